"""When conditions in time switch: symbols once per scene, numbers for each set of parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError
from gearlib.run import time_switches


class Switched(gl.Component):
    """Torques that switch at times given by parameters, and where a sine passes a half."""

    ts = gl.Parameter("s", "first switch", default=0.3)
    sine = gl.Structural(True)

    def assemble(self) -> list[Any]:
        t = gl.time
        late = (t - 2 * self.ts) / 0.1 < 0
        sine = ((gl.sin(t), gl.sin(20 * t) > 0.5),) if self.sine else ()
        tau = gl.Piecewise((1.0, t < self.ts), (2.0, late), *sine, (3.0, True))
        self.drive, self.body = gp.Torque(tau=tau), gp.Inertia(J=1.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-0.05, w_nominal=1.0, torque_direction=False)
        return [gl.connect(self.drive.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.fan.flange)]


SYSTEM = gl.compile(Switched())


def by_hand(ts: float, end: float) -> list[float]:
    sine = [(np.arcsin(0.5) + 2 * np.pi * k) / 20 for k in range(20)] + [
        (5 * np.pi / 6 + 2 * np.pi * k) / 20 for k in range(20)
    ]
    return sorted(t for t in [ts, 2 * ts, *sine] if 0 < t < end)


@pytest.mark.parametrize("ts", [0.3, 0.123456789, 1 / 3, 5.0])
def test_events_stand_where_the_conditions_switch(ts: float) -> None:
    result = SYSTEM.simulate(1.0, samples=3, parameters={"ts": ts})
    assert [t for t, _ in result.events] == pytest.approx(by_hand(ts, 1.0), rel=1e-14)
    assert ts > 1.0 or ts in [t for t, _ in result.events]  # to the last bit


def test_no_symbol_is_made_in_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    system = gl.compile(Switched(sine=False))
    assert len(system.simulate(1.0, samples=3).events) == 2
    made = []
    new = sympy.Basic.__new__
    monkeypatch.setattr(sympy.Basic, "__new__", lambda cls, *a: made.append(cls) or new(cls, *a))
    for ts in (0.3, 0.4):
        assert system.simulate(1.0, samples=3, parameters={"ts": ts}).events[0][0] == ts
    assert not made


def test_conditions_are_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    find = time_switches.times_of_breakpoints
    monkeypatch.setattr(time_switches, "times_of_breakpoints", lambda *a: calls.append(a) or find(*a))
    for _ in range(3):
        SYSTEM.simulate(1.5, samples=3)
    assert len(calls) == 1  # the sine's; straight lines need none


class Late(gl.Component):
    """A torque that begins at a time, or with the torque of a flange that is connected to nothing."""

    flange = gp.Flange("driven shaft")
    idle = gp.Flange("connected to nothing")
    ts = gl.Parameter("s", "when it begins", default=0.5)
    k = gl.Parameter("s/(N.m)", "how much earlier for each newton metre", default=1.0)
    tau = gl.Parameter("N.m", "what acts then", default=1.0)

    def equations(self) -> list[gl.Eq]:
        begun = gl.Piecewise((self.tau, gl.time - self.ts + self.k * self.idle.tau > 0), (0.0, True))
        return [gl.Eq(self.flange.tau, -begun), gl.Eq(self.idle.phi, self.flange.phi)]


def test_what_is_always_zero_takes_no_part_in_a_condition() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.late, self.body = Late(), gp.Inertia(J=1.0)
            return [gl.connect(self.late.flange, self.body.flange_a)]

    for ts in (0.5, 0.25):
        result = gl.simulate(Driven(), 1.0, samples=2, method="rk", parameters={"late.ts": ts})
        assert result.events == [(ts, result.events[0][1])]
        assert result["body.w"][-1] == pytest.approx(1.0 - ts)


class Drives(gl.Component):
    """Sines of time of several rates, by parameters and numbers, beside conditions on time that are no drive."""

    rate = gl.Parameter("rad/s", default=20.0)
    other = gl.Parameter("rad/s", default=-70.0)
    unit = gl.Parameter("1/s", default=1.0)
    kind = gl.Structural("sines")
    x = gl.Variable("1")

    def equations(self) -> list[Any]:
        drive = {
            "sines": gl.sin(self.rate * gl.time) + gl.cos(self.other * gl.time) + gl.sin(50 * self.unit * gl.time),
            "numbers": gl.sin(3 * gl.time) - gl.cos(5 * gl.time),
            "condition": gl.Piecewise((1.0, gl.time < 0.5), (2.0, True)),
            "none": 1.0, "unknown": gl.sin(3 * gl.time**2), "pulse": gl.exp(-((gl.time - 1) ** 2)),
        }[self.kind]  # fmt: skip
        return [gl.Eq(gl.der(self.x), self.unit * drive)]


@pytest.mark.parametrize(
    ("kind", "values", "rate"),
    [
        ("sines", {}, 70.0), ("sines", {"other": 3.0}, 50.0), ("sines", {"other": 3.0, "unit": 0.0}, 20.0),
        ("sines", {"rate": -90.0}, 90.0), ("numbers", {}, 5.0), ("condition", {}, 0.0), ("none", {}, 0.0), ("unknown", {}, 0.0),
        ("pulse", {}, 2.0**0.5),
    ],
)  # fmt: skip
def test_the_fastest_drive(kind: str, values: dict[str, float], rate: float) -> None:
    translation = gl.compile(Drives(kind=kind)).translation
    drive = translation.scene.fastest_drive
    assert drive(translation.parameter_values(values)) == pytest.approx(rate)
    assert drive.known == (kind != "unknown")


@pytest.mark.parametrize(("first", "last"), [(0.0, 1.0), (0.3, 0.6), (0.2, 0.3), (0.61, 0.61)])
def test_switches_inside_an_interval_only(first: float, last: float) -> None:
    """Neither at its ends nor outside; where the slope of a condition is zero nothing switches."""
    switches = SYSTEM.translation.scene.time_switches
    found = sorted(t for t, _ in switches(SYSTEM.translation.parameter_values({}), first, last))
    assert found == pytest.approx([t for t in by_hand(0.3, 10.0) if first < t < last and t not in (first, last)], rel=1e-12)


class NeverOn(gl.Component):
    """A condition on a variable that is always zero."""

    signal, x = gl.Variable("1"), gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(self.signal, 0), gl.Eq(gl.der(self.x), gl.Piecewise((5.0, self.signal > 0), (2.0, True)))]


def test_a_condition_on_what_is_always_zero_never_switches() -> None:
    assert gl.simulate(NeverOn(), 1.0, samples=3)["x"] == pytest.approx([0.0, 1.0, 2.0])


@pytest.mark.parametrize("kinds", [("unknown", "numbers"), ("numbers", "unknown")])
def test_the_fastest_known_drive_beside_one_of_unknown_rate(kinds: tuple[str, str]) -> None:
    """In whichever order."""

    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = (Drives(kind=kind) for kind in kinds)
            return []

    translation = gl.compile(Both()).translation
    drive = translation.scene.fastest_drive
    assert not drive.known
    assert drive(translation.parameter_values({})) == 5.0


class Flat(gl.Component):
    """x grows from where the cube of a time is positive, and twice as fast after another time."""

    p, late = gl.Parameter("s3", default=0.0), gl.Parameter("s", default=1.5)
    x, w = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        flat = gl.Piecewise((1.0, (gl.time - 1) ** 3 > self.p), (0.0, True))
        return [gl.Eq(gl.der(self.w), gl.Piecewise((3.0, gl.time > self.late), (0.0, True))), gl.Eq(gl.der(self.x), flat)]


@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
@pytest.mark.parametrize("samples", [3, 8])
def test_a_condition_that_passes_zero_without_slope_switches(method: str, samples: int) -> None:
    found = gl.simulate(Flat(), 2.0, samples=samples, method=method)
    assert found["x"] == pytest.approx(np.maximum(found.time - 1.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("method", ["rk8", "ida"])
def test_its_time_has_no_derivative(method: str) -> None:
    """The refusal names it, not what switches elsewhere; other parameters have sensitivities."""
    with pytest.raises(SolverError) as refused:
        gl.simulate(Flat(), 2.0, samples=3, method=method, sensitivities=["late", "p"])
    said = str(refused.value)
    assert said.startswith("there are no sensitivities after t = 1 s: the event function of Flat: der(x) = Piecewise((1.0, ")
    assert ") touches zero there without crossing it, and whether there is an event" in said
    found = gl.simulate(Flat(), 2.0, samples=3, method=method, sensitivities=["late"])
    assert found.sensitivity("w", "late") == pytest.approx([0.0, 0.0, -3.0])
    assert found.sensitivity("x", "late") == pytest.approx([0.0, 0.0, 0.0])


class Cubic(gl.Component):
    """x grows from where a polynomial of time is positive."""

    a, b, c = (gl.Parameter("any", default=1.0) for _ in range(3))
    x = gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        t = gl.time
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, t**3 + self.a * t**2 + self.b * t + self.c > 0), (0.0, True)))]


class Beside(Cubic):
    """The same beside what is not linear."""

    z = gl.Variable("any", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.z), -(self.z**2))]


@pytest.mark.parametrize("method", ["auto", "rk", "ida"])
def test_a_polynomial_whose_terms_almost_cancel_switches(method: str) -> None:
    """At 1.6 s, beside a complex pair of roots that is 4 ms away."""
    system = gl.compile(Beside())
    for near in (1.599, 1.6, 1.6013):
        _, *numbers = np.polymul([1.0, -1.6], [1.0, -2 * near, near**2 + 0.004**2]).tolist()
        found = system.simulate(2.0, samples=2, method=method, parameters=dict(zip("abc", numbers, strict=True)))
        assert found["x"][-1] == pytest.approx(0.4, abs=1e-8)


@pytest.mark.parametrize("method", ["exact", "rk", "ida"])
@pytest.mark.parametrize("gap", [0.1, 4e-3, 1e-3])
def test_the_time_at_which_a_polynomial_switches_moves_with_its_coefficients(method: str, gap: float) -> None:
    """By -1 / p'(1.6) with the constant one, however near a complex pair of roots is."""

    near = 1.6 + 0.3 * gap
    _, *numbers = np.polymul([1.0, -1.6], [1.0, -2 * near, near**2 + gap**2]).tolist()
    given = dict(zip("abc", numbers, strict=True))
    found = gl.simulate(Cubic(), 2.0, samples=2, method=method, parameters=given, sensitivities=["c"])
    assert found.sensitivity("x", "c")[-1] == pytest.approx(1 / (1.09 * gap**2), rel=1e-4)


