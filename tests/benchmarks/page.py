"""Tables and pictures of the measured curves: docs/benchmarks.md between its marks, docs/images/work_precision_*.png.

python -m tests.benchmarks.page     writes page and pictures anew, from the kept times, and measures nothing
"""

from __future__ import annotations

import math
import os
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.benchmarks.references import SCENES
from tests.measured import Part
from tests.pictures import save

if TYPE_CHECKING:
    from tests.benchmarks.work_precision import Curve

DOCS = Path(__file__).resolve().parents[2] / "docs"
TARGETS = (1e-4, 1e-6, 1e-8)  # errors whose times are tabled
LEVELS = (1e-4, 1e-6, 1e-8)  # rtol of the table of IDA


@dataclass(frozen=True)
class Row:
    """A solver on a scene, as far as the page shows it.

    Parameters
    ----------
    solver, kind, remark : str
    ms, inner_ms : list of float
        Time of a call, and of the integration in it, to each of `TARGETS`; NaN where no run is that accurate.
    quotients : list of float
        Least and largest error / rtol; empty without a run.
    level_ms : list of float
        Integration at each of `LEVELS`.
    beside_ms : float
        Least time of a call beside its integration.
    """

    solver: str
    kind: str
    ms: Sequence[float]
    inner_ms: Sequence[float]
    quotients: Sequence[float]
    level_ms: Sequence[float]
    beside_ms: float
    remark: str

    def time_to(self, target: float, inner: bool = False) -> float:
        """Time (s) to a true error."""
        return 1e-3 * (self.inner_ms if inner else self.ms)[TARGETS.index(target)]


def row(curve: Curve) -> Row:
    """What the page shows of a curve."""
    at, own = {p.rtol: 1e3 * p.inner for p in curve.points}, curve.kind == "gearlib"
    quotients = [p.error / p.rtol for p in curve.points]
    return Row(
        curve.solver,
        curve.kind,
        [1e3 * curve.time_to(target) for target in TARGETS],
        [1e3 * curve.time_to(target, inner=True) if own else math.nan for target in TARGETS],
        [min(quotients), max(quotients)] if quotients else [],
        [at.get(rtol, math.nan) if "ida" in curve.solver.lower() else math.nan for rtol in LEVELS],
        min((1e3 * (p.total - p.inner) for p in curve.points if own), default=math.nan),
        curve.remark,
    )


def loaded(kept: dict[str, Any]) -> dict[str, list[Row]]:
    """The rows of each scene."""

    def numbers(values: list[Any]) -> list[float]:
        return [math.nan if value is None else value for value in values]

    return {
        name: [
            Row(**{k: numbers(v) if isinstance(v, list) else math.nan if v is None else v for k, v in each.items()})
            for each in scene["rows"]
        ]
        for name, scene in kept["scenes"].items()
    }


def store(name: str, curves: list[Curve]) -> None:
    """Keep a scene's times, and write the page with those of the others, which may be of another day."""
    kept = CURVES.load() if CURVES.data.exists() else {"scenes": {}}
    kept["scenes"][name] = {"on": machine(), "load": os.getloadavg()[0], "rows": [asdict(row(c)) for c in curves]}
    CURVES.store(kept)


def redraw() -> None:
    """Draw the pictures from the kept times."""
    for name, rows in loaded(CURVES.load()).items():
        if name in SCENES:
            draw(name, rows, DOCS / "images" / f"work_precision_{name}.png")


def number(value: float, factor: float = 1.0) -> str:
    """Three digits, or a dash."""
    return "-" if math.isnan(value) else f"{factor * value:.3g}"


def scene_table(name: str, curves: list[Row]) -> list[str]:
    from tests.benchmarks.work_precision import best

    floors = [best(curves, "floor", target) for target in TARGETS]
    lines = [
        f"### {name}: {SCENES[name].title}", "",
        "| solver | 1e-4, ms | 1e-6, ms | 1e-8, ms | over the floor | error / rtol | remark |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for curve in curves:
        if curve.kind in ("floor", "IDA floor") and not curve.quotients:
            continue
        times = [curve.time_to(target) for target in TARGETS]
        over = " / ".join(number(t / f) for t, f in zip(times, floors, strict=True))
        span = " .. ".join(f"{q:.2g}" for q in curve.quotients) or "-"
        cells = [curve.solver, *(number(t, 1e3) for t in times), over, span, curve.remark]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, "", f"![Time against error, {name}](images/work_precision_{name}.png)", ""]


