"""Mesh stiffness patterns from a gear pair's geometry: tables for the detailed meshes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gearlib.arguments import is_real, real, shown, whole
from gearlib.errors import ArgumentError, BoundError
from gearparts.gears.gear_pair import GearPair
from gearparts.tables import Rows


@dataclass(frozen=True)
class StiffnessPattern:
    """Mesh stiffness as a function of the mesh phase: its mean, and a table relative to it.

    Attributes
    ----------
    mean : float
        N/m; the parameter ``c`` of a detailed mesh.
    table : tuple of (float, float)
        Mesh phase (rad) from the instant at which a new pair comes into contact, and stiffness over ``mean``: the ``stiffness_table``
        of a detailed mesh.
    """

    mean: float
    table: Rows


def cai_pair_stiffness(pair: GearPair, place: float) -> float:
    """Stiffness of one tooth pair (N/m) at a position along its path of contact, after Cai.

    Spur gears (Cai and Hayashi): ``k_p (0.55 + 1.8 u - 1.8 u**2)``. Helical gears (Cai): ``k_p exp(C_a abs(eps_gamma (u - 1/2) / (1.125
    eps_alpha))**3)`` with ``C_a = 0.322 (beta - 5) + 0.23 width / h - 23.26``, the helix angle in degrees and the tooth height h. ``u``
    is 0 at the beginning of contact and 1 at its end, and ``k_p`` is the maximum single stiffness ``c'`` of ISO 6336-1 times the face
    width.

    Parameters
    ----------
    pair : GearPair
    place : float
        In base pitches from the beginning of contact; the stiffness is zero outside 0 to the total contact ratio.

    References
    ----------
    Y. Cai, T. Hayashi, "The linear approximated equation of vibration of a pair of spur gears (theory and experiment)", Journal of
    Mechanical Design 116 (1994), 558-564. https://doi.org/10.1115/1.2919414

    Y. Cai, "Simulation on the rotational vibration of helical gears in consideration of the tooth separation phenomenon (a new
    stiffness function of helical involute tooth pair)", Journal of Mechanical Design 117 (1995), 460-469.
    https://doi.org/10.1115/1.2826701

    Examples
    --------
    >>> pair = GearPair(20, 40, m_n=3e-3, width=0.02)
    >>> largest = pair.single_stiffness * pair.width
    >>> [round(cai_pair_stiffness(pair, u * pair.contact_ratio) / largest, 6) for u in (0.0, 0.5, 1.0)]
    [0.55, 1.0, 0.55]
    """
    _check_pair(pair)
    total = pair.contact_ratio + pair.overlap_ratio
    u = real("place", place) / total
    if not 0 <= u <= 1:
        return 0.0
    largest = pair.single_stiffness * pair.width
    if pair.beta == 0:
        return largest * (0.55 + 1.8 * u - 1.8 * u**2)
    height = (pair.h_aP + pair.h_fP) * pair.m_n
    helix = math.degrees(abs(pair.beta))
    shape = 0.322 * (helix - 5) + 0.23 * pair.width / height - 23.26
    if shape > 0:  # stiffest at the ends of the contact
        raise BoundError(f"Cai's formula does not hold for a helix of {helix:g} degrees and a width of {pair.width:g} m")
    return largest * math.exp(shape * abs(total * (u - 0.5) / (1.125 * pair.contact_ratio)) ** 3)


def _check_pair(pair: object) -> None:
    if not isinstance(pair, GearPair):
        raise ArgumentError(f"pair is {shown(pair)}; expected a GearPair")


def cai_stiffness(pair: GearPair, samples: int = 32, mean: float | None = None) -> StiffnessPattern:
    """Mesh stiffness over the mesh phase after Cai: the sum of `cai_pair_stiffness` over the pairs in contact.

    The jumps of a spur pair's stiffness, where a pair enters or leaves contact, are smoothed by the table's spline; more samples make
    them steeper.

    Parameters
    ----------
    pair : GearPair
    samples : int
        Number of table rows, at equal phase steps.
    mean : float, optional
        Mean stiffness (N/m) to which the pattern is scaled; by default Cai's own.

    Returns
    -------
    StiffnessPattern

    Examples
    --------
    >>> pair = GearPair(20, 40, m_n=3e-3, width=0.02)
    >>> pattern = cai_stiffness(pair, mean=pair.mesh_stiffness * pair.width)
    >>> len(pattern.table), round(pattern.mean / 1e6)
    (32, 375)
    """
    _check_pair(pair)
    samples = whole("cai_stiffness: samples", samples, 8)
    if not (mean is None or (is_real(mean) and mean > 0)):
        raise ArgumentError(f"cai_stiffness(mean={shown(mean)}): expected a positive stiffness, N/m")
    pairs = math.ceil(pair.contact_ratio + pair.overlap_ratio)
    steps = [(k + 0.5) / samples for k in range(samples)]  # avoids sampling a jump at the beginning of the period
    sums = [sum(cai_pair_stiffness(pair, step + n) for n in range(pairs)) for step in steps]
    own_mean = sum(sums) / samples
    table = tuple((2 * math.pi * step, value / own_mean) for step, value in zip(steps, sums, strict=True))
    return StiffnessPattern(own_mean if mean is None else mean, table)
