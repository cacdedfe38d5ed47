"""Poles: where states are coupled in one direction only, at 0 and on the axis, their changes; and linear models made by hand."""

from __future__ import annotations

import re
import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError, SolverError
from gearlib.feedback.feedback_loop import as_loop
from gearlib.linear import eigenvalue_changes as eigenvalue_changes_module
from gearlib.linear.eigenvalue_changes import eigenvalue_changes
from gearlib.linear.linear_model import is_sparse
from gearlib.linear.poles import Poles, deflate, eigen, largest_singular_value, poles, rows_and_null, warn_of_rounding
from gearlib.linear.steady_state import SteadyState
from gearlib.vibration.spectrum import dense_spectrum

FAST, SLOW, COUPLING = 2.2e4, 0.0449, 5e8


@pytest.mark.parametrize("seed", range(20))
def test_poles_of_a_triangular_matrix_stand_on_its_diagonal(seed: int) -> None:
    """Eight decades of poles, fifteen of couplings, in any order of the states."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    right = np.sort(-(10.0 ** rng.uniform(-3, 5, n)))
    below = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-6, 9, (n, n)) * (rng.random((n, n)) < 0.5)
    order = rng.permutation(n)
    matrix = (np.diag(right) + np.tril(below, -1))[np.ix_(order, order)]
    found = poles(matrix)
    assert found.verdict == "stable"
    assert np.sort(found.values.real) == pytest.approx(right, rel=1e-9)
    assert dense_spectrum(matrix, np.eye(n), None).decays[::-1] == pytest.approx(right, rel=1e-9)


class OneWay(gl.Component):
    """A fast state that drives a slow one."""

    fast = gl.Parameter("1/s", default=FAST)
    slow = gl.Parameter("1/s", default=SLOW)
    coupling = gl.Parameter("1/s", default=COUPLING)
    u = gl.Input("1")
    x = gl.Variable("1")
    y = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.fast * (self.u - self.x)),
            gl.Eq(gl.der(self.y), -self.coupling * self.x - self.slow * self.y),
        ]


def test_all_analyses_see_a_slow_state_behind_a_large_coupling() -> None:
    system = gl.compile(OneWay(), outputs=["y"])
    assert np.sort(gl.stability(system).eigenvalues.real) == pytest.approx([-FAST, -SLOW], rel=1e-9)
    assert gl.modes(system).decays == pytest.approx([-SLOW, -FAST], rel=1e-9)
    omega = np.array([1e-3, 0.05, 1e4])
    response = gl.frequency_response(system, omega, inputs=["u"], outputs=["y"])
    s = 1j * omega
    expected = -COUPLING * FAST / ((s + FAST) * (s + SLOW))
    assert np.asarray(response["y", "u"]) == pytest.approx(expected, rel=1e-9)


class Coupled(gl.Component):
    """Two bodies with a drag and two couplings in series: nothing of mass between these makes a pole of -c / d."""

    c = gl.Parameter("N.m/rad", default=1e6)
    d = gl.Parameter("N.m.s/rad", default=1e-2)
    drag = gl.Parameter("N.m.s/rad", default=1e-3)

    def assemble(self) -> list[Any]:
        self.torque, self.driver, self.driven = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.one, self.other = gp.SpringDamper(c=self.c, d=self.d), gp.SpringDamper(c=self.c, d=self.d)
        self.damper, self.ground = gp.Damper(d=self.drag), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.driver.flange_a),
            gl.connect(self.driver.flange_b, self.one.flange_a),
            gl.connect(self.one.flange_b, self.other.flange_a),
            gl.connect(self.other.flange_b, self.driven.flange_a),
            gl.connect(self.driven.flange_b, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.ground.flange),
        ]


@pytest.fixture(scope="module")
def coupled() -> gl.System:
    return gl.compile(Coupled(), outputs=["driven.w"])


def by_hand(d: float, drag: float) -> np.ndarray:
    """Twist and speeds: the couplings in series are one of half the stiffness and half the damping."""
    c, d = 0.5e6, d / 2
    return np.array([[0.0, 1.0, -1.0], [-c, -d, d], [c / 2, d / 2, -(d + drag) / 2]])


@pytest.mark.parametrize(("d", "drag"), [(1e-2, 1.0), (1e-2, 1e-3), (1e-2, 0.0), (1e-4, 1.0), (1e-4, 1e-3), (1e-6, 1.0)])
def test_slow_poles_beside_very_fast_ones(coupled: gl.System, d: float, drag: float) -> None:
    """Up to twelve decades apart: a drag is no free motion, and a damping ratio of 1e-7 is not none."""
    given = {"d": d, "drag": drag}
    right = np.sort_complex(np.linalg.eigvals(by_hand(d, drag)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gl.GearlibWarning)
        report, found = gl.stability(coupled, parameters=given), gl.modes(coupled, parameters=given)
    slow = report.poles.values[:3]
    assert report.poles.resolution == pytest.approx(4e-15 * 1e6 / d, rel=0.2)
    assert np.sort_complex(slow) == pytest.approx(right, abs=report.poles.tolerances.max())
    assert report.verdict == ("stable" if drag else "marginal")
    assert (report.poles.values[-1], found.free) == (pytest.approx(-1e6 / d, rel=1e-6), 0 if drag else 1)
    assert found.eigenvalues[found.free :] == pytest.approx(slow[slow.imag > 0], abs=1e-15 * 1e6 / d)
    assert found.decays[:-1] == pytest.approx(slow.real[(slow.imag == 0) & (slow != 0)], abs=1e-15 * 1e6 / d)
    assert ("1 pole (to 4e-07 rad/s) at 0" in str(report)) == (not drag)


def test_poles_that_rounding_hides_are_reported(coupled: gl.System) -> None:
    """A drag that makes a pole slower than the rounding of the fastest one, and a damping that is less."""
    said = (
        r"Coupled: poles are known to 0\.004 rad/s, since the fastest one, mostly of \w+\.phi_rel, is 1e\+12 rad/s; a slower "
        r"motion counts as a pole at 0, and less damping as none\. A damping or an inertia that is nearly 0 makes such a pole; 0 "
    )
    given = {"d": 1e-6, "drag": 1e-3}
    for ask in (gl.stability, gl.modes, lambda system, parameters: as_loop(system, parameters=parameters)):
        with pytest.warns(gl.GearlibWarning, match=said):
            ask(coupled, parameters=given)
    with pytest.warns(gl.GearlibWarning, match=r"known to 4e\+01 rad/s"):  # nothing at 0, but the frequency is not known
        assert gl.stability(coupled, parameters={"d": 1e-10, "drag": 1e6}).poles.resolution > 1
    assert gl.modes(coupled, parameters={"d": 0.0, "drag": 1e-3}).decays == pytest.approx([-1e-3 / 3], rel=1e-6)


# ---------------------------------------------------------------- verdicts


def similar(blocks: list[np.ndarray], seed: int = 3) -> np.ndarray:
    """The matrix of these blocks in other states of about the same size."""
    from scipy.linalg import block_diag

    rng = np.random.default_rng(seed)
    matrix = block_diag(*blocks)
    turn = np.linalg.qr(rng.normal(size=matrix.shape))[0]
    return np.asarray(turn @ matrix @ turn.T)


def swing(w: float, d: float = 0.0) -> np.ndarray:
    return np.array([[0.0, w], [-w, -d]])


FREE, STILL = np.array([[0.0, 1.0], [0.0, 0.0]]), np.zeros((1, 1))
DECAY, GROWTH = np.array([[-2.0]]), np.array([[0.5]])
PAIRED = np.block([[swing(3.0), np.eye(2)], [np.zeros((2, 2)), swing(3.0)]])
CASES: list[tuple[list[Any], str, tuple[int, ...], list[float]]] = [
    ([DECAY, swing(3.0, 1.0)], "stable", (), []),
    ([DECAY, swing(3.0)], "marginal", (), [3.0]),
    ([DECAY, STILL], "marginal", (1,), [0.0]),
    ([STILL, STILL, DECAY], "marginal", (2,), [0.0]),
    ([FREE, DECAY], "drifting", (1, 1), [0.0]),
    ([FREE, STILL, swing(2.0, 1.0)], "drifting", (2, 1), [0.0]),
    ([np.eye(3, k=1), DECAY], "drifting", (1, 1, 1), [0.0]),
    ([swing(3.0), swing(3.0), DECAY], "marginal", (), [3.0]),
    ([swing(3.0), swing(3.0), swing(5.0)], "marginal", (), [3.0, 5.0]),
    ([PAIRED, DECAY], "drifting", (), [3.0]),
    ([swing(3.0), GROWTH, FREE], "unstable", (1, 1), [0.0, 3.0]),
    ([swing(3.0, -0.1)], "unstable", (), []),
]


@pytest.mark.parametrize(("blocks", "verdict", "chains", "axis"), CASES)
def test_verdicts_follow_from_the_blocks(blocks: list[Any], verdict: str, chains: tuple[int, ...], axis: list[float]) -> None:
    matrix = similar(blocks)
    found = poles(matrix)
    expected = np.concatenate([np.linalg.eigvals(b) for b in blocks])
    assert found.verdict == verdict
    assert found.chains == chains
    assert found.at_zero == sum(chains) == (found.values == 0).sum()
    assert found.right == (expected.real > 1e-6).sum()
    assert found.on_axis == pytest.approx(axis, abs=1e-6)
    assert found.chained == (pytest.approx((3.0,), abs=1e-6) if PAIRED is blocks[0] else ())
    near = 1e-6 if PAIRED is blocks[0] else 1e-9
    assert np.sort_complex(np.round(found.values, 5)) == pytest.approx(np.sort_complex(np.round(expected, 5)), abs=near + 2e-5)
    sizes = np.abs(found.values)
    assert (np.diff(np.round(sizes, 9)) >= 0).all()
    assert (found.tolerances[found.values == 0] == 0).all()
    assert (found.tolerances[found.values != 0] > 0).all()
    ratio = found.damping
    assert np.isnan(ratio[sizes == 0]).all()
    moving = sizes > 0
    assert ratio[moving] == pytest.approx(-found.values[moving].real / sizes[moving], abs=1e-12)


@pytest.mark.parametrize("factor", [1e-9, 1e-3, 1e7])
@pytest.mark.parametrize(("blocks", "verdict", "chains", "axis"), CASES)
def test_a_faster_clock_makes_all_poles_slower(
    blocks: list[Any], verdict: str, chains: tuple[int, ...], axis: list[float], factor: float
) -> None:
    found, slow = poles(similar(blocks)), poles(factor * similar(blocks))
    assert (slow.verdict, slow.chains) == (verdict, chains)
    assert np.sort_complex(np.round(slow.values / factor, 4)) == pytest.approx(
        np.sort_complex(np.round(found.values, 4)), abs=3e-4
    )
    assert slow.on_axis == pytest.approx(factor * np.array(axis), abs=1e-6 * factor)


@pytest.mark.parametrize("w", [0.02, 0.7, 40.0])
def test_chains_on_the_axis_are_found_at_any_frequency(w: float) -> None:
    """Twice the same swing, coupled or not; and two coupled pairs of different frequencies."""

    def chain(w: float) -> np.ndarray:
        return np.block([[swing(w), w * np.eye(2)], [np.zeros((2, 2)), swing(w)]])

    assert poles(similar([swing(w), swing(w), w * DECAY])).chained == ()
    assert poles(similar([chain(w), w * DECAY])).chained == pytest.approx((w,), rel=1e-6)
    both = poles(similar([chain(w), chain(3 * w), swing(2 * w)]))
    assert sorted(both.chained) == pytest.approx([w, 3 * w], rel=1e-6)
    assert both.on_axis == pytest.approx([w, 2 * w, 3 * w], rel=1e-6)
    assert both.verdict == "drifting"


@pytest.mark.parametrize(("apart", "chained"), [(5e-10, (1.0,)), (5e-9, ())])
def test_frequencies_that_agree_to_nine_digits_are_one(apart: float, chained: tuple[float, ...]) -> None:
    """A swing that drives another one, which is as fast: the second grows for thousands of turns."""
    matrix = np.block([[swing(1.0), 1e-6 * np.eye(2)], [np.zeros((2, 2)), swing(1.0 + apart)]])
    found = poles(matrix)
    assert found.chained == pytest.approx(chained, rel=1e-8)
    assert found.verdict == ("drifting" if chained else "marginal")


def test_two_decays_that_rounding_hides_are_no_chain_off_zero() -> None:
    """A chain at 0 is found by the staircase alone."""
    turned = np.array([[0.6, 0.8], [-0.8, 0.6]])
    found = poles(turned @ [[-1e-7, 1.0], [0.0, -1e-7]] @ turned.T)
    assert (found.values.tolist(), found.chains, found.chained) == ([0, 0], (), ())


def test_conjugates_stand_side_by_side_and_the_slower_first() -> None:
    values = poles(similar([swing(5.0, 1.0), swing(2.0, 1.0), np.array([[-3.0]])])).values
    assert values.imag == pytest.approx([-np.sqrt(3.75), np.sqrt(3.75), 0.0, -np.sqrt(24.75), np.sqrt(24.75)])
    alike = poles(similar([np.array([[-5.0]]), swing(5.0, 1.0)])).values
    assert alike.imag == pytest.approx([0.0, -np.sqrt(24.75), np.sqrt(24.75)])


def test_matrices_without_poles_or_with_zeros_only() -> None:
    assert poles(np.empty((0, 0))).verdict == "stable"
    nothing = poles(np.zeros((3, 3)))
    assert (nothing.chains, nothing.values.tolist(), nothing.tolerances.tolist()) == ((3,), [0, 0, 0], [0, 0, 0])
    still = eigen(np.zeros((3, 3)))
    assert (still.others @ still.vectors).shape == (3, 0)
    assert poles(sparse.csr_matrix(np.diag([-1.0, -2.0]))).values.real.tolist() == [-1, -2]
    for wrong, said in ((np.ones((2, 3)), r"shape \(2, 3\) has no eigenvalues"), (np.ones(3), r"shape \(3,\)"),
                        (np.ones((0, 3)), r"shape \(0, 3\)"),
                        (np.array([[np.nan]]), "not finite"), (np.array([[1e150]]), "whose squares are not")):  # fmt: skip
        with pytest.raises(ArgumentError, match=said):
            poles(wrong)
    assert poles(np.array([[-0.9e150]])).right == 0


@pytest.mark.parametrize("seed", range(8))
def test_the_null_space_is_split_off_whatever_its_rank(seed: int) -> None:
    """Orthonormal bases; the one is mapped to nothing, the other keeps all of the matrix; up to the limit and just beyond it."""
    rng = np.random.default_rng(seed)
    n, rank = 6, int(rng.integers(0, 7))
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    sizes = np.concatenate([10.0 ** rng.uniform(-3, 2, rank), np.full(n - rank, 0.9e-6)])
    matrix = left @ np.diag(sizes) @ right.T
    rows, null = rows_and_null(matrix, 1e-6 if rank < n else 1e-12)
    assert (rows.shape[1], null.shape[1]) == (rank, n - rank)
    both = np.hstack([rows, null])
    assert both.T @ both == pytest.approx(np.eye(n), abs=1e-12)
    assert np.linalg.norm(matrix @ null, axis=0).max(initial=0.0) < 2e-6
    assert np.linalg.norm(matrix @ rows) == pytest.approx(np.linalg.norm(sizes[:rank]), abs=1e-5)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_the_rank_is_that_of_the_singular_values_wherever_the_limit_lies(n: int) -> None:
    """Also where neither an inverse nor a triangle tells it, whose entries are below the limit, and their sum above it."""
    rng = np.random.default_rng(n)
    drawn = [rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1, n) for _ in range(40)]
    for matrix in [np.triu(np.full((n, n), 0.9)), np.ones((n, n)), *drawn]:
        sizes = np.linalg.svd(matrix, compute_uv=False)
        for rank in range(n + 1):
            above, below = np.append(np.append(2 * sizes[0], sizes), sizes[-1] / 2)[rank : rank + 2]
            if above < max(1.001 * below, 1e-9 * sizes[0]):
                continue
            limit = float(np.sqrt(above * max(below, 1e-11 * sizes[0])))
            rows, null = rows_and_null(matrix, limit)
            assert (rows.shape, null.shape) == ((n, rank), (n, n - rank))
            assert np.linalg.norm(matrix @ null) <= limit * np.sqrt(n)
            both = np.hstack([rows, null])
            assert both.T @ both == pytest.approx(np.eye(n), abs=1e-12)


def test_the_staircase_leaves_a_block_triangular_matrix() -> None:
    matrix = similar([FREE, STILL, np.eye(3, k=1), swing(2.0, 1.0)])
    zero, others, chains, limit = deflate(matrix)
    assert chains == (3, 2, 1)
    assert 1e-15 < limit / np.linalg.norm(matrix, 2) < 1e-14
    assert others.T @ matrix @ zero == pytest.approx(np.zeros((2, 6)), abs=1e-12)
    inner = zero.T @ matrix @ zero
    assert np.linalg.matrix_power(inner, 3) == pytest.approx(np.zeros((6, 6)), abs=1e-12)
    assert inner[:, :3] == pytest.approx(np.zeros((6, 3)), abs=1e-12)
    assert np.abs(np.linalg.eigvals(others.T @ matrix @ others)) == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize("size", [1e-140, 1.0, 1e140])
@pytest.mark.parametrize("n", [2, 10, 40])
def test_what_counts_as_zero_is_a_part_of_the_largest_singular_value(n: int, size: float) -> None:
    rng = np.random.default_rng(n)
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    matrix = size * left @ np.diag(0.5 ** np.arange(n).clip(0, 20)) @ right.T
    assert deflate(matrix)[3] / size == pytest.approx(4e-15 * max(n / 10, 1.0), rel=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("coupling", [0.0, 3.0, 1e5])
def test_bounds_of_rounding_grow_where_eigenvectors_are_nearly_parallel(coupling: float, size: float) -> None:
    """Of ``[[-1, c], [0, -3]]``: left and right unit vectors of an eigenvalue have the product 2 / sqrt(4 + c^2)."""
    found = eigen(size * np.array([[-1.0, coupling], [0.0, -3.0]]))
    assert np.sort(found.values.real) / size == pytest.approx([-3.0, -1.0])
    norm, product = np.sqrt(1 + 9 + coupling**2), 2 / np.sqrt(4 + coupling**2)
    expected = 40 * 2.0**-52 * norm / product
    assert found.tolerances / size == pytest.approx([expected] * 2, rel=1e-9)
    assert found.chains == ()
    free = np.zeros((3, 3))
    free[:2, :2] = size * np.array([[-1.0, coupling], [0.0, -3.0]])
    if coupling < 10:
        split = eigen(free)
        assert split.chains == (1,)
        assert split.tolerances / size == pytest.approx([expected] * 2, rel=1e-9)
        shape = split.others @ split.vectors
        assert free @ shape == pytest.approx(shape * split.values, abs=1e-12 * size)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("coupling", 10.0 ** np.linspace(-2, 2, 13))
def test_bounds_of_a_double_swing_end_where_rounding_makes_nothing_singular(coupling: float, size: float) -> None:
    """Two equal swings, one of which drives the other: at the bound the matrix is regular, at a quarter of it rounding hides it."""
    swing = np.array([[0.0, 1.0], [-1.0, 0.0]])
    matrix = size * np.block([[swing, coupling * np.eye(2)], [np.zeros((2, 2)), swing]])
    found, rounding = eigen(matrix), 40 * 2.0**-52 * np.linalg.norm(matrix)
    assert np.abs(found.values / size) == pytest.approx([1.0] * 4, rel=1e-6)
    for value, bound in zip(found.values, found.tolerances, strict=True):

        def regular(distance: float, value: complex = value) -> float:
            sides = [matrix - (value + distance * way) * np.eye(4) for way in (1, 1j, -1, -1j)]
            return float(min(np.linalg.svd(side, compute_uv=False)[-1] for side in sides))

        assert regular(bound / 4) <= rounding < regular(bound)


def test_frequencies_within_rounding_are_one_on_the_axis() -> None:
    """The bound of the one that is met counts; frequencies farther apart are two, and what is damped is none."""

    def on_axis(values: list[complex], tolerance: float) -> list[float]:
        both = np.array([v for value in values for v in (value, value.conjugate())])
        return Poles(both, np.full(len(both), tolerance), ()).on_axis.tolist()

    assert on_axis([5j, 2j], 1e-12) == [2, 5]
    assert on_axis([2j, 2.001j], 0.0009) == [2, 2.001]
    assert on_axis([2j, 2.001j], 0.0011) == [2]
    assert on_axis([2e9j, (2e9 + 1) * 1j], 1e-12) == [2e9]  # relative, too
    assert on_axis([2e9j, (2e9 + 3) * 1j], 1e-12) == [2e9, 2e9 + 3]
    assert on_axis([2j, -1e-300 + 3j], 1e-12) == [2]
    assert on_axis([0j], 0.0) == [0]


# ---------------------------------------------------------------- derivatives of eigenvalues


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_changes_of_eigenvalues_are_their_differences(seed: int, large: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """In states of any units, along two changes at once, by all eigenvectors or by inverse iteration."""
    if large:
        monkeypatch.setattr(eigenvalue_changes_module, "MOST_FULL", 3)
    rng = np.random.default_rng(seed)
    n = 9
    units = 10.0 ** rng.uniform(-3, 3, n)
    matrix = rng.normal(size=(n, n))
    changes = [rng.normal(size=(n, n)) for _ in range(2)]
    values = np.linalg.eigvals(matrix)
    given: list[Any] = [m * units[:, None] / units for m in (matrix, *changes)]
    if large:
        given = [sparse.csr_matrix(m) for m in given]
    found = eigenvalue_changes(given[0], given[1:], values)
    for row, change in zip(found, changes, strict=True):
        h = 1e-6
        ahead, behind = (np.linalg.eigvals(matrix + step * change) for step in (h, -h))
        for k, value in enumerate(values):
            difference = ahead[np.argmin(abs(ahead - value))] - behind[np.argmin(abs(behind - value))]
            assert row[k] == pytest.approx(difference / (2 * h), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("size", [1e-14, 1.0, 1e14])
@pytest.mark.parametrize("large", [False, True])
def test_branches_of_repeated_eigenvalues(large: bool, size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 2, 2, 2 and 5 along a change that parts them by -1, 0 and 4; zeros stay; all or, if they part, none of the branches."""
    if large:
        monkeypatch.setattr(eigenvalue_changes_module, "MOST_FULL", 3)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(8, 8)))[0]
    rest = [7.0, 9.0, 11.0]

    def of(diagonal: list[float]) -> Any:
        matrix = size * turn @ np.diag(diagonal) @ turn.T
        return sparse.csr_matrix(matrix) if large else matrix

    A, change = of([2.0, 2.0, 2.0, 5.0, 0.0, *rest]), of([4.0, -1.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0])
    found = eigenvalue_changes(A, [change], size * np.array([2.0, 5.0, 2.0, 0.0, 2.0])) / size
    assert found[0] == pytest.approx(np.array([-1.0, 1.0, 0.0, 0.0, 4.0]), abs=1e-6)
    assert eigenvalue_changes(A, [change], np.zeros(2)) == pytest.approx(np.zeros((1, 2)))
    value = re.escape(f"{2 * size:g}")
    said = rf"the eigenvalue {value}\+0j 1/s is repeated 3 times, and a change of the parameter parts them; ask for all of them, not for 2"
    with pytest.raises(SolverError, match=said):
        eigenvalue_changes(A, [change], size * np.array([2.0, 2.0]))
    alike = of([3.0, 3.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert eigenvalue_changes(A, [alike], size * np.array([2.0]))[0] / size == pytest.approx([3.0], abs=1e-6)
    assert eigenvalue_changes(A, [0 * change], size * np.array([2.0]))[0] == pytest.approx([0.0])
    chain = np.diag([2.0, 2.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0])
    chain[0, 1] = 1.0
    with pytest.raises(
        SolverError, match=r"the eigenvalue 2 1/s has no derivative: it is repeated with too few independent shapes"
    ):
        eigenvalue_changes(chain, [np.eye(8)], np.array([2.0]))


# ---------------------------------------------------------------- linear models


def test_large_matrices_with_few_entries_count_as_sparse() -> None:
    few, many = np.eye(81), np.eye(81)
    many.ravel()[: int(0.1 * 81**2) + 1] = 1.0
    assert is_sparse(few)
    assert is_sparse(sparse.csr_matrix(few))
    assert not is_sparse(many)
    assert not is_sparse(sparse.csr_matrix(many))
    assert not is_sparse(np.eye(80))


def test_a_steady_state_is_listed_with_its_units() -> None:
    state = SteadyState(("load.w", "a"), np.array([6.0, -1e-7]), ("rad/s", ""), lambda name: np.array([1.0, 2.0]))
    assert str(state) == "load.w             6 rad/s\na             -1e-07"
    assert (state["a"], state.sensitivity("a", "x")) == (-1e-7, 2.0)
    with pytest.raises(NameLookupError, match=r"the steady state was not asked for 'load\.v'; did you mean 'load\.w'"):
        state["load.v"]


@pytest.mark.parametrize("beside", [1e-12, 1e-17])
@pytest.mark.parametrize("free", [False, True])
def test_a_swing_that_a_fast_pole_hides_is_told(beside: float, free: bool) -> None:
    """Of 1 rad/s, or 1.22 rad/s where the other end turns, too; beside the fastest it may count as two poles at 0, and all are then."""

    class Swinging(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.body, self.spring, self.end = gp.Inertia(J=1.0), gp.Spring(c=1.0), gp.Inertia(J=2.0) if free else gp.Fixed()
            self.damper, self.tiny = gp.Damper(d=1.0), gp.Inertia(J=beside)
            end = self.end.flange_b if free else self.end.flange
            return [
                gl.connect(end, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.body.flange_a),
                gl.connect(self.body.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.tiny.flange_a),
            ]

    with pytest.warns(gl.GearlibWarning, match=r"poles are known to .* rad/s, since the fastest one, mostly of tiny\.w"):
        gl.stability(gl.compile(Swinging()))


@pytest.mark.parametrize(
    ("values", "chains", "resolution", "warned"),
    [
        ([-2.0, -50.0], (), 1.9e-3, False), ([-2.0, -50.0], (), 2.1e-3, True),  # poles that are blurred
        ([1j, -1j, -50.0], (), 0.9e-6, False), ([1j, -1j, -50.0], (), 1.1e-6, True),  # a damping that is hidden
        ([0.0, -2.0, -50.0], (1,), 1.9e-6, False), ([0.0, -2.0, -50.0], (1,), 2.1e-6, True),  # a slow motion, taken for one at 0
        ([0.0, 0.0, -50.0], (2,), 4.9e-5, False), ([0.0, 0.0, -50.0], (2,), 5.1e-5, True),
        ([0.0, -50.0, -60.0], (1,), 2.4, True), ([0.0, 0.0, -5e6], (2,), 2.4, False), ([0.0, 0.0, -5e6], (2,), 2.6, True),
        ([-0.0], (), 0.0, False),
    ],
)  # fmt: skip
def test_rounding_is_told_where_it_blurs_poles_or_hides_damping(
    values: list[complex], chains: tuple[int, ...], resolution: float, warned: bool
) -> None:
    found: Any = SimpleNamespace(
        values=np.array(values, complex), chains=chains, resolution=resolution, tolerances=np.full(len(values), 1e-9)
    )
    A = np.diag([0.0, 2.5, -50.0][-len(values) :])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warn_of_rounding("Train", ["a.w", "b.w", "c.w"][-len(values) :], A, found)
    if warned:
        (text,) = (str(one.message) for one in told)
        assert text.startswith(
            f"Train: poles are known to {resolution:.1g} rad/s, since the fastest one, mostly of c.w, is {abs(values[-1]):.2g} rad/s;"
        )
    else:
        assert not told


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e60])
def test_the_largest_singular_value_is_estimated_from_the_largest_row(size: float) -> None:
    """Also where another row is zero, and where equal numbers are mapped to zero."""
    for matrix in (
        np.array([[0.0, 0.0], [5.0, 0.0]]),
        np.array([[0.0, 7.0], [0.0, 0.0]]),
        np.array([[1.0, -1.0], [-1.0, 1.0]]),
    ):
        assert largest_singular_value(size * matrix) / size == pytest.approx(np.linalg.norm(matrix, 2), rel=1e-12)
    assert largest_singular_value(np.zeros((2, 2))) == 0.0


@pytest.mark.parametrize("value", [-1.0, 1.0, 0.02, -0.02 + 3j])
@pytest.mark.parametrize("fastest", [1.0, 1e3, 1e5])
def test_repeated_poles_off_the_axis_are_not_on_it(value: complex, fastest: float) -> None:
    """Beside a fast pole, where the bound of first order of the rounding of a defective pole is larger than the pole."""
    w = complex(value).imag
    block = np.array([[value.real, w], [-w, value.real]]) if w else np.array([[value]])
    n = len(block)
    A = np.zeros((2 * n + 1, 2 * n + 1))
    A[:n, :n] = A[n : 2 * n, n : 2 * n] = block
    A[:n, n : 2 * n], A[-1, -1] = np.eye(n), -fastest
    found = poles(A)
    assert found.verdict == ("stable" if value.real < 0 else "unstable")
    assert found.right == (0 if value.real < 0 else 2)
    assert sorted(found.values.real) == pytest.approx(sorted([value.real] * 2 * n + [-fastest]), rel=1e-4)
