"""The component library of gearlib: shafts, gears, meshes, planetary sets, sources, sensors and complete trains."""

from gearparts.gears import IdealGear, IdealPlanetary
from gearparts.interfaces import Flange, HeatPort, TranslationalFlange
from gearparts.shafts import Damper, Fixed, Inertia, Spring, SpringDamper
from gearparts.sources import QuadraticSpeedDependentTorque, Torque

__all__ = [
    "Damper", "Fixed", "Flange", "HeatPort", "IdealGear", "IdealPlanetary", "Inertia", "QuadraticSpeedDependentTorque", "Spring",
    "SpringDamper", "Torque", "TranslationalFlange",
]  # fmt: skip
