"""What ``auto`` costs on random trains beside the best of gearlib's own methods: `python -m tests.stress.choice_campaign linear 100`.

Processor times of whole calls in one process, each the least of several, the methods taking turns; so a busy machine disturbs the ratios
little. Trains that the reference refuses, or gearlib, are left out. ``--first`` sets the first seed.
"""

from __future__ import annotations

import argparse
import gc
import math
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gearlib as gl
from tests.stress.described import Model, Train
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.linear_draw import linear_train
from tests.stress.linear_reference import LinearTrain, Unclear, start_values

TOLERANCES = (1e-4, 1e-6, 1e-8)
OWN = ("exact", "rk5", "rk8", "taylor", "ida")
ALLOWED = 2.0  # of auto's time over that of the best method
ROUNDS, ENOUGH = 7, 0.25  # calls of each method at most, and processor time (s) after which there are no more
HOPELESS = 5.0  # a method that takes so many times as long as auto is given up
DRAWN = {"linear": linear_train, "hybrid": hybrid_train}


class GivenUp(Exception):
    """A run that takes too long."""


@dataclass(frozen=True)
class Choice:
    """Least processor time (s) of each method on a train, what was counted as work, and why auto chose as it did."""

    family: str
    seed: int
    rtol: float
    seconds: dict[str, float]
    work: dict[str, float]
    why: str

    @property
    def best(self) -> str:
        return min((m for m in self.seconds if m != "auto"), key=self.seconds.__getitem__)

    @property
    def ratio(self) -> float:
        """Of auto's time over that of the best method."""
        return self.seconds["auto"] / self.seconds[self.best]

    def __str__(self) -> str:
        times = ", ".join(f"{m} {1e3 * s:.3g}" for m, s in self.seconds.items())
        return f"{self.family} {self.seed} at {self.rtol:.0e}: {self.ratio:.2f} ({times} ms): {self.why}"


def choices(family: str, seed: int) -> list[Choice]:
    """The methods on a random train, at each tolerance; empty where it cannot be simulated."""
    train: Train = DRAWN[family](seed)
    try:
        solved = LinearTrain(train)
        if solved.problems:
            return []
        start, inputs = start_values(solved), train.unbound()
        system = gl.compile(Model(train=train))
        system.simulate(train.t_end, samples=21, start=start, inputs=inputs)
    except (Unclear, gl.GearlibError):
        return []
    return [_at(system, train, rtol, {"start": start, "inputs": inputs}, family, seed) for rtol in TOLERANCES]


def _at(system: gl.System, train: Train, rtol: float, given: dict[str, Any], family: str, seed: int) -> Choice:
    seconds: dict[str, float] = {}
    work: dict[str, float] = {}
    why = ""
    methods = ["auto", *OWN]
    for turn in range(ROUNDS + 1):  # the first one compiles
        first = turn % len(methods)  # each follows another one in turn: which one has used the caches before matters
        for method in methods[first:] + methods[:first]:
            begin = time.process_time()
            try:
                stats = system.simulate(
                    train.t_end, samples=21, method=method, rtol=rtol, **given, **_limited(method, begin, seconds)
                ).stats
            except (gl.GearlibError, GivenUp):
                methods.remove(method)
                continue
            spent = time.process_time() - begin
            if turn:
                seconds[method] = min(spent, seconds.get(method, spent))
            elif method == "auto":
                why = f"{stats['method']}: {stats['why']}"
            work[method] = float(stats.get("work") or 0.0)
            if method != "auto" and turn and spent > HOPELESS * seconds.get("auto", math.inf):
                methods.remove(method)
        if turn and turn * sum(seconds.values()) > ENOUGH:
            break
    gc.collect()
    return Choice(family, seed, rtol, seconds, work, why)


def _limited(method: str, begin: float, seconds: dict[str, float]) -> dict[str, Any]:
    """Options of a first call that give it up where it takes too long."""
    if method == "auto" or seconds:
        return {}

    def watch(share: float, t: float) -> None:
        if time.process_time() - begin > 2.0:
            raise GivenUp

    return {"progress": watch}


def campaign(family: str, first: int, count: int) -> Iterator[Choice]:
    """The choices on that many trains that can be simulated."""
    seed = first
    while count:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = choices(family, seed)
        count, seed = count - bool(found), seed + 1
        yield from found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=sorted(DRAWN))
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    found = []
    for choice in campaign(given.family, given.first, given.count):
        found.append(choice.ratio)
        if choice.ratio > 1.3:
            print(choice, flush=True)
    found.sort()
    above = sum(ratio > ALLOWED for ratio in found)
    print(f"{len(found)} choices: median {found[len(found) // 2]:.2f}, largest {found[-1]:.2f}, {above} above {ALLOWED}")


if __name__ == "__main__":
    main()
