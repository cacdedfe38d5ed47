"""Time of the lowest modes of large trains, of their energies and of the sparse linear model; writes a table of docs/linear_analysis.md.

    python -m tests.benchmarks.modal

Processor time, the least of two; trains are compiled before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import gearlib as gl
from tests.benchmarks.scenes import Chain, Tree
from tests.measured import Part, table

COUNT = 20
TRAINS: tuple[tuple[str, Callable[[], gl.Component]], ...] = (
    ("chain of 1000 bodies, a damper at its end", lambda: Chain(N=1000)),
    ("chain of 5000 bodies", lambda: Chain(N=5000)),
    ("random tree of 2000 geared bodies with loops", lambda: Tree(N=2000)),
)
DENSE = (300, 600, 1000)  # bodies of chains whose poles `gl.stability` computes


def least(function: Callable[[], Any]) -> float:
    """Processor time, s."""
    times = []
    for _ in range(2):
        begin = time.process_time()
        function()
        times.append(time.process_time() - begin)
    return min(times)


def measured() -> dict[str, Any]:
    rows = []
    for title, make in TRAINS:
        system = gl.compile(make())
        row = {"train": title, "states": len(system.states), "modes": least(lambda s=system: gl.modes(s, COUNT))}  # type: ignore[misc]
        modes = gl.modes(system, COUNT)
        rows.append(row)
        print(row, len(modes.frequencies), flush=True)
    dense = []
    for n in DENSE:
        system = gl.compile(Chain(N=n))
        dense.append({"states": len(system.states), "poles": least(lambda s=system: gl.stability(s))})  # type: ignore[misc]
        print(dense[-1], flush=True)
    return {"modes": rows, "dense": dense}


def text(kept: dict[str, Any]) -> str:
    """The table, and what all poles take."""
    rows = [[r["train"], str(r["states"]), f"{r['modes']:.2g} s"] for r in kept["modes"]]
    poles = ", ".join(f"{r['poles']:.2g} s with {r['states']} states" for r in kept["dense"])
    return (
        table(["train", "states", f"{COUNT} modes"], rows)
        + f"\n\nAll poles of a chain, as `gl.stability` computes them: {poles}."
    )


TABLE = Part("modal", "linear_analysis", text)
PARTS = [TABLE]


if __name__ == "__main__":
    TABLE.store(measured())
