"""`Delayed`: a signal as it was some time ago; the driver of a run keeps its history."""

from __future__ import annotations

from gearlib.language.component import Component
from gearlib.language.declarations import Input, Parameter, Variable
from gearlib.language.energy import Energy
from gearlib.language.expressions import Eq, der

SHORTEST = 1e-9  # s; a run is divided into pieces no longer than its shortest delay


class Delayed(Component):
    """Base of delays: ``y(t) = u(t - delay_time)``, and ``y = u`` at the start of the run before there is anything older."""

    u = Input("any", "input signal")
    y = Variable("any", "the input, delay_time ago")
    delay_time = Parameter("s", "delay", min=SHORTEST)
    age = Variable("s", "how old the output is")
    now = Variable("any", "the input")
    total = Variable("any", "integral of the input: with it a run finds the input's jumps as events", start=0.0)
    past = Input("any", "the input as it was; the run gives it")

    def equations(self) -> list[Eq]:
        return [Eq(self.y, self.past), Eq(self.now, self.u), Eq(der(self.total), self.u), Eq(self.age, self.delay_time)]

    def energies(self) -> Energy:
        return Energy()
