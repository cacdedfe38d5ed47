"""SI units in declarations, and the SI replacements of other units.

Angles are dimensionless: 1 rad = 1. All values are in SI as well: nothing is converted, and a unit outside SI is refused with the one
to declare instead.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import lru_cache

from gearlib.errors import DeclarationError

Dimension = tuple[Fraction, ...]  # exponents of the base units
BASE = ("kg", "m", "s", "K", "A")
NONE: Dimension = (Fraction(0),) * len(BASE)
SECOND: Dimension = tuple(Fraction(unit == "s") for unit in BASE)
UNITS = {
    "1": (0, 0, 0, 0, 0), "rad": (0, 0, 0, 0, 0), "kg": (1, 0, 0, 0, 0), "m": (0, 1, 0, 0, 0), "s": (0, 0, 1, 0, 0),
    "K": (0, 0, 0, 1, 0), "A": (0, 0, 0, 0, 1), "Hz": (0, 0, -1, 0, 0), "N": (1, 1, -2, 0, 0), "Pa": (1, -1, -2, 0, 0),
    "J": (1, 2, -2, 0, 0), "W": (1, 2, -3, 0, 0), "C": (0, 0, 1, 0, 1), "V": (1, 2, -3, 0, -1), "Ohm": (1, 2, -3, 0, -2),
    "F": (-1, -2, 4, 0, 2), "H": (1, 2, -2, 0, -2), "Wb": (1, 2, -2, 0, -1), "T": (1, 0, -2, 0, -1),
}  # fmt: skip
INSTEAD = {  # SI unit to write instead, and the value of one of the other unit in it
    "rpm": ("rad/s", "0.104719755 rad/s"), "1/min": ("rad/s", "0.104719755 rad/s"), "U/min": ("rad/s", "0.104719755 rad/s"),
    "rev/min": ("rad/s", "0.104719755 rad/s"), "r/min": ("rad/s", "0.104719755 rad/s"),
    "rev": ("rad", "6.283185307 rad"), "deg": ("rad", "0.01745329252 rad"), "°": ("rad", "0.01745329252 rad"),
    "degC": ("K", "1 K, counted from 273.15 K"), "°C": ("K", "1 K, counted from 273.15 K"), "%": ("1", "0.01"),
    "g": ("kg", "1e-3 kg"), "t": ("kg", "1e3 kg"), "mm": ("m", "1e-3 m"), "cm": ("m", "1e-2 m"), "um": ("m", "1e-6 m"),
    "µm": ("m", "1e-6 m"), "km": ("m", "1e3 m"), "in": ("m", "0.0254 m"), "ft": ("m", "0.3048 m"), "ms": ("s", "1e-3 s"),
    "us": ("s", "1e-6 s"), "min": ("s", "60 s"), "h": ("s", "3600 s"), "kN": ("N", "1e3 N"), "MN": ("N", "1e6 N"),
    "mN": ("N", "1e-3 N"), "lbf": ("N", "4.448221615 N"), "lb": ("kg", "0.45359237 kg"), "kHz": ("Hz", "1e3 Hz"),
    "kJ": ("J", "1e3 J"), "kW": ("W", "1e3 W"), "MW": ("W", "1e6 W"), "mW": ("W", "1e-3 W"), "hp": ("W", "745.6998716 W"),
    "PS": ("W", "735.49875 W"), "kPa": ("Pa", "1e3 Pa"), "MPa": ("Pa", "1e6 Pa"), "GPa": ("Pa", "1e9 Pa"), "bar": ("Pa", "1e5 Pa"),
    "mA": ("A", "1e-3 A"), "kA": ("A", "1e3 A"), "mV": ("V", "1e-3 V"), "kV": ("V", "1e3 V"), "mH": ("H", "1e-3 H"),
    "uF": ("F", "1e-6 F"), "kph": ("m/s", "0.2777777778 m/s"), "mph": ("m/s", "0.44704 m/s"), "ohm": ("Ohm", "1 Ohm"),
    "Nm": ("N.m", "1 N.m"), "kNm": ("N.m", "1e3 N.m"), "Nmm": ("N.m", "1e-3 N.m"), "Nms": ("N.m.s", "1 N.m.s"),
    "Ns": ("N.s", "1 N.s"), "Js": ("J.s", "1 J.s"), "Ws": ("W.s", "1 W.s"), "Wh": ("J", "3600 J"), "kWh": ("J", "3.6e6 J"),
    "sec": ("s", "1 s"), "kgm2": ("kg.m2", "1 kg.m2"), "kgm": ("kg.m", "1 kg.m"),
}  # fmt: skip
_FACTOR = re.compile(r"([A-Za-z]+|1(?![-\d]))(-?\d+)?")  # 10 and 1-3 are no units


@lru_cache(maxsize=1000)
def dimension(unit: str) -> Dimension | None:
    """Dimension of a unit as exponents of kg, m, s, K and A; None for ``"any"``, which matches every dimension.

    Parameters
    ----------
    unit : str
        For example ``"N.m.s/rad"`` or ``"W/(m2.K)"``: factors with exponents, joined by dots; everything after the slash is divided by.

    Raises
    ------
    DeclarationError
        Unknown unit, or not SI.

    Examples
    --------
    >>> dimension("N.m.s/rad") == dimension("kg.m2/s")
    True
    """
    if unit == "any":
        return None
    total = list(NONE)
    above, stroke, below = unit.partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    if unit in INSTEAD or (stroke and not below):
        raise _unknown(unit, unit)
    for sense, side in ((1, above), (-1, below)):
        for factor in side.split(".") if side else []:
            found = _FACTOR.fullmatch(factor)
            if found is None or found[1] not in UNITS or len(found[2] or "") > 4:
                raise _unknown(unit, factor)
            exponent = sense * int(found[2] or 1)
            total = [t + exponent * e for t, e in zip(total, UNITS[found[1]], strict=True)]
    return tuple(total)


def _unknown(unit: str, factor: str) -> DeclarationError:
    where = f"the unit '{unit}'" if unit == factor else f"the unit '{unit}' has the factor '{factor}', which"
    known = f"known: {', '.join(UNITS)}, any"
    bare = factor if factor in INSTEAD else factor.rstrip("-0123456789")
    if bare in INSTEAD:
        si, size = INSTEAD[bare]
        return DeclarationError(
            f"{where} is not accepted: declare '{si}' instead, and give values in that unit (1 {bare} is {size}); {known}"
        )
    if any(sign in factor for sign in "*^ ·"):
        return DeclarationError(
            f"{where} cannot be parsed: join factors by dots, with exponents behind them, as in 'kg.m2/s'; {known}"
        )
    return DeclarationError(f"{where} is not known; {known}")


def name_of(d: Dimension | None) -> str:
    """A dimension in base units, for messages.

    >>> name_of(dimension("N/m"))
    'kg.s-2'
    """
    if d is None:
        return "any"
    return ".".join(f"{u}{'' if e == 1 else e}" for u, e in zip(BASE, d, strict=True) if e) or "1"
