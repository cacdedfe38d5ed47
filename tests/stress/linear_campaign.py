"""Linear trains through gearlib and by hand: histories, reactions, orders of declaration, outputs, samples, methods."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.errors import StartError
from tests.stress.described import Model, Train
from tests.stress.linear_reference import PRESCRIBED, Floats, LinearTrain, Unclear, quantities, start_values
from tests.stress.verdicts import ANSWERED, RIGHT, UNCLEAR, Verdict, attempted, audited, converging, distance, sizes

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
    if refusal is None and solved.jolted:
        refusal = "the acceleration of what a step of torque makes jump is measured"
    refusal = refusal or solved.differentiated
    return attempted(lambda: _run(train, solved, random.Random(seed), refusal), refusal)


@dataclass(frozen=True)
class Right:
    """Histories of all that is determined, with units and the sizes that errors are measured by."""

    values: dict[str, Floats]
    units: dict[str, str]
    sizes: dict[str, float]


def right_values(solved: LinearTrain, times: Floats) -> Right:
    states, zs, stretches = solved.solve(times)
    columns: dict[int, Any] = {id(s): quantities(solved, s) for s in stretches}
    values: dict[str, list[float]] = {q.path: [] for q in columns[id(stretches[0])]}
    units = {q.path: q.unit for q in columns[id(stretches[0])]}
    terms = dict.fromkeys(units.values(), 0.0)
    for x, z, stretch in zip(states, zs, stretches, strict=True):
        for q in columns[id(stretch)]:
            values[q.path].append(float(q.rows[0] @ x + q.rows[1] @ z))
            terms[q.unit] = max(terms[q.unit], float(np.abs(q.rows[0]) @ np.abs(x) + np.abs(q.rows[1]) @ np.abs(z)))
    for x, z, stretch in zip(
        states, zs, stretches, strict=True
    ):  # torques that cancel at the nodes, and what they would accelerate
        q, v = (np.abs(pair[0] @ x + pair[1] @ z) for pair in (stretch.q, stretch.v))
        pull = float((np.abs(solved.K) @ q + np.abs(solved.D) @ v).max(initial=0.0))
        lightest = min((p.value("J") for p in solved.train.parts if p.value("J") > 0), default=1.0)
        for unit, most in (("N.m", pull), ("rad/s2", pull / lightest)):
            terms[unit] = max(terms.get(unit, 0.0), most)
    histories = {n: np.array(v) for n, v in values.items()}
    return Right(histories, units, sizes(histories, units, terms))


def _run(train: Train, solved: LinearTrain, rng: random.Random, refusal: str | None) -> Verdict:
    system = gl.compile(Model(train=train))
    if solved.problems:
        result = system.simulate(train.t_end, samples=3, inputs=train.unbound())
        for name in sorted(system.variables):  # what nothing determines is refused when it is asked for
            result[name]
        return Verdict(ANSWERED, refusal or "")
    times = sample_times(solved, rng)
    inputs, right = train.unbound(), right_values(solved, times)
    start = accepted_start(system, train, start_values(solved), inputs)

    def compared(system: gl.System, label: str, at: Floats, names: list[str], **options: Any) -> Verdict:
        here = {n: right.values[n][np.searchsorted(times, at)] for n in names}

        def run(rtol: float) -> tuple[float, str]:
            found = system.simulate(train.t_end, times=at, start=start, inputs=inputs, rtol=rtol, **options)
            return distance({n: found[n] for n in names}, here, right.units, right.sizes)

        return converging(run, label)

    names = list(right.values)
    rates = max(float(np.abs(np.linalg.eigvals(solved.system(0.0).A)).max(initial=0.0)), 1.0)
    methods = ["auto", "ida", *(["rk5", "rk8"] if rates * train.t_end < FASTEST else [])]
    order, method = rng.randint(1, 10**6), rng.choice(methods)
    chosen = rng.sample(sorted(names), min(len(names), 3))
    coarse = np.unique(np.concatenate([times[:1], rng.sample(times[1:].tolist(), 2)]))
    other = Model(train=train, order=order)
    for verdict in (
        lambda: compared(system, "auto", times, names),
        lambda: compared(gl.compile(other, names), f"{method}, order {order}", times, names, method=method),
        lambda: compared(gl.compile(other, chosen), f"order {order}, outputs {chosen} at {coarse.tolist()}", coarse, chosen),
    ):
        found = verdict()
        if found.kind != RIGHT:
            shaken = right_values(LinearTrain(disturbed(train)), times)
            known, where = distance(shaken.values, right.values, right.units, right.sizes)
            return Verdict(UNCLEAR, f"the last digits of the parameters change the motion | {where}") if known > 1e-7 else found
    return audited(system.simulate(train.t_end, samples=9, start=start, inputs=inputs), "auto")


def accepted_start(system: gl.System, train: Train, start: dict[str, float], inputs: dict[str, Any]) -> dict[str, float]:
    """The start values; where they are refused, without the zeros of which rounding makes something else."""
    try:
        system.simulate(train.t_end, samples=2, start=start, inputs=inputs)
    except StartError:
        other = start_values(LinearTrain(disturbed(train)))
        return {n: v for n, v in start.items() if abs(v - other[n]) <= 1e-10 * abs(v)}
    return start


def disturbed(train: Train) -> Train:
    """A train whose stiffnesses, dampings and inertias differ in their last digits, and whose nodes are numbered backwards."""
    rng, last = random.Random(0), len(train.angles) - 1

    def digits(name: str, value: Any) -> Any:
        return value * (1 + 1e-14 * rng.uniform(-1, 1)) if name in ("J", "c", "d") else value

    parts = [
        replace(p, at=tuple(last - node for node in p.at), values=tuple((n, digits(n, v)) for n, v in p.values))
        for p in train.parts
    ]
    return Train(tuple(parts), train.angles[::-1], train.speeds[::-1], train.t_end)


def sample_times(solved: LinearTrain, rng: random.Random) -> Floats:
    """Moments of a run, none on a step."""
    times = np.array(
        [0.0, *sorted(rng.uniform(0, solved.train.t_end) for _ in range(rng.choice([2, 5, 12]))), solved.train.t_end]
    )
    apart = [all(abs(t - m) > 1e-6 for m in solved.moments) for t in times]
    return np.unique(times[apart])
