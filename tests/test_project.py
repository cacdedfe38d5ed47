"""What holds for the project as a whole: its layers, its folders, its files and its wheel."""

from __future__ import annotations

import ast
import functools
import re
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.architecture import syntax, uncollected

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONTRACTS = {contract["id"]: contract for contract in PROJECT["tool"]["importlinter"]["contracts"]}
SOURCES = sorted([*(ROOT / "gearlib").rglob("*.py"), *(ROOT / "library").rglob("*.py")])
FOLDERS = {"gearlib", "library", "examples", "tests", "docs"}
BUILT = {"build", "dist", "__pycache__"}
# Beginnings of paths that exist on one machine only.
PRIVATE = re.compile(r"(?<![\w.\-])(?:/(?:work|tmp|root|home|Users)/|[A-Z]:\\Users|(?:\.\./)?shared/(?=\w))")


def module_name(path: Path) -> str:
    base = ROOT / "library" if path.is_relative_to(ROOT / "library") else ROOT
    parts = path.relative_to(base).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(tree: ast.Module, package: str) -> Iterator[str]:
    """Absolute names of all that a module imports, also inside functions; ``package`` is where relative ones start."""
    for node in statements(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            target = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{target}.{alias.name}" for alias in node.names)


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """A tree's statements at every depth, and none of their expressions."""
    yield tree
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(tree, part, ())
        for node in inner if isinstance(inner, list) else ():
            yield from statements(node)


def inside(name: str, module: str) -> bool:
    return name == module or name.startswith(module + ".")


@functools.cache
def all_imports() -> list[tuple[str, str]]:
    """Pairs (module, imported name) of all modules."""
    found = []
    for path in SOURCES:
        module = module_name(path)
        home = module if path.name == "__init__.py" else module.rpartition(".")[0]
        found += [(module, name) for name in imports(syntax(path), home)]
    return found


def imported_by(package: str) -> Iterator[tuple[str, str]]:
    """Pairs (module, imported name) of all modules of ``package``."""
    return (pair for pair in all_imports() if inside(pair[0], package))


def text_files() -> Iterator[Path]:
    suffixes = {".py", ".md", ".rst", ".toml", ".cff", ".txt", ".csv", ".json", ".mo", ".yml", ".yaml", ""}
    generated = {"_build", "gallery", "api", *BUILT}
    # In a git worktree .git is a file, which holds a path.
    paths = [p for p in ROOT.iterdir() if p.name != ".git"]
    paths += [path for folder in [*sorted(FOLDERS), ".ci"] for path in (ROOT / folder).rglob("*")]
    for path in paths:
        if path.is_file() and path.suffix in suffixes and not generated & set(path.relative_to(ROOT).parts):
            yield path


def test_relative_imports_are_resolved() -> None:
    tree = ast.parse("from . import a\nfrom ..b import c\nimport d.e")
    assert list(imports(tree, "top.inner")) == ["top.inner.a", "top.b.c", "d.e"]


def test_imports_are_found_at_every_depth() -> None:
    tree = ast.parse(
        """
class A:
    def f(self):
        async def g():
            async with x, y:
                import a
            async for z in x:
                import b
            else:
                import c
        if x: import d
        elif y: import e
        else: import f
        while x: import g
        try: import h
        except E: import i
        else: import j
        finally: import k
        try: import l
        except* E: import m
        match x:
            case 1: import n
        with x: import o
"""
    )
    assert sorted(imports(tree, "")) == [*"abcdefghijklmno"]


def test_phases_import_downwards_only() -> None:
    layers = [[name.strip(" ()") for name in re.split("[:|]", layer)] for layer in CONTRACTS["layers"]["layers"]]
    upwards = [
        f"{module} imports {name}"
        for depth, layer in enumerate(layers)
        for package in layer
        for module, name in imported_by(package)
        if any(inside(name, higher) for above in layers[:depth] for higher in above)
    ]
    assert upwards == []


def test_every_module_is_in_a_layer() -> None:
    placed = {name.strip(" ()") for layer in CONTRACTS["layers"]["layers"] for name in re.split("[:|]", layer)}
    placed |= {"gearlib.bondgraph"}
    outside = [m for m in map(module_name, SOURCES) if inside(m, "gearlib") and not any(inside(m, layer) for layer in placed)]
    assert outside in ([], ["gearlib"])


@pytest.mark.parametrize("contract", [c for c in CONTRACTS.values() if c["type"] == "forbidden"], ids=lambda c: str(c["id"]))
def test_forbidden_imports_are_absent(contract: dict[str, list[str]]) -> None:
    found = [
        f"{module} imports {name}"
        for package in contract["source_modules"]
        for module, name in imported_by(package)
        if any(inside(name, forbidden) for forbidden in contract["forbidden_modules"])
    ]
    assert found == []


def test_tests_import_public_names_only() -> None:
    for path in sorted((ROOT / "tests").rglob("*.py")):
        with uncollected():
            tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {n for n in imports(tree, "tests") if inside(n, "gearlib") or inside(n, "gearparts")}
        assert not [name for name in names if re.search(r"\._(?!_)", name)], path
        modules = {name.rpartition(".")[2]: ROOT / f"{name.replace('.', '/')}.py" for name in names}
        reached = {
            f"{n.value.id}.{n.attr}" for n in ast.walk(tree) if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name)
        }
        for module, name in (text.split(".") for text in reached):
            if module in modules and modules[module].exists() and name.startswith("_"):
                assert not re.search(rf"^(def|class) {name}\b", modules[module].read_text(encoding="utf-8"), re.MULTILINE), path


