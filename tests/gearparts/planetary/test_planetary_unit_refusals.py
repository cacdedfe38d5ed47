"""What a planetary unit refuses: values of other levels of detail, and radii that its teeth contradict; in full words."""

from __future__ import annotations

import re
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, BoundError
from gearlib.flatten.flatten import flatten

UNIT: dict[str, Any] = {"R_s": 0.5, "R_p": 1.0, "I_s": 1.0, "I_r": 1.0, "I_h": 1.0, "I_spin": 1.0, "I_orbit": 1.0}
IDEAL, SEPARATE, PLANAR = {"level": "ideal"}, {"planet_meshes": "separate"}, {"level": "planar"}
MEANING = {
    name: kind._declarations[name].description
    for kind, names in (
        (gp.LumpedPlanetaryUnit, ("C_v", "K_ring", "e_rate")), (gp.LossyPlanetaryUnit, ("sun_efficiency",)),
        (gp.TranslationalPlanetaryUnit, ("k_p",)),
    )
    for name in names
}  # fmt: skip
AT_IDEAL, AT_SEPARATE = "level='ideal', planet_meshes='lumped'", "level='elastic', planet_meshes='separate'"


@pytest.mark.parametrize(
    ("choice", "name", "value", "said"),
    [
        (IDEAL, "C_v", 3.0, (AT_IDEAL, "level='elastic'")),
        (PLANAR, "C_v", 3.0, ("level='planar', planet_meshes='lumped'", "level='elastic'")),
        (SEPARATE, "C_v", 3.0, (AT_SEPARATE, "planet_meshes='lumped'")),
        (IDEAL, "K_ring", 3.0, (AT_IDEAL, "level='elastic' or level='planar'")),
        (SEPARATE, "k_p", 3.0, (AT_SEPARATE, "level='planar'")),
        (IDEAL, "sun_efficiency", ((0.0, 0.9, 0.9),), (AT_IDEAL, "level='lossy'")),
        (IDEAL, "planet_meshes", "separate", (AT_IDEAL, "level='elastic'")),
        (IDEAL, "e_rate", 2 * gl.time, (AT_IDEAL, "level='elastic'")),
    ],
)
def test_a_value_of_another_level_is_refused_with_the_choices_for_which_it_counts(
    choice: dict[str, str], name: str, value: Any, said: tuple[str, str]
) -> None:
    shown = str(value) if name == "e_rate" else repr(value)
    meaning = f" ({MEANING[name]})" if name in MEANING else ""
    message = f"PlanetaryUnit: {name}={shown} has no effect with {said[0]}{meaning}; it counts with {said[1]}"
    with pytest.raises(BindingError, match=rf"^{re.escape(message)}$"):
        gp.PlanetaryUnit(**UNIT, **choice, **{name: value}).check()


def test_a_class_of_one_level_is_not_asked_for_another() -> None:
    for kind, asked, has in (
        (gp.IdealPlanetaryUnit, "lossy", "ideal"), (gp.TorsionalPlanetaryUnit, "planar", "elastic")
    ):  # fmt: skip
        unit = kind(**UNIT, level=asked)
        with pytest.raises(BindingError, match=rf"level='{asked}' has no effect with level='{has}'.*with level='{asked}'$"):
            unit.check()
        assert kind(**UNIT, level=has).check() is None  # type: ignore[func-returns-value]


def test_a_unit_within_a_train_is_named_by_its_path() -> None:
    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.unit = gp.PlanetaryUnit(**UNIT, level="ideal", K_sun=3.0)
            return []

    with pytest.raises(BindingError, match=r"^unit \(PlanetaryUnit\): K_sun=3\.0 has no effect with level='ideal'"):
        flatten(Train())


def test_what_is_offered_or_handed_on_or_left_open_needs_no_effect() -> None:
    class Train(gl.Component):
        stiffness = gl.Parameter("N/m", default=1e8)

        def assemble(self) -> list[Any]:
            self.unit = gp.PlanetaryUnit(**UNIT, level="ideal", K_sun=2 * self.stiffness)
            return []

    flatten(Train())
    for value in (None, lambda unit: 2e8, gl.offered({"K_sun": 3.0})["K_sun"]):
        flatten(gp.PlanetaryUnit(**UNIT, level="ideal", K_sun=value))


TEETH = {"Z_s": 16, "Z_p": 32, "Z_r": 80, "planets": 4}
LARGE_RING = "IdealPlanetaryUnit: R_r / R_s = 2.6 / 0.5 = 5.2, but Z_r / Z_s = 80 / 16 = 5; expected R_r = 2.5 m (by default R_s + 2 R_p)"
LARGE_CARRIER = (
    "IdealPlanetaryUnit: 2 R_h / R_s = 2 * 1.6 / 0.5 = 6.4, but 1 + Z_r / Z_s = 6, the ratio of sun and carrier; "
    "expected R_h = 1.5 m (by default R_s + R_p)"
)


