"""Modelica's named quantities, constants and unit conversions: units, numbers, factors."""

from __future__ import annotations

import math

from gearlib.errors import DeclarationError
from gearlib.language.units import dimension

UNIT_OF = {  # Modelica.Units.SI (before 4.0: Modelica.SIunits), quantities of mechanics, heat and electricity
    "Angle": "rad", "AngularVelocity": "rad/s", "AngularAcceleration": "rad/s2", "AngularJerk": "rad/s3", "SolidAngle": "1",
    "Length": "m", "PathLength": "m", "Position": "m", "Distance": "m", "Breadth": "m", "Height": "m", "Thickness": "m",
    "Radius": "m", "Diameter": "m", "Area": "m2", "Volume": "m3", "Time": "s", "Duration": "s", "Period": "s", "Velocity": "m/s",
    "Speed": "m/s", "Acceleration": "m/s2", "Jerk": "m/s3", "Frequency": "Hz", "AngularFrequency": "rad/s",
    "DampingCoefficient": "1/s", "Mass": "kg", "Density": "kg/m3", "LinearDensity": "kg/m", "Momentum": "kg.m/s",
    "MomentOfInertia": "kg.m2", "Inertia": "kg.m2", "Force": "N", "Weight": "N", "Torque": "N.m", "MomentOfForce": "N.m",
    "Impulse": "N.s", "AngularMomentum": "kg.m2/s", "AngularImpulse": "N.m.s", "Pressure": "Pa", "Stress": "Pa",
    "NormalStress": "Pa", "ModulusOfElasticity": "Pa", "DynamicViscosity": "Pa.s", "KinematicViscosity": "m2/s",
    "SurfaceTension": "N/m", "Work": "J", "Energy": "J", "PotentialEnergy": "J", "KineticEnergy": "J", "Power": "W",
    "EnergyFlowRate": "W", "Efficiency": "1", "MassFlowRate": "kg/s", "VolumeFlowRate": "m3/s",
    "RotationalSpringConstant": "N.m/rad", "TranslationalSpringConstant": "N/m", "RotationalDampingConstant": "N.m.s/rad",
    "TranslationalDampingConstant": "N.s/m", "CoefficientOfFriction": "1", "FrictionCoefficient": "1",
    "Temperature": "K", "ThermodynamicTemperature": "K", "TemperatureDifference": "K", "TemperatureSlope": "K/s",
    "LinearTemperatureCoefficient": "1/K", "Heat": "J", "HeatFlowRate": "W", "HeatCapacity": "J/K",
    "SpecificHeatCapacity": "J/(kg.K)", "ThermalConductance": "W/K", "ThermalResistance": "K/W",
    "CoefficientOfHeatTransfer": "W/(m2.K)", "ThermalConductivity": "W/(m.K)", "Current": "A", "ElectricCurrent": "A",
    "Voltage": "V", "ElectricPotential": "V", "Resistance": "Ohm", "Inductance": "H", "Capacitance": "F", "ElectricCharge": "C",
    "MagneticFlux": "Wb", "ElectricalTorqueConstant": "N.m/A", "DimensionlessRatio": "1", "PerUnit": "1",
}  # fmt: skip

CONSTANTS = {  # Modelica.Constants
    "pi": math.pi, "e": math.e, "D2R": math.pi / 180, "R2D": 180 / math.pi, "gamma": 0.57721566490153286061, "eps": 1e-15,
    "small": 1e-60, "inf": 1e60, "g_n": 9.80665, "G": 6.67430e-11, "c": 299792458.0, "k": 1.380649e-23, "R": 8.314462618,
    "sigma": 5.670374419e-8, "N_A": 6.02214076e23, "T_zero": -273.15,
}  # fmt: skip

CONVERSIONS = {  # Modelica.Units.Conversions (before 4.0: Modelica.SIunits.Conversions): factor and offset
    "from_deg": (math.pi / 180, 0.0), "to_deg": (180 / math.pi, 0.0), "from_rpm": (math.pi / 30, 0.0),
    "to_rpm": (30 / math.pi, 0.0), "from_degC": (1.0, 273.15), "to_degC": (1.0, -273.15), "from_kmh": (1 / 3.6, 0.0),
    "to_kmh": (3.6, 0.0), "from_day": (86400.0, 0.0), "from_hour": (3600.0, 0.0), "from_minute": (60.0, 0.0),
    "from_litre": (1e-3, 0.0), "from_kWh": (3.6e6, 0.0), "from_bar": (1e5, 0.0), "from_gps": (1e-3, 0.0), "to_hour": (1 / 3600, 0.0),
}  # fmt: skip

_PLACES = ("Modelica.Units.SI.", "Modelica.SIunits.")


def unit_named(path: str) -> str | None:
    """Unit of a quantity type by its full name, None if it is not one.

    >>> unit_named("Modelica.Units.SI.Torque")
    'N.m'
    """
    for place in _PLACES:
        if path.startswith(place):
            return UNIT_OF.get(path.removeprefix(place))
    return None


def constant_named(path: str) -> float | None:
    """A constant of Modelica.Constants by its full name."""
    return CONSTANTS.get(path.removeprefix("Modelica.Constants.")) if path.startswith("Modelica.Constants.") else None


def conversion_named(path: str) -> tuple[float, float] | None:
    """Factor and offset of a unit conversion by its full name."""
    for place in ("Modelica.Units.Conversions.", "Modelica.SIunits.Conversions."):
        if path.startswith(place):
            return CONVERSIONS.get(path.removeprefix(place))
    return None


def unit_written(text: str) -> str | None:
    """Convert a unit from Modelica's notation to that of declarations; None if it is unknown or not SI.

    >>> unit_written("N.m.s/rad"), unit_written("kg.m2"), unit_written("km/h")
    ('N.m.s/rad', 'kg.m2', None)
    """
    text = text or "any"
    try:
        dimension(text)
    except DeclarationError:
        return None
    return text
