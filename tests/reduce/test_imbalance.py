"""What a modeller reads whose classes have an equation too many or too few, or who forgot to connect a part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError, ModelError
from gearlib.flatten.flatten import flatten
from gearlib.reduce.imbalance import Account, unbalanced_classes

c = gl.connect


def connect(parts: dict[str, gl.Component], *links: str, also: Callable[[Any], list[Any]] | None = None) -> gl.Component:
    """A model of parts, with connections such as "motor.flange load.flange_a", and equations of its own."""

    def assemble(self: Any) -> list[Any]:
        for name, part in parts.items():
            setattr(self, name, part)

        def port(path: str) -> Any:
            part, connector = path.split(".")
            return getattr(getattr(self, part), connector)

        return [c(*map(port, link.split())) for link in links]

    made: gl.Component = type("Drive", (gl.Component,), {"assemble": assemble, **({"equations": also} if also else {})})()
    return made


class Shaft(gl.Component):
    """A spring, whose equations the tests give."""

    flange_a = gp.Flange("left")
    flange_b = gp.Flange("right")
    c = gl.Parameter("N.m/rad", "stiffness", default=10.0)
    tau = gl.Variable("N.m", "torque")


def law(self: Any) -> gl.Eq:
    return gl.Eq(self.tau, self.c * (self.flange_b.phi - self.flange_a.phi))


def ends(self: Any) -> list[gl.Eq]:
    return [gl.Eq(self.flange_b.tau, self.tau), gl.Eq(self.flange_a.tau, -self.tau)]


class Wrapped(gl.Component):
    """A spring in a housing, with variables of its own."""

    flange_a = gp.Flange("left")
    flange_b = gp.Flange("right")
    twist = gl.Variable("rad", "twist")
    power = gl.Variable("W", "power")

    def assemble(self) -> list[Any]:
        self.spring = gp.SpringDamper(c=10.0, d=1.0)
        return [c(self.flange_a, self.spring.flange_a), c(self.flange_b, self.spring.flange_b)]


def half_connected(self: Any) -> list[Any]:
    self.spring = gp.SpringDamper(c=10.0, d=1.0)
    return [c(self.flange_a, self.spring.flange_a)]


SHAFT = r"shaft \(Kind\) has {} equations for 3 unknowns \(flange_a\.tau; flange_b\.tau; tau\), "
WRAPPED = r"shaft \(Kind\) has {} equations for 4 unknowns \(flange_a\.tau; flange_b\.tau; twist; power\), 1 is "
SIDE = {"flange_c": gp.Flange("side")}


@pytest.mark.parametrize(
    ("base", "declared", "equations", "message"),
    [
        (
            Shaft,
            {},
            lambda s: [law(s), ends(s)[0]],
            SHAFT.format(2) + r"1 is missing: none of them holds flange_a\.tau\. under",
        ),
        (Shaft, {}, lambda s: [law(s)], SHAFT.format("1").replace("equations", "equation") + "2 are missing"),
        (
            Shaft,
            {},
            lambda s: [],
            SHAFT.format("no") + r"3 are missing: none of them holds flange_a\.tau, flange_b\.tau, tau\.",
        ),
        (
            Shaft,
            {},
            lambda s: [law(s), *ends(s), gl.Eq(s.tau, s.c * gl.sin(s.flange_a.phi))],
            SHAFT.format(4)
            + r"1 is too many: tau = .*; flange_b\.tau = tau; .*; tau = c\*sin\(flange_a\.phi\)\. over-determined",
        ),
        (
            Shaft,
            {"power": gl.Variable("W", "power")},
            lambda s: [law(s), *ends(s)],
            r"3 equations for 4 unknowns .* none of them holds power\.",
        ),
        (
            Shaft,
            SIDE,
            lambda s: [law(s), *ends(s)],
            r"none of them holds flange_c\.tau\. shaft\.flange_c is connected to nothing",
        ),
        (Wrapped, {}, lambda s: [gl.Eq(s.twist, s.spring.phi_rel)], WRAPPED.format(3) + r"missing: none of them holds power\."),
        (
            Wrapped,
            {"assemble": half_connected},
            lambda s: [gl.Eq(s.twist, s.spring.phi_rel), gl.Eq(s.power, 0)],
            WRAPPED.format(3) + r"missing: none of them holds flange_b\.tau\.",
        ),
        (
            Wrapped,
            {},
            lambda s: [gl.Eq(s.twist, s.spring.phi_rel), gl.Eq(s.power, 0), gl.Eq(s.spring.tau, 0)],
            WRAPPED.format(5) + r"too many: .*; spring\.tau = 0; connection of flange_a; connection of flange_b\.",
        ),
    ],
)
def test_the_class_is_named_that_has_too_many_equations_or_too_few(
    base: type[gl.Component], declared: dict[str, Any], equations: Any, message: str
) -> None:
    kind = type("Kind", (base,), {**declared, "equations": equations})
    parts = {"motor": gp.Torque(tau=1.0), "a": gp.Inertia(J=1.0), "shaft": kind(), "b": gp.Inertia(J=1.0)}
    links = ("motor.flange a.flange_a", "a.flange_b shaft.flange_a", "shaft.flange_b b.flange_a")
    with pytest.raises(BalanceError, match=r"^the model is not balanced\. .*" + message):
        gl.compile(connect(parts, *links))


@pytest.mark.parametrize("gears", [2, 3])
def test_a_missing_equation_is_missed_beside_a_rigid_loop_too(gears: int) -> None:
    """A loop of equal gears leaves one torque open for each gear beyond the first, and no more."""
    kind = type("Kind", (Shaft,), {"equations": lambda s: [law(s), ends(s)[0]]})
    loop = {f"g{k}": gp.IdealGear(ratio=2.0) for k in range(gears)}
    parts = {"a": gp.Inertia(J=1.0), "b": gp.Inertia(J=1.0), "shaft": kind(), "end": gp.Inertia(J=1.0), **loop}
    links = [
        " ".join(["a.flange_b", *(f"{g}.flange_a" for g in loop)]),
        " ".join(["b.flange_a", *(f"{g}.flange_b" for g in loop)]),
    ]
    with pytest.raises(
        BalanceError, match=SHAFT.format(2) + r"1 is missing: none of them holds flange_a\.tau\. under-.*, 1 too few"
    ):
        gl.compile(connect(parts, *links, "b.flange_b shaft.flange_a", "shaft.flange_b end.flange_a"))


def test_several_instances_of_a_faulty_class_are_named_together() -> None:
    kind = type("Kind", (Shaft,), {"equations": lambda s: [law(s), ends(s)[0]]})
    shafts = {f"s{i}": kind() for i in range(5)}
    bodies = {f"b{i}": gp.Inertia(J=1.0) for i in range(6)}
    links = [f"b{i}.flange_b s{i}.flange_a" for i in range(5)] + [f"s{i}.flange_b b{i + 1}.flange_a" for i in range(5)]
    with pytest.raises(BalanceError, match=r"balanced\. s0, s1, s2, \.\.\. \(Kind\) has 2 equations for 3 unknowns"):
        gl.compile(connect({**bodies, **shafts}, *links))


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (lambda s: gl.Eq(s.flange_b.tau, s.tau), r"two equations Kind: flange_b\.tau = tau say the same"),
        (lambda s: gl.Eq(s.tau, s.flange_b.tau), r"Kind: flange_b\.tau = tau and Kind: tau = flange_b\.tau say the same"),
        (law, r"two equations Kind: tau = c.* say the same; leave one of them out"),
        (lambda s: gl.Eq(0, 1), r"Kind: 0 = 1 holds no variable"),
        (lambda s: gl.Eq(s.c, 10), r"Kind: c = 10 holds no variable"),
        (lambda s: gl.Eq(s.tau, s.tau), r"Kind: tau = tau holds no variable"),
    ],
)
@pytest.mark.parametrize("instead", [False, True])
def test_equations_that_say_nothing_new_are_refused(extra: Any, message: str, instead: bool) -> None:
    """Where they stood in place of another one, a torque that nothing determines was set to zero."""
    kind = type("Kind", (Shaft,), {"equations": lambda s: [law(s), *ends(s)[: 2 - instead], extra(s)]})
    parts = {"motor": gp.Torque(tau=1.0), "a": gp.Inertia(J=1.0), "shaft": kind(), "b": gp.Inertia(J=1.0)}
    links = ("motor.flange a.flange_a", "a.flange_b shaft.flange_a", "shaft.flange_b b.flange_a")
    with pytest.raises(BalanceError, match=r"over-determined: .*" + message):
        gl.compile(connect(parts, *links))


def test_an_equation_that_follows_from_two_others_is_refused() -> None:
    kind = type("Kind", (Shaft,), {"equations": lambda s: [law(s), *ends(s), gl.Eq(s.flange_a.tau, -s.flange_b.tau)]})
    with pytest.raises(
        BalanceError, match=r"one of these equations follows from the others: .*; Kind: flange_a\.tau = -flange_b"
    ):
        gl.compile(connect({"shaft": kind()}))


@pytest.mark.parametrize(
    ("parts", "links", "message"),
    [
        ({"q": lambda: gp.Torque(tau=1.0)}, (), r"balanced\. q\.flange is connected to nothing; connect it\. over"),
        (
            {"q": lambda: gp.Torque(tau=1.0, use_support=True)},
            ("q.flange a.flange_a",),
            r"balanced\. q\.support is connected to nothing; connect it, or leave it switched off \(use_support=False of q\)",
        ),
        ({"sensor": gp.SpeedSensor}, (), r"balanced\. sensor\.flange is connected to nothing; connect it\. under"),
        (
            {"brake": lambda: gp.Damper(d=1.0)},
            (),
            r"balanced\. brake\.flange_a and brake\.flange_b are connected to nothing; connect them, or leave brake out\.",
        ),
        (
            {"gear": lambda: gp.IdealGear(ratio=2.0)},
            (),
            r"balanced\. gear\.flange_a and gear\.flange_b are connected to nothing",
        ),
        (
            {"q": lambda: gp.Torque(tau=1.0), "gear": lambda: gp.IdealGear(ratio=2.0)},
            ("q.flange gear.flange_a",),
            r"balanced\. gear\.flange_b is connected to nothing; connect it\. over",
        ),
        (
            {"q": lambda: gp.Torque(tau=1.0), "r": lambda: gp.Torque(tau=1.0)},
            ("q.flange r.flange",),
            r"balanced\. Nothing determines q\.flange\.phi: connect q\.flange to a component that does\.",
        ),
    ],
)
def test_a_part_that_was_forgotten_is_named(parts: dict[str, Any], links: tuple[str, ...], message: str) -> None:
    """Not one that turns by itself."""
    made = {name: make() for name, make in parts.items()}
    bodies = {"a": gp.Inertia(J=1.0), "b": gp.Inertia(J=2.0), "spare": gp.Inertia(J=3.0)}
    with pytest.raises(BalanceError, match=message) as told:
        gl.compile(connect({**bodies, **made}, *links, "a.flange_b b.flange_a"))
    assert "spare" not in str(told.value)


def test_an_input_that_acts_between_a_shaft_and_nothing_is_named() -> None:
    drive = connect({"q": gp.Torque(use_support=True), "a": gp.Inertia(J=1.0)}, "q.flange a.flange_a")
    with pytest.raises(
        ModelError, match=r"q\.support is connected to nothing, so that the input q\.tau does nothing; connect it, or leave"
    ):
        gl.compile(drive)


def test_of_several_loose_ends_the_first_is_named() -> None:
    class Branch(gl.Component):
        flange_a, flange_b, flange_c = gp.Flange("driven"), gp.Flange("first"), gp.Flange("second")
        u, k = gl.Input("N.m"), gl.Parameter("N.m/rad", default=1.0)

        def equations(self) -> list[gl.Eq]:
            a, b, far = self.flange_a, self.flange_b, self.flange_c
            return [gl.Eq(b.tau, -self.u), gl.Eq(far.tau, self.k * (far.phi - b.phi)), gl.Eq(a.phi, b.phi)]

    with pytest.raises(
        ModelError, match=r"^q\.flange_b is connected to nothing, so that the input q\.u does nothing; connect it$"
    ):
        gl.compile(connect({"q": Branch(), "a": gp.Inertia(J=1.0)}, "q.flange_a a.flange_a"))


@pytest.mark.parametrize(
    ("tau", "equation", "message"),
    [
        (None, lambda s: gl.Eq(s.q.tau, 3 * gl.sin(gl.time)), r"q\.tau is an input and given from outside; if it is to obey "),
        (None, lambda s: gl.Eq(s.q.tau, -s.k * s.a.w), r"obey Drive: q\.tau = -a\.w\*k, bind it: tau=\.\.\. where q is made\."),
        (2.0, lambda s: gl.Eq(s.q.tau, -s.k * s.a.w), r"q\.tau is an input and bound to something already; if it is to obey"),
    ],
)
def test_an_input_that_an_equation_gives_is_to_be_bound(tau: float | None, equation: Any, message: str) -> None:
    class Drive(gl.Component):
        k = gl.Parameter("N.m.s/rad", "gain", default=2.0)

        def assemble(self) -> list[Any]:
            self.q, self.a = gp.Torque(**({} if tau is None else {"tau": tau})), gp.Inertia(J=1.0)
            return [c(self.q.flange, self.a.flange_a)]

        def equations(self) -> list[gl.Eq]:
            return [equation(self)]

    with pytest.raises(
        BalanceError, match=r"the model \(Drive\) has 1 equation for no unknowns, 1 is too many: q\.tau.*" + message
    ):
        gl.compile(Drive())


@pytest.mark.parametrize("boxed", [False, True])
def test_inputs_that_their_own_component_determines_are_to_be_variables(boxed: bool) -> None:
    class Inner(gl.Component):
        u, v, x = gl.Input("1"), gl.Input("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.u), gl.Eq(self.u, 2 * self.v)]

    class Box(gl.Component):
        def assemble(self) -> list[Any]:
            self.inner = Inner()
            return []

    at = "inner." if boxed else ""
    said = " ".join(
        f"{at}{name} is an input, which is given from outside; declare it as a variable if Inner: u = 2*v is to determine it."
        for name in "uv"
    )
    with pytest.raises(BalanceError) as told:
        gl.compile(Box() if boxed else Inner())
    assert said in str(told.value)
    assert "bind it" not in str(told.value)


def test_correct_classes_owe_nothing() -> None:
    """Sources, sensors, gears, and composites whose flanges go to parts; a clutch with a discrete variable."""
    parts = {
        "q": gp.Torque(), "a": gp.Inertia(J=1.0), "gear": gp.IdealGear(ratio=2.0), "b": gp.Inertia(J=1.0),
        "clutch": gp.Clutch(fn_max=10.0), "sensor": gp.SpeedSensor(), "ground": gp.Fixed(), "set": gp.IdealPlanetary(ratio=2.0),
        "pair": gp.ElasticCoupling(J_a=1.0, J_b=1.0, c=1.0, d=1.0),
    }  # fmt: skip
    model = flatten(connect(parts, "q.flange a.flange_a sensor.flange", "a.flange_b gear.flange_a pair.flange_a"))
    assert unbalanced_classes(model) == []
    assert unbalanced_classes(flatten(gp.ZhouCui2022(tau_in=1.0))) == []


@pytest.mark.parametrize(
    ("equations", "unknowns", "untouched", "text"),
    [
        ((), ("x",), ("x",), "no equations for 1 unknown (x), 1 is missing: none of them holds x"),
        (("a",), ("x", "y"), (), "1 equation for 2 unknowns (x; y), 1 is missing"),
        (("a", "b"), (), (), "2 equations for no unknowns, 2 are too many: a; b"),
        (("a", "b"), ("x",), (), "2 equations for 1 unknown (x), 1 is too many: a; b"),
        ((), ("x", "y"), ("x", "y"), "no equations for 2 unknowns (x; y), 2 are missing: none of them holds x, y"),
        (("a",), tuple("uvwxyzabc"), (), "1 equation for 9 unknowns (u; v; w; x; y; z; a; b; and 1 more), 8 are missing"),
    ],
)  # fmt: skip
def test_accounts_are_told_in_words(equations: Any, unknowns: Any, untouched: Any, text: str) -> None:
    balance = Account("Kind", equations, unknowns, untouched)
    assert str(balance) == text
    assert balance.surplus == len(equations) - len(unknowns)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_three_instances_and_three_causes_are_named(count: int) -> None:
    kind = type("Kind", (Shaft,), {"equations": lambda s: [law(s), ends(s)[0]]})
    shafts = {f"s{i}": kind() for i in range(count)}
    with pytest.raises(BalanceError) as told:
        gl.compile(connect({"a": gp.Inertia(J=1.0), **shafts}, *(f"a.flange_b s{i}.flange_a" for i in range(count))))
    named = ", ".join([*(f"s{i}" for i in range(min(count, 3))), *(["..."] if count > 3 else [])])
    assert f"balanced. {named} (Kind) has 2 equations for 3 unknowns" in str(told.value)
    kinds = {f"k{i}": type(f"Kind{i}", (Shaft,), {"equations": lambda s: [law(s), ends(s)[0]]})() for i in range(count)}
    with pytest.raises(BalanceError) as told:
        gl.compile(connect({"a": gp.Inertia(J=1.0), **kinds}, *(f"a.flange_b k{i}.flange_a" for i in range(count))))
    assert str(told.value).count("has 2 equations for 3 unknowns") == min(count, 3)
    assert f"{count} too few." in str(told.value)


def test_a_class_is_named_only_if_its_count_goes_the_way_of_the_models() -> None:
    """What one class leaves out an enclosing one may give; then only what is too much there is told."""

    class Part(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[Any]:
            return [gl.Eq(self.x, gl.sin(gl.time))]

    def told(*also: Any) -> str:
        with pytest.raises(BalanceError) as caught:
            gl.compile(connect({"part": Part()}, also=lambda s: [equation(s) for equation in also]))
        return str(caught.value)

    too_many = told(lambda s: gl.Eq(s.part.y, 2 * s.part.x), lambda s: gl.Eq(s.part.y**2, gl.time))
    assert "(Drive) has" in too_many
    assert "(Part) has" not in too_many
    assert "over-determined" in too_many
    assert "under-determined" not in too_many
    too_few = told()
    assert "part (Part) has" in too_few
    assert "(Drive) has" not in too_few
    assert "over-determined" not in too_few
