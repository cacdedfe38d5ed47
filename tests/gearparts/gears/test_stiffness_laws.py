"""A law of one's own for the stiffness of a mesh, in one class."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from gearlib.language.expressions import real_symbol
from gearparts.gears.mesh_phase import ContactInterval
from gearparts.gears.stiffness_laws import FourierStiffness, SinusoidalStiffness, StiffnessLaw
from tests.gearparts.gears.test_mesh_models import R_A, R_B, Z_A, C, pair
from tests.gearparts.laws import plain, powers, right_side


@dataclass(frozen=True)
class SquaredCosine(gp.StiffnessLaw):
    """``1 + depth (cos(phase)**2 - 1/2)``."""

    depth: float

    def value(self, mesh: Any, phase: Any) -> Any:
        return 1 + self.depth * (gl.cos(phase) ** 2 - 0.5)

    def slope(self, mesh: Any, phase: Any) -> Any:
        return -self.depth * gl.sin(2 * phase)


class Deep(gp.DetailedExternalMesh):
    """A mesh with a parameter of its own, which its law reads."""

    depth = gl.Parameter("1", "variation of the stiffness", default=0.3)


class DeepLaw(gp.StiffnessLaw):
    def value(self, mesh: Any, phase: Any) -> Any:
        return 1 + mesh.depth * (gl.cos(phase) ** 2 - 0.5)


def test_a_law_of_one_s_own_against_scipy() -> None:
    t = np.linspace(0.0, 0.05, 26)

    def rate(_: float, x: np.ndarray) -> list[float]:
        f = C * (1 + 0.3 * (np.cos(Z_A * x[1] + 0.2) ** 2 - 0.5)) * x[0]
        return [R_A * x[2] + R_B * x[3], x[2], -R_A * f / 0.002, -R_B * f / 0.01]

    expected = solve_ivp(rate, (0, 0.05), [0, 0, 10.0, 0], "DOP853", t, rtol=1e-10, atol=1e-13, max_step=2e-4).y
    model = pair(stiffness_law=SquaredCosine(0.3), c_phase=0.2)
    result = gl.simulate(model, 0.05, samples=26, rtol=1e-9)
    assert result["mesh.q"] == pytest.approx(expected[0], abs=1e-6 * np.abs(expected[0]).max())
    assert result.energy_balance().relative_residual < 1e-6  # the slope is the value's


@pytest.mark.parametrize("terms", [((1.0, 0.2, 0.3),), ((1.0, 0.2, -0.4), (2.0, 0.1, 1.0), (3.0, 0.05, 2.0))])
def test_the_slope_of_a_law_of_the_library_is_that_of_its_value(terms: Any) -> None:
    phase, h = 0.7, 1e-6
    sinusoidal = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness="sinusoidal", c_amplitude=0.3)
    fourier = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness="fourier", stiffness_terms=terms)
    for law, mesh in ((SinusoidalStiffness(), sinusoidal), (FourierStiffness(), fourier)):
        by_difference = (law.value(mesh, phase + h) - law.value(mesh, phase - h)) / (2 * h)
        assert float(law.slope(mesh, phase)) == pytest.approx(float(by_difference), rel=1e-8)


@pytest.mark.parametrize(
    ("law", "least"),
    [
        ({"stiffness_terms": ((1, 0.6, 0.0), (2, 0.39, 0.5))}, None),
        ({"stiffness_terms": ((1, 1.0, 0.3),)}, None),
        ({"stiffness_terms": ((1, 1.0, 0.0),)}, None),  # a phase at which it is zero is among those that are tried
        ({"stiffness_terms": ((1, 1.0 + 9e-10, 0.0),)}, None),
        ({"stiffness_terms": ((1, 1.0 + 1.1e-9, 0.0),)}, "-1.1e-09"),
        ({"stiffness_terms": ((1, 1.5, 0.3),)}, "-0.5"),
        ({"stiffness_terms": ((1, 1.5, -1.0),)}, "-0.5"),  # in the second half of the period
        ({"stiffness_terms": ((1, 1.001, np.pi / 64),)}, "-0.0009"),  # for a hundredth of the period
        ({"stiffness_terms": ((1, 0.6, 0.0), (2, 0.5, 0.0))}, None),  # from 0.41 to 2.1
        ({"stiffness_terms": ((1, -0.6, 0.0), (2, -0.5, 0.0))}, "-0.1"),
        ({"stiffness_terms": ((3, 2e7, 0.0),)}, "-2e+07"),
        ({"stiffness_terms": ((0.05, 1.5, 0.0),)}, "-0.5"),  # once in 20 teeth
        ({"stiffness_terms": ((1 / 37, 0.7, 1.0), (1 / 23, 0.7, 2.0))}, "-0.39"),
        ({"stiffness_terms": ((1 / 37, 0.4, 1.0), (1 / 23, 0.4, 2.0), (1.0, 0.19, 0.0))}, None),
        ({"stiffness_table": ((0.0, 0.0), (2.0, 1.0), (4.0, 1.0))}, "-0."),  # the spline goes below its rows
        ({"stiffness_table": ((1.0, 0.5), (2.0, 1.0), (4.0, 1.0))}, None),
        ({"stiffness_table": ((0.0, 1.0), (2.0, -0.5), (4.0, 1.0))}, "-0."),
    ],
)
def test_a_stiffness_below_zero_is_refused(law: dict[str, Any], least: str | None) -> None:
    (name,) = law
    mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness="fourier" if "terms" in name else "table", **law)
    if least is None:
        flatten(mesh)
    else:
        said = rf"DetailedExternalMesh\.{name}: the stiffness falls to {re.escape(least)}.* times c; expected 0 or more"
        with pytest.raises(BindingError, match=said):
            flatten(mesh)


def test_terms_that_change_the_mean_stiffness_are_refused() -> None:
    terms = ((0.0, 1.0, 0.0), (1.0, 0.2, 0.0))
    mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness="fourier", stiffness_terms=terms)
    with pytest.raises(BindingError, match=r"DetailedExternalMesh\.stiffness_terms has the order 0; .* the mean is c"):
        flatten(mesh)


@pytest.mark.parametrize("kind", ["constant", "sinusoidal", "fourier", "table"])
def test_a_mesh_is_even_unless_a_pattern_is_given(kind: str) -> None:
    mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness=kind)
    law = mesh.law()
    for phase in (-0.5, 0.0, 1.0, 3.0, 5.0):
        at = real_symbol("phase_in_stiffness"), law.phase_in_table(mesh, phase)
        values = [plain(f(mesh, phase)).subs(*at) for f in (law.value, law.slope)]
        assert [float(value) for value in values] == pytest.approx([1.0, 0.0], abs=1e-15)
    assert StiffnessLaw().phase_in_table(mesh, 2.5) == 0


def test_a_law_may_read_a_parameter_of_a_derived_mesh() -> None:
    class Rig(gl.Component):
        def assemble(self) -> Any:
            self.a, self.b = gp.Inertia(J=0.002, start={"w": 10.0}), gp.Inertia(J=0.01)
            self.mesh = Deep(stiffness_law=DeepLaw(), r_a=R_A, r_b=R_B, z_a=float(Z_A), c=C, d=0.0, start={"q": 0.0})
            return [gl.connect(self.a.flange_b, self.mesh.flange_a), gl.connect(self.mesh.flange_b, self.b.flange_a)]

    ours = gl.compile(Rig()).simulate(0.02, samples=3, rtol=1e-9, parameters={"mesh.depth": 0.1})["mesh.q"]
    same = gl.simulate(pair(stiffness_law=SquaredCosine(0.1)), 0.02, samples=3, rtol=1e-9)["mesh.q"]
    assert ours == pytest.approx(same, rel=1e-6)


def test_a_law_takes_the_place_of_the_choice_and_must_be_one() -> None:
    with pytest.raises(BindingError, match=r"mesh \(DetailedExternalMesh\): stiffness='sinusoidal' has no effect"):
        gl.compile(pair(stiffness_law=SquaredCosine(0.3), stiffness="sinusoidal"))
    with pytest.raises(
        BindingError, match=r"stiffness_law is 3\.0; expected an instance of a class derived from gearparts\.StiffnessLaw"
    ):
        gl.compile(pair(stiffness_law=3.0))


@pytest.mark.parametrize("interval", [(0.0, 0.4), (0.4, 1.0)])
def test_the_newest_pair_has_come_as_far_as_the_phase(interval: tuple[float, float]) -> None:
    """In base pitches from where a pair comes into contact, in whichever turn; beyond both ends of its interval, too."""
    contact = ContactInterval(*interval, 2)
    for turn in (-3, 0, 5):
        for part in np.linspace(interval[0] - 0.05, interval[1] + 0.05, 7):
            assert float(contact.newest(2 * np.pi * (turn + float(part)))) == pytest.approx(part, abs=1e-12)


ROWS = ((0.3, 0.8), (1.5, 1.1), (2.9, 1.3), (4.0, 1.0), (5.6, 0.8))
SPLINE = CubicSpline([*(x for x, _ in ROWS), 0.3 + 2 * math.pi], [*(y for _, y in ROWS), 0.8], bc_type="periodic")
TERMS = ((0.5, 0.15, 1.0), (1.0, 0.2, 0.3), (2.0, -0.1, -0.5))
PATTERNS: dict[str, tuple[dict[str, Any], Any, Any]] = {  # choices, value over the mean, and slope, at a phase
    "constant": ({}, lambda x: 1.0, lambda x: 0.0),
    "sinusoidal": ({}, lambda x: 1 + 0.3 * math.cos(x), lambda x: -0.3 * math.sin(x)),
    "fourier": (
        {"stiffness_terms": TERMS},
        lambda x: 1 + 0.2 * math.cos(x + 0.3) - 0.1 * math.cos(2 * x - 0.5) + 0.15 * math.cos(x / 2 + 1),
        lambda x: -0.2 * math.sin(x + 0.3) + 0.2 * math.sin(2 * x - 0.5) - 0.075 * math.sin(x / 2 + 1),
    ),
    "table": ({"stiffness_table": ROWS}, lambda x: float(SPLINE(x)), lambda x: float(SPLINE(x, 1))),
    "rectangular": ({"contact_ratio": 1.625}, lambda x: (2 if x / 2 / math.pi % 1 < 0.625 else 1) / 1.625, lambda x: 0.0),
}


@pytest.mark.parametrize("stiffness", PATTERNS)
def test_stiffness_over_the_phase_and_what_its_change_supplies(stiffness: str) -> None:
    """A phase of the stiffness is ahead of the mesh phase; a spring that stiffens at its deflection takes up energy."""
    choices, value, slope = PATTERNS[stiffness]
    mesh = gp.DetailedExternalMesh(r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness=stiffness, **choices)
    for phase in (-5.0, -0.2, 0.1, 1.7, 3.6, 4.4, 9.0):
        values = {"phase": phase - 0.7, "c_phase": 0.7, "c": 8.0, "c_amplitude": 0.3}
        inside = right_side(mesh, "phase_in_stiffness", **values)
        assert stiffness != "table" or 0.3 <= inside <= 0.3 + 2 * math.pi
        values["phase_in_stiffness"] = inside
        assert right_side(mesh, "c_now", **values) == pytest.approx(8.0 * value(phase), rel=1e-12)
        moving = {"z_a": 20.0, "w_a": -1.5, "q": 3.0, "c_now": 5.0, "f": 0.0, "e_rate": 0.0, "loss_power": 0.0}
        assert powers(mesh, values | moving)[2] == pytest.approx(8.0 * slope(phase) * -30.0 * 9.0 / 2, abs=1e-11)


def test_a_whole_number_of_pairs_in_contact_is_as_stiff_all_the_time() -> None:
    for contact_ratio in (1.0, 2.0, 3.0):
        mesh = gp.DetailedExternalMesh(
            r_a=0.1, r_b=0.2, c=1e8, d=0.0, stiffness="rectangular", contact_ratio=contact_ratio
        )  # fmt: skip
        assert {right_side(mesh, "c_now", phase=x, c=8.0) for x in (0.1, 2.0, 4.0, 6.2)} == {8.0}


def test_a_mesh_has_the_law_of_its_choice_or_its_own() -> None:
    mesh = {"r_a": 0.1, "r_b": 0.2, "c": 1e8, "d": 0.0}
    assert isinstance(gp.DetailedExternalMesh(stiffness="sinusoidal", **mesh).law(), SinusoidalStiffness)
    own = SquaredCosine(0.3)
    assert gp.DetailedExternalMesh(stiffness_law=own, **mesh).law() is own
    with pytest.raises(BindingError, match=r"^DetailedExternalMesh\.stiffness_law is 3\.0; expected an instance of a class"):
        gp.DetailedExternalMesh(stiffness_law=3.0, **mesh).law()
