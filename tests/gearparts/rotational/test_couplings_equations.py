"""What couplings are made of, and the angles of universal joints."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits
from tests.gearparts.test_declared_numbers import parameters


@pytest.mark.parametrize(
    ("element", "law"), [("linear", gp.SpringDamper), ("cubic", gp.CubicSpringDamper), ("backlash", gp.ElastoBacklash)]
)
@pytest.mark.parametrize("use_heat_port", [False, True])
def test_a_coupling_hands_its_values_to_its_hubs_and_its_element(element: str, law: Any, use_heat_port: bool) -> None:
    more = {"cubic": {"c_3": 5.0}, "backlash": {"b": 0.25}}.get(element, {})
    part = gp.ElasticCoupling(element=element, J_a=1.0, J_b=2.0, c=3.0, d=4.0, use_heat_port=use_heat_port, **more)
    found = parameters(part)
    expected = {"hub_a.J": 1.0, "hub_b.J": 2.0, "spring.c": 3.0, "spring.d": 4.0, "spring.phi_rel0": 0.0}
    expected |= {f"spring.{name}": value for name, value in more.items()}
    assert {name: found[name] for name in expected} == expected
    assert type(part.spring) is law
    assert part.spring.use_heat_port is use_heat_port


@pytest.mark.parametrize("angle", [-3.0, -1.0, 0.0, 0.4, math.pi / 2, 2.0, 3.1])
@pytest.mark.parametrize("beta", [-0.9, 0.0, 0.6])
def test_a_universal_joint_has_the_fork_s_angle_and_keeps_the_power(angle: float, beta: float) -> None:
    bend = math.cos(beta)
    turned = math.atan2(math.sin(angle), bend * math.cos(angle))  # tan(phi_b) = tan(phi_a) / cos(beta), in the same half turn
    ratio = bend / (math.sin(angle) ** 2 + bend**2 * math.cos(angle) ** 2)
    values = {"beta": beta, "flange_a.phi": angle, "flange_b.phi": turned, "flange_b.tau": 4.0, "flange_a.tau": -4.0 * ratio}
    assert misfits(gp.UniversalJoint(beta=beta), values) == []
