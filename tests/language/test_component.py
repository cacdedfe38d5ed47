"""Composites: parts, families, paths, and how they go wrong."""

from __future__ import annotations

import copy
import pickle
from collections import UserDict
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError, BindingError, ConnectionError, DeclarationError, ModelError
from gearlib.language.component import (
    Connection,
    changed,
    check_declarations,
    enclosing,
    energies_of,
    equations_of,
    evaluated_in,
    given_to,
    inside,
    name_of,
    reads_of,
    signals_of,
    with_parts,
)
from gearlib.language.declarations import NO_VALUE
from gearlib.language.expressions import real_symbol as signal
from gearlib.language.interior import connections_of, forget, number_of, parts_of, path_of, radii_of

c = gl.connect


def body() -> gp.Inertia:
    return gp.Inertia(J=1.0)


def composite(assemble: Callable[[Any], Any], **members: Any) -> gl.Component:
    made: gl.Component = type("Model", (gl.Component,), {"assemble": assemble, **members})()
    return made


def test_parts_are_reached_before_and_after_compiling() -> None:
    def assemble(self: Any) -> list[Any]:
        self.planets = [body() for _ in range(3)]
        self.load = gp.Inertia(J=self.J)
        return [c(self.planets[2].flange_b, self.load.flange_a)]

    model = composite(assemble, J=gl.Parameter("kg.m2", "inertia", default=2.0))
    assert repr(model.planets[2]) == "<Inertia planets[2]>"
    assert gl.compile(model, outputs=["load.w"]).states == ("planets[2].w",)
    assert "planets[2].w" in gl.compile(model).variables


def test_compiling_twice_gives_the_same() -> None:
    model = composite(lambda self: setattr(self, "body", body()) or [])
    assert gl.compile(model).states == gl.compile(model).states == ("body.w",)


@pytest.mark.parametrize(
    ("assemble", "error", "message"),
    [
        (lambda s: None, ModelError, r"Model\.assemble\(\) must return a list of connect\(\.\.\.\) calls; got None"),
        (lambda s: [3], ModelError, r"must return a list of connect\(\.\.\.\) calls; got 3"),
        (
            lambda s: setattr(s, "a", gp.Inertia) or [],
            ModelError,
            r"Model\.a is the class Inertia; make an instance: Inertia\(",
        ),
        (
            lambda s: setattr(s, "a", [body(), 3]) or [],
            ModelError,
            r"Model\.a\[1\] is 3; a family of parts holds components only",
        ),
        (
            lambda s: setattr(s, "a", [body()] * 2) or [],
            ModelError,
            r"Model\.a\[1\]: this Inertia already is the part 'a\[0\]'",
        ),
        (lambda s: setattr(s, "a", s) or [], ModelError, r"Model\.a: a component cannot be a part of itself"),
        (lambda s: setattr(s, "x", 3) or [], DeclarationError, r"Model\.x is declared by the class.*Model\(x=\.\.\.\)"),
    ],
)
def test_slips_in_assemble(assemble: Callable[[Any], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        gl.compile(composite(assemble, x=gl.Variable("m", "x")))


def test_a_single_connection_is_no_list() -> None:
    def assemble(self: Any) -> Any:
        self.a, self.b = body(), body()
        return c(self.a.flange_b, self.b.flange_a)

    with pytest.raises(ModelError, match=r"must return a list of connect\(\.\.\.\) calls; got Connection"):
        gl.compile(composite(assemble))


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        (lambda s: (s.a, s.b), r"joins connectors, such as motor\.flange_b; got <Inertia a> \(name one of its connectors\)"),
        (lambda s: (s.a.w, s.b.w), r"joins the signals a\.w, b\.w, each of which has a value of its own"),
        (lambda s: (s.a.flange_a, "b.flange_a"), r"joins connectors, such as motor\.flange_b; got 'b\.flange_a'"),
        (lambda s: (s.a.flange_a,), r"connect\(\) needs two connectors, got 1"),
        (lambda s: (s.a.flange_a, s.a.flange_a), r"a\.flange_a is connected to itself"),
        (
            lambda s: (s.a.flange_a, s.mass.flange_a),
            r"cannot connect a\.flange_a \(Flange\) to mass\.flange_a \(TranslationalFlange\): connectors of different kinds",
        ),
        (lambda s: (s.gear.support, s.a.flange_a), r"gear has no 'support' here; make it with use_support=True"),
        (
            lambda s: (s.a.flange_a, body().flange_a),
            r"Model: connects Inertia 'flange_a', which is not part of it; assign the part",
        ),
        (lambda s: (s.a.flange_a, OTHER.motor.flange_a), r"connects Inertia 'motor\.flange_a', which is not part of it"),
    ],
)
def test_wrong_connections(ports: Callable[[Any], Any], message: str) -> None:
    class Rod(gl.Component):
        flange_a = gp.TranslationalFlange("end")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.flange_a.s, 0)]

    def assemble(self: Any) -> list[Any]:
        self.a, self.b, self.gear, self.mass = body(), body(), gp.IdealGear(ratio=2.0), Rod()
        return [c(*ports(self))]

    with pytest.raises(ConnectionError, match=message):
        gl.compile(composite(assemble))


