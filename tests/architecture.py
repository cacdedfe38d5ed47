"""Counts that say how much there is to learn about the engine: ``python tests/architecture.py`` prints them beside their limits.

``-v`` lists what is counted, ``--lower`` writes smaller counts into ``architecture.json`` as the new limits. The limits may only fall.
"""

from __future__ import annotations

import ast
import importlib
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
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
    "gearlib.reduce.rows.Rows",
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


@cache
def texts() -> dict[str, str]:
    """Text of each module of gearlib, by dotted name."""
    paths = sorted((ROOT / "gearlib").rglob("*.py"))
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths]
    return {name: path.read_text(encoding="utf-8") for name, path in zip(names, paths)}


@cache
def sources() -> dict[str, ast.Module]:
    """Syntax tree of each module of gearlib, by dotted name."""
    return {name: ast.parse(text) for name, text in texts().items()}


@cache
def nodes(tree: ast.Module) -> list[ast.AST]:
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


def upward_imports() -> list[str]:
    """Imports of a module from a layer above its own, as pyproject.toml lists the layers."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    (rows,) = [contract["layers"] for contract in contracts if contract["id"] == "layers"]
    depth = {name.strip(" ()"): k for k, row in enumerate(rows) for name in re.split("[:|]", row)}

    def layer(module: str) -> int | None:
        return depth.get(".".join(module.split(".")[:2]))

    pairs = [(a, b, layer(a), layer(b)) for a, b in sorted(imports())]
    return [f"{a} imports {b}" for a, b, above, below in pairs if above is not None and below is not None and below < above]


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
        text = texts()[module].splitlines()
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


def record_types(action: Callable[[], object]) -> list[str]:
    """Classes of gearlib of which an action makes instances."""
    made: set[str] = set()

    def watch(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_name in ("__init__", "__new__"):
            subject = frame.f_locals.get("self", frame.f_locals.get("_cls"))
            kind = subject if isinstance(subject, type) else type(subject)
            if kind.__module__.startswith("gearlib."):
                made.add(f"{kind.__module__}.{kind.__qualname__}")

    before = sys.getprofile()
    sys.setprofile(watch)
    try:
        action()
    finally:
        sys.setprofile(before)
    return sorted(made)


def small_linear_scene() -> None:
    import gearlib as gl
    import gearparts as gp

    class Drive(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
            self.shaft, self.wheel = gp.SpringDamper(c=1e4, d=1.0), gp.Inertia(J=1.0)
            pairs = [(self.torque.flange, self.load.flange_a), (self.load.flange_b, self.shaft.flange_a)]
            return [gl.connect(a, b) for a, b in [*pairs, (self.shaft.flange_b, self.wheel.flange_a)]]

    gl.compile(Drive(), outputs=["load.w"]).simulate(1.0)["load.w"]


def records_of_a_run() -> list[str]:
    """Those of a small linear scene from `compile` to a result, in a process and with a cache of their own: nothing is found ready."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--records"]
        places = os.pathsep.join([str(ROOT), str(ROOT / "library")])
        environment = {**os.environ, "GEARLIB_CACHE": folder, "PYTHONPATH": places}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


# ---------------------------------------------------------------- the table


@cache
def findings() -> Mapping[str, list[str]]:
    """What is counted in each row."""
    return {
        "record types between compile and result": records_of_a_run(),
        "forms of one equation": existing(FORMS),
        **{f"implementations: {concept}": existing(names) for concept, names in IMPLEMENTATIONS.items()},
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


if __name__ == "__main__":
    if "--records" in sys.argv:
        print(*record_types(small_linear_scene), sep="\n")
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
