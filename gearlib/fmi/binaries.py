"""Shared libraries of an FMU: object code from gearlib's compiler, linked with a C wrapper by an available C compiler."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from gearlib.compiler.cache import COMPILING, cached_bytes
from gearlib.compiler.instructions import Unsupported
from gearlib.compiler.native_module import native_digest, native_text
from gearlib.compiler.platforms import PLATFORMS, Platform, object_code_for, own_platform
from gearlib.compiler.translate import intermediate
from gearlib.errors import ArgumentError, MissingPackageError
from gearlib.solvers.rungekutta.loop import MODULES

WRAPPER = Path(__file__).parent / "wrapper"
DRIVE = "gearlib.solvers.drive.drive_loop"
EXTRA = {
    ".so": ("-Wl,-Bsymbolic", "-lm"),
    ".dylib": ("-Wl,-install_name,@rpath/library.dylib",),
}  # not the path where it was linked
FLAGS = ("-std=c11", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")


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
    """Compile and link a model. What is the same for every model is compiled once, and kept in the cache.

    Parameters
    ----------
    target : Platform
    source : str
        Source of the model's functions, in the small language.
    tables : mapping of str to str
        Generated C files. The wrapper depends on ``record.h`` alone.
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
        here, compiler = Path(folder), _linker(target)

        def made(name: str, *arguments: str) -> bytes:
            command = [*compiler, *FLAGS, f"-I{WRAPPER}", f"-I{here}", *arguments, "-o", str(here / name)]
            done = subprocess.run(command, capture_output=True, text=True, cwd=here)
            if done.returncode:
                raise MissingPackageError(
                    f"the C compiler {compiler[0]} could not link for {target.name}: {done.stderr.strip()[:2000]}"
                )
            return (here / name).read_bytes()

        for name, text in tables.items():
            (here / name).write_text(text, encoding="utf-8")
        texts = [path.read_text(encoding="utf-8") for path in sorted(WRAPPER.glob("*.[ch]"))]
        for file in ("instance.c", "stepping.c", *faces):
            made_from = "\0".join([file, target.name, *compiler, *FLAGS, tables["record.h"], *texts])
            kept = f"gearlib_wrapper_{hashlib.sha256(made_from.encode()).hexdigest()[:24]}.o"
            with COMPILING:
                codes[file] = cached_bytes(kept, partial(made, f"{file}.o", "-c", str(WRAPPER / file)))
        for name, code in codes.items():
            (here / f"{name}.o").write_bytes(code)
        own = [str(here / name) for name in tables if name.endswith(".c")]
        objects = [str(here / f"{name}.o") for name in codes]
        return made(f"library{target.suffix}", "-shared", *own, *objects, *EXTRA.get(target.suffix, ()))


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
