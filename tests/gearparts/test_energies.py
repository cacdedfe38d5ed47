"""The energies that components declare, against their equations: power in is what is stored, lost and supplied, wherever they hold.

No run is needed: random values are brought by least squares to where the equations and their derivatives hold, and the powers are
compared there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.equations.kernel import array_function
from gearlib.equations.template import piecewise
from gearlib.language.component import energies_of, equations_of
from gearlib.language.declarations import declared_by
from gearlib.language.expressions import real_symbol, total_derivative
from tests.gearparts.bench import needed_values, structural_choices
from tests.gearparts.laws import plain
from tests.gearparts.test_components import LEAVES

FLOW_OF = {"phi": "tau", "s": "f", "x": "f_x", "y": "f_y"}
MODES = (gp.BearingFriction, gp.Brake, gp.Clutch, gp.OneWayClutch)  # hold before and after an event: see test_friction
VARYING: list[dict[str, Any]] = [
    {"stiffness": "sinusoidal", "error_terms": ((1.0, 0.2, 0.4), (2.0, 0.1, 0.0))},
    {"stiffness": "rectangular", "contact_ratio": 1.6, "backlash": True},
    {"stiffness": "fourier", "stiffness_terms": ((1.0, 0.2, 0.3), (2.0, 0.1, -0.5)), "use_support": True},
    {"stiffness": "table", "stiffness_table": ((0.3, 0.8), (1.5, 1.1), (2.9, 1.3)), "error_table": ((0.0, 0.0), (1.0, 0.4), (3.0, -0.2))},
    {"friction": True, "use_heat_port": True},
]  # fmt: skip


def branches(expression: Any) -> Any:
    """An expression with no other functions of conditions than branches."""
    return piecewise(plain(expression))


class Powers:
    """Equations of a component and their derivatives, and its powers, as functions of the values of all symbols."""

    def __init__(self, part: gl.Component) -> None:
        declared, energies = declared_by(part), energies_of(part)
        assert energies is not None
        constants = frozenset({*declared.parameters, *declared.discretes})

        def rate(expression: Any) -> Any:
            return total_derivative(expression, constants)

        through, heat_in = sympy.S.Zero, sympy.S.Zero
        for name, connector in declared.connectors.items():
            for potential in FLOW_OF.keys() & connector.variables.keys():
                through += real_symbol(f"{name}.{FLOW_OF[potential]}") * rate(real_symbol(f"{name}.{potential}"))
            heat_in += real_symbol(f"{name}.Q_flow") if "T" in connector.variables else 0
        powers = [through, heat_in, rate(branches(energies.stored)), branches(energies.heat), branches(energies.supplied)]
        equations = [e for e in equations_of(part) if isinstance(e, gl.Eq)]
        modes = [e for e in equations if str(e.left) in declared.discretes]
        laws = [branches(e.residual) for e in equations if e not in modes]
        laws = [*(branches(e.residual) for e in modes), *laws, *map(rate, laws)]
        self.symbols = sorted(set().union(*(e.free_symbols for e in (*laws, *powers))), key=str)
        self.modes = [self.symbols.index(e.left) for e in modes]
        self.moving = np.array([s.name not in constants for s in self.symbols])
        self.laws, self.powers = array_function(self.symbols, *laws, 0 * through), array_function(self.symbols, *powers)

    def residual(self, x: Any) -> Any:
        """What is left of each equation, at one point or at several side by side."""
        return np.array([np.broadcast_to(law, x.shape[1:]) for law in self.laws(*x)], float)

    def at_a_point(self, rng: np.random.Generator) -> list[float]:
        """Mechanical power in, heat in, rate of what is stored, heat and supplied power where all equations hold."""
        x = np.where(self.moving, rng.uniform(-1.5, 1.5, len(self.symbols)), rng.uniform(0.5, 1.4, len(self.symbols)))
        steps = 1e-6 * np.eye(len(x))[:, self.moving]
        for _ in range(30):
            slopes = (self.residual(x[:, None] + steps) - self.residual(x[:, None] - steps)) / 2e-6
            x[self.moving] -= np.linalg.lstsq(slopes, self.residual(x), rcond=1e-9)[0]
            x[self.modes] -= self.residual(x)[: len(self.modes)]
            if np.abs(self.residual(x)).max() < 1e-12:
                return [float(power) for power in self.powers(*x)]
        raise AssertionError("the equations cannot hold")


def chosen(kind: Any) -> list[dict[str, Any]]:
    """The first and the last of a component's choices; of a mesh, those that make a difference to its energy."""
    choices = list(structural_choices(kind))
    if "stiffness" in kind._declarations:
        return VARYING if kind is gp.DetailedExternalMesh else [{}]
    return choices[:: max(1, len(choices) - 1)]


def made(kind: Any, choice: dict[str, Any]) -> gl.Component:
    part: gl.Component = kind(**{**needed_values(kind, 1.0), **choice})
    return part


AUDITED = [
    pytest.param(kind, choice, id="-".join([kind.__name__, *(k for k, v in choice.items() if v)]))
    for kind in LEAVES
    if kind not in MODES
    for choice in chosen(kind)
    if not energies_of(made(kind, choice)).source
]


@pytest.mark.parametrize(("kind", "choice"), AUDITED)
def test_power_into_its_connectors_is_stored_lost_or_supplied(kind: Any, choice: dict[str, Any]) -> None:
    powers, rng = Powers(made(kind, choice)), np.random.default_rng(3)
    for _ in range(6):
        through, heat_in, stored, heat, supplied = powers.at_a_point(rng)
        if kind in (gp.HeatCapacitor, gp.ThermalConductor, gp.Convection, gp.FixedTemperature):
            through, heat_in = heat_in, -heat  # nothing moves
        assert through == pytest.approx(stored + heat - supplied, abs=1e-9)
        assert heat_in == pytest.approx(-heat if choice.get("use_heat_port") else heat_in, abs=1e-12)
        assert heat > -1e-12 or kind is gp.FixedTemperature
