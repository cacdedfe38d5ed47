"""Counterparts of the Modelica Standard Library 4.1.0, for `gearlib.read_modelica` and `gearlib.to_modelica`."""

from __future__ import annotations

from typing import Any

from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearlib.modelica.counterparts import Counterpart, StandardLibrary, snake_case

SMOOTH: dict[str, Any] = {
    "values": {"smoothness": {"LinearSegments": "linear", "ConstantSegments": "constant", "ContinuousDerivative": "akima"}},
    "enumerations": {"smoothness": "Modelica.Blocks.Types.Smoothness"},
}  # fmt: skip
COMPLIANT: dict[str, Any] = {
    "nominals": {"phi_nominal": "phi_rel"}, "states": ("phi_rel", "w_rel"), "ignored": frozenset({"homotopyType"}),
}  # fmt: skip
SPELLINGS = (
    "useSupport", "useHeatPort", "heatPort", "lossPower", "lossTable", "stepTorque", "offsetTorque", "startTime", "deltaPhi",
    "TorqueDirection", "ForceDirection", "controllerType", "yMax", "yMin", "uMax", "uMin", "uHigh", "uLow", "samplePeriod",
    "delayTime",
    "startForward", "startBackward",
)  # fmt: skip
# how blocks begin: their states at their start values, the first of these; "InitialOutput" says the same where the output is a state
BY_STATE: dict[str, Any] = {"initType": ("InitialState", "NoInit", "DoNotUse_InitialIntegratorState")}
BY_OUTPUT: dict[str, Any] = {"initType": ("InitialOutput", "InitialState", "NoInit")}
NO_CHANGE = frozenset({"strict", "homotopyType", "limitsAtInit", "verboseExtrapolation", "significantDigits"})


def _same(package: str, module: str, *names: str, **options: Any) -> dict[str, Counterpart]:
    """Classes with the same names here and in a Modelica package."""
    return {f"Modelica.{package}.{name}": Counterpart(f"{module}:{name}", **options) for name in names}


def _named(package: str, module: str, **names: str) -> dict[str, Counterpart]:
    """Classes by their names in a Modelica package."""
    return {f"Modelica.{package}.{name}": Counterpart(f"{module}:{local}") for name, local in names.items()}


def _columns_after_time(columns: Any) -> tuple[int, ...]:
    """Column numbers of a table that count from the first one after the time; in Modelica the time is column 1."""
    return tuple(c - 1 for c in columns)


def _columns_with_time(columns: Any) -> tuple[int, ...]:
    """The inverse of `_columns_after_time`."""
    return tuple(c + 1 for c in columns)


def _one_for_all(offsets: Any) -> Any:
    """The offset of all columns; Modelica's is an array of one value for all, or one for each."""
    first, *others = offsets if isinstance(offsets, tuple) and offsets else (offsets,)
    if any(each != first for each in others):
        raise BindingError(f"the offsets of the columns differ: {shown(offsets)}; expected one for all")
    return first


def _of_one_axis(values: Any) -> Any:
    """The only element of an array with one for each axis."""
    if not isinstance(values, tuple) or len(values) != 1:
        raise BindingError(f"{shown(values)}: expected an array with one element, as in {{1}}, for one axis")
    return values[0]


_ROTATIONAL, _TRANSLATIONAL = "Mechanics.Rotational", "Mechanics.Translational"
_SHAFTS, _INTERFACES = "gearparts.rotational.shafts", "gearparts.interfaces"
_SOURCES, _MOTIONS = "gearparts.rotational.sources", "gearparts.rotational.motions"

