"""Friction of rolling bearings, as a table for `gearparts.BearingFriction`."""

from __future__ import annotations

import math

from gearlib.arguments import is_real, shown, whole
from gearlib.errors import ArgumentError
from gearparts.tables import Rows


def palmgren_friction(
    d_m: float, *, f_0: float, viscosity: float, f_1: float = 0.0, load: float = 0.0, w_max: float = 300.0, rows: int = 12
) -> Rows:  # fmt: skip
    """Friction torque of a rolling bearing over speed, after Palmgren: a load-independent part and one proportional to the load.

    With ``d_m`` in mm, the kinematic viscosity ``nu`` in mm2/s and the speed ``n`` in 1/min, the load-independent part is ``1e-7 f_0
    (nu n)**(2/3) d_m**3`` N.mm, or ``160e-7 f_0 d_m**3`` N.mm for ``nu n < 2000``; the other is ``f_1 load d_m``.

    Parameters
    ----------
    d_m : float
        Mean diameter of the bearing, m.
    f_0 : float
        Factor for bearing type and lubrication (1.5 to 2 for deep groove ball bearings in an oil bath).
    viscosity : float
        Kinematic viscosity of the oil at operating temperature, m2/s.
    f_1 : float
        Factor of the load-dependent part (0.0003 to 0.001).
    load : float
        Load on the bearing, N.
    w_max : float
        Highest speed of the table, rad/s; it is extrapolated beyond.
    rows : int
        Number of rows.

    Returns
    -------
    rows of float
        Speed (rad/s), torque (N.m): ``tau_pos`` of `BearingFriction`.

    Raises
    ------
    ArgumentError
        A value that is not positive, or fewer than three rows.

    References
    ----------
    A. Palmgren, "Ball and Roller Bearing Engineering", SKF Industries, 1959.

    Examples
    --------
    >>> table = palmgren_friction(0.06, f_0=2.0, viscosity=30e-6, f_1=5e-4, load=2000.0, w_max=200.0, rows=4)
    >>> [(round(w, 3), round(tau, 5)) for w, tau in table]
    [(0.0, 0.06691), (6.981, 0.06686), (103.491, 0.10138), (200.0, 0.1242)]
    """
    for name, value in {"d_m": d_m, "f_0": f_0, "viscosity": viscosity, "w_max": w_max}.items():
        if not (is_real(value) and value > 0):
            raise ArgumentError(f"palmgren_friction({name}={shown(value)}): expected a positive number")
    for name, value in {"f_1": f_1, "load": load}.items():
        if not (is_real(value) and value >= 0):
            raise ArgumentError(f"palmgren_friction({name}={shown(value)}): expected 0 or more")
    rows = whole("palmgren_friction: rows", rows, 3)
    corner = 2000 / (1e6 * viscosity) * math.pi / 30  # rad/s, where nu n = 2000
    if corner >= w_max:
        speeds = [w_max * k / (rows - 1) for k in range(rows)]
    else:
        speeds = [0.0, *(corner + (w_max - corner) * k / (rows - 2) for k in range(rows - 1))]
    loaded, d = f_1 * load * d_m, 1e3 * d_m

    def free(w: float) -> float:
        flow = 1e6 * viscosity * w * 30 / math.pi
        return 1e-3 * f_0 * (d * d * d) * (160e-7 if w < corner else 1e-7 * flow ** (2 / 3))

    table = tuple((w, loaded + free(w)) for w in speeds)
    if not all(map(is_real, (number for row in table for number in row))):
        raise ArgumentError(f"palmgren_friction({d_m=}, {f_0=}, {viscosity=}, {w_max=}): the torque is too large for a number")
    return table