class Rising(gl.Component):
    """One while ``(t - 1)**3 > 0``, written out."""

    x, s = gl.Variable("1", start=0.0), gl.Parameter("s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        t = gl.time / self.s
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1, t**3 - 3 * t**2 + 3 * t > 1), (0, True)) / self.s)]


@pytest.mark.parametrize("method", ["rk5", "ida", "taylor", "exact"])
def test_a_condition_switches_where_three_of_its_roots_are_one(method: str) -> None:
    run = gl.simulate(Rising(), 3.0, times=[0.0, 0.9, 3.0], method=method)
    assert run["x"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-4)


HIDDEN = {
    "line": lambda t, p, q, k, one: t - p + q, "sum": lambda t, p, q, k, one: (t - p) * k + q * k,
    "parts": lambda t, p, q, k, one: (t + q) * k - p * k,
    "squares": lambda t, p, q, k, one: (t + q) ** 2 - p**2, "exponentials": lambda t, p, q, k, one: k * gl.exp((t + q) / p) - k * gl.exp(1),
    "cube": lambda t, p, q, k, one: (t - (p - q)) ** 3 + 1 - one, "scaled": lambda t, p, q, k, one: ((t + q - p) ** 3 + 1) * k - k,
}  # fmt: skip


@pytest.mark.parametrize("kind", HIDDEN)
def test_conditions_whose_terms_cancel_switch_once(kind: str) -> None:
    """At t = p - q, or where rounding, of the size of q and amplified by a triple root, no longer hides the sign; also from there on."""

    class Begins(gl.Component):
        x, n = gl.Variable("1", start=0.0), gl.Discrete()
        p, q, k, s, one = (
            gl.Parameter("1", default=2.0),
            gl.Parameter("1", default=1.0),
            gl.Parameter("1", default=1.0),
            gl.Parameter("s", default=1),
            gl.Parameter("1", default=1.0),
        )

        def equations(self) -> list[Any]:
            begun = HIDDEN[kind](gl.time / self.s, self.p, self.q, self.k, self.one) > 0
            return [
                gl.Eq(gl.der(self.x), gl.Piecewise((1, begun), (0, True)) / self.s),
                gl.When(begun, gl.Eq(self.n, gl.pre(self.n) + 1)),
            ]

    system, rng = gl.compile(Begins()), np.random.default_rng(1)
    for i in range(30):
        q, begin, k = (1 + i, 1.0, 3.0) if i < 3 else (10 ** rng.uniform(0, 5), rng.uniform(0.2, 2.5), 10 ** rng.uniform(-4, 4))
        p = q + begin
        begin = p - q
        late = (3e-14 * p) ** (1 / 3) if kind in ("cube", "scaled") else 1e-13 * p + 1e-12
        for method, start in (("rk5", 0.0), ("ida", 0.0), ("rk5", begin)):
            run = system.simulate(3.0, t_start=start, method=method, parameters={"p": p, "q": q, "k": k}, samples=2)
            assert run["x"][-1] == pytest.approx(3 - begin, abs=3 * late), (p, q, k)
            assert start or run["n"][-1] == 1.0
