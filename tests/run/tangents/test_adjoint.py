"""Adjoint gradients, against closed forms, complex steps through scipy, and the tangents of the same run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import fresnel

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError, SolverError
from gearlib.program import derivatives
from gearlib.run.tangents.adjoint import Adjoint
from tests.run.tangents.test_sensitivities import Closed, Decay, Implicit
from tests.trains import Chain

XP = ["K_g", "C_g", "I_r", "R_s", "e_amplitude", "e_omega", "e_phase", "start(w_in)"]


def as_tangents(system: gl.System, names: list[str], outputs: list[str], t_end: float, **options: Any) -> None:
    """The gradient of a random weighting of samples is that of the tangents, by another road through time."""
    rng = np.random.default_rng(5)
    run = system.simulate(t_end, samples=23, rtol=1e-10, sensitivities=names, **options)
    weights = {name: rng.normal(size=23) / np.abs(run[name]).max() for name in outputs}
    found = system.simulate(t_end, samples=23, **options).gradient(weights, names)
    for name in names:
        parts = [weights[output] * run.sensitivity(output, name) for output in outputs]
        assert abs(found[name] - np.sum(parts)) < 1e-6 * np.abs(parts).sum(), name


@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
def test_of_a_decay(method: str) -> None:
    run = gl.compile(Decay()).simulate(2.0, times=[0.5, 2.0], method=method)
    found = run.gradient({"x": [1.0, 2.0], "y": [0.0, 3.0]}, ["k", "start(x)"])
    t, decay = np.array([0.5, 2.0]), np.exp(-0.7 * np.array([0.5, 2.0]))
    by_k = -3.0 * t * decay @ [1.0, 2.0] + 3 * 3.0 * (2 * 0.7 - 0.7**2 * 2.0) * 2.0 * decay[1]
    by_x = decay @ [1.0, 2.0] + 3 * 0.7**2 * 2.0 * decay[1]
    assert found == pytest.approx({"k": by_k, "start(x)": by_x}, rel=1e-8)


@pytest.mark.parametrize("samples", [2, 3, 40, 700])
def test_every_sample_has_its_weight(samples: int) -> None:
    """Also where there are more of them than steps."""
    run = gl.compile(Decay()).simulate(2.0, samples=samples)
    weights = np.cos(np.arange(samples)) / samples
    found = run.gradient({"x": weights}, ["k", "start(x)"])
    decay = np.exp(-0.7 * run.time)
    assert found == pytest.approx({"k": -3.0 * weights @ (run.time * decay), "start(x)": weights @ decay}, rel=1e-7, abs=1e-9)


def test_of_the_xp_train() -> None:
    train = gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=500.0, e_phase=0.1)
    as_tangents(gl.compile(train, outputs=["w_out", "q_ring"]), XP, ["w_out", "q_ring", "der(w_out)"], 0.01)


class Swing(gl.Component):
    """A driven pendulum with a friction that saturates."""

    g = gl.Parameter("1", default=20.0)
    b = gl.Parameter("1", default=0.4)
    phi = gl.Variable("1", start=1.0)
    w = gl.Variable("1", start=0.0)
    u = gl.Input("1")

    def equations(self) -> list[Any]:
        rate = -self.g * gl.sin(self.phi) - self.b * gl.tanh(5 * self.w) + self.u + gl.cos(9 * gl.time) / self.g
        return [gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.w), rate)]


def test_of_a_pendulum_by_complex_steps() -> None:
    """Derivatives without differences: a step of 1e-30 along the imaginary axis, with scipy's integrator."""
    corners = np.array([0.0, 0.3, 0.31, 2.0])
    heights = np.array([0.0, 0.0, 4.0, 1.0])
    run = gl.compile(Swing()).simulate(2.0, samples=11, inputs={"u": gl.Table(corners, heights)})
    found = run.gradient({"phi": 2 * run["phi"], "w": np.arange(11.0)}, ["g", "b", "start(phi)"])

    def number(g: Any, b: Any, phi: Any) -> Any:
        def rate(t: float, x: Any) -> Any:
            drive = np.interp(t, corners, heights) + np.cos(9 * t) / g
            return np.array([x[1], -g * np.sin(x[0]) - b * np.tanh(5 * x[1]) + drive])

        x, samples = np.array([phi, 0.0], complex), [np.array([phi, 0.0], complex)]
        for a, end in zip(run.time[:-1], run.time[1:], strict=True):
            for first, last in zip((cut := [a, *corners[(corners > a) & (corners < end)], end])[:-1], cut[1:], strict=True):
                x = solve_ivp(rate, (first, last), x, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            samples.append(x)
        history = np.array(samples)
        return 2 * run["phi"] @ history[:, 0] + np.arange(11.0) @ history[:, 1]

    given = {"g": 20.0, "b": 0.4, "start(phi)": 1.0}
    for name in given:
        turned = [value + (1e-30j if key == name else 0.0) for key, value in given.items()]
        assert found[name] == pytest.approx(number(*turned).imag / 1e-30, rel=1e-6)


def test_through_constant_linear_blocks() -> None:
    names = ["load.J", "motor.J", "planetary.ratio", "closing.ratio", "shaft.c", "fan.tau_nominal"]
    as_tangents(gl.compile(Closed()), names, ["load.w", "shaft.tau", "planetary.sun.tau"], 0.3)


def test_through_blocks_that_are_solved_by_iteration() -> None:
    as_tangents(gl.compile(Implicit(start={"x": 2.0})), ["a", "k", "start(x)"], ["x", "r"], 1.5)


class Chirp(gl.Component):
    """The integral of the cosine of an angle that is accelerated from rest: a Fresnel integral."""

    a = gl.Parameter("1", "amplitude", default=2.0)
    alpha = gl.Parameter("1", "angular acceleration", default=400.0)
    phi, w, y = (gl.Variable("1", start=0.0) for _ in range(3))

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(gl.der(self.w), self.alpha),
            gl.Eq(gl.der(self.y), self.a * gl.cos(self.phi)),
        ]


