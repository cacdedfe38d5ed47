"""`System.sweep`: each run is that of `simulate`, bit for bit; what varies in every form; failures, warnings, shapes and tables."""

from __future__ import annotations

import warnings
from time import sleep
from typing import Any

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BoundError, GearlibWarning, InputWarning, NameLookupError
from tests.many_runs.models import Drive, Rattle, Thermostat, peak

TORQUE = {"torque.tau": 3.0}


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive())


@pytest.fixture(scope="module")
def rattle() -> gl.System:
    return gl.compile(Rattle(), outputs=["load.w", "gap.tau"])


# ---------------------------------------------------------------- the same as single runs


@pytest.mark.parametrize("method", ["auto", "exact", "rk5", "rk8", "ida"])
def test_linear_runs_are_single_runs(drive: gl.System, method: str) -> None:
    J, c = [0.5, 1.0, 2.0, 4.0], [300.0, 500.0, 200.0, 900.0]
    options: dict[str, Any] = {"samples": 21, "method": method, "rtol": 1e-8, "inputs": TORQUE}
    runs = drive.sweep({"J": J, "shaft.c": c}, 1.0, outputs=["load.w", "shaft.tau"], **options)
    for k in range(4):
        single = drive.simulate(1.0, parameters={"J": J[k], "shaft.c": c[k]}, **options)
        for name in ("load.w", "shaft.tau"):
            assert runs[name][k].tobytes() == single[name].tobytes()


@settings(max_examples=8)
@given(data=st.data())
def test_any_sweep_is_single_runs(data: st.DataObject, drive: gl.System, rattle: gl.System) -> None:
    thermostat = gl.compile(Thermostat())
    system, ranges, inputs = data.draw(
        st.sampled_from(
            [
                (
                    drive,
                    {"J": (0.1, 9.0), "shaft.c": (10.0, 900.0), "start(load.w)": (-5.0, 5.0), "torque.tau": (-9.0, 9.0)},
                    None,
                ),
                (rattle, {"gap.b": (0.0, 0.1), "load.J": (0.1, 2.0), "start(motor.w)": (0.0, 3.0)}, None),
                (thermostat, {"power": (1.0, 9.0), "start(T)": (15.0, 25.0)}, None),
            ]
        )
    )
    names = data.draw(st.lists(st.sampled_from(sorted(ranges)), min_size=1, unique=True))
    values = {n: data.draw(st.lists(st.floats(*ranges[n]), min_size=3, max_size=3), label=n) for n in names}
    if system is drive and "torque.tau" not in names:
        inputs = {"torque.tau": gl.Table([0, 0.5, 1], [0, 4, 1])}
    outputs = [system.outputs[0] if system.outputs else system.states[-1]]
    runs = system.sweep(values, 2.0, samples=11, outputs=outputs, inputs=inputs)
    for k in range(3):
        given_: dict[str, dict[str, float]] = {"parameters": {}, "start": {}, "inputs": dict(inputs or {})}
        for name, column in values.items():
            kind = "start" if name.startswith("start(") else "inputs" if name == "torque.tau" else "parameters"
            given_[kind][name.removeprefix("start(").removesuffix(")") if kind == "start" else name] = column[k]
        single = system.simulate(2.0, samples=11, **{kind: found or None for kind, found in given_.items()})
        assert runs[outputs[0]][k].tobytes() == single[outputs[0]].tobytes()


def test_a_table_for_each_run(drive: gl.System) -> None:
    tables = [gl.Table([0, 1], [0, k]) for k in (1.0, 2.0, 5.0)]
    runs = drive.sweep({"torque.tau": tables, "J": [1.0, 2.0, 3.0]}, 1.0, samples=5, outputs=["load.w"])
    for k, table in enumerate(tables):
        single = drive.simulate(1.0, samples=5, inputs={"torque.tau": table}, parameters={"J": k + 1.0})
        assert runs["load.w"][k].tobytes() == single["load.w"].tobytes()
    assert runs.parameters["torque.tau"] == tables


