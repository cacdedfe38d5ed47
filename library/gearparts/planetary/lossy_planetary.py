"""Planetary set with mesh efficiencies and bearing friction, with self-locking."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearlib.errors import BindingError
from gearparts.gears.lossy import LossyGear
from gearparts.interfaces import Flange, MaybeHeated
from gearparts.tables import IDEAL_MESH, NO_FRICTION, Rows, check_rows

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class LossyPlanetary(MaybeHeated):
    """Planetary set with mesh efficiencies and bearing friction, without inertia; the lossy version of `IdealPlanetary`.

    ``(1 + ratio) phi_carrier = phi_sun + ratio phi_ring``. Meshes dissipate power through the motion relative to the carrier. In that
    frame the set is a fixed-axis gear from the sun over the planets to the ring, ``w_sun - w_carrier = -ratio (w_ring - w_carrier)``,
    and its efficiency is the product of those of its two meshes, ``eta_s eta_r``. So it is a `LossyGear` with the carrier as its
    housing, whose laws hold for all directions of speed and power and at standstill: with the sun driving relative to the carrier
    ``tau_ring = ratio (eta tau_sun - B)``, with the ring driving ``tau_ring = ratio (tau_sun / eta - B)``, and ``tau_sun + tau_ring +
    tau_carrier = 0``.

    A row of ``sun_mesh`` or ``ring_mesh`` holds the speed of the sun relative to the carrier, and the efficiencies of the mesh with the
    sun driving and with the ring driving. A row of ``bearing`` holds that speed and a friction torque, referred to the sun. Beyond their
    first and last rows the three tables are constant; the product is exact at the speeds of all rows, and linear between them.

    References
    ----------
    H. W. Mueller, "Epicyclic Drive Trains", Wayne State University Press, 1982.

    E. Pennestri, F. Freudenstein, "The mechanical efficiency of epicyclic gear trains", Journal of Mechanical Design 115 (1993),
    645-651. https://doi.org/10.1115/1.2919239

    C. Pelchen, C. Schweiger, M. Otter, "Modeling and simulating the efficiency of gearboxes and of planetary gearboxes",
    2nd International Modelica Conference, 2002, pp. 257-266.
    """

    icon = "planetary"
    radii = ("ratio",)

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    sun_mesh = gl.Structural(IDEAL_MESH, "rows of speed (rad/s) and the efficiencies with the sun and with the ring driving")
    ring_mesh = gl.Structural(IDEAL_MESH, "rows of speed (rad/s) and the efficiencies with the sun and with the ring driving")
    bearing = gl.Structural(NO_FRICTION, "rows of speed (rad/s) and friction torque at the sun (N.m)")
    ratio = gl.Parameter("1", "teeth of the ring over teeth of the sun")
    loss_power = gl.Variable("W", "power lost to heat")

    def assemble(self) -> list[Connection]:
        table = combined_losses(self.sun_mesh, self.ring_mesh, self.bearing)
        self.gear = LossyGear(ratio=-self.ratio, loss_table=table, use_support=True, use_heat_port=self.use_heat_port)
        links = [
            gl.connect(self.sun, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.ring),
            gl.connect(self.gear.support, self.carrier),
        ]
        return [*links, gl.connect(self.heat_port, self.gear.heat_port)] if self.use_heat_port else links

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.loss_power, self.gear.loss_power)]


def combined_losses(sun_mesh: Rows, ring_mesh: Rows, bearing: Rows = NO_FRICTION) -> Rows:
    """Loss table of the equivalent `LossyGear` from sun to ring in the carrier frame, with the product of both mesh efficiencies.

    The product is tabulated at the speeds of all three tables and interpolated between them. Each table is constant beyond its ends.

    Parameters
    ----------
    sun_mesh, ring_mesh : rows of float
        Speed of the sun relative to the carrier (rad/s), efficiencies with the sun and with the ring driving.
    bearing : rows of float
        Speed (rad/s), friction torque at the sun (N.m).

    Returns
    -------
    rows of float
        Speed, eta1, eta2, B1, B2.

    Raises
    ------
    BindingError
        An efficiency outside of 0 (exclusive) to 1, or an invalid table.

    Examples
    --------
    >>> combined_losses(((0, 0.9, 0.8),), ((0, 0.5, 1.0), (10, 1.0, 1.0)))
    ((0.0, 0.45, 0.8, 0.0, 0.0), (10.0, 0.9, 0.8, 0.0, 0.0), (11.0, 0.9, 0.8, 0.0, 0.0))
    """
    tables = {"sun_mesh": check_rows("LossyPlanetary.sun_mesh", sun_mesh, 3)}
    tables["ring_mesh"] = check_rows("LossyPlanetary.ring_mesh", ring_mesh, 3)
    for name, rows in tables.items():
        for row in rows:
            if not (0 < row[1] <= 1 and 0 < row[2] <= 1):
                raise BindingError(f"LossyPlanetary.{name} has the row {row}; expected efficiencies above 0, up to 1")
    friction = check_rows("LossyPlanetary.bearing", bearing, 2)
    speeds = sorted({row[0] for rows in (*tables.values(), friction) for row in rows})
    if len(speeds) > 1:  # a LossyGear extrapolates from two rows: equal ones make that constant
        speeds = [*sorted({0.0, *speeds}), speeds[-1] + 1.0]
    losses = []
    for speed in speeds:
        forward, backward = (
            _at(tables["sun_mesh"], speed, column) * _at(tables["ring_mesh"], speed, column) for column in (1, 2)
        )
        torque = _at(friction, speed, 1)
        losses.append((speed, forward, backward, torque, torque))
    return tuple(losses)


def _at(rows: Rows, speed: float, column: int) -> float:
    """A column, linear between its rows and constant beyond them."""
    import numpy as np

    return float(np.interp(speed, [row[0] for row in rows], [row[column] for row in rows]))
