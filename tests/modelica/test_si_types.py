"""Modelica's quantities, constants and conversions against SciPy's; names of the standard library and what they mean here."""

from __future__ import annotations

import math
from typing import Any

import pytest
import scipy.constants as known

import gearparts as gp
from gearlib.language.units import dimension
from gearlib.modelica.counterparts import array_in, local_name, names_in, snake_case, standard_library
from gearlib.modelica.si_types import CONVERSIONS, UNIT_OF, constant_named, conversion_named, unit_named, unit_written


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("pi", math.pi), ("e", math.e), ("D2R", math.radians(1)), ("R2D", math.degrees(1)), ("g_n", known.g), ("G", known.G),
        ("c", known.c), ("k", known.k), ("R", known.R), ("sigma", known.sigma), ("N_A", known.N_A), ("T_zero", -known.zero_Celsius),
        ("gamma", 0.5772156649015329), ("eps", 1e-15), ("small", 1e-60), ("inf", 1e60),
    ],
)  # fmt: skip
def test_constants(name: str, value: float) -> None:
    assert constant_named(f"Modelica.Constants.{name}") == pytest.approx(value, rel=1e-9)
    assert constant_named(f"Constants.{name}") is None


@pytest.mark.parametrize(
    ("name", "one"),
    [
        ("from_deg", known.degree), ("from_rpm", 2 * math.pi / known.minute), ("from_kmh", known.kmh), ("from_day", known.day),
        ("from_hour", known.hour), ("from_minute", known.minute), ("from_litre", known.liter), ("from_kWh", known.kilo * known.hour),
        ("from_bar", known.bar), ("from_gps", known.gram), ("from_degC", 1 + known.zero_Celsius), ("to_deg", 1 / known.degree),
        ("to_rpm", known.minute / (2 * math.pi)), ("to_kmh", 1 / known.kmh), ("to_hour", 1 / known.hour),
        ("to_degC", 1 - known.zero_Celsius),
    ],
)  # fmt: skip
def test_conversions_of_one_and_back(name: str, one: float) -> None:
    found = conversion_named(f"Modelica.Units.Conversions.{name}")
    assert found is not None
    assert found == conversion_named(f"Modelica.SIunits.Conversions.{name}")
    factor, offset = found
    assert factor + offset == pytest.approx(one, rel=1e-12)
    back = CONVERSIONS.get(name.replace("from_", "to_") if name.startswith("from_") else name.replace("to_", "from_"))
    if back is not None:
        assert back[0] * (factor * 37.5 + offset) + back[1] == pytest.approx(37.5, rel=1e-12)
    assert conversion_named(f"Modelica.Other.{name}") is None


def test_units_of_quantities_are_units_of_declarations() -> None:
    for name, unit in UNIT_OF.items():
        assert unit_written(unit) == unit
        assert dimension(unit) is not None
        assert unit_named(f"Modelica.Units.SI.{name}") == unit_named(f"Modelica.SIunits.{name}") == unit
        assert unit_named(name) is None
    assert (unit_written(""), unit_written("km/h"), unit_named("Modelica.Units.SI.Nothing")) == ("any", None, None)


@pytest.mark.parametrize(
    ("path", "is_known"),
    [
        ("Modelica", True), ("Modelica.Mechanics", True), ("Modelica.Mechanics.Rotational.Components", True),
        ("Modelica.Mechanics.Rotational.Components.Inertia", True), ("Modelica.Mechanics.Rotational.Components.Inertie", False),
        ("Modelica.Mechanics.MultiBody", False), ("Modelica.Units.SI.Torque", True), ("Modelica.SIunits.Anything", True),
        ("Modelica.Units.SI.Torque.more", False), ("Modelica.Constants.pi", True), ("Modelica.Math.sin", True),
        ("Modelica.Blocks.Interfaces.RealInput", True), ("Modelica.Blocks.Types.Init.NoInit", True), ("Types.Init", False),
        ("Firm.Types.Init", False), ("Components.Inertia", False),
    ],
)  # fmt: skip
def test_names_that_the_library_knows(path: str, is_known: bool) -> None:
    assert standard_library().knows(tuple(path.split("."))) is is_known


@pytest.mark.parametrize(
    ("kind", "path", "element"),
    [
        ("Modelica.Mechanics.Rotational.Sources.Move", "w_ref", "u[2]"),
        ("Modelica.Mechanics.Rotational.Sources.Move", "w", None),
        ("Modelica.Blocks.Continuous.StateSpace", "outputs[3].y", "y[4]"),
        ("Modelica.Blocks.Continuous.StateSpace", "outputs[3].u", None),
        ("Modelica.Blocks.Continuous.StateSpace", "x[0].y", "x[1]"),
        ("Modelica.Blocks.Math.Gain", "y", None),
    ],
)
def test_elements_of_arrays_of_signals(kind: str, path: str, element: str | None) -> None:
    assert standard_library().counterparts[kind].element(path) == element


@pytest.mark.parametrize(
    ("kind", "name", "local"),
    [
        (gp.Inertia, "J", "J"),
        (gp.Inertia, "flange_a", "flange_a"),
        (gp.IdealGear, "useSupport", "use_support"),
        (gp.blocks.Limiter, "uMax", "y_max"),
        (gp.IdealGearR2T, "flangeR", "flange_r"),
    ],
)
def test_names_within_classes(kind: Any, name: str, local: str) -> None:
    assert local_name(kind, names_in(kind), name) == local
    outward = {ours: theirs for theirs, ours in names_in(kind).items()}
    assert outward.get(local, name) == name


def test_names_of_subclasses_and_arrays_are_those_of_their_bases() -> None:
    kind = type("Own", (gp.blocks.Limiter,), {})
    assert names_in(kind) == names_in(gp.blocks.Limiter) != {}
    assert array_in(type("Own", (gp.Move,), {}), "u") == ("phi_ref", "w_ref", "a_ref")
    assert array_in(gp.Move, "phi") is None
    assert [snake_case(name) for name in ("aB", "AB", "Ab", "J", "u2Max", "phi", "A1b", "")] == [
        "a_b", "ab", "ab", "J", "u2_max", "phi", "a1b", "",
    ]  # fmt: skip