class Other(gl.Component):
    def assemble(self) -> list[Any]:
        self.motor = body()
        return []


OTHER = Other()


def test_part_of_another_model() -> None:
    with pytest.raises(
        ModelError, match=r"Model\.m: this Inertia already is the part 'motor' of another component; make a new one"
    ):
        gl.compile(composite(lambda s: setattr(s, "m", OTHER.motor) or []))


def test_a_list_is_assigned_after_it_is_filled() -> None:
    def assemble(self: Any) -> list[Any]:
        self.bodies = []
        for _ in range(2):
            self.bodies.append(body())
        return [c(self.bodies[0].flange_b, self.bodies[1].flange_a)]

    with pytest.raises(ConnectionError, match="a list after it is filled"):
        gl.compile(composite(assemble))


def test_misspelt_attributes_are_advised() -> None:
    model = composite(lambda s: setattr(s, "load", body()) or [])
    with pytest.raises(AttributeError, match=r"Model has no 'laod'; did you mean 'load'\?"):
        model.laod  # noqa: B018
    with pytest.raises(AttributeError, match=r"Inertia has no 'flange_c'; did you mean 'flange_"):
        model.load.flange_c  # noqa: B018


def test_a_component_of_its_own_class_without_end() -> None:
    class Nest(gl.Component):
        def assemble(self) -> list[Any]:
            self.inner = Nest()
            return []

    with pytest.raises(ModelError, match=r"inner\.inner.*does Nest make a part of its own class without end"):
        gl.compile(Nest())


