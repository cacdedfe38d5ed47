"""Libraries of FMUs for other machines: their format, what they export and import; that for ARM runs in an emulator."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.compiler.platforms import PLATFORMS

HEADERS = Path(fmpy.__file__).parent / "c-code"  # those of the standard
pytestmark = pytest.mark.slow
pytest.importorskip("ziglang")

FORMATS = {
    "x86_64-linux": "elf64-x86-64", "aarch64-linux": "elf64-littleaarch64", "x86_64-windows": "coff-x86-64",
    "aarch64-windows": "coff-arm64", "x86_64-darwin": "mach-o 64-bit x86-64", "aarch64-darwin": "mach-o arm64",
}  # fmt: skip
SYSTEM = re.compile(
    r"(?i)lib(c|m|dl|pthread|System(\.B)?)\.(so|dylib)|ld-linux|kernel32|ntdll|msvcrt|ucrt|api-ms-win-crt|advapi32"
)
ARM = Path("/usr/aarch64-linux-gnu")  # of the package libc6-arm64-cross


def library(name: str, folder: Path) -> tuple[gl.System, fmpy.model_description.ModelDescription, Path]:
    """The XP train's library for a platform."""
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0))
    path = system.export_fmu(folder / "xp.fmu", platforms=[name], kind="cs")
    fmpy.extract(str(path), str(folder / "content"))
    target = folder / "content" / "binaries" / name / f"xp{PLATFORMS[name].suffix}"
    return system, fmpy.read_model_description(str(path)), target


def listed(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


@pytest.mark.skipif(shutil.which("llvm-objdump") is None, reason="llvm is not installed")
@pytest.mark.parametrize("name", PLATFORMS)
def test_a_library_exports_the_interface_and_needs_the_system_only(name: str, tmp_path: Path) -> None:
    *_, path = library(name, tmp_path)
    head = listed("llvm-objdump", "-f", str(path))
    assert FORMATS[name] in head, head
    if name.endswith("windows"):
        text = listed("llvm-objdump", "-p", str(path))
        exported = set(re.findall(r"\s(fmi3\w+)", text))
        needed = re.findall(r"DLL Name: (\S+)", text)
    else:
        dynamic = ["-D"] if name.endswith("linux") else []
        exported = {
            word.lstrip("_")
            for word in listed("llvm-nm", *dynamic, "-g", "--defined-only", str(path)).split()
            if "fmi3" in word
        }
        kind = "--dylibs-used" if name.endswith("darwin") else "-p"
        text = listed("llvm-objdump", *(["--macho"] if name.endswith("darwin") else []), kind, str(path))
        needed = re.findall(r"NEEDED\s+(\S+)|^\s+(/\S+\.dylib)", text, re.MULTILINE)
        needed = ["".join(found) for found in needed]
    declared = set(re.findall(r"^#define (fmi3[A-Z]\w+) ", (HEADERS / "fmi3Functions.h").read_text(), re.MULTILINE))
    assert len(exported) >= 60
    assert {f for f in declared if not f.endswith("TYPE")} - exported <= {
        "fmi3FullName",
        "fmi3Paste",
        "fmi3PasteB",
        "fmi3Version",
    }
    assert [n for n in needed if not SYSTEM.search(n) and "@rpath" not in n and not n.endswith(path.name)] == []


@pytest.mark.skipif(
    shutil.which("qemu-aarch64-static") is None or not ARM.exists(), reason="no emulator, or no C library for it"
)
def test_library_for_arm_moves_as_the_model_does(tmp_path: Path) -> None:
    system, description, path = library("aarch64-linux", tmp_path)
    references = {v.name: v.valueReference for v in description.modelVariables}
    target = ["-target", "aarch64-linux-gnu.2.28", "-O2", f"-I{HEADERS}"]
    host = Path(__file__).with_name("host.c")
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *target, str(host), "-ldl", "-o", "host"], check=True, cwd=tmp_path)
    numbers = [str(references[n]) for n in system.states]
    done = subprocess.run(
        ["qemu-aarch64-static", "-L", str(ARM), "./host", str(path), description.guid, *numbers],
        capture_output=True, text=True, cwd=tmp_path, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    expected = system.simulate(0.5, samples=2, rtol=1e-12, method="rk")
    np.testing.assert_allclose(
        [float(line) for line in done.stdout.split()], [expected[n][-1] for n in system.states], rtol=1e-7
    )
