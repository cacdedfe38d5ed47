"""The component library of gearlib: shafts, gears, meshes, planetary sets, sources, sensors and complete trains.

All components are here; modules are imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearparts import blocks as blocks
    from gearparts.bond_graph import BondGraphPart as BondGraphPart
    from gearparts.bond_graph import from_bond_graph as from_bond_graph
    from gearparts.fmu import FMU as FMU
    from gearparts.gears.gear_pair import GearPair as GearPair
    from gearparts.gears.lossy import Gearbox as Gearbox
    from gearparts.gears.lossy import LossyGear as LossyGear
    from gearparts.gears.mesh_models import DetailedExternalMesh as DetailedExternalMesh
    from gearparts.gears.mesh_models import DetailedInternalMesh as DetailedInternalMesh
    from gearparts.gears.mesh_models import mesh_damping as mesh_damping
    from gearparts.gears.meshes import ExternalMesh as ExternalMesh
    from gearparts.gears.meshes import InternalMesh as InternalMesh
    from gearparts.gears.rigid_gears import IdealGear as IdealGear
    from gearparts.gears.rigid_gears import IdealGearR2T as IdealGearR2T
    from gearparts.gears.rigid_gears import IdealPlanetary as IdealPlanetary
    from gearparts.gears.rigid_gears import IdealRollingWheel as IdealRollingWheel
    from gearparts.gears.stiffness_laws import StiffnessLaw as StiffnessLaw
    from gearparts.gears.stiffness_patterns import StiffnessPattern as StiffnessPattern
    from gearparts.gears.stiffness_patterns import cai_pair_stiffness as cai_pair_stiffness
    from gearparts.gears.stiffness_patterns import cai_stiffness as cai_stiffness
    from gearparts.interfaces import Flange as Flange
    from gearparts.interfaces import HeatPort as HeatPort
    from gearparts.interfaces import TranslationalFlange as TranslationalFlange
    from gearparts.planetary.gear_sets import DoublePinionPlanetary as DoublePinionPlanetary
    from gearparts.planetary.gear_sets import Ravigneaux as Ravigneaux
    from gearparts.planetary.gear_sets import Simpson as Simpson
    from gearparts.planetary.lossy_planetary import LossyPlanetary as LossyPlanetary
    from gearparts.planetary.phasing import PlanetPhasing as PlanetPhasing
    from gearparts.planetary.phasing import check_assembly as check_assembly
    from gearparts.planetary.phasing import planet_phasing as planet_phasing
    from gearparts.planetary.phasing import planet_positions as planet_positions
    from gearparts.planetary.planar import PlanarBody as PlanarBody
    from gearparts.planetary.planar import PlanarFlange as PlanarFlange
    from gearparts.planetary.planar import PlanarMesh as PlanarMesh
    from gearparts.planetary.planar import PlanarPlanetaryUnit as PlanarPlanetaryUnit
    from gearparts.planetary.planar import PlanarShaft as PlanarShaft
    from gearparts.planetary.planar import PlanarSupport as PlanarSupport
    from gearparts.planetary.planar import PlanetBearing as PlanetBearing
    from gearparts.planetary.planetary_unit import IdealPlanetaryUnit as IdealPlanetaryUnit
    from gearparts.planetary.planetary_unit import LossyPlanetaryUnit as LossyPlanetaryUnit
    from gearparts.planetary.planetary_unit import LumpedPlanetaryUnit as LumpedPlanetaryUnit
    from gearparts.planetary.planetary_unit import Planet as Planet
    from gearparts.planetary.planetary_unit import PlanetaryUnit as PlanetaryUnit
    from gearparts.planetary.planetary_unit import PlanetOnCarrier as PlanetOnCarrier
    from gearparts.planetary.planetary_unit import TorsionalPlanetaryUnit as TorsionalPlanetaryUnit
    from gearparts.planetary.planetary_unit import TranslationalPlanetaryUnit as TranslationalPlanetaryUnit
    from gearparts.rotational.adaptors import AngleToTorqueAdaptor as AngleToTorqueAdaptor
    from gearparts.rotational.adaptors import TorqueToAngleAdaptor as TorqueToAngleAdaptor
    from gearparts.rotational.backlash import ElastoBacklash as ElastoBacklash
    from gearparts.rotational.backlash import ElastoBacklash2 as ElastoBacklash2
    from gearparts.rotational.bearings import palmgren_friction as palmgren_friction
    from gearparts.rotational.couplings import CubicSpringDamper as CubicSpringDamper
    from gearparts.rotational.couplings import ElasticCoupling as ElasticCoupling
    from gearparts.rotational.couplings import UniversalJoint as UniversalJoint
    from gearparts.rotational.friction import BearingFriction as BearingFriction
    from gearparts.rotational.friction import Brake as Brake
    from gearparts.rotational.friction import Clutch as Clutch
    from gearparts.rotational.friction import OneWayClutch as OneWayClutch
    from gearparts.rotational.motions import Accelerate as Accelerate
    from gearparts.rotational.motions import ConstantSpeed as ConstantSpeed
    from gearparts.rotational.motions import Move as Move
    from gearparts.rotational.motions import Position as Position
    from gearparts.rotational.motions import Speed as Speed
    from gearparts.rotational.sensors import AccSensor as AccSensor
    from gearparts.rotational.sensors import AngleSensor as AngleSensor
    from gearparts.rotational.sensors import MultiSensor as MultiSensor
    from gearparts.rotational.sensors import PowerSensor as PowerSensor
    from gearparts.rotational.sensors import RelAccSensor as RelAccSensor
    from gearparts.rotational.sensors import RelAngleSensor as RelAngleSensor
    from gearparts.rotational.sensors import RelSpeedSensor as RelSpeedSensor
    from gearparts.rotational.sensors import SpeedSensor as SpeedSensor
    from gearparts.rotational.sensors import TorqueSensor as TorqueSensor
    from gearparts.rotational.shafts import Damper as Damper
    from gearparts.rotational.shafts import Disc as Disc
    from gearparts.rotational.shafts import Fixed as Fixed
    from gearparts.rotational.shafts import Inertia as Inertia
    from gearparts.rotational.shafts import InitializeFlange as InitializeFlange
    from gearparts.rotational.shafts import RelativeStates as RelativeStates
    from gearparts.rotational.shafts import Spring as Spring
    from gearparts.rotational.shafts import SpringDamper as SpringDamper
    from gearparts.rotational.shafts import TorsionalShaft as TorsionalShaft
    from gearparts.rotational.sources import ConstantTorque as ConstantTorque
    from gearparts.rotational.sources import EddyCurrentTorque as EddyCurrentTorque
    from gearparts.rotational.sources import InverseSpeedDependentTorque as InverseSpeedDependentTorque
    from gearparts.rotational.sources import LinearSpeedDependentTorque as LinearSpeedDependentTorque
    from gearparts.rotational.sources import QuadraticSpeedDependentTorque as QuadraticSpeedDependentTorque
    from gearparts.rotational.sources import SignTorque as SignTorque
    from gearparts.rotational.sources import Torque as Torque
    from gearparts.rotational.sources import Torque2 as Torque2
    from gearparts.rotational.sources import TorqueStep as TorqueStep
    from gearparts.thermal import Convection as Convection
    from gearparts.thermal import FixedTemperature as FixedTemperature
    from gearparts.thermal import HeatCapacitor as HeatCapacitor
    from gearparts.thermal import ThermalConductor as ThermalConductor
    from gearparts.trains.single_loop import PXTrain as PXTrain
    from gearparts.trains.single_loop import XXTrain as XXTrain
    from gearparts.trains.xp_train import FixedAxisUnit as FixedAxisUnit
    from gearparts.trains.xp_train import XPTrain as XPTrain
    from gearparts.trains.xp_train import ZhouCui2022 as ZhouCui2022
    from gearparts.translational import Force as Force
    from gearparts.translational import Mass as Mass
    from gearparts.translational import QuadraticSpeedDependentForce as QuadraticSpeedDependentForce
    from gearparts.translational import TranslationalDamper as TranslationalDamper
    from gearparts.translational import TranslationalFixed as TranslationalFixed
    from gearparts.translational import TranslationalSpring as TranslationalSpring
    from gearparts.translational import TranslationalSpringDamper as TranslationalSpringDamper

_HOME = {
    **dict.fromkeys(["AngleToTorqueAdaptor", "TorqueToAngleAdaptor"], "gearparts.rotational.adaptors"),
    **dict.fromkeys(["ElastoBacklash", "ElastoBacklash2"], "gearparts.rotational.backlash"),
    **dict.fromkeys(["BondGraphPart", "from_bond_graph"], "gearparts.bond_graph"),
    **dict.fromkeys(["BearingFriction", "Brake", "Clutch", "OneWayClutch"], "gearparts.rotational.friction"),
    "FMU": "gearparts.fmu",
    "GearPair": "gearparts.gears.gear_pair",
    **dict.fromkeys(["IdealGear", "IdealGearR2T", "IdealPlanetary", "IdealRollingWheel"], "gearparts.gears.rigid_gears"),
    **dict.fromkeys(["Flange", "HeatPort", "TranslationalFlange"], "gearparts.interfaces"),
    **dict.fromkeys(["Gearbox", "LossyGear"], "gearparts.gears.lossy"),
    **dict.fromkeys(["DetailedExternalMesh", "DetailedInternalMesh", "mesh_damping"], "gearparts.gears.mesh_models"),
    **dict.fromkeys(["ExternalMesh", "InternalMesh"], "gearparts.gears.meshes"),
    **dict.fromkeys(["Accelerate", "ConstantSpeed", "Move", "Position", "Speed"], "gearparts.rotational.motions"),
    **dict.fromkeys(
        [
            "PlanarBody", "PlanarFlange", "PlanarMesh", "PlanarPlanetaryUnit", "PlanarShaft", "PlanarSupport",
            "PlanetBearing",
        ],
        "gearparts.planetary.planar",
    ),
    **dict.fromkeys(
        [
            "IdealPlanetaryUnit", "LossyPlanetaryUnit", "LumpedPlanetaryUnit", "Planet", "PlanetOnCarrier", "PlanetaryUnit",
            "TorsionalPlanetaryUnit", "TranslationalPlanetaryUnit",
        ],
        "gearparts.planetary.planetary_unit",
    ),
    **dict.fromkeys(
        [
            "AccSensor", "AngleSensor", "MultiSensor", "PowerSensor", "RelAccSensor", "RelAngleSensor",
            "RelSpeedSensor", "SpeedSensor", "TorqueSensor",
        ],
        "gearparts.rotational.sensors",
    ),
    **dict.fromkeys(
        [
            "Damper", "Disc", "Fixed", "Inertia", "InitializeFlange", "RelativeStates", "Spring", "SpringDamper",
            "TorsionalShaft",
        ],
        "gearparts.rotational.shafts",
    ),
    **dict.fromkeys(
        [
            "ConstantTorque", "EddyCurrentTorque", "InverseSpeedDependentTorque", "LinearSpeedDependentTorque",
            "QuadraticSpeedDependentTorque", "SignTorque", "Torque", "Torque2", "TorqueStep",
        ],
        "gearparts.rotational.sources",
    ),
    "StiffnessLaw": "gearparts.gears.stiffness_laws",
    **dict.fromkeys(["StiffnessPattern", "cai_pair_stiffness", "cai_stiffness"], "gearparts.gears.stiffness_patterns"),
    **dict.fromkeys(["Convection", "FixedTemperature", "HeatCapacitor", "ThermalConductor"], "gearparts.thermal"),
    **dict.fromkeys(["FixedAxisUnit", "XPTrain", "ZhouCui2022"], "gearparts.trains.xp_train"),
    **dict.fromkeys(
        [
            "Force", "Mass", "QuadraticSpeedDependentForce", "TranslationalDamper", "TranslationalFixed",
            "TranslationalSpring", "TranslationalSpringDamper",
        ],
        "gearparts.translational",
    ),
    **dict.fromkeys(["PlanetPhasing", "check_assembly", "planet_phasing", "planet_positions"], "gearparts.planetary.phasing"),
    **dict.fromkeys(["LossyPlanetary"], "gearparts.planetary.lossy_planetary"),
    **dict.fromkeys(["PXTrain", "XXTrain"], "gearparts.trains.single_loop"),
    **dict.fromkeys(["DoublePinionPlanetary", "Ravigneaux", "Simpson"], "gearparts.planetary.gear_sets"),
    **dict.fromkeys(["CubicSpringDamper", "ElasticCoupling", "UniversalJoint"], "gearparts.rotational.couplings"),
    **dict.fromkeys(["palmgren_friction"], "gearparts.rotational.bearings"),
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name == "blocks":  # signal blocks have a namespace of their own
        return importlib.import_module("gearparts.blocks")
    if name.startswith("_"):  # looked up by Python itself: __path__, __wrapped__, ...
        raise AttributeError(f"module 'gearparts' has no attribute '{name}'")
    from gearlib.errors import nearest

    raise AttributeError(f"module 'gearparts' has no attribute '{name}'; {nearest(name, _HOME)}")


def __dir__() -> list[str]:
    return __all__
