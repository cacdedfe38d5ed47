"""Where a run gives its samples: any times in the run, and no more than there is memory for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError


class Swing(gl.Component):
    """A body on a spring, started aside."""

    def assemble(self) -> list[Any]:
        self.body, self.spring, self.wall = gp.Inertia(J=1.0, start={"phi": 1.0, "w": 0.0}), gp.Spring(c=4.0), gp.Fixed()
        return [gl.connect(self.body.flange_a, self.spring.flange_a), gl.connect(self.spring.flange_b, self.wall.flange)]


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Swing(), outputs=["body.w"])


@pytest.mark.parametrize("method", ["exact", "rk", "ida"])
def test_times_may_begin_after_the_start(system: gl.System, method: str) -> None:
    times = [1.0, 1.5, 2.25]
    result = system.simulate(3.0, times=times, method=method, rtol=1e-10)
    t = np.array(times)
    assert result.time.tolist() == times
    assert result.states.shape == (3, len(system.states))
    assert result["body.w"] == pytest.approx(-2 * np.sin(2 * t), abs=1e-8)
    assert result["spring.tau"] == pytest.approx(-4 * np.cos(2 * t), abs=1e-8)  # computed from the states
    assert result["body.phi"] == pytest.approx(np.cos(2 * t), abs=1e-8)
    assert system.linearize([], at=(result, 1.2), sparse=True).A.shape == (2, 2)  # integrated again, from the start


def test_one_time_is_enough(system: gl.System) -> None:
    result = system.simulate(3.0, t_start=1.0, times=[3.0])
    assert result.time.tolist() == [3.0]
    assert result["body.w"] == pytest.approx(-2 * np.sin(2 * 2.0), abs=1e-9)


def test_events_before_the_first_sample_are_kept() -> None:
    class Bounce(gl.Component):
        x, v = gl.Variable("m", start=1.0), gl.Variable("m/s", start=0.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.v),
                gl.Eq(gl.der(self.v), -10),
                gl.When(self.x < 0, gl.reinit(self.v, -self.v)),
            ]

    result = gl.simulate(Bounce(), 1.0, times=[0.8, 1.0], method="rk", rtol=1e-10)
    assert result.events[0][0] == pytest.approx(np.sqrt(0.2), rel=1e-6)
    fall = np.sqrt(0.2)
    speed = np.sqrt(20.0)
    since = result.time - fall
    assert result["x"] == pytest.approx(speed * since - 5 * since**2, abs=1e-7)


def test_times_outside_the_run_are_refused(system: gl.System) -> None:
    for times in ([-0.1, 1.0], [1.0, 3.1]):
        with pytest.raises(ArgumentError, match=r"times must lie in t_start \.\. t_end \(0 \.\. 3\)"):
            system.simulate(3.0, times=times)


def test_more_samples_than_memory_are_refused(system: gl.System) -> None:
    with pytest.raises(ArgumentError, match=r"samples is 1000000000000: time and 2 states .* 2\.4e\+04 GB, .*times=\[1\]"):
        system.simulate(1.0, samples=10**12)
