"""Trains that switch, through gearlib and by hand."""

from __future__ import annotations

import random

import numpy as np

import gearlib as gl
from tests.stress.described import Model, Train
from tests.stress.hybrid_reference import Floats, HybridTrain
from tests.stress.linear_reference import LinearTrain, Unclear, start_values
from tests.stress.verdicts import UNCLEAR, WRONG, Verdict, attempted, audited, distance, sizes

DISTURBANCE = 1e-7
MOST = 1e4  # by how much a disturbance may grow in a train that is judged
APART = 1e-5  # s between a sample and an event


def unit(name: str) -> str:
    variable = name.split(".")[-1].split(" ")[-1]
    return {"phi": "rad", "phi_rel": "rad", "w": "rad/s", "w_rel": "rad/s", "tau": "N.m"}.get(variable, "1")


def judge_hybrid(train: Train, seed: int = 0) -> Verdict:
    """The verdict on one train; ``seed`` chooses samples and variations."""
    rng = random.Random(seed)
    try:
        solved = HybridTrain(train)
        wanted = np.array(sorted({0.0, train.t_end, *(rng.uniform(0, train.t_end) for _ in range(rng.choice([2, 6, 15])))}))
        right = solved.solve(wanted)
    except Unclear as reason:
        return Verdict(UNCLEAR, str(reason))
    kept = np.array([all(abs(t - e) > APART for e in right.events) and 0 < t < train.t_end - APART for t in wanted])
    if not kept.any():
        return Verdict(UNCLEAR, "all samples fall on events")
    names = [n for n in right.values if " " not in n and (unit(n) != "rad/s" or n.endswith((".w", ".w_rel")))]
    expected = {n: right.values[n][kept] for n in names}
    return attempted(lambda: _run(train, solved, rng, wanted[kept], expected, len(right.events)), None)


def _run(
    train: Train, solved: HybridTrain, rng: random.Random, times: Floats, right: dict[str, Floats], events: int
) -> Verdict:
    units = {n: unit(n) for n in right}
    size = sizes(right, units)
    start, inputs = start_values(LinearTrain(train)), train.unbound()
    order = rng.choice([0, rng.randint(1, 10**6)])
    named = rng.random() < 0.75  # otherwise a variable that no state gives is integrated when it is read, by another run
    system = gl.compile(Model(train=train, order=order), list(right) if named else None)
    growth: float | None = None
    for method in (rng.choice(["rk5", "rk8"]), rng.choice(["ida", "auto"])):
        worst: list[tuple[float, str]] = []
        for rtol in (1e-8, 1e-11):
            result = system.simulate(train.t_end, times=times, method=method, rtol=rtol, start=start, inputs=inputs)
            worst.append(distance({n: result[n] for n in right}, right, units, size))
            if worst[-1][0] <= 1e3 * rtol * max(1.0, growth or 1.0):
                break
            if growth is None:
                growth = sensitivity(solved, times, right, units)
                if growth > MOST:
                    return Verdict(UNCLEAR, f"a disturbance of the start grows more than {MOST:,.0f} times | {growth:.0e}")
            if worst[-1][0] <= 1e3 * rtol * max(1.0, growth):
                break
        else:
            if worst[1][0] > 1e-6 or worst[1][0] > 0.1 * worst[0][0]:
                errors = " then ".join(f"{e:.1e}" for e, _ in worst)
                return Verdict(
                    WRONG, f"{method}, order {order}: error {errors}, growth {growth:.0e}, {events} events: {worst[1][1]}"
                )
    middle = float(times[len(times) // 2])
    if middle < times[-1] and growth is None:  # the run as two halves
        half = system.simulate(middle, samples=3, rtol=1e-8, start=start, inputs=inputs)
        later = times[times > middle]
        rest = system.simulate(train.t_end, t_start=middle, times=later, rtol=1e-8, start=half, inputs=inputs)
        worst_half, where = distance({n: rest[n] for n in right}, {n: right[n][times > middle] for n in right}, units, size)
        if worst_half > 1e-5:
            return Verdict(WRONG, f"continued at {middle!r}, order {order}: {where}")
    return audited(system.simulate(train.t_end, samples=2, start=start, inputs=inputs), f"order {order}")


def sensitivity(solved: HybridTrain, times: Floats, right: dict[str, Floats], units: dict[str, str]) -> float:
    """By how much a small disturbance of the start grows until a sample."""
    largest = 0.0
    rng = np.random.default_rng(0)
    for _ in range(2):
        shift = rng.choice([-1.0, 1.0], 2 * solved.n) * DISTURBANCE
        try:
            there = solved.solve(times, shift, rtol=1e-11)
        except Unclear:
            return np.inf
        largest = max(
            largest, distance({n: there.values[n] for n in right}, right, units, sizes(right, units))[0] / DISTURBANCE
        )
    return largest