@pytest.mark.parametrize(
    ("radii", "said"),
    [
        ({}, None),
        ({"R_r": 2.6}, LARGE_RING),
        ({"R_r": 2.515625}, None),  # 80 teeth and a half
        ({"R_r": 2.484375}, None),
        ({"R_r": 2.5157}, "R_r / R_s = 2.5157 / 0.5"),
        ({"R_r": 2.4843}, "R_r / R_s = 2.4843 / 0.5"),
        ({"R_h": 1.6}, LARGE_CARRIER),
        ({"R_h": 1.5078125}, None),  # half a tooth of the ring
        ({"R_h": 1.4921875}, None),
        ({"R_h": 1.5079}, "2 R_h / R_s = 2 * 1.5079 / 0.5"),
        ({"R_h": 1.4921}, "2 R_h / R_s = 2 * 1.4921 / 0.5"),
        ({"R_s": 0.0}, None),  # nothing to compare with
        ({"R_p": 1.1, "R_r": 2.5, "R_h": 1.5}, None),  # planets with profile shift
    ],
)
def test_radii_are_in_the_ratio_of_the_teeth_to_half_a_tooth_of_the_ring(radii: dict[str, float], said: str | None) -> None:
    unit = gp.PlanetaryUnit(**UNIT | TEETH | radii, level="ideal")
    if said is None:
        unit.check()
    else:
        with pytest.raises(BindingError, match=re.escape(said)):
            unit.check()


def test_numbers_of_teeth_are_given_together() -> None:
    for name in ("Z_s", "Z_p", "Z_r"):
        with pytest.raises(BindingError, match=r"PlanetaryUnit: Z_. is 0; expected a whole number above 0"):
            gp.PlanetaryUnit(**UNIT, level="ideal", **{name: TEETH[name]}).check()


@pytest.mark.parametrize(
    ("choice", "model"),
    [
        (IDEAL, gp.IdealPlanetaryUnit),
        ({"level": "lossy"}, gp.LossyPlanetaryUnit),
        ({"C_v": 3.0}, gp.LumpedPlanetaryUnit),
        ({"level": "elastic", "planet_meshes": "lumped"}, gp.LumpedPlanetaryUnit),
        (SEPARATE, gp.TorsionalPlanetaryUnit),
        (PLANAR, gp.TranslationalPlanetaryUnit),
    ],
)
def test_choices_make_the_class_of_the_table(choice: dict[str, str], model: type) -> None:
    unit = gp.PlanetaryUnit(**UNIT, **choice)
    assert type(unit) is model
    assert type(model(**UNIT)) is model
    unit.check()


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        ({"level": "rigid"}, "'level' is 'rigid'; valid choices: 'ideal', 'lossy', 'elastic', 'planar'"),
        ({"planet_meshes": "single"}, "'planet_meshes' is 'single'; valid choices: 'lumped', 'separate'"),
    ],
)
def test_an_unknown_choice_is_refused_with_those_that_there_are(choice: dict[str, str], said: str) -> None:
    with pytest.raises(BindingError, match=rf"^PlanetaryUnit: structural choice {said}$"):
        gp.PlanetaryUnit(**UNIT, **choice)


@pytest.mark.parametrize("known", [("Z_s", "Z_p"), ("Z_s", "Z_r"), ("Z_p", "Z_r"), ("Z_s",), ("Z_p",), ("Z_r",), ()])
def test_gears_are_drawn_where_all_numbers_of_teeth_are_known(known: tuple[str, ...]) -> None:
    assert gp.PlanetaryUnit(**UNIT, level="ideal", **{name: TEETH[name] for name in known}).drawn_gears() is None
    assert gp.PlanetaryUnit(**UNIT | TEETH | {"R_s": 0.0}, level="ideal").drawn_gears() is None


@pytest.mark.parametrize(
    ("choice", "forces"),
    [
        (IDEAL, ((), ())),
        ({"C_v": 3.0}, (("sun_mesh.f",), ("ring_mesh.f",))),
        (SEPARATE, (("sun_meshes[0].f", "sun_meshes[1].f"), ("ring_meshes[0].f", "ring_meshes[1].f"))),
        (PLANAR, (("planar.sun_mesh[0].f", "planar.sun_mesh[1].f"), ("planar.ring_mesh[0].f", "planar.ring_mesh[1].f"))),
    ],
)
def test_drawn_gears_stand_at_the_planets_angles_and_show_the_forces_of_the_level(
    choice: dict[str, Any], forces: tuple[tuple[str, ...], tuple[str, ...]]
) -> None:
    unit = gp.PlanetaryUnit(**UNIT | TEETH | {"planets": 2}, **choice)
    gears = unit.drawn_gears()
    assert gears is not None
    assert unit.mesh_forces() == forces
    assert [w.place for w in gears.wheels[1:3]] == pytest.approx([0.0, 3.141592653589793])
    assert [(w.pitch_radius, w.orbit) for w in gears.wheels] == [
        (pytest.approx(r), pytest.approx(orbit)) for r, orbit in ((0.5, 0.0), (1.0, 1.5), (1.0, 1.5), (2.5, 0.0))
    ]  # fmt: skip
    assert [c.force for c in gears.contacts] == [
        names[n if len(names) > 1 else 0] for names in forces if names for n in range(2)
    ]  # fmt: skip


def test_a_radius_below_zero_is_refused_as_such() -> None:
    """Not by its ratio to other radii."""
    for teeth in (TEETH, {}):
        with pytest.raises(BoundError, match=r"R_s is -0\.5"):
            flatten(gp.PlanetaryUnit(**UNIT | teeth | {"R_s": -0.5}, level="ideal"))
