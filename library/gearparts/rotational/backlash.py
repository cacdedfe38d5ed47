"""Couplings with backlash: spring and damper that act only outside a gap."""

from __future__ import annotations

from typing import Any

import gearlib as gl
from gearparts.interfaces import Compliant, Dissipative

NO_BACKLASH = 1e-10  # rad
CONTACT = {0.0: "open: coupling {}", 1.0: "in contact: coupling {}", -1.0: "in contact, driven backwards: coupling {}"}


class BacklashCoupling(Compliant, Dissipative):
    """Base of couplings with backlash: compliance, gap, and the side on which it is closed.

    A derived class defines by ``contact_torque`` the torque in contact.
    """

    icon = "backlash"

    c = gl.Parameter("N.m/rad", "stiffness in contact", min=0)
    d = gl.Parameter("N.m.s/rad", "damping in contact", min=0)
    b = gl.Parameter("rad", "total backlash", default=0.0, min=0)
    phi_rel0 = gl.Parameter("rad", "angle in the middle of the gap", default=0.0)
    tau_c = gl.Variable("N.m", "torque of the spring")
    tau_d = gl.Variable("N.m", "torque of the damper, where it acts in full")
    touching = gl.Variable("1", "the same as contact; 1 where there is no gap", words=CONTACT)
    has_gap = gl.Discrete("whether there is a backlash at all; otherwise it is a spring and a damper")
    contact = gl.Discrete("1 above the gap, -1 below it, 0 inside")

    def contact_torque(self) -> Any:
        """The torque in contact, on either side."""
        raise NotImplementedError

    def equations(self) -> list[gl.Eq]:
        x, half = self.phi_rel - self.phi_rel0, self.b / 2
        # multiplied by a flag: without a gap the comparisons would raise meaningless events
        above, below = self.has_gap * (x - half) > 0, self.has_gap * (x + half) < 0
        whole, inside = gl.equals(self.has_gap, 0), gl.equals(self.contact, 0)
        return [
            gl.Eq(self.tau_c, gl.Piecewise((self.c * x, whole), (0, inside), (self.c * (x - half * self.contact), True))),
            gl.Eq(self.tau_d, self.d * self.w_rel),
            gl.Eq(self.tau, gl.Piecewise((self.tau_c + self.tau_d, whole), (0, inside), (self.contact_torque(), True))),
            gl.Eq(self.has_gap, self.b > NO_BACKLASH),
            gl.Eq(self.contact, gl.Piecewise((1, above), (-1, below), (0, True))),
            gl.Eq(self.touching, gl.Piecewise((1, whole), (self.contact, True))),
            gl.Eq(self.loss_power, (self.tau - self.tau_c) * self.w_rel),
        ]

    def energies(self) -> gl.Energy:
        x, half = self.phi_rel - self.phi_rel0, self.b / 2
        beyond = gl.Max(x - half, 0) - gl.Max(-x - half, 0)  # deflection beyond the gap
        return gl.Energy(stored=self.c * beyond**2 / 2, heat=self.loss_power)


class ElastoBacklash(BacklashCoupling):
    """Backlash with spring and damper, without pull, and with damping limited to the spring's torque.

    With ``x = phi_rel - phi_rel0``: ``tau = max(0, tau_c + min(tau_c, d w_rel))`` with ``tau_c = c (x - b/2)`` for ``x > b/2``,
    ``tau = min(0, tau_c + max(tau_c, d w_rel))`` with ``tau_c = c (x + b/2)`` for ``x < -b/2``, and zero between. So the torque is
    continuous. Without a backlash, ``tau = c x + d w_rel``.
    """

    def contact_torque(self) -> Any:
        side, total = self.contact, self.tau_c + self.tau_d
        limited = gl.Piecewise((2 * self.tau_c, side * (self.tau_d - self.tau_c) > 0), (total, True))
        return gl.Piecewise((0, side * total < 0), (limited, True))


class ElastoBacklash2(BacklashCoupling):
    """Backlash with spring and damper without pull; the torque jumps where contact is made.

    With ``x = phi_rel - phi_rel0``: ``tau = max(0, tau_c + d w_rel)`` with ``tau_c = c (x - b/2)`` for ``x > b/2``,
    ``tau = min(0, tau_c + d w_rel)`` with ``tau_c = c (x + b/2)`` for ``x < -b/2``, and zero between. Without a backlash,
    ``tau = c x + d w_rel``.
    """

    def contact_torque(self) -> Any:
        total = self.tau_c + self.tau_d
        return gl.Piecewise((0, self.contact * total < 0), (total, True))
