"""How translation grows with the model: measurements, the table in docs/scale.md and its plot, the output in docs/how_it_scales.md.

Run as ``python -m tests.benchmarks.scale`` from the checkout. Every measurement is made in a process of its own with an empty cache, and
times are processor time, so that other work on the machine does not count.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests import architecture
from tests.measured import ROOT, Part

SIZES = {
    "chain": [10, 100, 1000, 10_000],
    "star": [20, 50, 200],
    "tree": [50, 200, 600, 1950],  # 1950 bodies: 5000 components
}
TITLES = {
    "chain": "chain of N inertias",
    "star": "star of N planetary sets",
    "tree": "random tree of N bodies on gears, with loops",
}
Row = dict[str, Any]

MEASURE = """
import json, resource, sys, time
import gearlib as gl
from tests.benchmarks.scenes import Chain, Star, Tree
clock = time.process_time
model = {"chain": Chain, "star": Star, "tree": Tree}["KIND"](N=SIZE)
compile = gl.compile
marks = [clock()]
system = compile(model)
marks.append(clock())
system.translation.scene.program
marks.append(clock())
source = system.source
try:  # the peak of this program; elsewhere the system's number may include the parent's
    memory = 1024 * int(next(l for l in open("/proc/self/status") if l.startswith("VmHWM")).split()[1])
except OSError:
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
marks.append(clock())
system.translation.scene.native
marks.append(clock())
again = [clock(), compile(type(model)(N=SIZE)), clock()]
flat = system.translation.model
print(json.dumps({"kind": "KIND", "n": SIZE, "components": len(flat.instances), "equations": flat.n_equations,
    "states": len(system.states), "compile": marks[1] - marks[0], "again": again[2] - again[0], "program": marks[2] - marks[1],
    "native": marks[4] - marks[3], "source": len(source.splitlines()), "memory": memory}))
"""

RUMOCA = """
import json, time
import rumoca
from tests.benchmarks import scenes
source = scenes.FORM(SIZE)
session = rumoca.Session()
begin = time.process_time()
model = session.loads(source, model="Chain")
print(json.dumps({"seconds": time.process_time() - begin, "version": rumoca.version()}))
"""

XP = """
import json, sys, time
begin = time.process_time()
start = begin  # since the process began
import gearlib as gl, gearparts as gp
system = gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=["w_out"])
last = system.simulate(t_end=0.05, samples=101, method="METHOD")["w_out"][-1]
total = time.process_time()
begin = time.process_time()
system.simulate(t_end=0.05, samples=101, method="METHOD")["w_out"]
again = time.process_time() - begin
files = [m for m in sys.modules if m != "__main__"]
print(json.dumps({"total": total, "run": again, "modules": files, "last": last}))
"""

# Imports what a run was seen to import, in the same order, and nothing else.
LOAD = """
import importlib, json, sys, time
for name in json.load(open(sys.argv[1])):
    try:
        importlib.import_module(name)
    except Exception:
        pass