def test_forgotten_super_init() -> None:
    class Own(gl.Component):
        def __init__(self) -> None:
            self.load = body()

    with pytest.raises(ModelError, match=r"Own\.__init__\(\) must call super\(\)\.__init__\(\)"):
        Own()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gp.Inertia(1.0), r"Inertia\(1\.0\): give values by name, such as Inertia\(J=\.\.\.\)"),
        (lambda: gp.Inertia(J=1.0, j=2.0), "Inertia: 'j' is not a parameter, input or structural choice.*did you mean 'J'"),
        (lambda: gp.Inertia(J=1.0, w=2.0), r"Inertia: 'w' is a variable.*a start value is given as start=\{'w': \.\.\.\}"),
        (lambda: gp.Inertia(J=1.0, start=[1]), r"Inertia: start is \[1\]; expected start values by name"),
        (lambda: gp.Inertia(1.0, 2.0), r"^Inertia\(1\.0\): give values by name"),
        (lambda: gp.Inertia(J=1.0, start=[("w", 1.0)]), r"Inertia: start is \[\('w', 1\.0\)\]; expected start values by name"),
        (lambda: gp.Inertia(J=1.0, start="steady"), "Inertia: start is 'steady'; expected start values by name"),
        (lambda: gp.Inertia(J=1.0, guess=5), "Inertia: guess is 5; expected start values by name"),
    ],
)
def test_wrong_arguments_of_a_component(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        make()


@pytest.mark.parametrize(
    ("equations", "got"),
    [
        (lambda s: None, "got None"),
        (lambda s: gl.Eq(s.x, 1), r"got Eq\(left=x, right=1\)"),
        (lambda s: [s.x == 1], "got False"),
        (lambda s: [s.x - 1], "got x - 1"),
    ],
)
def test_equations_must_be_a_list_of_equations(equations: Callable[[Any], Any], got: str) -> None:
    leaf: gl.Component = type("Leaf", (gl.Component,), {"x": gl.Variable("m", "x"), "equations": equations})()
    with pytest.raises(DeclarationError, match=rf"Leaf\.equations\(\) must return a list of gl\.Eq\(left, right\); {got}"):
        gl.compile(leaf)


def test_equations_may_be_generated() -> None:
    leaf: gl.Component = type(
        "Leaf", (gl.Component,), {"x": gl.Variable("m", "x"), "equations": lambda s: (gl.Eq(s.x, n) for n in [7])}
    )()
    assert gl.compile(leaf).simulate(1.0, samples=2)["x"].tolist() == [7.0, 7.0]


def test_equations_of_a_composite_may_hold_its_parts_variables() -> None:
    other = body()

    def wrong(self: Any) -> list[gl.Eq]:
        return [gl.Eq(self.x, other.w)]

    with pytest.raises(ModelError, match="Model refers to a Inertia that is not part of it; assign it to an attribute first"):
        gl.compile(composite(lambda s: [], x=gl.Variable("rad/s", "x"), equations=wrong))


# ---------------------------------------------------------------- equations of bases


class Store(gl.Component):
    x = gl.Variable("1")
    rate = gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate)]


class Tap(Store):
    inflow = gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.inflow, 2.0)]


class Leak(Store):
    outflow = gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.outflow, 3.0 * self.x)]


class Tank(Tap, Leak):
    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.rate, self.inflow - self.outflow)]


def test_a_class_has_the_equations_of_all_its_bases_each_once() -> None:
    """A diamond: what both bases have in common is stated once; x = 2/3 (1 - exp(-3 t))."""
    left = [str(e.left) for e in equations_of(Tank()) if isinstance(e, gl.Eq)]
    assert sorted(left) == ["der(x)", "inflow", "outflow", "rate"]
    assert left[0] == "der(x)"  # bases first
    assert left[-1] == "rate"
    assert gl.simulate(Tank(), 1.0, samples=2, rtol=1e-10)["x"][-1] == pytest.approx(2 / 3 * (1 - np.exp(-3.0)), rel=1e-9)


def test_a_class_that_adds_nothing_has_its_base_s_equations() -> None:
    class Renamed(Tank):
        pass

    assert equations_of(Renamed()) == equations_of(Tank())


def test_a_base_s_equation_is_not_repeated() -> None:
    class Chained(Tap):
        def equations(self) -> list[gl.Eq]:
            return [*super().equations(), gl.Eq(self.rate, self.inflow)]

    with pytest.raises(
        DeclarationError,
        match=r"Chained\.equations\(\) repeats inflow = 2\.0 of its base Tap; .* without super\(\)\.equations\(\)",
    ):
        gl.compile(Chained())


def test_a_base_s_equation_cannot_be_replaced() -> None:
    class Other(Store):
        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), 2 * self.rate), gl.Eq(self.rate, 1)]

    with pytest.raises(BalanceError, match="too many"):
        gl.compile(Other())


