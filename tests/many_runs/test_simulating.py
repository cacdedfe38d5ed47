"""What the simulations of a sweep are prepared from: kinds of names, the parameters of the first run, and the reasons why not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.many_runs import simulating as parts
from gearlib.many_runs.by_exponentials import ExactSweep
from gearlib.many_runs.in_lanes import LaneSweep
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.simulating import Simulating, functions_of, kind_of, simulating
from gearlib.run.simulate import checked_request
from tests.many_runs.models import Drive, Thermostat

TORQUE = {"torque.tau": 3.0}
J = np.linspace(0.5, 4.0, 11)


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive(), outputs=["load.w", "shaft.tau"])


def task(
    system: gl.System, varied: Any, lanes: Any = "auto", outputs: Any = None, reduce: Any = None, **options: Any
) -> Simulating:
    given = {"inputs": TORQUE, "samples": 5, **options}
    own, request = checked_request(system.translation, 1.0, **given)
    return simulating(own, as_samples(varied), request, {}, given["inputs"], outputs, reduce, lanes)


def test_kinds_of_names(drive: gl.System) -> None:
    own = drive.translation
    assert [kind_of(own, n) for n in ("J", "shaft.c", "torque.tau", "start(load.w)")] == [
        "parameter",
        "parameter",
        "input",
        "start",
    ]
    assert kind_of(gl.compile(Thermostat()).translation, "start(on)") == "start"
    with pytest.raises(
        NameLookupError, match=r"^the model has no parameter 'shaft\.k'; .*An input is named by its path, a start value as"
    ):
        kind_of(own, "shaft.k")
    with pytest.raises(NameLookupError, match=r"did you mean 'torque\.tau'"):
        kind_of(own, "torqe.tau")
    with pytest.raises(NameLookupError, match=r"load\.v"):
        kind_of(own, "start(load.v)")


def test_functions_by_name() -> None:
    assert functions_of(None) == {}
    assert functions_of({"n": len}) == {"n": len}
    with pytest.raises(ArgumentError, match=r"^reduce\['n'\] is 3; expected a function of a result$"):
        functions_of({"n": 3})


def test_parameters_of_the_first_run(drive: gl.System) -> None:
    """Of those that vary and those that all runs share; the model's own where the first run needs other equations, or fails."""
    own, request = checked_request(drive.translation, 1.0, inputs=TORQUE)
    index = own.model.parameters.index
    varied = as_samples({"J": [5.0, 6.0], "torque.tau": [1.0, 2.0], "start(load.w)": [7.0, 8.0]})
    found = parts.first_parameters(own, varied, request, {"shaft.c": 300.0})
    assert (found[index["J"]], found[index["load.J"]], found[index["shaft.c"]]) == (5.0, 5.0, 300.0)
    assert found[index["shaft.d"]] == request.parameters[index["shaft.d"]] == 2.0
    for first in (0.0, -1.0):
        assert parts.first_parameters(own, as_samples({"motor.J": [first, 1.0]}), request, {}) is request.parameters


@pytest.mark.parametrize("lanes", [1, "auto"])
def test_outputs_that_there_are_not_are_refused_before_the_runs(drive: gl.System, lanes: Any) -> None:
    with pytest.raises(NameLookupError, match=r"lod\.w"):
        task(drive, {"J": J}, outputs=["load.w", "lod.w"], lanes=lanes)


def test_ways_in_which_runs_are_carried_out(drive: gl.System) -> None:
    tables = [gl.Table([0.0, 1.0], [0.0, k]) for k in J]
    functions = [lambda t: t] * 11
    assert isinstance(task(drive, {"J": J}).together_by, ExactSweep)
    assert isinstance(task(drive, {"J": J}, method="exact").together_by, ExactSweep)
    assert isinstance(task(drive, {"J": J}, method="rk5").together_by, LaneSweep)
    assert isinstance(task(drive, {"J": J}, lanes=8).together_by, LaneSweep)
    assert isinstance(task(drive, {"torque.tau": tables}, inputs={}).together_by, LaneSweep)
    assert task(drive, {"torque.tau": functions}, inputs={}).together_by == "inputs are functions of time"
    assert task(drive, {"J": J}, lanes=1).together_by == "asked for"
    assert task(drive, {"J": J[:7]}).together_by == "there are fewer than 8 runs"
    assert isinstance(task(drive, {"J": J[:8]}).together_by, ExactSweep)
    with pytest.raises(
        ArgumentError, match=r"^lanes is 8, but these runs cannot be carried out so: there are fewer than 8 runs; leave"
    ):
        task(drive, {"J": J[:7]}, lanes=8)
    with pytest.raises(ArgumentError, match="lanes is 8, but these runs cannot be carried out so: the method is exact"):
        task(drive, {"J": J}, lanes=8, method="exact")


def test_names_of_what_is_kept(drive: gl.System) -> None:
    """Each once; the outputs of the system where nothing is asked for, and none beside functions."""
    assert task(drive, {"J": J}).outputs == ("load.w", "shaft.tau")
    assert task(drive, {"J": J}, outputs=["shaft.tau", "load.w", "shaft.tau"]).outputs == ("shaft.tau", "load.w")
    alone = task(drive, {"J": J}, reduce={"n": len})
    assert (alone.outputs, alone.dimensions("n"), alone.unit("n")) == ((), (), "")
    both = task(drive, {"J": J, "start(load.w)": J, "torque.tau": J}, outputs=["load.w"], reduce={"n": len}, inputs={})
    assert (both.dimensions("load.w"), both.dimensions("n"), both.unit("load.w"), both.unit("n")) == (
        ("time",),
        (),
        "rad/s",
        "",
    )
    assert [both.varied_unit(n) for n in ("J", "start(load.w)", "torque.tau")] == ["kg.m2", "rad/s", "N.m"]
    plain = gl.compile(Drive())
    assert task(plain, {"J": J}).outputs == plain.states
    with pytest.raises(
        ArgumentError, match=r"^load\.w is the name of an output and of a function in reduce; give the function another name$"
    ):
        task(drive, {"J": J}, outputs=["load.w"], reduce={"load.w": len})
    with pytest.raises(
        ArgumentError, match=r"^parameters: start\(load\.w\) varies, but start='steady' fixes all start values$"
    ):
        task(drive, {"start(load.w)": J}, start="steady")
    with pytest.raises(ArgumentError, match=r"^parameters\['J'\] is <"):
        task(drive, {"J": lambda t: t})
    with pytest.raises(ArgumentError, match=r"^parameters\['J'\] is "):
        task(drive, {"J": [gl.Table([0.0, 1.0], [0.0, 1.0])] * 3})
