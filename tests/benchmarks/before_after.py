"""Figures of an older commit and of this checkout, measured in turns in one run: the table before and after of docs/benchmarks.md.

    python -m tests.benchmarks.before_after [COMMIT] [--rounds N] [--quick]     five rounds take some twelve minutes

The older commit is unpacked beside the checkout. Processes of both take turns, each version with a cache of its own; of every figure the
least of all rounds counts, as processor time. Scenes and errors are those of `tests.benchmarks.references`, and both versions are held to
the same references. ``--quick`` measures a few figures once, prints them, and leaves the page as it is.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.page import TARGETS, machine, number
from tests.benchmarks.references import SCENES
from tests.benchmarks.scale import XP
from tests.benchmarks.work_precision import Curve, Point
from tests.measured import ROOT, Part, table

BEFORE = "b4e6e2a"
"""The last commit before the architecture was counted (its successor wrote tests/architecture.json)."""
TOLERANCES = tuple(10.0**-k for k in range(3, 11))
ROUNDS = 5
METHODS = ("auto", "rk", "ida")

# A call of `simulate` at each tolerance, with a parameter that every run changes in its last digit, and reading the outputs.
SCENE = """
import gc, json, sys, time
import numpy as np
import gearlib as gl
from tests.benchmarks.references import SCENES
name, tolerances, turned, start, values = json.loads(sys.argv[1])
scene = SCENES[name]
system = gl.compile(scene.component(), outputs=list(scene.outputs))
value, count, least = system.parameters[turned], 0, []
def run(rtol):
    global count
    count += 1
    result = system.simulate(scene.times[-1], times=scene.times, rtol=rtol, start=start,
                             parameters={turned: value * (1 + count % 400 * 2.2e-16)})
    return np.column_stack([result[output] for output in scene.outputs])
for rtol in tolerances:
    if values:
        np.save(f"{values}/{tolerances.index(rtol)}.npy", run(rtol))
    run(rtol)
    gc.disable()
    times, begin = [], time.process_time()
    while len(times) < 5 or time.process_time() - begin < 0.05:
        now = time.process_time()
        run(rtol)
        times.append(time.process_time() - now)
    gc.enable()
    least.append(min(times))
print(json.dumps(least))
"""

COMPILE = """
import json, time
import gearlib as gl, gearparts as gp
from tests.benchmarks.scenes import Chain
begin = time.process_time()
gl.compile(MODEL)
print(json.dumps(time.process_time() - begin))
"""


@dataclass(frozen=True)
class Version:
    """One of the two: its files and its cache."""

    root: Path
    cache: Path

    def run(self, script: str, *arguments: str, cache: Path | None = None) -> Any:
        """What a script prints as JSON, in a process of its own."""
        path = os.pathsep.join([str(self.root), str(self.root / "library")])
        environment = {**os.environ, "PYTHONPATH": path, "GEARLIB_CACHE": str(cache or self.cache)}
        command = [sys.executable, "-W", "ignore", "-c", script, *arguments]
        done = subprocess.run(command, env=environment, cwd=self.root, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
        return json.loads(done.stdout.splitlines()[-1])


def unpacked(commit: str, folder: Path) -> Path:
    """The files of a commit in a folder."""
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="data")
    return folder


Row = tuple[str, tuple[float, float]]
"""A figure's name and its values before and after."""