def test_declarations_that_have_been_replaced_are_refused() -> None:
    """Of the class or of a base, also after the class has been found right; with what was declared it is right again."""

    class Base(gl.Component):
        k = gl.Parameter("1", "gain")

    class Kind(Base):
        m = gl.Parameter("kg", "mass")

    for owner, name in ((Kind, "m"), (Base, "k"), (Kind, "m")):
        check_declarations(Kind)
        declared = vars(owner)[name]
        setattr(owner, name, 3.0)
        for _ in range(2):
            with pytest.raises(
                DeclarationError, match=rf"^Kind\.{name} is 3\.0 where Parameter.* was declared; declare it in the body"
            ):
                check_declarations(Kind)
        setattr(owner, name, declared)
    check_declarations(Kind)
    Kind.more = gl.Parameter("m")  # type: ignore[attr-defined]
    with pytest.raises(
        DeclarationError, match=r"^Kind\.more was declared outside of a component class; declare it in the body"
    ):
        check_declarations(Kind)


def test_a_declaration_in_the_base_of_all_components_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl.Component, "stray", gl.Parameter("m"), raising=False)
    with pytest.raises(DeclarationError, match=r"^Store\.stray was declared outside of a component class"):
        check_declarations(Store)


def test_sides_that_have_no_hash_are_left_to_what_refuses_them() -> None:
    class Listed(Tap):
        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.rate, [1, 2])]

    assert [equation.right for equation in equations_of(Listed())][1:] == [2.0, [1, 2]]  # type: ignore[union-attr]
    with pytest.raises(DeclarationError, match=r"rate == \[1, 2\] is not an equation"):
        gl.compile(Listed())


def test_what_a_base_s_equations_return_is_named_by_its_class() -> None:
    class Wrong(gl.Component):
        def equations(self) -> Any:
            return 3

    class Derived(Wrong):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x, 1)]

    with pytest.raises(DeclarationError, match=r"^Wrong\.equations\(\) must return a list of gl\.Eq"):
        gl.compile(Derived())


def test_a_base_asks_its_derived_classes_for_a_method() -> None:
    class Law(Store):
        def law(self, x: Any) -> Any:
            raise NotImplementedError

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.rate, self.law(self.x))]

    class Decay(Law):
        k = gl.Parameter("1/s", default=2.0)

        def law(self, x: Any) -> Any:
            return -self.k * x

    found = gl.simulate(Decay(start={"x": 1.0}), 1.0, samples=2, rtol=1e-10)["x"][-1]
    assert found == pytest.approx(np.exp(-2.0), rel=1e-9)


# ---------------------------------------------------------------- names, values and parts of an instance


class Stage(gl.Component):
    """A body in a box, of which values follow from those of the stage."""

    size = gl.Parameter("m", default=2.0)
    mass = gl.Parameter("kg", default=lambda s: 3 * s.size)
    count = gl.Structural(2)
    flange = gp.Flange("outside")

    def assemble(self) -> list[Any]:
        self.bodies = [gp.Inertia(J=self.mass * self.size**2 + i) for i in range(self.count)]
        self.label = "plain"
        return [c(self.flange, *(b.flange_a for b in self.bodies))]


class Plant(gl.Component):
    scale = gl.Parameter("1", default=0.5)

    def assemble(self) -> list[Any]:
        self.stage = Stage(size=4 * self.scale, count=3)
        self.extra = gp.Inertia(J=self.stage.mass)
        return [c(self.stage.flange, self.extra.flange_a)]


def test_numbers_follow_from_what_encloses_a_part() -> None:
    plant = Plant()
    connections_of(plant)
    stage = plant.stage
    connections_of(stage)
    assert number_of(stage, "size") == 2.0
    assert [number_of(plant, "scale"), number_of(stage, "size"), number_of(stage, "mass"), number_of(stage, "count")] == [
        0.5,
        2.0,
        6.0,
        3.0,
    ]
    assert [number_of(b, "J") for b in stage.bodies] == [24.0, 25.0, 26.0]
    assert number_of(plant.extra, "J") == 6.0
    assert number_of(gp.Inertia(), "J") is None
    assert number_of(Stage(size=gl.time), "size") is None
    mesh = type("Mesh", (gl.Component,), {"r": gl.Parameter("m", default=0.2), "s": gl.Parameter("m"), "radii": ("r", "s")})()
    assert radii_of(mesh) == pytest.approx((0.2, np.nan), nan_ok=True)


