"""gearlib: equation-based dynamics of gear trains.

All public names are here; modules are imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearlib.errors import GearlibError as GearlibError
    from gearlib.errors import GearlibWarning as GearlibWarning
    from gearlib.errors import InputWarning as InputWarning
    from gearlib.feedback.loop_plots import bode_plot as bode_plot
    from gearlib.feedback.loop_plots import nichols_plot as nichols_plot
    from gearlib.feedback.loop_plots import nyquist_plot as nyquist_plot
    from gearlib.feedback.loop_plots import root_locus_plot as root_locus_plot
    from gearlib.feedback.passivity import Passivity as Passivity
    from gearlib.feedback.passivity import passivity as passivity
    from gearlib.feedback.stability import StabilityReport as StabilityReport
    from gearlib.feedback.stability import stability as stability
    from gearlib.feedback.stability_sensitivity import StabilitySensitivity as StabilitySensitivity
    from gearlib.files.parameter_sets import load_parameters as load_parameters
    from gearlib.files.parameter_sets import save_parameters as save_parameters
    from gearlib.fitting.fit import fit as fit
    from gearlib.fitting.fit_result import Fit as Fit
    from gearlib.fitting.measured import MeasuredHistories as MeasuredHistories
    from gearlib.fitting.measured import MeasuredMargins as MeasuredMargins
    from gearlib.fitting.measured import MeasuredModes as MeasuredModes
    from gearlib.fitting.measured import MeasuredResponse as MeasuredResponse
    from gearlib.language.component import Component as Component
    from gearlib.language.component import Connection as Connection
    from gearlib.language.component import connect as connect
    from gearlib.language.cutting import cut as cut
    from gearlib.language.declarations import Connector as Connector
    from gearlib.language.declarations import Derivative as Derivative
    from gearlib.language.declarations import Discrete as Discrete
    from gearlib.language.declarations import Flow as Flow
    from gearlib.language.declarations import Input as Input
    from gearlib.language.declarations import Parameter as Parameter
    from gearlib.language.declarations import Potential as Potential
    from gearlib.language.declarations import Structural as Structural
    from gearlib.language.declarations import Variable as Variable
    from gearlib.language.declarations import offered as offered
    from gearlib.language.dimensions import check_units as check_units
    from gearlib.language.energy import Energy as Energy
    from gearlib.language.expressions import And as And
    from gearlib.language.expressions import Eq as Eq
    from gearlib.language.expressions import Max as Max
    from gearlib.language.expressions import Min as Min
    from gearlib.language.expressions import Not as Not
    from gearlib.language.expressions import Or as Or
    from gearlib.language.expressions import Piecewise as Piecewise
    from gearlib.language.expressions import When as When
    from gearlib.language.expressions import acos as acos
    from gearlib.language.expressions import asin as asin
    from gearlib.language.expressions import atan as atan
    from gearlib.language.expressions import atan2 as atan2
    from gearlib.language.expressions import cos as cos
    from gearlib.language.expressions import cosh as cosh
    from gearlib.language.expressions import der as der
    from gearlib.language.expressions import equals as equals
    from gearlib.language.expressions import exp as exp
    from gearlib.language.expressions import holds as holds
    from gearlib.language.expressions import initial as initial
    from gearlib.language.expressions import log as log
    from gearlib.language.expressions import no_event as no_event
    from gearlib.language.expressions import pi as pi
    from gearlib.language.expressions import pre as pre
    from gearlib.language.expressions import reinit as reinit
    from gearlib.language.expressions import sample as sample
    from gearlib.language.expressions import sign as sign
    from gearlib.language.expressions import sin as sin
    from gearlib.language.expressions import sinh as sinh
    from gearlib.language.expressions import sqrt as sqrt
    from gearlib.language.expressions import tan as tan
    from gearlib.language.expressions import tanh as tanh
    from gearlib.language.expressions import time as time
    from gearlib.language.sampled import Sampled as Sampled
    from gearlib.linear.frequency_response import FrequencyResponse as FrequencyResponse
    from gearlib.linear.frequency_response import frequency_response as frequency_response
    from gearlib.linear.frequency_response import transmission_error_response as transmission_error_response
    from gearlib.linear.steady_state import SteadyState as SteadyState
    from gearlib.linear.steady_state import steady_state as steady_state
    from gearlib.many_runs.analysing import sweep as sweep
    from gearlib.many_runs.runs import Runs as Runs
    from gearlib.many_runs.samples import grid as grid
    from gearlib.modelica.reading import read_modelica as read_modelica
    from gearlib.modelica.writing import to_modelica as to_modelica
    from gearlib.periodic.describing_function import PreloadedBacklash as PreloadedBacklash
    from gearlib.periodic.describing_function import backlash_describing_function as backlash_describing_function
    from gearlib.periodic.describing_function import equivalent_stiffness as equivalent_stiffness
    from gearlib.periodic.harmonic_balance import harmonic_balance as harmonic_balance
    from gearlib.periodic.harmonic_response import HarmonicBalance as HarmonicBalance
    from gearlib.periodic.order_analysis import OrderSpectrum as OrderSpectrum
    from gearlib.periodic.order_analysis import OrderWaterfall as OrderWaterfall
    from gearlib.periodic.order_analysis import order_spectrum as order_spectrum
    from gearlib.periodic.order_analysis import order_waterfall as order_waterfall
    from gearlib.run.energy.energy_balance import EnergyBalance as EnergyBalance
    from gearlib.run.methods.method import Method as Method
    from gearlib.run.methods.method_table import register_method as register_method
    from gearlib.run.result import Result as Result
    from gearlib.run.stepping.stepped_run import SteppedRun as SteppedRun
    from gearlib.solvers.drive.explicit_stepper import ExplicitStepper as ExplicitStepper
    from gearlib.solvers.inputs.table import Table as Table
    from gearlib.solvers.inputs.table import Table2D as Table2D
    from gearlib.statics.power_flow import PowerFlow as PowerFlow
    from gearlib.statics.statics import mobility as mobility
    from gearlib.statics.statics import power_flow as power_flow
    from gearlib.statics.statics import speed_ratio as speed_ratio
    from gearlib.stored_result import load_result as load_result
    from gearlib.system import System as System
    from gearlib.system import compile as compile
    from gearlib.system import simulate as simulate
    from gearlib.vibration.campbell import Campbell as Campbell
    from gearlib.vibration.campbell import campbell as campbell
    from gearlib.vibration.mode_sensitivity import ModeSensitivity as ModeSensitivity
    from gearlib.vibration.modes import Modes as Modes
    from gearlib.vibration.modes import modes as modes

__version__ = "0.1.0"

_HOME = {
    **dict.fromkeys(["Campbell", "campbell"], "gearlib.vibration.campbell"),
    **dict.fromkeys(
        ["PreloadedBacklash", "backlash_describing_function", "equivalent_stiffness"], "gearlib.periodic.describing_function"
    ),
    "harmonic_balance": "gearlib.periodic.harmonic_balance",
    "HarmonicBalance": "gearlib.periodic.harmonic_response",
    **dict.fromkeys(["Modes", "modes"], "gearlib.vibration.modes"),
    **dict.fromkeys(["OrderSpectrum", "OrderWaterfall", "order_spectrum", "order_waterfall"], "gearlib.periodic.order_analysis"),
    **dict.fromkeys(["bode_plot", "nichols_plot", "nyquist_plot", "root_locus_plot"], "gearlib.feedback.loop_plots"),
    **dict.fromkeys(["FrequencyResponse", "frequency_response", "transmission_error_response"], "gearlib.linear.frequency_response"),
    **dict.fromkeys(["Passivity", "passivity"], "gearlib.feedback.passivity"),
    **dict.fromkeys(["StabilityReport", "stability"], "gearlib.feedback.stability"),
    "fit": "gearlib.fitting.fit",
    "Fit": "gearlib.fitting.fit_result",
    **dict.fromkeys(
        ["MeasuredHistories", "MeasuredMargins", "MeasuredModes", "MeasuredResponse"], "gearlib.fitting.measured"
    ),
    "StabilitySensitivity": "gearlib.feedback.stability_sensitivity",
    "ModeSensitivity": "gearlib.vibration.mode_sensitivity",
    **dict.fromkeys(["SteadyState", "steady_state"], "gearlib.linear.steady_state"),
    "Runs": "gearlib.many_runs.runs",
    "sweep": "gearlib.many_runs.analysing",
    "grid": "gearlib.many_runs.samples",
    "PowerFlow": "gearlib.statics.power_flow",
    **dict.fromkeys(["mobility", "power_flow", "speed_ratio"], "gearlib.statics.statics"),
    **dict.fromkeys(["GearlibError", "GearlibWarning", "InputWarning"], "gearlib.errors"),
    **dict.fromkeys(["Component", "Connection", "connect"], "gearlib.language.component"),
    **dict.fromkeys(
        ["Connector", "Derivative", "Discrete", "Flow", "Input", "Parameter", "Potential", "Structural", "Variable", "offered"],
        "gearlib.language.declarations",
    ),
    **dict.fromkeys(
        [
            "And", "Eq", "Max", "Min", "Not", "Or", "Piecewise", "When", "acos", "asin", "atan", "atan2", "cos", "cosh", "der",
            "equals", "exp", "holds", "initial", "log", "no_event", "pi", "pre", "reinit", "sample", "sign", "sin", "sinh", "sqrt",
            "tan", "tanh", "time",
        ],
        "gearlib.language.expressions",
    ),
    "Energy": "gearlib.language.energy",
    "EnergyBalance": "gearlib.run.energy.energy_balance",
    "Sampled": "gearlib.language.sampled",
    "cut": "gearlib.language.cutting",
    "check_units": "gearlib.language.dimensions",
    "read_modelica": "gearlib.modelica.reading",
    "to_modelica": "gearlib.modelica.writing",
    "Result": "gearlib.run.result",
    "Method": "gearlib.run.methods.method",
    "register_method": "gearlib.run.methods.method_table",
    "ExplicitStepper": "gearlib.solvers.drive.explicit_stepper",
    **dict.fromkeys(["load_parameters", "save_parameters"], "gearlib.files.parameter_sets"),
    "load_result": "gearlib.stored_result",
    "SteppedRun": "gearlib.run.stepping.stepped_run",
    **dict.fromkeys(["Table", "Table2D"], "gearlib.solvers.inputs.table"),
    **dict.fromkeys(["System", "compile", "simulate"], "gearlib.system"),
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name.startswith("_"):  # looked up by Python itself: __path__, __wrapped__, ...
        raise AttributeError(f"module 'gearlib' has no attribute '{name}'")
    from gearlib.errors import nearest

    raise AttributeError(f"module 'gearlib' has no attribute '{name}'; {nearest(name, _HOME)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
