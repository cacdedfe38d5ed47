"""The component library of gearlib: shafts, gears, meshes, planetary sets, sources, sensors and complete trains.

Every component is here; nothing is imported before it is used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearparts.adaptors import AngleToTorqueAdaptor as AngleToTorqueAdaptor
    from gearparts.adaptors import TorqueToAngleAdaptor as TorqueToAngleAdaptor
    from gearparts.backlash import ElastoBacklash as ElastoBacklash
    from gearparts.backlash import ElastoBacklash2 as ElastoBacklash2
    from gearparts.bearings import palmgren_friction as palmgren_friction
    from gearparts.bond_graph import BondGraphPart as BondGraphPart
    from gearparts.bond_graph import from_bond_graph as from_bond_graph
    from gearparts.couplings import CubicSpringDamper as CubicSpringDamper
    from gearparts.couplings import ElasticCoupling as ElasticCoupling
    from gearparts.couplings import UniversalJoint as UniversalJoint
    from gearparts.friction import BearingFriction as BearingFriction
    from gearparts.friction import Brake as Brake
    from gearparts.friction import Clutch as Clutch
    from gearparts.friction import OneWayClutch as OneWayClutch
    from gearparts.gear_pair import GearPair as GearPair
    from gearparts.gear_sets import DoublePinionPlanetary as DoublePinionPlanetary
    from gearparts.gear_sets import Ravigneaux as Ravigneaux
    from gearparts.gear_sets import Simpson as Simpson
    from gearparts.gears import IdealGear as IdealGear
    from gearparts.gears import IdealGearR2T as IdealGearR2T
    from gearparts.gears import IdealPlanetary as IdealPlanetary
    from gearparts.gears import IdealRollingWheel as IdealRollingWheel
    from gearparts.interfaces import Flange as Flange
    from gearparts.interfaces import HeatPort as HeatPort
    from gearparts.interfaces import TranslationalFlange as TranslationalFlange
    from gearparts.lossy import Gearbox as Gearbox
    from gearparts.lossy import LossyGear as LossyGear
    from gearparts.lossy_planetary import LossyPlanetary as LossyPlanetary
    from gearparts.mesh_models import DetailedExternalMesh as DetailedExternalMesh
    from gearparts.mesh_models import DetailedInternalMesh as DetailedInternalMesh
    from gearparts.mesh_models import mesh_damping as mesh_damping
    from gearparts.meshes import ExternalMesh as ExternalMesh
    from gearparts.meshes import InternalMesh as InternalMesh
    from gearparts.motions import Accelerate as Accelerate
    from gearparts.motions import ConstantSpeed as ConstantSpeed
    from gearparts.motions import Move as Move
    from gearparts.motions import Position as Position
    from gearparts.motions import Speed as Speed
    from gearparts.phasing import PlanetPhasing as PlanetPhasing
    from gearparts.phasing import check_assembly as check_assembly
    from gearparts.phasing import planet_phasing as planet_phasing
    from gearparts.planar import PlanarBody as PlanarBody
    from gearparts.planar import PlanarFlange as PlanarFlange
    from gearparts.planar import PlanarMesh as PlanarMesh
    from gearparts.planar import PlanarPlanetaryUnit as PlanarPlanetaryUnit
    from gearparts.planar import PlanarShaft as PlanarShaft
    from gearparts.planar import PlanarSupport as PlanarSupport
    from gearparts.planar import PlanetBearing as PlanetBearing
    from gearparts.planetary import IdealPlanetaryUnit as IdealPlanetaryUnit
    from gearparts.planetary import LossyPlanetaryUnit as LossyPlanetaryUnit
    from gearparts.planetary import LumpedPlanetaryUnit as LumpedPlanetaryUnit
    from gearparts.planetary import Planet as Planet
    from gearparts.planetary import PlanetaryUnit as PlanetaryUnit
    from gearparts.planetary import PlanetOnCarrier as PlanetOnCarrier
    from gearparts.planetary import TorsionalPlanetaryUnit as TorsionalPlanetaryUnit
    from gearparts.planetary import TranslationalPlanetaryUnit as TranslationalPlanetaryUnit
    from gearparts.sensors import AccSensor as AccSensor
    from gearparts.sensors import AngleSensor as AngleSensor
    from gearparts.sensors import MultiSensor as MultiSensor
    from gearparts.sensors import PowerSensor as PowerSensor
    from gearparts.sensors import RelAccSensor as RelAccSensor
    from gearparts.sensors import RelAngleSensor as RelAngleSensor
    from gearparts.sensors import RelSpeedSensor as RelSpeedSensor
    from gearparts.sensors import SpeedSensor as SpeedSensor
    from gearparts.sensors import TorqueSensor as TorqueSensor
    from gearparts.shafts import Damper as Damper
    from gearparts.shafts import Disc as Disc
    from gearparts.shafts import Fixed as Fixed
    from gearparts.shafts import Inertia as Inertia
    from gearparts.shafts import InitializeFlange as InitializeFlange
    from gearparts.shafts import RelativeStates as RelativeStates
    from gearparts.shafts import Spring as Spring
    from gearparts.shafts import SpringDamper as SpringDamper
    from gearparts.shafts import TorsionalShaft as TorsionalShaft
    from gearparts.single_loop import PXTrain as PXTrain
    from gearparts.single_loop import XXTrain as XXTrain
    from gearparts.sources import ConstantTorque as ConstantTorque
    from gearparts.sources import EddyCurrentTorque as EddyCurrentTorque
    from gearparts.sources import InverseSpeedDependentTorque as InverseSpeedDependentTorque
    from gearparts.sources import LinearSpeedDependentTorque as LinearSpeedDependentTorque
    from gearparts.sources import QuadraticSpeedDependentTorque as QuadraticSpeedDependentTorque
    from gearparts.sources import SignTorque as SignTorque
    from gearparts.sources import Torque as Torque
    from gearparts.sources import Torque2 as Torque2
    from gearparts.sources import TorqueStep as TorqueStep
    from gearparts.stiffness_laws import StiffnessLaw as StiffnessLaw
    from gearparts.stiffness_patterns import StiffnessPattern as StiffnessPattern
    from gearparts.stiffness_patterns import cai_pair_stiffness as cai_pair_stiffness
    from gearparts.stiffness_patterns import cai_stiffness as cai_stiffness
    from gearparts.thermal import Convection as Convection
    from gearparts.thermal import FixedTemperature as FixedTemperature
    from gearparts.thermal import HeatCapacitor as HeatCapacitor
    from gearparts.thermal import ThermalConductor as ThermalConductor
    from gearparts.trains import FixedAxisUnit as FixedAxisUnit
    from gearparts.trains import XPTrain as XPTrain
    from gearparts.trains import ZhouCui2022 as ZhouCui2022
    from gearparts.translational import Force as Force
    from gearparts.translational import Mass as Mass
    from gearparts.translational import QuadraticSpeedDependentForce as QuadraticSpeedDependentForce
    from gearparts.translational import TranslationalDamper as TranslationalDamper
    from gearparts.translational import TranslationalFixed as TranslationalFixed
    from gearparts.translational import TranslationalSpring as TranslationalSpring
    from gearparts.translational import TranslationalSpringDamper as TranslationalSpringDamper

_HOME = {
    **dict.fromkeys(["AngleToTorqueAdaptor", "TorqueToAngleAdaptor"], "gearparts.adaptors"),
    **dict.fromkeys(["ElastoBacklash", "ElastoBacklash2"], "gearparts.backlash"),
    **dict.fromkeys(["BondGraphPart", "from_bond_graph"], "gearparts.bond_graph"),
    **dict.fromkeys(["BearingFriction", "Brake", "Clutch", "OneWayClutch"], "gearparts.friction"),
    "GearPair": "gearparts.gear_pair",
    **dict.fromkeys(["IdealGear", "IdealGearR2T", "IdealPlanetary", "IdealRollingWheel"], "gearparts.gears"),
    **dict.fromkeys(["Flange", "HeatPort", "TranslationalFlange"], "gearparts.interfaces"),
    **dict.fromkeys(["Gearbox", "LossyGear"], "gearparts.lossy"),
    **dict.fromkeys(["DetailedExternalMesh", "DetailedInternalMesh", "mesh_damping"], "gearparts.mesh_models"),
    **dict.fromkeys(["ExternalMesh", "InternalMesh"], "gearparts.meshes"),
    **dict.fromkeys(["Accelerate", "ConstantSpeed", "Move", "Position", "Speed"], "gearparts.motions"),
    **dict.fromkeys(
        [
            "PlanarBody", "PlanarFlange", "PlanarMesh", "PlanarPlanetaryUnit", "PlanarShaft", "PlanarSupport",
            "PlanetBearing",
        ],
        "gearparts.planar",
    ),
    **dict.fromkeys(
        [
            "IdealPlanetaryUnit", "LossyPlanetaryUnit", "LumpedPlanetaryUnit", "Planet", "PlanetOnCarrier", "PlanetaryUnit",
            "TorsionalPlanetaryUnit", "TranslationalPlanetaryUnit",
        ],
        "gearparts.planetary",
    ),
    **dict.fromkeys(
        [
            "AccSensor", "AngleSensor", "MultiSensor", "PowerSensor", "RelAccSensor", "RelAngleSensor",
            "RelSpeedSensor", "SpeedSensor", "TorqueSensor",
        ],
        "gearparts.sensors",
    ),
    **dict.fromkeys(
        [
            "Damper", "Disc", "Fixed", "Inertia", "InitializeFlange", "RelativeStates", "Spring", "SpringDamper",
            "TorsionalShaft",
        ],
        "gearparts.shafts",
    ),
    **dict.fromkeys(
        [
            "ConstantTorque", "EddyCurrentTorque", "InverseSpeedDependentTorque", "LinearSpeedDependentTorque",
            "QuadraticSpeedDependentTorque", "SignTorque", "Torque", "Torque2", "TorqueStep",
        ],
        "gearparts.sources",
    ),
    "StiffnessLaw": "gearparts.stiffness_laws",
    **dict.fromkeys(["StiffnessPattern", "cai_pair_stiffness", "cai_stiffness"], "gearparts.stiffness_patterns"),
    **dict.fromkeys(["Convection", "FixedTemperature", "HeatCapacitor", "ThermalConductor"], "gearparts.thermal"),
    **dict.fromkeys(["FixedAxisUnit", "XPTrain", "ZhouCui2022"], "gearparts.trains"),
    **dict.fromkeys(
        [
            "Force", "Mass", "QuadraticSpeedDependentForce", "TranslationalDamper", "TranslationalFixed",
            "TranslationalSpring", "TranslationalSpringDamper",
        ],
        "gearparts.translational",
    ),
    **dict.fromkeys(["PlanetPhasing", "check_assembly", "planet_phasing"], "gearparts.phasing"),
    **dict.fromkeys(["LossyPlanetary"], "gearparts.lossy_planetary"),
    **dict.fromkeys(["PXTrain", "XXTrain"], "gearparts.single_loop"),
    **dict.fromkeys(["DoublePinionPlanetary", "Ravigneaux", "Simpson"], "gearparts.gear_sets"),
    **dict.fromkeys(["CubicSpringDamper", "ElasticCoupling", "UniversalJoint"], "gearparts.couplings"),
    **dict.fromkeys(["palmgren_friction"], "gearparts.bearings"),
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name.startswith("_"):  # asked by Python itself: __path__, __wrapped__, ...
        raise AttributeError(f"module 'gearparts' has no attribute '{name}'")
    from gearlib.errors import nearest

    raise AttributeError(f"module 'gearparts' has no attribute '{name}'; {nearest(name, _HOME)}")


def __dir__() -> list[str]:
    return __all__