@pytest.mark.parametrize("wrong", ["abc", "3", True, [1.0, 2.0], 10**400, float("nan"), 1j, gl.time, gl.sin])
def test_what_is_no_number_is_none_where_a_model_is_drawn(wrong: Any) -> None:
    """It is refused where the model is compiled; its picture is shown nevertheless."""
    gear = gp.IdealGear(ratio=wrong)
    assert number_of(gear, "ratio") is None
    assert np.isnan(radii_of(gear)).all()
    assert "<svg" in gear.diagram().svg
    with pytest.raises(gl.GearlibError):
        gl.compile(gear)


@pytest.mark.parametrize(("given", "value"), [(gl.pi / 2, np.pi / 2), (np.float32(2.5), 2.5), (gl.sqrt(2), 2**0.5), (3, 3.0)])
def test_numbers_of_other_kinds_are_floats(given: Any, value: float) -> None:
    found = number_of(gp.IdealGear(ratio=given), "ratio")
    assert (found, type(found)) == (pytest.approx(value, rel=1e-15), float)


@pytest.mark.parametrize("radii", [("nope",), ("r", "flange"), ("r", 3), "r", 3, None, ([],)])
def test_radii_are_names_of_parameters(radii: Any) -> None:
    members = {"icon": "external_mesh", "r": gl.Parameter("m", default=0.2), "flange": gp.Flange("side"), "radii": radii}
    for draw in (radii_of, lambda mesh: mesh.diagram(), lambda mesh: mesh.scheme()):
        with pytest.raises(Exception, match=r"^Mesh\.radii is .*; expected a tuple of names of its parameters$") as refused:
            draw(type("Mesh", (gl.Component,), members)())
        assert type(refused.value) is DeclarationError


def test_paths_parts_and_what_encloses_them() -> None:
    plant = Plant()
    connections_of(plant)
    for _, part in with_parts(plant):
        connections_of(part)
    found = dict(with_parts(plant))
    assert found.pop("") is plant
    assert list(found) == ["stage", "stage.bodies[0]", "stage.bodies[1]", "stage.bodies[2]", "extra"]
    for path, part in found.items():
        assert path_of(part) == path
        assert name_of(part) == path.rpartition(".")[2]
        assert repr(part) == f"<{type(part).__name__} {path}>"
    body = found["stage.bodies[1]"]
    assert list(enclosing(body)) == [plant.stage, plant]
    assert list(enclosing(plant)) == []
    assert path_of(body, plant.stage) == "bodies[1]"
    assert path_of(plant) == ""
    assert (repr(plant), repr(body.flange_a), repr(gp.Inertia(J=1.0).flange_b)) == (
        "<Plant>",
        "<Flange stage.bodies[1].flange_a>",
        "<Flange Inertia.flange_b>",
    )
    with pytest.raises(ModelError, match="Inertia refers to a Stage that is not part of it"):
        path_of(plant.stage, body)


def test_symbols_are_named_from_the_scope() -> None:
    plant = Plant()
    connections_of(plant)
    body = plant.stage.bodies[0]
    assert str(body.w) == "stage.bodies[0].w"
    with inside(plant.stage):
        assert (str(body.w), str(body.flange_a.tau), str(plant.stage.size)) == ("bodies[0].w", "bodies[0].flange_a.tau", "size")
    with inside(body):
        assert (str(body.w), str(body.J)) == ("w", "J")
    assert plant.scale == 0.5, "outside of any scope a parameter is what was given"
    assert evaluated_in(plant, lambda p: p.scale * 2) == 2 * gl.language.expressions.real_symbol("scale")
    assert evaluated_in(plant, 3.0) == 3.0
    assert evaluated_in(plant, NO_VALUE) is NO_VALUE
    assert evaluated_in(plant, Stage) is Stage


