"""Sensitivities of linear scenes by the derivative of the exponential, against equations written by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, expm_frechet

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from tests.run.tangents.other_runs import off
from tests.trains import Chain

NAMES = ("J", "c", "d", "d_load", "start(body[0].w)")


def by_hand(n: int, J: float, c: float, d: float, d_load: float) -> np.ndarray:
    """The matrix of `Chain` for n deflections and n + 1 speeds, and a torque on the first body as the last, constant state."""
    inertia = J * (1 + 0.3 * np.arange(n + 1))
    stretch = np.eye(n, n + 1) - np.eye(n, n + 1, 1)
    c_i = c * (1 + 0.2 * np.arange(n))
    damping = d * stretch.T @ stretch
    damping[-1, -1] += d_load
    A = np.zeros((2 * n + 2, 2 * n + 2))
    A[:n, n : 2 * n + 1] = stretch
    A[n:-1, :n] = -(stretch.T * c_i) / inertia[:, None]
    A[n:-1, n:-1] = -damping / inertia[:, None]
    A[n, -1] = 1.0 / inertia[0]
    return A


@pytest.mark.parametrize("n", [3, 24])
def test_of_a_chain_by_mass_and_stiffness(n: int) -> None:
    """24 shafts have 49 states: more than the dense exponential takes in any case."""
    at = {"J": 1.0, "c": 100.0, "d": 0.4, "d_load": 0.5}
    system = gl.compile(Chain(n=n + 1, grounded=True, d=0.4), outputs=["shaft[0].phi_rel", "body[2].w"])
    given = {"inputs": {"torque.tau": 3.0}, "start": {"body[0].w": 2.0}}
    run = system.simulate(2.0, samples=5, method="exact", rtol=1e-3, sensitivities=NAMES, **given)
    x0 = np.zeros(2 * n + 2)
    x0[n], x0[-1] = 2.0, 3.0
    for name in NAMES:
        if name.startswith("start"):
            change, begin = np.zeros((2 * n + 2, 2 * n + 2)), np.eye(2 * n + 2)[n]
        else:
            change, begin = _slope(n, at, name), np.zeros(2 * n + 2)
        for k, t in enumerate(run.time):
            E, dE = expm_frechet(by_hand(n, **at) * t, change * t)
            right = dE @ x0 + E @ begin
            for output, place in (("shaft[0].phi_rel", 0), ("body[2].w", n + 2)):
                size = np.abs(run.sensitivity(output, name)).max()
                # phi_rel of a spring is the second flange less the first
                sign = -1.0 if output.startswith("shaft") else 1.0
                assert abs(run.sensitivity(output, name)[k] - sign * right[place]) < 1e-9 * size, (name, output, t)


def _slope(n: int, at: dict[str, float], key: str) -> np.ndarray:
    """The derivative of the matrix: entries are products of powers of parameters, whose differences extrapolate to rounding."""

    def half(step: float) -> np.ndarray:
        there = [by_hand(n, **{**at, key: at[key] + s * step}) for s in (1, -1)]
        return np.asarray((there[0] - there[1]) / (2 * step))

    h = 1e-2 * at[key]
    return (64 * half(h / 4) - 20 * half(h / 2) + half(h)) / 45


class Driven(gl.Component):
    """x' = -k x + a sin(w t + f) + b."""

    k, a, b = gl.Parameter("1/s", default=0.7), gl.Parameter("1/s", default=2.0), gl.Parameter("1/s", default=0.3)
    w, f = gl.Parameter("rad/s", default=5.0), gl.Parameter("rad", default=0.4)
    x = gl.Variable("1", "quantity", start=3.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.k * self.x + self.a * gl.sin(self.w * gl.time + self.f) + self.b)]


def test_of_what_drives_it_by_complex_steps() -> None:
    at = {"k": 0.7, "a": 2.0, "b": 0.3, "w": 5.0, "f": 0.4}
    run = gl.simulate(Driven(), 3.0, samples=7, method="exact", sensitivities=[*at])

    def x(k: Any, a: Any, b: Any, w: Any, f: Any) -> Any:
        t = run.time
        bent = [a * (k * np.sin(w * s + f) - w * np.cos(w * s + f)) / (k * k + w * w) + b / k for s in (t, 0.0)]
        return bent[0] + np.exp(-k * t) * (3.0 - bent[1])

    assert np.allclose(run["x"], x(**at), rtol=1e-12)
    for name, value in at.items():
        right = x(**{**at, name: value + 1e-30j}).imag / 1e-30
        assert off(run.sensitivity("x", name), right) < 1e-12, name


