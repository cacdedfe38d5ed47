"""Tables and pictures of the measured curves: docs/benchmarks.md between its markers, docs/images/work_precision_*.png.

python -m tests.benchmarks.page     draws the pictures anew, from the times in the page's tables, and measures nothing
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.benchmarks.references import SCENES
from tests.pictures import save

if TYPE_CHECKING:
    from tests.benchmarks.work_precision import Curve

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / ".cache" / "benchmarks"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


def save_curves(name: str, curves: list[Curve]) -> None:
    """Keep the curves of a scene, so that scenes can be measured one at a time."""
    KEPT.mkdir(parents=True, exist_ok=True)
    kept = {"load": os.getloadavg()[0], "curves": [asdict(c) for c in curves]}
    (KEPT / f"{name}.json").write_text(json.dumps(kept))


def load_curves(name: str) -> list[Curve]:
    from tests.benchmarks.work_precision import Curve, Point

    kept = json.loads((KEPT / f"{name}.json").read_text())["curves"]
    return [Curve(c["solver"], c["kind"], [Point(**p) for p in c["points"]], c["remark"]) for c in kept]


def tabled_curves(name: str, page: str) -> list[Curve]:
    """The curves of a scene as the page's table has them: the times to its three errors."""
    from tests.benchmarks.work_precision import TARGETS, Curve, Point

    section = page.split(f"### {name}:")[1].split("\n###")[0]
    found = []
    for line in section.splitlines():
        solver, *cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if line.startswith("| ") and solver != "solver":
            times = zip(TARGETS, cells[: len(TARGETS)], strict=True)
            points = [Point(math.nan, target, [1e-3 * float(t)], []) for target, t in times if t != "-"]
            kind = "IDA floor" if solver.startswith("IDA floor") else "floor" if "floor" in solver else "other"
            found.append(Curve(solver, "gearlib" if solver.startswith("gearlib") else kind, points))
    return found


def redraw(docs: Path) -> None:
    """Draw the pictures from the tables of the page."""
    page = (docs / "benchmarks.md").read_text(encoding="utf-8")
    for name in SCENES:
        if f"### {name}:" in page:
            draw(name, tabled_curves(name, page), docs / "images" / f"work_precision_{name}.png")


def number(value: float, factor: float = 1.0) -> str:
    """Three digits, or a dash."""
    return "-" if math.isnan(value) else f"{factor * value:.3g}"


def scene_table(name: str, curves: list[Curve]) -> list[str]:
    from tests.benchmarks.work_precision import TARGETS, best

    floors = [best(curves, "floor", target) for target in TARGETS]
    lines = [
        f"### {name}: {SCENES[name].title}", "",
        "| solver | 1e-4, ms | 1e-6, ms | 1e-8, ms | over the floor | error / rtol | remark |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for curve in curves:
        if curve.kind in ("floor", "IDA floor") and not curve.points:
            continue
        times = [curve.time_to(target) for target in TARGETS]
        over = " / ".join(number(t / f) for t, f in zip(times, floors, strict=True))
        quotients = [p.error / p.rtol for p in curve.points]
        span = f"{min(quotients):.2g} .. {max(quotients):.2g}" if quotients else "-"
        cells = [curve.solver, *(number(t, 1e3) for t in times), over, span, curve.remark]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, "", f"![Time against error, {name}](images/work_precision_{name}.png)", ""]


def verdicts(measured: dict[str, list[Curve]]) -> list[str]:
    """What was to hold, scene by scene."""
    from tests.benchmarks.work_precision import TARGETS, best

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


def side_tables(measured: dict[str, list[Curve]]) -> list[str]:
    """IDA against its floor, and what a run costs beside its integration."""
    lines = ["| scene | rtol | IDA floor, ms | `ida`, ms | ratio |", "|---|---|---|---|---|"]
    for name, curves in measured.items():
        by_name = {c.solver: {p.rtol: p for p in c.points} for c in curves}
        floor, own = by_name.get("IDA floor, C", {}), by_name["gearlib ida"]
        for rtol in (1e-4, 1e-6, 1e-8):
            if rtol in floor and rtol in own:
                a, b = floor[rtol].inner, own[rtol].inner
                lines.append(f"| {name} | {rtol:.0e} | {number(a, 1e3)} | {number(b, 1e3)} | {number(b / a)} |")
    lines += ["", "| scene | " + " | ".join(c.solver for c in next(iter(measured.values())) if c.kind == "gearlib") + " |",
              "|---|---|---|---|---|---|"]  # fmt: skip
    for name, curves in measured.items():
        beside = [
            "-" if not c.points else f"{1e3 * min(p.total - p.inner for p in c.points):.2f}"
            for c in curves
            if c.kind == "gearlib"
        ]
        lines.append(f"| {name} | " + " | ".join(beside) + " |")
    return [*lines, ""]


LINES = {
    "gearlib auto": {"ls": "", "marker": "o", "ms": 9, "mfc": "none", "color": "black"},
    "gearlib exact": {"color": "#0b5394", "marker": "*", "lw": 1.8, "ms": 5},
    "gearlib rk5": {"color": "#e08e0b", "marker": ".", "lw": 1.8},
    "gearlib rk8": {"color": "#2e8b57", "marker": ".", "lw": 1.8},
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


def style_of(curve: Curve) -> dict[str, Any]:
    """Colour and marker of a solver; the floors are black."""
    if curve.kind not in ("gearlib", "other", "acausal"):
        return {"lw": 1.2, "color": "black", "ls": "--" if "IDA" in curve.kind else "-." if ", C" in curve.solver else "-"}
    if curve.solver in LINES:
        return {"lw": 0.8, "ms": 3.5} | LINES[curve.solver]
    colour, marker = SPARE[sum(map(ord, curve.solver)) % len(SPARE)]
    return {"lw": 0.8, "ms": 3.5, "color": colour, "marker": marker}


def draw(name: str, curves: list[Curve], path: Path) -> None:
    """Time against error: gearlib's curves thick, the floors black, the others thin."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.9), layout="constrained")
    for curve in curves:
        points = [p for p in curve.points if 1e-15 < p.error < 1.0]
        if points:
            axes.loglog([p.error for p in points], [1e3 * p.total for p in points], label=curve.solver, **style_of(curve))
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


def write_page(docs: Path) -> None:
    """Put all kept curves into the page."""
    from tests.benchmarks.users import USERS
    from tests.benchmarks.users_table import table

    names = [n for n in SCENES if (KEPT / f"{n}.json").exists()]
    users = {n: load_curves(n) for n in USERS if (KEPT / f"{n}.json").exists()}
    measured = {n: load_curves(n) for n in names}
    loads = [json.loads((KEPT / f"{n}.json").read_text())["load"] for n in names]
    lines = [
        BEGIN, "", f"Measured on {machine()}; load average {min(loads):.1f} to {max(loads):.1f} (other programs were running).", "",
        "## What was aimed at, and what is", "", *verdicts(measured), "## IDA, and what a run costs beside its integration", "",
        *side_tables(measured), *(["## Users' scenes", "", *table(users)] if users else []), "## All solvers", "",
    ]  # fmt: skip
    for name, curves in measured.items():
        lines += scene_table(name, curves)
    page = docs / "benchmarks.md"
    text = page.read_text()
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    page.write_text(head + "\n".join([*lines, END]) + tail)
    redraw(docs)


if __name__ == "__main__":
    redraw(ROOT / "docs")
