"""Would a test notice? ``make mutate`` changes gearlib in one place at a time and runs the tests that should notice it.

Cosmic-ray makes the changes; this file draws a repeatable sample of them, finds each one's tests, runs them in a copy of the project
and says how they noticed. A module's tests follow from paths and names: the test file that mirrors it and its own doctests, then
those of the modules that import it, then the test files that use most of its public names, then the rest of the mirrored folder. The
first assertion that fails ends a mutant's run. An exception or a hang does not: the tests behind it are still run, and after an
exception the quick ones of the campaigns, whose claim is that nothing ends in a foreign exception. A mutant survives when its share
of processor time is used up and no test of the likeliest files (with ``--wide``: of all) has failed.

=============  =======================================================================================
``assertion``  a claim of a test did not hold, see below
``exception``  no claim, but a test met an exception that it did not expect
``crash``      nothing but a module that cannot be imported, a hang, or the end of the process
``survived``   no test failed
``accepted``   no claim failed, and ``tests/mutants.toml`` says why none need (equivalent, only slower)
=============  =======================================================================================

A claim of a test fails where its ``assert`` does, where what it expects to be raised is not, where a doctest prints something else,
and where gearlib refuses (a `GearlibError`) or warns: the test says that there is an answer, and the library checked that there is
none. A mutant may also break the code so that it gives no value at all (an index, a type, a shape): then the test that ran the line
fails by that exception, which says nothing of how well the values are watched. So the two are counted apart, and the bar of 97 % is
one of assertions. A crash is credited to no test.

Options follow ``ARGS=`` of make: ``-n 300``, ``--seed 7``, ``--folder gearlib/structure gearlib/reduce``, ``--again LOG`` for
those of a log that no assertion noticed, ``--goes-on`` for a sample that was interrupted: what its log holds is not tried again.
"""

from __future__ import annotations

import argparse
import ast
import doctest
import gc
import inspect
import itertools
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
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
OPERATORS = (
    *(f"ReplaceBinaryOperator_{old}_{new}" for old, new in SWAPS.items()),
    *(f"ReplaceComparisonOperator_{pair}" for pair in COMPARED),
    *OTHERS,
)


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


@cache
def places(module: str) -> list[list[tuple[str, int]]]:
    """Pairs (operator, occurrence) of each place of a module that can be changed."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    operators = {name: get_operator(f"core/{name}")() for name in OPERATORS}
    count: Counter[str] = Counter()
    found: dict[Any, list[tuple[str, int]]] = {}
    for node in ast_nodes(get_ast(source(module))):
        for name, operator in operators.items():
            for start, _ in operator.mutation_positions(node):
                if name != "ReplaceBinaryOperator_Mul_Div" or node.parent.type == "term":  # not the star of an argument
                    found.setdefault(start, []).append((name, count[name]))
                count[name] += 1
    return list(found.values())


def mutated(module: str, operator: str, occurrence: int) -> str:
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    return str(mutate_code(source(module), get_operator(f"core/{operator}")(), occurrence))


@cache
def meaning(text: str) -> str:
    """A module without what has no effect when all is right: annotations and some switches."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in WITHOUT_EFFECT]
    return ast.dump(tree)


def mutant(module: str, operator: str, occurrence: int) -> Mutant | None:
    """The mutant, if it means anything else than the module."""
    before, after = source(module), mutated(module, operator, occurrence)
    try:
        if meaning(before) == meaning(after):
            return None
    except SyntaxError:  # a star that is no operator
        return None
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


def logged(log: Path) -> list[Mutant]:
    """The mutants of a log with their verdicts; none where there is no log."""
    lines = map(json.loads, log.read_text().splitlines()) if log.exists() else ()
    return [Mutant(**{name: value for name, value in one.items() if name != "key"}) for one in lines]