def test_a_motion_may_become_fast() -> None:
    """Nothing at the start tells how many steps that takes; they are halved for as long as that helps."""
    found = gl.simulate(Chirp(), 3.0, samples=11, rtol=1e-9).gradient({"y": np.eye(11)[-1]}, ["a", "alpha"])
    unit = np.sqrt(np.pi / 400.0)
    integral = unit * fresnel(3.0 / unit)[1]
    by_alpha = 2.0 * (3.0 * np.cos(400.0 * 3.0**2 / 2) - integral) / (2 * 400.0)  # y = integral(a cos(alpha t^2 / 2)), by parts
    assert found == pytest.approx({"a": integral, "alpha": by_alpha}, rel=1e-7)


class Pushed(gl.Component):
    """Two braked bodies that a torque accelerates together: damping between them hardly changes their speeds."""

    def assemble(self) -> list[Any]:
        self.push, self.ground = gp.ConstantTorque(tau_constant=2.6), gp.Fixed()
        self.body, self.other, self.brake = gp.Inertia(J=0.035), gp.Inertia(J=0.028), gp.Damper(d=0.6)
        self.shaft = gp.SpringDamper(c=3000.0, d=3.3)
        return [
            gl.connect(self.push.flange, self.body.flange_a, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
            gl.connect(self.body.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.other.flange_a),
        ]


def test_what_cancels_to_the_tightest_tolerance() -> None:
    names = ["brake.d", "shaft.d", "body.J"]
    run = gl.compile(Pushed()).simulate(0.4, times=[0.27, 0.4], rtol=1e-9, sensitivities=names)
    found = run.gradient({"body.w": [1.0, 1.0]}, names)
    for name in names:
        assert found[name] == pytest.approx(run.sensitivity("body.w", name).sum(), rel=1e-8, abs=1e-9), name


def test_a_bound_parameter_that_is_given_does_not_follow() -> None:
    system = gl.compile(Chain(grounded=True), outputs=["body[3].w"])
    options: dict[str, Any] = {"inputs": {"torque.tau": 1.0}, "parameters": {"body[1].J": 1.3}}
    as_tangents(system, ["J", "c", "body[1].J"], ["body[3].w"], 1.0, **options)
    as_tangents(gl.compile(Chain(grounded=True)), ["J"], ["body[3].phi"], 1.0, inputs={"torque.tau": 1.0})


def test_the_cost_does_not_grow_with_the_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """One reverse pass serves all parameters; forward, each needs a tangent of its own."""
    chain = gl.compile(Chain(grounded=True), outputs=["body[3].w"])
    run = chain.simulate(1.0, samples=5, inputs={"torque.tau": 1.0})
    work: list[int] = []
    pulled = derivatives.pulled_back

    def counted(plan: Any, at: Any, weights: Any) -> Any:
        work.append(plan.n_entries * len(at.t))
        return pulled(plan, at, weights)

    monkeypatch.setattr("gearlib.run.tangents.adjoint.pulled_back", counted)
    spent = []
    for names in (["c"], [*(f"body[{k}].J" for k in range(4)), *(f"shaft[{k}].c" for k in range(3)), "J", "c", "d"]):
        work.clear()
        run.gradient({"body[3].w": np.ones(5)}, names)
        spent.append(sum(work))
    assert spent[1] < 1.6 * spent[0]


def test_what_is_refused() -> None:
    system = gl.compile(Decay())
    run = system.simulate(2.0, samples=3)
    for weights, names, error, text in (
        ({"x": [1.0, 2.0]}, ["k"], ArgumentError, r"weights\['x'\] has the shape \(2,\); expected 3 numbers"),
        ({}, ["k"], ArgumentError, "weights is empty"),
        ({"x": np.ones(3)}, [], ArgumentError, "names is empty"),
        ({"z": np.ones(3)}, ["k"], NameLookupError, "'z'"),
        ({"x": np.ones(3)}, ["kk"], NameLookupError, "kk"),
    ):
        with pytest.raises(error, match=text):
            run.gradient(weights, names)


def test_events_are_refused_by_name(tmp_path: Any) -> None:
    class Ball(gl.Component):
        h, v = gl.Variable("m", start=1.0), gl.Variable("m/s")
        e = gl.Parameter("1", default=0.8)

        def equations(self) -> list[Any]:
            bounce = gl.When(self.h < 0, gl.reinit(self.v, -self.e * self.v))
            return [gl.Eq(gl.der(self.h), self.v), gl.Eq(gl.der(self.v), -9.81), bounce]

    run = gl.compile(Ball()).simulate(1.0, samples=3)
    with pytest.raises(ArgumentError, match=r"no adjoint gradient through events \(.*h.*\); simulate\(sensitivities"):
        run.gradient({"h": np.ones(3)}, ["e"])
    run.save(tmp_path / "run.nc")
    with pytest.raises(ArgumentError, match="from a file has no gradients"):
        gl.load_result(tmp_path / "run.nc").gradient({"h": np.ones(3)}, ["e"])


def test_a_weight_at_the_start_only() -> None:
    """The start value is what it is, whatever follows; also where there is no other sample."""
    for times, weights in (([0.0], [2.0]), ([0.0, 1.0, 2.0], [2.0, 0.0, 0.0])):
        run = gl.compile(Decay()).simulate(2.0, times=times)
        assert run.gradient({"x": weights}, ["k", "start(x)"]) == pytest.approx({"k": 0.0, "start(x)": 2.0}, abs=1e-12)


def refined(rests: list[list[float]], sizes: list[float], rtol: float, exact: Any = (1.0, 1e-6)) -> Any:
    """The gradient with sums that miss the exact values by some rests in turn; and the numbers of steps taken."""
    taken: list[int] = []

    def integrated(jumps: Any, steps: int) -> Any:
        assert jumps == "jumps"
        taken.append(steps)
        return np.asarray(exact) + rests[min(len(taken), len(rests)) - 1]

    own: Any = SimpleNamespace(
        directions=SimpleNamespace(sizes=np.array(sizes)),
        _integrated=integrated,
        _at_samples=lambda: ("jumps", np.array([0.5, 0.0])),
    )
    try:
        found = Adjoint.gradient(own, rtol, 16)
    except SolverError as problem:
        return str(problem), taken
    return found.tolist(), taken


@pytest.mark.parametrize(
    ("rest", "sizes", "rtol", "steps"),
    [
        ([2.9e-6, 0.0], [1.0, 1.0], 1e-6, [16, 32, 64]),  # 2e-6 of 1.5 + 1.5e-3
        ([3.1e-6, 0.0], [1.0, 1.0], 1e-6, [16, 32, 64, 128]),
        ([0.0, 2.9e-9], [1.0, 1.0], 1e-6, [16, 32, 64]),  # of 1e-6 + a thousandth of the largest
        ([0.0, 3.1e-9], [1.0, 1.0], 1e-6, [16, 32, 64, 128]),
        ([0.0, 2.9e-9 / 4], [1.0, 4.0], 1e-6, [16, 32, 64]),  # the largest change by parameters as large as they are
        ([0.0, 3.1e-9 / 4], [1.0, 4.0], 1e-6, [16, 32, 64, 128]),
        ([0.0, 2.9e-10], [1.0, 1.0], 1e-9, [16, 32, 64]),  # of 1e-6 + a tenth: no finer than the motion
        ([0.0, 3.1e-10], [1.0, 1.0], 1e-9, [16, 32, 64, 128]),
    ],
)
def test_steps_are_halved_until_the_gradient_rests(
    rest: list[float], sizes: list[float], rtol: float, steps: list[int]
) -> None:
    """Between the second sum and the third half of the rest is left, and a quarter between the third and the fourth."""
    rests = [[100.0 * r + 1e-3 for r in rest], rest, [r / 2 for r in rest], [r / 4 for r in rest]]
    found, taken = refined(rests, sizes, rtol)
    assert taken == steps
    assert found == pytest.approx([1.5 + rests[len(taken) - 1][0], 1e-6 + rests[len(taken) - 1][1]], rel=1e-12)


@pytest.mark.parametrize(("ratio", "halvings"), [(0.5, 7), (0.11, 7), (0.09, 10)])
def test_halving_goes_on_where_it_helps(ratio: float, halvings: int) -> None:
    """After seven times, while each change is less than a tenth of the one before."""
    rests = [[0.3 * ratio**k, 0.0] for k in range(20)]
    found, taken = refined(rests, [1.0, 1.0], 1e-12)
    assert len(taken) == 1 + halvings
    if halvings == 7:
        assert found == f"the gradient still changes with the step at {16 * 2**7} steps; the motion may be chaotic, or stiff"


def test_a_run_may_begin_with_a_discrete_variable_on_which_nothing_depends() -> None:
    class Counting(gl.Component):
        k = gl.Parameter("1/s", default=0.5)
        x, n = gl.Variable("1", start=2.0), gl.Discrete()

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.k * self.x), gl.When(gl.time > 0.5, gl.Eq(self.n, gl.pre(self.n) + 1))]

    run = gl.compile(Counting(), outputs=["x"]).simulate(1.0, samples=2, start={"n": 3.0, "x": 4.0})
    found = run.gradient({"x": [0.0, 1.0]}, ["k", "start(x)"])
    assert found == pytest.approx({"k": -4.0 * np.exp(-0.5), "start(x)": np.exp(-0.5)}, rel=1e-7)
