"""Meshes in more detail: backlash or preload, stiffness and transmission error that vary over the mesh phase.

As in ``meshes``, the deflection ``q`` along the line of action is a state and counts from unloaded contact in the middle of the
gap; it is positive where a positive turn of ``flange_a`` presses the teeth together. The mesh phase grows by two pi with every
tooth, ``der(phase) = z_a (w_a - w_frame)``, and is a state only where something varies with it.
"""

from __future__ import annotations

from math import floor
from typing import Any

import gearlib as gl
from gearlib.errors import BindingError
from gearparts.interfaces import Dissipative, TwoFlanges
from gearparts.tables import Rows, check_rows


class DetailedMesh(TwoFlanges, Dissipative):
    """Declares what detailed meshes share; see `DetailedExternalMesh` for the laws."""

    backlash = gl.Structural(False, "whether the flanks can part; otherwise force and deflection are proportional")
    stiffness = gl.Structural(
        "constant", "how the stiffness varies over the mesh phase", choices=("constant", "sinusoidal", "rectangular", "fourier")
    )
    stiffness_terms = gl.Structural((), "fourier: rows of order, relative amplitude, phase (rad) of cosines")
    contact_ratio = gl.Structural(1.5, "rectangular: mean number of tooth pairs in contact")
    error_terms = gl.Structural((), "static transmission error: rows of order, amplitude (m), phase (rad) of sines")

    r_a = gl.Parameter("m", "base radius of the gear on flange_a", min=0)
    r_b = gl.Parameter("m", "base radius of the gear on flange_b", min=0)
    z_a = gl.Parameter("1", "teeth of the gear on flange_a", default=1.0, min=1)
    c = gl.Parameter("N/m", "mean mesh stiffness along the line of action", min=0)
    d = gl.Parameter("N.s/m", "mesh damping along the line of action; see mesh_damping", min=0)
    b = gl.Parameter("m", "backlash: total gap along the line of action; negative: interference, a preload", default=0.0)
    c_amplitude = gl.Parameter("1", "sinusoidal: amplitude of the stiffness over its mean", default=0.0, min=-1, max=1)
    c_phase = gl.Parameter("rad", "phase of the stiffness, ahead of the mesh phase", default=0.0)
    phase0 = gl.Parameter("rad", "mesh phase at the start", default=0.0)
    e_rate = gl.Input("m/s", "rate of a further transmission error; adds to the deflection", default=0.0)
    w_frame = gl.Input("rad/s", "speed of the carrier on which the pair rides", default=0.0)
    q = gl.Variable("m", "deflection along the line of action", state="prefer", nominal=1e-6)
    v = gl.Variable("m/s", "rate of deflection")
    f = gl.Variable("N", "force along the line of action; acts against a positive turn of flange_a")
    turned = gl.Variable("rad", "mesh phase beyond phase0", state="prefer", start=0.0)
    phase = gl.Variable("rad", "mesh phase", state="never")
    c_now = gl.Variable("N/m", "stiffness")
    e = gl.Variable("m", "static transmission error; adds to the deflection", state="never")

    def mesh_equations(self, turns_against: int) -> list[gl.Eq]:
        """Deflection, force and torques; ``turns_against`` is 1 where the gears turn against each other, -1 otherwise."""
        r_b = turns_against * self.r_b
        w_a = gl.der(self.flange_a.phi)
        error, slope = self._error()
        phase_rate = self.z_a * (w_a - self.w_frame)
        force, loss = self._force()
        return [
            gl.Eq(gl.der(self.turned), phase_rate),
            gl.Eq(self.phase, self.phase0 + self.turned),
            gl.Eq(self.e, error),
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(self.v, self.r_a * w_a + r_b * gl.der(self.flange_b.phi) + self.e_rate + slope * phase_rate),
            gl.Eq(self.c_now, self.c * self._stiffness()),
            gl.Eq(self.f, force),
            gl.Eq(self.flange_a.tau, self.r_a * self.f),
            gl.Eq(self.flange_b.tau, r_b * self.f),
            gl.Eq(self.loss_power, loss),
            *self.heat_equations(),
        ]

    def _error(self) -> tuple[Any, Any]:
        """The static transmission error and its derivative with respect to the mesh phase."""
        rows = self._terms("error_terms", self.error_terms)
        angles = [order * self.phase + shift for order, _, shift in rows]
        error = sum(row[1] * gl.sin(angle) for row, angle in zip(rows, angles, strict=True))
        return error, sum(row[0] * row[1] * gl.cos(angle) for row, angle in zip(rows, angles, strict=True))

    def _terms(self, name: str, rows: Rows) -> Rows:
        return check_rows(f"{type(self).__name__}.{name}", rows, 3) if rows else ()

    def _stiffness(self) -> Any:
        """The stiffness over its mean."""
        phase = self.phase + self.c_phase
        if self.stiffness == "constant":
            return 1
        if self.stiffness == "sinusoidal":
            return 1 + self.c_amplitude * gl.cos(phase)
        if self.stiffness == "fourier":
            rows = self._terms("stiffness_terms", self.stiffness_terms)
            return 1 + sum(amplitude * gl.cos(order * phase + shift) for order, amplitude, shift in rows)
        if not self.contact_ratio >= 1:
            raise BindingError(f"{type(self).__name__}.contact_ratio is {self.contact_ratio!r}; expected a number from 1 on")
        fewer = floor(self.contact_ratio)
        share = self.contact_ratio - fewer  # of a period in which one pair more is in contact, from its beginning
        if share == 0:
            return 1
        more = gl.cos(phase - gl.pi * share) > gl.cos(gl.pi * share)
        return gl.Piecewise(((fewer + 1) / self.contact_ratio, more), (fewer / self.contact_ratio, True))

    def _force(self) -> tuple[Any, Any]:
        """Force and loss."""
        damping = self.d * self.v
        if not self.backlash:
            return self.c_now * self.q + damping, damping * self.v
        half = self.b / 2
        drive, coast = self.q > half, self.q < -half
        force = gl.Piecewise((self.c_now * (self.q - half) + damping, drive), (0, True)) + gl.Piecewise(
            (self.c_now * (self.q + half) + damping, coast), (0, True)
        )
        flanks = gl.Piecewise((1, drive), (0, True)) + gl.Piecewise((1, coast), (0, True))
        return force, flanks * damping * self.v


