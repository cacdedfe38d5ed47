"""Campbell diagrams: their progress; the diagrams themselves are tested with the modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Rotor(gl.Component):
    """A disc on a shaft that is fixed at its other end, driven by a torque."""

    def assemble(self) -> list[Any]:
        self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=400.0, d=2.0), gp.Inertia(J=1.0)
        self.torque = gp.Torque()
        return [
            gl.connect(self.ground.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.disc.flange_a, self.torque.flange),
        ]


@pytest.mark.parametrize("varies", [False, True])
def test_progress_is_told_by_speeds(varies: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.progress.APART", 0.0)
    told: list[float] = []
    more: Any = {"parameters": lambda w: {"disc.J": 1.0 + 0.01 * w}} if varies else {}
    gl.campbell(gl.compile(Rotor()), [0.0, 10.0, 40.0], [2.0], progress=lambda f, _: told.append(f), **more)
    assert told == [0.0, 0.25, 1.0, 1.0]


def test_progress_of_a_harmonic_balance_is_told_by_frequencies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.progress.APART", 0.0)
    told: list[float] = []
    drive: Any = {"torque.tau": lambda phase, w: np.cos(phase)}
    gl.harmonic_balance(
        gl.compile(Rotor()), 15.0, 25.0, inputs=drive, outputs=["disc.w"], harmonics=1, progress=lambda f, _: told.append(f)
    )
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    assert len(told) > 5
