"""Quadrature of states beside a run: exact for polynomials, whatever is evaluated at once; and which states can be integrated so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.records import altered
from gearlib.run.afterwards import beside
from gearlib.run.afterwards.beside import COARSE, FINE, Gauss, integrated_beside
from tests.run.afterwards.test_beside import Integrals


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_gauss_integrates_polynomials(order: int) -> None:
    """Over the whole interval up to degree 2 n - 1, up to each of its points up to degree n - 1."""
    own = Gauss(order)
    assert ((own.points > 0) & (own.points < 1)).all()
    assert (np.diff(own.points) > 0).all()
    for degree in range(2 * order):
        assert own.weights @ own.points**degree == pytest.approx(1 / (degree + 1), rel=1e-12)
    assert own.weights @ own.points ** (2 * order) != pytest.approx(1 / (2 * order + 1), rel=1e-6)
    for degree in range(order):
        expected = own.points ** (degree + 1) / (degree + 1)
        assert own.up_to @ own.points**degree == pytest.approx(expected, rel=1e-10)
    assert (len(FINE.points), len(COARSE.points)) == (4, 3)


SYSTEM = gl.compile(Integrals(), outputs=["x"])


def parts(names: list[str], **options: Any) -> tuple[Any, Any, Any]:
    """The segment of a run that integrates x, a scene with more states, and their start."""
    result: Any = SYSTEM.simulate(2.0, **{"samples": 5, "rtol": 1e-8, "method": "rk8", **options})
    own = result._segments[0]
    wanted = {*own.scene.states, *(SYSTEM.translation.structure.named(name, "variable", ("", ""))[0] for name in names)}
    scene = SYSTEM.translation.with_states(tuple(sorted(wanted)))
    return own, scene, own.begun(scene).states


@pytest.mark.parametrize("at_once", [1, 3000, 10**9])
def test_whatever_is_evaluated_at_once(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """y = log(1 + t) and z = y^2 / 2, step by step or all together."""
    monkeypatch.setattr(beside, "AT_ONCE", at_once)
    own, scene, start = parts(["y", "z"])
    found = integrated_beside(own, scene, start, 1e-8)
    assert found is not None
    y = np.log1p(own.time)
    by_name = dict(zip(scene.state_names, found.T, strict=True))
    assert by_name["y"] == pytest.approx(y, abs=1e-9)
    assert by_name["z"] == pytest.approx(0.5 * y**2, abs=1e-9)


def test_samples_may_begin_late() -> None:
    own, scene, start = parts(["y"], samples=None, times=[0.7, 1.9])
    found = integrated_beside(own, scene, start, 1e-8)
    assert found is not None
    assert found[:, scene.state_names.index("y")] == pytest.approx(np.log1p([0.7, 1.9]), abs=1e-9)


def test_what_cannot_be_integrated_beside_the_run() -> None:
    """What depends on itself; a start at which the run's own states are others; a run of which nothing was kept."""
    own, scene, start = parts(["y", "slow"])
    assert integrated_beside(own, scene, start, 1e-8) is None
    own, scene, start = parts(["y"])
    x = scene.state_names.index("x")
    for change, possible in ((0.9e-9, True), (1.1e-9, False), (-1.1e-9, False)):
        moved = start.copy()
        moved[x] *= 1 + change
        assert (integrated_beside(own, scene, moved, 1e-8) is not None) == possible
    assert own.trace is not None
    late = altered(own.trace, origin=own.trace.origin + 0.5 * (own.time[1] - own.time[0]))
    for trace in (None, late):  # or from the first sample on
        assert integrated_beside(altered(own, trace=trace), scene, start, 1e-8) is None