_CONNECTORS_AND_BASES = {
    **_named(f"{_ROTATIONAL}.Interfaces", _INTERFACES, Flange="Flange", Flange_a="Flange", Flange_b="Flange", Support="Flange"),
    **_named(
        f"{_TRANSLATIONAL}.Interfaces", _INTERFACES, Flange="TranslationalFlange", Flange_a="TranslationalFlange",
        Flange_b="TranslationalFlange", Support="TranslationalFlange",
    ),
    **_named("Thermal.HeatTransfer.Interfaces", _INTERFACES, HeatPort="HeatPort", HeatPort_a="HeatPort", HeatPort_b="HeatPort"),
    **_named(
        f"{_ROTATIONAL}.Interfaces", _INTERFACES, PartialTwoFlanges="TwoFlanges", PartialTwoFlangesAndSupport="TwoFlangesAndSupport",
        PartialElementaryTwoFlangesAndSupport2="TwoFlangesAndSupport", PartialCompliant="Compliant",
        PartialCompliantWithRelativeStates="Compliant", PartialOneFlangeAndSupport="OneFlange",
        PartialElementaryOneFlangeAndSupport2="OneFlange",
    ),
    **_named(f"{_TRANSLATIONAL}.Interfaces", "gearparts.translational", PartialTwoFlanges="TwoTranslationalFlanges"),
    **_named(
        "Blocks.Interfaces", "gearparts.blocks.interfaces", SO="SO", SISO="SISO", SI2SO="SI2SO", SignalSource="SignalSource",
    ),
}  # fmt: skip

_ROTATIONAL_PARTS = {
    **_same(f"{_ROTATIONAL}.Components", _SHAFTS, "Fixed", "Disc"),
    **_same(
        f"{_ROTATIONAL}.Components", _SHAFTS, "RelativeStates", nominals={"phi_nominal": "phi_rel"}, states=("phi_rel", "w_rel"),
    ),
    **_same(f"{_ROTATIONAL}.Components", _SHAFTS, "Inertia", states=("phi", "w")),
    **_same(f"{_ROTATIONAL}.Components", _SHAFTS, "Spring", "Damper", "SpringDamper", **COMPLIANT),
    **_same(f"{_ROTATIONAL}.Components", _SHAFTS, "InitializeFlange", ignored=frozenset({"stateSelect"})),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.rotational.backlash", "ElastoBacklash", "ElastoBacklash2", **COMPLIANT),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.rotational.friction", "BearingFriction", "Brake", **SMOOTH),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.rotational.friction", "Clutch", "OneWayClutch", **SMOOTH, **COMPLIANT),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.gears.rigid_gears", "IdealGear", "IdealPlanetary"),
    **_same(
        f"{_ROTATIONAL}.Components", "gearparts.gears.rigid_gears", "IdealGearR2T", "IdealRollingWheel",
        names={"flangeR": "flange_r", "flangeT": "flange_t", "supportR": "support_r", "supportT": "support_t",
               "useSupportR": "use_support_r", "useSupportT": "use_support_t"},
    ),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.gears.lossy", "LossyGear", "Gearbox", **SMOOTH),
    **_same(f"{_ROTATIONAL}.Components", "gearparts.rotational.adaptors", "TorqueToAngleAdaptor"),
    **_same(
        f"{_ROTATIONAL}.Components", "gearparts.rotational.adaptors", "AngleToTorqueAdaptor",
        names={"phi": "phi_ref", "w": "w_ref", "a": "a_ref"}, own=frozenset({"k"}),
    ),
    **_same(
        f"{_ROTATIONAL}.Sources", _SOURCES, "Torque", "Torque2", "ConstantTorque", "TorqueStep", "LinearSpeedDependentTorque",
        "QuadraticSpeedDependentTorque", "InverseSpeedDependentTorque",
    ),
    **_same(
        f"{_ROTATIONAL}.Sources", _SOURCES, "SignTorque",
        values={"reg": {"Exp": "exp", "Sine": "sine", "Linear": "linear", "CoSine": "cosine"}},
        enumerations={"reg": "Modelica.Blocks.Types.Regularization"},
    ),
    **_same(
        f"{_ROTATIONAL}.Sources", _SOURCES, "EddyCurrentTorque",
        names={"TRef": "T_ref", "constantExcitation": "excitation"}, ignored=frozenset({"useExcitationInput"}),
        own=frozenset({"T", "excitation"}),
    ),
    **_same(f"{_ROTATIONAL}.Sources", _MOTIONS, "Position", "Speed", "Accelerate", "ConstantSpeed", states=("phi", "w")),
    **_same(
        f"{_ROTATIONAL}.Sources", _MOTIONS, "Move", arrays={"u": ("phi_ref", "w_ref", "a_ref")}, states=("phi", "w"), own=frozenset({"k"}),
    ),
    **_same(
        f"{_ROTATIONAL}.Sensors", "gearparts.rotational.sensors", "AngleSensor", "SpeedSensor", "AccSensor", "RelAngleSensor",
        "RelSpeedSensor", "RelAccSensor", "TorqueSensor", "PowerSensor", "MultiSensor",
    ),
}  # fmt: skip

