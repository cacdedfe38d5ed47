"""Linear trains through gearlib and by hand: histories, reactions, orders of declaration, outputs, samples, methods."""

from __future__ import annotations

import random
from typing import Any

import numpy as np

import gearlib as gl
from tests.stress.described import Model, Train
from tests.stress.linear_reference import PRESCRIBED, Floats, LinearTrain, Unclear, quantities, start_values
from tests.stress.verdicts import ANSWERED, RIGHT, UNCLEAR, WRONG, Verdict, attempted, converging

FASTEST = 3e4  # rate times length of a run that an explicit method is asked to follow


def judge_linear(train: Train, seed: int = 0) -> Verdict:
    """All that one train is asked; ``seed`` chooses the variations."""
    try:
        solved = LinearTrain(train)
    except Unclear as reason:
        return Verdict(UNCLEAR, str(reason))
    refusal = "; ".join(solved.problems) or None
    if refusal is None and solved.locked:
        refusal = "ratios that contradict each other"
    if refusal is None and solved.held_twice and not all(p.kind == "Fixed" for p in train.parts if p.kind in PRESCRIBED):
        refusal = "one prescribed motion follows from others"
    if refusal is None and solved.struck:
        refusal = "a step of torque acts on what has neither inertia nor damping"
    return attempted(lambda: _run(train, solved, random.Random(seed), refusal), refusal)


def right_values(solved: LinearTrain, times: Floats) -> tuple[dict[str, Floats], dict[str, str]]:
    """Histories of all that is determined, with units."""
    states, zs, stretches = solved.solve(times)
    columns: dict[int, Any] = {id(s): quantities(solved, s) for s in stretches}
    values: dict[str, list[float]] = {q.path: [] for q in columns[id(stretches[0])]}
    units = {q.path: q.unit for q in columns[id(stretches[0])]}
    for x, z, stretch in zip(states, zs, stretches, strict=True):
        for q in columns[id(stretch)]:
            values[q.path].append(float(q.rows[0] @ x + q.rows[1] @ z))
    return {n: np.array(v) for n, v in values.items()}, units


def _run(train: Train, solved: LinearTrain, rng: random.Random, refusal: str | None) -> Verdict:
    system = gl.compile(Model(train=train))
    if solved.problems:
        system.simulate(train.t_end, samples=3, inputs=train.unbound())
        return Verdict(ANSWERED, refusal or "")
    times = sample_times(solved, rng)
    start, inputs = start_values(solved), train.unbound()
    right, units = right_values(solved, times)
    rates = max(float(np.abs(np.linalg.eigvals(solved.system(0.0).A)).max(initial=0.0)), 1.0)
    methods = ["auto", "ida", *(["rk5", "rk8"] if rates * train.t_end < FASTEST else [])]
    for method in ["auto", rng.choice(methods)]:
        verdict = _compare(system, train, method, times, start, inputs, right, units)
        if verdict.kind != RIGHT:
            return verdict
    order = rng.randint(1, 10**6)
    other = gl.compile(Model(train=train, order=order))
    verdict = _compare(other, train, "auto", times, start, inputs, right, units, f"order {order}, ")
    if verdict.kind != RIGHT:
        return verdict
    chosen = rng.sample(sorted(right), min(len(right), 3))
    few = gl.compile(Model(train=train, order=order), outputs=chosen)
    coarse = np.unique(np.concatenate([times[:1], rng.sample(times[1:].tolist(), 2)]))
    here = {n: right[n][np.searchsorted(times, coarse)] for n in chosen}
    found = few.simulate(train.t_end, times=coarse, start=start, inputs=inputs, rtol=1e-10)
    scales = {n: right[n] for n in right}
    worst, where = _worst(found, here, scales, units)
    if worst > 1e-5:
        return Verdict(WRONG, f"outputs {chosen} at {coarse.tolist()}: {where}")
    return Verdict(RIGHT)


def _worst(found: Any, right: dict[str, Floats], scales: dict[str, Floats], units: dict[str, str]) -> tuple[float, str]:
    sizes = {u: max(1e-3, *(float(np.abs(scales[n]).max()) for n in scales if units[n] == u)) for u in set(units.values())}
    return max(
        (
            (float(np.abs(found[n] - right[n]).max() / sizes[units[n]]), f"{n} is {found[n]}, right is {right[n]}")
            for n in right
        ),
        default=(0.0, ""),
    )


def sample_times(solved: LinearTrain, rng: random.Random) -> Floats:
    """Moments of a run, none on a step."""
    times = np.array(
        [0.0, *sorted(rng.uniform(0, solved.train.t_end) for _ in range(rng.choice([2, 5, 12]))), solved.train.t_end]
    )
    apart = [all(abs(t - m) > 1e-6 for m in solved.moments) for t in times]
    return np.unique(times[apart])


def _compare(
    system: gl.System, train: Train, method: str, times: Floats, start: dict[str, float], inputs: dict[str, Any],
    right: dict[str, Floats], units: dict[str, str], label: str = "",
) -> Verdict:  # fmt: skip
    def run(rtol: float) -> dict[str, Floats]:
        result = system.simulate(train.t_end, times=times, method=method, rtol=rtol, start=start, inputs=inputs)
        return {name: result[name] for name in right}

    return converging(run, right, units, f"{label}{method}")
