"""Everything public, with every wrong kind of argument: refused by name, or right; never a foreign exception, a hang or a NaN."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib import bondgraph as bg
from tests.stress.misuse import ANSWERED, NOT_FINITE, RAW, REFUSED, UNNAMED, WRONG, Call, Hostile, misuses, outcome
from tests.stress.misused_calls import GROUPS, run, system
from tests.stress.modelica_texts import GOOD, READ, REFUSED_TEXT, judged, variants

NO_ARGUMENTS = {"GearlibError", "GearlibWarning", "InputWarning", "pi", "time"}  # an exception, warnings and two symbols
MADE_BY_ANALYSES = {
    "Campbell", "EnergyBalance", "FrequencyResponse", "HarmonicBalance", "Modes", "OrderSpectrum", "OrderWaterfall", "PowerFlow",
    "Fit", "Result", "Passivity", "Runs", "ModeSensitivity", "StabilitySensitivity", "SteadyState",
    "StabilityReport", "System", "Bond", "Causality", "StateEquations", "PlanetPhasing", "StiffnessPattern", "StiffnessLaw",
}  # fmt: skip
CONNECTORS = {"Flange", "HeatPort", "PlanarFlange", "TranslationalFlange"}  # as Connector
ABSTRACT = {"BondGraphPart", "Method", "ExplicitStepper"}

pytestmark = pytest.mark.filterwarnings("ignore::gearlib.errors.InputWarning")  # of inputs that nobody gave, among all else


@pytest.fixture(autouse=True)
def no_figures() -> Iterator[None]:
    yield
    plt.close("all")


def test_everything_public_is_misused() -> None:
    called = {call.name.split(".")[0].split(" ")[0].rstrip("[]()") for make in GROUPS.values() for call in make()}
    public = {name for module in (gl, gp, bg) for name in module.__all__}
    assert public - called - NO_ARGUMENTS - MADE_BY_ANALYSES - CONNECTORS - ABSTRACT == set()


def test_methods_of_what_comes_back_are_misused() -> None:
    names = {call.name for call in GROUPS["methods"]()}
    for kind in (
        gl.Result,
        gl.Modes,
        gl.Campbell,
        gl.Fit,
        gl.FrequencyResponse,
        gl.HarmonicBalance,
        gl.OrderSpectrum,
        gl.PowerFlow,
        gl.Runs,
        gl.SteppedRun,
    ):
        own = {name for name, value in vars(kind).items() if callable(value) and not name.startswith("_")}
        assert {f"{kind.__name__}.{name}" for name in own} <= names, kind


def wrong_kinds() -> dict[str, Any]:
    chosen = (
        "None", "True", "text", "nan", "-1", "0", "1e308", "10**400", "10**5000", "1+1j", "Decimal NaN", "huge Fraction", "sympy nan",
        "sympy expression", "timedelta", "[]", "[1, nan]", "[2, 1]", "['a']", "[10**400]", "array 0d", "array 2d", "array complex",
        "array object", "used up", "map", "{1: 2}", "a mapping that fails", "{load.w: hostile}", "hostile", "[hostile]", "unequal",
        "class", "component", "raises", "returns nan",
    )  # fmt: skip
    return {name: WRONG[name] for name in chosen}


SLOW = {"simulate", "harmonic_balance", "Energy", "draw", "bode_plot", "nichols_plot", "nyquist_plot", "root_locus_plot"}


@pytest.mark.parametrize("group", sorted(set(GROUPS) - {"plots"}))
def test_a_part_of_the_misuses(group: str) -> None:
    """A few cases of each call, of the most telling kinds; all of them are in `test_all_misuses`."""
    step = {"components": 97, "methods": 13, "analyses": 37}.get(group, 11)
    calls = [call for call in GROUPS[group]() if call.name not in SLOW]
    short = [str(o) for n, call in enumerate(calls) for o in misuses(call, wrong_kinds(), n % step, step) if o.short]
    plt.close("all")
    assert not short, "\n".join(short)


DEAR = SLOW - {"harmonic_balance"} | {
    "sweep",
    "frequency_response of a model",
    "transmission_error_response",
    "System.export_fmu",
}


@pytest.mark.parametrize("group", sorted(set(GROUPS) - {"plots", "components"}))
def test_right_arguments_are_answered(group: str) -> None:
    """What the misuses spoil, as it is meant."""
    found = [outcome(call, {}, "as meant", usual=False) for call in GROUPS[group]() if call.name not in DEAR]
    plt.close("all")
    short = [str(one) for one in found if one.kind != ANSWERED]
    assert not short, "\n".join(short)


@pytest.mark.stress
@pytest.mark.parametrize("group", sorted(GROUPS))
def test_all_misuses(group: str, capfd: pytest.CaptureFixture[str]) -> None:
    short: list[str] = []
    kinds: Counter[str] = Counter()
    for call in GROUPS[group]():
        for found in misuses(call):
            plt.close("all")
            kinds[found.kind] += 1
            short += [str(found)] if found.short else []
    assert not capfd.readouterr().err
    assert not short, "\n".join(short)
    assert kinds[REFUSED] > kinds[ANSWERED]


@pytest.mark.stress
@seed(11)
@settings(max_examples=2000, deadline=None, database=None)
@given(data=st.data())
def test_two_wrong_arguments_at_a_time(data: st.DataObject) -> None:
    group = data.draw(st.sampled_from(sorted(set(GROUPS) - {"plots", "components"})))
    calls = [call for call in all_calls(group) if len(call.places()) > 1]
    call = data.draw(st.sampled_from(calls))
    places = data.draw(st.lists(st.sampled_from(call.places()), min_size=2, max_size=2, unique=True))
    labels = [data.draw(st.sampled_from(sorted(WRONG))) for _ in places]
    wrong = {place: WRONG[label] for place, label in zip(places, labels, strict=True)}
    found = outcome(call, wrong, ", ".join(f"{p} = {v}" for p, v in zip(places, labels, strict=True)), usual=False)
    plt.close("all")
    assert not found.short, str(found)


_known: dict[str, list[Call]] = {}


def all_calls(group: str) -> list[Call]:
    if group not in _known:
        _known[group] = GROUPS[group]()
    return _known[group]


# ---------------------------------------------------------------- the judge itself


def test_the_judge_tells_what_falls_short() -> None:
    def asked(function: Any) -> str:
        return outcome(Call("f", function, lambda: {"x": 1.0}), {"x": lambda: "wrong"}, "x", usual=True).kind

    def refuse(x: Any, text: str) -> None:
        raise gl.GearlibError(text)

    assert asked(lambda x: [][1]) == RAW
    assert asked(lambda x: np.array([1.0, np.nan])) == NOT_FINITE
    assert asked(lambda x: np.float64(1.0) / np.float64(0.0)) == RAW  # a warning of numpy's
    assert asked(lambda x: refuse(x, "no")) == UNNAMED
    assert asked(lambda x: refuse(x, "x is 'wrong'; expected a number")) == REFUSED
    assert asked(lambda x: 1.0) == ANSWERED


def test_hostile_objects_are_refused() -> None:
    with pytest.raises(gl.GearlibError, match="t_end is a Hostile that cannot be printed; expected a finite number of seconds"):
        system().simulate(Hostile())  # type: ignore[arg-type]
    with pytest.raises(gl.GearlibError, match=r"outputs is a Hostile that cannot be printed; expected a list of names"):
        gl.compile(system().translation.component, Hostile())  # type: ignore[arg-type]


def test_what_is_a_number_is_taken_as_one() -> None:
    from fractions import Fraction

    import sympy

    driven = {"torque.tau": 1.0}
    right = system().simulate(0.5, samples=3, parameters={"load.J": 0.5}, inputs=driven)["load.w"]
    for half in (Fraction(1, 2), sympy.Rational(1, 2), np.float32(0.5), np.float64(0.5)):
        found = system().simulate(half, samples=3, parameters={"load.J": half}, inputs=driven)["load.w"]
        assert np.array_equal(found, right), half
    assert gl.Table([0, 1], [0, Fraction(1, 2)])(0.5) == 0.25
    assert run().time[-1] == 10.0


def test_intervals_that_are_no_intervals() -> None:
    for t_end in (5e-324, 1e308):
        with pytest.raises(gl.GearlibError, match=r"t_end is .*; expected 1e-200 to 1e\+200 s"):
            system().simulate(t_end, method="rk")
    with pytest.raises(gl.GearlibError, match="are not distinct in double precision"):
        system().simulate(1e9 + 1e-6, t_start=1e9, samples=1000)


@pytest.mark.parametrize(
    ("name", "place", "kinds"),
    [
        ("PlanetaryUnit", "planets", ("10**400", "timedelta")),
        ("PlanarPlanetaryUnit", "planets", ("10**400",)),
        ("XXTrain", "planets", ("10**5000", "0")),
        ("TorsionalShaft", "segments", ("10**400",)),
        ("DetailedExternalMesh", "contact_ratio", ("1e308",)),
        ("FixedAxisUnit", "details", ("[2, 1]", "['a']", "array 2d", "[hostile]")),
        ("XPTrain", "pair_details", ("[2, 1]",)),
        ("ZhouCui2022", "K_s", ("array 2d", "hostile", "Decimal NaN")),
    ],
)
def test_choices_of_parts_are_refused_by_name(name: str, place: str, kinds: tuple[str, ...]) -> None:
    call = next(call for call in all_calls("components") if call.name == name)
    short = [str(o) for kind in kinds if (o := outcome(call, {place: WRONG[kind]}, f"{place} = {kind}", usual=False)).short]
    assert not short, "\n".join(short)


def test_any_text_of_modelica_is_read_or_refused() -> None:
    """With words left out, doubled, or replaced by what does not belong there."""
    assert judged(GOOD) == READ
    found = Counter[str]()
    for text in variants(1, 150):
        try:
            found[judged(text)] += 1
        except Exception as problem:
            pytest.fail(f"{type(problem).__name__}: {problem} of\n{text}")
    assert min(found[READ], found[REFUSED_TEXT]) >= 5


def test_a_wrong_name_leaves_no_figure() -> None:
    with pytest.raises(gl.GearlibError, match="nonsense"):
        run().plot("load.w", "nonsense")
    assert not plt.get_fignums()


def test_a_sensor_alone_says_what_is_missing() -> None:
    class Alone(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.part = gp.AngleSensor()
            return []

    with pytest.raises(gl.GearlibError, match=r"part\.flange is connected to nothing; connect it"):
        gl.compile(Alone())
