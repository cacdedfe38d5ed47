"""Would a test notice? ``make mutate`` changes gearlib in one place at a time and runs the tests that should notice it.

Cosmic-ray makes the changes; this file draws a repeatable sample of them, finds each one's tests, runs them in a copy of the project
and says how they noticed. The first run, and every one with ``--measure``, runs all quick tests under coverage, which tells which test
runs which line. Most mutants are noticed at once: one process collects the tests of all, and in a fork of it for each mutant the changed
code takes the place of the function's, and the tests of its line are run, the quickest first. What that does not notice (also what runs
on import, is compiled, or is read by other processes) is tried in full, by a file in a copy of the project: with the files that mirror
its module and the module's doctests, then those that run its line, in the likeliest files. The first assertion that fails ends a
mutant's run. An exception or a hang does not: the tests behind it are still
run, and after an exception the quick ones of the campaigns, whose claim is that nothing ends in a foreign exception. A mutant survives
when its share of processor time is used up and no test of the likeliest files (with ``--wide``: of all that run its line) has failed.

=============  =======================================================================================
``assertion``  a claim of a test did not hold, see below
``exception``  no claim, but a test met an exception that it did not expect
``no value``   as before, and so did every test that ran the line: there is no value that a claim could judge
``crash``      nothing but a module that cannot be imported, a hang, or the end of the process
``survived``   no test failed
``accepted``   no claim failed, and ``tests/mutants.toml`` says why none need (equivalent, only slower)
=============  =======================================================================================

A claim of a test fails where its ``assert`` does, where what it expects to be raised is not, be it that nothing or something else is
(``with pytest.raises(...)``), where a doctest prints something else, and where gearlib refuses (a `GearlibError`) or warns: the test
says that there is an answer, and the library checked that there is none. A mutant may also break the code so that it gives no value at
all (an index, a type, a shape): then the test that ran the line fails by that exception, which says nothing of how well the values are
watched. So the two are counted apart, and the bar of 97 % is one of assertions; beside it stands the share of those that give values at
all. A crash is credited to no test.

Options follow ``ARGS=`` of make: ``-n 300``, ``--seed 7``, ``--all`` for one mutant at each place, ``--folder gearlib/structure
gearlib/reduce``, ``--again LOG`` for those of a log that no assertion noticed, ``--goes-on`` for a sample that was interrupted: what
its log holds is not tried again, ``--quick`` for the first way only.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import doctest
import gc
import importlib
import inspect
import itertools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
ACCEPTED = Path(__file__).with_name("mutants.toml")
COPIED = (
    "gearlib",
    "library",
    "tests",
    "examples",
    "docs",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE",
)
SWAPS = {"Add": "Sub", "Sub": "Add", "Mul": "Div", "Div": "Mul", "Pow": "Mul", "FloorDiv": "Mul", "BitAnd": "BitOr"}
COMPARED = (
    "Eq_NotEq",
    "NotEq_Eq",
    "Lt_LtE",
    "LtE_Lt",
    "Gt_GtE",
    "GtE_Gt",
    "Lt_GtE",
    "LtE_Gt",
    "Gt_LtE",
    "GtE_Lt",
    "Is_IsNot",
    "IsNot_Is",
)
OTHERS = (
    "ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not", "AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue",
    "ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "NumberReplacer",
    "ZeroIterationForLoop",
)  # fmt: skip
WITHOUT_EFFECT = {"frozen", "eq", "strict", "stacklevel", "maxsize"}  # guards, and sizes of what is remembered
WITHOUT_EFFECT |= {"lw", "ms", "mew", "fontsize", "figsize", "markersize", "zorder", "xytext"}  # sizes of what is drawn
OPERATORS = (
    *(f"ReplaceBinaryOperator_{old}_{new}" for old, new in SWAPS.items()),
    *(f"ReplaceComparisonOperator_{pair}" for pair in COMPARED),
    *OTHERS,
)


COVERED = ROOT / ".cache" / "covered"  # which test runs which line, and the modules of that time
UNFIT = ("tests/benchmarks", "tests/stress", "tests/test_project.py", "tests/test_architecture.py", "tests/test_scale.py")
FEW = 6  # files of tests that are imported at once

NOTHING_RAW = [f"tests/stress/test_{name}.py" for name in ("right_calls", "campaign", "misuse")]  # claim: no foreign exceptions


@dataclass(frozen=True)
class Mutant:
    """One change of one module, and what became of it."""

    module: str
    operator: str
    occurrence: int
    line: int
    old: str
    new: str
    verdict: str = ""
    noticed_by: str = ""
    seconds: float = 0.0

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is known by after its module has moved or grown."""
        return Path(self.module).name, self.old, self.new

    @property
    def change(self) -> tuple[str, str, int]:
        """What it is known by within one version of the project."""
        return self.module, self.operator, self.occurrence


