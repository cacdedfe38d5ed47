"""The library for Windows runs under wine, where that is installed, and moves as the model does in gearlib."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

HEADERS = Path(fmpy.__file__).parent / "c-code"  # those of the standard
pytestmark = [pytest.mark.slow, pytest.mark.skipif(shutil.which("wine") is None, reason="wine is not installed")]


def test_library_for_windows_moves_as_the_model_does(tmp_path: Path) -> None:
    pytest.importorskip("ziglang")
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0))
    path = system.export_fmu(tmp_path / "xp.fmu", platforms=["x86_64-windows"], kind="cs")
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmpy.extract(str(path), str(tmp_path / "content"))
    host = Path(__file__).with_name("host.c")
    target = ["-target", "x86_64-windows-gnu", "-O2", f"-I{HEADERS}"]
    command = [sys.executable, "-m", "ziglang", "cc", *target, str(host), "-o", "host.exe"]
    subprocess.run(command, check=True, cwd=tmp_path)
    done = subprocess.run(
        ["wine", "host.exe", r"content\binaries\x86_64-windows\xp.dll", description.guid, *(str(references[n]) for n in system.states)],
        capture_output=True, text=True, cwd=tmp_path, check=False,
        env={**os.environ, "WINEPREFIX": str(tmp_path / "prefix"), "WINEDEBUG": "-all"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    expected = system.simulate(0.5, samples=2, rtol=1e-12, method="rk")
    found = [float(line) for line in done.stdout.split()]
    np.testing.assert_allclose(found, [expected[n][-1] for n in system.states], rtol=1e-7)
