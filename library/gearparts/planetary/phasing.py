"""Mesh phasing of planetary sets from the numbers of teeth, and the assembly condition.

References
----------
R. G. Parker, J. Lin, "Mesh phasing relationships in planetary and epicyclic gears", Journal of Mechanical Design 126 (2004),
365-370. https://doi.org/10.1115/1.1667892

R. G. Parker, "A physical explanation for the effectiveness of planet phasing to suppress planetary gear vibration", Journal of
Sound and Vibration 236 (2000), 561-573. https://doi.org/10.1006/jsvi.1999.2859
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from gearlib.arguments import flag, is_real, reals, shown
from gearlib.errors import BindingError

MOST_PLANETS = 1000  # of a set: each is translated

ROUNDING = 1e-9  # of a tooth


@dataclass(frozen=True)
class PlanetPhasing:
    """Mesh phases of a planetary set, in mesh periods, from 0 to 1.

    Attributes
    ----------
    sun : tuple of float
        Lag of the sun's mesh with each planet behind its mesh with the first one (Parker and Lin's gamma_sn).
    ring : tuple of float
        The same for the ring's meshes (gamma_rn).
    ring_to_sun : float
        Lag of a planet's mesh with the ring behind its mesh with the sun (gamma_rs), both counted from contact at the pitch point.
    teeth : tuple of int
        Numbers of teeth of sun and ring.
    """

    sun: tuple[float, ...]
    ring: tuple[float, ...]
    ring_to_sun: float
    teeth: tuple[int, int]

    def excites(self, harmonic: int = 1) -> str:
        """Type of mode that a harmonic of the mesh frequency can excite, for identical, equally spaced planets.

        Returns
        -------
        str
            ``"rotational"`` if ``harmonic * Z_s`` is a multiple of the number of planets: the mesh forces add up to torques.
            ``"translational"`` if it is one more or one less: they add up to bearing forces. ``"planet"`` otherwise.
        """
        planets = len(self.sun)
        rest = harmonic * self.teeth[0] % planets
        if rest == 0:
            return "rotational"
        return "translational" if rest in (1, planets - 1) else "planet"


def planet_phasing(
    Z_s: int, Z_p: int, Z_r: int, planets: int, *, positions: Sequence[float] | None = None, clockwise: bool = True,
    ring_to_sun: float | None = None,
) -> PlanetPhasing:  # fmt: skip
    """Mesh phases of a planetary set from its numbers of teeth.

    For planets at the angles ``psi_n`` (counter-clockwise from the first) that rotate clockwise on the carrier, ``gamma_sn = Z_s psi_n
    / (2 pi)`` and ``gamma_rn = -Z_r psi_n / (2 pi)``, modulo whole periods; the signs change for counter-clockwise rotation. A planet
    meshes with sun and ring on opposite flanks of its teeth at points half a turn apart. If tooth and space are equally wide at the
    pitch circle, half a turn is ``Z_p / 2`` teeth and the other flank half a tooth away, so ``gamma_rs = (Z_p - 1) / 2`` modulo whole
    periods: 0 for odd ``Z_p``, 1/2 for even.

    Parameters
    ----------
    Z_s, Z_p, Z_r : int
        Numbers of teeth of sun, planet and ring.
    planets : int
        Number of planets.
    positions : sequence of float, optional
        Angles of the planets on the carrier, rad, of which only the differences count; by default equally spaced.
    clockwise : bool
        Direction in which the planets rotate on the carrier.
    ring_to_sun : float, optional
        gamma_rs, for teeth that are not as wide as their spaces.

    Returns
    -------
    PlanetPhasing

    Raises
    ------
    BindingError
        The set cannot be assembled.

    Examples
    --------
    >>> phasing = planet_phasing(30, 20, 70, 4)
    >>> phasing.sun, phasing.ring, phasing.ring_to_sun, phasing.excites()
    ((0.0, 0.5, 0.0, 0.5), (0.0, 0.5, 0.0, 0.5), 0.5, 'planet')
    """
    check_assembly("planet_phasing", Z_s, Z_p, Z_r, planets, positions)
    if not (ring_to_sun is None or is_real(ring_to_sun)):
        raise BindingError(f"planet_phasing: ring_to_sun is {shown(ring_to_sun)}; expected a number of mesh periods")
    turns = [n / planets for n in range(planets)] if positions is None else [p / (2 * math.pi) for p in from_first(positions)]
    sense = 1 if flag("clockwise", clockwise) else -1
    return PlanetPhasing(
        tuple(_fraction(sense * Z_s * turn) for turn in turns),
        tuple(_fraction(-sense * Z_r * turn) for turn in turns),
        _fraction((Z_p - 1) / 2 if ring_to_sun is None else ring_to_sun),
        (Z_s, Z_r),
    )


def from_first(positions: Sequence[Any]) -> list[Any]:
    """Angles from the first planet on: where an observer counts them from makes no difference to the teeth in mesh.

    >>> from_first([1.0, 3.0, 5.0])
    [0.0, 2.0, 4.0]
    """
    return [psi - positions[0] for psi in positions]


def _fraction(periods: float) -> float:
    rest = periods % 1.0
    return 0.0 if min(rest, 1.0 - rest) < ROUNDING else rest


def planet_positions(Z_s: int, Z_r: int, planets: int, *, Z_p: int | None = None) -> tuple[float, ...]:
    """Angles on the carrier at which planets can be assembled, as close to equal spacing as the teeth permit.

    With sun and ring at rest, a planet meshes with both at multiples of ``2 pi / (Z_s + Z_r)`` from the first one. The one nearest to
    ``2 pi n / planets`` is taken; of two equally near, the smaller.

    Parameters
    ----------
    Z_s, Z_r : int
        Teeth of sun and ring.
    planets : int
        Number of planets.
    Z_p : int, optional
        Number of teeth of a planet. If given, planets whose tip circles (one module outside the pitch circle) overlap are refused.

    Returns
    -------
    tuple of float
        Angles from the first planet, rad; equally spaced if ``Z_s + Z_r`` is a multiple of ``planets``.

    Raises
    ------
    BindingError
        Invalid numbers of teeth, or not enough space for so many planets.

    Examples
    --------
    The train of Zhou and Cui's Table 4, which cannot have three equally spaced planets: 19 + 81 is not a multiple of 3.

    >>> [round(math.degrees(psi), 3) for psi in planet_positions(19, 81, 3, Z_p=31)]
    [0.0, 118.8, 241.2]
    """
    _check_numbers("planet_positions", {"Z_s": Z_s, "Z_r": Z_r, "planets": planets} | ({} if Z_p is None else {"Z_p": Z_p}))
    steps = [-((planets - 2 * n * (Z_s + Z_r)) // (2 * planets)) for n in range(planets)]  # halves are rounded down
    gaps = [after - before for before, after in pairwise([*steps, Z_s + Z_r])]
    room = min(gaps) * 2 * math.pi / (Z_s + Z_r)
    narrow = Z_p is not None and planets > 1 and (Z_s + Z_p) * math.sin(room / 2) <= Z_p + 2
    if min(gaps) == 0 or narrow:
        raise BindingError(
            f"planet_positions: {planets} planets do not fit around a sun of Z_s = {Z_s} teeth: neighbours {math.degrees(room):.4g} "
            "degrees apart would touch; take fewer or smaller planets"
        )
    return tuple(2 * math.pi * step / (Z_s + Z_r) for step in steps)


def _check_numbers(owner: str, numbers: Mapping[str, int]) -> None:
    for name, number in numbers.items():
        if not (isinstance(number, (int, np.integer)) and is_real(number) and number > 0):
            raise BindingError(f"{owner}: {name} is {shown(number)}; expected a whole number above 0")


def check_assembly(
    owner: str, Z_s: int, Z_p: int, Z_r: int, planets: int, positions: Sequence[float] | None = None
) -> None:  # fmt: skip
    """Check that planets fit between sun and ring: each at a multiple of ``2 pi / (Z_s + Z_r)`` from the first.

    Equally spaced planets fit if ``(Z_s + Z_r) / planets`` is an integer.

    Raises
    ------
    BindingError
        They do not fit, or the numbers of teeth are inconsistent; ``owner`` names the set in the message.

    Examples
    --------
    >>> check_assembly("unit", 19, 31, 81, 5)
    >>> check_assembly("unit", 19, 31, 81, 3)
    Traceback (most recent call last):
        ...
    gearlib.errors.BindingError: unit: 3 equally spaced planets cannot be assembled with Z_s = 19 and Z_r = 81 ...
    """
    _check_numbers(owner, {"Z_s": Z_s, "Z_p": Z_p, "Z_r": Z_r, "planets": planets})
    if not Z_s + Z_p < Z_r:
        raise BindingError(
            f"{owner}: Z_s = {Z_s}, Z_p = {Z_p}, Z_r = {Z_r}; a planet between sun and ring needs Z_r near Z_s + 2 Z_p"
        )
    if positions is not None:
        angles = check_angles(owner, planets, positions)
        steps = [(p - angles[0]) / (2 * math.pi) * (Z_s + Z_r) for p in angles]
        for n, step in enumerate(steps):
            if abs(step - round(step)) > 1e-6:
                near = angles[0] + 2 * math.pi * round(step) / (Z_s + Z_r)
                raise BindingError(
                    f"{owner}: planet {n} at {angles[n]:.6g} rad does not fit between Z_s = {Z_s} and Z_r = {Z_r} teeth; the "
                    f"nearest position is {near:.6g} rad"
                )
    elif (Z_s + Z_r) % planets:
        valid = [n for n in range(1, 13) if (Z_s + Z_r) % n == 0]
        raise BindingError(
            f"{owner}: {planets} equally spaced planets cannot be assembled with Z_s = {Z_s} and Z_r = {Z_r} "
            f"(their sum {Z_s + Z_r} must be a multiple of the number of planets; valid numbers: {', '.join(map(str, valid))}); "
            "gearparts.planet_positions gives the nearest positions that do"
        )


def check_angles(owner: str, planets: int, positions: Sequence[float]) -> list[float]:
    """Angles of the planets (rad), one per planet; empty if none are given.

    Raises
    ------
    BindingError
        Not angles, or not one per planet; ``owner`` names the set in the message.
    """
    try:
        angles: list[float] = reals("positions", list(positions), "angles, rad").tolist()
    except Exception:  # not a sequence; a user's object may fail
        raise BindingError(f"{owner}: positions are {shown(positions)}; expected angles, rad") from None
    if angles and len(angles) != planets:
        raise BindingError(f"{owner}: {len(angles)} positions for {planets} planets")
    return angles