# ---------------------------------------------------------------- mutants


def modules() -> list[str]:
    """All modules, by path from the project's root."""
    found = [*(ROOT / "gearlib").rglob("*.py"), *(ROOT / "library").rglob("*.py")]
    return sorted(str(path.relative_to(ROOT)) for path in found if path.name != "__init__.py")


@cache
def source(module: str) -> str:
    return (ROOT / module).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Piece:
    """A statement of a module or of a class in it, which is parsed alone; what stands around it makes it a program."""

    text: str
    before: str = ""
    after: str = ""

    @property
    def program(self) -> str:
        return self.before + self.text + self.after


@cache
def pieces(module: str) -> list[Piece]:
    """The statements of a module; of a class its head, then its own statements."""
    from cosmic_ray.ast import get_ast

    found: list[Piece] = []
    for node in get_ast(source(module)).children:
        defined = node.children[-1] if node.type == "decorated" else node
        suite = defined.children[-1] if defined.type == "classdef" else None
        if suite is None or suite.type != "suite":
            found.append(Piece(node.get_code()))
            continue
        body = "".join(inner.get_code() for inner in suite.children[1:])
        head = node.get_code().removesuffix(body)
        assert node.get_code() == head + body
        found.append(Piece(head, after="    pass\n"))
        found += [Piece(inner.get_code(), before="class _:\n") for inner in suite.children[1:]]
    return found


@cache
def changes(module: str) -> list[list[tuple[str, int, int, int]]]:
    """Each place of a module that can be changed: operator, occurrence in the module, piece, occurrence in that."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    operators = {name: get_operator(f"core/{name}")() for name in OPERATORS}
    before: Counter[str] = Counter()
    found: list[list[tuple[str, int, int, int]]] = []
    for k, piece in enumerate(pieces(module)):
        count: Counter[str] = Counter()
        at: dict[Any, list[tuple[str, int, int, int]]] = {}
        for node in ast_nodes(get_ast(piece.program)):
            for name, operator in operators.items():
                for start, _ in operator.mutation_positions(node):
                    if name != "ReplaceBinaryOperator_Mul_Div" or node.parent.type == "term":  # not the star of an argument
                        at.setdefault(start, []).append((name, before[name] + count[name], k, count[name]))
                    count[name] += 1
        before += count
        found += at.values()
    return found


def places(module: str) -> list[list[tuple[str, int]]]:
    """Pairs (operator, occurrence) of each place of a module that can be changed."""
    return [[(name, occurrence) for name, occurrence, _, _ in at] for at in changes(module)]


@cache
def where(module: str) -> dict[tuple[str, int], tuple[int, int]]:
    """The piece, and the occurrence in it, of each change (operator, occurrence)."""
    return {(name, occurrence): (k, inner) for at in changes(module) for name, occurrence, k, inner in at}


@cache
def mutated_piece(module: str, operator: str, occurrence: int) -> tuple[int, Piece]:
    """A changed piece of a module, and which it is."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    k, inner = where(module)[operator, occurrence]
    piece = pieces(module)[k]
    text = str(mutate_code(piece.program, get_operator(f"core/{operator}")(), inner))
    return k, replace(piece, text=text.removeprefix(piece.before).removesuffix(piece.after))


def mutated(module: str, operator: str, occurrence: int) -> str:
    k, changed = mutated_piece(module, operator, occurrence)
    return "".join(piece.text for piece in [*pieces(module)[:k], changed, *pieces(module)[k + 1 :]])