def test_parameters_that_are_zero_in_some_runs_translate_the_model_again(drive: gl.System) -> None:
    runs = drive.sweep({"motor.J": [0.5, 0.0, 0.5]}, 1.0, samples=5, outputs=["load.w"], inputs=TORQUE)
    single = drive.simulate(1.0, samples=5, parameters={"motor.J": 0.0}, inputs=TORQUE)
    assert runs["load.w"][1].tobytes() == single["load.w"].tobytes()
    assert runs["load.w"][0].tobytes() == runs["load.w"][2].tobytes()


def test_start_values_that_all_runs_share(drive: gl.System) -> None:
    """Among the parameters as a single number; they complete those of ``start``."""
    runs = drive.sweep(
        {"J": [1.0, 2.0], "start(load.w)": 3.0}, 1.0, samples=5, outputs=["load.w"], start={"motor.w": 2.0}, inputs=TORQUE
    )
    single = drive.simulate(1.0, samples=5, parameters={"J": 2.0}, start={"motor.w": 2.0, "load.w": 3.0}, inputs=TORQUE)
    assert runs["load.w"][1].tobytes() == single["load.w"].tobytes()
    assert runs.parameters["start(load.w)"] == 3.0
    with pytest.raises(ArgumentError) as said:
        drive.sweep({"J": [1.0, 2.0], "start(load.w)": 3.0}, 1.0, start="steady", inputs=TORQUE)
    assert str(said.value) == "parameters give load.w a start value, and start='steady' gives all of them"
    for values in ([3.0, 4.0], 3.0):
        with pytest.raises(ArgumentError) as said:
            drive.sweep({"J": [1.0, 2.0], "start(load.w)": values}, 1.0, start={"load.w": 2.0}, inputs=TORQUE)
        assert str(said.value) == "the start value of load.w is given in parameters and in start; give it once"


def test_runs_go_on_from_another_run(drive: gl.System) -> None:
    first = drive.simulate(1.0, inputs=TORQUE)
    runs = drive.sweep({"J": [1.0, 2.0]}, 2.0, start=first, samples=5, outputs=["load.w"])
    single = drive.simulate(2.0, start=first, samples=5, parameters={"J": 1.0}, inputs=TORQUE)
    assert runs["load.w"][0].tobytes() == single["load.w"].tobytes()


# ---------------------------------------------------------------- what varies, in every form


def test_a_grid_has_an_axis_for_each_parameter(drive: gl.System) -> None:
    J, c, tau = [1.0, 2.0, 3.0], [100.0, 200.0], 3.0
    varied = gl.grid({"shaft.c": c, "torque.tau": tau}, J=J)
    runs = drive.sweep(varied, 1.0, samples=7, outputs=["load.w"], reduce={"peak": peak})
    assert runs.shape == (2, 3)
    assert runs["load.w"].shape == (2, 3, 7)
    assert runs["peak"].shape == runs.done.shape == runs["J"].shape == (2, 3)
    assert np.array(runs.parameters["J"]).tolist() == [J, J]
    assert np.array(runs.parameters["shaft.c"]).tolist() == [[100.0] * 3, [200.0] * 3]
    assert runs.parameters["torque.tau"] == tau
    single = drive.simulate(1.0, samples=7, parameters={"J": 3.0, "shaft.c": 100.0}, inputs=TORQUE)
    assert runs["load.w"][0, 2].tobytes() == single["load.w"].tobytes()
    assert runs["peak"][0, 2] == peak(single)
    table = runs.to_xarray()
    assert table["load.w"].dims == ("shaft.c", "J", "time")
    assert table["load.w"].sel({"shaft.c": 100.0, "J": 3.0}).values.tolist() == single["load.w"].tolist()
    assert table["load.w"].attrs["units"] == "rad/s"
    assert table["J"].attrs["units"] == "kg.m2"
    assert table.attrs["torque.tau"] == 3.0


