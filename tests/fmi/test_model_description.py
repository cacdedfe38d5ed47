"""What a model description says of each variable and of its structure, in both versions of FMI, and the tables beside it."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import pytest

import gearlib as gl
from gearlib.fmi.exported_model import exported_model
from gearlib.fmi.fmu_variables import fmu_variables
from gearlib.fmi.model_description import Description, description_2, description_3, unit_definitions
from gearlib.fmi.model_source import model_source
from gearlib.fmi.model_tables import model_tables


class Both(gl.Component):
    """Every kind of variable that an FMU has."""

    k = gl.Parameter("N.m/rad", "stiffness", default=2.0, min=0.5)
    double = gl.Parameter("N.m/rad", "twice", default=lambda c: 2 * c.k, max=50)
    m = gl.Parameter("kg.m2", "inertia", default=1.0)
    u = gl.Input("rad", "angle asked for")
    x = gl.Variable("rad", "angle", start=0.5, nominal=3.0, min=-1.0)
    w = gl.Variable("rad/s", "speed", start=2)
    y = gl.Variable("N.m", "torque")
    n = gl.Discrete("count", start=4)

    def equations(self) -> Any:
        count = gl.When(self.x > 1, gl.Eq(self.n, gl.pre(self.n) + 1))
        moving = gl.Eq(gl.der(self.x), self.w), gl.Eq(self.m * gl.der(self.w), self.y)
        return [*moving, gl.Eq(self.y, self.double * (self.u - self.x)), count]


class Still(gl.Component):
    """No state: a sum of two inputs."""

    u, v = gl.Input("any"), gl.Input("any")
    y = gl.Variable("any")

    def equations(self) -> Any:
        return [gl.Eq(self.y, self.u + 2 * self.v)]


def described(component: gl.Component, outputs: list[str] | None, kinds: tuple[str, ...] = ("me", "cs"), **given: Any) -> Any:
    """The description, the exported model, and its source."""
    exported = exported_model(gl.compile(component, outputs).translation, given.get("parameters"), given.get("inputs"), None)
    source = model_source(exported)
    variables = fmu_variables(exported, source.n_roots)
    made = Description("Name", "identifier", "token", "Text.", "gearlib 1", kinds, 1e-6, 2.5, variables, source.pattern)
    return made, exported, source


@pytest.fixture(scope="module")
def both() -> Any:
    return described(Both(), ["y", "x", "n", "der(w)"], parameters={"k": 3.0}, inputs={"u": 0.25})


EXPECTED = {  # reference, causality, variability, initial, unit, description, start, lower, upper, nominal, state of a derivative
    "time": (0, "independent", "continuous", "", "s", "time", None, None, None, None, None),
    "k": (1, "parameter", "tunable", "exact", "N.m/rad", "stiffness", 3.0, 0.5, None, None, None),
    "double": (2, "calculatedParameter", "tunable", "calculated", "N.m/rad", "twice", None, None, 50.0, None, None),
    "m": (3, "parameter", "tunable", "exact", "kg.m2", "inertia", 1.0, None, None, None, None),
    "u": (4, "input", "continuous", "", "rad", "angle asked for", 0.25, None, None, None, None),
    "x": (5, "output", "continuous", "exact", "rad", "angle", 0.5, -1.0, None, 3.0, None),
    "w": (6, "local", "continuous", "exact", "rad/s", "speed", 2.0, None, None, None, None),
    "der(x)": (7, "local", "continuous", "calculated", "rad/s", "derivative of angle", None, None, None, None, "x"),
    "der(w)": (8, "output", "continuous", "calculated", "rad/s2", "derivative of speed", None, None, None, None, "w"),
    "y": (9, "output", "continuous", "calculated", "N.m", "torque", None, None, None, None, None),
    "n": (10, "output", "discrete", "calculated", "", "", None, None, None, None, None),
    "event_indicators[0]": (11, "local", "continuous", "calculated", "", "event indicator", None, None, None, None, None),
}
NAMES = list(EXPECTED)
DEPENDS = {"der(x)": {"w"}, "der(w)": {"x", "u"}, "y": {"x", "u"}}  # outputs and derivatives, where FMI asks for it
UNKNOWN = {"double", "der(x)", "der(w)", "y", "n"}
SHOWN = {"rad": "deg", "rad/s": "rev/min"}


def number(text: str | None) -> float | None:
    return None if text is None else float(text)


def test_the_derivative_of_the_first_variable_has_its_unit() -> None:
    class One(gl.Component):
        x = gl.Variable("rad", "angle")

        def equations(self) -> Any:
            return [gl.Eq(gl.der(self.x), 1.0)]

    found = {v.name: (v.unit, v.description) for v in described(One(), None)[0].variables.listed}
    assert found["der(x)"] == ("rad/s", "derivative of angle")


def test_derivatives_are_described_by_their_order() -> None:
    class Third(gl.Component):
        x = gl.Variable("rad", "angle", start=0.0)
        k = gl.Parameter("1/s3", default=1.0)

        def equations(self) -> Any:
            return [gl.Eq(gl.der(gl.der(gl.der(self.x))), -self.k * self.x)]

    listed = described(Third(), None)[0].variables.listed
    assert {v.name: (v.unit, v.description) for v in listed if v.unit.startswith("rad")} == {
        "x": ("rad", "angle"),
        "der(x)": ("rad/s", "derivative of angle"),
        "der(x,2)": ("rad/s2", "second derivative of angle"),
        "der(x,3)": ("rad/s3", "3. derivative of angle"),
    }


def test_the_first_variable_as_an_output_has_its_unit() -> None:
    class Two(gl.Component):
        y, x = gl.Variable("N.m", "torque"), gl.Variable("rad", "angle")

        def equations(self) -> Any:
            return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(self.y, gl.sin(self.x) * self.torque)]

        torque = gl.Parameter("N.m", default=2.0)

    outputs = [v for v in described(Two(), ["y"])[0].variables.listed if v.causality == "output"]
    assert [(v.name, v.unit, v.description) for v in outputs] == [("y", "N.m", "torque")]


def test_variables_and_structure_in_fmi_3(both: Any) -> None:
    root = ElementTree.fromstring(description_3(both[0]))
    found = {e.get("name", ""): e for e in root.findall("ModelVariables/*")}
    assert list(found) == NAMES
    for name, expected in EXPECTED.items():
        e = found[name]
        derivative = e.get("derivative")
        assert (
            int(e.get("valueReference", "")), e.get("causality"), e.get("variability"), e.get("initial", ""), e.get("unit", ""),
            e.get("description", ""), *(number(e.get(key)) for key in ("start", "min", "max", "nominal")),
            None if derivative is None else NAMES[int(derivative)],
        ) == expected  # fmt: skip
        assert e.get("displayUnit") == SHOWN.get(e.get("unit", ""))
        assert e.get("intermediateUpdate") == ("true" if name == "u" else None)
    structure = [
        (e.tag, NAMES[int(e.get("valueReference", ""))], e.get("dependencies")) for e in root.findall("ModelStructure/*")
    ]
    assert [name for tag, name, _ in structure if tag == "Output"] == ["x", "der(w)", "y", "n"]
    assert [name for tag, name, _ in structure if tag == "ContinuousStateDerivative"] == ["der(x)", "der(w)"]
    assert {name for tag, name, _ in structure if tag == "InitialUnknown"} == UNKNOWN
    assert [name for tag, name, _ in structure if tag == "EventIndicator"] == ["event_indicators[0]"]
    for tag, name, on in structure:
        if tag in ("Output", "ContinuousStateDerivative"):
            assert (None if on is None else {NAMES[int(k)] for k in on.split()}) == DEPENDS.get(name)


def test_variables_and_structure_in_fmi_2(both: Any) -> None:
    """Positions count from 1, and event indicators are no variables."""
    root = ElementTree.fromstring(description_2(both[0]))
    names = NAMES[:-1]
    found = list(root.findall("ModelVariables/*"))
    assert [e.get("name") for e in found] == names
    for e in found:
        (real,) = e
        derivative = real.get("derivative")
        assert (
            int(e.get("valueReference", "")), e.get("causality"), e.get("variability"), e.get("initial", ""), real.get("unit", ""),
            e.get("description", ""), *(number(real.get(key)) for key in ("start", "min", "max", "nominal")),
            None if derivative is None else names[int(derivative) - 1],
        ) == EXPECTED[e.get("name", "")]  # fmt: skip
        assert real.get("description") is None
    groups = {
        group.tag: {names[int(e.get("index", "")) - 1]: e.get("dependencies") for e in group}
        for group in root.findall("ModelStructure/*")
    }
    assert list(groups["Outputs"]) == ["x", "der(w)", "y", "n"]
    assert list(groups["Derivatives"]) == ["der(x)", "der(w)"]
    assert set(groups["InitialUnknowns"]) == UNKNOWN
    assert set(groups["InitialUnknowns"].values()) == {None}
    for name, on in (groups["Outputs"] | groups["Derivatives"]).items():
        assert (None if on is None else {names[int(k) - 1] for k in on.split()}) == DEPENDS.get(name)
    assert (root.get("numberOfEventIndicators"), root.get("guid")) == ("1", "token")


@pytest.mark.parametrize(("describe", "version"), [(description_3, "3.0"), (description_2, "2.0")])
@pytest.mark.parametrize("kinds", [("me",), ("cs",), ("cs", "me")])
def test_what_is_said_of_the_whole(describe: Any, version: str, kinds: tuple[str, ...]) -> None:
    root = ElementTree.fromstring(describe(described(Still(), ["y"], kinds)[0]))
    assert (root.get("fmiVersion"), root.get("modelName"), root.get("description"), root.get("generationTool")) == (
        version, "Name", "Text.", "gearlib 1",
    )  # fmt: skip
    assert root.get("guid" if version == "2.0" else "instantiationToken") == "token"
    assert root.get("variableNamingConvention") == "structured"
    assert {e.tag for e in root} & {"ModelExchange", "CoSimulation"} == {
        {"me": "ModelExchange", "cs": "CoSimulation"}[kind] for kind in kinds
    }
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    assert experiment.attrib == {"startTime": "0", "stopTime": "2.5", "tolerance": "1e-06"}
    moving = [e.get("name") for e in root.iter("Float64") if e.get("intermediateUpdate") == "true"]
    assert moving == (["u", "v"] if version == "3.0" and "cs" in kinds else [])
    for element in (*root.iter("ModelExchange"), *root.iter("CoSimulation")):
        assert set(element.attrib.values()) == {"identifier", "true"}
        assert ("needsCompletedIntegratorStep" in element.attrib) == (version == "3.0" and element.tag == "ModelExchange")


def test_a_model_without_states_has_one_that_stands_still() -> None:
    """As FMI 2.0 tools expect one; outputs depend on the inputs alone."""
    made, exported, _ = described(Still(), ["y"])
    variables = {v.name: v for v in made.variables.listed}
    assert list(variables) == ["time", "u", "v", "no_state", "der(no_state)", "y"]
    assert (variables["no_state"].start, variables["no_state"].initial, variables["no_state"].causality) == (
        0.0,
        "exact",
        "local",
    )
    assert variables["der(no_state)"].derivative == variables["no_state"].reference
    assert made.variables.columns == made.variables.inputs == (1, 2)
    assert made.dependencies() == {variables["y"].reference: [1, 2]}
    assert exported.own_starts == ()


@pytest.mark.parametrize(("name", "naming"), [("u", "structured"), ("ω", "flat")])
def test_names_that_are_not_structured_are_said_to_be_flat(name: str, naming: str) -> None:
    kind = type("Odd", (gl.Component,), {name: gl.Input("any"), "y": gl.Variable("any"),
                "equations": lambda self: [gl.Eq(self.y, getattr(self, name))]})  # fmt: skip
    assert described(kind(), ["y"])[0].naming == naming


@pytest.mark.parametrize(
    ("unit", "base"),
    [
        ("N.m/rad", {"kg": "1", "m": "2", "s": "-2", "rad": "-1"}),
        ("rad2", {"rad": "2"}),
        ("rad/s2", {"rad": "1", "s": "-2"}),
        ("N.m.s/rad", {"kg": "1", "m": "2", "s": "-1", "rad": "-1"}),
        ("W/(m2.K)", {"kg": "1", "s": "-3", "K": "-1"}),
        ("m/(s.rad2)", {"m": "1", "s": "-1", "rad": "-2"}),
        ("K", {"K": "1"}),
    ],
)
def test_units_by_their_base_units(unit: str, base: dict[str, str]) -> None:
    root = ElementTree.Element("UnitDefinitions")
    unit_definitions(root, [unit, "1", "any", "", unit])
    (found,) = root
    assert (found.get("name"), found[0].attrib) == (unit, base)
    shown = [(e.get("name"), float(e.get("factor", "")), e.get("offset")) for e in found[1:]]
    assert shown == ([("degC", 1.0, "-273.15")] if unit == "K" else [])


class Cooling(gl.Component):
    T, dT = gl.Input("K", "temperature"), gl.Variable("K", "above the room")

    def equations(self) -> Any:
        return [gl.Eq(self.dT, self.T - 293.15)]


def test_differences_of_temperatures_are_not_shown_from_273_degrees_below() -> None:
    root = ElementTree.fromstring(description_3(described(Cooling(), ["dT"])[0]))
    variables = {e.get("name"): e for e in root.findall("ModelVariables/*")}
    assert {variables[name].get("unit") for name in ("T", "dT")} == {"K"}
    assert "displayUnit" not in variables["dT"].attrib


def test_a_state_that_is_the_derivative_of_another_is_not_declared_twice() -> None:
    class Swing(gl.Component):
        x = gl.Variable("any", start=1.0)

        def equations(self) -> Any:
            return [gl.Eq(gl.der(gl.der(self.x)), -self.x)]

    made, exported, _ = described(Swing(), ["x"])
    assert {order for _, order in exported.scene.states} == {0, 1}
    root = ElementTree.fromstring(description_3(made))
    names = {v.get("valueReference"): v.get("name") for v in root.findall("ModelVariables/*")}
    derived = {v.get("name"): names[v.get("derivative")] for v in root.findall("ModelVariables/*") if v.get("derivative")}
    assert derived == {"der(x)": "x", "der(x,2)": "der(x)"}
    rates = [names[e.get("valueReference")] for e in root.findall("ModelStructure/ContinuousStateDerivative")]
    assert sorted(map(str, rates)) == ["der(x)", "der(x,2)"]


def test_places_are_whole_numbers_in_c_and_values_are_not() -> None:
    class Decay(gl.Component):
        x = gl.Variable("1", start=1.0)

        def equations(self) -> Any:
            return [gl.Eq(gl.der(self.x), -self.x)]

    _, exported, source = described(Decay(), ["x"])
    text = model_tables(exported, source, "", 1e-5, 3.0)
    assert re.search(r"int64_t rows\[\] = \{\s*0, 1\s*\}", text)
    assert re.search(r"double nominal\[\] = \{\s*1\.0\s*\}", text)


def test_tables_of_the_wrapper(both: Any) -> None:
    """In C: places and signs of what is set and got, sizes, and text with its special bytes escaped."""
    made, exported, source = both
    text = model_tables(exported, source, 'a"\\?ω', 1e-5, 3.0)
    arrays = {name: [item.strip() for item in body.split(",") if item.strip()]
              for name, body in re.findall(r"^static const [^\n]*?(\w+)\[\] = \{\n(.*?)\n\};", text, re.MULTILINE | re.DOTALL)}  # fmt: skip
    numbers = dict(re.findall(r"^    \.(\w+) = (.*),$", text, re.MULTILINE))
    assert numbers["token"] == r'"a\042\134\077\317\211"'
    assert (numbers["tolerance"], numbers["stop_time"], numbers["driven"], numbers["has_events"]) == ("1e-05", "3.0", "0", "1")
    counts = {
        "n_parameters": 3,
        "n_inputs": 1,
        "n_states": 2,
        "n_equations": 2,
        "n_outputs": 2,
        "n_indicators": 1,
        "n_observed": 4,
    }
    assert {name: int(numbers[name]) for name in counts} == counts
    assert (arrays["settable"], arrays["start_settable"]) == (["1", "0", "1"], ["1", "1"]), (
        "what follows from others is not set"
    )
    assert (arrays["lower"], arrays["upper"]) == (["0.5", "-INFINITY", "-INFINITY"], ["INFINITY", "50.0", "INFINITY"])
    assert (arrays["nominal"], arrays["parameter_names"]) == (["3.0", "1.0"], ['"k"', '"double"', '"m"'])
    assert (arrays["output_signs"], arrays["output_slots"], arrays["output_discrete"][0]) == (["1.0", "1.0"], ["2", "-1"], "-1")
    assert len(arrays["data"]) == int(numbers["n_data"]) == len(source.data) + 1
    assert [float(arrays["data"][int(p)]) for p in arrays["parameter_places"]] == pytest.approx([3.0, 6.0, 1.0])
    assert [float(arrays["data"][int(p)]) for p in arrays["input_places"]] == [0.25]
    assert float(arrays["data"][int(numbers["discrete_at"]) + int(arrays["output_discrete"][1])]) == 4.0
    assert int(numbers["inputs_at"]) == int(numbers["discrete_at"]) + int(numbers["n_discrete"])
    assert [int(k) for k in arrays["index"]] == source.index.tolist()
    assert len(arrays["rows"]) == int(numbers["n_entries"]) == int(arrays["columns"][-1])
    assert all(len(line.split(", ")) <= 12 for line in text.splitlines() if re.match(r"    [-\d]", line))
    assert made.variables.observed == {7: 0, 8: 1, 9: 2}


def test_tables_of_least_values() -> None:
    """Each bound with its sign, size and name, the slot of what is observed, and the states that it is computed from."""

    class Tanks(gl.Component):
        x, y, z = gl.Variable("1", start=1.0), gl.Variable("1", start=2.0), gl.Variable("1", start=3.0)
        level = gl.Variable("1", min=0.5)
        turned = gl.Variable("1", nominal=7.0)
        depth = gl.Variable("1", min=-2.0, nominal=7.0)

        def equations(self) -> Any:
            rates = [gl.Eq(gl.der(v), -v) for v in (self.x, self.y, self.z)]
            return [*rates, gl.Eq(self.level, self.x + self.z), gl.Eq(self.depth, -self.turned), gl.Eq(self.turned, 2 * self.y)]

    _, exported, source = described(Tanks(), ["x", "y", "z"])
    text = model_tables(exported, source, "", 1e-5, 3.0)
    arrays = {name: body.split(", ") for name, body in re.findall(r"bound_(\w+)\[\] = \{\s*(.*?)\s*\}", text)}
    states = list(exported.scene.state_names)
    bounds = {}
    for k, name in enumerate(arrays["names"]):
        places = arrays["states"][int(arrays["from"][k]) : int(arrays["from"][k + 1])]
        node = exported.observed.outputs[int(arrays["slots"][k])]
        numbers = [float(arrays[kind][k]) for kind in ("signs", "least", "sizes")]
        bounds[name] = (exported.model.name(node[0]), *numbers, {states[int(place)] for place in places})
    assert bounds.pop('"level"') == ("level", 1.0, 0.5, 1.0, {"x", "z"})
    assert bounds in ({'"depth"': (name, sign, -2.0, 7.0, {"y"})} for name, sign in (("depth", 1.0), ("turned", -1.0)))
    assert len(arrays["from"]) == 3
    assert re.search(r"\.n_bounds = 2,", text)
