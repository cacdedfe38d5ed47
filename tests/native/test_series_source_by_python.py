"""Recurrences of each function alone, carried out by Python: Taylor coefficients against mpmath's series."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

import gearlib as gl
from gearlib.native.series_source import HEAD, ROW, NoSeriesError, TaylorSeries, taylor_series, taylor_source
from gearlib.native.source import HEADER
from tests.compiler.test_translate import SCOPE, Number
from tests.native.test_series_source import FUNCTIONS, ORDER, driven

ALONE = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "sqrt", "log", "atan", "asin", "acos"]
MORE: dict[str, tuple[Any, Any]] = {
    f"{name} alone": (lambda x, t, f=name: getattr(gl, f)(x / 3 + t / 7), lambda x, t, f=name: getattr(mp, f)(x / 3 + t / 7))
    for name in ALONE
}


@pytest.mark.parametrize("kind", [*FUNCTIONS, *MORE])
def test_every_function_has_the_coefficients_of_its_solution(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a sum, a product, a root, a power, a tangent, an exponential, a pair of sines, an angle: from x = 1.3 at t = 0.8 on, x = t + 0.5.

    So y is an integral over time.
    """
    monkeypatch.setitem(FUNCTIONS, kind, (FUNCTIONS | MORE)[kind])
    translation = gl.compile(driven((kind,))).translation
    scene = translation.scene
    text, write = taylor_source(scene.program, scene.layout)
    assert text.startswith(HEAD)
    numbers = scene.numbers(translation.parameter_values({}))
    data = np.zeros(scene.layout.size)
    data[: len(numbers.parameters)] = numbers.parameters
    c, work = [[Number(v) for v in (1.3, 0.0, *[0.0] * (2 * ORDER))], [Number(np.nan)] * (write.rows * ROW)]
    names: dict[str, Any] = dict(SCOPE)
    exec("from __future__ import annotations\n" + text, names)
    assert names["series"](Number(0.8), c, work, [Number(v) for v in data], [], ORDER, 2) == 0
    found = np.array(c, float).reshape(ORDER + 1, 2)
    assert found[:, 0].tolist() == [1.3, 1.0, *[0.0] * (ORDER - 1)]
    with mp.workdps(40):
        exact = mp.taylor(lambda t: FUNCTIONS[kind][1](t + mp.mpf(1) / 2, t), mp.mpf("0.8"), ORDER - 1)
    wanted = [float(a / k) for k, a in enumerate(exact, 1)]
    assert found[1:, 1] == pytest.approx(wanted, rel=1e-11, abs=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("most", [1, 2])
def test_so_many_differences_are_kept(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are more, what happens within a step is hidden."""
    monkeypatch.setattr("gearlib.native.series_source.MOST_COMPARED", most)
    right = lambda x, t: gl.no_event(gl.Piecewise((x, x > 1), (t, True)) + gl.Piecewise((1, t > 3), (2, True)))  # noqa: E731
    monkeypatch.setitem(FUNCTIONS, "compared", (right, None))
    scene = gl.compile(driven(("compared",))).translation.scene
    _, write = taylor_source(scene.program, scene.layout)
    assert (len(write.compared), write.hides) == ((2, False) if most == 2 else (0, True))
    series = taylor_series(scene.program, scene.layout)
    assert isinstance(series, TaylorSeries)
    assert (series.compared, series.hides, series.branches) == (len(write.compared), write.hides, True)
    assert (series.rows, series.sums, series.products) == (write.rows, len(write.later), write.products)
    assert not series.guarded
    assert not series.pulses
    assert series.address > 0
    assert HEADER.startswith('"""')


def test_what_has_no_series_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> None:
        raise NoSeriesError("has no Taylor series for a choice by x")

    scene = gl.compile(driven(("powers",))).translation.scene
    monkeypatch.setattr("gearlib.native.series_source.taylor_source", refused)
    assert taylor_series(scene.program, scene.layout) == "has no Taylor series for a choice by x"
