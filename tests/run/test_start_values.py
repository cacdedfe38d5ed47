"""Start values: fixed ones hold, guesses give way, contradictions are named."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError, StartError
from gearlib.run.start_values import fixed_values

c = gl.connect


def geared(motor: dict[str, Any], load: dict[str, Any], ratio: float = 10.0) -> gl.System:
    """Motor, gear, load; start and guess values of the two bodies."""

    class Geared(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.load = gp.Inertia(J=0.1, **motor), gp.Inertia(J=2.0, **load)
            self.gear = gp.IdealGear(ratio=ratio)
            return [c(self.motor.flange_b, self.gear.flange_a), c(self.gear.flange_b, self.load.flange_a)]

    return gl.compile(Geared())


def start(system: gl.System, *names: str, **options: Any) -> list[float]:
    result = system.simulate(1.0, samples=2, **options)
    return [float(result[n][0]) for n in names]


@pytest.mark.parametrize(
    ("motor", "load", "expected"),
    [
        ({"start": {"w": 50.0}}, {}, 5.0),
        ({}, {"start": {"w": 5.0}}, 5.0),
        ({"start": {"w": 50.0}}, {"start": {"w": 5.0}}, 5.0),  # redundant and consistent
        ({"guess": {"w": 50.0}}, {"start": {"w": 7.0}}, 7.0),
        ({"start": {"w": 70.0}}, {"guess": {"w": 5.0}}, 7.0),
        ({}, {}, 0.0),
        ({"start": {"flange_a.phi": 20.0, "w": 1.0}}, {}, 0.1),
    ],
)
def test_a_fixed_value_holds_on_whichever_side_of_the_gear(motor: Any, load: Any, expected: float) -> None:
    assert start(geared(motor, load), "load.w", "motor.w") == pytest.approx([expected, 10 * expected], rel=1e-12)


def test_fixed_angles_through_the_gear() -> None:
    assert start(geared({"start": {"phi": 3.0}}, {}), "load.phi", "motor.phi") == pytest.approx([0.3, 3.0], rel=1e-12)


@pytest.mark.parametrize(
    ("motor", "load", "message"),
    [
        (
            {"w": 1.0},
            {"w": 2.0},
            r"start values contradict each other: load\.w is fixed at 2, but .*motor\.w.*make it 0\.1; fix fewer",
        ),
        ({"w": 1.0, "flange_a.tau": 3.0}, {}, r"motor\.flange_a\.tau is fixed at 3, but .*make it 0|is always zero"),
    ],
)
def test_contradictions_are_named(motor: Any, load: Any, message: str) -> None:
    with pytest.raises(StartError, match=message):
        start(geared({"start": motor}, {"start": load}))


@pytest.mark.parametrize(
    ("name", "tau", "told"), [("torque.tau", 2.0, "2, .* make it 1"), ("torque.flange.tau", -2.0, "-2, .* make it -1")]
)
def test_a_contradiction_is_told_in_the_sign_of_the_variable_that_was_named(name: str, tau: float, told: str) -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body = gp.Torque(tau=1.0), gp.Inertia(J=1.0)
            return [c(self.torque.flange, self.body.flange_a)]

    with pytest.raises(StartError, match=rf"{re.escape(name)} is fixed at {told}; fix fewer"):
        gl.compile(Driven(), outputs=["torque.tau"]).simulate(1.0, start={name: tau})


def test_two_names_of_one_variable() -> None:
    class Shaft(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"phi": 1.0}), gp.Inertia(J=1.0, start={"phi": 2.0})
            return [c(self.a.flange_b, self.b.flange_a)]

    with pytest.raises(StartError, match=r"a\.phi and b\.phi are one variable \(up to its sign\), but are fixed at 1 and 2"):
        gl.compile(Shaft()).simulate(1.0)


@pytest.mark.parametrize(("first", "second"), [(0.0, 2.8e-17), (2.8e-17, 0.0), (-3e-17, 2e-16)])
def test_rounding_of_zero_is_no_contradiction_in_either_order(first: float, second: float) -> None:
    class Shaft(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"phi": first}), gp.Inertia(J=1.0, start={"phi": second})
            return [c(self.a.flange_b, self.b.flange_a)]

    assert abs(gl.compile(Shaft()).simulate(1.0)["a.phi"]).max() < 1e-15


def test_a_held_shaft_cannot_start_with_a_speed() -> None:
    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.ground = gp.Inertia(J=1.0, start={"w": 1.0}), gp.Fixed()
            return [c(self.body.flange_b, self.ground.flange)]

    with pytest.raises(StartError, match=r"body\.w is fixed at 1, but the equations make it 0"):
        gl.compile(Held()).simulate(1.0)


def test_start_of_a_run_overrides_that_of_the_model() -> None:
    system = geared({"start": {"w": 50.0}}, {})
    assert start(system, "load.w", start={"motor.w": 20.0}) == pytest.approx([2.0])
    assert start(system, "load.w") == pytest.approx([5.0])  # nothing is left behind


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"load.ww": 1.0}, NameLookupError, r"no variable 'load\.ww'; did you mean 'load\.w'"),
        ({"load.J": 1.0}, NameLookupError, r"no variable 'load\.J'"),
        ({"load.w": float("nan")}, ArgumentError, r"start of load\.w is nan; expected a finite number"),
        ({"load.w": "1"}, ArgumentError, r"start of load\.w is '1'; expected a finite number"),
        ({"load.w": None}, ArgumentError, r"start of load\.w is None; expected a finite number"),
        ("stead", ArgumentError, r"start is 'stead'; expected a mapping of start values, 'steady', a result, or"),
        ({"load.w": 1.0, "motor.w": 1.0}, StartError, r"load\.w is fixed at 1, but .*make it 0\.1"),
        ({3: 1.0}, NameLookupError, "3 is not a name"),
    ],
)
def test_wrong_start_of_a_run(given: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        geared({}, {}).simulate(1.0, start=given)


def test_summary_names_what_nothing_fixes() -> None:
    free = geared({}, {}).summary()
    assert "start       at their guess, since nothing fixes them: " in free
    assert "load.w" in free.split("nothing fixes them")[1] or "motor.w" in free.split("nothing fixes them")[1]
    assert "nothing fixes them" not in geared({"start": {"w": 1.0}}, {}).summary()


class Twisted(gl.Component):
    """Two bodies and a spring; both angles and the spring's deflection have start values."""

    rigid = gl.Structural(False)
    a, b, twist = (gl.Parameter("rad", default=0.0) for _ in range(3))

    def assemble(self) -> list[Any]:
        self.left, self.right = gp.Inertia(J=1.0, start={"phi": self.a}), gp.Inertia(J=2.0, start={"phi": self.b})
        if self.rigid:
            return [c(self.left.flange_b, self.right.flange_a)]
        self.spring = gp.SpringDamper(c=1e3, d=1.0, start={"phi_rel": self.twist})
        return [c(self.left.flange_b, self.spring.flange_a), c(self.spring.flange_b, self.right.flange_a)]


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_a_contradiction_is_measured_by_its_own_terms(size: float) -> None:
    """One part in 1e8 is no rounding, at 1e9 rad no more than at 1e-9 rad; one in 1e15 is."""
    for rigid in (False, True):
        system = gl.compile(Twisted(rigid=rigid))
        start(system, "left.phi", parameters={"a": size, "b": size * (1 + 1e-15)})
        for factor in (1 + 3e-9, 1 + 1e-6, -1.0, 0.0):
            with pytest.raises(StartError, match="start values contradict each other"):
                start(system, "left.phi", parameters={"a": size, "b": size * factor})