class Pulses(gl.Component):
    """x' = -k x + a between t_0 and t_1; y' = k (x - y) + b t while a sine is above a level."""

    k, a, level = gl.Parameter("1/s", default=0.7), gl.Parameter("1/s", default=2.0), gl.Parameter("1", default=0.5)
    b = gl.Parameter("1/s2", default=2.0)
    t_0, t_1, w = gl.Parameter("s", default=0.5), gl.Parameter("s", default=0.9), gl.Parameter("rad/s", default=5.0)
    x, y = gl.Variable("1", start=1.0), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        on = gl.Piecewise((0.0, gl.time < self.t_0), (self.a, gl.time < self.t_1), (0.0, True))
        waves = gl.Piecewise((self.b * gl.time, gl.sin(self.w * gl.time) > self.level), (0.0, True))
        return [gl.Eq(gl.der(self.x), -self.k * self.x + on), gl.Eq(gl.der(self.y), self.k * (self.x - self.y) + waves)]


def test_of_switching_times() -> None:
    run = gl.simulate(Pulses(), 1.2, samples=13, method="exact", sensitivities=["t_0", "t_1", "a", "k"])
    t = run.time
    assert run.stats["method"] == "exact"
    for name, at, height in (("t_0", 0.5, -2.0), ("t_1", 0.9, 2.0)):  # a sample at the switch belongs to what follows
        right = np.where(t >= at - 1e-12, height * np.exp(-0.7 * (t - at)), 0.0)
        assert np.allclose(run.sensitivity("x", name), right, atol=1e-13), name


@pytest.mark.parametrize("name", ["t_0", "t_1", "w", "level", "k", "a", "start(x)"])
def test_of_switching_times_against_steps(name: str) -> None:
    system = gl.compile(Pulses())
    times = np.linspace(0.03, 2.03, 9)
    exact, steps = (
        system.simulate(2.03, times=times, method=method, rtol=1e-12, sensitivities=[name]) for method in ("exact", "rk8")
    )
    for variable in ("x", "y"):
        right = steps.sensitivity(variable, name)
        assert np.abs(exact.sensitivity(variable, name) - right).max() <= 1e-9 * max(np.abs(right).max(), 1e-9), variable


def test_with_tables_constants_and_sines_together() -> None:
    class Driving(gl.Component):
        def assemble(self) -> list[Any]:
            self.chain = Chain(n=3, grounded=True, d=0.4)
            self.torque = gp.Torque(tau=1.5 * gl.sin(9 * gl.time))
            return [gl.connect(self.torque.flange, self.chain.body[2].flange_b)]

    system = gl.compile(Driving(), outputs=["chain.body[2].w"])
    tau = gl.Table([0.0, 0.3, 0.31, 1.0], [0.0, 2.0, -1.0, 0.5])
    names = ["chain.c", "chain.J", "start(chain.body[0].w)"]
    exact, steps = (
        system.simulate(1.0, samples=9, method=method, rtol=1e-12, inputs={"chain.torque.tau": tau}, sensitivities=names)
        for method in ("exact", "rk8")
    )
    for name in names:
        assert off(exact.sensitivity("chain.body[2].w", name), steps.sensitivity("chain.body[2].w", name)) < 1e-9, name


def test_the_tolerance_does_not_matter_and_states_are_those_of_a_run_without() -> None:
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=500.0), outputs=["w_out", "q_ring"])
    names = ["K_g", "I_r", "e_omega", "start(w_in)"]
    loose, tight = (system.simulate(0.05, samples=51, rtol=rtol, sensitivities=names) for rtol in (1e-2, 1e-12))
    plain = system.simulate(0.05, samples=51)
    assert loose.stats["method"] == "exact"
    for name in names:
        assert off(loose.sensitivity("q_ring", name), tight.sensitivity("q_ring", name)) < 1e-12
    assert off(loose["q_ring"], plain["q_ring"]) < 1e-12


def test_new_numbers_give_new_derivatives() -> None:
    system = gl.compile(Driven())
    for k in (0.7, 1.1, 0.7):
        run = system.simulate(1.0, samples=3, parameters={"k": k, "a": 0.0, "b": 0.0}, sensitivities=["k", "a"])
        assert np.allclose(run.sensitivity("x", "k"), -3.0 * run.time * np.exp(-k * run.time), rtol=1e-12)
        assert abs(run.sensitivity("x", "a")[-1]) > 1e-3  # though the amplitude is zero


def test_what_has_no_exact_derivative() -> None:
    class Waves(gl.Component):
        w = gl.Parameter("rad/s", default=7.0)
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            either = gl.Or(gl.sin(self.w * gl.time) > 0, gl.time < 3.141592653589793 / 7.0)
            return [gl.Eq(gl.der(self.x), gl.Piecewise((1.0, either), (0.0, True)))]

    with pytest.raises(ArgumentError, match=r"change together at t = 0\.448"):
        gl.simulate(Waves(), 0.8, method="exact", sensitivities=["w"])


