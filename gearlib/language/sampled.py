"""`Sampled`: a Python function as a sampled-data controller, called at exact instants during a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy

from gearlib.arguments import real, shown
from gearlib.errors import BindingError
from gearlib.language.component import Component
from gearlib.language.declarations import Input, Variable
from gearlib.language.energy import Energy
from gearlib.language.expressions import Eq


class Taken(Component):
    """A signal that a sampled controller reads: ``y = u``."""

    u = Input("any", "signal that is read")
    y = Variable("any", "the signal")

    def equations(self) -> list[Eq]:
        return [Eq(self.y, self.u)]

    def energies(self) -> Energy:
        return Energy()


class Held(Component):
    """A signal set by a sampled controller, held between its instants: ``y = u``."""

    u = Input("any", "what the function returned at the last instant")
    y = Variable("any", "the signal")

    def equations(self) -> list[Eq]:
        return [Eq(self.y, self.u)]

    def energies(self) -> Energy:
        return Energy()


class Sampled(Component):
    """A Python function that samples signals at ``offset + k * period`` and sets signals held in between (zero-order hold).

    The run stops exactly at each instant, calls ``function(t, values)`` with the time (s) and an array of the sampled signals, and
    continues with the return value: one number per output. Before the first instant the outputs are 0. The function may be stateful; it
    is called once per instant of a run, in order. Controllers that share an instant are called in the order in which they were made,
    and none of them sees what another sets there. A sampled block (`gl.sample`) that acts at the instant comes first where the function
    reads it, and takes the new outputs where it reads these.

    Parameters
    ----------
    function : callable
    period, offset : float
        s.
    inputs : sequence of signals
        Variables of parts, such as ``self.load.w``, in the scope of the component that makes the controller.
    outputs : sequence of signals
        Inputs of parts to drive, such as ``self.torque.tau``.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Governed(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
    ...         self.governor = gl.Sampled(
    ...             lambda t, values: 10.0 * (3.0 - values[0]), 0.1, inputs=[self.load.w], outputs=[self.torque.tau])
    ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
    >>> result = gl.simulate(Governed(), t_end=0.2, samples=3)
    >>> result["load.w"]
    array([0.  , 1.5 , 2.25])
    >>> result["torque.tau"]
    array([30. , 15. ,  7.5])
    """

    def __init__(
        self, function: Callable[[float, Any], Any], period: float, inputs: Sequence[Any] = (), outputs: Sequence[Any] = (),
        offset: float = 0.0,
    ) -> None:  # fmt: skip
        super().__init__()
        if not callable(function):
            raise BindingError(
                f"Sampled: function is {shown(function)}; expected a function of the time and an array of values"
            )
        if not real("Sampled: period", period, "a positive number of seconds") > 0.0:
            raise BindingError(f"Sampled: period is {shown(period)}; expected a positive number of seconds")
        for name, signals in (("inputs", inputs), ("outputs", outputs)):
            given = signals if isinstance(signals, (list, tuple)) else (None,)
            if not all(isinstance(signal, sympy.Symbol) for signal in given):
                raise BindingError(f"Sampled: {name} is {shown(signals)}; expected a list of signals, such as [self.load.w]")
        if not outputs:
            raise BindingError("Sampled: outputs is empty; expected the inputs that it drives, such as [self.torque.tau]")
        self.function, self.period, self.offset = function, float(period), real("Sampled: offset", offset)
        self.counts = len(inputs), len(outputs)
        read = ((signal, f"inputs[{k}].u") for k, signal in enumerate(inputs))
        self._joined = (*read, *((signal, f"outputs[{k}].y") for k, signal in enumerate(outputs)))

    def assemble(self) -> list[Any]:
        self.inputs = [Taken() for _ in range(self.counts[0])]
        self.outputs = [Held() for _ in range(self.counts[1])]
        return []