@cache
def meaning(text: str) -> str:
    """A program without what has no effect when all is right: annotations and some switches."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            node.test = ast.Constant(None)
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in WITHOUT_EFFECT]
    return ast.dump(tree)


def mutant(module: str, operator: str, occurrence: int) -> Mutant | None:
    """The mutant, if it means anything else than the module."""
    k, changed = mutated_piece(module, operator, occurrence)
    try:
        if meaning(pieces(module)[k].program) == meaning(changed.program):
            return None
    except SyntaxError:  # a star that is no operator
        return None
    before, after = source(module), mutated(module, operator, occurrence)
    for number, (old, new) in enumerate(zip(before.splitlines(), after.splitlines(), strict=True), 1):
        if old != new:
            return Mutant(module, operator, occurrence, number, old.strip(), new.strip())
    return None


def sample(n: int, seed: int, under: tuple[str, ...]) -> Iterator[Mutant]:
    """Mutants at places of modules drawn by their length; one that runs models counts a quarter of a pure one."""
    draw = random.Random(seed)
    candidates = [module for module in modules() if module.startswith(under)]
    weights = [
        len(source(module)) * (0.25 if re.search("^gearlib/(run|solvers)/|^gearlib/[^/]*$", module) else 1)
        for module in candidates
    ]
    seen: set[tuple[str, int]] = set()
    for _ in range(50 * n):
        (module,) = draw.choices(candidates, weights)
        if not places(module):  # declarations only
            continue
        place = draw.randrange(len(places(module)))
        made = mutant(module, *draw.choice(places(module)[place])) if (module, place) not in seen else None
        if made is not None:
            seen.add((module, place))
            yield made
        if len(seen) == n:
            return


def every(seed: int, under: tuple[str, ...], known: set[tuple[str, str, int]]) -> Iterator[Mutant]:
    """One mutant at each place of some modules that is not known; the seed chooses which."""
    draw = random.Random(seed)
    for module in filter(lambda name: name.startswith(under), modules()):
        chosen = [draw.choice(place) for place in places(module)]
        yield from filter(None, (mutant(module, *change) for change in chosen if (module, *change) not in known))


def logged(log: Path) -> list[Mutant]:
    """The mutants of a log with their verdicts; none where there is no log."""
    lines = map(json.loads, log.read_text().splitlines()) if log.exists() else ()
    return [Mutant(**{name: value for name, value in one.items() if name != "key"}) for one in lines]


def unnoticed(log: Path) -> Iterator[Mutant]:
    """Those of a log that no assertion noticed, wherever their lines are now."""
    for one in {one.key: one for one in logged(log) if one.verdict != "assertion"}.values():
        alike = [m for m in modules() if Path(m).name == one.key[0]]
        moved = ((m, *change) for m in alike for place in places(m) for change in place if change[0] == one.operator)
        there = [one.change] if one.module in alike and (one.operator, one.occurrence) in where(one.module) else []
        made = (mutant(*change) for change in (*there, *moved))
        yield from itertools.islice((found for found in made if found is not None and found.key == one.key), 1)


# ---------------------------------------------------------------- tests


def measure() -> None:
    """Run the quick tests once, two folders at a time, and keep which of them runs which line, with the modules as they are now."""
    from coverage import CoverageData

    shutil.rmtree(COVERED, ignore_errors=True)
    COVERED.mkdir(parents=True)
    settings = COVERED / "coveragerc"
    settings.write_text("[run]\nsource = gearlib, library/gearparts\nrelative_files = True\n")
    options = ["-q", "--tb=no", "-p", "no:xdist", *(f"--ignore={path}" for path in UNFIT)]
    options += ["--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report="]

    def part(folder: str) -> CoverageData:
        kept = COVERED / ("of-" + re.sub(r"\W", "_", folder))
        command = [sys.executable, "-m", "pytest", *options, "-o", f"cache_dir={kept}-cache", *map(str, ROOT.glob(folder))]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"COVERAGE_FILE": str(kept)}, stdout=subprocess.DEVNULL, check=False)
        found = CoverageData(str(kept))
        found.read()
        return found

    folders = [str(path.relative_to(ROOT)) for path in sorted((ROOT / "tests").iterdir()) if any(path.glob("**/test_*.py"))]
    folders = [folder for folder in folders if not folder.startswith(UNFIT)]
    whole = CoverageData(str(COVERED / "lines"))
    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(part, [*folders, "tests/test_*.py", "gearlib", "library"]):
            whole.update(found)
    for package in ("gearlib", "library"):
        shutil.copytree(ROOT / package, COVERED / package, ignore=shutil.ignore_patterns("__pycache__"))


@cache
def exists(file: str) -> bool:
    return (ROOT / file).exists()


@cache
def lines_run(module: str) -> dict[int, set[str]]:
    """The tests that run each line of a module, by the lines and files as they are now; what has changed since is left out."""
    from coverage import CoverageData

    data = CoverageData(str(COVERED / "lines"))
    data.read()
    tests = {
        number: {name.rpartition("|")[0] for name in names if name and exists(name.partition("::")[0])}
        for number, names in data.contexts_by_lineno(module).items()
    }
    before = (COVERED / module).read_text(encoding="utf-8").splitlines() if (COVERED / module).exists() else []
    same = difflib.SequenceMatcher(None, before, source(module).splitlines(), autojunk=False).get_matching_blocks()
    return {new + k + 1: tests.get(old + k + 1, set()) for old, new, size in same for k in range(size)}


@cache
def parsed(module: str) -> ast.Module:
    return ast.parse(source(module))


@cache
def statements(module: str) -> list[ast.stmt]:
    return [node for node in ast.walk(parsed(module)) if isinstance(node, ast.stmt)]


def around(module: str, line: int) -> list[ast.stmt]:
    """The simple statement on a line, and the functions and classes around it, the innermost first."""
    kinds = ast.FunctionDef | ast.ClassDef
    found = [node for node in statements(module) if node.lineno <= line <= (node.end_lineno or 0)]
    return sorted(
        (node for node in found if isinstance(node, kinds) or not hasattr(node, "body")), key=lambda node: -node.lineno
    )


def is_compiled(module: str, line: int) -> bool:
    """Whether a line is machine code's, which is made of the text of the file."""
    return any(
        "native" in map(ast.unparse, node.decorator_list) for node in around(module, line) if isinstance(node, ast.FunctionDef)
    )


