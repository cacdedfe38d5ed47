"""`gl.sweep`: analyses of many variants; modes that keep their column, margins, responses, power flow, harmonic balance."""

from __future__ import annotations

from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, GearlibWarning, NameLookupError
from tests.many_runs.models import Drive


class TwoRotors(gl.Component):
    """Two oscillators on the ground, hardly coupled: their frequencies cross when one spring grows."""

    def assemble(self) -> list[gl.Connection]:
        self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=100.0, d=0.1), gp.Inertia(J=1.0)
        self.other, self.wheel = gp.SpringDamper(c=400.0, d=0.4), gp.Inertia(J=1.0)
        self.between = gp.Spring(c=0.05)
        return [
            gl.connect(self.ground.flange, self.shaft.flange_a, self.other.flange_a),
            gl.connect(self.shaft.flange_b, self.disc.flange_a, self.between.flange_a),
            gl.connect(self.other.flange_b, self.wheel.flange_a, self.between.flange_b),
        ]


class Duffing(gl.Component):
    """A mass on a hardening spring under a harmonic force."""

    w = gl.Parameter("rad/s", default=1.0)
    k = gl.Parameter("1", default=1.0)
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        force = gl.cos(self.w * gl.time)
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force - 0.2 * self.v - self.k * self.x)]


@pytest.fixture(scope="module")
def rotors() -> gl.System:
    return gl.compile(TwoRotors())


@pytest.fixture(scope="module")
def processes() -> Any:
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
        yield pool


def test_a_mode_keeps_its_column_where_frequencies_cross(rotors: gl.System) -> None:
    c = np.linspace(100.0, 1000.0, 31)
    runs = gl.sweep(gl.modes, rotors, {"shaft.c": c})
    disc, wheel = 2 * np.pi * runs["frequencies"].T
    assert disc == pytest.approx(np.sqrt(c), rel=5e-3)
    assert wheel == pytest.approx(20.0, rel=5e-3)
    assert runs["number"][0].tolist() == [0, 1]
    assert runs["number"][-1].tolist() == [1, 0]
    for k in (0, 30):
        single = gl.modes(rotors, parameters={"shaft.c": c[k]})
        assert sorted(runs["frequencies"][k]) == sorted(single.frequencies)


def test_modes_are_followed_whatever_the_order_of_the_runs(rotors: gl.System) -> None:
    c = np.linspace(100.0, 1000.0, 31)
    order = np.random.default_rng(3).permutation(31)
    runs = gl.sweep(gl.modes, rotors, {"shaft.c": c[order]})
    near = np.abs(2 * np.pi * runs["frequencies"] - 20.0).argmin(axis=1)[[np.argmin(order), np.argmax(order)]]
    assert near[0] == near[1]  # the wheel's branch at both ends
    square = gl.sweep(gl.modes, rotors, gl.grid({"shaft.c": c[::3], "other.d": [0.4, 1.0]}))
    assert square["frequencies"].shape == (11, 2, 2)
    assert 2 * np.pi * square["frequencies"][:, 1, 0] == pytest.approx(np.sqrt(c[::3]), rel=5e-3)
    assert square["damping"][-1, 1, 1] == pytest.approx(1.0 / 40.0, rel=1e-2)


def test_a_mode_that_is_overdamped_leaves_its_branch_open(rotors: gl.System) -> None:
    runs = gl.sweep(gl.modes, rotors, {"shaft.d": [0.1, 1.0, 10.0, 30.0]})
    assert np.isfinite(runs["frequencies"][:3]).all()
    assert np.isnan(runs["frequencies"][3]).tolist() == [True, False]
    back = gl.sweep(gl.modes, rotors, {"shaft.d": [30.0, 10.0, 1.0, 0.1]})
    assert np.isnan(back["frequencies"]).sum() == 1
    assert np.nanmax(np.abs(np.diff(back["frequencies"], axis=0))) < 0.5


def test_processes_and_failures(rotors: gl.System, processes: Executor) -> None:
    c = np.linspace(100.0, 1000.0, 12)
    wanted = gl.sweep(gl.modes, rotors, {"shaft.c": c})
    found = gl.sweep(gl.modes, rotors, {"shaft.c": c}, executor=processes)
    assert found["eigenvalues"].tobytes() == wanted["eigenvalues"].tobytes()
    with pytest.warns(GearlibWarning, match="1 of 3 runs failed"):
        runs = gl.sweep(gl.modes, rotors, {"disc.J": [1.0, -1.0, 2.0]})
    assert list(runs.errors) == [1]
    assert np.isnan(runs["frequencies"][1]).all()


