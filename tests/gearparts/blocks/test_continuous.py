"""Linear blocks against scipy.signal, python-control and closed forms."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from scipy.signal import lsim, lti

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from tests.gearparts.blocks.bench import Driven, answer, close

B = gp.blocks
DRIVE = gl.sin(3 * gl.time) + gl.time**2 / 2


def drive(t: Any) -> Any:
    return np.sin(3 * t) + t**2 / 2


def simulated(b: Any, a: Any) -> Any:
    """Response of a transfer function to `drive`, with straight lines between many points."""
    t = np.linspace(0.0, 2.0, 41)
    fine = np.linspace(0.0, 2.0, 8001)
    _, y, _ = lsim(lti(b, a), drive(fine), fine)
    return np.interp(t, fine, y)


K, T, W, D = 2.5, 0.3, 4.0, 0.2
LAWS = [
    pytest.param(B.Gain, {"k": K}, [K], [1.0], id="Gain"),
    pytest.param(B.Integrator, {"k": K}, [K], [1.0, 0.0], id="Integrator"),
    pytest.param(B.Derivative, {"k": K, "T": T}, [K, 0.0], [T, 1.0], id="Derivative"),
    pytest.param(B.FirstOrder, {"k": K, "T": T}, [K], [T, 1.0], id="FirstOrder"),
    pytest.param(B.SecondOrder, {"k": K, "w": W, "D": D}, [K * W**2], [1.0, 2 * D * W, W**2], id="SecondOrder"),
    pytest.param(B.PI, {"k": K, "T": T}, [K * T, K], [T, 0.0], id="PI"),
    pytest.param(
        B.PID, {"k": K, "Ti": 0.7, "Td": 0.2, "Nd": 5.0},
        K * (np.poly1d([0.7, 0]) * np.poly1d([0.04, 1]) + np.poly1d([0.04, 1]) + np.poly1d([0.7 * 0.2, 0, 0])).coeffs,
        (np.poly1d([0.7, 0]) * np.poly1d([0.04, 1])).coeffs, id="PID",
    ),
    pytest.param(B.TransferFunction, {"b": (2.0, 3.0), "a": (0.5, 0.4, 6.0, 1.0)}, [2.0, 3.0], [0.5, 0.4, 6.0, 1.0], id="strictly proper"),
    pytest.param(B.TransferFunction, {"b": [2, 0, 1], "a": np.array([0.5, 1, 4])}, [2, 0, 1], [0.5, 1, 4], id="proper"),
    pytest.param(B.TransferFunction, {"b": [3.0], "a": [2.0]}, [1.5], [1.0], id="constant"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "b", "a"), LAWS)
def test_linear_blocks_are_their_transfer_functions(kind: Any, values: Any, b: Any, a: Any) -> None:
    _, y = answer(kind, u=DRIVE, **values)
    assert close(y, simulated(b, a), 1e-6)


@pytest.mark.parametrize(("kind", "values", "b", "a"), LAWS)
def test_linearised_they_have_the_poles_of_their_transfer_functions(kind: Any, values: Any, b: Any, a: Any) -> None:
    linear = gl.compile(Driven(make=lambda: kind(**values))).linearize(["block.u"], ["block.y"])
    s = 1j * np.array([0.3, 1.0, 7.0])
    expected = np.polyval(b, s) / np.polyval(a, s)
    assert np.asarray([complex(np.squeeze(linear(x))) for x in s]) == pytest.approx(expected, rel=1e-9)


def test_sums_and_products() -> None:
    two = {"u1": 2.0 * gl.time, "u2": 3.0}
    t, y = answer(B.Add, k1=2.0, k2=-1.0, **two)
    assert close(y, 4 * t - 3, 1e-14)
    assert close(answer(B.Add3, k3=5.0, u3=gl.time, **two)[1], 7 * t + 3, 1e-14)
    assert close(answer(B.Feedback, **two)[1], 2 * t - 3, 1e-14)
    assert close(answer(B.Product, **two)[1], 6 * t, 1e-14)


def test_a_state_space_block_is_its_system() -> None:
    system = control.ss(
        [[-0.2, 1.5, 0.0], [-2.0, -0.3, 0.4], [0.0, 1.0, -1.0]], [[0.0], [1.0], [0.5]], [[1.0, 0.0, 2.0]], [[0.3]]
    )
    fine = np.linspace(0.0, 2.0, 8001)
    expected = control.forced_response(system, fine, drive(fine)).outputs[::200]
    _, y = answer(B.StateSpace.of, system=system, u=DRIVE)
    assert close(y, expected, 1e-6)
    given = {"A": system.A, "B": system.B, "C": system.C, "D": 0.3}
    assert close(answer(B.StateSpace, u=DRIVE, **given)[1], y, 1e-12)
    poly = control.tf([1.0, 2.0], [1.0, 3.0, 5.0])
    assert close(
        answer(B.StateSpace.of, system=poly, u=DRIVE)[1], answer(B.TransferFunction, b=[1, 2], a=[1, 3, 5], u=DRIVE)[1], 1e-9
    )


def test_start_values_of_states() -> None:
    t, y = answer(B.Integrator, u=0.0, start={"y": 2.0})
    assert (y == 2.0).all()
    t, y = answer(B.StateSpace, A=[[-3.0]], B=[1.0], C=[2.0], u=0.0, start={"x[0].y": 0.5})
    assert close(y, np.exp(-3 * t), 1e-9)


def test_several_inputs_and_outputs() -> None:
    system = control.rss(4, 2, 3, strictly_proper=False)
    A = system.A - 0.1 * np.eye(4)

    class Two(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.wave, self.ramp = B.Sine(f=0.5), B.Ramp(duration=1.0)
            self.plant = B.MultiStateSpace.of(control.ss(A, system.B, system.C, system.D))
            first, second, third = self.plant.inputs
            return [gl.connect(self.wave.y, first.u, third.u), gl.connect(self.ramp.y, second.u)]

    r = gl.simulate(Two(), 2.0, samples=41, rtol=1e-10)
    fine = np.linspace(0.0, 2.0, 8001)
    wave, ramp = np.sin(np.pi * fine), np.minimum(fine, 1.0)
    expected = control.forced_response(control.ss(A, system.B, system.C, system.D), fine, [wave, ramp, wave]).outputs[:, ::200]
    for i in range(2):
        assert close(r[f"plant.outputs[{i}].y"], expected[i], 1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: B.TransferFunction(b=[1, 2, 3], a=[1, 2]), r"block: b is .*at most as many coefficients"),
        (lambda: B.TransferFunction(a=[0.0, 2.0]), r"first coefficient of a that is not 0"),
        (lambda: B.TransferFunction(a=["x"]), r"a is \('x',\); expected a sequence of finite numbers"),
        (
            lambda: B.TransferFunction(b=[[1.0, 2.0], [3.0, 4.0]], a=[1.0, 2.0, 3.0, 4.0, 5.0]),
            r"b is .*; expected a sequence of finite numbers",
        ),
        (lambda: B.StateSpace(A=[[1.0, 2.0]], B=[1.0], C=[1.0]), r"expected n x n, n and n numbers"),
        (lambda: B.StateSpace.of(control.rss(2, 2, 1)), r"1 inputs and 2 outputs; MultiStateSpace"),
        (lambda: B.StateSpace.of(control.ss(1, 1, 1, 0, 0.1)), r"discrete, with a sample time of 0\.1; gl\.Sampled"),
        (lambda: B.StateSpace.of(3.0), r"StateSpace\.of\(3\.0\): expected a control\.StateSpace"),
        (lambda: B.StateSpace(A=[[1.0]], B=[1.0, 2.0], C=[1.0]), r"expected n x n, n and n numbers"),
        (lambda: B.StateSpace(A=[[1.0]], B=[1.0], C=[]), r"expected n x n, n and n numbers"),
        (lambda: B.StateSpace(A=[[np.inf]], B=[1.0], C=[1.0]), r"a row of A is .*; expected a sequence of finite numbers"),
        (
            lambda: B.MultiStateSpace(A=[[1.0, 0.0]], B=[[1.0]], C=[[1.0]]),
            r"do not fit each other: A 1 x 2, B 1 x 1, C 1 x 1, D 1 x 1",
        ),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0], [2.0]], C=[[1.0]]), r"A 1 x 1, B 2 x 1, C 1 x 1"),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0]], C=[[1.0]], D=[[1.0], [2.0]]), r"C 1 x 1, D 2 x 1"),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0]], C=[[1.0]], D=[[1.0, 2.0]]), r"C 1 x 1, D 1 x 2"),
        (lambda: B.MultiStateSpace(B=[[1.0]], C=[[1.0]]), r"A 0 x 0, B 1 x 1, C 1 x 1"),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[]], C=[[1.0]], D=[[]]), r"A 1 x 1, B 1 x 0, C 1 x 1, D 1 x 0"),
        (
            lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0]], C=[[1.0], [1.0, 2.0]], D=[[1.0], [2.0], [3.0]]),
            r"A 1 x 1, B 1 x 1, C 2 x 1, D 3 x 1",
        ),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0]]), r"A 1 x 1, B 1 x 1, C 0 x 0, D 0 x 0"),
        (lambda: B.MultiStateSpace(A=[[1.0]], B=[[1.0]], C=[[1.0, 2.0]]), r"do not fit each other: A 1 x 1, B 1 x 1, C 1 x 2"),
    ],
)
def test_matrices_that_are_refused(make: Any, message: str) -> None:
    with pytest.raises(BindingError, match=message):
        flatten(Driven(make=make))


class NothingPassed(gl.Component):
    """One state with two inputs and two outputs, and nothing that is passed on at once."""

    def assemble(self) -> list[Any]:
        self.a, self.b = B.Constant(k=1.0), B.Constant(k=2.0)
        self.plant = B.MultiStateSpace(A=[[-2.0]], B=[[1.0, 4.0]], C=[[3.0], [0.5]])
        return [gl.connect(self.a.y, self.plant.inputs[0].u), gl.connect(self.b.y, self.plant.inputs[1].u)]


def test_without_a_matrix_d_outputs_follow_the_states_only() -> None:
    run = gl.simulate(NothingPassed(), t_end=1.0, samples=5, rtol=1e-10)
    x = 4.5 * (1 - np.exp(-2 * run.time))
    assert run["plant.outputs[0].y"] == pytest.approx(3 * x, abs=1e-8)
    assert run["plant.outputs[1].y"] == pytest.approx(0.5 * x, abs=1e-8)