def unnoticed(log: Path) -> Iterator[Mutant]:
    """Those of a log that no assertion noticed, wherever their lines are now."""
    for one in {one.key: one for one in logged(log) if one.verdict != "assertion"}.values():
        where = [m for m in modules() if Path(m).name == one.key[0]]
        changes = [one.change, *((m, *c) for m in where for place in places(m) for c in place if c[0] == one.operator)]
        made = (mutant(*change) for change in changes if change[0] in where)
        yield from itertools.islice((found for found in made if found is not None and found.key == one.key), 1)


# ---------------------------------------------------------------- tests


@cache
def public_names(module: str) -> frozenset[str]:
    body = ast.parse(source(module)).body
    names = {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return frozenset(name for name in names if not name.startswith("_"))


@cache
def imported(module: str) -> frozenset[str]:
    """Dotted names of the modules that a module imports."""
    nodes = ast.walk(ast.parse(source(module)))
    return frozenset(str(node.module) for node in nodes if isinstance(node, ast.ImportFrom))


@cache
def test_files() -> dict[str, frozenset[str]]:
    """The quick tests, and the words in each."""
    found = sorted((ROOT / "tests").rglob("test_*.py"))
    slow = ("tests/benchmarks", "tests/stress", "tests/test_project.py", "tests/test_scale.py")
    paths = [path for path in found if not str(path.relative_to(ROOT)).startswith(slow)]
    return {str(path.relative_to(ROOT)): frozenset(re.findall(r"\w+", path.read_text(encoding="utf-8"))) for path in paths}


def mirrors(module: str) -> list[str]:
    """The test files of a module's name, those in its own folder first."""
    stem, folder = Path(module).stem, Path(module).parent.name
    own = [file for file in test_files() if re.fullmatch(rf"test_{stem}(_\w+)?", Path(file).stem)]
    return sorted(own, key=lambda file: (Path(file).parent.name != folder, len(file)))


def tests_of(module: str) -> list[str]:
    """What to run for a module, that which should notice first."""
    dotted = module.removeprefix("library/").removesuffix(".py").replace("/", ".")
    users = [other for other in modules() if dotted in imported(other)]
    names = public_names(module)
    using = sorted(test_files(), key=lambda file: -len(names & test_files()[file]))
    using = [file for file in using if names & test_files()[file]]
    folder = [file for file in test_files() if Path(file).parent.name == Path(module).parent.name]
    near = [file for user in users for file in mirrors(user)]
    first = [*mirrors(module), module, *(file for file in using if file in folder), *near]
    return list(dict.fromkeys([*first, *users, *using, *folder, *test_files()]))


# ---------------------------------------------------------------- runs


def is_claim(failure: BaseException) -> bool:
    """Whether a failure says that a claim of the test does not hold; gearlib is the copy's, so its errors are known by name."""
    if isinstance(failure, doctest.UnexpectedException):
        failure = failure.exc_info[1]
    said = (AssertionError, pytest.fail.Exception, doctest.DocTestFailure, Warning)
    return isinstance(failure, said) or any(kind.__name__ == "GearlibError" for kind in type(failure).__mro__)


def limit_processor_time(seconds: int) -> None:
    import resource  # not on every system

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))


FOUND = {"assertions": "assertion", "exceptions": "exception", "crashes": "crash"}  # what notices, and the verdict