class Measured(gl.Component):
    """A state, its error, and a large sum that the state is a small part of."""

    w = gl.Variable("1", "a state")
    offset = gl.Variable("1", "the other part of the sum", start=1e8)
    total = gl.Variable("1", "the sum")
    error = gl.Variable("1", "of the state", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.w), -self.w),
            gl.Eq(gl.der(self.offset), 0.0),
            gl.Eq(self.total, 100.0 * self.w + self.offset),
            gl.Eq(self.error, self.w - 2.9),
        ]


def test_an_error_is_left_where_it_is_rounding() -> None:
    """The sum is given with eleven digits, so that the state follows from its error; with six, they contradict each other."""
    system = gl.compile(Measured())
    assert start(system, "w", "error", start={"total": 1e8 + 290.0 + 1e-3}) == pytest.approx([2.9, 0.0], abs=1e-9)
    with pytest.raises(StartError, match="start values contradict each other"):
        start(system, "w", start={"total": 1e8 + 390.0})


@pytest.mark.parametrize("twist", [1.2345678912345e-9, 1.2345678912345e-6, 0.3])
def test_a_deflection_with_a_start_value_keeps_its_digits_at_large_angles(twist: float) -> None:
    system = gl.compile(Twisted())
    assert start(system, "spring.phi_rel", parameters={"a": 1e9, "b": 1e9 + twist, "twist": twist}) == [twist]
    with pytest.raises(StartError, match=r"(left|right)\.phi is fixed at 100000000\d"):
        start(system, "spring.phi_rel", parameters={"a": 1e9, "b": 1e9 + 3.0, "twist": twist})


def test_a_nonlinear_constraint_moves_the_free_state() -> None:
    class Leaf(gl.Component):
        x = gl.Variable("1", "state", guess=1.0)
        y = gl.Variable("1", "its cube")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(self.y, self.x**3)]

    assert start(gl.compile(Leaf(start={"y": 8.0})), "x", "y") == pytest.approx([2.0, 8.0], rel=1e-12)
    with pytest.raises(StartError, match=r"y is fixed at 8, but the other fixed values \(x\) and the equations make it 1"):
        gl.compile(Leaf(start={"y": 8.0, "x": 1.0})).simulate(1.0)


