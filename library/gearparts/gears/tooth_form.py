"""The form of involute teeth in the transverse section: flanks, fillets that a rack cuts, and the outline of a whole gear.

References
----------
ISO 21771:2007, "Gears - Cylindrical involute gears and gear pairs - Concepts and geometry".

F. L. Litvin, A. Fuentes, "Gear Geometry and Applied Theory", 2nd edition, Cambridge 2004, chapter 6 (the fillet as the envelope of the
rack's rounded corner).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearparts.gears.involute import involute

Floats = NDArray[np.float64]
POINTS = 9  # of an involute flank, and of a fillet


@dataclass(frozen=True)
class ToothForm:
    """Teeth of an external gear, or of a ring, whose spaces have the form of an external gear's teeth.

    Parameters
    ----------
    z : int
        Number of teeth.
    m : float
        Transverse module, m.
    alpha : float
        Transverse pressure angle, rad.
    x : float
        Profile shift over the module; positive makes teeth thicker, and moves a ring's towards its axis (ISO 21771).
    ring : bool
        Whether the teeth point inwards.
    tip : float, optional
        Radius of the tip circle, m; without, it follows from ``h_aP``.
    h_aP, h_fP, rho : float
        Addendum, dedendum and corner radius of the rack over the module.

    Examples
    --------
    >>> form = ToothForm(20, 2e-3)
    >>> round(1e3 * form.pitch_radius, 6), round(1e3 * form.tip_radius, 6), round(1e3 * form.root_radius, 6)
    (20.0, 22.0, 17.5)
    >>> round(2e3 * form.pitch_radius * form.half_angle(form.pitch_radius), 6)  # half the pitch, pi m / 2
    3.141593
    """

    z: int
    m: float
    alpha: float = math.pi / 9
    x: float = 0.0
    ring: bool = False
    tip: float | None = None
    h_aP: float = 1.0
    h_fP: float = 1.25
    rho: float = 0.38

    @property
    def pitch_radius(self) -> float:
        """Of the reference circle, m."""
        return self.z * self.m / 2

    @property
    def base_radius(self) -> float:
        return self.pitch_radius * math.cos(self.alpha)

    @property
    def root_radius(self) -> float:
        depth = self.h_fP - self.x
        return self.pitch_radius + (depth if self.ring else -depth) * self.m

    @cached_property
    def tip_radius(self) -> float:
        """Of the tip circle; where flanks would meet before it, of the point in which they meet; of a ring, the base circle at least."""
        reach = (self.h_aP + self.x) * self.m
        if self.ring:
            return max(self.pitch_radius - reach if self.tip is None else self.tip, self.base_radius)
        tip = self.pitch_radius + reach if self.tip is None else self.tip
        if self.half_angle(tip) >= 0:
            return tip
        low, high = self.base_radius, tip
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self.half_angle(middle) > 0 else (low, middle)
        return low

    def half_angle(self, radius: float) -> float:
        """Half the angle (rad) that a tooth takes on a circle outside the base circle; of a ring, that a space takes.

        The flank is the involute of the base circle: at the radius ``r`` its pressure angle is ``arccos(r_b / r)``, and the tooth has
        become narrower by the involute function's growth from the reference circle on.
        """
        shift = -self.x if self.ring else self.x
        at_pitch = (math.pi / 2 + 2 * shift * math.tan(self.alpha)) / self.z
        return at_pitch + involute(self.alpha) - involute(math.acos(self.base_radius / max(radius, self.base_radius)))

    def flank(self) -> tuple[Floats, Floats]:
        """Radii (m) from the root to the tip of an external tooth, from the tip to the root of a ring's, and half angles there (rad)."""
        if self.ring:
            radii = _squared(self.tip_radius, self.root_radius, self.base_radius)
            return radii, np.array([self.half_angle(r) for r in radii])
        fillet_radii, fillet_angles = self._fillet(POINTS)
        start = math.hypot(self.base_radius, self.undercut) if self.undercut else float(fillet_radii[-1])
        start = min(start, self.tip_radius)
        radii, below = _squared(start, self.tip_radius, self.base_radius), fillet_radii < start
        angles = [self.half_angle(r) for r in radii]
        return np.concatenate([fillet_radii[below], radii]), np.concatenate([fillet_angles[below], angles])

    @cached_property
    def undercut(self) -> float:
        """How far from the tangent point of the line of action an undercut flank begins, m; 0 where nothing is cut under."""
        sin = math.sin(self.alpha)
        # from the tangent point to where the rack's straight flank ends; before that point the corner cuts under
        along = self.pitch_radius * sin - (self.h_fP - self.x - self.rho * (1 - sin)) * self.m / sin
        if self.ring or along >= 0:
            return 0.0
        first, last = math.pi / 2, self.alpha  # of the corner's normal, below the undercut and beyond it
        for _ in range(60):
            middle = (first + last) / 2
            (radius,), (half,) = self._cut(np.array([middle]))
            beyond = radius > self.base_radius and half >= self.half_angle(radius)
            first, last = (first, middle) if beyond else (middle, last)
        return math.sqrt(max(float(self._cut(np.array([last]))[0][0]) ** 2 - self.base_radius**2, 0.0))

    def _fillet(self, points: int) -> tuple[Floats, Floats]:
        """Radii, which rise, and half angles of what the rack's rounded corner cuts, from the root on."""
        return self._cut(np.linspace(math.pi / 2, self.alpha, points))

    def _cut(self, beta: Floats) -> tuple[Floats, Floats]:
        """Radii and half angles of points that the rack's rounded corner cuts.

        The common normal of corner and gear passes the pitch point P. Where it is inclined by ``beta`` to the pitch line, the corner's
        centre, which lies ``d`` below that line, is ``d / sin(beta)`` from P, and the cut point farther by the corner's radius. The
        rack has then moved along the pitch line from the place in which a space of it faces the tooth, and the gear has turned with it.
        """
        r, m, rho = self.pitch_radius, self.m, self.rho * self.m
        d = (self.h_fP - self.x) * m - rho
        from_datum = self.h_fP * m - rho
        corner = min(math.pi * m / 4 + from_datum * math.tan(self.alpha) + rho / math.cos(self.alpha), math.pi * m / 2)
        reach = d / np.sin(beta) + rho
        x, y = -reach * np.cos(beta), r - reach * np.sin(beta)
        moved = -d / np.tan(beta) - corner
        return np.hypot(x, y), np.arctan2(x, y) - moved / r

    def outline(self) -> Floats:
        """The gear as a polygon, shape (n, 2), m, counter-clockwise, with the middle of a tooth (of a ring: of a space) on the x axis."""
        radii, half = self.flank()
        radii, angles = np.concatenate([radii, radii[::-1]]), np.concatenate([-half, half[::-1]])
        turns = 2 * np.pi * np.arange(self.z)[:, None] / self.z
        at = (turns + angles).ravel()
        return np.stack([np.tile(radii, self.z) * np.cos(at), np.tile(radii, self.z) * np.sin(at)], axis=1)


def _squared(start: float, end: float, base: float) -> Floats:
    """Radii at equal steps of the involute's roll angle, which is ``sqrt(r**2 / r_b**2 - 1)``."""
    first, last = (math.sqrt(max((r / base) ** 2 - 1, 0.0)) for r in (start, end))
    return base * np.sqrt(1 + np.linspace(first, last, POINTS) ** 2)
