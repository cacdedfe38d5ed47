"""Events that accumulate before a certain time, after which a run is no motion of the model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import GearlibWarning


class Ball(gl.Component):
    """Bounces with a part of its speed; where ``rests``, it stays where it is once it is slow."""

    rests = gl.Structural(False)
    e = gl.Parameter("1", "coefficient of restitution", default=0.8)
    h = gl.Variable("m", start=1.0)
    v = gl.Variable("m/s")
    lies = gl.Discrete()

    def equations(self) -> list[Any]:
        slow = gl.And(self.h < 0, self.v > -1e-3) if self.rests else self.h < -1e9
        return [
            gl.Eq(gl.der(self.h), self.v * (1 - self.lies)),
            gl.Eq(gl.der(self.v), -9.81 * (1 - self.lies)),
            gl.When(slow, gl.Eq(self.lies, 1)),
            gl.When(self.h < 0, gl.reinit(self.v, -self.e * self.v)),
        ]


@pytest.mark.parametrize("method", ["rk", "ida", "taylor"])
@pytest.mark.parametrize("e", [0.95, 0.8, 0.3])
def test_a_run_that_passes_infinitely_many_bounces_warns(method: str, e: float) -> None:
    system = gl.compile(Ball())
    rests_at = np.sqrt(2 / 9.81) * (1 + 2 * e / (1 - e))
    before = system.simulate(0.99 * rests_at, method=method, parameters={"e": e})
    assert before["h"].min() > -1e-9
    with pytest.warns(GearlibWarning, match=r"of Ball: when_1 come ever faster until t = ") as said:
        system.simulate(1.5 * rests_at, method=method, parameters={"e": e})
    assert float(str(said[0].message).split("t = ")[1].split(" s")[0]) == pytest.approx(rests_at, rel=1e-4)


def test_a_ball_that_comes_to_rest_does_not() -> None:
    run = gl.compile(Ball(rests=True)).simulate(8.0)
    assert run["lies"][-1] == 1
    assert abs(run["h"][-1]) < 1e-6