def test_guesses_and_starts_of_an_opposite_alias() -> None:
    class Opposite(gl.Component):
        x = gl.Variable("1", "one")
        y = gl.Variable("1", "other")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), 0), gl.Eq(self.y, -self.x)]

    for given in ({"guess": {"y": 3.0}}, {"start": {"y": 3.0}}, {"guess": {"x": -3.0}}, {"start": {"x": -3.0}}):
        assert start(gl.compile(Opposite(**given)), "x", "y") == [-3.0, 3.0]


def test_start_values_may_be_expressions_of_parameters() -> None:
    class Model(gl.Component):
        n = gl.Parameter("1", "speed in revolutions per minute", default=60.0)

        def assemble(self) -> list[Any]:
            self.load = gp.Inertia(J=1.0, start={"w": 2 * gl.pi * self.n / 60})
            return []

    system = gl.compile(Model())
    assert start(system, "load.w") == pytest.approx([2 * np.pi])
    assert start(system, "load.w", parameters={"n": 120.0}) == pytest.approx([4 * np.pi])


def test_computed_start_values_may_miss_zero_by_rounding() -> None:
    """Of a part across one shaft, of two names of one variable, where all terms of a constraint are rounding, or printed."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.c = gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            self.across, self.gear = gp.Damper(d=1.0), gp.IdealGear(ratio=2.0)
            return [
                gl.connect(self.a.flange_b, self.b.flange_a),
                gl.connect(self.across.flange_a, self.a.flange_a),
                gl.connect(self.across.flange_b, self.b.flange_b),
                gl.connect(self.b.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.c.flange_a),
            ]

    system = gl.compile(Train())
    given = {"a.phi": 5.2e-17, "b.phi": -1.1e-16, "c.phi": 5.6e-17, "across.phi_rel": 2.8e-17, "a.w": 3.0}
    result = system.simulate(1.0, samples=2, start=given)
    assert result["c.w"] == pytest.approx([1.5, 1.5], rel=1e-12)
    for alone in ({"across.phi_rel": 2.8e-17}, {"b.phi": 5.6e-17, "a.phi": 0.0}, {"c.phi": -1.4e-17, "a.phi": 0.0}):
        assert system.simulate(1.0, samples=2, start={**alone, "a.w": 3.0})["c.w"] == pytest.approx([1.5, 1.5], rel=1e-12)
    for alone in ({"across.phi_rel": 7.1e-16}, {"c.phi": -1.04e-17, "a.phi": 0.0}):  # with nothing else to be measured by
        assert system.simulate(1.0, samples=2, start=alone)["c.w"] == pytest.approx([0.0, 0.0], abs=1e-15)
    printed = {"a.phi": 2 / 3, "b.phi": 0.666666666667, "c.phi": 0.333333333333, "a.w": 3.0, "c.w": 1.5}
    assert system.simulate(1.0, samples=2, start=printed)["c.w"] == pytest.approx([1.5, 1.5], rel=1e-11)
    for name, other in (("across.phi_rel", {}), ("b.phi", {"a.phi": 0.0}), ("c.phi", {"a.phi": 0.0})):
        with pytest.raises(StartError, match=r"always zero|contradict each other"):
            system.simulate(1.0, samples=2, start={name: 1e-6, **other})


def test_free_states_do_not_depend_on_the_order_of_declaration() -> None:
    """Of two angles with 0.3 rad between them either may be the state."""

    def ordered(names: tuple[str, str]) -> gl.System:
        class Train(gl.Component):
            def assemble(self) -> list[Any]:
                for name in names:
                    setattr(self, name, gp.Inertia(J=1.0))
                self.disc = gp.Disc(delta_phi=0.3)
                return [gl.connect(self.motor.flange_b, self.disc.flange_a), gl.connect(self.disc.flange_b, self.load.flange_a)]

        return gl.compile(Train())

    one, other = ordered(("motor", "load")), ordered(("load", "motor"))
    assert one.states == other.states
    assert start(one, "motor.phi", "load.phi") == start(other, "motor.phi", "load.phi")


@pytest.mark.parametrize(("nominal", "agree"), [(1e6, True), (1.0, False)])
def test_what_counts_as_zero_is_relative_to_the_size_of_a_variable(nominal: float, agree: bool) -> None:
    """Two names of one, fixed at 0 and 5e-6: the same up to rounding if values of a million are usual."""

    class Twice(gl.Component):
        a = gl.Variable("1", start=0.0, nominal=nominal)
        b = gl.Variable("1", start=5e-6, nominal=nominal)
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.a), -self.rate * self.b), gl.Eq(self.a, self.b)]

    translation = gl.compile(Twice()).translation
    parameters = translation.parameter_values({})
    if agree:
        found = fixed_values(translation.model, parameters, {})
        assert [value for value, _ in found.values()] == [pytest.approx(0.0, abs=1e-5)]
    else:
        with pytest.raises(StartError, match=r"start values contradict each other: [ab] and [ab] are one variable"):
            fixed_values(translation.model, parameters, {})
