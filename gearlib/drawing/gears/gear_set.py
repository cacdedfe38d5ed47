"""What a view of gears shows, as plain data: wheels with their outlines and motion, and the meshes whose forces are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Wheel:
    """A gear in the plane.

    Parameters
    ----------
    name : str
    outline : array
        Polygon about the gear's axis at the angle zero, shape (n, 2), m.
    pitch_radius : float
        Of the working pitch circle, m.
    ring : bool
        Whether its teeth point inwards.
    turn : tuple of float
        Angle at the start (rad), and how far it turns with the set's first gear and with its carrier.
    orbit : float
        Distance of its axis from the set's, m; 0: they are the same.
    place : float
        Where its axis stands on the carrier, rad.
    """

    name: str
    outline: Floats
    pitch_radius: float
    ring: bool
    turn: tuple[float, float, float]
    orbit: float = 0.0
    place: float = 0.0


@dataclass(frozen=True)
class Contact:
    """A mesh of two wheels.

    Parameters
    ----------
    a, b : int
        Numbers of the wheels; ``a`` is on the set's axis.
    alpha : float
        Working pressure angle, rad.
    force : str
        Variable, from the component on, that is positive where a positive turn of ``a`` presses the teeth together; N.
    share : float
        Of that force in this mesh.
    """

    a: int
    b: int
    alpha: float
    force: str = ""
    share: float = 1.0


@dataclass(frozen=True)
class WheelPosition:
    """Where a wheel is: centre (m) and angle (rad)."""

    x: float
    y: float
    angle: float


@dataclass(frozen=True, eq=False)
class GearSet:
    """Gears that mesh with each other, about one axis.

    Parameters
    ----------
    wheels : tuple of Wheel
    contacts : tuple of Contact
    first, carrier : str
        Variables with the angles that move the set, from the component on; an empty carrier stands still.
    holding : mapping
        How far the first gear and the carrier turn with the angle of a view, by the shaft that is held.
    """

    wheels: tuple[Wheel, ...]
    contacts: tuple[Contact, ...]
    first: str
    carrier: str
    holding: Mapping[str, tuple[float, float]]

    @property
    def extent(self) -> float:
        """Radius of the circle around everything, m."""
        return max(w.orbit + float(np.hypot(*w.outline.T).max()) * (1.1 if w.ring else 1.0) for w in self.wheels)

    def placed(self, first: float, carrier: float) -> list[WheelPosition]:
        """Where the wheels are at an angle of the first gear and of the carrier (rad)."""
        found = []
        for wheel in self.wheels:
            start, by_first, by_carrier = wheel.turn
            at = wheel.place + carrier
            found.append(
                WheelPosition(wheel.orbit * cos(at), wheel.orbit * sin(at), start + by_first * first + by_carrier * carrier)
            )
        return found

    def force_on_b(self, contact: Contact, placed: list[WheelPosition], force: float) -> tuple[float, float, float, float]:
        """Where the mesh is (its pitch point, m) and the force on wheel b (N).

        With e from the axis of a to that of b, and t at a right angle to it, a positive force pushes b along t and away from the
        teeth of a: along e, or, within a ring, against it. A negative one acts on the other flank.
        """
        a, b = placed[contact.a], placed[contact.b]
        wheel = self.wheels[contact.a]
        distance = float(np.hypot(b.x - a.x, b.y - a.y))
        ex, ey = (b.x - a.x) / distance, (b.y - a.y) / distance
        along, apart = force * cos(contact.alpha), abs(force) * sin(contact.alpha) * (-1 if wheel.ring else 1)
        r = wheel.pitch_radius
        return a.x + r * ex, a.y + r * ey, -ey * along + ex * apart, ex * along + ey * apart


def meshing_turn(z_a: int, z_b: int, ring: bool, place: float, turn: tuple[float, float, float]) -> tuple[float, float, float]:
    """Rotation of wheel b in mesh with wheel a, whose rotation is ``turn``; b's axis is at the angle ``place`` on the carrier.

    On the line of centres a tooth of the one faces a space of the other. Of a ring the spaces are counted, so a tooth of b is where a
    space of the ring is.

    >>> meshing_turn(20, 40, False, 0.0, (0.0, 1.0, 0.0))[1:]
    (-0.5, 1.5)
    >>> meshing_turn(60, 20, True, 0.0, (0.0, 1.0, 0.0))
    (0.0, 3.0, -2.0)
    """
    ratio = z_a / z_b if ring else -z_a / z_b
    start = place if ring else place + pi + pi / z_b
    return start + ratio * (turn[0] - place), ratio * turn[1], 1 - ratio + ratio * turn[2]
