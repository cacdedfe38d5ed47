"""Meshes in more detail: backlash or preload, stiffness and transmission error that vary over the mesh phase, sliding friction.

As in ``meshes``, the deflection ``q`` along the line of action is a state and counts from unloaded contact in the middle of the
gap; it is positive where a positive turn of ``flange_a`` presses the teeth together. The mesh phase grows by two pi with every
tooth of gear a, ``der(phase) = z_a (w_a - w_support)``; at its multiples of two pi a new pair comes into contact. It is a state
only where something varies with it.
"""

from __future__ import annotations

from math import pi
from typing import Any, ClassVar

import sympy

import gearlib as gl
from gearlib.errors import BoundError
from gearparts.interfaces import Dissipative, TwoFlangesAndSupport
from gearparts.mesh_phase import checked_period, periodic, stretches, wrapped
from gearparts.tables import Rows, check_rows, is_finite

STIFFNESS = ("constant", "sinusoidal", "rectangular", "fourier", "table")
CONTACT = {
    0.0: "open: mesh {}",
    1.0: "in contact: mesh {}",
    -1.0: "in contact, driven backwards: mesh {}",
    2.0: "in contact on both flanks: mesh {}",
}
EVEN: Rows = ((0.0, 1.0), (2.0, 1.0), (4.0, 1.0))


