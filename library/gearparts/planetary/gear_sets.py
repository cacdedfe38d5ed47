"""Compound planetary sets of automatic transmissions from rigid sets: double-pinion, Simpson, Ravigneaux.

References
----------
H. W. Mueller, "Epicyclic Drive Trains", Wayne State University Press, 1982.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import gearlib as gl
from gearparts.gears.rigid_gears import IdealPlanetary
from gearparts.interfaces import Flange

if TYPE_CHECKING:
    from gearlib.language.component import Connection


class DoublePinionPlanetary(gl.Component):
    """Planetary set with two meshing planets between sun and ring: ``(1 - ratio) carrier = sun - ratio ring``.

    Relative to the carrier, sun and ring rotate in the same direction; it is `IdealPlanetary` with the negative ratio, and needs
    ``ratio != 1``. Torques: ``ring = -ratio sun``, ``carrier = (ratio - 1) sun``.
    """

    icon = "planetary"

    sun = Flange("sun shaft")
    carrier = Flange("carrier shaft")
    ring = Flange("ring shaft")
    ratio = gl.Parameter("1", "teeth of the ring over teeth of the sun")

    def assemble(self) -> list[Connection]:
        self.set = IdealPlanetary(ratio=-self.ratio)
        return [gl.connect(getattr(self, shaft), getattr(self.set, shaft)) for shaft in ("sun", "carrier", "ring")]


class Simpson(gl.Component):
    """Simpson set: two planetary sets with a common sun; the front carrier and the rear ring are the output.

    ``sun + ratio_front ring = (1 + ratio_front) output``, ``sun + ratio_rear output = (1 + ratio_rear) rear_carrier``.

    With the ring driving, first gear has the rear carrier held and ratio ``(1 + ratio_front + ratio_rear) / ratio_front``, second
    gear the sun held and ratio ``(1 + ratio_front) / ratio_front``; reverse has the sun driving and the rear carrier held, with
    ratio ``-ratio_rear``.
    """

    icon = "planetary"

    sun = Flange("common sun shaft")
    ring = Flange("front ring")
    rear_carrier = Flange("rear carrier")
    output = Flange("front carrier and rear ring")
    ratio_front = gl.Parameter("1", "teeth of the ring over teeth of the sun, front set")
    ratio_rear = gl.Parameter("1", "teeth of the ring over teeth of the sun, rear set")

    def assemble(self) -> list[Connection]:
        self.front, self.rear = IdealPlanetary(ratio=self.ratio_front), IdealPlanetary(ratio=self.ratio_rear)
        return [
            gl.connect(self.sun, self.front.sun, self.rear.sun),
            gl.connect(self.ring, self.front.ring),
            gl.connect(self.output, self.front.carrier, self.rear.ring),
            gl.connect(self.rear_carrier, self.rear.carrier),
        ]


class Ravigneaux(gl.Component):
    """Ravigneaux set: a large sun meshes with long planets, a small sun with short ones that mesh with the long ones; one ring.

    ``large_sun + ratio_large ring = (1 + ratio_large) carrier`` and ``small_sun - ratio_small ring = (1 - ratio_small) carrier``: a
    simple set and one with double pinions that share ring and carrier.

    With the ring as the output, first gear has the small sun driving and the carrier held, ratio ``ratio_small``; second gear the
    large sun held instead, ratio ``(ratio_small + ratio_large) / (1 + ratio_large)``; fourth gear the carrier driving and the
    large sun held, ratio ``ratio_large / (1 + ratio_large)``; reverse the large sun driving and the carrier held, ratio
    ``-ratio_large``.
    """

    icon = "planetary"

    small_sun = Flange("sun of the short planets")
    large_sun = Flange("sun of the long planets")
    carrier = Flange("common carrier")
    ring = Flange("ring")
    ratio_small = gl.Parameter("1", "teeth of the ring over teeth of the small sun")
    ratio_large = gl.Parameter("1", "teeth of the ring over teeth of the large sun")

    def assemble(self) -> list[Connection]:
        self.simple, self.double = IdealPlanetary(ratio=self.ratio_large), DoublePinionPlanetary(ratio=self.ratio_small)
        return [
            gl.connect(self.large_sun, self.simple.sun),
            gl.connect(self.small_sun, self.double.sun),
            gl.connect(self.carrier, self.simple.carrier, self.double.carrier),
            gl.connect(self.ring, self.simple.ring, self.double.ring),
        ]
