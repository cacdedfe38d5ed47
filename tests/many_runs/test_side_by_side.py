"""Runs side by side, by exponentials or in lanes: what is kept of them, at which times, and what they begin with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import InputWarning
from gearlib.many_runs.by_exponentials import ExactSweep
from tests.many_runs.models import Drive
from tests.many_runs.test_simulating import J, task


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive(), outputs=["load.w", "shaft.tau"])


def test_what_is_kept_of_runs_side_by_side(drive: gl.System) -> None:
    """Histories of states alone need no results, nor do their last values; what is made of anything else does."""
    varied, scene = {"J": J}, drive.translation.scene
    place = scene.place_of[scene.named("load.w")[0]]
    for outputs, reduce, whole, kept, last in (
        (["load.w"], None, False, (place,), False),
        ([], {"end": gl.final("load.w")}, False, (place,), True),
        ([], {"end": gl.final("load.w"), "top": gl.peak("load.w")}, False, (place,), False),
        (["load.w"], {"end": gl.final("load.w")}, False, (place,), False),
        (["load.w", "shaft.tau"], None, True, (), False),
        ([], {"end": gl.final("shaft.tau")}, True, (), False),
        ([], {"n": len, "end": gl.final("load.w")}, True, (), False),
    ):
        engine = task(drive, varied, outputs=outputs, reduce=reduce).together_by
        assert isinstance(engine, ExactSweep)
        assert (engine.whole, engine.kept, engine.last) == (whole, kept, last)
        count = len(scene.states) if whole else 1
        assert len(engine.columns) == count
        assert len(engine.sampled) == (2 if last else 5)
        assert engine.column("load.w") == (-1 if whole else 0)
        assert engine.column("shaft.tau") == -1


@pytest.mark.parametrize("times", [[0.5, 1.0], [0.0, 0.9, 1.0]])
def test_a_periodic_input_repeats_from_the_start_to_the_last_sample(drive: gl.System, times: list[float]) -> None:
    """Its periods before the first sample count as well: they move what is sampled then."""

    def wave() -> gl.Table:
        return gl.Table([0.0, 0.05, 0.2], [0.0, 5.0, 0.0], outside="periodic")

    options: dict[str, Any] = {"samples": None, "times": times}
    engine = task(drive, {"J": J}, outputs=["load.w"], inputs={"torque.tau": wave()}, **options).together_by
    assert isinstance(engine, ExactSweep)
    (repeated,) = (s for s in engine.signals if isinstance(s, gl.Table))
    assert repeated.t[0] <= 0.0
    assert repeated.t[-1] >= 1.0
    runs = drive.sweep({"J": J}, 1.0, times=times, inputs={"torque.tau": wave()})
    for k in (0, len(J) - 1):
        single = drive.simulate(
            1.0,
            times=np.linspace(0.0, 1.0, 11),
            parameters={"J": J[k]},
            inputs={"torque.tau": wave()},
            method="rk8",
            rtol=1e-10,
        )
        expected = [single["load.w"][round(10 * t)] for t in times]
        assert runs["load.w"][k] == pytest.approx(expected, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(
    ("times", "grid", "hidden", "of_the_last"),
    [
        ([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], 0, ([0.0, 1.0], 1)),
        ([0.5, 1.0], [0.0, 0.5, 1.0], 1, ([0.0, 1.0], 1)),
        ([1.0], [0.0, 1.0], 1, ([0.0, 1.0], 1)),
        ([0.0, 1.0], [0.0, 1.0], 0, ([0.0, 1.0], 0)),
    ],
)
def test_times_at_which_runs_are_computed(drive: gl.System, times: Any, grid: Any, hidden: int, of_the_last: Any) -> None:
    """The start comes before them, and is hidden; for the last value no others are needed."""
    options: dict[str, Any] = {"samples": None, "times": times}
    whole = task(drive, {"J": J}, outputs=["load.w"], **options).together_by
    last = task(drive, {"J": J}, reduce={"end": gl.final("load.w")}, outputs=[], **options).together_by
    assert isinstance(whole, ExactSweep)
    assert isinstance(last, ExactSweep)
    assert (whole.grid.tolist(), whole.sampled.tolist(), whole.hidden) == (grid, grid, hidden)
    assert (last.grid.tolist(), last.sampled.tolist(), last.hidden) == (grid, *of_the_last)


@pytest.mark.parametrize("start", [{"load.w": 3.0}, "steady"])
@pytest.mark.parametrize("method", ["exact", "rk5"])
def test_runs_begin_where_all_are_told_to(drive: gl.System, method: str, start: Any) -> None:
    options: dict[str, Any] = {"samples": 5, "method": method, "start": start, "inputs": {"torque.tau": 3.0}}
    runs = drive.sweep({"J": J, "brake.d": 0.1 * J}, 1.0, **options)
    for k in (0, 10):
        single = drive.simulate(1.0, parameters={"J": J[k], "brake.d": 0.1 * J[k]}, **options)
        assert runs["load.w"][k] == pytest.approx(single["load.w"], rel=1e-5)
        assert runs["load.w"][k][0] == pytest.approx(3.0 if start != "steady" else 30.0 / J[k], rel=1e-9)


@pytest.mark.parametrize("method", ["exact", "rk5"])
def test_start_values_that_vary_complete_those_of_all_runs(drive: gl.System, method: str) -> None:
    options: dict[str, Any] = {"samples": 5, "method": method, "inputs": {"torque.tau": 3.0}}
    runs = drive.sweep({"start(load.w)": J}, 1.0, start={"motor.w": 20.0}, **options)
    single = drive.simulate(1.0, start={"motor.w": 20.0, "load.w": J[7]}, **options)
    assert runs["load.w"][7] == pytest.approx(single["load.w"], rel=1e-5)
    assert np.abs(runs["load.w"][7] - drive.simulate(1.0, start={"load.w": J[7]}, **options)["load.w"]).max() > 0.1


@pytest.mark.parametrize("method", ["exact", "rk5"])
def test_start_values_alone_may_vary(drive: gl.System, method: str) -> None:
    options: dict[str, Any] = {"samples": 5, "method": method, "inputs": {"torque.tau": 3.0}}
    runs = drive.sweep({"start(load.w)": J}, 1.0, **options)
    assert runs["load.w"][:, 0].tolist() == J.tolist()
    single = drive.simulate(1.0, start={"load.w": J[7]}, **options)
    assert runs["load.w"][7] == pytest.approx(single["load.w"], rel=1e-5)


@pytest.mark.parametrize("method", ["exact", "rk5"])
def test_inputs_that_are_not_given_are_zero(drive: gl.System, method: str) -> None:
    with pytest.warns(InputWarning, match="0 in all runs of this sweep"):
        runs = drive.sweep({"J": J}, 1.0, samples=5, method=method)
    zero = drive.sweep({"J": J}, 1.0, samples=5, method=method, inputs={"torque.tau": 0.0})
    assert runs["load.w"].tobytes() == zero["load.w"].tobytes()
    assert (np.diff(runs["load.w"][:, [0, -1]], axis=1) < 0).all()  # the brake slows the load
