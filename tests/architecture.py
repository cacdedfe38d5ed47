"""Counts that say how much there is to learn about the engine: ``python tests/architecture.py`` prints them beside their limits.

``-v`` lists what is counted, ``--lower`` writes smaller counts into ``architecture.json`` as the new limits, ``--page`` writes the limits
into the table of ``docs/phases.md``. The limits may only fall.
"""

from __future__ import annotations

import ast
import gc
import importlib
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LIMITS = Path(__file__).with_suffix(".json")
CACHES = {"lru_cache", "cache", "WeakKeyDictionary", "WeakValueDictionary"}

# The records and texts that one equation becomes, in this order. One that went counts no more.
FORMS = (
    "gearlib.language.expressions.Eq",
    "gearlib.equations.template.Template",
    "gearlib.flatten.model.EquationGroup",
    "gearlib.equations.kernel.Kernel",
    "gearlib.program.program.Batch",
    "gearlib.native.source.Body",
    "gearlib.native.scene_functions.NativeFunction",
    "gearlib.compiler.instructions.Writer",
    "gearlib.compiler.object_code.CompiledFunction",
)

# Where one concept is implemented. One that went counts no more; a new one is to be listed.
IMPLEMENTATIONS = {
    "differentiating a program": (
        "gearlib.program.derivatives.entries",
    ),  # before there is a program, `EquationGroup.values` evaluates the partial derivatives of equations
    "event iteration": (
        "gearlib.program.event_iteration.EventIteration",
        "gearlib.solvers.drive.drive_loop.settle",
    ),
    "sparse elimination": (
        "gearlib.structure.sparse_rows.eliminate",
    ),  # what chooses its pivots: rigid_loops, states, sparse_elimination
    "integration driver": ("gearlib.solvers.drive.driver.Driver",),
    "Newton's method": (
        "gearlib.program.newton.newton",
        "gearlib.native.source._newton",
    ),
    "compiler": ("gearlib.compiler.translate.translated",),
}


# ---------------------------------------------------------------- the text


@contextmanager
def uncollected() -> Iterator[None]:
    """No garbage is looked for in the many objects of syntax trees, neither now nor later."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@cache
def syntax(path: Path) -> ast.Module:
    """Syntax tree of a file."""
    with uncollected():
        return ast.parse(path.read_text(encoding="utf-8"))


@cache
def files() -> dict[str, Path]:
    """File of each module of gearlib, by dotted name."""
    paths = sorted((ROOT / "gearlib").rglob("*.py"))
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


@cache
def sources() -> dict[str, ast.Module]:
    """Syntax tree of each module of gearlib, by dotted name."""
    return {name: syntax(path) for name, path in files().items()}


@cache
def nodes(tree: ast.Module) -> list[ast.AST]:
    with uncollected():
        return list(ast.walk(tree))


def imported_modules(tree: ast.Module) -> Iterator[str]:
    """Modules of gearlib that a module imports, anywhere in its text, also for its annotations only."""
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name in sources())
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in sources() or node.module in sources():
                    yield inner if inner in sources() else node.module


@cache
def imports() -> set[tuple[str, str]]:
    """Pairs (module, imported module); not those of ``gearlib`` itself, which exports what all others define."""
    return {(a, b) for a, tree in sources().items() for b in imported_modules(tree) if a != "gearlib" != b}


def import_circles() -> list[str]:
    """Groups of modules that import each other."""
    import networkx as nx

    graph = nx.DiGraph(list(imports()))
    return [" ".join(sorted(c)) for c in nx.strongly_connected_components(graph) if len(c) > 1]


@cache
def layers() -> dict[str, int]:
    """The layer of each package, as pyproject.toml lists them, counted from above."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    (rows,) = [contract["layers"] for contract in contracts if contract["id"] == "layers"]
    return {name.strip(" ()"): k for k, row in enumerate(rows) for name in re.split("[:|]", row)}


def package(module: str) -> str:
    """The package of gearlib that a module belongs to, or the module itself if it is in none.

    >>> package("gearlib.run.methods.run"), package("gearlib.errors")
    ('gearlib.run', 'gearlib.errors')
    """
    return ".".join(module.split(".")[:2])