def scene_rows(name: str, versions: tuple[Version, Version], tolerances: tuple[float, ...], rounds: int) -> Iterator[Row]:
    """Milliseconds of a call with the automatic method to the errors of the work-precision page."""
    from tests.benchmarks.contestants import START, TURNED

    least = [np.full(len(tolerances), math.inf) for _ in versions]
    curves = []
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(rounds):
            for k in (0, 1) if turn % 2 == 0 else (1, 0):
                values = Path(folder) / str(k)
                values.mkdir(exist_ok=True)
                request = [name, tolerances, TURNED[name[:2]], START.get(name), str(values) if turn == 0 else ""]
                least[k] = np.minimum(least[k], versions[k].run(SCENE, json.dumps(request)))
        for k, found in enumerate(least):
            errors = [SCENES[name].error(np.load(Path(folder) / str(k) / f"{i}.npy")) for i in range(len(tolerances))]
            points = zip(tolerances, errors, found.tolist(), strict=True)
            curves.append(Curve("auto", "gearlib", [Point(rtol, error, [t], [t]) for rtol, error, t in points]))
    for target in TARGETS:
        before, after = (1e3 * curve.time_to(target) for curve in curves)
        yield f"{name}, error {target:.0e}, ms", (before, after)


def compile_row(title: str, model: str, versions: tuple[Version, Version], rounds: int) -> Row:
    """Seconds of `gl.compile` in a new process."""
    least = [math.inf, math.inf]
    for turn in range(rounds):
        for k in (0, 1) if turn % 2 == 0 else (1, 0):
            least[k] = min(least[k], versions[k].run(COMPILE.replace("MODEL", model)))
    return title, (least[0], least[1])


def process_rows(method: str, versions: tuple[Version, Version], rounds: int) -> Iterator[Row]:
    """Seconds of a process from its start to a history of the XP train: on a machine without a cache, and the second time."""
    first, second = [math.inf, math.inf], [math.inf, math.inf]
    for turn in range(rounds):
        for k in (0, 1) if turn % 2 == 0 else (1, 0):
            with tempfile.TemporaryDirectory() as folder:
                for least in (first, second):
                    least[k] = min(least[k], versions[k].run(XP.replace("METHOD", method), cache=Path(folder))["total"])
    yield f"first process, XP, `{method}`, s", (first[0], first[1])
    yield f"second process, XP, `{method}`, s", (second[0], second[1])


def measured(versions: tuple[Version, Version], rounds: int, quick: bool) -> Iterator[Row]:
    """All rows."""
    for name in ("M2", "XP") if quick else SCENES:
        yield from scene_rows(name, versions, TOLERANCES[::3] if quick else TOLERANCES, rounds)
    yield compile_row("compile, XP, s", "gp.ZhouCui2022(tau_in=100.0), outputs=['w_out']", versions, rounds)
    bodies = 1000 if quick else 10_000
    yield compile_row(f"compile, chain of {bodies} inertias, s", f"Chain(N={bodies})", versions, rounds)
    for method in METHODS[:1] if quick else METHODS:
        yield from process_rows(method, versions, rounds)


def text(kept: dict[str, Any]) -> str:
    """The part of the page."""
    found = [(r["figure"], r["before"], r["after"]) for r in kept["rows"] if r["before"] and r["after"]]
    rows = [[figure, number(before), number(after), number(after / before)] for figure, before, after in found]
    rounds = "one round" if kept["rounds"] == 1 else f"{kept['rounds']} rounds"
    said = f"Measured on {kept['machine']}, load average {kept['load']:.1f}, {rounds}, against commit {kept['commit']}."
    return f"{said}\n\n{table(['figure', 'before', 'after', 'after / before'], rows)}"


TABLE = Part("before_after", "benchmarks", text)
PARTS = [TABLE]


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("commit", nargs="?", default=BEFORE)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args(arguments)
    rounds = 1 if given.quick else given.rounds
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        old = Version(unpacked(given.commit, Path(folder) / "before"), Path(folder) / "cache_before")
        new = Version(ROOT, Path(folder) / "cache_after")
        for name, (before, after) in measured((old, new), rounds, given.quick):
            rows.append({"figure": name, "before": before, "after": after})
            print(f"{name:45} {number(before):>8} {number(after):>8} {number(after / before):>8}", flush=True)
    if not given.quick:
        load = os.getloadavg()[0]
        TABLE.store({"machine": machine(), "load": load, "commit": given.commit, "rounds": rounds, "rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
