"""The value of an output at a time does not depend on which other times were asked for, nor on which other outputs were."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import newton

import gearlib as gl
from tests.run.test_constrained import released

# Andrews' squeezing mechanism: F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4 (2008), chapter II-7.
M1, M2, M3, M4, M5, M6, M7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
XA, YA, XB, YB, XC, YC = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
D, DA, E, EA, RR, RA = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092
SS, SA, SB, SC, SD, TA, TB = 0.035, 0.01874, 0.01043, 0.018, 0.02, 0.02308, 0.00916
U, UA, UB, ZF, ZT, FA, C0, L0, MOM = 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421, 4530.0, 0.07785, 0.033
ANGLES = ("beta", "theta", "gamma", "phi", "delta", "omega", "eps")
START = (
    -0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550, -0.222668390165885885,
    1.23054744454982119,
)  # fmt: skip
AT_THE_END = (
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304, 0.5347301163226948,
    1.048080741042263,
)  # at 0.03 s, from the test set  # fmt: skip
# Each constraint is a sum of c cos(sum of angles + phase), and a constant.
QUARTER = np.pi / 2
CRANK_X, CRANK_Y = [(RR, (0,), 0.0), (-D, (0, 1), 0.0)], [(RR, (0,), -QUARTER), (-D, (0, 1), -QUARTER)]
CONSTRAINTS: list[tuple[list[tuple[float, tuple[int, ...], float]], float]] = [
    ([*CRANK_X, (-SS, (2,), -QUARTER)], -XB),
    ([*CRANK_Y, (SS, (2,), 0.0)], -YB),
    ([*CRANK_X, (-E, (3, 4), -QUARTER), (-ZT, (4,), 0.0)], -XA),
    ([*CRANK_Y, (E, (3, 4), 0.0), (-ZT, (4,), -QUARTER)], -YA),
    ([*CRANK_X, (-ZF, (5, 6), 0.0), (-U, (6,), -QUARTER)], -XA),
    ([*CRANK_Y, (-ZF, (5, 6), -QUARTER), (U, (6,), 0.0)], -YA),
]


def mechanism(q: Any, w: Any, cos: Any, sin: Any, sqrt: Any) -> tuple[dict[tuple[int, int], Any], list[Any]]:
    """Entries of the mass matrix, upper half, and the forces."""
    _, theta, gamma, phi, _, omega, _ = q
    lever, rod = E - EA, ZF - FA
    mass = {
        (0, 0): M1 * RA**2 + M2 * (RR**2 - 2 * DA * RR * cos(theta) + DA**2) + I1 + I2,
        (0, 1): M2 * (DA**2 - DA * RR * cos(theta)) + I2,
        (1, 1): M2 * DA**2 + I2,
        (2, 2): M3 * (SA**2 + SB**2) + I3,
        (3, 3): M4 * lever**2 + I4,
        (3, 4): M4 * (lever**2 + ZT * lever * sin(phi)) + I4,
        (4, 4): M4 * (ZT**2 + 2 * ZT * lever * sin(phi) + lever**2) + M5 * (TA**2 + TB**2) + I4 + I5,
        (5, 5): M6 * rod**2 + I6,
        (5, 6): M6 * (rod**2 - U * rod * sin(omega)) + I6,
        (6, 6): M6 * (rod**2 - 2 * U * rod * sin(omega) + U**2) + M7 * (UA**2 + UB**2) + I6 + I7,
    }
    xd, yd = SD * cos(gamma) + SC * sin(gamma) + XB, SD * sin(gamma) - SC * cos(gamma) + YB
    length = sqrt((xd - XC) ** 2 + (yd - YC) ** 2)
    pull = -C0 * (length - L0) / length
    fx, fy = pull * (xd - XC), pull * (yd - YC)
    forces = [
        MOM - M2 * DA * RR * w[1] * (w[1] + 2 * w[0]) * sin(theta),
        M2 * DA * RR * w[0] ** 2 * sin(theta),
        fx * (SC * cos(gamma) - SD * sin(gamma)) + fy * (SD * cos(gamma) + SC * sin(gamma)),
        M4 * ZT * lever * w[4] ** 2 * cos(phi),
        -M4 * ZT * lever * w[3] * (w[3] + 2 * w[4]) * cos(phi),
        -M6 * U * rod * w[6] ** 2 * cos(omega),
        M6 * U * rod * w[5] * (w[5] + 2 * w[6]) * cos(omega),
    ]
    return mass, forces


class Andrews(gl.Component):
    """Seven angles, six constraints and their multipliers: one degree of freedom."""

    beta, theta, gamma, phi, delta, omega, eps = (gl.Variable("1", "angle", start=s) for s in START)
    v_beta, v_theta, v_gamma, v_phi, v_delta, v_omega, v_eps = (gl.Variable("1/s", "its speed", start=0.0) for _ in START)
    l1, l2, l3, l4, l5, l6 = (gl.Variable("1", "multiplier") for _ in CONSTRAINTS)

    def equations(self) -> list[Any]:
        q, w = [getattr(self, n) for n in ANGLES], [getattr(self, f"v_{n}") for n in ANGLES]
        multipliers = [self.l1, self.l2, self.l3, self.l4, self.l5, self.l6]
        mass, forces = mechanism(q, w, gl.cos, gl.sin, gl.sqrt)
        found = [gl.Eq(gl.der(a), b) for a, b in zip(q, w, strict=True)]
        for i in range(7):
            inertia = sum(mass.get((min(i, j), max(i, j)), 0) * gl.der(w[j]) for j in range(7))
            held = sum(
                m * c * gl.cos(sum(q[k] for k in angles) + phase + QUARTER)
                for m, (terms, _) in zip(multipliers, CONSTRAINTS, strict=True)
                for c, angles, phase in terms
                if i in angles
            )
            found.append(gl.Eq(inertia, forces[i] - held))
        for terms, constant in CONSTRAINTS:
            found.append(gl.Eq(sum(c * gl.cos(sum(q[k] for k in angles) + phase) for c, angles, phase in terms) + constant, 0))
        return found


def by_hand(t: float, z: Any) -> Any:
    """The same with its constraints differentiated twice."""
    q, w = z[:7], z[7:]
    mass, forces = mechanism(q, w, np.cos, np.sin, np.sqrt)
    matrix, right = np.zeros((13, 13)), np.zeros(13)
    for (i, j), value in mass.items():
        matrix[i, j] = matrix[j, i] = value
    right[:7] = forces
    for row, (terms, _) in enumerate(CONSTRAINTS, 7):
        for c, angles, phase in terms:
            angle, speed = sum(q[k] for k in angles) + phase, sum(w[k] for k in angles)
            for k in angles:
                matrix[row, k] -= c * np.sin(angle)
            right[row] += c * np.cos(angle) * speed**2
        matrix[:7, row] = matrix[row, :7]
    return np.concatenate([w, np.linalg.solve(matrix, right)[:7]])


@lru_cache(maxsize=1)
def trajectory() -> Any:
    found = solve_ivp(by_hand, (0.0, 0.03), [*START, *[0.0] * 7], rtol=1e-11, atol=1e-12, method="DOP853", dense_output=True)
    return found.sol


def test_the_reference_is_that_of_the_test_set() -> None:
    assert trajectory()(0.03)[:7] == pytest.approx(AT_THE_END, rel=1e-6)


@pytest.mark.parametrize(
    ("state", "method", "samples"),
    [
        ("beta", "rk", 3),
        ("theta", "ida", 2),
        pytest.param("beta", "ida", 2, marks=pytest.mark.slow),
        pytest.param("theta", "rk", 3, marks=pytest.mark.slow),
    ],
)
def test_andrews_mechanism_with_few_samples(state: str, method: str, samples: int) -> None:
    """The crank turns several times, its constraints have other solutions, and with theta IDA changes the states on the way."""
    system = gl.compile(Andrews(state={state: "prefer"}), outputs=["beta"])
    result = system.simulate(0.03, samples=samples, method=method, rtol=1e-9)
    right = trajectory()(result.time)
    for k, name in enumerate(ANGLES):
        assert result[name] == pytest.approx(right[k], rel=1e-4, abs=1e-4), name
    if method == "rk" or state == "theta":  # IDA may change those that begin with beta, too
        assert ("segments" in result.stats) == (method == "ida")


@lru_cache
def pendulum(angle: float, speed: float) -> Any:
    return released(angle, speed)


@settings(max_examples=6, deadline=None)
@given(
    st.sampled_from([(1.7, 0.0), (3.0, 0.1), (0.3, 9.0)]), st.sampled_from(["ida", "rk", "auto"]),
    st.lists(st.floats(0.01, 4.0), min_size=1, max_size=5, unique=True),
)  # fmt: skip
def test_pendulums_that_go_through_several_sets_of_states(start: Any, method: str, times: list[float]) -> None:
    times = sorted(times)
    options = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853", "t_eval": times}
    angle = solve_ivp(lambda t, z: [z[1], -9.81 * np.sin(z[0])], (0.0, times[-1]), start, **options).y[0]
    result = pendulum(*start).simulate(times[-1], times=times, method=method, rtol=1e-9)
    assert result["x"] == pytest.approx(np.sin(angle), abs=1e-5)
    assert result["y"] == pytest.approx(-np.cos(angle), abs=1e-5)


class Compared(gl.Component):
    """Turns of a on the solution of sin(b - a) = 0.3 sin(b) that goes with it; a relation of b counts in y, in z also within the loop."""

    a = gl.Variable("1", "given", start=0.0)
    b = gl.Variable("1", "follows a")
    y = gl.Variable("1", "of b, and whether it is large")
    z = gl.Variable("1", "follows a with a shift once it is large")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), 3.0),
            gl.Eq(gl.sin(self.b - self.a), 0.3 * gl.sin(self.b)),
            gl.Eq(self.y + 0.1 * gl.sin(self.y), gl.Piecewise((self.b, self.b > 10.0), (0.0, True))),
            gl.Eq(gl.sin(self.z - self.a), 0.3 * gl.sin(self.z) + gl.Piecewise((0.1, self.z > 10.0), (0.0, True))),
        ]


@lru_cache
def compared(end: float) -> tuple[float, float, float]:
    """The same in small steps by hand."""

    def root(f: Any, near: float) -> float:
        return float(newton(f, near, tol=1e-13))

    b = z = shift = 0.0
    for a in np.linspace(0.0, 3.0 * end, 1001):
        b = root(lambda b, a=a: np.sin(b - a) - 0.3 * np.sin(b), b)
        for _ in range(2):  # once more with the shift that is found
            z = root(lambda z, a=a, shift=shift: np.sin(z - a) - 0.3 * np.sin(z) - shift, z)
            shift = 0.1 if z > 10.0 else 0.0
    return b, root(lambda y: y + 0.1 * np.sin(y) - (b if b > 10.0 else 0.0), b), z


@pytest.mark.parametrize(
    ("method", "outputs", "end", "samples"), [("exact", None, 5.0, 2), ("ida", ("z",), 2.5, 3), ("rk", ("y",), 5.0, 3)]
)
def test_relations_of_a_nonlinear_loop(method: str, outputs: Any, end: float, samples: int) -> None:
    """They hold or not on the branch that the run is on, whether or not the run had need of them."""
    result = gl.compile(Compared(), outputs=outputs).simulate(end, samples=samples, method=method)
    assert [result[name][-1] for name in "byz"] == pytest.approx(compared(end), rel=1e-9)
