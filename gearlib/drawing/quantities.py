"""Units on axes: canonical spelling, quantity names, and alternative units (µm, kN, 1/min)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from gearlib.errors import ArgumentError

NAMES = {
    "rad": "angle", "rad/s": "angular velocity", "rad/s²": "angular acceleration", "N·m": "torque", "N·m/s": "rate of torque",
    "m": "displacement", "m/s": "velocity", "m/s²": "acceleration", "N": "force", "N/s": "rate of force", "W": "power",
    "J": "energy", "K": "temperature", "N/m": "stiffness", "N·m/rad": "torsional stiffness", "Pa": "pressure", "s": "time",
    "Hz": "frequency", "kg": "mass", "kg·m²": "moment of inertia", "A": "current", "V": "voltage",
}  # fmt: skip
"""Quantity by unit; what has no name here is called by the variable's."""

PREFIXES = {"n": 1e-9, "µ": 1e-6, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
OTHERS = {  # unit: (SI unit, the unit in terms of it)
    "deg": ("rad", math.pi / 180), "°": ("rad", math.pi / 180), "rev": ("rad", 2 * math.pi), "arcmin": ("rad", math.pi / 10800),
    "1/min": ("rad/s", math.pi / 30), "rpm": ("rad/s", math.pi / 30), "km/h": ("m/s", 1 / 3.6), "bar": ("Pa", 1e5),
    "min": ("s", 60.0), "h": ("s", 3600.0), "%": ("1", 0.01), "kWh": ("J", 3.6e6),
}  # fmt: skip
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
FACTOR = re.compile(r"([^\d.·/\-]+|1)(-?\d+)?$")


@dataclass(frozen=True)
class Shown:
    """A display unit, and the number of these units per SI unit."""

    text: str
    factor: float


def _factors(unit: str) -> dict[str, int]:
    """Exponents by unit symbol, in the order written; a slash divides by everything after it, up to the next slash.

    >>> _factors("rad/s/s"), _factors("N.m.s/rad"), _factors("W/(m2.K)")
    ({'rad': 1, 's': -2}, {'N': 1, 'm': 1, 's': 1, 'rad': -1}, {'W': 1, 'm': -2, 'K': -1})
    """
    found: dict[str, int] = {}
    for k, part in enumerate(unit.translate(DIGITS).replace("·", ".").replace("(", "").replace(")", "").split("/")):
        for factor in filter(None, part.split(".")):
            match = FACTOR.match(factor)
            if match is None:
                return {unit: 1}
            if match[1] != "1":
                found[match[1]] = found.get(match[1], 0) + int(match[2] or 1) * (-1 if k else 1)
    return {symbol: exponent for symbol, exponent in found.items() if exponent}


def spelled(unit: str) -> str:
    """A unit as printed; empty for dimensionless numbers.

    >>> spelled("rad/s/s"), spelled("kg.m2"), spelled("N.m.s/rad"), spelled("1"), spelled("1/s")
    ('rad/s²', 'kg·m²', 'N·m·s/rad', '', '1/s')
    """
    above: list[str] = []
    below: list[str] = []
    for symbol, exponent in _factors(unit).items():
        size = "" if abs(exponent) == 1 else str(abs(exponent)).translate(SUPERSCRIPT)
        (above if exponent > 0 else below).append(symbol + size)
    if not below:
        return "·".join(above)
    return f"{'·'.join(above) or '1'}/{below[0] if len(below) == 1 else '(' + '·'.join(below) + ')'}"


def in_unit(unit: str, wanted: str | None) -> Shown:
    """Display of values in an SI unit in another unit.

    Parameters
    ----------
    unit : str
        Unit of the values.
    wanted : str or None
        The same with prefixes, such as "µm" or "kN.m", or one of ``OTHERS``; None: the unit itself.

    Raises
    ------
    ArgumentError
        Not a unit of this quantity.

    Examples
    --------
    >>> in_unit("m", "µm").factor, in_unit("rad/s", "1/min").text, round(in_unit("N.m", "kN.m").factor, 9)
    (1000000.0, '1/min', 0.001)
    """
    if wanted is None or spelled(wanted) == spelled(unit):
        return Shown(spelled(unit), 1.0)
    if wanted in OTHERS and spelled(OTHERS[wanted][0]) == spelled(unit):
        return Shown(wanted, 1 / OTHERS[wanted][1])
    have, want = _factors(unit), _factors(wanted)
    factor = 1.0
    if len(have) == len(want):
        for (base, exponent), (symbol, other) in zip(have.items(), want.items(), strict=True):
            if exponent != other or not (symbol == base or (symbol.endswith(base) and symbol[: -len(base)] in PREFIXES)):
                break
            factor /= (1.0 if symbol == base else PREFIXES[symbol[: -len(base)]]) ** exponent
        else:
            return Shown(spelled(wanted), float(f"{factor:.15g}"))
    raise ArgumentError(
        f"units: '{wanted}' is not a unit for values in {spelled(unit) or 'no unit'}; expected that unit with a prefix, such as "
        f"'k{spelled(unit)}', or one of {', '.join(OTHERS)} where it fits"
    )


def axis_label(name: str, unit: str) -> str:
    """Axis label: quantity and unit.

    >>> axis_label("speed", "rad/s"), axis_label("ratio", "")
    ('speed, rad/s', 'ratio')
    """
    return f"{name}, {unit}" if unit else name
