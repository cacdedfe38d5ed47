"""Detailed meshes: backlash or preload, time-varying stiffness, static transmission error, sliding friction.

As in ``meshes``, the deflection ``q`` along the line of action is a state, counted from unloaded contact in the middle of the gap; it
is positive if a positive rotation of ``flange_a`` presses the teeth together. The mesh phase grows by two pi per tooth of gear a,
``der(phase) = z_a (w_a - w_support)``; at multiples of two pi a new pair comes into contact. It is a state only if something depends on
it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

import gearlib as gl
from gearlib.arguments import is_real, shown
from gearlib.errors import BindingError, BoundError
from gearlib.language.interior import path_of
from gearparts.gears.tooth_friction import ToothFriction
from gearparts.gears.transmission_error import TransmissionError
from gearparts.interfaces import Dissipative

if TYPE_CHECKING:
    from gearlib.drawing.gears.gear_set import GearSet


class DetailedMesh(TransmissionError, ToothFriction, Dissipative):
    """Base of the detailed meshes, assembled from the constitutive laws; see `DetailedExternalMesh`.

    The mesh phase (`MeshMotion`), phase-dependent stiffness (`VaryingStiffness`, with a `StiffnessLaw`), static transmission error
    (`TransmissionError`), flanks with or without backlash (`Flanks`) and tooth friction (`ToothFriction`).
    """

    icon = "mesh"
    radii = ("r_a", "r_b")

    def equations(self) -> list[gl.Eq]:
        r_b = self.turns_against * self.r_b
        rubbing_a, rubbing_b = self.friction_torques()
        return [
            gl.Eq(self.v, self.r_a * self.w_a + r_b * self.w_b + self.error_rate()),
            gl.Eq(self.flange_a.tau, self.r_a * self.f + rubbing_a),
            gl.Eq(self.flange_b.tau, r_b * self.f + rubbing_b),
            gl.Eq(self.loss_power, self.damping_loss() + rubbing_a * self.w_a + rubbing_b * self.w_b),
        ]

    def drawn_gears(self) -> GearSet | None:
        """From base radii, teeth, working pressure angle and path of contact; both gears have teeth as thick as their spaces."""
        from gearparts.gears.drawn_gears import meshing_pair

        return meshing_pair(self, "support.phi" if self.use_support else "")

    def energies(self) -> gl.Energy:
        """The transmission error moves the flanks, and varying stiffness changes the energy stored at a given deflection."""
        stiffer = self.stiffness_slope() * self.phase_rate() * self.squared_deflection() / 2
        return gl.Energy(
            stored=self.c_now * self.squared_deflection() / 2,
            heat=self.loss_power,
            supplied=self.f * self.error_rate() + stiffer,
        )


class DetailedExternalMesh(DetailedMesh):
    """Mesh of two external gears with backlash, and with phase-dependent stiffness, transmission error and friction.

    ``der(q) = r_a w_a + r_b w_b + e_rate + der(e)`` with speeds relative to the support. The static transmission error is ``e = sum(E_k
    sin(k phase + p_k))``, plus a table if one is given.

    Without backlash ``f = c_now q + d v``. With it, each flank in contact contributes: the drive flank ``c_now (q - b/2) + d v`` where
    ``q > b/2``, the coast flank ``c_now (q + b/2) + d v`` where ``q < -b/2``. A negative ``b`` is an interference fit: for ``abs(q) <
    -b/2`` both flanks are in contact, preloaded by ``-c_now b / 2``, and the mesh is twice as stiff.

    The stiffness ``c_now`` is the mean ``c`` times 1, ``1 + c_amplitude cos(phase)``, ``1 + sum(A_k cos(k phase + p_k))``, the value of
    a table or, for rectangular variation, a factor proportional to the number of pairs in contact: the integer above the contact ratio
    during the first part of each period, which is the fractional part of the contact ratio, and the integer below it afterwards. The
    phase in these laws is ``phase + c_phase``. Tables are interpolated by periodic cubic splines
    (`gearparts.gears.mesh_phase.periodic`); `GearPair` computes some from the geometry.

    With friction, the pairs in contact share ``f`` equally. A pair that has advanced by ``u`` base pitches ``p = 2 pi r_a / z_a`` along
    the line of action is in contact at ``x_a = r_a tan(alpha) + p (u - approach)`` from gear a's tangent point and at ``x_b = r_b
    tan(alpha) - p (u - approach)`` from gear b's. Its flanks slide with ``v_s = x_a w_a + x_b w_b``, which changes sign at the pitch
    point, and the friction force ``mu abs(f) / pairs tanh(v_s / v_smooth)`` has the lever arms ``x_a`` and ``x_b``. So it is always
    dissipative, and vanishes at rest. Without vibration and for ``1 <= contact_ratio <= 2`` the mean loss is ``mu pi (1/z_a + 1/z_b) (1
    - eps + eps_1**2 + eps_2**2)`` of the power, with the contact ratios of approach and recess. The positions of the drive flank are
    used for both flanks.

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
    """Mesh of a ring on flange_a and a gear inside it: ``der(q) = r_a w_a - r_b w_b + e_rate + der(e)``; see `DetailedExternalMesh`.

    With friction, both tangent points lie on one side of the pitch point: ``x_a = r_a tan(alpha) - p (u - approach)``,
    ``x_b = r_b tan(alpha) - p (u - approach)``, ``v_s = x_a w_a - x_b w_b``.
    """

    icon = "internal_mesh"

    turns_against = -1


