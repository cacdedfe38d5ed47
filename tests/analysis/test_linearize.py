"""Linear models against derivations by hand, and their names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearparts import zhou_cui_2022 as zc


def test_matrices_equal_a_derivation_by_hand(chain: Callable[..., gl.System]) -> None:
    """Twists and speeds as states: twist' = w_b - w_a, J w' = torques; every entry, by its names."""
    n, J, c, d, d_load = 4, 0.7, 310.0, 1.7, 2.2
    model = chain(n=n, grounded=True).linearize(
        ["torque.tau"], [f"shaft[{i}].tau" for i in range(n - 1)] + ["body[3].w"],
        parameters={"J": J, "c": c, "d": d, "d_load": d_load},
    )  # fmt: skip
    names = [f"shaft[{i}].phi_rel" for i in range(n - 1)] + [f"body[{i}].w" for i in range(n)]
    A, B = np.zeros((2 * n - 1, 2 * n - 1)), np.zeros((2 * n - 1, 1))
    C = np.zeros((n, 2 * n - 1))
    for i in range(n - 1):
        stretch, left, right = i, n - 1 + i, n + i
        A[stretch, left], A[stretch, right] = -1, 1
        C[i, [stretch, left, right]] = c * (1 + 0.2 * i), -d, d
        A[left] += C[i] / (J * (1 + 0.3 * i))
        A[right] -= C[i] / (J * (1 + 0.3 * (i + 1)))
    A[-1, -1] -= d_load / (J * (1 + 0.3 * (n - 1)))
    B[n - 1] = 1 / J
    C[n - 1, -1] = 1
    place = [list(model.state_labels).index(name) for name in names]
    assert np.array(model.A)[np.ix_(place, place)] == pytest.approx(A, rel=1e-12, abs=1e-10)
    assert np.array(model.B)[place] == pytest.approx(B, rel=1e-12)
    assert np.array(model.C)[:, place] == pytest.approx(C, rel=1e-12, abs=1e-12)
    assert list(model.input_labels) == ["torque_tau"]
    assert list(model.output_labels) == [f"shaft[{i}]_tau" for i in range(n - 1)] + ["body[3]_w"]


def test_paper_equals_its_printed_equations_at_random_parameters() -> None:
    """Transfer functions from all four sources; the states differ (momenta there, speeds here)."""
    rng = np.random.default_rng(5)
    symbols = ("R_s", "R_p", "I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v")
    defaults = gl.compile(gp.ZhouCui2022()).parameters
    values = {name: float(defaults[name] * rng.uniform(0.5, 2.0)) for name in symbols}
    values |= {"R_r": values["R_s"] + 2 * values["R_p"], "R_h": values["R_s"] + values["R_p"]}
    system = gl.compile(gp.ZhouCui2022())
    model = system.linearize(["tau_in", "train.e_rate"], ["w_in", "w_out", "q_ring", "q_sun", "q_pair"], parameters=values)
    params = zc.bond_parameters(**values)
    A, B = zc.explicit_matrices(params)
    C = np.zeros((5, 8))
    C[0, 0], C[1, 7] = 1 / params.I[2], -1 / params.I[78] / params.m[22]
    C[2, 1] = C[3, 4] = C[4, 6] = 1
    B = np.column_stack([B[:, 0], B[:, 1:].sum(axis=1)])
    for w in (3.0, 300.0, 5000.0, 60000.0):
        mine = model.C @ np.linalg.solve(1j * w * np.eye(8) - model.A, model.B) + model.D
        theirs = C @ np.linalg.solve(1j * w * np.eye(8) - A, B)
        assert np.abs(mine - theirs) == pytest.approx(0, abs=1e-10 * np.abs(theirs).max())
        assert mine == pytest.approx(theirs, rel=1e-8)


class Fan(gl.Component):
    """A motor against a load that grows with the square of speed."""

    def assemble(self) -> list[Any]:
        self.torque, self.rotor = gp.Torque(tau=8.0), gp.Inertia(J=0.5, guess={"w": 10.0})
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=10.0)
        return [gl.connect(self.torque.flange, self.rotor.flange_a), gl.connect(self.rotor.flange_b, self.load.flange)]


def test_steady_state_under_load_is_found_and_used() -> None:
    """8 = 2 (w / 10)^2 at w = 20; there d(tau)/dw = -2 * 2 * 20 / 100 = -0.8, so A = -0.8 / 0.5."""
    system = gl.compile(Fan(), outputs=["rotor.w"])
    model = system.linearize(["torque.tau"], at="steady")
    assert np.array(model.A) == pytest.approx(np.array([[-1.6]]), rel=1e-10)
    assert np.array(model.B) == pytest.approx(np.array([[2.0]]), rel=1e-12)


def test_moment_of_a_run_is_used() -> None:
    system = gl.compile(Fan(), outputs=["rotor.w"])
    run = system.simulate(t_end=0.3, samples=31, rtol=1e-10, start={"rotor.w": 2.0})
    model = system.linearize(["torque.tau"], at=(run, 0.2))
    w = float(run["rotor.w"][20])
    assert float(np.array(model.A)[0, 0]) == pytest.approx(-2 * 2 * w / 100 / 0.5, rel=1e-10)


def test_sparse_and_full_matrices_agree(chain: Callable[..., gl.System]) -> None:
    names = ["torque.tau"], ["body[900].w"]
    small = chain(n=1000).linearize(*names, sparse=True)
    assert small.A.nnz < 8000
    full = chain(n=1000).linearize(*names)
    assert np.array_equal(small.A.toarray(), np.array(full.A))
