"""Fits recover what data was made with, say how sure they are, and name what the data does not determine."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.fitting.measured import Measured, as_real
from tests.many_runs.models import Drive, Rattle

TIME = np.linspace(0.0, 2.0, 201)
TRUE = {"shaft.c": 520.0, "shaft.d": 1.6}
FREE = {"shaft.c": (1e2, 1e4), "shaft.d": (0.01, 10.0)}
STEP = gl.Table([0.0, 0.5, 0.51, 2.0], [0.0, 0.0, 20.0, 20.0])
PLANS: list[dict[str, Any]] = [
    {"inputs": {"torque.tau": 5.0}}, {"inputs": {"torque.tau": STEP}, "start": {"motor.w": 3.0}, "parameters": {"load.J": 1.0}},
]  # fmt: skip


@cache
def system() -> gl.System:
    return gl.compile(Drive(), outputs=["load.w", "motor.w"])


@cache
def histories(plan: int) -> Any:
    own = dict(PLANS[plan])
    own["parameters"] = {**own.get("parameters", {}), **TRUE}
    return system().simulate(2.0, times=TIME, rtol=1e-10, **own)


def measured(seed: int, plan: int = 0, noise: float = 0.05, **options: Any) -> gl.MeasuredHistories:
    rng, run = np.random.default_rng(seed), histories(plan)
    data = {n: run[n] + noise * rng.normal(size=len(TIME)) for n in ("load.w", "motor.w")}
    return gl.MeasuredHistories({"time": TIME, **data}, **{**PLANS[plan], "noise": noise or None, **options})


def test_an_experiment_does_not_follow_what_was_given_for_it() -> None:
    """One mapping that is filled anew for each experiment."""
    inputs, start, data, experiments = {"torque.tau": 5.0}, {"motor.w": 0.0}, {"time": TIME.copy()}, []
    for speed in (0.0, 3.0):
        start["motor.w"] = speed
        data["load.w"] = system().simulate(2.0, times=TIME, rtol=1e-10, inputs=inputs, start=start, parameters=TRUE)["load.w"]
        experiments.append(gl.MeasuredHistories(data, inputs=inputs, start=start))
    data["time"] *= 2.0
    inputs["torque.tau"] = -1.0
    found = gl.fit(system(), experiments, FREE)
    assert found["shaft.c"] == pytest.approx(TRUE["shaft.c"], rel=1e-6)


def test_a_shaft_from_two_experiments() -> None:
    """Other inputs, start values and a load of another mass in the second."""
    found = gl.fit(system(), [measured(1), measured(2, 1)], FREE)
    for name, value in TRUE.items():
        assert abs(found[name] - value) < 3 * found.standard_errors[name] < 0.05 * value
    assert (found.identifiable, found.converged, found.experiments, found.approximate) == (True, True, 2, "")
    assert found.evaluations <= 15
    assert found.values == {n: found[n] for n in TRUE}
    assert np.sqrt(np.mean(found.residuals**2)) == pytest.approx(1.0, abs=0.1)
    assert [s.noise for s in found.series] == [0.05] * 4
    np.testing.assert_allclose(np.diag(found.correlation), 1.0)
    assert [s.name for s in found.series] == ["load.w", "motor.w"] * 2
    assert max(map(len, str(found).splitlines())) <= 100
    assert "Identifiable: the data determines every direction" in str(found)
    assert list(found.to_dataframe().columns) == ["value", "standard error", "unit", "low", "high", "begin"]


def spread_of_fits(seeds: range) -> tuple[dict[str, int], float, int]:
    """How many seeds are within two standard deviations; the mean square of the errors in these; the most evaluations."""
    inside, squares, most = dict.fromkeys(TRUE, 0), 0.0, 0
    for seed in seeds:
        found = gl.fit(system(), measured(seed), FREE)
        error = np.array([found[n] - value for n, value in TRUE.items()])
        squares += float(error @ np.linalg.solve(found.covariance, error)) / len(TRUE) / len(seeds)
        for n, value in TRUE.items():
            inside[n] += abs(found[n] - value) <= 2 * found.standard_errors[n]
        most = max(most, found.evaluations)
    return inside, squares, most


def test_values_for_all_experiments_hold_where_they_give_none_of_their_own() -> None:
    data = measured(0, 1, noise=0.0)  # with a load of 1 kg.m2
    found = gl.fit(system(), data, FREE, parameters={"load.J": 3.0})
    assert found.values == pytest.approx(TRUE, rel=1e-5)
    assert data.parameters == {"load.J": 1.0}


def test_standard_errors_are_those_of_the_noise() -> None:
    inside, squares, most = spread_of_fits(range(12))
    assert min(inside.values()) >= 10
    assert 0.5 < squares < 1.7
    assert most <= 15


@pytest.mark.slow
def test_ninety_five_of_a_hundred() -> None:
    """95.4 % of normal errors are within two standard deviations: of 100 seeds, 91 at least with a probability of 98 %."""
    inside, squares, most = spread_of_fits(range(100))
    assert min(inside.values()) >= 91
    assert squares == pytest.approx(1.0, abs=0.3)
    assert most <= 15


def test_noise_that_is_not_given_is_estimated() -> None:
    found = gl.fit(system(), measured(3, noise=0.05), FREE)
    other = measured(3, noise=0.05)
    other.noise = {}
    estimated = gl.fit(system(), other, FREE)
    assert [s.noise for s in estimated.series] == pytest.approx([0.05, 0.05], rel=0.2)
    for name in TRUE:
        assert estimated.standard_errors[name] == pytest.approx(found.standard_errors[name], rel=0.2)
    assert "% of the spread" in str(estimated)
    with pytest.raises(gl.GearlibError, match=r"the noise of motor\.w is not given, that of others is"):
        gl.fit(system(), other, FREE, noise={"load.w": 0.05})


def test_a_data_frame_with_gaps_and_a_free_start_value() -> None:
    run = system().simulate(2.0, times=TIME, inputs={"torque.tau": 5.0}, start={"motor.w": 2.5}, parameters=TRUE, rtol=1e-10)
    frame = pd.DataFrame({"load.w": run["load.w"].copy(), "motor.w": run["motor.w"]}, index=TIME)
    frame.loc[frame.index[3::4], "load.w"] = np.nan
    measured = gl.MeasuredHistories(frame, inputs={"torque.tau": 5.0})
    found = gl.fit(system(), measured, {**FREE, "start(motor.w)": (-10.0, 10.0)})
    for name, value in {**TRUE, "start(motor.w)": 2.5}.items():
        assert found[name] == pytest.approx(value, rel=1e-4), name
    assert found.units == ("N.m/rad", "N.m.s/rad", "rad/s")
    assert len(found.series[0].x) == len(TIME) - 50


def of_all_kinds() -> list[Measured]:
    omega = np.linspace(5.0, 60.0, 40)
    response = gl.frequency_response(system(), omega, ["torque.tau"], ["load.w"], parameters=TRUE)["load.w"]
    modes = gl.modes(system(), parameters=TRUE)
    margins = gl.stability(system(), ("torque.tau", "load.w"), gain=300.0, parameters=TRUE).loop
    assert margins is not None
    m = margins.margins
    return [
        measured(0, noise=0.0),
        gl.MeasuredResponse(omega, response, "torque.tau", "load.w"),
        gl.MeasuredModes(modes.frequencies[modes.free :], modes.damping[modes.free :]),
        gl.MeasuredMargins(
            ("torque.tau", "load.w"), gain=300.0, gain_margin_db=m.gain_margin_db, phase_margin=m.phase_margin,
            delay_margin=m.delay_margin, modulus_margin=m.modulus_margin,
        ),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", range(4))
def test_every_kind_of_data_recovers_the_shaft(kind: int) -> None:
    """With derivatives that are those of what is predicted."""
    data = of_all_kinds()[kind]
    found = gl.fit(system(), data, FREE)
    for name, value in TRUE.items():
        assert found[name] == pytest.approx(value, rel=1e-5)
    fixed = gl.fit(system(), data, {"shaft.d": FREE["shaft.d"]}, parameters={"shaft.c": TRUE["shaft.c"]})
    assert fixed["shaft.d"] == pytest.approx(TRUE["shaft.d"], rel=1e-5)
    at = {"shaft.c": 430.0, "shaft.d": 2.4}
    slopes = np.concatenate(data.predicted(system(), at).slopes)
    for k, (name, value) in enumerate(at.items()):
        h = 1e-4 * value
        ahead, back = (
            np.concatenate([as_real(v) for v in data.predicted(system(), {**at, name: value + e}).values]) for e in (h, -h)
        )
        right = (ahead - back) / (2 * h)
        np.testing.assert_allclose(slopes[:, k], right, atol=3e-5 * np.abs(right).max())
    axes = found.plot()
    assert len(np.atleast_1d(axes)) == len(found.series)
    plt.close("all")
    assert data.__class__.__name__ in repr(data)


def test_all_kinds_at_once() -> None:
    found = gl.fit(system(), of_all_kinds(), {**FREE, "brake.d": (0.01, 10.0)})
    assert found["brake.d"] == pytest.approx(0.5, rel=1e-4)
    assert found.experiments == 4
    axes = found.plot()
    assert len(axes) == 6
    plt.close("all")


def test_springs_in_series_are_felt_as_one() -> None:
    class Shaft(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.one, self.other = gp.Fixed(), gp.Spring(c=300.0), gp.Spring(c=300.0)
            self.disc = gp.Inertia(J=1.0)
            return [
                gl.connect(self.ground.flange, self.one.flange_a), gl.connect(self.one.flange_b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.disc.flange_a),
            ]  # fmt: skip

    data = gl.MeasuredModes([2.0], noise=0.001)
    found = gl.fit(gl.compile(Shaft()), data, {"one.c": (10.0, 1e4), "other.c": (10.0, 1e4), "disc.J": (0.5, 2.0)})
    assert not found.identifiable
    assert len(found.identifiability.open_directions) == 2
    assert found.standard_errors["one.c"] == np.inf
    text = str(found)
    assert "Not identifiable: the data determines 1 of 3 directions" in text
    assert "not determined" in text
    assert max(map(len, text.splitlines())) <= 100
    series = 1 / (1 / found["one.c"] + 1 / found["other.c"])
    assert np.sqrt(series / found["disc.J"]) / 2 / np.pi == pytest.approx(2.0, rel=1e-6)  # what was measured is met
    alone = gl.fit(gl.compile(Shaft()), data, {"one.c": (10.0, 1e4)})
    assert alone.identifiable


def test_one_margin_of_the_paper_singles_nothing_out() -> None:
    """Figure 7 prints a gain margin of 7.05 dB: any of many combinations of stiffness, damping and inertia has it."""
    train = gl.compile(gp.ZhouCui2022(), outputs=["w_out"])
    printed = gl.MeasuredMargins(("tau_in", "w_out"), gain_margin_db=7.05, gain=100.0, noise=0.005)
    found = gl.fit(train, printed, {"K_g": (5e7, 5e8), "C_g": (1e2, 1e5), "I_r": (0.05, 2.0)})
    assert not found.identifiable
    assert "Not identifiable: the data determines 1 of 3 directions" in str(found)
    report = gl.stability(train, ("tau_in", "w_out"), gain=100.0, parameters=found.values)
    assert report.loop is not None
    assert report.loop.margins.gain_margin_db == pytest.approx(7.05, abs=1e-4)
    assert all(np.isinf(found.standard_errors[n]) for n in next(iter(found.identifiability.open_directions)))


def test_no_influence_at_all() -> None:
    found = gl.fit(system(), gl.MeasuredModes([3.0], noise=0.01), {"shaft.c": (1e2, 1e4), "start(motor.w)": (0.0, 3.0)})
    assert found.identifiability.open_directions == ({"start(motor.w)": 1.0},)
    assert "Not determined: start(motor.w) +1.00" in str(found)


def test_values_that_a_bound_holds() -> None:
    found = gl.fit(system(), measured(1), {"shaft.c": (600.0, 1e4), "shaft.d": (0.01, 10.0)})
    assert found.at_bounds == ("shaft.c",)
    assert "at its bound" in str(found)


def test_runs_with_events() -> None:
    """Where tangents are not known, differences of tight runs; the result says so."""
    rattle = gl.compile(Rattle(), outputs=["load.w"])
    time = np.linspace(0.0, 0.6, 61)
    run = rattle.simulate(0.6, times=time, parameters={"gap.c": 640.0}, rtol=1e-10)
    found = gl.fit(rattle, {"time": time, "load.w": run["load.w"]}, {"gap.c": (100.0, 5e3)})
    assert found["gap.c"] == pytest.approx(640.0, rel=1e-3)
    assert not found.approximate or "Derivatives of histories are differences of runs" in str(found)


@pytest.mark.parametrize("why", ["", "the run leaves its tangents"])
def test_tangents_are_asked_for_until_they_are_missing(why: str) -> None:
    """Of each experiment on its own: what has no exact derivatives is not run with tangents again, and the result says why."""

    class Told(gl.MeasuredHistories):
        why = ""

        def predicted(self, system: Any, free: Any, exact: bool = True) -> Any:
            asked.setdefault(self.why, []).append(exact)
            return replace(super().predicted(system, free, exact), approximate=self.why)

    asked: dict[str, list[bool]] = {}
    experiments = [Told({"time": TIME, "load.w": histories(0)["load.w"]}, **PLANS[0]) for _ in range(2)]
    experiments[1].why = why
    found = gl.fit(system(), experiments, {"shaft.c": (1e2, 1e4)})
    assert found.approximate == why
    assert ("Derivatives of histories are differences of runs" in str(found)) == bool(why)
    assert all(asked[""])
    if why:
        assert asked[why] == [True] + [False] * (found.evaluations - 1)


def test_evaluations_that_run_out() -> None:
    told: list[float] = []
    found = gl.fit(system(), measured(1), FREE, evaluations=2, progress=lambda fraction, now: told.append(fraction))
    assert not found.converged
    assert "had not ended" in str(found)
    assert told == sorted(told)
    assert max(told) <= 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"free": {}}, "free is empty"),
        ({"free": {"shaft.k": (1, 2)}}, r"no parameter 'shaft\.k' \(in free\)"),
        ({"free": {"shaft.c": (2, 1)}}, r"free\['shaft\.c'\] is .*; expected \(low, high\), low below high"),
        ({"free": {"shaft.c": 3.0}}, r"expected \(low, high\)"),
        ({"free": {"start(nothing)": (0, 1)}}, "nothing"),
        ({"parameters": {"shaft.c": 4.0}}, r"'shaft\.c' is free, and given as 4\.0 in parameters"),
        (
            {
                "data": gl.MeasuredHistories({"time": [0.0, 1.0], "load.w": [0.0, 1.0]}, start={"motor.w": 3.0}),
                "free": {"start(motor.w)": (0, 1)},
            },
            r"^'start\(motor\.w\)' is free, and given as 3\.0 in the start values of an experiment; leave one of the two out$",
        ),
        (
            {"data": gl.MeasuredModes([1.0], at={"motor.w": 3.0}), "free": {"start(motor.w)": (0, 1)}},
            r"'start\(motor\.w\)' is free, and given as 3\.0",
        ),
        ({"data": []}, "data is empty"),
        ({"data": 3.0}, r"data is 3\.0; expected a pandas\.DataFrame, or a mapping"),
        ({"data": {"load.w": [1.0, 2.0]}}, "data has no column 'time'"),
        ({"data": {"time": [0.0, 1.0]}}, "data has no column but the time"),
        ({"data": {"time": [0.0, 1.0], "load.w": [0.0]}}, r"has the shape \(1,\); expected \(2,\)"),
        (
            {"data": {"time": [0.0, 1.0], "load.w": [np.nan, np.nan]}},
            r"data\['load\.w'\] holds no number; expected a history of numbers",
        ),
        (
            {"data": {"time": [0.0, 1.0], "load.w": [[1.0], [2.0, 3.0]]}},
            r"data\['load\.w'\] is \[\[1\.0\], .*; expected a history of numbers",
        ),
        ({"data": {"time": [0.0, 1.0], "load.w": ["1", "2"]}}, r"data\['load\.w'\] is .*; expected a history of numbers"),
        ({"data": {"time": [0.0, 1.0], "load.x": [0.0, 1.0]}}, r"load\.x"),
        (
            {"data": {"time": [1.0, 1.0], "load.w": [0.0, 1.0]}},
            r"expected an increasing sequence of two or more finite numbers, s$",
        ),
        ({"noise": {"load.x": 1.0}}, r"noise names 'load\.x', which was not measured"),
        ({"noise": -1.0}, "expected a standard deviation above 0"),
        ({"noise": 5e-324}, r"load\.w is predicted as 1 and measured as 0; in units of its noise, 4\.94e-324, the difference"),
        ({"noise": 1e-160}, r"load\.w is predicted .* noise, 1e-160, .* Expected a finite prediction, and a noise nearer"),
        ({"evaluations": 0}, "evaluations is 0"),
    ],
)
def test_what_is_refused(change: dict[str, Any], message: str) -> None:
    plain = {"time": [0.0, 1.0], "load.w": [0.0, 1.0]}
    with pytest.raises(gl.GearlibError, match=message):
        gl.fit(system(), **{"data": plain, "free": {"shaft.c": (1.0, 1e4)}, **change})


def test_the_first_series_that_overflows_is_named() -> None:
    """By its own numbers: only the last of the second series leaves the range."""
    found = {"time": TIME, "load.w": histories(0)["load.w"], "motor.w": np.where(TIME < 2.0, np.nan, 1e160)}
    found["motor.w"][:5] = 0.0
    with pytest.raises(
        ArgumentError, match=r"^motor\.w is predicted as [0-9.]+ and measured as 1e\+160; in units of its noise, 0\.5,"
    ):
        gl.fit(system(), gl.MeasuredHistories(found, noise=0.5, **PLANS[0]), {"shaft.c": (1e2, 1e4)})


@pytest.mark.parametrize("noise", [2.0, 1e308])
def test_noise_above_the_signal_leaves_the_parameter_open(noise: float) -> None:
    data = gl.MeasuredResponse([1.0, 2.0], [1.0 - 1j, 0.2 - 0.4j], "torque.tau", "load.w")
    found = gl.fit(system(), data, {"shaft.c": (1.0, 1e4)}, noise=noise)
    assert not found.identifiable
    assert np.isinf(found.covariance).all()
    assert np.isfinite(found.numbers).all()


class Fails:
    """Fails whatever is asked of it."""

    def _fail(self, *_: Any) -> Any:
        raise RuntimeError("a failing object")

    __array__ = __len__ = __iter__ = __getitem__ = __float__ = __complex__ = __repr__ = _fail


@pytest.mark.parametrize(
    "values",
    [10**400, [1, 10**400], [Fraction(10**400, 3), 1], np.array([1e308, 1.0], np.longdouble) * 1e100, Fails(), [Fails(), 1.0],
     ["1", "2"], [True, False], [1.0, np.nan], [1.0, complex(0.0, np.inf)], np.array(["2020", "2021"], "M8[ns]"), {}],
)  # fmt: skip
def test_values_that_are_no_complex_numbers(values: Any) -> None:
    with pytest.raises(
        ArgumentError, match=r"values is .*; expected 2 finite complex numbers, one for each frequency in omega"
    ):
        gl.MeasuredResponse([1.0, 2.0], values, "a", "b")


def test_a_response_has_at_least_one_frequency() -> None:
    with pytest.raises(
        ArgumentError, match=r"^values is \[\]; expected some finite complex numbers, one for each frequency in omega$"
    ):
        gl.MeasuredResponse([], [], "a", "b")
    assert gl.MeasuredResponse(2.0, [1j], "a", "b").omega.tolist() == [2.0]


def test_values_may_be_numbers_of_any_kind() -> None:
    found = gl.MeasuredResponse([1.0, 2.0, 3.0], [Fraction(1, 4), sympy.Rational(1, 2), np.complex64(2j)], "a", "b").values
    assert found.dtype == complex
    assert found.tolist() == [0.25, 0.5, 2j]


@pytest.mark.parametrize("numbers", [[1e308], [0.5], [-1], [2.0**60], [2**53]])
def test_numbers_of_modes_are_whole(numbers: Any) -> None:
    with pytest.raises(ArgumentError, match=r"numbers is .*; expected the index of each mode, a whole number, 0 or more"):
        gl.MeasuredModes([1.0], numbers=numbers)
    assert gl.MeasuredModes([1.0], numbers=[2**53 - 1]).numbers == 2**53 - 1


def test_measurements_that_are_none() -> None:
    with pytest.raises(gl.GearlibError, match="no margin was given"):
        gl.MeasuredMargins(("a", "b"))
    with pytest.raises(gl.GearlibError, match="expected 2 finite complex numbers"):
        gl.MeasuredResponse([1.0, 2.0], [1.0], "a", "b")
    with pytest.raises(gl.GearlibError, match=r"damping has the shape \(2,\); expected one for each of 1"):
        gl.MeasuredModes([1.0], [0.1, 0.2])
    with pytest.raises(gl.GearlibError, match="numbers names mode 7"):
        gl.fit(system(), gl.MeasuredModes([1.0], numbers=[7]), FREE)
    with pytest.raises(gl.GearlibError, match=r"^the loop torque\.tau -> load\.w has no phase_margin with {.*}: it is inf$"):
        gl.fit(system(), gl.MeasuredMargins(("torque.tau", "load.w"), phase_margin=3.0, gain=1e-3), FREE)
    with pytest.raises(gl.GearlibError, match=r"'shaft\.x' was not free"):
        gl.fit(system(), gl.MeasuredModes([3.0]), {"shaft.c": (1e2, 1e4)})["shaft.x"]


# ---------------------------------------------------------------- what is measured


def test_series_have_the_units_and_places_of_what_was_measured() -> None:
    histories = gl.MeasuredHistories(
        {"time": [0.0, 0.5, 1.0], "load.w": [1, 2, 3], "shaft.tau": [np.nan, 2.0, np.nan]}, noise={"load.w": 0.5}
    )
    speed, torque = histories.series(system())
    assert (speed.name, speed.unit, speed.along, speed.noise) == ("load.w", "rad/s", "time, s", 0.5)
    assert (speed.x.tolist(), speed.numbers.tolist()) == ([0.0, 0.5, 1.0], [1.0, 2.0, 3.0])
    assert (torque.unit, torque.x.tolist(), torque.values.tolist(), torque.noise) == ("N.m", [0.5], [2.0], None)
    (response,) = gl.MeasuredResponse([np.pi, 4 * np.pi], [1 + 2j, 3 - 4j], "torque.tau", "load.w", noise=0.1).series(system())
    assert (response.name, response.unit) == ("load.w to torque.tau", "rad/s per N.m")
    assert (response.x.tolist(), response.along, response.noise) == ([0.5, 2.0], "frequency, Hz", 0.1)
    assert response.numbers.tolist() == [1.0, 3.0, 2.0, -4.0]  # real parts, then imaginary ones
    frequencies, damping = gl.MeasuredModes([2.0, 3.0], [0.1, 0.2], numbers=[0, 2], noise={"damping": 0.01}).series(system())
    assert (frequencies.unit, frequencies.noise, damping.unit, damping.noise) == ("Hz", None, "1", 0.01)
    assert (damping.x.tolist(), damping.along) == ([0.0, 2.0], "mode")
    assert gl.MeasuredModes([2.0], 0.1, noise=0.3).noise == {"frequencies": 0.3}
    margins = gl.MeasuredMargins(
        ("a", "b"), gain_margin_db=6.0, phase_margin=30.0, delay_margin=0.1, modulus_margin=0.5, noise=2.0
    )
    assert [(s.name, s.unit, s.values.tolist(), s.noise) for s in margins.series(system())] == [
        ("gain_margin_db", "dB", [6.0], 2.0), ("phase_margin", "deg", [30.0], 2.0), ("delay_margin", "s", [0.1], 2.0),
        ("modulus_margin", "1", [0.5], 2.0),
    ]  # fmt: skip
    shown = [repr(m) for m in (histories, gl.MeasuredModes([2.0, 3.0], [0.1, 0.2]), gl.MeasuredModes([2.0]), margins)]
    assert shown == [
        "<MeasuredHistories of load.w, shaft.tau: 3 times>", "<MeasuredModes: 2 frequencies and damping>",
        "<MeasuredModes: 1 frequencies>",
        "<MeasuredMargins of a -> b: gain_margin_db, phase_margin, delay_margin, modulus_margin>",
    ]  # fmt: skip


def test_differences_of_runs_are_the_tangents() -> None:
    """Where histories are not asked for with exact derivatives: of a parameter and of start values, also one that is zero."""
    data = measured(0, noise=0.0)
    at = {"shaft.c": 430.0, "start(motor.w)": 0.0, "start(load.w)": -2.0, "brake.d": 2e-3}
    exact, differences = (data.predicted(system(), at, wanted) for wanted in (True, False))
    assert exact.approximate == differences.approximate == ""
    for tangent, difference, values, own in zip(
        exact.slopes, differences.slopes, exact.values, differences.values, strict=True
    ):
        assert own == pytest.approx(values, rel=1e-6, abs=1e-8)
        for k in range(4):
            np.testing.assert_allclose(difference[:, k], tangent[:, k], atol=2e-5 * np.abs(tangent[:, k]).max())


@pytest.mark.parametrize("scale", [1.0, 1e-2, 1e-4])
def test_a_parameter_of_little_influence_is_found_where_the_data_shows_it(scale: float) -> None:
    """A brake that takes a ten-thousandth of the speed, and less: data without noise determines it all the same."""
    run = system().simulate(2.0, times=TIME, rtol=1e-12, **PLANS[0], parameters={"brake.d": 5e-4 * scale})
    data = gl.MeasuredHistories({"time": TIME, "load.w": run["load.w"]}, **PLANS[0])
    found = gl.fit(system(), data, {"brake.d": (1e-6 * scale, 1e-3 * scale)})
    assert found["brake.d"] == pytest.approx(5e-4 * scale, rel=1e-3)
    assert found.converged


def test_what_is_free_does_not_move_what_it_is_not_in() -> None:
    """A start value moves no response, no mode and no margin: its column is zero, beside those of parameters."""
    at = {"shaft.c": 430.0, "start(motor.w)": 1.0, "shaft.d": 2.4}
    for data in of_all_kinds()[1:]:
        slopes = np.concatenate(data.predicted(system(), at).slopes)
        alone = np.concatenate(data.predicted(system(), {"shaft.d": 2.4, "shaft.c": 430.0}).slopes)
        assert slopes == pytest.approx(np.column_stack([alone[:, 1], 0 * alone[:, 0], alone[:, 0]]), rel=1e-12)
        assert data.predicted(system(), {"start(motor.w)": 1.0}).slopes[0] == pytest.approx(
            np.zeros((len(slopes) // len(data.series(system())), 1))
        )


def test_experiments_have_their_own_gain_margins_in_decibels() -> None:
    loop = ("torque.tau", "load.w")
    data = gl.MeasuredMargins(loop, gain_margin_db=3.0, modulus_margin=0.2, gain=300.0, parameters={"brake.d": 0.7})
    report = gl.stability(system(), loop, gain=300.0, parameters={"brake.d": 0.7, "shaft.c": 500.0}).loop
    assert report is not None
    found = data.predicted(system(), {"shaft.c": 500.0})
    assert found.values[0] == pytest.approx([20 * np.log10(report.margins.gain_margin)])
    assert found.values[1] == pytest.approx([report.margins.modulus_margin])


@pytest.mark.parametrize(("count", "numbers"), [(1, [2]), (1, [5]), (2, [0, 1])])
def test_modes_that_the_system_does_not_have(count: int, numbers: list[int]) -> None:
    """The drive vibrates in one mode, number 0."""
    with pytest.raises(ArgumentError, match=rf"numbers names mode {max(numbers)}; the system has 1 that vibrate"):
        gl.MeasuredModes([3.0] * count, numbers=numbers).predicted(system(), {"shaft.c": 400.0})
    assert gl.MeasuredModes([3.0], numbers=[0]).predicted(system(), {"shaft.c": 400.0}).values[0] == pytest.approx(
        gl.modes(system()).frequencies
    )


# ---------------------------------------------------------------- the search


@pytest.mark.parametrize(
    ("bounds", "begin"),
    [
        ((100.0, 1e4), 400.0),  # the model's own value
        ((400.0, 1600.0), 800.0),  # at a bound the search could not leave it: the middle of the logarithms
        ((100.0, 400.0), 200.0),
        ((900.0, 2500.0), 1500.0),
        ((0.0, 300.0), 150.0),  # no logarithms down to zero
        ((-100.0, 300.0), 100.0),
    ],
)
def test_where_a_search_begins(bounds: tuple[float, float], begin: float) -> None:
    found = gl.fit(system(), gl.MeasuredModes([5.0], noise=0.1), {"shaft.c": bounds}, evaluations=1)
    assert found.begin == pytest.approx([begin], rel=1e-12)
    assert found.bounds.tolist() == [list(bounds)]
    assert found.evaluations >= 1


def test_the_error_of_a_parameter_is_that_of_its_derivative() -> None:
    """One frequency f = sqrt(c / J) / 2 pi with an error s: that of c is 2 c s / f, whether c is sought by its logarithm or not."""
    for low in (100.0, -100.0):
        found = gl.fit(system(), gl.MeasuredModes([6.0], noise=0.06), {"shaft.c": (low, 5e3)})
        f = gl.modes(system(), parameters=found.values).frequencies[0]
        assert f == pytest.approx(6.0, rel=1e-6)
        assert found.standard_errors["shaft.c"] == pytest.approx(2 * found["shaft.c"] * 0.01, rel=2e-3)  # little damping
        assert (found.units, found.names, found.noise_given) == (("N.m/rad",), ("shaft.c",), True)
        assert found.residuals == pytest.approx([0.0], abs=1e-5)


def test_a_search_is_told_by_the_part_of_its_evaluations() -> None:
    told: list[float] = []
    found = gl.fit(
        system(),
        gl.MeasuredModes([6.0], noise=0.1),
        {"shaft.c": (100.0, 5e3)},
        evaluations=20,
        progress=lambda f, _: told.append(f),
    )
    assert told == pytest.approx([min(1.0, k / 20) for k in range(2, found.evaluations + 1)])  # the first is before the search
    assert found.converged


def test_without_noise_each_series_counts_by_its_spread() -> None:
    """Two histories in very different units; the noise is that part of each spread which the residuals show; constants count by size."""
    run = histories(0)
    rng = np.random.default_rng(5)
    data = {n: run[n] + 0.02 * np.std(run[n]) * rng.normal(size=len(TIME)) for n in ("load.w", "shaft.tau")}
    found = gl.fit(system(), gl.MeasuredHistories({"time": TIME, **data}, **PLANS[0]), FREE)
    for s in found.series:
        own = np.std(data[s.name])
        assert s.noise == pytest.approx(0.02 * own, rel=0.1)
        here = found.residuals[: len(TIME)] if s.name == "load.w" else found.residuals[len(TIME) :]
        assert here == pytest.approx((s.predicted - s.measured) / own)
    still = gl.fit(system(), gl.MeasuredModes([6.0]), {"shaft.c": (600.0, 5e3)}, evaluations=1)
    assert still.residuals == pytest.approx((still.series[0].predicted - 6.0) / 6.0)
    assert np.isnan([still.standard_errors["shaft.c"], still.series[0].noise]).all()  # one number, which the parameter takes
    assert np.std([0.05] * 3) > 0.0  # by rounding of the mean
    thrice = gl.MeasuredModes([6.0] * 3, [0.05] * 3, numbers=[0, 0, 0])
    same = gl.fit(system(), thrice, {"shaft.c": (600.0, 5e3)}, evaluations=1)
    assert same.residuals[3:] == pytest.approx((same.series[1].predicted - 0.05) / 0.05)


class Swing(gl.Component):
    """A body on a spring with damping, c / J = 10."""

    d = gl.Parameter("N.m.s/rad", "damping", default=0.5, min=0)

    def assemble(self) -> list[gl.Connection]:
        self.body, self.shaft, self.wall = (
            gp.Inertia(J=1.0, start={"phi": 0.0, "w": 1.0}),
            gp.SpringDamper(c=10.0, d=self.d),
            gp.Fixed(),
        )
        return [gl.connect(self.body.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.wall.flange)]


@pytest.mark.parametrize("growth", [-0.005, 0.005])
def test_a_value_that_tends_to_a_bound_of_zero_is_at_its_bound(growth: float) -> None:
    """cos(sqrt(10) t) exp(g t) is nearly the motion with d = -2 g; where it grows, the best damping is none."""
    t = np.linspace(0.0, 5.0, 101)
    measured = {"time": t, "body.w": np.cos(np.sqrt(10.0) * t) * np.exp(growth * t)}
    found = gl.fit(gl.compile(Swing(), outputs=["body.w"]), measured, free={"d": (0.0, 2.0)})
    assert found["d"] == pytest.approx(max(-2 * growth, 0.0), abs=1e-3)
    assert found.at_bounds == (("d",) if growth > 0 else ())
    assert ("at its bound" in str(found)) == (growth > 0)


@pytest.mark.parametrize(("low", "high", "size"), [(-1.0, 1.0, 1.0), (0.0, 1.0, 1.0), (-1e-6, 2e-6, 1e-6), (-1e7, 1e7, 1.0)])
def test_differences_of_runs_of_a_parameter_near_zero(low: float, high: float, size: float) -> None:
    """By hand: y = 3 + sin(p / size), dy/dp = cos(p / size) / size, also where p is far below what rounding leaves of y."""

    class Shifted(gl.Component):
        p, least = gl.Parameter("1", default=0.0), gl.Parameter("1", default=1.0)
        x, y, second = gl.Variable("1", start=2.0), gl.Variable("1"), gl.Parameter("s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(self.second * gl.der(self.x), -self.x), gl.Eq(self.y, 3 + gl.sin(self.p / self.least))]

    shifted, time = gl.compile(Shifted()), np.linspace(0.0, 1.0, 5)
    data = gl.MeasuredHistories({"time": time, "y": 0 * time}, parameters={"least": size})
    data.bounds = {"p": (low, high)}
    for p in (0.0, 1e-13 * size, 1e-7 * size, 0.1 * size):
        (slopes,) = data.predicted(shifted, {"p": p}, False).slopes
        np.testing.assert_allclose(slopes[:, 0], np.cos(p / size) / size, rtol=1e-5)


def test_differences_of_runs_stay_within_the_bounds() -> None:
    """A spring's damping that is found to be none has no run with a negative one; its standard error is the textbook's."""

    class Untangled(gl.MeasuredHistories):
        def predicted(self, system: Any, free: Any, exact: bool = True) -> Any:
            return super().predicted(system, free, False)

    time, noise = np.linspace(0.0, 2.0, 41), np.random.default_rng(3).normal(size=41)
    train = system()
    run = train.simulate(2.0, times=time, parameters={"shaft.d": 0.0}, rtol=1e-10, inputs={"torque.tau": 5.0})
    measured = {"time": time, "load.w": run["load.w"] + 1e-2 * noise}
    both = [
        gl.fit(train, kind(measured, inputs={"torque.tau": 5.0}), {"shaft.d": (0.0, 10.0)}, noise=1e-2)
        for kind in (gl.MeasuredHistories, Untangled)
    ]
    assert both[1]["shaft.d"] == pytest.approx(both[0]["shaft.d"], abs=1e-3 * both[0].standard_errors["shaft.d"])
    assert both[1].standard_errors["shaft.d"] == pytest.approx(both[0].standard_errors["shaft.d"], rel=1e-3)


class Hardening(gl.Component):
    """x'' = -k (x + x^3) - d x' + u, in SI units; the angle at the start has no value of its own."""

    k, d = gl.Parameter("1", default=2.0), gl.Parameter("1", default=0.1)
    second = gl.Parameter("s", default=1.0)
    x, v, u = gl.Variable("1"), gl.Variable("1"), gl.Input("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.second * gl.der(self.x), self.v),
            gl.Eq(self.second * gl.der(self.v), self.u - self.k * (self.x + self.x**3) - self.d * self.v),
        ]