def climbs(pairs: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Those of some pairs of packages in which the second one's layer is above that of the first."""
    return ((a, b) for a, b in pairs if a in layers() and b in layers() and layers()[b] < layers()[a])


def upward_imports() -> list[str]:
    """Imports of a module from a layer above its own."""
    return [f"{a} imports {b}" for a, b in sorted(imports()) if [*climbs([(package(a), package(b))])]]


def private_reads() -> list[str]:
    """Names that begin with an underscore and are read outside the module that defines them."""
    found = []
    for module, tree in sources().items():
        own = {n.name for n in nodes(tree) if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
        own |= {n.attr for n in nodes(tree) if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
        own |= {n.target.id for n in nodes(tree) if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
        own |= {"_fields", "_fields_", "_replace", "_asdict"}  # of named tuples and ctypes
        for node in nodes(tree):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
                if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")) and node.attr not in own:
                    found.append(f"{module}:{node.lineno} .{node.attr}")
            if isinstance(node, ast.ImportFrom):
                private = [a.name for a in node.names if a.name.startswith("_") and not a.name.startswith("__")]
                found += [f"{module}:{node.lineno} {name}" for name in private]
    return found


def _called(node: ast.AST | None) -> str:
    """The last name of what is called: ``cache`` of ``functools.cache(...)`` and of ``cache``."""
    target = node.func if isinstance(node, ast.Call) else node
    return str(getattr(target, "id", getattr(target, "attr", "")))


def module_caches() -> list[str]:
    """Memoised functions and dictionaries of modules, which outlive every system."""
    found = []
    for module, tree in sources().items():
        top = [*tree.body, *(n for c in tree.body if isinstance(c, ast.ClassDef) for n in c.body)]
        functions = [node for node in top if isinstance(node, ast.FunctionDef)]
        found += [f"{module}.{f.name}" for f in functions if any(_called(d) in CACHES for d in f.decorator_list)]
        for node in tree.body:
            if isinstance(node, (ast.Assign, ast.AnnAssign)):
                value = node.value
                if (isinstance(value, ast.Dict) and not value.keys) or _called(value) in CACHES | {"OrderedDict"}:
                    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                    found.append(f"{module}.{ast.unparse(target)}")
    return found


def class_names_with_two_meanings() -> list[str]:
    """Names of classes that several modules define."""
    count = Counter(n.name for tree in sources().values() for n in tree.body if isinstance(n, ast.ClassDef))
    return sorted(name for name, k in count.items() if k > 1)


def file_names_in_several_folders() -> list[str]:
    """Names of files that stand in several folders of gearlib."""
    count = Counter(p.name for p in (ROOT / "gearlib").rglob("*.py") if p.name != "__init__.py")
    return sorted(name for name, k in count.items() if k > 1)


def largest_folder() -> list[str]:
    """Files of the fullest folder of the two packages."""
    folders: dict[Path, list[str]] = {}
    for top in ("gearlib", "library"):
        for path in sorted((ROOT / top).rglob("*.py")):
            if path.name != "__init__.py":
                folders.setdefault(path.parent, []).append(str(path.relative_to(ROOT)))
    return max(folders.values(), key=len)


AROUND = ("gearlib.drawing", "gearlib.files", "gearlib.fmi", "gearlib.command_line")
"""Packages around the engine, which may grow with what they offer."""


def lines() -> tuple[int, int]:
    """Lines of the engine, and those of them that hold code: neither blank, nor a comment, nor part of a docstring."""
    total = code = 0
    for module, tree in sources().items():
        if module.startswith(AROUND):
            continue
        text = files()[module].read_text(encoding="utf-8").splitlines()
        total += len(text)
        with_code = {k for k, line in enumerate(text, 1) if line.strip() and not line.lstrip().startswith("#")}
        for node in nodes(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False):
                first = node.body[0]
                with_code -= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
        code += len(with_code)
    return total, code


def existing(names: tuple[str, ...]) -> list[str]:
    """Those dotted names that exist."""

    def exists(name: str) -> bool:
        module = max((m for m in sources() if name.startswith(m + ".")), key=len)
        found: Any = importlib.import_module(module)
        for part in name.removeprefix(module + ".").split("."):
            found = getattr(found, part, None)
        return found is not None

    return [name for name in names if exists(name)]


# ---------------------------------------------------------------- a run


def profiled(action: Callable[[], object], watch: Callable[[FrameType, str, Any], None]) -> None:
    """Run an action under a profiling function."""
    before = sys.getprofile()
    sys.setprofile(watch)
    try:
        action()
    finally:
        sys.setprofile(before)


def record_types(action: Callable[[], object]) -> list[str]:
    """Classes of gearlib of which an action makes instances."""
    made: set[str] = set()

    def watch(frame: FrameType, event: str, _: Any) -> None:
        new = frame.f_code.co_name == "<lambda>" and frame.f_code.co_varnames[:1] == ("_cls",)  # of a named tuple
        if event == "call" and (new or frame.f_code.co_name == "__init__"):
            subject = frame.f_locals.get("self", frame.f_locals.get("_cls"))
            kind = subject if isinstance(subject, type) else type(subject)
            if kind.__module__.startswith("gearlib."):
                made.add(f"{kind.__module__}.{kind.__qualname__}")

    profiled(action, watch)
    return sorted(made)


Call = tuple[str, str, str, str]
"""Package and name of a function, package and name of one that it calls."""


def calls_with(kind: type, action: Callable[[], object]) -> list[Call]:
    """The different calls from gearlib to gearlib in which an argument is an instance of a class, in the order of their first time."""
    found: dict[Call, None] = {}

    def watch(frame: FrameType, event: str, _: Any) -> None:
        code, caller = frame.f_code, frame.f_back
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if event != "call" or code.co_name.startswith("<") or not any(isinstance(frame.f_locals.get(n), kind) for n in names):
            return
        while caller is not None and caller.f_code.co_name.startswith("<"):  # a comprehension belongs to its function
            caller = caller.f_back
        if caller is not None:
            ends = (caller.f_globals["__name__"], caller.f_code), (frame.f_globals["__name__"], code)
            if all(module.startswith("gearlib.") for module, _ in ends):
                (a, one), (b, other) = ((package(module), c.co_name) for module, c in ends)
                found.setdefault((a, one, b, other))

    profiled(action, watch)
    return list(found)


def way_of(calls: Iterable[Call]) -> dict[str, list[str]]:
    """Calls sorted by where they lead: on within a package, up to a higher layer, or into a package that was entered before."""
    rows: dict[str, list[str]] = {row: [] for row in WAY}
    within, upwards, again = rows.values()
    entered: set[str] = set()
    for a, one, b, other in calls:
        text = f"{a}: {one} -> {b}: {other}"
        if a == b:
            within.append(text)
            continue
        if [*climbs([(a, b)])]:
            upwards.append(text)
        if b in entered:
            again.append(text)
        entered.add(b)
    return rows


WAY = (
    "calls with the component: within a package",
    "calls with the component: to a higher layer",
    "calls with the component: into a package entered before",
)


def small_model() -> Any:
    import gearlib as gl
    import gearparts as gp

    class Drive(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
            self.shaft, self.wheel = gp.SpringDamper(c=1e4, d=1.0), gp.Inertia(J=1.0)
            pairs = [(self.torque.flange, self.load.flange_a), (self.load.flange_b, self.shaft.flange_a)]
            return [gl.connect(a, b) for a, b in [*pairs, (self.shaft.flange_b, self.wheel.flange_a)]]

    return Drive()


def small_linear_scene() -> None:
    import gearlib as gl

    gl.compile(small_model(), outputs=["load.w"]).simulate(1.0)["load.w"]


def way_of_the_component() -> dict[str, list[str]]:
    """Where the calls of `compile` lead that pass on the component or a part of it."""
    import gearlib as gl

    model = small_model()
    return way_of(calls_with(gl.Component, lambda: gl.compile(model, outputs=["load.w"])))


def in_new_process(what: str) -> Any:
    """Counts of a process with a cache of its own: nothing is found ready."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, what]
        places = os.pathsep.join([str(ROOT), str(ROOT / "library")])
        environment = {**os.environ, "GEARLIB_CACHE": folder, "PYTHONPATH": places}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


# ---------------------------------------------------------------- the table


@cache
def findings() -> Mapping[str, list[str]]:
    """What is counted in each row."""
    return {
        "record types between compile and result": in_new_process("--records"),
        "forms of one equation": existing(FORMS),
        **{f"implementations: {concept}": existing(names) for concept, names in IMPLEMENTATIONS.items()},
        **in_new_process("--way"),
        "import circles": import_circles(),
        "upward imports": upward_imports(),
        "private names read from other modules": private_reads(),
        "module-level caches": module_caches(),
        "class names with two meanings": class_names_with_two_meanings(),
        "file names in several folders": file_names_in_several_folders(),
        "files in the largest folder": largest_folder(),
    }


def counts() -> dict[str, int]:
    """The rows with their counts."""
    total, code = lines()
    return {**{row: len(found) for row, found in findings().items()}, "lines": total, "lines of code": code}


def limits() -> dict[str, int]:
    found: dict[str, int] = json.loads(LIMITS.read_text(encoding="utf-8"))
    return found


# ---------------------------------------------------------------- the page

PAGE = ROOT / "docs" / "phases.md"
BEGIN, END = "<!-- counted: begin -->", "<!-- counted: end -->"

ROWS: Mapping[str, tuple[str, str, str]] = {
    "record types between compile and result": (
        "66", "22",
        "eight are made while modules are loaded (the declarations of classes, and C prototypes), five are public (`Eq`, `Connection`, "
        "`Port`, `System`, the result), eight belong to the exact solution alone (the linear form, what generates its inputs, the chosen "
        "algorithm and its steps), three exist only while another is built (`Tree`, `Builder`, the rows of a derivative plan); the others "
        "are results of phases, read by later ones",
    ),
    "forms of one equation": ("12", "8", "the compiler's own intermediate text and object code"),
    "implementations: differentiating a program": ("5", "1", ""),
    "implementations: event iteration": ("4", "1, in two backends", ""),
    "implementations: sparse elimination": ("3", "1", ""),
    "implementations: integration driver": ("4", "1", ""),
    "implementations: Newton's method": ("8", "1, in two backends", ""),
    "implementations: compiler": ("1", "1", ""),
    WAY[0]: ("34", "20", "a class has more to be checked than then: units, unused values, sampled controllers"),
    WAY[1]: ("0", "0", ""),
    WAY[2]: ("7", "few", "flattening asks `gearlib.language` for the parts, connections and values of each component in turn"),
    "import circles": ("5", "0", ""),
    "upward imports": ("0", "0", ""),
    "private names read from other modules": ("141", "0", ""),
    "module-level caches": ("47", "12", "symbols, units, templates of classes and loaded libraries, which no single system owns"),
    "class names with two meanings": ("11", "0", ""),
    "file names in several folders": ("1", "0", ""),
    "files in the largest folder": ("18", "12", "the drawings, and the reader and writer of Modelica, which are not on this page's way"),
    "lines": (
        "30567", "19500",
        "features came faster than lines went: a feature's lines are admitted when it comes, and from then on may only fall",
    ),
    "lines of code": ("20763", "12000", "as above"),
}  # fmt: skip
"""First count (commit b4e6e2a), aim, and what keeps the count above it."""
EXTENSIONS = {"An integration method": "5", "An event": "6", "A stiffness law": "2"}
"""Sections of docs/extending.md, with the files to touch before there was that page."""


def rounded(row: str, count: int) -> str:
    """A count as the page shows it: lines in thousands."""
    return f"{round(count, -3)}" if row.startswith("lines") else str(count)


def files_to_touch(section: str) -> int:
    """How many files docs/extending.md names for an extension; the tests carry out these alone."""
    text = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8").split(f"## {section}\n")[1].split("\n## ")[0]
    return len(set(re.findall(r"examples/\w+\.py", text)))


def first_process(method: str) -> str:
    """Seconds of the XP train in the first process on a new machine, as docs/scale.md has them."""
    text = (ROOT / "docs" / "scale.md").read_text(encoding="utf-8")
    (seconds,) = re.findall(rf"^\| {method} \| ([\d.]+) \|", text, re.MULTILINE)
    return str(seconds)


def table() -> str:
    """The table of the page: what was counted first, the limits now, and the aims."""
    lines = [BEGIN, "", "| what | first | now | aim | why more |", "|---|---:|---:|---:|---|"]
    for row, count in limits().items():
        first, aim, why = ROWS[row]
        far = count > int(aim) if aim.isdigit() else aim == "few"
        lines.append(f"| {row} | {rounded(row, int(first))} | {rounded(row, count)} | {aim} | {why if far else ''} |")
    for method in ("rk", "ida"):
        title, seconds = f"first process on a new machine, `{method}`, s ([measured](scale.md))", first_process(method)
        why = "LLVM compiles the loops of the integrators, once per machine" if float(seconds) > 2 else ""
        lines.append(f"| {title} | 7 to 14 | {seconds} | 2 | {why} |")
    for section, first in EXTENSIONS.items():
        article, _, what = section.partition(" ")
        title = f"files to touch to add {article.lower()} {what} ([shown](extending.md))"
        lines.append(f"| {title} | {first} | {files_to_touch(section)} | 1 | |")
    return "\n".join([*lines, "", END])


def write_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(text.split(BEGIN)[0] + table() + text.split(END)[1], encoding="utf-8")


if __name__ == "__main__":
    if {"--records", "--way"} & {*sys.argv}:
        print(json.dumps(record_types(small_linear_scene) if "--records" in sys.argv else way_of_the_component()))
        sys.exit()
    sys.path[:0] = [str(ROOT), str(ROOT / "library")]
    now, before = counts(), limits() if LIMITS.exists() else {}
    if "-v" in sys.argv:
        for row, found in findings().items():
            print(row, *found, sep="\n  ", end="\n\n")
    for row, count in now.items():
        print(f"{row:45} {count:6d}   at most {before.get(row, count):6d}")
    if "--lower" in sys.argv:
        LIMITS.write_text(json.dumps({r: min(n, before.get(r, n)) for r, n in now.items()}, indent=1) + "\n", encoding="utf-8")
    if {"--lower", "--page"} & {*sys.argv}:
        write_page()
