"""Linear sweeps by exponentials of many matrices at once: the runs of `simulate`, to rounding."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BoundError, GearlibWarning
from gearlib.many_runs import side_by_side
from tests.many_runs.models import Drive

J = np.linspace(0.5, 4.0, 11)
HOW = "matrix exponentials of many runs at once"


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive(), outputs=["load.w", "shaft.tau"])


@pytest.fixture(scope="module")
def train() -> gl.System:
    return gl.compile(gp.ZhouCui2022(), outputs=["w_out", "q_ring"])


def close(found: Any, wanted: Any, digits: float = 1e-11) -> bool:
    return bool(np.abs(found - wanted).max() <= digits * np.abs(wanted).max())


@pytest.mark.parametrize("method", ["auto", "exact"])
@pytest.mark.parametrize(
    "torque",
    [
        3.0,
        gl.Table([0.0, 0.31, 0.4, 1.0], [0.0, 4.0, -2.0, 1.0]),
        gl.Table([0.0, 0.05, 0.2], [0.0, 5.0, 0.0], outside="periodic"),
    ],
)
def test_runs_are_those_of_simulate(drive: gl.System, method: str, torque: Any) -> None:
    varied = {"J": J, "shaft.c": 100.0 * J[::-1], "start(load.w)": -J}
    runs = drive.sweep(varied, 1.0, samples=21, method=method, inputs={"torque.tau": torque})
    assert (runs.stats["lanes"], runs.stats["why"]) == (1, HOW)
    for k in (0, 4, 10):
        single = drive.simulate(
            1.0, samples=21, method="exact", inputs={"torque.tau": torque}, start={"load.w": -J[k]},
            parameters={"J": J[k], "shaft.c": varied["shaft.c"][k]},
        )  # fmt: skip
        for name in ("load.w", "shaft.tau"):
            assert close(runs[name][k], single[name])


def test_statistics_of_a_run_by_exponentials(drive: gl.System) -> None:
    """No step, no evaluation; eight runs at least are done at once."""

    def told(result: gl.Result) -> list[float]:
        s = result.stats
        assert s["method"] == "exact"
        assert s["why"].startswith("the scene is linear")
        return [s["steps"], s["rhs"], s["events"], s["states"]]

    runs = drive.sweep({"J": J}, 1.0, samples=3, reduce={"told": told}, inputs={"torque.tau": 3.0})
    assert runs["told"].tolist() == [[0.0, 0.0, 0.0, float(len(drive.states))]] * len(J)


@pytest.mark.parametrize("times", [[0.02], [0.0, 0.001, 0.0013, 0.05], np.linspace(0.0, 0.05, 300)])
def test_the_papers_train_at_any_times(train: gl.System, times: Any) -> None:
    options: dict[str, Any] = {"times": times, "inputs": {"tau_in": 100.0}}
    stiffness = np.geomspace(1e6, 1e10, 9)  # each with doublings of its own
    runs = train.sweep({"K_g": stiffness}, 0.05, **options)
    assert runs.stats["why"] == HOW
    for k in (0, 3, 8):
        single = train.simulate(0.05, parameters={"K_g": stiffness[k]}, **options)
        for name in ("w_out", "q_ring"):
            assert close(runs[name][k], single[name], 1e-10)


def test_transmission_errors_that_vary_are_runs_by_themselves(train: gl.System) -> None:
    """What time drives is the same in all runs that are done at once; amplitudes, too."""
    varied = {"e_omega": np.where(np.arange(9) == 5, 40.0, 28.0)}
    runs = train.sweep(varied, 0.05, samples=11, inputs={"tau_in": 100.0})
    for k in (4, 5):
        single = train.simulate(0.05, samples=11, inputs={"tau_in": 100.0}, parameters={"e_omega": varied["e_omega"][k]})
        assert close(runs["q_ring"][k], single["q_ring"])


def test_a_run_is_the_same_whatever_its_neighbours_are(train: gl.System) -> None:
    stiffness, options = np.geomspace(1e6, 1e10, 130), {"samples": 41, "inputs": {"tau_in": 100.0}}
    whole = train.sweep({"K_g": stiffness}, 0.02, **options)["q_ring"]
    turned = train.sweep({"K_g": stiffness[::-1]}, 0.02, **options)["q_ring"][::-1]
    with ThreadPoolExecutor(2) as pool:
        shared = train.sweep({"K_g": stiffness}, 0.02, executor=pool, **options)["q_ring"]
    assert whole.tobytes() == turned.tobytes() == shared.tobytes()


def test_ends_and_peaks_need_no_results(train: gl.System) -> None:
    options: dict[str, Any] = {"samples": 101, "inputs": {"tau_in": 100.0}}
    reduce = {"end": gl.final("w_out"), "peak": gl.peak("q_ring")}
    runs = train.sweep({"I_r": J}, 0.05, reduce=reduce, **options)
    alone = train.sweep({"I_r": J}, 0.05, reduce=reduce, lanes=1, **options)
    own = {"end": lambda r: r["w_out"][-1], "peak": lambda r: abs(r["q_ring"]).max()}
    results = train.sweep({"I_r": J}, 0.05, reduce=own, **options)
    assert [r.stats["why"] for r in (runs, alone, results)] == [HOW, "asked for", HOW]
    for name in ("end", "peak"):
        assert close(runs[name], alone[name])
        assert close(runs[name], results[name])


def test_reductions_of_what_is_no_state(drive: gl.System) -> None:
    runs = drive.sweep({"J": J}, 1.0, samples=21, reduce={"peak": gl.peak("shaft.tau")}, inputs={"torque.tau": 3.0})
    single = drive.simulate(1.0, samples=21, parameters={"J": J[3]}, inputs={"torque.tau": 3.0})
    assert runs["peak"][3] == pytest.approx(np.abs(single["shaft.tau"]).max(), rel=1e-11)


def test_runs_that_fail_or_do_not_fit_are_carried_out_by_themselves(drive: gl.System) -> None:
    masses = np.where(J[3] == J, -1.0, 0.5)
    masses[5] = 0.0  # another translation
    options: dict[str, Any] = {"samples": 5, "inputs": {"torque.tau": 3.0}}
    with pytest.warns(GearlibWarning, match=r"1 of 11 runs failed.*run 3: motor.J is -1"):
        runs = drive.sweep({"J": J, "motor.J": masses}, 1.0, **options)
    assert isinstance(runs.errors[3], BoundError)
    single = drive.simulate(1.0, parameters={"J": J[5], "motor.J": 0.0}, **options)
    assert runs["load.w"][5].tobytes() == single["load.w"].tobytes()
    assert np.isfinite(runs["load.w"]).all(axis=1).tolist() == [k != 3 for k in range(11)]


@pytest.mark.parametrize("options", [{}, {"lanes": 8}, {"method": "rk5"}, {"inputs": {"torque.tau": lambda t: 0.0 * t}}])
def test_whether_a_sweep_is_linear_is_found_out_once(
    drive: gl.System, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    asked: list[Any] = []
    forms = side_by_side.linear_forms
    monkeypatch.setattr(side_by_side, "linear_forms", lambda *given: asked.append(given) or forms(*given))
    drive.sweep({"J": J}, 0.1, samples=3, **{"inputs": {"torque.tau": 1.0}, **options})
    assert len(asked) == (1 if "method" not in options else 0)


@pytest.mark.parametrize(("method", "digits"), [("auto", 1e-12), ("rk5", 0.0)])
@pytest.mark.parametrize("times", [np.linspace(0.0, 1.0, 21), np.array([0.3, 0.7, 1.0]), np.array([1.0])])
def test_the_last_value_takes_no_other_samples(
    drive: gl.System, monkeypatch: pytest.MonkeyPatch, method: str, digits: float, times: Any
) -> None:
    """Steps do not depend on samples; exponentials differ by rounding."""
    kept: list[int] = []
    results = side_by_side.SideBySide.results

    def watched(*given: Any) -> Any:
        for found in results(*given):
            kept.append(found.states.shape[1])
            yield found

    table = gl.Table([0.0, 0.31, 0.4, 1.0], [0.0, 4.0, -2.0, 1.0])
    options: dict[str, Any] = {"times": times, "method": method, "inputs": {"torque.tau": table}}
    histories = drive.sweep({"J": J}, 1.0, outputs=["load.w"], **options)["load.w"]
    monkeypatch.setattr(side_by_side.SideBySide, "results", watched)
    ends = drive.sweep({"J": J}, 1.0, reduce={"end": gl.final("load.w")}, **options)
    assert close(ends["end"], histories[:, -1], digits)
    assert set(kept) == {1}


def test_files_are_filled_batch_by_batch(drive: gl.System, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches of 4 runs come after one another; run 6 does not fit, being another translation."""
    varied = {"J": J, "motor.J": np.where(J[6] == J, 0.0, 0.5)}
    options: dict[str, Any] = {"samples": 5, "inputs": {"torque.tau": 3.0}, "outputs": ["load.w"]}
    memory = drive.sweep(varied, 1.0, **options)
    for name in ("LANES", "AT_ONCE"):
        monkeypatch.setattr(side_by_side, name, 4)
    there = drive.sweep(varied, 1.0, to=tmp_path / "sweep.zarr", **options)
    assert there.stats["done"] == len(J)
    assert close(there["load.w"], memory["load.w"])