def mesh_damping(zeta: Any, c: Any, J_a: Any, r_a: Any, J_b: Any, r_b: Any) -> Any:
    """Mesh damping (N.s/m) for a damping ratio: ``2 zeta sqrt(c m)`` with the reduced mass ``1 / (r_a**2 / J_a + r_b**2 / J_b)``.

    Parameters
    ----------
    zeta : float or expression
        Damping ratio of the relative vibration of the pair.
    c : float or expression
        Mean mesh stiffness, N/m.
    J_a, J_b : float or expression
        Moments of inertia, kg.m2.
    r_a, r_b : float or expression
        Base radii, m.

    Raises
    ------
    BoundError
        A value out of range.

    Examples
    --------
    >>> float(mesh_damping(0.05, 2e8, 0.001, 0.05, 0.016, 0.1))
    800.0
    """
    for name, value in {"zeta": zeta, "c": c, "J_a": J_a, "r_a": r_a, "J_b": J_b, "r_b": r_b}.items():
        if isinstance(value, sympy.Expr):
            continue
        may_be_zero = name in ("zeta", "c")
        if not (is_real(value) and (value > 0 or (may_be_zero and value == 0))):
            expected = "a finite number from 0 on" if may_be_zero else "a positive finite number"
            raise BoundError(f"mesh_damping: {name} is {shown(value)}; expected {expected}")
    try:
        damping = 2 * zeta * gl.sqrt(c / (r_a**2 / J_a + r_b**2 / J_b))
    except (OverflowError, ZeroDivisionError, gl.GearlibError):
        damping = sympy.nan
    if not damping.free_symbols and not is_real(damping):
        raise BoundError(f"mesh_damping({zeta=}, {c=}, {J_a=}, {r_a=}, {J_b=}, {r_b=}) is not a finite number")
    return damping


def details_of(owner: gl.Component, name: str) -> dict[str, Any]:
    """Choices and values of a detailed mesh, which a structural choice of its owner gives as pairs.

    Raises
    ------
    BindingError
        They are not pairs that begin with a name.
    """
    given = getattr(owner, name)
    try:
        found = dict(given)
    except Exception:  # not pairs
        found = {None: None}
    if not all(isinstance(each, str) for each in found):
        said = f"{path_of(owner) or type(owner).__name__}.{name} is {shown(given)}"
        raise BindingError(f"{said}; expected pairs of a name and a value")
    return found
