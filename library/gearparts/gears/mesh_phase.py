"""Mesh kinematics, and periodic functions of the mesh phase: Fourier sums, tables, intervals of constant contact number.

The mesh phase grows by two pi per tooth; patterns have the period two pi.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi
from typing import Any

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearparts.interfaces import TwoFlangesAndSupport
from gearparts.tables import Rows, check_rows, piecewise_without_events


class MeshMotion(TwoFlangesAndSupport):
    """Base of meshes: speeds relative to the support, deflection, and the mesh phase (two pi per tooth).

    A derived class equates ``v``.
    """

    contact_ratio = gl.Structural(1.5, "rectangular, friction: mean number of tooth pairs in contact")
    r_a = gl.Parameter("m", "base radius of the gear on flange_a", min=0)
    r_b = gl.Parameter("m", "base radius of the gear on flange_b", min=0)
    z_a = gl.Parameter("1", "teeth of the gear on flange_a", default=1.0, min=1)
    phase0 = gl.Parameter("rad", "mesh phase at the start", default=0.0)
    q = gl.Variable("m", "deflection along the line of action", state="prefer", nominal=1e-6)
    v = gl.Variable("m/s", "rate of deflection")
    turned = gl.Variable("rad", "mesh phase beyond phase0", state="prefer", start=0.0)
    phase = gl.Variable("rad", "mesh phase", state="never")
    w_a = gl.Variable("rad/s", "speed of flange_a relative to the support", state="avoid")
    w_b = gl.Variable("rad/s", "speed of flange_b relative to the support", state="avoid")

    def phase_rate(self) -> Any:
        """Rate of the mesh phase."""
        return self.z_a * self.w_a

    def equations(self) -> list[gl.Eq]:
        w_support = gl.der(self.support.phi) if self.use_support else 0
        return [
            gl.Eq(self.w_a, gl.der(self.flange_a.phi) - w_support),
            gl.Eq(self.w_b, gl.der(self.flange_b.phi) - w_support),
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(gl.der(self.turned), self.phase_rate()),
            gl.Eq(self.phase, self.phase0 + self.turned),
        ]


def wrapped(phase: Any, centre: float = 0.0) -> Any:
    """The phase wrapped to within pi of ``centre``."""
    return centre + gl.atan2(gl.sin(phase - centre), gl.cos(phase - centre))


def checked_period(owner: str, rows: Rows) -> Rows:
    """Rows of phase (rad) and value, checked to lie within one period.

    Raises
    ------
    BindingError
        Fewer than three rows, or more than one period; ``owner`` names the table in the message.

    Examples
    --------
    >>> checked_period("Mesh.table", ((0, 1), (2, 3), (4, 2)))
    ((0.0, 1.0), (2.0, 3.0), (4.0, 2.0))
    """
    rows = check_rows(owner, rows, 2)
    if len(rows) < 3 or not rows[-1][0] - rows[0][0] < 2 * pi:
        raise BindingError(
            f"{owner} has {len(rows)} rows from {rows[0][0]:g} to {rows[-1][0]:g} rad; expected three or more within less than "
            "one period of two pi, which repeats by itself"
        )
    return rows


def checked_terms(mesh: Any, name: str) -> Rows:
    """Rows of order, amplitude and phase; empty if there are none."""
    rows: Rows = getattr(mesh, name)
    return check_rows(f"{type(mesh).__name__}.{name}", rows, 3) if rows else ()


def period_spline(rows: Rows) -> Any:
    """Cubic spline over the period that begins at the first row, as SciPy's `CubicSpline`."""
    from scipy.interpolate import CubicSpline

    phases = [*(row[0] for row in rows), rows[0][0] + 2 * pi]
    return CubicSpline(phases, [row[1] for row in (*rows, rows[0])], bc_type="periodic")


def periodic(rows: Rows, x: Any) -> tuple[Any, Any]:
    """Periodic interpolation of a table over the mesh phase, and its derivative with respect to the phase.

    It is a cubic spline with period two pi and continuous second derivative, so that it raises no events.

    Parameters
    ----------
    rows : tuple of (float, float)
        Validated by `checked_period`.
    x : expression
        Mesh phase (rad) in the period that begins at the first row: ``wrapped(phase, rows[0][0] + pi)``.

    Examples
    --------
    >>> import sympy
    >>> x = sympy.Symbol("x", real=True)
    >>> value, slope = periodic(((0.0, 1.0), (2.0, 3.0), (4.0, 2.0)), x)
    >>> [round(float(value.args[0].subs(x, at)), 9) for at in (0.0, 2.0, 4.0, 2 * pi)]
    [1.0, 3.0, 2.0, 1.0]
    """
    spline = period_spline(rows)
    closed, values, slopes = spline.x.tolist(), [], []
    for left, right, (a, b, c, d) in zip(closed, closed[1:], spline.c.T.tolist(), strict=False):
        t = x - left
        until = x < right if right < closed[-1] else True
        values.append((((a * t + b) * t + c) * t + d, until))
        slopes.append(((3 * a * t + 2 * b) * t + c, until))
    return piecewise_without_events(*values), piecewise_without_events(*slopes)


@dataclass(frozen=True)
class ContactInterval:
    """An interval of the mesh period with a constant number of tooth pairs: from ``start`` to ``end``, in periods."""

    start: float
    end: float
    pairs: int

    def within(self, phase: Any) -> Any:
        """Condition that the phase lies in this interval."""
        half = pi * (self.end - self.start)
        return gl.cos(phase - pi * (self.start + self.end)) > float(gl.cos(half))

    def newest(self, phase: Any) -> Any:
        """Position of the newest pair, in base pitches; defined beyond both ends of the interval."""
        return wrapped(phase, pi * (self.start + self.end)) / (2 * gl.pi)


def contact_intervals(owner: str, contact_ratio: float) -> list[ContactInterval]:
    """Intervals of the mesh period from the instant at which a new pair comes into contact; at least two.

    Raises
    ------
    BindingError
        A contact ratio below 1 or above 100.

    Examples
    --------
    >>> [(s.start, s.end, s.pairs) for s in contact_intervals("Mesh", 1.75)]
    [(0.0, 0.75, 2), (0.75, 1.0, 1)]
    """
    if not 1 <= contact_ratio <= 100:
        raise BindingError(f"{owner}.contact_ratio is {shown(contact_ratio)}; expected a number from 1 to 100")
    fewer = floor(contact_ratio)
    share = contact_ratio - fewer
    if share == 0:
        return [ContactInterval(0.0, 0.5, fewer), ContactInterval(0.5, 1.0, fewer)]
    return [ContactInterval(0.0, share, fewer + 1), ContactInterval(share, 1.0, fewer)]
