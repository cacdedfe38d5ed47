"""Bond graphs: elements, causality and explicit state equations; independent of the other phases."""

from gearlib.bondgraph.causality import Causality, assign_causality
from gearlib.bondgraph.draw import draw
from gearlib.bondgraph.efforts_and_flows import rate_of
from gearlib.bondgraph.elements import GY, TF, C, I, MSe, MSf, One, R, Se, Sf, Zero, energy_symbol, time
from gearlib.bondgraph.equations import StateEquations, state_equations
from gearlib.bondgraph.graph import Bond, BondGraph
from gearlib.bondgraph.runtime import RunTime

__all__ = [
    "GY", "TF", "Bond", "BondGraph", "C", "Causality", "I", "MSe", "MSf", "One", "R", "RunTime", "Se", "Sf", "StateEquations",
    "Zero", "assign_causality", "draw", "energy_symbol", "rate_of", "state_equations", "time",
]  # fmt: skip
