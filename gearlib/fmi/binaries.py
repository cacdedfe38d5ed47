"""Shared libraries of an FMU: object code from gearlib's compiler, linked with a C wrapper by an available C compiler."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from gearlib.compiler.instructions import Unsupported
from gearlib.compiler.native_module import native_digest, native_text
from gearlib.compiler.platforms import PLATFORMS, Platform, object_code_for, own_platform
from gearlib.compiler.translate import intermediate
from gearlib.errors import ArgumentError, MissingPackageError
from gearlib.solvers.rungekutta.loop import MODULES

HERE = Path(__file__).parent
DRIVE = "gearlib.solvers.drive.drive_loop"
EXTRA = {
    ".so": ("-Wl,-Bsymbolic", "-lm"),
    ".dylib": ("-Wl,-install_name,@rpath/library.dylib",),
}  # not the path where it was linked
FLAGS = ("-std=c11", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-shared")


def chosen_platforms(names: Sequence[str]) -> list[Platform]:
    """Platforms by name; ``"native"`` is the host platform, ``"all"`` all of them.

    Raises
    ------
    ArgumentError
        Unknown platform.
    """
    found: dict[str, Platform] = {}
    for name in names:
        own = own_platform() if name == "native" else name
        if name == "all":
            found.update(PLATFORMS)
        elif own in PLATFORMS:
            found[own] = PLATFORMS[own]
        else:
            raise ArgumentError(f"there is no platform '{own}' to export for; valid names: native, all, {', '.join(PLATFORMS)}")
    return list(found.values())


def shared_library(target: Platform, source: str, tables: Mapping[str, str], faces: Sequence[str]) -> bytes:
    """Compile and link a model.

    Parameters
    ----------
    target : Platform
    source : str
        Source of the model's functions, in the small language.
    tables : mapping of str to str
        Generated C files.
    faces : sequence of str
        Files of the wrapper in addition to its core.

    Raises
    ------
    ArgumentError
        An expression that cannot be compiled.
    MissingPackageError
        No C compiler links for the platform.
    """
    units = {"drive": (DRIVE,), "rungekutta": MODULES}
    try:
        codes = {"model": object_code_for(target, lambda: intermediate(source), source)}
    except Unsupported as problem:
        raise ArgumentError(f"the model cannot be exported: {problem}") from None
    for name, modules in units.items():
        codes[name] = object_code_for(target, partial(native_text, *modules), native_digest(*modules))
    with TemporaryDirectory(prefix="gearlib-") as folder:
        here = Path(folder)
        for name, code in codes.items():
            (here / f"{name}.o").write_bytes(code)
        for name, text in tables.items():
            (here / name).write_text(text, encoding="utf-8")
        wrapper = HERE / "wrapper"
        result = here / f"library{target.suffix}"
        own = [str(here / name) for name in tables if name.endswith(".c")]
        command = [
            *_linker(target), *FLAGS, f"-I{wrapper}", f"-I{here}",
            *(str(wrapper / name) for name in ("instance.c", "stepping.c", *faces)), *own, *(str(here / f"{n}.o") for n in codes),
            *EXTRA.get(target.suffix, ()), "-o", str(result),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, cwd=here)
        if done.returncode:
            raise MissingPackageError(
                f"the C compiler {command[0]} could not link for {target.name}: {done.stderr.strip()[:2000]}"
            )
        return result.read_bytes()


def _linker(target: Platform) -> list[str]:
    """The command that links for a platform: the system's compiler for the native one, zig's otherwise."""
    native = target.name == own_platform()
    chosen = os.environ.get("CC")
    if native and chosen and shutil.which(chosen.split()[0]):
        return chosen.split()
    if native and (found := next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)):
        return [found]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.zig]
    if shutil.which("zig"):
        return ["zig", "cc", "-target", target.zig]
    raise MissingPackageError(
        f"an FMU for {target.name} needs a C compiler that links for it, and there is none: pip install ziglang (the extra "
        "gearlib[fmu])"
    )
