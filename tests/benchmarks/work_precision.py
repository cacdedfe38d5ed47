"""Work against precision: every solver on every scene, each tolerance several times, processor times and true errors.

    python -m tests.benchmarks.work_precision [SCENE ...]     writes docs/benchmarks.md and its pictures

Solvers take turns, so that a busy machine disturbs all of them alike; times are medians of processor time. A solver stops going
to finer tolerances when one run takes longer than the limit, and one that is missing is named in the tables.
"""

from __future__ import annotations

import gc
import math
import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from tests.benchmarks.competitors import Competitor, RunAt, Unavailable, others
from tests.benchmarks.contestants import FLOORS, OWN, clocked
from tests.benchmarks.references import SCENES, BenchScene
from tests.benchmarks.users import UserScene

if TYPE_CHECKING:
    from tests.benchmarks.page import Row

TOLERANCES = tuple(10.0**-k for k in range(3, 13))
LIMIT = 2.0  # s, of one run
HOPELESS = 10.0  # s, of a first run
BUDGET = 1.5  # s, for the repetitions of one tolerance and solver
TURN = 0.02  # s, of a solver's turn: short runs are made many times in it, as a user who varies parameters makes them


@dataclass
class Point:
    """One solver at one tolerance."""

    rtol: float
    error: float
    totals: list[float] = field(default_factory=list)  # s, of a whole call
    inners: list[float] = field(default_factory=list)  # s, of the integration in it

    @property
    def total(self) -> float:
        return statistics.median(self.totals)

    @property
    def inner(self) -> float:
        return statistics.median(self.inners)


@dataclass
class Curve:
    """One solver on one scene."""

    solver: str
    kind: str
    points: list[Point] = field(default_factory=list)
    remark: str = ""

    def time_to(self, target: float, inner: bool = False) -> float:
        """Time (s) to a true error, interpolated between neighbours; NaN where no run is that accurate."""
        data = [(p.error, p.inner if inner else p.total) for p in self.points if math.isfinite(p.error) and p.error > 0.0]
        found = [t for e, t in data if e <= target]
        for (e, t), (e_next, t_next) in pairwise(data):
            if (e - target) * (e_next - target) < 0.0:
                share = math.log(target / e) / math.log(e_next / e)
                found.append(t * (t_next / t) ** share)
        return min(found, default=math.nan)


def measure(scene: BenchScene | UserScene, solvers: tuple[Competitor, ...], repeats: int = 5) -> list[Curve]:
    """Curves of the solvers on a scene."""
    curves = [Curve(s.name, s.kind) for s in solvers]
    runs: dict[str, RunAt] = {}
    for solver, curve in zip(solvers, curves, strict=True):
        try:
            runs[solver.name] = solver.prepare(scene)
        except Unavailable as reason:
            curve.remark = str(reason)
    for rtol in TOLERANCES:
        _one_tolerance(scene, rtol, [c for c in curves if c.solver in runs], runs, repeats)
    return curves


def _one_tolerance(
    scene: BenchScene | UserScene, rtol: float, curves: list[Curve], runs: dict[str, RunAt], repeats: int
) -> None:
    active: list[tuple[Curve, Point, int]] = []
    for curve in curves:  # the first run compiles or fills caches, and is judged
        begin = time.process_time()
        try:
            values = runs[curve.solver](rtol)
        except Unavailable as reason:
            curve.remark = curve.remark or f"{rtol:.0e}: {reason}"
            continue
        seconds = time.process_time() - begin
        point = Point(rtol, scene.error(values))  # not timed: the first error computes the reference
        if seconds > HOPELESS:  # not made twice; what it compiled is little beside it
            point.totals.append(seconds)
            point.inners.append(seconds)
        else:
            seconds = _clock(runs[curve.solver], point, curve.kind)
        if seconds < TURN:  # a single run fills caches: not counted
            _clock(runs[curve.solver], point, curve.kind)
            del point.totals[0], point.inners[0]
        curve.points.append(point)
        if seconds > LIMIT:
            curve.remark = f"stopped at rtol {rtol:.0e}, which takes {seconds:.1f} s"
            del runs[curve.solver]
        elif seconds < BUDGET / 2:
            active.append((curve, point, repeats if seconds < BUDGET / repeats else 1))
    for k in range(1, repeats):
        for curve, point, count in active:
            if k < count:
                _clock(runs[curve.solver], point, curve.kind)


def _clock(run: RunAt, point: Point, kind: str) -> float:
    """Time a turn of as many runs as the point's last ones suggest."""
    times = max(1, round(TURN / point.totals[-1])) if point.totals else 1
    gc.disable()
    try:
        with clocked() as inner:
            start = time.process_time()
            for _ in range(times):
                run(point.rtol)
            total = (time.process_time() - start) / times
    finally:
        gc.enable()
    point.totals.append(total)
    point.inners.append(inner[0] / times if kind == "gearlib" else total)
    return total


def best(curves: Sequence[Curve | Row], kind: str, target: float, inner: bool = False) -> float:
    """Shortest time of a kind of solvers to an error; NaN where none gets there. ``auto`` is no method of its own."""
    times = [c.time_to(target, inner) for c in curves if c.kind == kind and c.solver != "gearlib auto"]
    return min((t for t in times if not math.isnan(t)), default=math.nan)


def main(names: list[str]) -> None:
    from tests.benchmarks.page import redraw, store
    from tests.benchmarks.users import USERS
    from tests.benchmarks.users_table import SOLVERS

    for name in names or (*SCENES, *USERS):
        start = time.perf_counter()
        store(name, measure(SCENES[name], FLOORS + OWN + others()) if name in SCENES else measure(USERS[name], SOLVERS))
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
    redraw()


if __name__ == "__main__":
    main(sys.argv[1:])
