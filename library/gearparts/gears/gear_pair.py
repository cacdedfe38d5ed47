"""Geometry of a cylindrical involute gear pair, and its contact ratio, mesh stiffness and loss factor.

References
----------
ISO 21771:2007, "Gears - Cylindrical involute gears and gear pairs - Concepts and geometry".

ISO 6336-1:2006, "Calculation of load capacity of spur and helical gears - Part 1", clause 9 (tooth stiffness, method B).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearlib.arguments import is_real, shown
from gearlib.drawing.gears.gear_set import GearSet
from gearlib.errors import BoundError
from gearlib.language.declarations import offered
from gearparts.gears.drawn_gears import pair_of
from gearparts.gears.involute import involute, involute_angle
from gearparts.gears.mesh_phase import contact_intervals
from gearparts.gears.tooth_form import ToothForm

# ISO 6336-1, equation (86): flexibility of a pair of teeth, in mm um / N
FLEXIBILITY = (0.04723, 0.15551, 0.25791, -0.00635, -0.11654, -0.00193, -0.24188, 0.00529, 0.00182)
CORRECTION = 0.8  # C_M, ratio of measured to theoretical stiffness of solid gears
N_PER_MM_UM = 1e9  # N/(mm um) in N/m2
LIGHT = 1e5  # N/m; at loads per face width below this the contact is softer


@dataclass(frozen=True)
class GearPair:
    """A pinion (1) in mesh with a wheel (2), both cylindrical with involute teeth.

    Parameters
    ----------
    z_1, z_2 : int
        Numbers of teeth, positive.
    m_n : float
        Normal module, m.
    width : float
        Common face width, m.
    x_1, x_2 : float
        Profile shift coefficients; positive moves the teeth towards their tips, so a ring's towards its axis (ISO 21771).
    alpha_n, beta : float
        Normal pressure angle and helix angle, rad.
    internal : bool
        Whether the wheel is a ring gear around the pinion.
    h_aP, h_fP : float
        Addendum and dedendum of the basic rack over the normal module.
    blank : float
        ISO 6336-1's gear blank factor C_R; 1 for solid discs.
    line_load : float
        Tangential load including its application factor per face width, N/m; it has an effect below 1e5 N/m.

    Raises
    ------
    BoundError
        A geometrically impossible pair.

    Examples
    --------
    >>> pair = GearPair(19, 104, m_n=4e-3, width=0.05, x_1=0.5, x_2=0.15)
    >>> round(1e3 * pair.centre_distance, 4), round(pair.contact_ratio, 4)
    (248.5068, 1.5363)
    """

    z_1: int
    z_2: int
    m_n: float
    width: float
    x_1: float = 0.0
    x_2: float = 0.0
    alpha_n: float = math.pi / 9
    beta: float = 0.0
    internal: bool = False
    h_aP: float = 1.0
    h_fP: float = 1.25
    blank: float = 1.0
    line_load: float = math.inf

    def __post_init__(self) -> None:
        for name in ("z_1", "z_2", "m_n", "width", "alpha_n", "h_aP", "h_fP", "blank", "line_load"):
            value = getattr(self, name)
            unbounded = name == "line_load" and isinstance(value, float) and value == math.inf
            if not unbounded and not (is_real(value) and 0 < value <= 1e300):
                raise BoundError(f"GearPair.{name} is {shown(value)}; expected a positive number")
        for name in ("z_1", "z_2"):
            if not float(getattr(self, name)).is_integer():
                raise BoundError(f"GearPair.{name} is {shown(getattr(self, name))}; expected a whole number of teeth")
        for name in ("x_1", "x_2", "beta"):
            if not (is_real(getattr(self, name)) and abs(getattr(self, name)) < 1e150):
                raise BoundError(f"GearPair.{name} is {shown(getattr(self, name))}; expected a finite number")
        if not isinstance(self.internal, (bool, np.bool_)):
            raise BoundError(f"GearPair.internal is {shown(self.internal)}; expected True or False")
        if self.internal and self.z_2 <= self.z_1:
            raise BoundError(f"GearPair: a ring of {self.z_2} teeth around a pinion of {self.z_1}; expected z_2 > z_1")
        if not self.alpha_n < math.pi / 2:
            raise BoundError(f"GearPair.alpha_n is {shown(self.alpha_n)} rad; expected an angle between 0 and pi/2")
        if not abs(self.beta) < math.pi / 2:
            raise BoundError(f"GearPair.beta is {shown(self.beta)} rad; expected an angle between -pi/2 and pi/2")
        if not self.tips_reach:
            raise BoundError(
                f"GearPair: {self.z_1} and {self.z_2} teeth with profile shifts {self.x_1:g} and {self.x_2:g} do not reach each "
                "other's base circles along the line of action; check the profile shifts, the addendum and internal="
            )
        for name, form in zip(("z_1",) if self.internal else ("z_1", "z_2"), self._teeth, strict=False):
            if form.half_angle(form.tip or 0.0) < 0:
                raise BoundError(
                    f"GearPair: the {form.z} teeth of {name} end in points at a radius of {form.tip_radius:.6g} m, before their tip "
                    f"circle of {form.tip:.6g} m; check the profile shifts and the addendum"
                )

    @property
    def sense(self) -> int:
        """1 for an external wheel, -1 for a ring, which has a negative number of teeth in ISO 21771."""
        return -1 if self.internal else 1

    @property
    def ratio(self) -> float:
        """Number of teeth of the wheel over that of the pinion."""
        return self.z_2 / self.z_1

    @property
    def alpha_t(self) -> float:
        """Transverse pressure angle, rad."""
        return math.atan(math.tan(self.alpha_n) / math.cos(self.beta))

    @property
    def beta_b(self) -> float:
        """Helix angle at the base circle, rad."""
        return math.asin(math.sin(self.beta) * math.cos(self.alpha_n))

    @cached_property
    def alpha_wt(self) -> float:
        """Working pressure angle in the transverse section, without backlash, rad."""
        shift = 2 * math.tan(self.alpha_n) * (self.x_1 + self.x_2) / (self.z_1 + self.sense * self.z_2)
        target = involute(self.alpha_t) + shift
        if not target >= 0:
            raise BoundError(f"GearPair: no pressure angle fits the profile shifts {self.x_1:g} and {self.x_2:g}")
        return involute_angle(target)

    @property
    def centre_distance(self) -> float:
        """Working centre distance, m."""
        axis = self.m_n / math.cos(self.beta) * abs(self.z_1 + self.sense * self.z_2) / 2
        return axis * math.cos(self.alpha_t) / math.cos(self.alpha_wt)

    @property
    def base_radii(self) -> tuple[float, float]:
        """Base radii of pinion and wheel, m."""
        half = self.m_n / math.cos(self.beta) * math.cos(self.alpha_t) / 2
        return self.z_1 * half, self.z_2 * half

    @property
    def tip_radii(self) -> tuple[float, float]:
        """Tip radii of pinion and wheel, m; without tip shortening."""
        half = self.m_n / math.cos(self.beta) / 2
        reach = self.sense * (self.x_2 + self.h_aP)
        return self.z_1 * half + self.m_n * (self.x_1 + self.h_aP), self.z_2 * half + self.m_n * reach

    @property
    def base_pitch(self) -> float:
        """Transverse base pitch, m."""
        return math.pi * self.m_n / math.cos(self.beta) * math.cos(self.alpha_t)

    @property
    def tips_reach(self) -> bool:
        """Whether both tip circles lie outside the base circles and the path of contact has positive length."""
        outside = all(a > b for a, b in zip(self.tip_radii, self.base_radii, strict=True))
        return outside and self.approach + self.recess > 0

    @property
    def recess(self) -> float:
        """Part of the contact ratio after the pitch point with the pinion driving (ISO 21771: epsilon_1)."""
        return self._beyond_pitch_point(0)

    @property
    def approach(self) -> float:
        """Part of the contact ratio before the pitch point with the pinion driving (epsilon_2)."""
        return self._beyond_pitch_point(1)

    def _beyond_pitch_point(self, gear: int) -> float:
        """Over the base pitch: up to the gear's tip, or to where its mate's flank ends at the base circle or is cut away."""
        tip, base, slope = self.tip_radii[gear], self.base_radii[gear], math.tan(self.alpha_wt)
        beyond = (math.sqrt(tip**2 - base**2) - base * slope) * (self.sense if gear else 1)
        mate = self._teeth[1 - gear]
        if not mate.ring:
            beyond = min(beyond, mate.base_radius * slope - mate.undercut)
        return beyond / self.base_pitch

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio, epsilon_alpha; without what an undercut or the base circle takes from a flank."""
        return self.approach + self.recess

    @property
    def overlap_ratio(self) -> float:
        """Overlap ratio of a helical pair, epsilon_beta."""
        return self.width * math.sin(abs(self.beta)) / (math.pi * self.m_n)

    @property
    def loss_factor(self) -> float:
        """Mean sliding loss relative to power and friction coefficient, for load shared equally by the pairs in contact.

        ``pi (1/z_1 + 1/z_2) / cos(beta_b)`` with ``-1/z_2`` for a ring, times twice the mean distance of the pairs from the pitch point
        in base pitches; equal to ``1 - eps + eps_1**2 + eps_2**2`` if approach and recess are at most 1 (Niemann, Winter:
        Maschinenelemente, vol. 2).
        """

        def area(place: float) -> float:
            return (place - self.approach) * abs(place - self.approach) / 2

        distance = sum(
            (area(s.end + pair) - area(s.start + pair)) / s.pairs
            for s in contact_intervals("GearPair", max(self.contact_ratio, 1.0))
            for pair in range(s.pairs)
        )
        return 2 * math.pi * (1 / self.z_1 + self.sense / self.z_2) / math.cos(self.beta_b) * distance

    def efficiency(self, mu: float) -> float:
        """Efficiency of the mesh alone, with a mean friction coefficient ``mu``.

        Raises
        ------
        BoundError
            A negative coefficient, or one so large that the mesh would dissipate more than the power transmitted.
        """
        if not (is_real(mu) and 0 <= mu * self.loss_factor < 1):
            expected = f"expected a mean friction coefficient from 0 on, below {1 / self.loss_factor:.3g}"
            raise BoundError(f"GearPair.efficiency: mu is {shown(mu)}; {expected}, at which all power is lost")
        return 1 - mu * self.loss_factor

    @property
    def virtual_teeth(self) -> tuple[float, float]:
        """Numbers of teeth of the virtual spur gears in the normal section; infinite for a ring, as in ISO 6336-1."""
        per_tooth = 1 / (math.cos(self.beta_b) ** 2 * math.cos(self.beta))
        return self.z_1 * per_tooth, math.inf if self.internal else self.z_2 * per_tooth

    @property
    def single_stiffness(self) -> float:
        """Maximum single stiffness of a tooth pair per face width, c', N/m2 (ISO 6336-1, method B; steel).

        ``c' = 0.8 C_R C_B cos(beta) / q'``, with q' a polynomial of the virtual numbers of teeth and the profile shifts (for ``x_1 >=
        x_2`` and ``-0.5 <= x_1 + x_2 <= 2``), ``C_B = (1 + 0.5 (1.2 - h_fP)) (1 - 0.02 (20 - alpha_n in degrees))``; with the
        fourth root of the load per 100 N/mm below that.
        """
        z_1, z_2 = self.virtual_teeth
        x_1, x_2 = self.x_1, self.x_2
        terms = (1, 1 / z_1, 1 / z_2, x_1, x_1 / z_1, x_2, x_2 / z_2, x_1**2, x_2**2)
        q = sum(c * t for c, t in zip(FLEXIBILITY, terms, strict=True))
        rack = (1 + 0.5 * (1.2 - self.h_fP)) * (1 - 0.02 * (20 - math.degrees(self.alpha_n)))
        if not (q > 0 and rack > 0):
            raise BoundError(
                f"GearPair: ISO 6336-1 knows no stiffness of teeth with h_fP = {self.h_fP:g}, alpha_n = {self.alpha_n:g} rad and profile "
                f"shifts {self.x_1:g} and {self.x_2:g}"
            )
        stiffness = N_PER_MM_UM * CORRECTION * self.blank * rack * math.cos(self.beta) / q
        return float(stiffness * min(self.line_load / LIGHT, 1.0) ** 0.25)

    @property
    def mesh_stiffness(self) -> float:
        """Mean mesh stiffness per face width, c_gamma_alpha = c' (0.75 eps_alpha + 0.25), N/m2 (ISO 6336-1)."""
        return self.single_stiffness * (0.75 * self.contact_ratio + 0.25)

    def drawn_gears(self) -> GearSet:
        """The pair in the transverse section with its profile shifts, for ``gear_view(part, gears=...)``; a ring is the first gear."""
        forms = self._teeth
        if self.internal:
            return pair_of(forms[1], forms[0], self.centre_distance, self.alpha_wt, names=("ring", "pinion"))
        return pair_of(forms[0], forms[1], self.centre_distance, self.alpha_wt, names=("pinion", "wheel"))

    @cached_property
    def _teeth(self) -> list[ToothForm]:
        """Teeth of both gears in the transverse section."""
        m, teeth = self.m_n / math.cos(self.beta), (self.z_1, self.z_2)
        stretched = math.cos(self.beta)  # the rack's lengths are normal modules
        return [
            ToothForm(
                int(z), m, self.alpha_t, x * stretched, ring, tip,
                h_fP=self.h_fP * stretched, rho=min(0.38, 0.9 * self.h_fP) * stretched,
            )
            for z, x, ring, tip in zip(teeth, (self.x_1, self.x_2), (False, self.internal), self.tip_radii, strict=True)
        ]  # fmt: skip

    def mesh_values(self) -> dict[str, float]:
        """Values of the pair for `DetailedExternalMesh` (pinion on flange_a) or `DetailedInternalMesh` (ring on flange_a).

        They are optional values (`gearlib.offered`): a mesh without friction ignores those that only friction needs.

        Examples
        --------
        >>> values = GearPair(20, 40, m_n=3e-3, width=0.02).mesh_values()
        >>> sorted(values)
        ['alpha', 'approach', 'c', 'contact_ratio', 'r_a', 'r_b', 'z_a']
        """
        first, second = (1, 0) if self.internal else (0, 1)  # gear a drives where f > 0
        values = {
            "r_a": self.base_radii[first],
            "r_b": self.base_radii[second],
            "z_a": float((self.z_1, self.z_2)[first]),
            "c": self.mesh_stiffness * self.width,
            "alpha": self.alpha_wt,
            "contact_ratio": self.contact_ratio,
            "approach": (self.approach, self.recess)[first],
        }
        return offered(values)