@pytest.mark.parametrize("at", [None, {"v": 0.0}, {"x": 3.0}])
def test_free_start_values_move_the_point_at_which_linear_models_are_taken(at: dict[str, float] | None) -> None:
    """By hand: stiffness k (1 + 3 x^2) at the start. It was that of the model's own start, whatever the start was found to be."""
    hardening, omega, place, k = gl.compile(Hardening()), np.array([0.5, 3.0]), 0.7, 1.5
    free = {"start(x)": place, "k": k}
    stiffness, slope = k * (1 + 3 * place**2), np.array([6 * k * place, 1 + 3 * place**2])
    response = 1 / (stiffness - omega**2 + 0.1j * omega)
    found = gl.MeasuredResponse(omega, response, "u", "x", at=at).predicted(hardening, free)
    np.testing.assert_allclose(found.values[0], response, rtol=1e-9)
    np.testing.assert_allclose(found.slopes[0], as_real(-(response**2)[:, None] * slope), rtol=1e-6)
    frequency = np.sqrt(stiffness)
    found = gl.MeasuredModes([1.0], [0.1], at=at).predicted(hardening, free)
    assert found.values == [pytest.approx([frequency / (2 * np.pi)]), pytest.approx([0.05 / frequency])]
    np.testing.assert_allclose(found.slopes[0], [slope / (4 * np.pi * frequency)], rtol=1e-6)
    np.testing.assert_allclose(found.slopes[1], [-0.025 * slope / frequency**3], rtol=1e-6)
    found = gl.MeasuredMargins(("u", "v"), phase_margin=90.0, gain=0.3, at=at).predicted(hardening, free)
    crossing = max(np.roots([1, 0, 0.1**2 - 2 * stiffness - 0.3**2, 0, stiffness**2]), key=abs)  # |0.3 i w| = |D(i w)|
    margin = np.degrees(np.angle(0.3j * crossing / (stiffness - crossing**2 + 0.1j * crossing)))
    assert abs(found.values[0][0]) == pytest.approx(180 - abs(margin), rel=1e-6)
    steady = gl.MeasuredModes([1.0], at="steady").predicted(hardening, free)
    assert steady.values[0] == pytest.approx([np.sqrt(k) / (2 * np.pi)], rel=1e-4)
    assert steady.slopes[0][0, 0] == 0.0


def test_a_start_value_and_a_stiffness_are_found_from_modes_and_histories() -> None:
    hardening, time, omega = gl.compile(Hardening()), np.linspace(0.0, 3.0, 31), np.array([2.0, 3.0, 4.0])
    run = hardening.simulate(3.0, times=time, parameters={"k": 1.5}, start={"x": 0.7}, inputs={"u": 0.0}, rtol=1e-10)
    data = [
        gl.MeasuredResponse(omega, 1 / (1.5 * (1 + 3 * 0.49) - omega**2 + 0.1j * omega), "u", "x", noise=1e-3),
        gl.MeasuredHistories({"time": time, "x": run["x"]}, inputs={"u": 0.0}, noise=1e-2),
    ]
    found = gl.fit(hardening, data, {"k": (0.1, 10.0), "start(x)": (0.1, 2.0)})
    assert found.values == pytest.approx({"k": 1.5, "start(x)": 0.7}, rel=1e-5)