def test_the_reference_is_right() -> None:
    at = {"J": 1.0, "c": 100.0, "d": 0.4, "d_load": 0.5}
    step = 1e-6
    ends = [expm(by_hand(2, **{**at, "c": 100.0 + s * step})) for s in (1, -1)]
    _, dE = expm_frechet(by_hand(2, **at), _slope(2, at, "c"))
    assert np.allclose((ends[0] - ends[1]) / (2 * step), dE, atol=1e-8)


class Bound(gl.Component):
    """x' = -x + 3 k sin(5 t) + 4 k: amplitudes that follow from a parameter, several times as large."""

    k = gl.Parameter("any", default=0.7)
    wave, level = gl.Parameter("any", default=lambda s: 3 * s.k), gl.Parameter("any", default=lambda s: -4 * s.k)
    x = gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.wave * gl.sin(5.0 * gl.time) - self.level - self.x)]


def test_drives_that_follow_from_a_parameter() -> None:
    """x is in proportion to k."""
    run = gl.compile(Bound()).simulate(2.0, samples=9, method="exact", sensitivities=["k"])
    assert np.abs(run["x"]).max() > 1.0
    assert run.sensitivity("x", "k") == pytest.approx(run["x"] / 0.7, rel=1e-9, abs=1e-12)


class Several(gl.Component):
    """x_i' = -x_i + 1 before a time of its own and + 3 after it, beside an input."""

    u = gl.Input("any")
    t_1, t_2, t_3 = gl.Parameter("s", default=0.3), gl.Parameter("s", default=0.6), gl.Parameter("s", default=0.8)
    y, x_1, x_2, x_3 = gl.Variable("any"), gl.Variable("any"), gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        pairs = ((self.x_1, self.t_1), (self.x_2, self.t_2), (self.x_3, self.t_3))
        switched = [gl.Eq(gl.der(x), gl.Piecewise((1.0, gl.time < t), (3.0, True)) - x) for x, t in pairs]
        return [gl.Eq(gl.der(self.y), self.u - self.y), *switched]


def test_of_the_times_of_several_switches() -> None:
    """Each moves its own state only, by -2 exp(-(t - t_i)) after its switch."""
    names = ["t_1", "t_2", "t_3"]
    run = gl.compile(Several()).simulate(2.0, samples=9, method="exact", inputs={"u": 1.0}, sensitivities=names)
    for i, own in enumerate((0.3, 0.6, 0.8), start=1):
        moved = np.where(run.time > own, -2.0 * np.exp(own - run.time), 0.0)
        for name in names:
            right = moved if name == f"t_{i}" else np.zeros(9)
            assert run.sensitivity(f"x_{i}", name) == pytest.approx(right, rel=1e-9, abs=1e-12)
        assert run.sensitivity("y", f"t_{i}").tolist() == [0.0] * 9


class Drives(gl.Component):
    """Integrals of a constant, of two terms of time, and of one that switches from ``d`` to ``e`` at ``s``."""

    a, b, c, d, e = (gl.Parameter("any", default=value) for value in (2.0, -3.0, 0.7, 4.0, -1.0))
    s = gl.Parameter("s", default=0.6)
    v, w, x, y = (gl.Variable("any") for _ in range(4))
    order = gl.Structural((0, 1, 2, 3))

    def equations(self) -> list[gl.Eq]:
        switched = gl.Piecewise((self.d, gl.time < self.s), (self.e, True))
        rows = [
            gl.Eq(gl.der(self.v), self.a), gl.Eq(gl.der(self.w), self.b * gl.sin(gl.time)),
            gl.Eq(gl.der(self.x), self.c * gl.cos(2 * gl.time)), gl.Eq(gl.der(self.y), switched),
        ]  # fmt: skip
        return [rows[i] for i in self.order]


@pytest.mark.parametrize("names", ["abcdes", "c", "be", "sa"])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 0, 3, 1)], ids=str)
def test_of_integrals_of_drives(order: tuple[int, ...], names: str) -> None:
    """All at once or some, in whatever order they are declared."""
    system, t = gl.compile(Drives(order=order)), np.array([0.0, 0.4, 0.6, 0.9, 2.0])
    found = system.simulate(2.0, times=t, method="exact", sensitivities=list(names))
    expected = {
        ("v", "a"): t, ("w", "b"): 1.0 - np.cos(t), ("x", "c"): np.sin(2 * t) / 2, ("y", "d"): np.minimum(t, 0.6),
        ("y", "e"): np.maximum(t - 0.6, 0.0), ("y", "s"): np.where(t < 0.6, 0.0, 5.0),
    }  # fmt: skip
    for name in "vwxy":
        for by in names:
            own, right = found.sensitivity(name, by), expected.get((name, by), 0.0 * t)
            assert own[t != 0.6] == pytest.approx(right[t != 0.6], rel=1e-12, abs=1e-13), (name, by)
