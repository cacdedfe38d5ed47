"""What a sweep keeps of each kind of result: of results that are written down."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.many_runs.analysing import Analysing, kept
from gearlib.many_runs.reductions import final, peak
from gearlib.many_runs.samples import as_samples


def test_of_a_stability_report_the_growth_and_the_least_damping() -> None:
    """Of the fastest motion, and of what vibrates; with a loop, its margins and the growth when it is closed."""
    model = control.tf([3.0], np.polymul([1, 2.0], [1, 0.4, 4.0]))
    row = kept(gl.stability(model)).values
    assert row == pytest.approx({"growth": -0.2, "least_damping": 0.1})
    report = gl.stability(model, (0, 0))
    assert report.loop is not None
    m = report.loop.margins
    with_loop = kept(report).values
    closed = np.roots(np.polyadd([3.0], np.polymul([1, 2.0], [1, 0.4, 4.0])))
    assert with_loop == pytest.approx(row | {
        "gain_margin": m.gain_margin, "phase_margin": m.phase_margin, "delay_margin": m.delay_margin,
        "modulus_margin": m.modulus_margin, "closed_growth": closed.real.max(),
    })  # fmt: skip
    assert kept(gl.stability(control.tf([1.0], [1, -3.0]))).values == {"growth": 3.0, "least_damping": np.inf}


def test_of_harmonic_balance_the_peak_of_each_output_and_where_it_is() -> None:
    series = np.zeros((3, 3, 2))
    series[:, 1, 0], series[:, 2, 1] = [1.0, -4.0, 2.0], [5.0, 3.0, 6.0]
    options: dict[str, Any] = {
        "folds": (1,),
        "outputs": ("x", "y"),
        "units": ("m", "m"),
        "complete": True,
        "error": np.zeros(3),
    }
    for multiplier, stable in ((0.9, 1.0), (1.1, 0.0)):
        found = gl.HarmonicBalance(np.array([7.0, 8.0, 9.0]), series, np.array([[0.5], [multiplier], [0.5]]), **options)
        row = kept(found)
        assert row.values["peak"].tolist() == [4.0, 6.0]
        assert row.values["peak_omega"].tolist() == [8.0, 9.0]
        assert (row.values["folds"], row.values["all_stable"]) == (1.0, stable)
        assert row.coordinates == {"output": ("x", "y")}


def test_of_modes_those_that_vibrate_padded_to_the_number_of_states(chain: Any) -> None:
    modes = gl.modes(chain(n=3), parameters={"d": 1.0})  # turns freely: one mode at zero, two that vibrate
    row = kept(modes).values
    n, count = len(modes.states), len(modes.eigenvalues) - modes.free
    assert (row["eigenvalues"].shape, row["shapes"].shape) == ((n,) if count < n else (count,), (n, max(n, count)))
    assert row["eigenvalues"][:count].tolist() == modes.eigenvalues[modes.free :].tolist()
    assert np.isnan(row["eigenvalues"][count:]).all()
    assert row["shapes"][:, :count].tolist() == modes.shapes[:, modes.free :].tolist()
    assert np.isnan(row["shapes"][:, count:]).all()


def test_of_frequency_responses_and_power_flows_all_with_their_names(chain: Any) -> None:
    system = chain(n=2, grounded=True)
    response = gl.frequency_response(system, [1.0, 2.0], ["torque.tau"], ["body[0].w"])
    row = kept(response)
    assert row.values["response"] is response.values
    assert (tuple(row.coordinates["output"]), tuple(row.coordinates["input"])) == (("body[0].w",), ("torque.tau",))
    assert list(row.coordinates["omega"]) == [1.0, 2.0]
    flow = gl.power_flow(system, torques={"torque.tau": 1.0})
    row = kept(flow)
    assert row.coordinates["flange"] == tuple(f.name for f in flow.flanges)
    for name in ("speed", "torque", "power"):
        assert row.values[name] == [getattr(f, name) for f in flow.flanges]
    assert row.values["input_power"] == flow.input_power
    still = gl.steady_state(system, inputs={"torque.tau": 1.0})
    assert kept(still).values == dict(zip(still.names, map(float, still.values), strict=True))


def test_of_anything_else_nothing_is_known() -> None:
    with pytest.raises(
        ArgumentError, match=r"analysis returned a float; say what is to be kept of it: reduce=\{'name': function\}"
    ):
        kept(3.0)


def test_reductions_of_histories() -> None:
    """The last value, and the largest magnitude on either side, of one history or of many."""
    histories = np.array([[1.0, -5.0, 2.0], [3.0, 4.0, -1.0], [0.0, 0.0, 0.0]])
    assert final("w").of(histories).tolist() == [2.0, -1.0, 0.0]
    assert peak("w").of(histories).tolist() == [5.0, 4.0, 0.0]
    assert (final("w")({"w": histories[0]}), peak("w")({"w": histories[0]})) == (2.0, 5.0)
    for made in (final, peak):
        with pytest.raises(ArgumentError, match=r"name is 3; expected a name, such as 'load\.w'"):
            made(3)  # type: ignore[arg-type]


def test_modes_that_are_followed_have_frequencies_damping_and_numbers() -> None:
    """Of eigenvalues that are written down: a pair, one without damping, one that is missing; shapes are not shown."""
    work = Analysing(gl.modes, None, {}, {})  # type: ignore[arg-type]
    samples, nothing = as_samples({"a": [0.0, 1.0]}), np.nan + 0j
    values = np.array([[-3 + 4j, 0 + 12j], [-0.5 + 12j, nothing]])
    shapes = np.array([np.eye(2), np.eye(2)[:, ::-1]], complex)
    shapes[1, :, 1] = nothing
    found, axes = work.finished(samples, {"eigenvalues": values, "shapes": shapes})
    assert list(found) == ["frequencies", "damping", "eigenvalues", "number"]
    assert axes == dict.fromkeys(found, ("mode",))
    np.testing.assert_allclose(2 * np.pi * found["frequencies"], [[5.0, 12.0], [np.nan, np.hypot(0.5, 12.0)]])
    np.testing.assert_allclose(found["damping"], [[0.6, 0.0], [np.nan, 0.5 / np.hypot(0.5, 12.0)]])
    np.testing.assert_array_equal(found["eigenvalues"], [[-3 + 4j, 12j], [nothing, -0.5 + 12j]])
    np.testing.assert_array_equal(found["number"], [[0, 1], [np.nan, 0]])
    assert work.presented(["eigenvalues", "shapes"]) == tuple(found)
    assert work.presented(["growth"]) == ["growth"]
    plain = {"growth": np.zeros(2), "power": np.zeros((2, 3))}
    assert work.finished(samples, plain) == (plain, {"growth": (), "power": ("flange",)})
    assert work.reshapes
    assert not Analysing(gl.modes, None, {}, {"n": len}).reshapes  # type: ignore[arg-type]


def test_units_and_axes_of_what_an_analysis_gives(chain: Any) -> None:
    """Those of results by their kind, of variables by their own; a function of the user's has none."""
    system = chain(n=2, grounded=True)
    work, own = (Analysing(gl.modes, system, {}, reduce) for reduce in ({}, {"growth": len, "body[0].w": len}))
    assert [work.unit(n) for n in ("growth", "frequencies", "body[0].w", "torque.tau", "whatever")] == [
        "1/s",
        "Hz",
        "rad/s",
        "N.m",
        "",
    ]
    assert [own.unit(n) for n in ("growth", "body[0].w")] == ["", ""]
    assert (work.varied_unit("d"), work.varied_unit("whatever")) == (system.translation.parameter_units["d"], "")
    assert work.dimensions("response") == ("output", "input", "omega")
    assert (work.dimensions("growth"), own.dimensions("response")) == ((), ())


def test_an_analysis_is_given_what_varies_beside_what_all_runs_share() -> None:
    asked: list[Any] = []

    def analysis(system: Any, parameters: Any, depth: int) -> Any:
        asked.append((parameters, depth))
        if parameters["a"] < 0:
            raise ZeroDivisionError("no inverse")
        return 1.0

    work = Analysing(analysis, None, {"depth": 3, "parameters": {"b": 2.0, "a": 9.0}}, {"twice": lambda x: 2 * x})  # type: ignore[arg-type]
    assert work.row({"a": 1.0}).values == {"twice": 2.0}
    assert asked == [({"a": 1.0, "b": 2.0}, 3)]
    with pytest.raises(ArgumentError, match=r"^analysis raised ZeroDivisionError: no inverse$"):
        work.row({"a": -1.0})
    assert Analysing(lambda system, parameters: parameters, None, {}, {"n": len}).row({"a": 1.0}).values == {"n": 1}  # type: ignore[arg-type]
