"""Two gears in mesh between bodies, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Pair(gl.Component):
    """Two bodies joined by a mesh."""

    external = gl.Structural(True)
    J_a = gl.Parameter("kg.m2", "gear a", default=0.3)
    J_b = gl.Parameter("kg.m2", "gear b", default=0.7)
    r_a = gl.Parameter("m", "radius a", default=0.05)
    r_b = gl.Parameter("m", "radius b", default=0.11)
    c = gl.Parameter("N/m", "stiffness", default=2e6)
    d = gl.Parameter("N.s/m", "damping", default=300.0)
    e_rate = gl.Input("m/s", "transmission error", default=0.0)

    def assemble(self) -> Any:
        kind = gp.ExternalMesh if self.external else gp.InternalMesh
        self.a, self.b = gp.Inertia(J=self.J_a), gp.Inertia(J=self.J_b)
        self.mesh = kind(r_a=self.r_a, r_b=self.r_b, c=self.c, d=self.d, e_rate=self.e_rate)
        return [gl.connect(self.a.flange_b, self.mesh.flange_a), gl.connect(self.mesh.flange_b, self.b.flange_a)]


class Warm(gl.Component):
    """A mesh that heats a body."""

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.mesh = gp.ExternalMesh(r_a=0.1, r_b=0.2, c=1e5, d=50.0, use_heat_port=True)
        self.air = Air()
        return [
            gl.connect(self.a.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.b.flange_a),
            gl.connect(self.mesh.heat_port, self.air.port),
        ]


class Air(gl.Component):
    """Constant temperature."""

    port = gp.HeatPort()

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.port.T, 300.0)]


@pytest.mark.parametrize("external", [True, False])
def test_a_mesh_between_two_bodies_swings_with_the_reduced_mass(probe: Callable[..., Any], external: bool) -> None:
    p = probe(Pair(external=external))
    assert set(p.states) == {"a.w", "b.w", "mesh.q"}  # no absolute angle
    c, d, m = 2e6, 300.0, 1 / (0.05**2 / 0.3 + 0.11**2 / 0.7)
    swing = np.roots([m, d, c])
    expected = np.sort_complex(np.append(swing, 0.0))
    assert np.sort_complex(np.linalg.eigvals(p.A)) == pytest.approx(expected, abs=1e-9 * abs(swing[0]))


@pytest.mark.parametrize(("external", "sense"), [(True, 1), (False, -1)])
def test_signs(probe: Callable[..., Any], external: bool, sense: int) -> None:
    value = probe(Pair(external=external, e_rate=0.01)).values({"a.w": 3.0, "b.w": 2.0, "mesh.q": 1e-5})
    v = 0.05 * 3.0 + sense * 0.11 * 2.0 + 0.01
    f = 2e6 * 1e-5 + 300.0 * v
    assert value("mesh.v") == pytest.approx(v, rel=1e-14)
    assert value("der(mesh.q)") == value("mesh.v")
    assert value("mesh.f") == pytest.approx(f, rel=1e-14)
    assert 0.3 * value("der(a.w)") == pytest.approx(-0.05 * f, rel=1e-13)
    assert 0.7 * value("der(b.w)") == pytest.approx(-sense * 0.11 * f, rel=1e-13)


def test_power_into_a_mesh_is_stored_or_lost(probe: Callable[..., Any]) -> None:
    value = probe(Warm()).values({"a.w": 3.0, "b.w": 2.0, "mesh.q": 1e-5})
    power = value("mesh.flange_a.tau") * value("a.w") + value("mesh.flange_b.tau") * value("b.w")
    stored = 1e5 * value("mesh.q") * value("der(mesh.q)")
    assert value("air.port.Q_flow") == pytest.approx(50.0 * value("mesh.v") ** 2)
    assert power == pytest.approx(stored + value("air.port.Q_flow"), rel=1e-13)