def test_choices_that_are_read_are_known() -> None:
    stage = Stage(count=1)
    with reads_of(stage) as reads:
        assert stage.count == 1
    assert reads == {"count"}
    assert stage._read == set()
    connections_of(stage)
    assert stage._read == {"count"}
    given = given_to(Stage(count=1, size=3.0, start={"x": 1}, nominal={"y": 2.0}, state={"z": "never"}))
    assert (given.values, given.choices, given.start, given.guess, given.nominal, given.state) == (
        {"size": 3.0}, {"count": 1}, {"x": 1}, {}, {"y": 2.0}, {"z": "never"},
    )  # fmt: skip


def test_pickled_composites_make_their_parts_again() -> None:
    stage = Stage(count=3)
    stage.own = gp.Inertia(J=7.0)  # assigned by hand
    stage.note = "mine"
    assert len(parts_of(stage)) == 1
    connections_of(stage)
    assert len(parts_of(stage)) == 4
    again = pickle.loads(pickle.dumps(stage))
    assert list(parts_of(again)) == ["own"]
    assert (again.note, again.own.J, "label" in again.__dict__) == ("mine", 7.0, False)
    assert again.label == "plain", "asked for, it is assembled"
    assert list(parts_of(again)) == ["own", "bodies[0]", "bodies[1]", "bodies[2]"]
    port = pickle.loads(pickle.dumps(stage.flange))
    assert (port.connector.name, port.component.note) == ("flange", "mine")


@pytest.mark.parametrize("assembled", [False, True])
def test_a_copy_has_parts_of_its_own(assembled: bool) -> None:
    stage = Stage(count=1)
    stage.own = gp.Inertia(J=7.0)
    if assembled:
        connections_of(stage)
    for again in (copy.copy(stage), copy.deepcopy(stage)):
        for one in (again, stage):
            connections_of(one)
            assert list(parts_of(one)) == ["own", "bodies[0]"]
            assert all(next(enclosing(part)) is one for part in parts_of(one).values())
        assert not {*map(id, parts_of(again).values())} & {*map(id, parts_of(stage).values())}
        assert (again.own.J, given_to(again)) == (7.0, given_to(stage))


def test_a_change_is_made_whenever_the_parts_are() -> None:
    times: list[int] = []

    def add(stage: Any) -> None:
        times.append(len(stage.bodies))
        stage.more = gp.Inertia(J=1.0)

    stage = Stage()
    more = changed(stage, add)
    assert ("more" in parts_of(more), "more" in parts_of(stage)) == (True, False)
    assert gl.compile(more, outputs=["more.w"]).states == ("more.w",)
    assert len(times) > 1
    assert set(times) == {2}