print(json.dumps(time.process_time()))
"""


def run(script: str, *arguments: str, cache: str | None = None) -> Any:
    """What a script prints as JSON, in a process of its own, with an empty cache unless one is named."""
    with tempfile.TemporaryDirectory() as empty:
        path = os.pathsep.join([str(ROOT), str(ROOT / "library")])
        environment = {**os.environ, "PYTHONPATH": path, "GEARLIB_CACHE": cache or empty}
        done = subprocess.run(
            [sys.executable, "-c", script, *arguments], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
        )
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


@functools.cache
def measure(kind: str, n: int, repetitions: int = 3) -> Row:
    """Medians of some processes that translate a model."""
    rows = [run(MEASURE.replace("KIND", kind).replace("SIZE", str(n))) for _ in range(repetitions)]
    timed = {key: statistics.median(r[key] for r in rows) for key in ("compile", "again", "program", "native", "memory")}
    return {**rows[0], **timed}


@functools.cache
def rumoca(form: str, n: int) -> Row | None:
    """Seconds that rumoca needs for the chain in one of two forms; None where it is not installed."""
    try:
        return dict(run(RUMOCA.replace("FORM", form).replace("SIZE", str(n))))
    except RuntimeError as problem:
        if "No module named 'rumoca'" in str(problem):
            return None
        raise


def exponent(small: Row, large: Row, key: str = "compile") -> float:
    """Of the growth of time with components, between two sizes."""
    return math.log(large[key] / small[key]) / math.log(large["components"] / small["components"])


@functools.cache
def second_process(method: str = "auto", repetitions: int = 5) -> Row:
    """The XP train in a process that finds everything in the cache, beside one that only imports the same modules."""
    with tempfile.TemporaryDirectory() as folder:
        script = XP.replace("METHOD", method)
        first = run(script, cache=folder)
        names = Path(folder) / "modules.json"
        names.write_text(json.dumps(first["modules"]), encoding="utf-8")
        runs, loads = [], []
        for _ in range(repetitions):
            runs.append(run(script, cache=folder))
            loads.append(run(LOAD, str(names), cache=folder))
    total, integration = (statistics.median(r[key] for r in runs) for key in ("total", "run"))
    return {"total": total, "run": integration, "imports": statistics.median(loads), "first": first["total"]}


COLUMNS = {
    "n": ("N", "{}"), "components": ("components", "{}"), "equations": ("equations", "{}"), "states": ("states", "{}"),
    "compile": ("translate, s", "{:.3f}"), "again": ("again, s", "{:.3f}"), "program": ("program, s", "{:.3f}"),
    "native": ("machine code, s", "{:.2f}"), "source": ("lines of source", "{}"), "megabytes": ("memory, MB", "{:.0f}"),
}  # fmt: skip


def measured() -> Row:
    """All that the page shows."""
    keys = ("kind", "n", "components", "equations", "states", "compile", "again", "program", "native", "source", "memory")
    rows = [{key: measure(kind, n)[key] for key in keys} for kind, sizes in SIZES.items() for n in sizes]
    theirs = {form: [rumoca(form, n) for n in (100, 1000)] for form in RUMOCAS}
    processes = [{"method": method, **second_process(method)} for method in ("auto", "rk", "ida")]
    host = {"python": platform.python_version(), "machine": platform.machine()}
    return {**host, "rows": rows, "rumoca": theirs, "processes": processes}


RUMOCAS = {
    "rumoca_components": "rumoca, the chain as components and `connect` (what gearlib is given)",
    "rumoca_equations": "rumoca, the chain as flat equations (nothing to connect, no aliases)",
}


def text(kept: Row) -> str:
    """The page docs/scale.md below its title."""
    heads = [head for head, _ in COLUMNS.values()]
    lines = [
        "Processor seconds, each the median of three processes that began with an empty cache; "
        f"Python {kept['python']}, one core of an {kept['machine']} machine that also did other work. *Translate* is "
        "`gl.compile`; *again* is a second model of that size in the same process, whose classes are known; *program* is the sorted "
        "program that a run needs, made at the first run; *machine code* is its compilation, which the cache keeps (loading LLVM "
        "included). Linear scenes that are solved exactly need no machine code. Memory is the peak of the process before LLVM was "
        "loaded.",
        "",
        f"| model | {' | '.join(heads)} |",
        f"|---|{'---:|' * len(heads)}",
    ]
    for r in kept["rows"]:
        cells = [form.format({**r, "megabytes": r["memory"] / 2**20}[key]) for key, (_, form) in COLUMNS.items()]
        lines += [f"| {TITLES[r['kind']]} | {' | '.join(cells)} |"]
    lines += ["", "![Time to translate against the number of components](images/scale.png)", ""]
    for kind, title in TITLES.items():
        small, large = [r for r in kept["rows"] if r["kind"] == kind][-2:]
        lines.append(f"- {title}: time grows with the components to the power of {exponent(small, large, 'again'):.2f} between the "
                     "two largest (classes known).")  # fmt: skip
    return "\n".join([*lines, "", *_comparison(kept), "", *_process(kept["processes"])])


def _comparison(kept: Row) -> list[str]:
    if any(r is None for rows in kept["rumoca"].values() for r in rows):
        return ["## Beside rumoca", "", "Not measured: the package rumoca was not installed."]
    version = kept["rumoca"]["rumoca_components"][0]["version"]
    ours = {r["n"]: r["compile"] for r in kept["rows"] if r["kind"] == "chain"}
    lines = [
        "## Beside rumoca", "",
        f"rumoca {version}, `Session.loads` of the same chain, in the same run; the factor is against gearlib's `gl.compile` in a new "
        "process.", "", "| | N = 100, s | N = 1000, s | factor at N = 1000 |", "|---|---:|---:|---:|",
        f"| gearlib | {ours[100]:.3f} | {ours[1000]:.3f} | 1 |",
    ]  # fmt: skip
    for form, title in RUMOCAS.items():
        hundred, thousand = (r["seconds"] for r in kept["rumoca"][form])
        lines.append(f"| {title} | {hundred:.3f} | {thousand:.2f} | {thousand / ours[1000]:.0f} |")
    return lines


def _process(rows: list[Row]) -> list[str]:
    lines = [
        "## A second process", "",
        "The XP train (`gp.ZhouCui2022`), from the start of the process to `w_out`, with a warm cache; beside it a process that only "
        "imports the same modules, and the integration alone.", "",
        "| method | first process, s | second process, s | imports, s | integration, s | second / (imports + integration) |",
        "|---|---:|---:|---:|---:|---:|",
    ]  # fmt: skip
    lines += [
        f"| {r['method']} | {r['first']:.2f} | {r['total']:.2f} | {r['imports']:.2f} | {r['run']:.4f} | "
        f"{r['total'] / (r['imports'] + r['run']):.2f} |"
        for r in rows
    ]
    return lines


PAGE = Part("scale", "scale", text)
PARTS = [PAGE]


def plot(path: Path) -> None:
    """Time against components, on logarithmic axes."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from tests.pictures import save

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for (kind, sizes), marker in zip(SIZES.items(), "os^", strict=True):
        rows = [measure(kind, n) for n in sizes]
        x = [r["components"] for r in rows]
        axes.loglog(x, [r["again"] for r in rows], marker + "-", label=TITLES[kind])
    for form, label in (
        ("rumoca_components", "chain, rumoca (components)"),
        ("rumoca_equations", "chain, rumoca (flat equations)"),
    ):
        sizes = [n for n in (10, 100, 1000) if rumoca(form, n)]
        if sizes:
            axes.loglog([measure("chain", n)["components"] for n in sizes], [(rumoca(form, n) or {})["seconds"] for n in sizes], "x--",
                        label=label)  # fmt: skip
    axes.set_xlabel("components")
    axes.set_ylabel("processor time to translate, s")
    axes.grid(which="major", alpha=0.3)
    axes.legend(fontsize="small")
    save(figure, path)
    plt.close(figure)


def refresh(page: Path) -> None:
    """Run the code of a page and put what it prints below each block."""
    names: Row = {"__name__": "page"}

    def printed(block: re.Match[str]) -> str:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(block[1], str(page), "exec"), names)
        return f"```python\n{block[1]}```\n" + (f"\n```text\n{out.getvalue()}```\n" if out.getvalue() else "")

    text = page.read_text(encoding="utf-8")
    block = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n.*?^```\n)?", re.MULTILINE | re.DOTALL)
    page.write_text(block.sub(printed, text), encoding="utf-8")


if __name__ == "__main__":
    refresh(ROOT / "docs" / "how_it_scales.md")
    plot(ROOT / "docs" / "images" / "scale.png")
    PAGE.store(measured())
    architecture.write_page()  # its table shows the first process