class DetailedExternalMesh(DetailedMesh):
    """Two outer gears, which turn against each other, with backlash and with parameters that vary over the mesh phase.

    ``der(q) = r_a w_a + r_b w_b + e_rate + der(e)`` with the static transmission error ``e = sum(E_k sin(k phase + p_k))``.

    Without backlash ``f = c_now q + d v``. With it, each flank that touches adds its part: the drive flank
    ``c_now (q - b/2) + d v`` where ``q > b/2``, the coast flank ``c_now (q + b/2) + d v`` where ``q < -b/2``. A negative ``b`` is an
    interference: within ``abs(q) < -b/2`` both flanks touch, pressed by ``-c_now b / 2``, and the mesh is twice as stiff.

    The stiffness ``c_now`` is the mean ``c`` times 1, ``1 + c_amplitude cos(phase)``, ``1 + sum(A_k cos(k phase + p_k))``, or,
    rectangular, proportional to the number of pairs in contact: the next number above the contact ratio in the fractional part of
    it of each period, and the number below otherwise. ``phase + c_phase`` stands for the phase.

    References
    ----------
    A. Kahraman, R. Singh, "Interactions between time-varying mesh stiffness and clearance non-linearities in a geared system",
    Journal of Sound and Vibration 146 (1991), 135-156. https://doi.org/10.1016/0022-460X(91)90527-Q
    """

    def equations(self) -> list[gl.Eq]:
        return self.mesh_equations(1)


class DetailedInternalMesh(DetailedMesh):
    """A ring on flange_a and a gear inside it: ``der(q) = r_a w_a - r_b w_b + e_rate + der(e)``; else as `DetailedExternalMesh`."""

    def equations(self) -> list[gl.Eq]:
        return self.mesh_equations(-1)


def mesh_damping(zeta: Any, c: Any, J_a: Any, r_a: Any, J_b: Any, r_b: Any) -> Any:
    """Damping (N.s/m) of a mesh between two free bodies for a damping ratio: ``2 zeta sqrt(c m)``, ``1/m = r_a**2/J_a + r_b**2/J_b``.

    Parameters
    ----------
    zeta : float or expression
        Damping ratio of the pair's vibration against each other.
    c : float or expression
        Mean mesh stiffness, N/m.
    J_a, J_b : float or expression
        Moments of inertia, kg.m2.
    r_a, r_b : float or expression
        Base radii, m.

    Examples
    --------
    >>> float(mesh_damping(0.05, 2e8, 0.001, 0.05, 0.016, 0.1))
    800.0
    """
    return 2 * zeta * gl.sqrt(c / (r_a**2 / J_a + r_b**2 / J_b))
