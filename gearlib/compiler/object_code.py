"""Object code: compiled by LLVM, cached on disk, linked into the process."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import count
from pathlib import Path
from typing import Any

from gearlib.compiler.cache import COMPILING, cached_bytes

COMPILER = (
    "data_flow.py",
    "instructions.py",
    "native_module.py",
    "object_code.py",
    "platforms.py",
    "small_language.py",
    "translate.py",
)
WINDOWS = sys.platform == "win32"  # JITLink, LLVM's newer linker for small code models, does not support Windows COFF
LINKED = 300  # modules kept linked though unreferenced, the most recently used ones
USES = 64  # compilations after which `Host.passes` makes LLVM's pass manager anew
LONG = 40_000  # characters of source that take about a second to compile
_numbers = count()


@dataclass(frozen=True)
class CompiledFunction:
    """A function linked into the process; its code lives as long as this object."""

    address: int
    _library: Any


@lru_cache(maxsize=LINKED)
def compiled(source: str, name: str, fused: bool = False) -> CompiledFunction:
    r"""Compile a function from generated source, or load it from the cache.

    Parameters
    ----------
    source : str
        A module in the language of `gearlib.compiler.translate`.
    name : str
        A function in it that returns ``int32``.
    fused : bool
        Whether a product and a sum of vectors may be one instruction.

    Raises
    ------
    Unsupported
        The source is not in that language.

    Examples
    --------
    >>> import ctypes
    >>> half = compiled("def half(t: float, x: floats) -> int32:\n    x[0] = t / 2\n    return 0", "half")
    >>> result = ctypes.c_double()
    >>> ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p)(half.address)(3.0, ctypes.addressof(result))
    0
    >>> result.value
    1.5
    """
    with COMPILING:
        digest = hashlib.sha256("\0".join((compiler_digest(), source, *["fused"] * fused)).encode()).hexdigest()[:24]
        try:
            slow = "a large model" if len(source) > LONG else ""
            code = cached_bytes(f"gearlib_model_{digest}.o", lambda: object_code(source, fused), slow)
            addresses, library = linked(code, [name])
        except RuntimeError:  # damage that the checksum did not reveal
            addresses, library = linked(object_code(source, fused), [name])
        return CompiledFunction(addresses[name], library)


class Host:
    """LLVM objects for the host machine, each created on first use."""

    @cached_property
    def processor(self) -> tuple[str, str]:
        """Name and features of the CPU."""
        from llvmlite import binding

        try:
            return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
        except RuntimeError:  # a CPU unknown to LLVM
            return binding.get_host_cpu_name(), ""

    @cached_property
    def digest(self) -> str:
        """Digest of what object code depends on besides its source: LLVM version, CPU features, compiler sources, options."""
        import llvmlite
        from llvmlite import binding

        here = Path(__file__).parent
        own = hashlib.sha256(b"".join((here / file).read_bytes() for file in COMPILER)).hexdigest()
        llvm = ".".join(str(number) for number in binding.llvm_version_info)
        return "\0".join((llvmlite.__version__, llvm, binding.get_process_triple(), *self.processor, own))

    @cached_property
    def machine(self) -> Any:
        """LLVM's target machine."""
        from llvmlite import binding

        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        name, features = self.processor
        target = binding.Target.from_triple(binding.get_process_triple())
        reloc, model = ("static", "jitdefault") if WINDOWS else ("pic", "small")
        return target.create_target_machine(cpu=name, features=features, opt=2, reloc=reloc, codemodel=model, jit=WINDOWS)

    @cached_property
    def linker(self) -> Any:
        from llvmlite import binding

        return binding.create_lljit_compiler(self.machine, use_jit_link=not WINDOWS, suppress_errors=True)

    @property
    def passes(self) -> tuple[Any, Any]:
        """Function pass manager at optimisation level 1, and its pass builder.

        At level 1 the code is as fast as with all passes at the highest level, in a third of the time: loops arrive in canonical form
        and already vectorised. Both objects slow down with every use, and llvmlite never frees their memory; so they are reused a
        limited number of times.
        """
        if self._uses % USES == 0:
            from llvmlite import binding

            builder = binding.create_pass_builder(self.machine, binding.create_pipeline_tuning_options(speed_level=1))
            self._passes = builder.getFunctionPassManager(), builder
        self._uses += 1
        return self._passes

    _uses = 0
    _passes: tuple[Any, Any]


HOST = Host()


def compiler_digest() -> str:
    """Digest of what object code depends on besides its source."""
    return HOST.digest


def object_code(source: str, fused: bool = False) -> bytes:
    """Compile a module."""
    from llvmlite import binding

    from gearlib.compiler.translate import intermediate

    machine, (passes, builder) = HOST.machine, HOST.passes
    head = f'target datalayout = "{machine.target_data}"\ntarget triple = "{machine.triple}"\n'
    module = binding.parse_assembly(head + intermediate(source, fused=fused))
    for function in module.functions:
        if not function.is_declaration:
            passes.run(function, builder)
    return bytes(machine.emit_object(module))


def optimised(text: str) -> bytes:
    """Compile an IR module, with inlining across functions, which matters in integration loops.

    LLVM neither vectorises nor unrolls: where that pays, loops say so (``blocks``, ``parallel``, ``lane``), and all others compile fast.
    """
    from llvmlite import binding

    machine = HOST.machine
    head = f'target datalayout = "{machine.target_data}"\ntarget triple = "{machine.triple}"\n'
    module = binding.parse_assembly(head + text)
    options = binding.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.loop_unrolling = False
    options.inlining_threshold = 60  # short functions only
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def linked(code: bytes, names: Sequence[str]) -> tuple[dict[str, int], Any]:
    """Link object code into the process; returns the addresses of exported functions and the owner of their memory."""
    from llvmlite import binding

    unit = binding.JITLibraryBuilder().add_object_img(code).add_current_process()
    for name in names:
        unit.export_symbol(name)
    tracker = unit.link(HOST.linker, f"gearlib_{next(_numbers)}")
    return {name: int(tracker[name]) for name in names}, tracker
