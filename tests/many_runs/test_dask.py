"""Sweeps on a real cluster of dask: two worker processes over TCP, and one that is killed in the middle."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from tests.many_runs.models import Drive, peak, slow_peak

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("default"),  # of dask, tornado and the sockets that they close
]
distributed = pytest.importorskip("distributed")
OPTIONS: dict[str, Any] = {"inputs": {"torque.tau": 3.0}}


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    monkeypatch.setenv("GEARLIB_TEST_LOG", str(tmp_path / "log"))
    made = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, protocol="tcp", host="127.0.0.1", dashboard_address=None
    )
    client = distributed.Client(made)
    try:
        yield client
    finally:
        client.close()
        made.close()


def test_two_workers_give_the_same_numbers(cluster: Any) -> None:
    system, J = gl.compile(Drive()), np.linspace(0.5, 5.0, 200)
    wanted = system.sweep({"J": J}, 1.0, samples=11, outputs=["load.w"], reduce={"peak": peak}, **OPTIONS)
    with cluster.get_executor() as executor:
        found = system.sweep({"J": J}, 1.0, samples=11, outputs=["load.w"], reduce={"peak": peak}, executor=executor, **OPTIONS)
        modes = gl.sweep(gl.modes, system, {"J": J[:20]}, executor=executor)
    assert found["load.w"].tobytes() == wanted["load.w"].tobytes()
    assert found["peak"].tobytes() == wanted["peak"].tobytes()
    assert modes["frequencies"].tobytes() == gl.sweep(gl.modes, system, {"J": J[:20]})["frequencies"].tobytes()


def test_a_worker_that_is_killed_loses_nothing(cluster: Any, tmp_path: Path) -> None:
    system, J = gl.compile(Drive()), np.linspace(0.5, 5.0, 150)
    pids = list(cluster.run(os.getpid).values())
    killed: list[int] = []

    def kill_one(fraction: float, _: float) -> None:
        if fraction > 0.2 and not killed:
            killed.append(pids[0])
            os.kill(pids[0], 9)

    with cluster.get_executor() as executor:
        begin = time.monotonic()
        found = system.sweep(
            {"J": J},
            1.0,
            reduce={"peak": slow_peak},
            executor=executor,
            progress=kill_one,
            to=tmp_path / "runs.zarr",
            **OPTIONS,
        )
    assert killed, time.monotonic() - begin
    assert found.done.all()
    assert not found.errors
    wanted = system.sweep({"J": J}, 1.0, reduce={"peak": peak}, **OPTIONS)
    assert found["peak"].tobytes() == wanted["peak"].tobytes()