class DetailedMesh(TwoFlangesAndSupport, Dissipative):
    """Declares what detailed meshes share; see `DetailedExternalMesh` for the laws."""

    turns_against: ClassVar[int]  # 1 where the gears turn against each other, -1 otherwise

    backlash = gl.Structural(False, "whether the flanks can part; otherwise force and deflection are proportional")
    stiffness = gl.Structural("constant", "how the stiffness varies over the mesh phase", choices=STIFFNESS)
    stiffness_terms = gl.Structural((), "fourier: rows of order, relative amplitude, phase (rad) of cosines")
    stiffness_table = gl.Structural(EVEN, "table: rows of mesh phase (rad), stiffness over c")
    contact_ratio = gl.Structural(1.5, "rectangular, friction: mean number of tooth pairs in contact")
    error_terms = gl.Structural((), "static transmission error: rows of order, amplitude (m), phase (rad) of sines")
    error_table = gl.Structural((), "static transmission error: rows of mesh phase (rad), error (m)")
    friction = gl.Structural(False, "whether the teeth slide with friction")

    r_a = gl.Parameter("m", "base radius of the gear on flange_a", min=0)
    r_b = gl.Parameter("m", "base radius of the gear on flange_b", min=0)
    z_a = gl.Parameter("1", "teeth of the gear on flange_a", default=1.0, min=1)
    c = gl.Parameter("N/m", "mean mesh stiffness along the line of action", min=0)
    d = gl.Parameter("N.s/m", "mesh damping along the line of action; see mesh_damping", min=0)
    b = gl.Parameter("m", "backlash: total gap along the line of action; negative: interference, a preload", default=0.0)
    c_amplitude = gl.Parameter("1", "sinusoidal: amplitude of the stiffness over its mean", default=0.0, min=-1, max=1)
    c_phase = gl.Parameter("rad", "phase of the stiffness, ahead of the mesh phase", default=0.0)
    phase0 = gl.Parameter("rad", "mesh phase at the start", default=0.0)
    mu = gl.Parameter("1", "friction: coefficient of the sliding teeth", default=0.05, min=0)
    v_smooth = gl.Parameter("m/s", "friction: sliding speed at which it has 76 % of its full size", default=1e-3, min=1e-12)
    alpha = gl.Parameter("rad", "friction: working pressure angle in the transverse section", default=gl.pi / 9, min=0, max=1.5)
    approach = gl.Parameter(
        "1", "friction: part of the contact ratio before the pitch point", default=lambda mesh: mesh.contact_ratio / 2, min=0
    )
    pitch = gl.Parameter("m", "friction: base pitch", default=lambda mesh: 2 * gl.pi * mesh.r_a / mesh.z_a, min=0)
    tangent_a = gl.Parameter(
        "m",
        "friction: way from gear a's tangent point to the pitch point",
        default=lambda mesh: mesh.r_a * gl.tan(mesh.alpha),
        min=0,
    )
    tangent_b = gl.Parameter(
        "m",
        "friction: way from gear b's tangent point to the pitch point",
        default=lambda mesh: mesh.r_b * gl.tan(mesh.alpha),
        min=0,
    )
    e_rate = gl.Input("m/s", "rate of a further transmission error; adds to the deflection", default=0.0)
    q = gl.Variable("m", "deflection along the line of action", state="prefer", nominal=1e-6)
    v = gl.Variable("m/s", "rate of deflection")
    f = gl.Variable("N", "force along the line of action; acts against a positive turn of flange_a")
    contact = gl.Variable(
        "1",
        "1: pressed by a positive turn of flange_a, -1: by a negative one, 0: open, 2: both flanks are pressed",
        words=CONTACT,
    )
    turned = gl.Variable("rad", "mesh phase beyond phase0", state="prefer", start=0.0)
    phase = gl.Variable("rad", "mesh phase", state="never")
    phase_in_stiffness = gl.Variable("rad", "table: phase within the period of stiffness_table", state="never")
    phase_in_error = gl.Variable("rad", "error_table: phase within its period", state="never")
    beyond = gl.Variable(
        "m", "friction: way of the newest pair from the pitch point, away from gear a's tangent point", state="never"
    )
    sliding = gl.Variable("m/s", "friction: sliding speed of the newest pair")
    grip = gl.Variable("1", "friction: mean over the pairs of their smoothed signs of sliding")
    grip_later = gl.Variable("1", "friction: the same, each times the base pitches that the pair is ahead of the newest")
    c_now = gl.Variable("N/m", "stiffness")
    e = gl.Variable("m", "static transmission error; adds to the deflection", state="never")
    w_a = gl.Variable("rad/s", "speed of flange_a relative to the support", state="avoid")
    w_b = gl.Variable("rad/s", "speed of flange_b relative to the support", state="avoid")
    tau_friction_a = gl.Variable("N.m", "torque of the sliding friction on flange_a")
    tau_friction_b = gl.Variable("N.m", "torque of the sliding friction on flange_b")

    def equations(self) -> list[gl.Eq]:
        r_b = self.turns_against * self.r_b
        w_support = gl.der(self.support.phi) if self.use_support else 0
        error, slope, phase_in_error = self._error()
        stiffness, phase_in_stiffness = self._stiffness()
        phase_rate = self.z_a * self.w_a
        force, loss = self._force()
        rubbing = self.tau_friction_a * self.w_a + self.tau_friction_b * self.w_b if self.friction else 0
        return [
            gl.Eq(self.w_a, gl.der(self.flange_a.phi) - w_support),
            gl.Eq(self.w_b, gl.der(self.flange_b.phi) - w_support),
            gl.Eq(gl.der(self.turned), phase_rate),
            gl.Eq(self.phase, self.phase0 + self.turned),
            gl.Eq(self.phase_in_stiffness, phase_in_stiffness),
            gl.Eq(self.phase_in_error, phase_in_error),
            gl.Eq(self.e, error),
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(self.v, self.r_a * self.w_a + r_b * self.w_b + self.e_rate + slope * phase_rate),
            gl.Eq(self.c_now, self.c * stiffness),
            gl.Eq(self.f, force),
            gl.Eq(self.contact, self._contact()),
            *self._friction(self.turns_against),
            gl.Eq(self.flange_a.tau, self.r_a * self.f + (self.tau_friction_a if self.friction else 0)),
            gl.Eq(self.flange_b.tau, r_b * self.f + (self.tau_friction_b if self.friction else 0)),
            gl.Eq(self.loss_power, loss + rubbing),
        ]

    def energies(self) -> gl.Energy:
        """The transmission error moves the flanks, and a stiffness that varies stores more, or less, in the same deflection."""
        half = self.b / 2
        flanks = gl.Max(self.q - half, 0) ** 2 + gl.Max(-self.q - half, 0) ** 2 if self.backlash else self.q**2
        phase_rate = self.z_a * self.w_a
        excited = self.f * (self.e_rate + self._error()[1] * phase_rate)
        stiffer = self.c * self._stiffening() * phase_rate * flanks / 2
        return gl.Energy(stored=self.c_now * flanks / 2, heat=self.loss_power, supplied=excited + stiffer)

    def _owner(self, name: str) -> str:
        return f"{type(self).__name__}.{name}"

    def _error(self) -> tuple[Any, Any, Any]:
        """The static transmission error, its derivative with respect to the mesh phase, and the phase in its table."""
        rows = self._terms("error_terms", self.error_terms)
        angles = [order * self.phase + shift for order, _, shift in rows]
        error = sum(row[1] * gl.sin(angle) for row, angle in zip(rows, angles, strict=True))
        slope = sum(row[0] * row[1] * gl.cos(angle) for row, angle in zip(rows, angles, strict=True))
        if not self.error_table:
            return error, slope, 0
        table = checked_period(self._owner("error_table"), self.error_table)
        more = periodic(table, self.phase_in_error)
        return error + more[0], slope + more[1], wrapped(self.phase, table[0][0] + pi)

    def _terms(self, name: str, rows: Rows) -> Rows:
        return check_rows(self._owner(name), rows, 3) if rows else ()

    def _stiffness(self) -> tuple[Any, Any]:
        """The stiffness over its mean, and the phase in its table."""
        phase = self.phase + self.c_phase
        if self.stiffness == "constant":
            return 1, 0
        if self.stiffness == "sinusoidal":
            return 1 + self.c_amplitude * gl.cos(phase), 0
        if self.stiffness == "fourier":
            rows = self._terms("stiffness_terms", self.stiffness_terms)
            return 1 + sum(amplitude * gl.cos(order * phase + shift) for order, amplitude, shift in rows), 0
        if self.stiffness == "table":
            table = checked_period(self._owner("stiffness_table"), self.stiffness_table)
            return periodic(table, self.phase_in_stiffness)[0], wrapped(phase, table[0][0] + pi)
        first, second = stretches(type(self).__name__, self.contact_ratio)
        if first.pairs == second.pairs:
            return 1, 0
        more, fewer = (stretch.pairs / self.contact_ratio for stretch in (first, second))
        return gl.Piecewise((more, first.within(phase)), (fewer, True)), 0

    def _stiffening(self) -> Any:
        """The derivative of the stiffness, over its mean, with respect to the mesh phase, where it does not jump."""
        phase = self.phase + self.c_phase
        if self.stiffness == "sinusoidal":
            return -self.c_amplitude * gl.sin(phase)
        if self.stiffness == "fourier":
            rows = self._terms("stiffness_terms", self.stiffness_terms)
            return -sum(order * amplitude * gl.sin(order * phase + shift) for order, amplitude, shift in rows)
        if self.stiffness == "table":
            table = checked_period(self._owner("stiffness_table"), self.stiffness_table)
            return periodic(table, self.phase_in_stiffness)[1]
        return 0

    def _force(self) -> tuple[Any, Any]:
        """Force and loss."""
        damping = self.d * self.v
        if not self.backlash:
            return self.c_now * self.q + damping, damping * self.v
        half = self.b / 2
        drive, coast = self._flanks()
        force = gl.Piecewise((self.c_now * (self.q - half) + damping, drive), (0, True)) + gl.Piecewise(
            (self.c_now * (self.q + half) + damping, coast), (0, True)
        )
        flanks = gl.Piecewise((1, drive), (0, True)) + gl.Piecewise((1, coast), (0, True))
        return force, flanks * damping * self.v

    def _flanks(self) -> tuple[Any, Any]:
        """Whether each flank is in contact. One of them includes the edge of the gap: without a gap there is always contact."""
        return self.q >= self.b / 2, self.q < -self.b / 2

    def _contact(self) -> Any:
        if not self.backlash:
            return 1
        drive, coast = self._flanks()
        return gl.no_event(gl.Piecewise((2, sympy.And(drive, coast)), (1, drive), (-1, coast), (0, True)))

    def _friction(self, turns_against: int) -> list[gl.Eq]:
        """The sliding of the pairs in contact, and the torques of their friction."""
        laws = (self.beyond, self.sliding, self.grip, self.grip_later, self.tau_friction_a, self.tau_friction_b)
        if not self.friction:
            return [gl.Eq(law, 0) for law in laws]
        step, opposite = turns_against * self.pitch, turns_against * self.tangent_b
        early, late = stretches(type(self).__name__, self.contact_ratio)
        inside = early.within(self.phase)
        newest = gl.Piecewise((early.newest(self.phase), inside), (late.newest(self.phase), True))

        def mean(weight: int) -> Any:
            """Over the pairs, of their signs; with weight 1 each times the pitches that it is ahead of the newest."""
            speeds = [self.sliding + pair * step * (self.w_a - self.w_b) for pair in range(early.pairs)]
            signs = [pair**weight * gl.tanh(speed / self.v_smooth) for pair, speed in enumerate(speeds)]
            return gl.Piecewise(*((sum(signs[: s.pairs]) / s.pairs, when) for s, when in ((early, inside), (late, True))))

        pressed = self.mu * gl.no_event(abs(self.f))
        arm_a, arm_b = self.tangent_a + self.beyond, opposite - self.beyond
        values = (
            step * (newest - self.approach),
            arm_a * self.w_a + arm_b * self.w_b,
            mean(0),
            mean(1),
            pressed * (arm_a * self.grip + step * self.grip_later),
            pressed * (arm_b * self.grip - step * self.grip_later),
        )
        return [gl.Eq(law, value) for law, value in zip(laws, values, strict=True)]


