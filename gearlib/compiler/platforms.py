"""Cross-compilation: object code for any processor of a platform, not only for the host."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gearlib.compiler.cache import COMPILING, cached_bytes
from gearlib.compiler.object_code import compiler_digest


@dataclass(frozen=True)
class Platform:
    """A processor architecture with its operating system.

    Attributes
    ----------
    name : str
        FMI 3.0's name, such as ``"x86_64-linux"``.
    triple : str
        LLVM's target triple.
    zig : str
        Target of ``zig cc -target``, with the oldest C library that is supported.
    suffix : str
        File suffix of shared libraries.
    fmi2 : str
        FMI 2.0's name.
    """

    name: str
    triple: str
    zig: str
    suffix: str
    fmi2: str


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17", ".so", "linux64"),
        Platform("aarch64-linux", "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17", ".so", "aarch64-linux"),
        Platform("x86_64-windows", "x86_64-w64-windows-gnu", "x86_64-windows-gnu", ".dll", "win64"),
        Platform("aarch64-windows", "aarch64-w64-windows-gnu", "aarch64-windows-gnu", ".dll", "aarch64-windows"),
        Platform("x86_64-darwin", "x86_64-apple-macosx11.0.0", "x86_64-macos.11.0", ".dylib", "darwin64"),
        Platform("aarch64-darwin", "arm64-apple-macosx11.0.0", "aarch64-macos.11.0", ".dylib", "aarch64-darwin"),
    )
}


def own_platform() -> str:
    """Name of the host platform; it need not be one of `PLATFORMS`."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return f"{machine}-{system}"


def _machine(triple: str) -> Any:
    """LLVM target machine of a platform, for its baseline processor."""
    from llvmlite import binding

    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    return binding.Target.from_triple(triple).create_target_machine(opt=2, reloc="pic", codemodel="small")


def object_code_for(target: Platform, text: Callable[[], str], made_from: str) -> bytes:
    """Compile LLVM IR for a platform; its functions are visible to what they are linked with, and hidden outside.

    Parameters
    ----------
    target : Platform
    text : callable
        Returns the IR, as `gearlib.compiler.translate` produces it.
    made_from : str
        Everything that the IR depends on, or a digest of it: the key in the cache.
    """
    digest = hashlib.sha256("\0".join((compiler_digest(), target.triple, made_from)).encode()).hexdigest()[:24]
    with COMPILING:
        return cached_bytes(f"gearlib_code_{digest}.o", lambda: compiled(target, text()))


def compiled(target: Platform, text: str) -> bytes:
    from llvmlite import binding

    machine = _machine(target.triple)
    head = f'target datalayout = "{machine.target_data}"\ntarget triple = "{machine.triple}"\n'
    module = binding.parse_assembly(head + text)
    for function in module.functions:
        if not function.is_declaration and function.linkage.name == "external":
            function.visibility = "hidden"
    builder = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=2))
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))