def test_files_of_analyses_go_on(rotors: gl.System, tmp_path: Path) -> None:
    c = np.linspace(100.0, 1000.0, 12)
    wanted = gl.sweep(gl.modes, rotors, {"shaft.c": c})
    for _ in range(2):
        runs = gl.sweep(gl.modes, rotors, {"shaft.c": c}, to=tmp_path / "modes.zarr")
        assert runs["frequencies"].tobytes() == wanted["frequencies"].tobytes()
    assert runs.stats["done_before"] == 12
    assert 0.0 < runs.stats["seconds"] < 60.0
    with pytest.raises(ArgumentError, match=r"is complex, which netCDF cannot hold; give a path that ends in \.zarr"):
        gl.sweep(gl.modes, rotors, {"shaft.c": c}, to=tmp_path / "modes.nc")


def test_margins() -> None:
    system = gl.compile(Drive())
    loop = ("torque.tau", "load.w")
    runs = gl.sweep(gl.stability, system, {"brake.d": [0.5, 2.0, 5.0]}, loop=loop, gain=3.0)
    for k, d in enumerate([0.5, 2.0, 5.0]):
        report = gl.stability(system, loop, gain=3.0, parameters={"brake.d": d})
        assert report.loop is not None
        assert runs["gain_margin"][k] == report.loop.margins.gain_margin
        assert runs["phase_margin"][k] == report.loop.margins.phase_margin
        assert runs["growth"][k] == report.eigenvalues.real.max()
    assert runs.unit("phase_margin") == "deg"


def test_frequency_responses() -> None:
    system = gl.compile(Drive(), outputs=["load.w"])
    omega = [1.0, 10.0, 100.0]
    runs = gl.sweep(gl.frequency_response, system, gl.grid({"shaft.c": [100.0, 400.0]}, J=[1.0, 2.0, 3.0]), omega=omega)
    assert runs["response"].shape == (2, 3, 1, 1, 3)
    single = gl.frequency_response(system, omega, parameters={"shaft.c": 400.0, "J": 3.0})
    assert runs["response"][1, 2].tobytes() == single.values.tobytes()
    table = runs.to_xarray()
    assert (
        complex(table["response"].sel({"shaft.c": 400.0, "J": 3.0, "output": "load.w", "omega": 10.0}).squeeze())
        == single["load.w"][1]
    )


def test_power_flow() -> None:
    system = gl.compile(Drive())
    given: dict[str, Any] = {"speeds": {"load.w": 10.0}}
    runs = gl.sweep(gl.power_flow, system, {"brake.d": [0.5, 1.0]}, **given)
    flow = gl.power_flow(system, parameters={"brake.d": 1.0}, **given)
    assert runs["input_power"].tolist() == pytest.approx([50.0, 100.0])
    place = runs.coordinates["flange"].tolist().index("load.flange_a")
    assert runs["torque"][1, place] == flow["load.flange_a"].torque


def test_harmonic_balance() -> None:
    system = gl.compile(Duffing())
    options: dict[str, Any] = {"start": 2.0, "end": 0.5, "frequency": "w", "harmonics": 1, "samples": 16, "outputs": ["x"]}
    runs = gl.sweep(gl.harmonic_balance, system, {"k": [1.0, 1.5]}, step=0.02, points=400, **options)
    assert runs["peak"][:, 0] == pytest.approx([1 / (0.2 * np.sqrt(k - 0.01)) for k in (1.0, 1.5)], rel=1e-3)
    assert runs["folds"].tolist() == [0.0, 0.0]


def test_any_function_of_a_system() -> None:
    system = gl.compile(Drive())

    def ratio(model: gl.System, parameters: dict[str, float]) -> float:
        return float(gl.modes(model, parameters=parameters).frequencies.max())

    runs = gl.sweep(ratio, system, {"J": [1.0, 2.0]}, reduce={"highest": lambda f: f})
    assert runs["highest"][1] == gl.modes(system, parameters={"J": 2.0}).frequencies.max()


