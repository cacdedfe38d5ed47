"""Stages, error estimates and dense output, carried out by Python: the small language is a part of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853

from gearlib.solvers.rungekutta.stages import GENERATED
from gearlib.solvers.rungekutta.tableaux import DOP853_A, DOP853_C, DOP853_E, TSIT5_A, TSIT5_C, TSIT5_E, TSIT5_R

N, T, H = 3, 0.5, 0.25
START, ORIGIN = np.array([1.0, -0.5, 2.0]), 0.25
ATOL, RTOL = np.array([1e-3, 2e-3, 5e-3]), 0.1
A, C = {5: TSIT5_A, 8: DOP853_A}, {5: TSIT5_C, 8: DOP853_C}
STAGES = {5: 7, 8: 13}


def rates(t: float, x: Any) -> Any:
    return np.array([x[1] * x[2], -np.sin(x[0]) + t**2, np.cos(3.0 * t) - x[2] * x[0]])


class Step:
    """The record of a step in a memory of its own, in which addresses are multiples of 8."""

    def __init__(self, order: int, fails_at: int = -1) -> None:
        self.memory, self.calls, self.fails_at = np.full(60 * N, np.nan), 0, fails_at
        places = {name: 8 * N * (k + 1) for k, name in enumerate(("x", "y", "x_new", "atol", "out"))}
        self.s = SimpleNamespace(**places, k=8 * N * 6, c=8 * N * 30, size=N, rtol=RTOL, origin=ORIGIN, rhs=0, data=0, index=0)
        self.at("x")[:], self.at("atol")[:] = START, ATOL
        self.k = self.memory[6 * N : 22 * N].reshape(16, N)
        self.k[0] = rates(ORIGIN + T, START)
        self.order = order
        self.space: dict[str, Any] = {
            "floats_at": lambda address: self.memory[address // 8 :], "blocks": range, "block": lambda v: v, "total": lambda v: v,
            "one_by_one": lambda array, i: array[i], "MODEL": self.model,
        }  # fmt: skip
        exec(f"from __future__ import annotations\n{GENERATED}", self.space)

    def at(self, name: str) -> Any:
        place = getattr(self.s, name) // 8
        return self.memory[place : place + N]

    def model(self, rhs: int, t: float, x: int, dx: int, data: int, index: int) -> int:
        self.calls += 1
        self.memory[dx // 8 : dx // 8 + N] = rates(t, self.memory[x // 8 : x // 8 + N])
        return 3 if self.calls == self.fails_at else 0

    def run(self, name: str, *arguments: Any) -> Any:
        return self.space[f"_{name}"](self.s, *arguments)

    def taken(self) -> Step:
        assert self.run(f"step{self.order}", T, H) == 0
        return self


def by_hand(order: int) -> tuple[Any, Any]:
    """The rates at all stages, and the state at the end."""
    k = [rates(ORIGIN + T, START)]
    for row, c in list(zip(A[order], C[order], strict=True))[1 : STAGES[order]]:
        x = START + H * sum(a * each for a, each in zip(row, k, strict=False))
        k.append(rates(ORIGIN + T + c * H, x))
    return np.array(k), x


@pytest.mark.parametrize("order", [5, 8])
def test_a_step_is_that_of_its_tableau(order: int) -> None:
    own, (k, x) = Step(order).taken(), by_hand(order)
    assert own.calls == STAGES[order] - 1
    assert own.k[: STAGES[order]] == pytest.approx(k, rel=1e-12)
    assert own.at("x_new") == pytest.approx(x, rel=1e-12)
    assert own.at("x").tolist() == START.tolist()


@pytest.mark.parametrize("order", [5, 8])
def test_a_step_ends_at_the_stage_that_fails(order: int) -> None:
    for stage in range(1, STAGES[order]):
        own = Step(order, fails_at=stage)
        assert own.run(f"step{order}", T, H) == 3
        assert own.calls == stage


@pytest.mark.parametrize("order", [5, 8])
def test_errors_are_sums_of_squares_relative_to_the_tolerance(order: int) -> None:
    own, (k, x) = Step(order).taken(), by_hand(order)
    y = own.at("y").copy()
    weight = 1.0 / (ATOL + RTOL * np.maximum(np.abs(x), np.abs(START)))
    estimates = (TSIT5_E,) if order == 5 else DOP853_E
    expected = [float(((weight * np.dot(e[: len(k)], k[: len(e)])) ** 2).sum()) for e in estimates]
    slope, move = weight * (k[-1] - k[-2]), weight * (x - y)
    expected += [float(slope @ slope), float(move @ move), float(slope @ move)]
    assert own.run(f"errors{order}") == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("theta", [0.0, 0.1, 0.5, 0.8, 1.0])
def test_between_the_ends_of_a_step_is_what_the_tableau_says(theta: float) -> None:
    own, (k, x) = Step(5).taken(), by_hand(5)
    own.run("coefficients5")
    own.run("polynomial5", H * theta, theta, theta, own.s.out)
    weights = [sum(r * theta ** (p + 1) for p, r in enumerate(row)) for row in TSIT5_R]
    assert own.at("out") == pytest.approx(START + H * np.dot(weights, k), rel=1e-12)
    if theta in (0.0, 1.0):
        assert own.at("out") == pytest.approx(x if theta else START, rel=1e-12)


@pytest.mark.parametrize("theta", [0.0, 0.1, 0.5, 0.8, 1.0])
def test_the_step_of_order_8_and_what_is_between_its_ends_are_those_of_scipy(theta: float) -> None:
    other = DOP853(rates, ORIGIN + T, START, ORIGIN + T + H, first_step=H, rtol=1e3, atol=1e3)
    other.step()
    own = Step(8).taken()
    assert own.at("x_new") == pytest.approx(other.y, rel=1e-12)
    assert own.run("more8", T, H) == 0
    own.run("coefficients8")
    own.run("polynomial8", H * theta, theta, 1.0 - theta, own.s.out)
    assert own.at("out") == pytest.approx(other.dense_output()(ORIGIN + T + theta * H), rel=1e-11)
