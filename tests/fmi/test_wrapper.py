"""The C interface against the headers of the FMI standard, which FMPy brings along."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import fmpy
import pytest

from gearlib.fmi.binaries import WRAPPER
from gearlib.fmi.model_tables import record_header

HEADERS = Path(fmpy.__file__).parent / "c-code"


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("version", ["2", "3"])
def test_functions_are_those_of_the_standard(version: str, tmp_path: Path) -> None:
    """All of them are defined with the standard's signatures, and without its headers the types are the same."""
    (tmp_path / "record.h").write_text(record_header(), encoding="utf-8")
    face = WRAPPER / f"fmi{version}.c"
    command = ["cc", "-std=c11", "-Wall", "-Werror", "-fsyntax-only", f"-I{WRAPPER}", f"-I{tmp_path}", str(face)]
    header = HEADERS / f"fmi{version}Functions.h"
    for more in ([], ["-include", str(header)]):
        done = subprocess.run([*command, *more], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    text = face.read_text(encoding="utf-8")
    defined = set(re.findall(rf"^EXPORT .*?\b(fmi{version}\w+)\(", text, re.MULTILINE))
    for name in re.findall(r"^NO_TYPE\((\w+)", text, re.MULTILINE):
        defined |= {f"fmi{version}Get{name}", f"fmi{version}Set{name}"}
    declared = set(
        re.findall(rf"FMI{version}_Export fmi{version}\w+TYPE +(fmi{version}\w+);", header.read_text(encoding="utf-8"))
    )
    assert defined == declared
    assert len(declared) > 40