def test_signals_of_a_composite_are_those_connected_and_those_joined_by_parts() -> None:
    class Governed(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load, self.gain = gp.Torque(), gp.Inertia(J=2.0), gp.blocks.Gain(k=2.0)
            self.governor = gl.Sampled(lambda t, v: v, 0.1, inputs=[self.load.w], outputs=[self.gain.u])
            return [c(self.torque.flange, self.load.flange_a), c(self.gain.y, self.torque.tau)]

    found = [tuple(map(str, signals)) for signals in signals_of(Governed())]
    assert found == [("gain.y", "torque.tau"), ("load.w", "governor.inputs[0].u"), ("gain.u", "governor.outputs[0].y")]


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Connection([gp.Inertia(J=1.0).flange_a]), ConnectionError, r"Connection: ports is \[.*\]; expected connectors"),
        (lambda: Connection((), (3,)), ConnectionError, r"Connection: signals is \(3,\); expected signals"),
        (lambda: c(signal("a.y")), ConnectionError, r"^connect\(\) needs two signals, got only a\.y$"),
        (lambda: c(signal("a.y"), signal("b.u"), signal("b.u")), ConnectionError, r"^b\.u is connected to itself$"),
        (lambda: c(), ConnectionError, r"connect\(\) needs two connectors, got 0"),
        (lambda: gp.Inertia(J=1.0).flange_a._x, AttributeError, "_x"),
        (lambda: gp.Inertia(J=1.0, nominal={1, 2}), BindingError, r"nominal is .*; expected typical sizes by name, such as nominal"),
        (lambda: gp.Inertia(J=1.0, start={"phi"}), BindingError, r"such as start=\{'phi': 100\.0\}"),
        (lambda: gp.Inertia(J=1.0, state="avoid"), BindingError, r"expected preferences by name, such as state=\{'w': 'prefer'\}"),
        (lambda: gl.Component(3), BindingError, r"Component\(3\): give values by name, such as Component\(start=\.\.\.\)"),
        (lambda: Stage(flange=1), BindingError, "'flange' is a variable or connector, and cannot be given by keyword"),
        (lambda: setattr(Stage(), "size", 3), DeclarationError, r"Stage\.size is declared by the class; .* is made: Stage\(size=\.\.\.\)"),
        (lambda: setattr(Stage(), "more", {"a": gp.Inertia(J=1.0)}), ModelError, r"Stage\.more is a dict of components; a family"),
        (lambda: setattr(Plant().stage, "note", 3), ModelError, r"stage\.note: Plant\.assemble\(\) made this part"),
        (lambda: setattr(Plant().stage.bodies[0], "note", 3), ModelError, r"stage\.bodies\[0\]\.note: Stage\.assemble\(\) made this"),
        (lambda: Plant()._nothing, AttributeError, "_nothing"),
        (lambda: Plant().stage.bodies[0].nothing, AttributeError, r"stage\.bodies\[0\]: Inertia has no 'nothing'"),
    ],
)  # fmt: skip
def test_slips_outside_of_assemble(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize("value", [[1, 2], dict, {"a": 1}, "text", None, (), gp.Flange("side")])
def test_attributes_that_are_no_parts_are_kept_as_they_are(value: Any) -> None:
    model = composite(lambda s: [])
    model.more = value
    assert model.more is value
    assert dict(parts_of(model)) == {}


def test_what_assemble_made_is_discarded_before_it_runs_again() -> None:
    wanted = [True]

    def assemble(self: Any) -> list[Any]:
        if wanted:
            self.note, self.pair = "first", [body(), body()]
        return []

    model = composite(assemble)
    model.own = body()
    connections_of(model)
    assert (model.note, list(parts_of(model))) == ("first", ["own", "pair[0]", "pair[1]"])
    wanted.clear()
    pair = model.pair
    forget(model)
    connections_of(model)
    assert (vars(model).keys() & {"note", "pair", "own"}, list(parts_of(model))) == ({"own"}, ["own"])
    other = composite(lambda s: [])
    other.taken = pair[0]
    assert path_of(pair[0]) == "taken"


def test_only_a_composite_is_assembled_for_an_unknown_name() -> None:
    leaf = type("Leaf", (gl.Component,), {"count": gl.Structural(2, min=1)})(count=0)
    with pytest.raises(AttributeError, match=r"^Leaf has no 'nothing'; Valid names: count$"):
        leaf.nothing  # noqa: B018


def test_values_that_can_not_be_read_are_refused() -> None:
    class Unread(UserDict[str, float]):
        def __iter__(self) -> Iterator[str]:
            if self.pop("fails", None):
                raise RuntimeError("no")
            return super().__iter__()

    with pytest.raises(BindingError, match=r"^Inertia: guess is .*; expected start values by name"):
        gp.Inertia(J=1.0, guess=Unread(fails=1.0, w=2.0))
    assert given_to(gp.Inertia(J=1.0, guess=Unread(w=2.0))).guess == {"w": 2.0}


def test_a_part_that_is_deleted_is_no_part_any_more() -> None:
    def assemble(self: Any) -> list[Any]:
        self.tried, self.load, self.several = body(), body(), [body()]
        del self.tried
        return []

    model = composite(assemble)
    model.own, model.pair, model.note, model.owner = body(), [body(), body()], "text", body()
    own, pair = model.own, model.pair
    del model.own, model.pair, model.note
    assert list(parts_of(model)) == ["owner"]
    assert gl.compile(model).states == ("owner.w", "load.w", "several[0].w")
    other = composite(lambda s: [])
    other.own, other.pair = own, pair
    model.own = body()
    assert gl.compile(model).states == ("owner.w", "own.w", "load.w", "several[0].w")
    for made in ("load", "several"):
        with pytest.raises(ModelError, match=rf"^Model\.{made}: assemble\(\) made this part, and makes it again"):
            delattr(model, made)
    for missing in ("nothing", "_nothing"):
        with pytest.raises(AttributeError, match=missing):
            delattr(model, missing)


@pytest.mark.parametrize("when", ["nothing", "size", "flange"])
def test_a_connector_exists_by_a_structural_choice_of_the_class(when: str) -> None:
    members = {"size": gl.Parameter("1"), "wide": gl.Structural(False), "flange": gp.Flange("side")}
    assert type("Fine", (gl.Component,), {**members, "more": gp.Flange("more", when="wide")})().wide is False
    with pytest.raises(DeclarationError, match=rf"^Odd\.more: when='{when}' is not a Structural of the class$"):
        type("Odd", (gl.Component,), {**members, "more": gp.Flange("more", when=when)})


def test_a_name_is_given_to_one_part() -> None:
    model = composite(lambda s: [])
    model.a = body()
    with pytest.raises(ModelError, match=r"Model\.a is assigned twice"):
        model.a = body()
    inner = composite(lambda s: [])
    model.inner = inner
    with pytest.raises(ModelError, match=r"Model\.loop: a component cannot be a part of itself"):
        inner.loop = model


@pytest.mark.parametrize(
    ("right", "advice"),
    [
        (lambda s: s.flange.phi if s.x > 0 else 1, r"use gl\.Piecewise\(\(value, condition\), \(other, True\)\) instead of if"),
        (lambda s: s.flange * 2, "a connector is not a variable; name one that it has"),
        (lambda s: np.sqrt(s.x), r"use gl\.sin, gl\.sqrt, \.\.\. instead of those of math or numpy"),
        (lambda s: __import__("math").sqrt(s.x), r"use gl\.sin, gl\.sqrt, \.\.\. instead of those of math or numpy"),
        (lambda s: gl.sin("x"), r"Leaf\.equations\(\): the argument of sin\(\) is 'x'"),
    ],
)  # fmt: skip
def test_what_python_cannot_do_with_a_symbol_is_explained(right: Callable[[Any], Any], advice: str) -> None:
    members = {"x": gl.Variable("1"), "flange": gp.Flange("side")}
    leaf: gl.Component = type("Leaf", (gl.Component,), {**members, "equations": lambda s: [gl.Eq(s.x, right(s))]})()
    with pytest.raises(DeclarationError, match=rf"^Leaf\.equations\(\): .*{advice}|^{advice}"):
        equations_of(leaf)


def test_other_errors_of_a_user_are_left_as_they_are() -> None:
    def wrong(self: Any) -> Any:
        return len(3)  # type: ignore[arg-type]

    leaf: gl.Component = type("Leaf", (gl.Component,), {"equations": wrong})()
    with pytest.raises(TypeError, match=r"object of type 'int' has no len\(\)"):
        equations_of(leaf)
    lost: gl.Component = type("Lost", (gl.Component,), {"energies": lambda s: 3})()
    with pytest.raises(
        DeclarationError, match=r"Lost\.energies\(\) must return gl\.Energy\(stored=\.\.\., heat=\.\.\.\); got 3"
    ):
        energies_of(lost)
    assert energies_of(gp.Torque(tau=1.0)).source