@pytest.mark.parametrize(
    ("analysis", "parameters", "more", "message"),
    [
        (3, {"J": [1.0]}, {}, "analysis is 3; expected a function of a system, such as gl.modes"),
        (gl.modes, {"K": [1.0]}, {}, "the model has no parameter 'K'"),
        (gl.modes, {"J": [gl.Table([0, 1], [0, 1])]}, {}, "holds what is not a number"),
        (gl.modes, {"J": [1.0]}, {"cuont": 3}, "analysis raised TypeError: .*cuont"),
        (lambda system, parameters: 3.0, {"J": [1.0]}, {}, "analysis returned a float; say what is to be kept of it: reduce="),
    ],
)
def test_what_is_wrong_is_named(analysis: Any, parameters: Any, more: dict[str, Any], message: str) -> None:
    with pytest.raises((ArgumentError, NameLookupError), match=message):
        gl.sweep(analysis, gl.compile(Drive()), parameters, **more)


def test_steady_states() -> None:
    """w = tau / d of the brake."""
    system = gl.compile(Drive(), outputs=["load.w"])
    runs = gl.sweep(gl.steady_state, system, {"brake.d": [0.5, 0.8, 2.0]}, inputs={"torque.tau": 4.0})
    np.testing.assert_allclose(runs["load.w"], [8.0, 5.0, 2.0])
    assert runs.to_xarray()["load.w"].attrs["units"] == "rad/s"


def test_steady_states_of_bodies_without_inertia_keep_their_names() -> None:
    """The train of such a run has a state less; whichever run is the first, each has the speeds of all bodies."""
    for inertias in ([1.0, 0.0], [0.0, 1.0]):
        runs = gl.sweep(gl.steady_state, gl.compile(Drive()), {"motor.J": inertias}, inputs={"torque.tau": 4.0})
        assert runs["motor.w"].tolist() == pytest.approx([8.0, 8.0])
        assert {"load.w", "shaft.phi_rel"} < {*runs}
        assert runs.errors == {}


def test_runs_that_are_not_alike_fail() -> None:
    """Frequencies that follow what varies: the result has one axis for all."""

    def response(system: gl.System, parameters: dict[str, float]) -> Any:
        return gl.frequency_response(system, [1.0, 10.0 * parameters["J"]], ["torque.tau"], ["load.w"], parameters=parameters)

    with pytest.warns(GearlibWarning, match="1 of 2 runs failed"):
        runs = gl.sweep(response, gl.compile(Drive()), {"J": [1.0, 2.0]})
    assert "the axis omega has other values in this run than in the first one" in str(runs.errors[1])
    assert np.isfinite(runs["response"]).all(axis=(1, 2, 3)).tolist() == [True, False]


class Damped(gl.Component):
    """One oscillator, whose parameters have the names of results."""

    damping = gl.Parameter("N.m.s/rad", default=0.4)
    mode = gl.Parameter("N.m/rad", default=100.0)

    def assemble(self) -> list[gl.Connection]:
        self.ground, self.shaft = gp.Fixed(), gp.SpringDamper(c=self.mode, d=self.damping)
        self.disc = gp.Inertia(J=1.0)
        return [
            gl.connect(self.ground.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.disc.flange_a),
        ]


def test_parameters_may_have_the_names_of_results_where_one_of_both_is_there(tmp_path: Path) -> None:
    system = gl.compile(Damped(damping=0.8))
    fixed = gl.sweep(gl.modes, system, {"shaft.c": [100.0, 400.0]})
    assert fixed["damping"][:, 0] == pytest.approx([0.04, 0.02])
    assert (fixed.unit("damping"), fixed.unit("shaft.c")) == ("", "N.m/rad")  # a ratio has none
    ratio = {"ratio": lambda modes: modes.damping[0], "shaft.d": lambda modes: modes.damping[0]}
    varied = gl.sweep(gl.modes, system, {"damping": [0.8, 1.6], "mode": 100.0}, reduce=ratio)
    assert varied["ratio"] == pytest.approx([0.04, 0.08])
    assert (varied.unit("damping"), varied.unit("shaft.d")) == ("N.m.s/rad", "")
    assert varied.to_xarray()["damping"].attrs == {"units": "N.m.s/rad"}
    for name, kind in (("damping", "is a result"), ("mode", "is an axis of the results")):
        for given in ({name: [1.0, 2.0]}, {name: 2.0}, gl.grid({name: [1.0, 2.0]})):
            with pytest.raises(
                ArgumentError, match=f"{name} is given to the runs and {kind}, too; give the result another name"
            ):
                gl.sweep(gl.modes, system, given, to=tmp_path / "runs.nc")
    with pytest.raises(ArgumentError, match="damping is given to the runs and is a result, too"):
        gl.sweep(gl.modes, system, {"damping": [0.8, 1.6]}, reduce={"damping": lambda modes: 1.0})