@cache
def inside(node: ast.AST) -> set[int]:
    """The lines of the functions in a syntax tree, which run when they are called."""
    functions = [inner for inner in ast.walk(node) if isinstance(inner, ast.FunctionDef)]
    return {number for f in functions for number in range(f.body[0].lineno, (f.end_lineno or 0) + 1)}


def covering(module: str, line: int) -> set[str]:
    """The tests that run a line; of one that runs on import or has changed since, those that run a function around it."""
    nodes = [*around(module, line), parsed(module)]
    spans = [inside(n) if hasattr(n, "body") else set(range(n.lineno, (n.end_lineno or 0) + 1)) for n in nodes]
    for lines in ({line}, *spans):
        tests: set[str] = set().union(*(lines_run(module).get(number, ()) for number in lines & spans[-1]))
        if tests:
            return tests
    return set()


@cache
def test_files() -> list[Path]:
    return sorted((ROOT / "tests").rglob("test_*.py"))


@cache
def mirrors(module: str) -> list[str]:
    """The test files of a module's name, those in its own folder first, and the module for its doctests."""
    stem, folder = Path(module).stem, Path(module).parent.name
    paths = [path for path in test_files() if re.fullmatch(rf"test_{stem}(_\w+)?", path.stem)]
    paths = sorted(paths, key=lambda path: (path.parent.name != folder, len(str(path))))
    return [*(str(path.relative_to(ROOT)) for path in paths if not str(path.relative_to(ROOT)).startswith(UNFIT)), module]


def rounds(one: Mutant) -> list[list[str]]:
    """What to run, that which should notice first: the files that mirror the module; the tests that run the line, in few files; in all."""
    first = mirrors(one.module)
    files: dict[str, list[str]] = {}
    for test in covering(one.module, one.line):
        if not test.startswith((*UNFIT, *first)):
            files.setdefault(test.partition("::")[0], []).append(test)
    folder = Path(one.module).parent.name
    if not files or is_compiled(one.module, one.line):  # what is compiled runs unseen
        own = [str(path.relative_to(ROOT)) for path in test_files() if path.parent.name == folder]
        files |= {file: [file] for file in own if not file.startswith((*UNFIT, *first))}
    declares = one.line not in inside(parsed(one.module))

    def rank(file: str) -> tuple[bool, bool, int, str]:
        return not (declares and "declared" in file), Path(file).parent.name != folder, -len(files[file]), file

    ranked = sorted(files, key=rank)
    return [first, *([test for file in some for test in files[file]] for some in (ranked[:FEW], ranked[FEW:]))]