def test_tables_and_arrays_of_samples(drive: gl.System) -> None:
    values = {"J": [1.0, 2.0, 3.0, 4.0], "shaft.c": [100.0, 200.0, 300.0, 400.0]}
    wanted = drive.sweep(values, 0.5, samples=3, inputs=TORQUE)["load.w"]
    frame = drive.sweep(pandas.DataFrame(values), 0.5, samples=3, inputs=TORQUE)
    array = drive.sweep(np.array([*values.values()]).T, 0.5, names=[*values], samples=3, inputs=TORQUE)
    assert frame["load.w"].tobytes() == array["load.w"].tobytes() == wanted.tobytes()
    drawn = qmc.scale(qmc.Sobol(2, seed=1).random(8), [0.5, 100.0], [4.0, 900.0])
    runs = drive.sweep(drawn, 0.5, names=["J", "shaft.c"], samples=3, inputs=TORQUE)
    single = drive.simulate(0.5, samples=3, parameters={"J": drawn[5, 0], "shaft.c": drawn[5, 1]}, inputs=TORQUE)
    assert np.allclose(runs["load.w"][5], single["load.w"], rtol=1e-12, atol=1e-12)


def test_what_was_kept_is_not_changed_by_its_reader(drive: gl.System) -> None:
    runs = drive.sweep({"J": [0.5, 1.0]}, 1.0, outputs=["load.w"], samples=3, inputs=TORQUE)
    for array in (runs["load.w"], runs["J"], runs.parameters["J"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_one_run_where_nothing_varies(drive: gl.System) -> None:
    runs = drive.sweep({"J": 3.0}, 1.0, samples=3, outputs=["load.w"], inputs=TORQUE)
    assert runs["load.w"].shape == (1, 3)
    assert drive.sweep({}, 1.0, samples=3, outputs=["load.w"], inputs=TORQUE)["load.w"].shape == (1, 3)


# ---------------------------------------------------------------- what comes back


def test_reduce_keeps_what_is_asked_and_nothing_else(drive: gl.System) -> None:
    end = {"end": lambda r: [r["load.w"][-1], r["motor.w"][-1]], "rises": lambda r: r["load.w"][-1] > r["load.w"][0]}
    runs = drive.sweep({"J": [1.0, 2.0]}, 1.0, reduce=end, inputs=TORQUE)
    assert runs.keys() == ["end", "rises"]
    assert runs["end"].shape == (2, 2)
    assert runs["rises"].tolist() == [1.0, 1.0]
    with pytest.raises(NameLookupError, match="no histories"):
        _ = runs.time
    with pytest.raises(NameLookupError, match=r"nothing of the name 'load\.w'"):
        _ = runs["load.w"]


def test_a_table_has_a_row_for_each_run_or_each_time(drive: gl.System) -> None:
    short = drive.sweep({"J": [1.0, 2.0]}, 1.0, reduce={"peak": peak}, inputs=TORQUE).to_dataframe()
    assert short.columns.tolist() == ["J", "peak"]
    assert len(short) == 2
    runs = drive.sweep({"J": [1.0, 2.0]}, 1.0, samples=3, outputs=["load.w"], reduce={"peak": peak}, inputs=TORQUE)
    long = runs.to_dataframe()
    assert long["time"].tolist() == [0.0, 0.5, 1.0] * 2
    assert long["load.w"].tolist() == runs["load.w"].ravel().tolist()
    assert long["peak"].tolist() == np.repeat(runs["peak"], 3).tolist()
    with pytest.raises(ArgumentError, match=r"end has axes of its own.*to_xarray"):
        drive.sweep({"J": [1.0]}, 1.0, reduce={"end": lambda r: r["load.w"][-2:]}, inputs=TORQUE).to_dataframe()


def test_runs_that_fail_are_nan_and_named_and_the_others_go_on(drive: gl.System) -> None:
    with pytest.warns(GearlibWarning, match=r"1 of 3 runs failed and are NaN; runs\.errors says why: run 1: J is -1"):
        runs = drive.sweep({"J": [1.0, -1.0, 2.0]}, 1.0, samples=3, outputs=["load.w"], reduce={"peak": peak}, inputs=TORQUE)
    assert list(runs.errors) == [1]
    assert isinstance(runs.errors[1], BoundError)
    assert np.isnan(runs["load.w"][1]).all()
    assert np.isnan(runs["peak"][1])
    assert np.isfinite(runs["load.w"][[0, 2]]).all()
    with pytest.warns(GearlibWarning, match=r"run \(0, 1\)"):
        square = drive.sweep(gl.grid({"J": [1.0, 2.0], "shaft.c": [1.0, -1.0]}), 1.0, samples=3, inputs=TORQUE)
    assert list(square.errors) == [(0, 1), (1, 1)]


def test_the_first_run_may_fail(drive: gl.System) -> None:
    with pytest.warns(GearlibWarning, match="1 of 2"):
        runs = drive.sweep({"J": [-1.0, 2.0]}, 1.0, samples=3, outputs=["load.w"], inputs=TORQUE)
    assert np.isnan(runs["load.w"][0]).all()
    assert np.isfinite(runs["load.w"][1]).all()


def test_where_all_runs_fail_the_first_error_is_raised(drive: gl.System) -> None:
    with pytest.raises(BoundError, match="J is -1"):
        drive.sweep({"J": [-1.0, -2.0]}, 1.0, inputs=TORQUE)


def test_a_function_that_fails_in_one_run(drive: gl.System) -> None:
    def ratio(result: Any) -> float:
        return 1.0 / (float(result.request.parameters.max()) != 500.0)

    with pytest.warns(GearlibWarning, match=r"reduce\['ratio'\] raised ZeroDivisionError"):
        runs = drive.sweep({"shaft.c": [400.0, 500.0]}, 1.0, reduce={"ratio": ratio}, inputs=TORQUE)
    assert list(runs.errors) == [1]
    lengths = iter((2, 3, 2))
    with pytest.warns(GearlibWarning, match=r"has the shape \(3,\) in this run and \(2,\) in the first one"):
        runs = drive.sweep({"J": [1.0, 2.0, 3.0]}, 1.0, reduce={"n": lambda r: np.zeros(next(lengths))}, inputs=TORQUE)
    assert list(runs.errors) == [1]


def test_warnings_come_once(drive: gl.System) -> None:
    with pytest.warns(InputWarning, match="0 in all runs of this sweep") as told:
        drive.sweep({"J": np.linspace(1, 2, 5)}, 1.0, samples=3)
    assert len(told) == 1

    def grumble(result: Any) -> float:
        warnings.warn(f"the load turns at {result['load.w'][-1]:.3f} rad/s", RuntimeWarning, stacklevel=1)
        return 0.0

    with pytest.warns(RuntimeWarning, match=r"the load turns at .* \(in 5 runs\)") as told:
        drive.sweep({"J": np.linspace(1, 2, 5)}, 1.0, reduce={"none": grumble}, inputs=TORQUE)
    assert len(told) == 1


def test_an_input_that_varies_is_given(drive: gl.System) -> None:
    assert drive.sweep({"torque.tau": [1.0, 2.0]}, 1.0, samples=3)["load.w"].shape == (2, 3)


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("parameters", "more", "message"),
    [
        (
            {"J": [1, 2], "shaft.c": [1, 2, 3]},
            {},
            r"must be equally long, got J 2, shaft\.c 3; for all combinations give gl\.grid",
        ),
        ({"J": []}, {}, "there is no run"),
        ({"J": ["a", "b"]}, {}, r"parameters\['J'\] is \['a', 'b'\]; expected a number, or a sequence"),
        ({"J": [1.0, float("nan")]}, {}, r"parameters\['J'\]"),
        ({"K": [1, 2]}, {}, "the model has no parameter 'K'"),
        ({"start(lod.w)": [1, 2]}, {}, r"no variable 'lod\.w'"),
        (np.ones((3, 2)), {}, r"say what its columns are: names="),
        (np.ones((3, 2)), {"names": ["J"]}, r"shape \(3, 2\); expected an array"),
        (3.0, {}, "parameters is 3.0; expected values by path"),
        ({"J": [1, 2]}, {"outputs": ["lod.w"]}, r"no variable 'lod\.w'"),
        ({"J": [1, 2]}, {"outputs": "load.w"}, "outputs is 'load.w'; expected a list of names"),
        ({"J": [1, 2]}, {"outputs": []}, "outputs is empty, and so is reduce"),
        ({"J": [1, 2]}, {"reduce": {"peak": 3}}, r"reduce\['peak'\] is 3; expected a function"),
        ({"J": [1, 2]}, {"reduce": {"J": peak}}, "J is given to the runs and is a result, too; give the result another name"),
        ({"J": 2.0}, {"reduce": {"run": peak}}, "run is a result and is an axis of the results, too"),
        ({"J": 2.0}, {"outputs": ["load.w"], "reduce": {"time": peak}}, "time is a result and is an axis of the results, too"),
        ({"J": [1, 2]}, {"executor": 4}, "executor is 4; expected a concurrent.futures.Executor"),
        ({"J": [1, 2]}, {"threads": 0}, "threads is 0"),
        ({"J": [1, 2]}, {"to": "runs.csv"}, r"expected a path that ends in \.zarr or \.nc"),
        ({"J": [1, 2]}, {"progress": "yes"}, "progress is 'yes'; expected True, False, or a function"),
        ({"J": [1, 2], "torque.tau": [1, 2]}, {}, "is given in parameters and in inputs"),
        (
            {"J": [1, 2]},
            {"inputs": 3.0},
            r"inputs is 3\.0; expected a mapping of paths to numbers, functions of time or tables",
        ),
        ({"start(load.w)": [1, 2]}, {"start": "steady"}, "fixes all start values"),
        ({"J": [1, 2], "torque.tau": [gl.Table([0, 1], [0, 1]), "x"]}, {"inputs": None}, r"holds 'x'; expected"),
    ],
)
def test_what_is_wrong_is_named(drive: gl.System, parameters: Any, more: dict[str, Any], message: str) -> None:
    with pytest.raises(gl.GearlibError, match=message):
        drive.sweep(parameters, 1.0, **({"inputs": TORQUE} | more))


def test_the_papers_train() -> None:
    system = gl.compile(gp.ZhouCui2022(), outputs=["w_out"])
    K_g = np.linspace(1e8, 3e8, 3)
    options: dict[str, Any] = {"samples": 51, "inputs": {"tau_in": 100.0}}
    for method in ("auto", "rk5"):
        runs = system.sweep({"K_g": K_g, "I_r": 0.3}, 0.05, outputs=["w_out", "q_ring"], method=method, **options)
        single = system.simulate(0.05, parameters={"K_g": K_g[1], "I_r": 0.3}, method=method, **options)
        assert runs["q_ring"][1].tobytes() == single["q_ring"].tobytes()
        assert runs["w_out"][1].tobytes() == single["w_out"].tobytes()


def test_start_values_of_discrete_variables_vary() -> None:
    """Between its thresholds the heater stays as it was: T = 10 + 10 exp(-t / 10), and with 3 K/s more, 40 - 20 exp(-t / 10)."""
    system, t = gl.compile(Thermostat(), outputs=["T", "on"]), np.array([0.0, 0.25, 0.5])
    runs = system.sweep({"start(on)": [0.0, 1.0], "start(T)": 20.0}, 0.5, samples=3, rtol=1e-9)
    assert runs["on"].tolist() == [[0.0] * 3, [1.0] * 3]
    assert runs["T"] == pytest.approx(np.array([10.0 + 10.0 * np.exp(-t / 10), 40.0 - 20.0 * np.exp(-t / 10)]), rel=1e-8)
    assert (runs.unit("start(on)"), runs.unit("start(T)"), runs.unit("on"), runs.unit("T")) == ("", "K", "", "K")


class Integrating:
    """A control law with a state, which begins anew with each run."""

    def __call__(self, t: float, values: Any) -> float:
        self.total = (0.0 if t == 0.0 else self.total) + 3.0 - values[0]
        sleep(1e-4)  # another thread may go on here
        return 4.0 * self.total


class Programmed(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        self.program = gl.Sampled(Integrating(), 0.05, inputs=[self.load.w], outputs=[self.torque.tau])
        return [gl.connect(self.torque.flange, self.load.flange_a)]


def test_runs_whose_controller_has_a_state_take_turns() -> None:
    system, varied = gl.compile(Programmed(), outputs=["load.w"]), {"load.J": np.linspace(1.0, 3.0, 12)}
    alone = system.sweep(varied, 0.5, samples=3)
    beside = system.sweep(varied, 0.5, samples=3, threads=4)
    assert beside["load.w"].tolist() == alone["load.w"].tolist()