def test_top_level_folders_are_the_five() -> None:
    folders = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")}
    assert folders - BUILT == FOLDERS


def test_no_file_names_a_path_of_one_machine() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}"
        for path in text_files()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if PRIVATE.search(line)
    ]
    assert found == []


def test_version_is_the_same_everywhere() -> None:
    version = PROJECT["project"]["version"]
    citation = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    newest = re.search(r"^## \[(\d[^\]]*)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert citation is not None
    assert newest is not None
    assert (citation[1], newest[1]) == (version, version)


def test_wheel_holds_both_packages_and_nothing_else(tmp_path: Path) -> None:
    wheel_builder = pytest.importorskip("hatchling.builders.wheel").WheelBuilder
    (wheel,) = wheel_builder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    assert Path(wheel).stat().st_size < (1 << 20) / 0.827  # `make wheel`, which refuses 1 MB and more, takes off 17 %
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"gearlib", "gearparts"}
    modules = {str(path.relative_to(ROOT)).removeprefix("library/") for path in SOURCES}
    assert modules | {"gearlib/py.typed", "gearparts/py.typed"} <= names


def test_pictures_of_the_documentation_are_small() -> None:
    assert sum(path.stat().st_size for path in (ROOT / "docs" / "images").iterdir()) < 400_000


def test_no_public_name_is_that_of_a_folder_or_module() -> None:
    """Importing ``gearlib.x`` puts the module in place of ``gl.x``, so that what is called depends on what was imported before."""
    import pkgutil

    import gearlib

    assert not {module.name for module in pkgutil.iter_modules(gearlib.__path__)} & set(gearlib.__all__)


def test_classifiers_exist_and_name_the_versions_that_are_supported() -> None:
    known = pytest.importorskip("trove_classifiers").classifiers
    given = PROJECT["project"]["classifiers"]
    assert set(given) <= set(known)
    assert given == sorted(given)
    oldest = PROJECT["project"]["requires-python"].removeprefix(">=")
    assert f"Programming Language :: Python :: {oldest}" in given


def test_the_recipe_for_conda_has_the_same_requirements() -> None:
    recipe = (ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    run = re.search(r"  run:\n((?:    - .*\n)+)", recipe)
    assert run is not None
    found = {line.strip("- ") for line in run[1].splitlines()} - {"python >=${{ python_min }}"}
    names = {"control": "python-control"}  # what conda-forge calls them
    wanted = [re.fullmatch(r"([\w-]+)(.*)", requirement) for requirement in PROJECT["project"]["dependencies"]]
    assert found == {f"{names.get(m[1], m[1])} {m[2]}" for m in wanted if m}
    assert f'version: "{PROJECT["project"]["version"]}"' in recipe
    assert "hatchling >=1.27" in recipe


def test_the_article_cites_what_its_bibliography_has() -> None:
    article, entries = ((ROOT / "docs" / "joss" / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
    cited, listed = set(re.findall(r"@(\w+)", article)), set(re.findall(r"^@\w+\{(\w+),", entries, re.MULTILINE))
    assert cited == listed
    assert entries.count("doi = {10.") == len(listed)


def test_community_files_are_linked() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for name in re.findall(r"\]\((?!http)([^)]+)\)|`(docs/[\w/]+\.md)`", text):
        assert (ROOT / (name[0] or name[1])).is_file(), name
    targets = set(re.findall(r"(?:^|`)make (\w+)", text, re.MULTILINE))
    assert targets <= set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