class DetailedExternalMesh(DetailedMesh):
    """Two outer gears, which turn against each other, with backlash and with parameters that vary over the mesh phase.

    ``der(q) = r_a w_a + r_b w_b + e_rate + der(e)`` with speeds relative to the support. The static transmission error is
    ``e = sum(E_k sin(k phase + p_k))``, plus a table if there is one.

    Without backlash ``f = c_now q + d v``. With it, each flank that touches adds its part: the drive flank
    ``c_now (q - b/2) + d v`` where ``q > b/2``, the coast flank ``c_now (q + b/2) + d v`` where ``q < -b/2``. A negative ``b`` is an
    interference: within ``abs(q) < -b/2`` both flanks touch, pressed by ``-c_now b / 2``, and the mesh is twice as stiff.

    The stiffness ``c_now`` is the mean ``c`` times 1, ``1 + c_amplitude cos(phase)``, ``1 + sum(A_k cos(k phase + p_k))``, the
    value of a table, or, rectangular, proportional to the number of pairs in contact: the next number above the contact ratio in
    the fractional part of it of each period, from its beginning, and the number below otherwise. ``phase + c_phase`` stands for
    the phase. Tables are interpolated by periodic cubic splines (`gearparts.mesh_phase.periodic`); `GearPair` makes some from
    the geometry.

    With friction, the pairs in contact share ``f`` equally. A pair that has come ``u`` base pitches ``p = 2 pi r_a / z_a`` along
    the line of action touches at ``x_a = r_a tan(alpha) + p (u - approach)`` from gear a's tangent point and at
    ``x_b = r_b tan(alpha) - p (u - approach)`` from gear b's. Its flanks slide with ``v_s = x_a w_a + x_b w_b``, which changes its
    sign at the pitch point, and rub with ``mu abs(f) / pairs tanh(v_s / v_smooth)``, which has the arms ``x_a`` and ``x_b``. So it
    always takes power, and at rest none is transmitted. Without vibrations and with ``1 <= contact_ratio <= 2`` the mean loss is
    ``mu pi (1/z_a + 1/z_b) (1 - eps + eps_1**2 + eps_2**2)`` of the power, with the contact ratios of approach and recess. Both
    flanks are taken to have the drive flank's positions.

    References
    ----------
    A. Kahraman, R. Singh, "Interactions between time-varying mesh stiffness and clearance non-linearities in a geared system",
    Journal of Sound and Vibration 146 (1991), 135-156. https://doi.org/10.1016/0022-460X(91)90527-Q

    S. He, R. Gunda, R. Singh, "Effect of sliding friction on the dynamics of spur gear pair with realistic time-varying
    stiffness", Journal of Sound and Vibration 301 (2007), 927-949 (moments of friction; here with a smoothed sign).

    G. Niemann, H. Winter, "Maschinenelemente", vol. 2 (mean loss).
    """

    turns_against = 1