class Notice:
    """A pytest plugin that runs likely and quick tests first, and stops at the first assertion that fails or when the time is up."""

    def __init__(self, budget: float, likely: str, took: dict[str, float], file: Path) -> None:
        self.budget, self.likely, self.took, self.file = budget, likely, took, file
        self.assertions: list[str] = []
        self.exceptions: list[str] = []
        self.crashes: list[str] = []

    def write(self, running: str = "") -> None:
        """Say what is known so far, and which test is running, should the process end in it."""
        written = self.file.with_suffix(".part")
        written.write_text(json.dumps({kind: getattr(self, kind) for kind in FOUND} | {"running": running}))
        written.replace(self.file)  # whole, or not there

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        def order(item: pytest.Item) -> tuple[bool, float]:
            function = getattr(item, "function", None)
            text = inspect.getsource(function) if function and self.likely else ""
            return not re.search(rf"\b{self.likely}\b", text), self.took.get(item.nodeid, 0.2)

        items.sort(key=order)

    def pytest_exception_interact(self, node: pytest.Item | pytest.Collector, call: Any) -> None:
        failures = getattr(call.excinfo.value, "failures", [call.excinfo.value])  # a doctest's failures come together
        if getattr(call, "when", "") != "call":
            self.crashes.append(node.nodeid)
        else:
            (self.assertions if any(map(is_claim, failures)) else self.exceptions).append(node.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        started = time.process_time()
        limit_processor_time(int(started) + 30)  # for a test that hangs
        self.write(item.nodeid)
        done = yield
        self.took[item.nodeid] = round(time.process_time() - started, 2)
        if self.assertions or time.process_time() > self.budget:
            item.session.shouldstop = "enough is known"
        return done


def in_child(copy: Path, targets: list[str], budget: float, likely: str = "", without: tuple[str, ...] = ()) -> dict[str, Any]:
    """What the tests say, run in a fork of this process, which has imported what gearlib needs but not gearlib.

    If the process ends in a test, those behind it are run in another, up to three times.
    """
    import resource  # not on every system

    file, times = copy / "said.json", ROOT / ".cache" / "mutation-times.json"
    file.unlink(missing_ok=True)
    pid = os.fork()
    if pid == 0:
        with suppress(Exception):
            with open(os.devnull, "w") as nothing:
                os.dup2(nothing.fileno(), 1)
                os.dup2(nothing.fileno(), 2)
            limit_processor_time(60)  # until the first test sets its own
            resource.setrlimit(resource.RLIMIT_AS, (8 * 2**30,) * 2)
            os.chdir(copy)
            sys.path[:0] = [str(copy), str(copy / "library")]
            notice = Notice(budget, likely, json.loads(times.read_text()) if times.exists() else {}, file)
            options = ["-q", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-p", "no:xdist", "--tb=no"]
            options += [f"--deselect={test}" for test in without]
            code = pytest.main([*options, "--continue-on-collection-errors", *targets], plugins=[notice])
            if code not in (0, 1, 2, 5):  # passed, failed, stopped, no tests
                notice.crashes.append(f"pytest: {code}")
            times.write_text(json.dumps(notice.took))
            notice.write()
        os._exit(0)
    started = time.monotonic()
    while os.waitpid(pid, os.WNOHANG) == (0, 0):
        time.sleep(0.05)
        if time.monotonic() - started > 60 * budget:  # a wait that needs no processor, on a machine that is shared
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            break
    said = dict(json.loads(file.read_text())) if file.exists() else {**{kind: [] for kind in FOUND}, "running": "the process"}
    ended = said.pop("running")
    if ended:
        said["crashes"].append(ended)
    if "::" in ended and not said["assertions"] and len(without) < 3:
        more = in_child(copy, targets, budget, likely, (*without, ended))
        return {kind: said[kind] + more[kind] for kind in FOUND}
    return said


def definition(module: str, line: int) -> str:
    """The innermost function or class around a line, as a test would write its name."""
    kinds = ast.FunctionDef | ast.ClassDef
    around = [node for node in ast.walk(ast.parse(source(module))) if isinstance(node, kinds)]
    around = [node for node in around if node.lineno <= line <= (node.end_lineno or 0)]
    return max(around, key=lambda node: node.lineno).name.strip("_") if around else ""


def tried(one: Mutant, copy: Path, budget: float, number: int, wide: bool) -> Mutant:
    """The mutant with its verdict."""
    path = copy / one.module
    before = path.stat().st_mtime
    path.write_text(mutated(one.module, one.operator, one.occurrence), encoding="utf-8")
    os.utime(path, (before + 10 * number, before + 10 * number))  # no byte code of another mutant is taken for this one's
    started = time.monotonic()
    tests, likely = tests_of(one.module), definition(one.module, one.line)
    said: dict[str, list[str]] = {kind: [] for kind in FOUND}
    try:
        for some in (tests[:2], tests[2:7], *([tests[7:]] if wide else [])):  # most are noticed before others are imported
            if some and not said["assertions"]:
                more = in_child(copy, some, budget, likely)
                said = {key: said[key] + more[key] for key in said}
        if said["exceptions"] and not said["assertions"]:
            more = in_child(copy, NOTHING_RAW, 3 * budget, likely)
            said = {key: said[key] + more[key] for key in said}
    finally:
        path.write_text(source(one.module), encoding="utf-8")
        os.utime(path, (before, before))
    verdict, by = next(((verdict, said[kind][0]) for kind, verdict in FOUND.items() if said[kind]), ("survived", ""))
    return replace(one, verdict=verdict, noticed_by=by, seconds=round(time.monotonic() - started, 1))


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
    parser.add_argument("--folder", nargs="*", default=[""], help="only modules whose paths begin so")
    parser.add_argument(
        "--budget", type=float, default=10.0, help="seconds of processor time for the likeliest tests of a mutant"
    )
    parser.add_argument("--wide", action="store_true", help="run all quick tests, not the likeliest seven files only")
    parser.add_argument("--again", type=Path, help="a log, whose mutants that no assertion noticed are tried again")
    parser.add_argument("--goes-on", action="store_true", help="add to the log, and leave out the mutants that it holds")
    parser.add_argument("--log", type=Path, default=ROOT / ".cache" / "mutation.jsonl")
    chosen = parser.parse_args()
    os.environ["GEARLIB_TESTS"] = str(ROOT / ".cache")
    preload()
    gc.freeze()
    todo = unnoticed(chosen.again) if chosen.again else sample(chosen.n, chosen.seed, tuple(chosen.folder))
    reasons = accepted()
    chosen.log.parent.mkdir(exist_ok=True)
    results = logged(chosen.log) if chosen.goes_on else []
    known = {one.change for one in results}
    with (
        tempfile.TemporaryDirectory(prefix="gearlib-mutants-") as folder,
        chosen.log.open("a" if chosen.goes_on else "w") as log,
    ):
        copy = Path(folder)
        copied(copy)
        for number, one in enumerate(todo, 1):
            if one.change in known:
                continue
            done = tried(one, copy, chosen.budget, number, chosen.wide)
            if done.verdict != "assertion" and done.key in reasons:
                done = replace(done, verdict="accepted")
            print(
                f"{number:4} {done.verdict:9} {done.seconds:6.1f} s  {done.module}:{done.line}  {done.old}  ->  {done.new}",
                flush=True,
            )
            log.write(json.dumps(asdict(done) | {"key": done.key}) + "\n")
            log.flush()
            results.append(done)
        noticing = sorted({done.noticed_by for done in results if "::" in done.noticed_by})
        idle = set()
        for test in noticing:
            said = in_child(copy, [test], 60.0)
            idle |= {test for kind in FOUND for test in said[kind]}
    print(summary(results))
    if idle:
        sys.exit(f"these tests fail without a mutant, so what they noticed does not count: {', '.join(sorted(idle))}")


def summary(results: list[Mutant]) -> str:
    count = Counter(one.verdict for one in results)
    kept = len(results) - count["accepted"]
    lines = [
        f"{len(results)} mutants: {count['assertion']} noticed by an assertion, {count['exception']} by an exception, "
        f"{count['crash']} by a crash, "
        f"{count['survived']} survived, {count['accepted']} accepted as equivalent or only slower",
        f"of those that matter, {100 * count['assertion'] / max(kept, 1):.1f} % were noticed by an assertion "
        f"({100 * (count['assertion'] + count['exception']) / max(kept, 1):.1f} % by any test)",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
