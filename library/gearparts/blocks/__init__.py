"""Signal blocks named as in Modelica.Blocks: sources, filters, controllers, limiters, logic, sampled blocks.

Signals are connected like ports: ``gl.connect(self.controller.y, self.motor.tau)``. Blocks accept signals of any unit.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearparts.blocks.continuous import PI as PI
    from gearparts.blocks.continuous import PID as PID
    from gearparts.blocks.continuous import Add as Add
    from gearparts.blocks.continuous import Add3 as Add3
    from gearparts.blocks.continuous import Derivative as Derivative
    from gearparts.blocks.continuous import Feedback as Feedback
    from gearparts.blocks.continuous import FirstOrder as FirstOrder
    from gearparts.blocks.continuous import Gain as Gain
    from gearparts.blocks.continuous import Integrator as Integrator
    from gearparts.blocks.continuous import LimPID as LimPID
    from gearparts.blocks.continuous import Product as Product
    from gearparts.blocks.continuous import SecondOrder as SecondOrder
    from gearparts.blocks.delays import FixedDelay as FixedDelay
    from gearparts.blocks.delays import PadeDelay as PadeDelay
    from gearparts.blocks.discrete import DiscretePID as DiscretePID
    from gearparts.blocks.discrete import Sampler as Sampler
    from gearparts.blocks.discrete import TriggeredSampler as TriggeredSampler
    from gearparts.blocks.discrete import UnitDelay as UnitDelay
    from gearparts.blocks.discrete import ZeroOrderHold as ZeroOrderHold
    from gearparts.blocks.nonlinear import DeadZone as DeadZone
    from gearparts.blocks.nonlinear import Hysteresis as Hysteresis
    from gearparts.blocks.nonlinear import Limiter as Limiter
    from gearparts.blocks.nonlinear import LogicalSwitch as LogicalSwitch
    from gearparts.blocks.nonlinear import RateLimiter as RateLimiter
    from gearparts.blocks.nonlinear import Switch as Switch
    from gearparts.blocks.sources import BooleanExpression as BooleanExpression
    from gearparts.blocks.sources import Chirp as Chirp
    from gearparts.blocks.sources import Constant as Constant
    from gearparts.blocks.sources import KinematicPTP as KinematicPTP
    from gearparts.blocks.sources import Pulse as Pulse
    from gearparts.blocks.sources import Ramp as Ramp
    from gearparts.blocks.sources import RealExpression as RealExpression
    from gearparts.blocks.sources import Sine as Sine
    from gearparts.blocks.sources import Step as Step
    from gearparts.blocks.sources import Trapezoid as Trapezoid
    from gearparts.blocks.time_tables import CombiTimeTable as CombiTimeTable
    from gearparts.blocks.transfer import MultiStateSpace as MultiStateSpace
    from gearparts.blocks.transfer import StateSpace as StateSpace
    from gearparts.blocks.transfer import TransferFunction as TransferFunction

_HOME = {
    **dict.fromkeys(
        [
            "PI", "PID", "Add", "Add3", "Derivative", "Feedback", "FirstOrder", "Gain", "Integrator", "LimPID", "Product",
            "SecondOrder",
        ],
        "gearparts.blocks.continuous",
    ),
    **dict.fromkeys(["DiscretePID", "Sampler", "TriggeredSampler", "UnitDelay", "ZeroOrderHold"], "gearparts.blocks.discrete"),
    **dict.fromkeys(
        ["DeadZone", "Hysteresis", "Limiter", "LogicalSwitch", "RateLimiter", "Switch"], "gearparts.blocks.nonlinear"
    ),
    **dict.fromkeys(
        [
            "BooleanExpression", "Chirp", "Constant", "KinematicPTP", "Pulse", "Ramp", "RealExpression", "Sine", "Step", "Trapezoid",
        ],
        "gearparts.blocks.sources",
    ),
    "CombiTimeTable": "gearparts.blocks.time_tables",
    **dict.fromkeys(["FixedDelay", "PadeDelay"], "gearparts.blocks.delays"),
    **dict.fromkeys(["MultiStateSpace", "StateSpace", "TransferFunction"], "gearparts.blocks.transfer"),
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name.startswith("_"):  # looked up by Python itself: __path__, __wrapped__, ...
        raise AttributeError(f"module 'gearparts.blocks' has no attribute '{name}'")
    from gearlib.errors import nearest

    raise AttributeError(f"module 'gearparts.blocks' has no attribute '{name}'; {nearest(name, _HOME)}")


def __dir__() -> list[str]:
    return __all__
