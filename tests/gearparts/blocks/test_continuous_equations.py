"""The equations of a limited controller, at numbers, for all the parts that it may have."""

from __future__ import annotations

import pytest

import gearparts as gp
from tests.gearparts.laws import right_side
from tests.gearparts.test_declared_numbers import parameters

B = gp.blocks
VALUES = {
    "k": 2.0, "Ti": 0.4, "Td": 0.3, "Nd": 5.0, "Ni": 0.8, "wp": 0.6, "wd": 0.2, "u_s": 3.0, "u_m": 0.5, "x_I": 1.5, "x_D": -0.7,
    "y_max": 4.0, "y_min": -1.0,
}  # fmt: skip
E = 0.2 * 3.0 - 0.5  # what its derivative part differentiates


@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
def test_a_controller_has_the_parts_of_its_name_and_no_others(kind: str) -> None:
    controller = B.LimPID(controller_type=kind, y_max=4.0)
    integral, derivative = 1.5 if "I" in kind else 0.0, 5.0 * (E + 0.7) if "D" in kind else 0.0
    assert right_side(controller, "v", **VALUES) == pytest.approx(2.0 * (0.6 * 3.0 - 0.5 + integral + derivative), rel=1e-14)
    if "I" in kind:  # while its output is 3 less than asked for, it integrates less
        at_limit = right_side(controller, "Ti*der(x_I)", **VALUES, v=7.0, y=4.0)
        assert at_limit == pytest.approx(2.5 - 3.0 / (2.0 * 0.8), rel=1e-14)
    else:
        assert right_side(controller, "x_I", **VALUES) == 0.0
    if "D" in kind:
        assert right_side(controller, "Td*der(x_D)/Nd", **VALUES) == pytest.approx(E + 0.7, rel=1e-14)
    else:
        assert right_side(controller, "x_D", **VALUES) == 0.0
    limited = [right_side(controller, "y", **VALUES, v=v) for v in (-1.25, -1.0, 0.5, 4.0, 4.25)]
    assert limited == [-1.0, -1.0, 0.5, 4.0, 4.0]


def test_limits_are_symmetric_unless_told_otherwise() -> None:
    given, symmetric = parameters(B.LimPID(y_max=2.0, y_min=-3.0)), parameters(B.LimPID(y_max=2.0))
    assert (given["room"], given["y_min"], symmetric["room"], symmetric["y_min"]) == (5.0, -3.0, 4.0, -2.0)


def test_every_gain_of_a_sum_is_that_of_its_input() -> None:
    values = {"k1": 2.0, "k2": 3.0, "k3": -5.0, "u1": 7.0, "u2": 11.0, "u3": 13.0}
    assert right_side(B.Add(), "y", **values) == 47.0
    assert right_side(B.Add3(), "y", **values) == -18.0
    assert right_side(B.Feedback(), "y", **values) == -4.0
    assert right_side(B.Product(), "y", **values) == 77.0
