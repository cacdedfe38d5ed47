"""FMUs of all kinds of scenes, on all platforms, many times: what takes longer."""

from __future__ import annotations

import gc
import math
import re
import shutil
import sys
import zipfile
from ctypes import c_double
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.compiler.platforms import PLATFORMS
from tests.benchmarks.scenes import Chain
from tests.fmi.fmu_instance import FmuInstance
from tests.golden.scenes import SCENES

OTHERS = {"pendulum", "measured_torque"}  # other states on the way; a table as an input
MAGIC = {".so": b"\x7fELF", ".dll": b"MZ", ".dylib": b"\xcf\xfa\xed\xfe"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SCENES) - OTHERS))
def test_every_golden_scene_moves_as_in_gearlib(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]
    system = gl.compile(scene.make(), scene.outputs)
    inputs = scene.options.get("inputs", {})
    path = system.export_fmu(tmp_path / "scene.fmu", inputs=inputs or None, stop_time=scene.t_end)
    assert validate_fmu(str(path)) == []
    names = list(scene.outputs or system.states)
    expected = system.simulate(scene.t_end, samples=101, rtol=1e-12, method="rk", **scene.options)
    events = np.array([math.inf, *(t for t, _ in expected.events)])
    clear = np.abs(expected.time[:, None] - events).min(axis=1) > 1e-6  # at an event a state may jump
    for kind, accuracy, outputs in (
        ("CoSimulation", 1e-6, 100),
        ("ModelExchange", 1e-5, 1000),
    ):  # CVode: 500 steps to an output
        found = fmpy.simulate_fmu(
            str(path), fmi_type=kind, stop_time=scene.t_end, output_interval=scene.t_end / outputs, relative_tolerance=1e-11,
            output=names, start_values=inputs, solver="CVode",
        )  # fmt: skip
        for column in names:
            values = np.interp(expected.time, found["time"], found[column])
            size = max(float(np.abs(expected[column]).max()), 1e-9)
            np.testing.assert_allclose(
                values[clear], expected[column][clear], rtol=0, atol=accuracy * size, err_msg=f"{kind}: {column}"
            )


@pytest.mark.slow
def test_a_chain_of_a_thousand_bodies(tmp_path: Path) -> None:
    """In co-simulation; in model exchange with CVode, whose dense Jacobian allows a short run only, and with SciPy."""
    system = gl.compile(Chain(N=1000), outputs=["body[0].w", "body[1].w", "shaft[0].tau"])
    path = system.export_fmu(tmp_path / "chain.fmu")
    for kind, rtol, t_end, accuracy in (("CoSimulation", 1e-10, 0.01, 1e-6), ("ModelExchange", 1e-11, 2e-4, 1e-5)):
        found = fmpy.simulate_fmu(
            str(path), fmi_type=kind, stop_time=t_end, output_interval=t_end / 10, relative_tolerance=rtol, solver="CVode",
            output=list(system.outputs),
        )  # fmt: skip
        expected = system.simulate(t_end, samples=11, rtol=1e-12, method="rk")
        for name in system.outputs:
            size = np.abs(expected[name]).max()
            np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=accuracy * size, err_msg=f"{kind}: {name}")

    one = FmuInstance(path, tmp_path / "content", "me")
    one.begin()
    n = len(system.states)
    x, rates = (c_double * n)(), (c_double * n)()

    def by_fmu(t: float, y: np.ndarray) -> np.ndarray:
        one.fmu.setTime(t)
        x[:] = y.tolist()
        one.fmu.setContinuousStates(x, n)
        one.fmu.getContinuousStateDerivatives(rates, n)
        return np.array(rates)

    one.fmu.getContinuousStates(x, n)
    run = solve_ivp(by_fmu, (0.0, 0.01), np.array(x), method="DOP853", rtol=1e-11, atol=1e-12)
    expected = system.simulate(0.01, samples=2, rtol=1e-12, method="rk")
    last = np.array([expected[name][-1] for name in system.states])
    np.testing.assert_allclose(run.y[:, -1], last, rtol=0, atol=1e-8 * np.abs(last).max())
    one.close()


@pytest.mark.slow
@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_one_file_holds_every_platform(version: str, tmp_path: Path) -> None:
    pytest.importorskip("ziglang")
    path = gl.compile(gp.ZhouCui2022(tau_in=100.0)).export_fmu(tmp_path / "xp.fmu", version=version, platforms="all")
    with zipfile.ZipFile(path) as archive:
        libraries = {n: archive.read(n)[:4] for n in archive.namelist() if n.startswith("binaries/")}
    assert len(libraries) == len(PLATFORMS)
    for name, start in libraries.items():
        assert start.startswith(MAGIC[Path(name).suffix]), name
    assert validate_fmu(str(path)) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the size of a process is read from /proc")
def test_instances_leave_nothing_behind(tmp_path: Path) -> None:
    path = gl.compile(gp.ZhouCui2022(tau_in=100.0)).export_fmu(tmp_path / "xp.fmu")

    def used() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    def lives() -> None:
        made: list[Any] = [FmuInstance(path, tmp_path / "content") for _ in range(100)]
        for one in made:
            one.begin()
            one.go(1e-3)
            memory = one.fmu.getFMUState()
            one.fmu.setFMUState(memory)
            one.fmu.freeFMUState(memory)
            one.close()

    (tmp_path / "content").mkdir()
    sizes = []
    for _ in range(12):
        lives()
        sizes.append(used())
    assert min(sizes[8:]) - max(sizes[:4]) < 4e6  # an instance takes some 30 kB; the allocator's share of it comes and goes


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the libraries of a process are read from /proc")
def test_a_hundred_fmus_in_one_process(tmp_path: Path) -> None:
    """Each with a library of its own, all at once; afterwards none is loaded any more, and their memory is given back."""
    path = gl.compile(gp.ZhouCui2022(tau_in=100.0)).export_fmu(tmp_path / "xp.fmu")
    fmpy.extract(str(path), str(tmp_path / "0"))
    for k in range(1, 100):
        shutil.copytree(tmp_path / "0", tmp_path / str(k))

    def loaded() -> int:
        return len(set(re.findall(rf"{re.escape(str(tmp_path))}\S+\.so", Path("/proc/self/maps").read_text())))

    def used() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    sizes = []
    for _ in range(3):
        every = [FmuInstance(path, tmp_path / str(k)) for k in range(100)]
        assert loaded() == 100
        for one in every:
            one.begin()
            one.go(1e-3)
        assert len({tuple(one.get("w_in", "w_out")) for one in every}) == 1
        for one in every:
            one.close()
        del every, one
        assert loaded() == 0
        sizes.append(used())
    assert sizes[2] - sizes[1] < 4e6