def verdicts(measured: dict[str, list[Row]]) -> list[str]:
    """What was to hold, scene by scene."""
    from tests.benchmarks.work_precision import best

    lines = [
        "| scene | error | floor, ms | best method, ms | over floor | `auto`, ms | over best "
        "| acausal over auto | heyoka over auto | others over auto |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, curves in measured.items():
        auto = next(c for c in curves if c.solver == "gearlib auto")
        for target in TARGETS:
            floor, ours = best(curves, "floor", target), best(curves, "gearlib", target, inner=True)
            picked, whole = auto.time_to(target, inner=True), auto.time_to(target)
            series = [c for c in curves if c.solver == "heyoka"]
            rivals = [best(curves, "acausal", target), best(series, "other", target)]
            rivals.append(best([c for c in curves if c not in series], "other", target))
            cells = [name, f"{target:.0e}", number(floor, 1e3), number(ours, 1e3), number(ours / floor), number(picked, 1e3),
                     number(picked / ours), *(number(r / whole) for r in rivals)]  # fmt: skip
            lines.append("| " + " | ".join(cells) + " |")
    return [*lines, ""]


def side_tables(measured: dict[str, list[Row]]) -> list[str]:
    """IDA against its floor, and what a run costs beside its integration."""
    lines = ["| scene | rtol | IDA floor, ms | `ida`, ms | ratio |", "|---|---|---|---|---|"]
    for name, curves in measured.items():
        by_name = {c.solver: c.level_ms for c in curves}
        for rtol, a, b in zip(LEVELS, by_name.get("IDA floor, C", ()), by_name["gearlib ida"], strict=False):
            if not math.isnan(a + b):
                lines.append(f"| {name} | {rtol:.0e} | {number(a)} | {number(b)} | {number(b / a)} |")
    own = [c.solver for c in next(iter(measured.values())) if c.kind == "gearlib"]
    lines += ["", f"| scene | {' | '.join(own)} |", "|---" * (len(own) + 1) + "|"]
    for name, curves in measured.items():
        beside = ["-" if math.isnan(c.beside_ms) else f"{c.beside_ms:.2f}" for c in curves if c.kind == "gearlib"]
        lines.append(f"| {name} | " + " | ".join(beside) + " |")
    return [*lines, ""]


def goals(measured: dict[str, list[Row]]) -> list[str]:
    """Where the goals hold, with the numbers of the tables."""
    from tests.benchmarks.work_precision import best

    def over(name: str, kind: str, target: float, series: bool = False) -> float:
        """A rival's call over auto's: heyoka's, or that of the best of the others."""
        rows = measured[name]
        auto = next(r for r in rows if r.solver == "gearlib auto")
        rivals = [r for r in rows if (r.solver == "heyoka") == series]
        return best(rivals, kind, target) / auto.time_to(target)

    def spans(ratios: dict[str, list[float]]) -> str:
        """`M3 (14.8 to 19.5)`."""
        found = {n: sorted({number(v) for v in values if not math.isnan(v)}, key=float) for n, values in ratios.items()}
        return ", ".join(f"{n} ({' to '.join(dict.fromkeys((v[0], v[-1])))})" for n, v in found.items() if v) or "none"

    def split(kind: str, wanted: float) -> str:
        ratios = {name: [over(name, kind, target) for target in TARGETS] for name in measured}
        missed = {name: [v for v in values if v < wanted] for name, values in ratios.items()}
        return f"held on {spans({n: v for n, v in ratios.items() if not missed[n]})}; missed on {spans(missed)}"

    taylor = {name: [over(name, "other", target, series=True) for target in TARGETS] for name in measured}
    faster = {name: [1 / v for v in values if v < 1.0] for name, values in taylor.items()}
    slower = {name: [v for v in values if v >= 1.0] for name, values in taylor.items()}
    beside = {
        n: [r.beside_ms for r in rows if r.solver == "gearlib auto" and not r.beside_ms <= 0.3] for n, rows in measured.items()
    }
    careful = [
        f"{r.solver.removeprefix('gearlib ')} on {name} (from {r.quotients[0]:.2g})"
        for name, rows in measured.items()
        for r in rows
        if r.solver in ("gearlib rk5", "gearlib rk8", "gearlib ida") and r.quotients and r.quotients[0] < 0.01
    ]
    return [
        f"- *Twenty times faster than every acausal tool* (rumoca's call over that of `auto`): {split('acausal', 20.0)}.",
        f"- *Five times faster than every other solver*, SciPy and CasADi: {split('other', 5.0)}.",
        f"- *The same*, heyoka: a call of `auto` is faster on {spans(slower)}; heyoka's is faster on {spans(faster)}.",
        f"- *0.3 ms beside an integration*, `auto`: missed on {spans(beside)}.",
        f"- *Error / rtol from 0.01 on*: less with {', '.join(careful) or 'none'}.",
        "",
    ]  # fmt: skip


LINES = {
    "gearlib auto": {"ls": "", "marker": "o", "ms": 9, "mfc": "none", "color": "black"},
    "gearlib exact": {"color": "#0b5394", "marker": "*", "lw": 1.8, "ms": 5},
    "gearlib rk5": {"color": "#e08e0b", "marker": ".", "lw": 1.8},
    "gearlib rk8": {"color": "#2e8b57", "marker": ".", "lw": 1.8},
    "gearlib taylor": {"color": "#e0489b", "marker": "+", "lw": 1.8},
    "gearlib ida": {"color": "#d1495b", "marker": ".", "lw": 1.8},
    "SciPy LSODA": {"color": "#6a3d9a", "marker": "o"},
    "SciPy Radau": {"color": "#b07cc6", "marker": "s"},
    "SciPy DOP853": {"color": "#8e2f8a", "marker": "v"},
    "CasADi idas": {"color": "#8d5524", "marker": "^"},
    "CasADi cvodes": {"color": "#c2185b", "marker": "<"},
    "heyoka": {"color": "#00838f", "marker": ">"},
    "rumoca rk-like": {"color": "#7a8b00", "marker": "p"},
    "rumoca bdf": {"color": "#1f6fd1", "marker": "h"},
}
"""How each solver is drawn, the same in every picture."""
SPARE = (("#455a64", "X"), ("#ad6b00", "D"), ("#5d4037", "P"), ("#004d40", "d"))


def style_of(curve: Row) -> dict[str, Any]:
    """Colour and marker of a solver; the floors are black."""
    if curve.kind not in ("gearlib", "other", "acausal"):
        return {"lw": 1.2, "color": "black", "ls": "--" if "IDA" in curve.kind else "-." if ", C" in curve.solver else "-"}
    if curve.solver in LINES:
        return {"lw": 0.8, "ms": 3.5} | LINES[curve.solver]
    colour, marker = SPARE[sum(map(ord, curve.solver)) % len(SPARE)]
    return {"lw": 0.8, "ms": 3.5, "color": colour, "marker": marker}


def draw(name: str, curves: list[Row], path: Path) -> None:
    """Time against error: gearlib's curves thick, the floors black, the others thin."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.9), layout="constrained")
    for curve in curves:
        reached = [(target, ms) for target, ms in zip(TARGETS, curve.ms, strict=True) if not math.isnan(ms)]
        if reached:
            axes.loglog(*zip(*reached, strict=True), label=curve.solver, **style_of(curve))
    axes.set(xlabel="largest error over largest value", ylabel="processor time, ms", title=SCENES[name].title)
    axes.invert_xaxis()
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, path)
    plt.close(figure)


def machine() -> str:
    try:
        listed = subprocess.run(["lscpu"], capture_output=True, text=True, check=True).stdout
        fields = dict(line.split(":", 1) for line in listed.splitlines() if ":" in line)
        cpu = f"{fields.get('Model name', '?').strip()} at {float(fields.get('BogoMIPS', '0')) / 2000:.1f} GHz"
    except (OSError, subprocess.CalledProcessError):
        cpu = platform.processor()
    return f"{cpu}, {os.cpu_count()} cores, Python {platform.python_version()}, {date.today()}"


def page(kept: dict[str, Any]) -> str:
    """The text made of the kept times."""
    from tests.benchmarks.users import USERS
    from tests.benchmarks.users_table import table

    rows = loaded(kept)
    measured, users = ({n: rows[n] for n in names if n in rows} for names in (SCENES, USERS))
    scenes = kept["scenes"].values()
    days, loads = sorted({s["on"] for s in scenes}), [s["load"] for s in scenes]
    lines = [
        "", f"Measured on {'; '.join(days)}; load average {min(loads):.1f} to {max(loads):.1f} (other programs were running).", "",
        "## What was aimed at, and what is", "", *verdicts(measured), *goals(measured),
        "## IDA, and what a run costs beside its integration", "",
        *side_tables(measured), *(["## Users' scenes", "", *table(users)] if users else []), "## All solvers", "",
    ]  # fmt: skip
    for name, curves in measured.items():
        lines += scene_table(name, curves)
    return "\n".join(lines)


CURVES = Part("curves", "benchmarks", page)
PARTS = [CURVES]


if __name__ == "__main__":
    CURVES.write()
    redraw()