# ---------------------------------------------------------------- runs


def is_claim(failure: BaseException) -> bool:
    """Whether a failure says that a claim of the test does not hold; gearlib is the copy's, so its errors are known by name."""
    if isinstance(failure, doctest.UnexpectedException):
        failure = failure.exc_info[1]
    said = (AssertionError, pytest.fail.Exception, doctest.DocTestFailure, Warning)
    refused = any(kind.__name__ == "GearlibError" for kind in type(failure).__mro__)
    return refused or isinstance(failure, said) or was_expected_otherwise(failure)


def was_expected_otherwise(failure: BaseException) -> bool:
    """Whether an exception came out of a block of a test that says which exception it raises."""
    frames = traceback.extract_tb(failure.__traceback__)
    return any(Path(f.filename).name.startswith("test_") and f.lineno in raising_lines(f.filename) for f in frames)


@cache
def raising_lines(file: str) -> set[int]:
    """The lines of the blocks under ``with pytest.raises(...)`` in a file."""
    blocks = (node for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8"))) if isinstance(node, ast.With))
    says = (node for node in blocks if any(ast.unparse(item).startswith("pytest.raises(") for item in node.items))
    return {number for node in says for number in range(node.body[0].lineno, (node.end_lineno or 0) + 1)}


def limit_processor_time(seconds: int) -> None:
    import resource  # not on every system

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))


FOUND = {"assertions": "assertion", "exceptions": "exception", "crashes": "crash"}  # what notices, and the verdict
SAID = (*FOUND, "passed")  # the names of the tests, by what became of them


