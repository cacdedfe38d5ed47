"""The component library of gearlib: shafts, gears, meshes, planetary sets, sources, sensors and complete trains.

Every component is here; nothing is imported before it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearparts.gears import IdealGear as IdealGear
    from gearparts.gears import IdealPlanetary as IdealPlanetary
    from gearparts.interfaces import Flange as Flange
    from gearparts.interfaces import HeatPort as HeatPort
    from gearparts.interfaces import TranslationalFlange as TranslationalFlange
    from gearparts.meshes import ExternalMesh as ExternalMesh
    from gearparts.meshes import InternalMesh as InternalMesh
    from gearparts.planetary import Planet as Planet
    from gearparts.planetary import PlanetaryUnit as PlanetaryUnit
    from gearparts.planetary import PlanetOnCarrier as PlanetOnCarrier
    from gearparts.shafts import Damper as Damper
    from gearparts.shafts import Fixed as Fixed
    from gearparts.shafts import Inertia as Inertia
    from gearparts.shafts import Spring as Spring
    from gearparts.shafts import SpringDamper as SpringDamper
    from gearparts.sources import QuadraticSpeedDependentTorque as QuadraticSpeedDependentTorque
    from gearparts.sources import Torque as Torque
    from gearparts.trains import FixedAxisUnit as FixedAxisUnit
    from gearparts.trains import XPTrain as XPTrain
    from gearparts.trains import ZhouCui2022 as ZhouCui2022

_HOME = {
    **dict.fromkeys(["IdealGear", "IdealPlanetary"], "gearparts.gears"),
    **dict.fromkeys(["Flange", "HeatPort", "TranslationalFlange"], "gearparts.interfaces"),
    **dict.fromkeys(["ExternalMesh", "InternalMesh"], "gearparts.meshes"),
    **dict.fromkeys(["Planet", "PlanetOnCarrier", "PlanetaryUnit"], "gearparts.planetary"),
    **dict.fromkeys(["Damper", "Fixed", "Inertia", "Spring", "SpringDamper"], "gearparts.shafts"),
    **dict.fromkeys(["QuadraticSpeedDependentTorque", "Torque"], "gearparts.sources"),
    **dict.fromkeys(["FixedAxisUnit", "XPTrain", "ZhouCui2022"], "gearparts.trains"),
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'gearparts' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
