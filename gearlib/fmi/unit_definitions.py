"""Unit definitions in FMI: exponents of the base units, and display units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from gearlib.language.units import BASE, dimension

DISPLAYED = {  # display unit, its factor on a value in the unit, and its offset
    "rad": ("deg", 180.0 / math.pi, 0.0),
    "rad/s": ("rev/min", 30.0 / math.pi, 0.0),
    "K": ("degC", 1.0, -273.15),
    "m": ("mm", 1e3, 0.0),
    "W": ("kW", 1e-3, 0.0),
}
_ANGLE = re.compile(r"^rad(-?\d+)?$")


def has_unit(unit: str) -> bool:
    """Whether a variable has a unit: neither a plain number, nor "any"."""
    return unit not in ("1", "any", "")


def unit_definitions(root: Element, units: Iterable[str]) -> None:
    """Add the definitions of some units to a model description.

    Examples
    --------
    >>> from xml.etree.ElementTree import tostring
    >>> root = Element("UnitDefinitions")
    >>> unit_definitions(root, ["N.m/rad"])
    >>> tostring(root[0])
    b'<Unit name="N.m/rad"><BaseUnit kg="1" m="2" s="-2" rad="-1" /></Unit>'
    """
    for unit in sorted(set(filter(has_unit, units))):
        exponents = {base: int(e) for base, e in zip(BASE, dimension(unit) or (), strict=True) if e}
        exponents["rad"] = _angles(unit)
        element = SubElement(root, "Unit", name=unit)
        SubElement(element, "BaseUnit", {base: str(e) for base, e in exponents.items() if e})
        if unit in DISPLAYED:
            name, factor, offset = DISPLAYED[unit]
            more = {"offset": repr(offset)} if offset else {}
            SubElement(element, "DisplayUnit", {"name": name, "factor": repr(factor), **more})


def _angles(unit: str) -> int:
    """Exponent of the radian in a unit."""
    above, _, below = unit.partition("/")
    total = 0
    for sense, side in ((1, above), (-1, below.strip("()"))):
        for factor in side.split("."):
            if found := _ANGLE.match(factor):
                total += sense * int(found[1] or 1)
    return total