class Notice:
    """A pytest plugin that runs likely and quick tests first, and stops at the first assertion that fails or when the time is up."""

    def __init__(self, targets: list[str], budget: float, likely: tuple[str, str], took: dict[str, float], file: Path) -> None:
        self.targets, self.budget, self.took, self.file = {*targets}, budget, took, file
        self.folder, self.likely = likely
        self.assertions: list[str] = []
        self.exceptions: list[str] = []
        self.crashes: list[str] = []
        self.passed: list[str] = []

    def write(self, running: str = "") -> None:
        """Say what is known so far, and which test is running, should the process end in it."""
        written = self.file.with_suffix(".part")
        written.write_text(json.dumps({kind: getattr(self, kind) for kind in SAID} | {"running": running}))
        written.replace(self.file)  # whole, or not there

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        files = {target for target in self.targets if "::" not in target}
        items[:] = [item for item in items if item.nodeid in self.targets or item.nodeid.partition("::")[0] in files]

        items.sort(key=self.order)

    def order(self, item: pytest.Item) -> tuple[bool, bool, float]:
        """Tests of the module's folder, then the others, of each those first that name the function; the quickest first."""
        function = getattr(item, "function", None)
        unlike = not (function and self.likely) or self.likely not in words(function)
        return Path(item.nodeid.partition("::")[0]).parent.name != self.folder, unlike, self.took.get(item.nodeid, 0.2)

    def pytest_exception_interact(self, node: pytest.Item | pytest.Collector, call: Any) -> None:
        failures = getattr(call.excinfo.value, "failures", [call.excinfo.value])  # a doctest's failures come together
        if getattr(call, "when", "") != "call":
            self.crashes.append(node.nodeid)
        else:
            (self.assertions if any(map(is_claim, failures)) else self.exceptions).append(node.nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            self.passed.append(report.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        started = time.process_time()
        limit_processor_time(int(started) + 30)  # for a test that hangs
        self.write(item.nodeid)
        done = yield
        self.took.setdefault(item.nodeid, round(time.process_time() - started, 2))
        if self.assertions or time.process_time() > self.budget:
            item.session.shouldstop = "enough is known"
        return done


@cache
def words(function: Callable[..., Any]) -> set[str]:
    """The words in a test's source; names without underscores around them, as those of `definition` are."""
    return {word.strip("_") for word in re.findall(r"\w+", inspect.getsource(function))}


def in_child(
    copy: Path, run: Callable[[Notice, tuple[str, ...]], None], targets: Sequence[str], budget: float,
    likely: tuple[str, str] = ("", ""), without: tuple[str, ...] = (),
) -> dict[str, Any]:  # fmt: skip
    """What the tests say that are run in a fork of this process.

    If the process ends in a test, those behind it are run in another, up to three times.
    """
    import resource  # not on every system

    file, times = copy / "said.json", ROOT / ".cache" / "mutation-times.json"
    file.unlink(missing_ok=True)
    known = json.loads(times.read_text()) if times.exists() else {}
    pid = os.fork()
    if pid == 0:
        with suppress(Exception):
            with open(os.devnull, "w") as nothing:
                os.dup2(nothing.fileno(), 1)
                os.dup2(nothing.fileno(), 2)
            limit_processor_time(int(time.process_time()) + 60)  # until the first test sets its own
            resource.setrlimit(resource.RLIMIT_AS, (8 * 2**30,) * 2)
            os.chdir(copy)
            notice = Notice([*targets], time.process_time() + budget, likely, dict(known), file)
            run(notice, without)
            if len(notice.took) > len(known):
                times.write_text(json.dumps(notice.took))
            notice.write()
        os._exit(0)
    started = time.monotonic()
    while os.waitpid(pid, os.WNOHANG) == (0, 0):
        time.sleep(0.02)
        if time.monotonic() - started > 60 * budget:  # a wait that needs no processor, on a machine that is shared
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            break
    said = dict(json.loads(file.read_text())) if file.exists() else {**{kind: [] for kind in SAID}, "running": "the process"}
    ended = said.pop("running")
    if ended:
        said["crashes"].append(ended)
    if "::" in ended and not said["assertions"] and len(without) < 3:
        more = in_child(copy, run, targets, budget, likely, (*without, ended))
        return {kind: said[kind] + more[kind] for kind in SAID}
    return said


def afresh(copy: Path, notice: Notice, without: tuple[str, ...]) -> None:
    """Run tests of a copy of the project in this process, which has imported what gearlib needs but not gearlib."""
    sys.path[:0] = [str(copy), str(copy / "library")]
    files = dict.fromkeys(target.partition("::")[0] for target in notice.targets)
    options = ["-q", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-p", "no:xdist", "--tb=no"]
    options += [f"--deselect={test}" for test in without]
    code = pytest.main([*options, "--continue-on-collection-errors", *files], plugins=[notice])
    if code not in (0, 1, 2, 5):  # passed, failed, stopped, no tests
        notice.crashes.append(f"pytest: {code}")


def definition(module: str, line: int) -> tuple[str, str]:
    """The folder of a line, and the innermost function or class around it, as a test would write their names."""
    named = (node.name.strip("_") for node in around(module, line) if isinstance(node, ast.FunctionDef | ast.ClassDef))
    return Path(module).parent.name, next(named, "")


class InPlace:
    """A pytest plugin that collects tests once, and tries each mutant of a function by its tests in a fork with the changed code."""

    def __init__(self, mutants: list[Mutant], copy: Path, budget: float, keep: Callable[[Mutant], None]) -> None:
        self.mutants, self.copy, self.budget, self.keep = mutants, copy, budget, keep

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        for module in {one.module for one in self.mutants}:  # many are imported when they are needed
            importlib.import_module(module.removeprefix("library/").removesuffix(".py").replace("/", "."))
        gc.unfreeze()
        functions: dict[str, list[FunctionType]] = {}
        for found in gc.get_objects():
            if isinstance(found, FunctionType):
                functions.setdefault(found.__code__.co_filename, []).append(found)
        gc.freeze()
        by_name = {item.nodeid: item for item in session.items}
        for item in session.items:  # once, not in each fork
            if function := getattr(item, "function", None):
                words(function)
        for one in self.mutants:
            path = str(self.copy / one.module)
            before, after = codes(source(one.module), path), codes(mutated(*one.change), path)
            changed = {name: code for name, code in after.items() if code != before.get(name)}
            swaps = [(f, changed[named(f.__code__)]) for f in functions.get(path, ()) if named(f.__code__) in changed]
            swaps = [] if is_compiled(one.module, one.line) else swaps
            files = {name for some in rounds(one) for name in some if "::" not in name}
            tests = covering(one.module, one.line) | {name for name in by_name if name.partition("::")[0] in files}
            items = [by_name[name] for name in tests if name in by_name]
            if swaps and items:
                started = time.monotonic()
                said = in_child(self.copy, partial(in_place, swaps, items), [], self.budget, definition(one.module, one.line))
                self.keep(judged(one, said, started))
        return True


def named(code: CodeType) -> tuple[str, int]:
    return code.co_qualname, code.co_firstlineno


@lru_cache(maxsize=2)
def codes(text: str, path: str) -> dict[tuple[str, int], CodeType]:
    """The code of a module and of all functions in it, by name and place."""
    return dict(code_of(compile(text, path, "exec")))


def code_of(whole: CodeType) -> Iterator[tuple[tuple[str, int], CodeType]]:
    yield named(whole), whole
    for inner in whole.co_consts:
        if isinstance(inner, CodeType):
            yield from code_of(inner)


def in_place(
    swaps: list[tuple[FunctionType, CodeType]], items: list[pytest.Item], notice: Notice, without: tuple[str, ...]
) -> None:
    """Run tests that are collected, with other code in some functions."""
    for function, code in swaps:
        function.__code__ = code
    if any(Path(code.co_filename).parent.name in ("compiler", "native") for _, code in swaps):
        os.environ["GEARLIB_CACHE"] = tempfile.mkdtemp(dir=".")  # the machine code of a mutant has the names of the right one
    items = sorted((item for item in items if item.nodeid not in without), key=notice.order)
    if items:
        items[0].config.pluginmanager.register(notice)
    for item, following in itertools.zip_longest(items, items[1:]):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if item.session.shouldstop:
            break


def try_in_place(mutants: list[Mutant], copy: Path, budget: float, keep: Callable[[Mutant], None]) -> None:
    """Keep the verdicts of those that tests can be run for in place; in a process of its own, which imports the project's modules."""
    pid = os.fork()
    if pid == 0:
        with suppress(Exception):
            os.chdir(copy)
            sys.path[:0] = [str(copy), str(copy / "library")]
            files = sorted({test.partition("::")[0] for one in mutants for some in rounds(one) for test in some})
            found = InPlace(mutants, copy, budget, keep)
            options = [
                "-q",
                "-W",
                "ignore::pytest.PytestAssertRewriteWarning",
                "-p",
                "no:xdist",
                "-p",
                "no:faulthandler",
                "--tb=no",
                "-s",
            ]
            pytest.main([*options, "--continue-on-collection-errors", *files], plugins=[found])
        os._exit(0)
    os.waitpid(pid, 0)


def tried(one: Mutant, copy: Path, budget: float, number: int, wide: bool) -> Mutant:
    """The mutant with its verdict, by a file of the copy."""
    path = copy / one.module
    before = path.stat().st_mtime
    path.write_text(mutated(one.module, one.operator, one.occurrence), encoding="utf-8")
    os.utime(path, (before + 10 * number, before + 10 * number))  # no byte code of another mutant is taken for this one's
    started = time.monotonic()
    likely = definition(one.module, one.line)
    said: dict[str, list[str]] = {kind: [] for kind in SAID}
    try:
        for some in rounds(one)[: 3 if wide else 2]:  # most are noticed before others are imported
            if some and not said["assertions"]:
                more = in_child(copy, partial(afresh, copy), some, budget, likely)
                said = {key: said[key] + more[key] for key in said}
        if said["exceptions"] and not said["assertions"]:
            more = in_child(copy, partial(afresh, copy), NOTHING_RAW, 3 * budget, likely)
            said = {key: said[key] + more[key] for key in said}
    finally:
        path.write_text(source(one.module), encoding="utf-8")
        os.utime(path, (before, before))
    return judged(one, said, started)


def judged(one: Mutant, said: dict[str, list[str]], started: float) -> Mutant:
    verdict, by = next(((verdict, said[kind][0]) for kind, verdict in FOUND.items() if said[kind]), ("survived", ""))
    if verdict == "exception" and not covering(one.module, one.line) & {*said["passed"]}:
        verdict = "no value"
    verdict = "accepted" if verdict != "assertion" and one.key in accepted() else verdict
    done = replace(one, verdict=verdict, noticed_by=by, seconds=round(time.monotonic() - started, 1))
    print(f"{done.verdict:9} {done.seconds:6.1f} s  {done.module}:{done.line}  {done.old}  ->  {done.new}", flush=True)
    return done


@cache
def accepted() -> dict[tuple[str, str, str], str]:
    listed = tomllib.loads(ACCEPTED.read_text(encoding="utf-8"))["mutant"] if ACCEPTED.exists() else []
    return {(one["file"], one["old"], one["new"]): one["why"] for one in listed}


def preload() -> None:
    """Import what takes long and is never changed, once for all mutants."""
    import sympy  # noqa: F401


def copied(copy: Path) -> None:
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("_build", "gallery", "__pycache__"))
        else:
            shutil.copy2(ROOT / name, copy / name)


def main() -> None:
    parser = argparse.ArgumentParser(prog="make mutate")
    parser.add_argument("-n", type=int, default=200, help="how many mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="one mutant at each place, not a sample")
    parser.add_argument("--folder", nargs="*", default=[""], help="only modules whose paths begin so")
    parser.add_argument(
        "--budget", type=float, default=10.0, help="seconds of processor time for the likeliest tests of a mutant"
    )
    parser.add_argument("--wide", action="store_true", help="run all quick tests of the line, not those of few files")
    parser.add_argument(
        "--quick", action="store_true", help="only what can be tried in place: code that is called, not compiled"
    )
    parser.add_argument("--measure", action="store_true", help="find anew which test runs which line")
    parser.add_argument("--again", type=Path, help="a log, whose mutants that no assertion noticed are tried again")
    parser.add_argument("--goes-on", action="store_true", help="add to the log, and leave out the mutants that it holds")
    parser.add_argument("--log", type=Path, default=ROOT / ".cache" / "mutation.jsonl")
    chosen = parser.parse_args()
    os.environ["GEARLIB_TESTS"] = str(ROOT / ".cache")
    if chosen.measure or not COVERED.exists():
        print("running all quick tests once, to see which of them runs which line ...", flush=True)
        measure()
    preload()
    gc.freeze()
    chosen.log.parent.mkdir(exist_ok=True)
    known = {one.change for one in logged(chosen.log)} if chosen.goes_on else set()
    under = tuple(chosen.folder)
    fresh = every(chosen.seed, under, known) if chosen.all else sample(chosen.n, chosen.seed, under)
    drawn = unnoticed(chosen.again) if chosen.again else fresh
    todo = [one for one in drawn if one.change not in known]
    with (
        tempfile.TemporaryDirectory(prefix="gearlib-mutants-") as folder,
        chosen.log.open("a" if chosen.goes_on else "w") as log,
    ):
        copy = Path(folder)
        copied(copy)

        def keep(done: Mutant) -> None:
            log.write(json.dumps(asdict(done) | {"key": done.key}) + "\n")
            log.flush()

        def keep_what_is_known(done: Mutant) -> None:
            if chosen.quick or done.verdict in ("assertion", "accepted"):
                keep(done)

        try_in_place(todo, copy, chosen.budget, keep_what_is_known)
        left = {one.change for one in todo} - {one.change for one in logged(chosen.log)}
        for number, one in enumerate([] if chosen.quick else [one for one in todo if one.change in left], 1):
            keep(tried(one, copy, chosen.budget, number, chosen.wide))
        results = logged(chosen.log)
        noticing = sorted({done.noticed_by for done in results if "::" in done.noticed_by})
        said = in_child(copy, partial(afresh, copy), noticing, 60.0 * len(noticing))
    idle = [test for kind in FOUND for test in said[kind]]
    print(summary(results))
    if idle:
        sys.exit(f"these tests fail without a mutant, so what they noticed does not count: {', '.join(sorted(idle))}")


def summary(results: list[Mutant]) -> str:
    count = Counter(one.verdict for one in results)
    kept, raw = len(results) - count["accepted"], count["exception"] + count["no value"]
    shares = [100 * n / max(of, 1) for n, of in (
        (count["assertion"], kept), (count["assertion"] + raw, kept), (count["assertion"], kept - count["no value"])
    )]  # fmt: skip
    lines = [
        f"{len(results)} mutants: {count['assertion']} noticed by an assertion, {raw} by an exception "
        f"({count['no value']} of them in all tests of their lines), {count['crash']} by a crash, "
        f"{count['survived']} survived, {count['accepted']} accepted as equivalent or only slower",
        "of those that matter, {:.1f} % were noticed by an assertion ({:.1f} % by any test); of those that give values, {:.1f} %".format(
            *shares
        ),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