_TRANSLATIONAL_AND_THERMAL = {
    **_same(f"{_TRANSLATIONAL}.Components", "gearparts.translational", "Mass", states=("s", "v")),
    **_named(
        f"{_TRANSLATIONAL}.Components", "gearparts.translational", Fixed="TranslationalFixed", Spring="TranslationalSpring",
        Damper="TranslationalDamper", SpringDamper="TranslationalSpringDamper",
    ),
    **_same(f"{_TRANSLATIONAL}.Components", "gearparts.gears.rigid_gears", "IdealGearR2T", "IdealRollingWheel"),
    **_same(f"{_TRANSLATIONAL}.Sources", "gearparts.translational", "Force", "QuadraticSpeedDependentForce"),
    **_same("Thermal.HeatTransfer.Components", "gearparts.thermal", "HeatCapacitor", "ThermalConductor", "Convection"),
    **_same("Thermal.HeatTransfer.Sources", "gearparts.thermal", "FixedTemperature"),
}  # fmt: skip

_CONTINUOUS, _DISCRETE, _NONLINEAR = "gearparts.blocks.continuous", "gearparts.blocks.discrete", "gearparts.blocks.nonlinear"
_LIMITS = {"uMax": "y_max", "uMin": "y_min"}
_HELD = frozenset({"held", "taken", "now"})  # whose start values Modelica's sampled blocks do not have
_BLOCKS = {
    **_same("Blocks.Math", _CONTINUOUS, "Gain", "Add", "Add3", "Feedback", "Product"),
    **_same("Blocks.Continuous", _CONTINUOUS, "Integrator", "FirstOrder", starts={"y_start": "y"}, only=BY_OUTPUT),
    **_same("Blocks.Continuous", _CONTINUOUS, "SecondOrder", starts={"y_start": "y", "yd_start": "yd"}, only=BY_OUTPUT),
    **_same("Blocks.Continuous", _CONTINUOUS, "Derivative", "PI", starts={"x_start": "x"}, only=BY_STATE),
    **_same("Blocks.Continuous", _CONTINUOUS, "PID", starts={"xi_start": "x_I", "xd_start": "x_D"}, only=BY_STATE),
    **_same(
        "Blocks.Continuous", _CONTINUOUS, "LimPID", starts={"xi_start": "x_I", "xd_start": "x_D"},
        values={"controllerType": {kind: kind for kind in ("P", "PI", "PD", "PID")}},
        enumerations={"controllerType": "Modelica.Blocks.Types.SimpleController"}, own=frozenset({"room"}),
        ignored=NO_CHANGE, only=BY_STATE,
    ),
    **_same("Blocks.Continuous", "gearparts.blocks.transfer", "TransferFunction", only=BY_STATE),
    "Modelica.Blocks.Continuous.StateSpace": Counterpart(
        "gearparts.blocks.transfer:MultiStateSpace", only=BY_STATE,
        arrays={"u": "inputs.u", "y": "outputs.y", "x": "x.y"},
    ),
    **_same("Blocks.Nonlinear", _NONLINEAR, "Limiter", names=_LIMITS, ignored=NO_CHANGE),
    **_same("Blocks.Nonlinear", "gearparts.blocks.delays", "FixedDelay", own=frozenset({"past", "now", "age", "total"})),
    **_same(
        "Blocks.Nonlinear", "gearparts.blocks.delays", "PadeDelay", ignored=frozenset({"balance"}), own=frozenset({"settled"}),
    ),
    **_same("Blocks.Nonlinear", _NONLINEAR, "DeadZone", ignored=frozenset({"deadZoneAtInit"})),
    "Modelica.Blocks.Nonlinear.SlewRateLimiter": Counterpart(
        f"{_NONLINEAR}:RateLimiter", names={"Rising": "rising", "Falling": "falling"}, starts={"y_start": "y"},
        ignored=NO_CHANGE, only=BY_OUTPUT,
    ),
    **_same("Blocks.Logical", _NONLINEAR, "Hysteresis", truths=frozenset({"y"}), own=frozenset({"on"})),
    **_same("Blocks.Logical", _NONLINEAR, "Switch", truths=frozenset({"u2"})),
    **_same("Blocks.Logical", _NONLINEAR, "LogicalSwitch", truths=frozenset({"u1", "u2", "u3", "y"})),
    **_same("Blocks.Discrete", _DISCRETE, "Sampler", "ZeroOrderHold", "UnitDelay", own=_HELD),
    **_same("Blocks.Discrete", _DISCRETE, "TriggeredSampler", truths=frozenset({"trigger"}), own=_HELD),
    **_same("Blocks.Sources", "gearparts.blocks.sources", "Constant", "Step", "Ramp"),
    **_same("Blocks.Sources", "gearparts.blocks.sources", "Sine", names={"freqHz": "f", "f": "f"}),  # before 4.0, and since
    **_same("Blocks.Sources", "gearparts.blocks.sources", "Pulse", "Trapezoid", names={"nperiod": "n_period"}),
    **_same(
        "Blocks.Sources", "gearparts.blocks.sources", "KinematicPTP", arrays={"y": ("y",)},
        converted=dict.fromkeys(("deltaq", "qd_max", "qdd_max"), (_of_one_axis, lambda value: (value,))),
    ),
    **_same("Blocks.Sources", "gearparts.blocks.sources", "RealExpression", given={"y": "expression"}),
    **_same(
        "Blocks.Sources", "gearparts.blocks.sources", "BooleanExpression", given={"y": "expression"}, truths=frozenset({"expression", "y"}),
    ),
    "Modelica.Blocks.Sources.IntegerExpression": Counterpart("gearparts.blocks.sources:RealExpression", given={"y": "expression"}),
    **_same(
        "Blocks.Sources", "gearparts.blocks.time_tables", "CombiTimeTable",
        values={
            "smoothness": {"LinearSegments": "linear", "ConstantSegments": "constant", "ContinuousDerivative": "akima"},
            "extrapolation": {"LastTwoPoints": "lines", "HoldLastPoint": "hold", "Periodic": "periodic"},
        },
        enumerations={"smoothness": "Modelica.Blocks.Types.Smoothness", "extrapolation": "Modelica.Blocks.Types.Extrapolation"},
        ignored=frozenset({"verboseRead", "verboseExtrapolation", "timeEvents", "tableName", "fileName", "delimiter", "nHeaderLines"}),
        only={"tableOnFile": (False,), "timeScale": (1,)},
        converted={"columns": (_columns_after_time, _columns_with_time), "offset": (_one_for_all, lambda value: (value,))},
        arrays={"y": "outputs.y"},
    ),
}  # fmt: skip

STANDARD_LIBRARY = StandardLibrary(
    {**_CONNECTORS_AND_BASES, **_ROTATIONAL_PARTS, **_TRANSLATIONAL_AND_THERMAL, **_BLOCKS},
    {snake_case(name): name for name in SPELLINGS},
)
