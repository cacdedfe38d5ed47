"""Time of runs with sensitivities; writes a table of docs/gradients.md: ``python -m tests.benchmarks.gradients``.

Processor time, the least of some runs of the XP train (0.5 s, 501 samples, rtol 1e-6), reading the outputs included.
"""

from __future__ import annotations

import time
from typing import Any

import gearlib as gl
import gearparts as gp
from tests.measured import Part, table

NAMES = ["K_g", "C_g", "I_s", "I_p", "I_r", "I_h", "C_v", "R_s"]
METHODS = ("exact", "rk8")


def least(system: gl.System, method: str, names: list[str], repeat: int = 5) -> float:
    """Milliseconds of a run."""
    times = []
    for _ in range(repeat + 1):  # the first one compiles
        begin = time.process_time()
        run = system.simulate(0.5, samples=501, method=method, sensitivities=names)
        for name in names:
            run.sensitivity("q_ring", name)
        run["w_out"]
        times.append(1e3 * (time.process_time() - begin))
    return min(times[1:])


def measured() -> list[dict[str, Any]]:
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=["w_out", "q_ring"])
    return [{"method": m, "ms": [least(system, m, NAMES[:count]) for count in (0, 1, 8)]} for m in METHODS]


def text(rows: list[dict[str, Any]]) -> str:
    """The table."""
    head = ["XP train, a run of 0.5 s", "no sensitivities, ms", "one, ms", "eight, ms"]
    return table(head, [[f'`"{r["method"]}"`', *(f"{ms:.2g}" for ms in r["ms"])] for r in rows])


TABLE = Part("gradients", "gradients", text)
PARTS = [TABLE]


if __name__ == "__main__":
    TABLE.store(measured())
    print(TABLE.shown())
