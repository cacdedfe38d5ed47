"""What is linked into an FMU's library, by which compiler and with which options, without one that runs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gearlib.compiler.instructions import Unsupported
from gearlib.compiler.platforms import PLATFORMS, own_platform
from gearlib.errors import ArgumentError, MissingPackageError
from gearlib.fmi import binaries
from gearlib.fmi.binaries import WRAPPER, chosen_platforms, shared_library

OWN = own_platform()
OTHER = next(name for name in PLATFORMS if name != OWN and name.endswith("windows"))


def test_platforms_by_name() -> None:
    def names(*given: str) -> list[str]:
        return [platform.name for platform in chosen_platforms(given)]

    assert names("native") == names("native", OWN) == [OWN]
    assert names("all") == names("all", "native") == list(PLATFORMS)
    assert names(OTHER, "native", OTHER) == [OTHER, OWN]
    assert names() == []
    with pytest.raises(ArgumentError) as said:
        names("native", "amiga")
    assert str(said.value) == (f"there is no platform 'amiga' to export for; valid names: native, all, {', '.join(PLATFORMS)}")


class Linking:
    """Compilers that are there, and the commands that one of them was given: the last one links."""

    def __init__(self, patch: pytest.MonkeyPatch, there: list[str], ziglang: bool = False, chosen: str = "") -> None:
        self.commands: list[list[str]] = []
        self.files: dict[str, bytes] = {}
        self.fails = 0
        self.codes: dict[str, tuple[str, str]] = {}
        patch.setattr(binaries.shutil, "which", lambda name: f"/bin/{name}" if name in there else None)
        patch.setattr(binaries, "find_spec", lambda name: object() if ziglang and name == "ziglang" else None)
        patch.setattr(binaries, "object_code_for", self._code)
        patch.setattr(binaries, "cached_bytes", self._kept)
        self.kept: dict[str, bytes] = {}
        patch.setattr(subprocess, "run", self._run)
        patch.setenv("CC", chosen)

    def _code(self, target: Any, text: Any, made_from: str) -> bytes:
        return f"{target.name}: {made_from}".encode()

    def _kept(self, name: str, make: Callable[[], bytes]) -> bytes:
        if name not in self.kept:
            self.kept[name] = make()
        return self.kept[name]

    def _run(self, command: list[str], *, cwd: Path, **options: Any) -> Any:
        self.commands.append(command)
        self.files = {path.name: path.read_bytes() for path in sorted(cwd.iterdir())}
        Path(command[command.index("-o") + 1]).write_bytes(b"linked" if "-shared" in command else command[-3].encode())
        said = " no such thing\n" if options["capture_output"] and options["text"] else "unread"
        return subprocess.CompletedProcess(command, self.fails, "", said)

    def linked(self, name: str) -> bytes:
        tables = {"tables.c": "int one;\n", "record.h": "int two;\n"}
        return shared_library(PLATFORMS[name], "def f(): ...", tables, ("fmi3.c", "fmi2.c"))

    @property
    def compiler(self) -> list[str]:
        """What the command begins with."""
        (found,) = {tuple(command[: command.index("-std=c11")]) for command in self.commands}
        return [*found]


@pytest.mark.parametrize(
    ("name", "there", "ziglang", "chosen", "expected"),
    [
        (OWN, ["cc", "gcc", "clang", "zig"], True, "", ["cc"]),
        (OWN, ["clang", "gcc"], True, "", ["gcc"]),
        (OWN, ["clang"], False, "", ["clang"]),
        (OWN, ["cc", "mycc"], False, "mycc -m64", ["mycc", "-m64"]),
        (OWN, ["cc"], False, "mycc -m64", ["cc"]),
        (OWN, [], True, "", [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[OWN].zig]),
        (OTHER, ["cc", "mycc", "zig"], True, "mycc", [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[OTHER].zig]),
        (OTHER, ["cc", "zig"], False, "", ["zig", "cc", "-target", PLATFORMS[OTHER].zig]),
    ],
)
def test_compiler_is_the_systems_own_for_its_own_platform_and_zig_for_others(
    monkeypatch: pytest.MonkeyPatch, name: str, there: list[str], ziglang: bool, chosen: str, expected: list[str]
) -> None:
    linking = Linking(monkeypatch, there, ziglang, chosen)
    assert linking.linked(name) == b"linked"
    assert linking.compiler == expected


@pytest.mark.parametrize("name", PLATFORMS)
def test_library_is_linked_of_the_wrapper_and_the_model(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    linking = Linking(monkeypatch, ["cc", "zig"])
    linking.linked(name)
    *compiled, given = linking.commands
    wrapper = ["instance.c", "stepping.c", "fmi3.c", "fmi2.c"]
    assert [command[-3] for command in compiled] == [str(WRAPPER / file) for file in wrapper]
    assert all(command[-4] == "-c" and "-shared" not in command for command in compiled)
    assert all({f"-I{WRAPPER}", f"-I{Path(c[-1]).parent}", "-O2", "-fPIC", "-ffp-contract=off"} <= {*c} for c in compiled)
    objects = {"model.o", "drive.o", "rungekutta.o", *(f"{file}.o" for file in wrapper)}
    assert set(linking.files) == {*objects, "tables.c", "record.h"}
    assert linking.files["fmi3.c.o"] == str(WRAPPER / "fmi3.c").encode()
    assert linking.files["tables.c"] == b"int one;\n"
    assert linking.files["model.o"] == f"{name}: def f(): ...".encode()
    assert linking.files["drive.o"] != linking.files["rungekutta.o"]
    assert {Path(word).name for word in given if word.endswith((".c", ".o"))} == {*objects, "tables.c"}
    assert all((WRAPPER / file).is_file() for file in wrapper)
    assert {f"-I{Path(given[-1]).parent}", "-shared", "-fPIC", "-ffp-contract=off"} <= {*given}
    assert Path(given[-1]).name == f"library{PLATFORMS[name].suffix}"
    assert ("-lm" in given, "-Wl,-Bsymbolic" in given) == (name.endswith("linux"),) * 2
    assert ("-Wl,-install_name,@rpath/library.dylib" in given) == name.endswith("darwin")


def test_the_wrapper_is_compiled_once_for_all_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """And again for another platform or compiler, and where what it includes is another."""
    linking = Linking(monkeypatch, ["cc", "mycc", "zig"])
    spent = []
    for name, chosen, record in (
        (OWN, "", "one"),
        (OWN, "", "one"),
        (OWN, "", "two"),
        (OWN, "mycc", "two"),
        (OTHER, "", "two"),
    ):
        monkeypatch.setenv("CC", chosen)
        linking.commands.clear()
        shared_library(PLATFORMS[name], "def f(): ...", {"record.h": f"int {record};"}, ("fmi3.c",))
        spent.append(len(linking.commands))
    assert spent == [4, 1, 4, 4, 4]


def test_what_cannot_be_linked_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    linking = Linking(monkeypatch, ["cc"])
    with pytest.raises(MissingPackageError) as said:
        linking.linked(OTHER)
    assert str(said.value) == (
        f"an FMU for {OTHER} needs a C compiler that links for it, and there is none: pip install ziglang (the extra gearlib[fmu])"
    )
    linking.fails = 1
    with pytest.raises(MissingPackageError) as said:
        linking.linked(OWN)
    assert str(said.value) == f"the C compiler cc could not link for {OWN}: no such thing"

    def unsupported(*_: Any) -> bytes:
        raise Unsupported("a matrix")

    monkeypatch.setattr(binaries, "object_code_for", unsupported)
    with pytest.raises(ArgumentError, match=r"^the model cannot be exported: a matrix$"):
        linking.linked(OWN)