class DetailedInternalMesh(DetailedMesh):
    """A ring on flange_a and a gear inside it: ``der(q) = r_a w_a - r_b w_b + e_rate + der(e)``; else as `DetailedExternalMesh`.

    With friction, both tangent points lie on one side of the pitch point: ``x_a = r_a tan(alpha) - p (u - approach)``,
    ``x_b = r_b tan(alpha) - p (u - approach)``, ``v_s = x_a w_a - x_b w_b``.
    """

    turns_against = -1


def mesh_damping(zeta: Any, c: Any, J_a: Any, r_a: Any, J_b: Any, r_b: Any) -> Any:
    """Mesh damping (N.s/m) for a damping ratio: ``2 zeta sqrt(c m)`` with the reduced mass ``1 / (r_a**2 / J_a + r_b**2 / J_b)``.

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

    Raises
    ------
    BoundError
        A number that is out of range.

    Examples
    --------
    >>> float(mesh_damping(0.05, 2e8, 0.001, 0.05, 0.016, 0.1))
    800.0
    """
    for name, value in {"zeta": zeta, "c": c, "J_a": J_a, "r_a": r_a, "J_b": J_b, "r_b": r_b}.items():
        if isinstance(value, sympy.Expr):
            continue
        may_be_zero = name in ("zeta", "c")
        if not (is_finite(value) and (value > 0 or (may_be_zero and value == 0))):
            expected = "a finite number from 0 on" if may_be_zero else "a positive finite number"
            raise BoundError(f"mesh_damping: {name} is {value!r}; expected {expected}")
    return 2 * zeta * gl.sqrt(c / (r_a**2 / J_a + r_b**2 / J_b))
