"""A run that fails names the variable, the component and the expression."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import SolverError

METHODS = ["rk5", "rk8", "ida"]


class Root(gl.Component):
    """Falls below zero, where the root has no value."""

    x = gl.Variable("1", "falls", start=1.0)
    y = gl.Variable("1", "its root")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.y - 0.5), gl.Eq(self.y, gl.sqrt(self.x))]


class Logarithm(gl.Component):
    """Falls to where the logarithm has no value."""

    x = gl.Variable("1", "falls", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), gl.log(self.x - 0.5) - 1)]


class Escape(gl.Component):
    """Goes to infinity at one second."""

    x = gl.Variable("1", "grows", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.x**2)]


class Train(gl.Component):
    """Two parts, one of which is at fault."""

    def assemble(self) -> list[Any]:
        self.good, self.bad = Escape(), Root()
        return []


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("model", "end", "words"),
    [
        (Root(), 2.0, r"y is nan there, from Root: y = sqrt\(x\), with x = -"),
        (Logarithm(), 2.0, r"der\(x\) is nan there, from Logarithm: der\(x\) = log\(x - 0\.5\) - 1, with x = 0\.5"),
        (Train(), 0.95, r"bad\.y is nan there, from bad: Root: y = sqrt\(x\), with bad\.x = -"),
        (Escape(), 2.0, r"fastest of all goes x = .*, with der\(x\) = .* from Escape: der\(x\) = x\*\*2"),
    ],
)
def test_variable_component_and_expression_are_named(model: Any, end: float, words: str, method: str) -> None:
    with pytest.raises(SolverError, match=words):
        gl.simulate(model, end, samples=5, method=method)
