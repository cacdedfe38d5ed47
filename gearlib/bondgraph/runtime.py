"""Numerical state equations of a bond graph: right-hand side, linear model, efforts and flows of all bonds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import sympy as sp

from gearlib.arguments import by_name, is_real, real, reals, shown
from gearlib.bondgraph.efforts_and_flows import rate_of
from gearlib.bondgraph.elements import time
from gearlib.bondgraph.equations import StateEquations
from gearlib.errors import ArgumentError, BindingError, BoundError, SingularError, SolverError, nearest

__all__ = ["RunTime"]

Array: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"
Values: TypeAlias = "Mapping[str, float] | Sequence[float] | Array"
Input: TypeAlias = "float | Callable[[float], float] | sp.Expr"

NEWTON_STEPS = 50  # a solution near the guess takes five or six
NEWTON_ACCURACY = 1e-13  # relative, some 450 unit roundoffs


@dataclass(frozen=True, eq=False)
class RunTime:
    """Numerical form of state equations, generated once; states, inputs and parameters are arguments of each call.

    Parameters
    ----------
    equations : StateEquations
        Result of :func:`~gearlib.bondgraph.state_equations`.

    Examples
    --------
    >>> from gearlib.bondgraph import BondGraph, C, I, One, RunTime, Se, state_equations
    >>> v = One("v")
    >>> run = RunTime(state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, C()))))
    >>> run.rhs(0.0, [4.0, 1.0], u=[7.0], parameters={"I_2": 2.0, "C_3": 0.5}).tolist()
    [5.0, 2.0]
    """

    equations: StateEquations

    def __post_init__(self) -> None:
        if not isinstance(self.equations, StateEquations):
            raise ArgumentError(f"equations is {shown(self.equations)}; expected the result of state_equations")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in the order of x."""
        return tuple(map(str, self.equations.states))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of u."""
        return tuple(map(str, self.equations.inputs))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of a sequence of values."""
        return tuple(map(str, self.equations.parameters))

    def rhs(self, t: float, x: Any, u: Values = (), parameters: Values = (), u_rate: Values = ()) -> Array:
        """dx/dt at time t.

        Parameters
        ----------
        t : float
            Time (s).
        x : array
            Values of :attr:`states`.
        u, u_rate : mapping or sequence
            Values of :attr:`inputs` and of their time derivatives; empty means zero.
        parameters : mapping or sequence
            Values of :attr:`parameters`, by name or in their order.

        Returns
        -------
        array
            Rates of the states.

        Raises
        ------
        BindingError
            A parameter is missing or unknown.
        SingularError
            The mass matrix is singular for these values.
        SolverError
            Newton's method found no solution of a nonlinear loop.
        """
        return self._unknowns(*self._arguments(t, x, u, u_rate, parameters))[: len(self.equations.states)]

    def bind(
        self, parameters: Values = (), inputs: Mapping[str, Input] | None = None, rates: Mapping[str, Input] | None = None
    ) -> Callable[[float, Any], Array]:
        """The right-hand side f(t, x) for given parameters and inputs, for SciPy and other integrators.

        Parameters
        ----------
        parameters : mapping or sequence
            Values of :attr:`parameters`.
        inputs : mapping, optional
            Number, function of time, or sympy expression of :data:`~gearlib.bondgraph.time`, per input; zero if omitted.
        rates : mapping, optional
            Time derivatives of inputs that are Python functions, where derivative causality needs them.

        Returns
        -------
        callable
            f(t, x), which returns dx/dt.
        """
        theta = self._vector(parameters, self.parameters, "parameter")
        u_of, du_of = self._signals(
            by_name("inputs", inputs, "numbers, expressions or functions of time by name", "Se_1"),
            by_name("rates", rates, "functions of time by name", "Se_1"),
        )
        outer, count = self.equations, len(self.equations.states)
        if outer.is_linear_in_unknowns and outer.mass_matrix.free_symbols <= set(outer.parameters):
            nothing = np.zeros(len(self.inputs))
            M = self._matrix(0.0, np.zeros(count), nothing, nothing, theta)
            inverse = self._solve(M, np.eye(len(M)))[:count]
            somewhere = np.full(count, 0.3)
            self._check_finite(self._vector_b(0.0, somewhere, nothing, nothing, theta), somewhere)
            return lambda t, x: inverse @ self._vector_b(t, x, u_of(t), du_of(t), theta)
        return lambda t, x: self._unknowns(t, x, u_of(t), du_of(t), theta)[:count]

    def matrices(self, parameters: Values = (), *, t: float = 0.0, x: Any = None, u: Values = ()) -> tuple[Array, Array]:
        """A and B of the linear model about (t, x, u): d(x')/dx and d(x')/du, with zero rates of the inputs."""
        x = np.zeros(len(self.states)) if x is None else x
        arguments = self._arguments(t, x, u, (), parameters)
        y = self._unknowns(*arguments) if self._bends else np.zeros(len(self.equations.unknowns))
        by_y, by_x, by_u = self._jacobians(*arguments, y)
        count = len(self.states)
        by_x, by_u = -self._solve(by_y, by_x)[:count], -self._solve(by_y, by_u)[:count]
        if not (np.isfinite(by_x).all() and np.isfinite(by_u).all()):
            raise SingularError(f"{self.equations.graph.name}: with these values of parameters something is divided by zero")
        return by_x, by_u

    def bond_variables(
        self, t: float, x: Any, u: Values = (), parameters: Values = (), u_rate: Values = ()
    ) -> dict[int, tuple[float, float]]:
        """Effort and flow of every bond, by number, computed individually from the elements that set them.

        The arguments are those of :meth:`rhs`.
        """
        arguments = self._arguments(t, x, u, u_rate, parameters)
        efforts, flows = self._bonds(*arguments, self._unknowns(*arguments))
        numbers = self.equations.graph.bonds
        return {n: (float(e), float(f)) for n, e, f in zip(numbers, efforts, flows, strict=True)}

    # ------------------------------------------------------------------ arguments

    def _arguments(self, t: float, x: Any, u: Values, u_rate: Values, parameters: Values) -> tuple[Any, ...]:
        state = reals("x", x, f"{len(self.states)} numbers")
        if state.shape != (len(self.states),):
            raise ArgumentError(f"x must hold {len(self.states)} numbers ({', '.join(self.states)}), not {state.shape}")
        nothing = np.zeros(len(self.inputs))
        values = nothing if isinstance(u, tuple) and not u else self._vector(u, self.inputs, "input")
        rates = nothing if isinstance(u_rate, tuple) and not u_rate else self._vector(u_rate, self.inputs, "input")
        return real("t", t), state, values, rates, self._vector(parameters, self.parameters, "parameter")

    def _vector(self, values: Values, names: tuple[str, ...], what: str) -> Array:
        name = self.equations.graph.name
        if isinstance(values, Mapping):
            given = by_name(f"{name}: {what}s", values, "numbers by name", names[0] if names else "J")
            for key in given:
                if key not in names:
                    raise BindingError(f"{name}: no {what} '{key}': {nearest(key, names)}")
            if missing := [key for key in names if key not in given]:
                raise BindingError(f"{name}: no value for {what} {', '.join(missing)}")
            for key, value in given.items():
                if not is_real(value):
                    raise BoundError(f"{name}: {what} {key} = {shown(value)}; expected finite numbers")
            return np.array([float(given[key]) for key in names])
        found = reals(f"{name}: the {what}s {', '.join(names)}", values, "finite numbers, or a mapping")
        if found.shape != (len(names),):
            raise BindingError(f"{name}: {found.size} values for {len(names)} {what}s: {', '.join(names) or 'none'}")
        return found

    def _signals(self, inputs: dict[str, Input], rates: dict[str, Input]) -> tuple[Callable[[float], Array], ...]:
        for key in (*inputs, *rates):
            if key not in self.inputs:
                raise BindingError(f"{self.equations.graph.name}: no input '{key}': {nearest(key, self.inputs)}")
        for key, value in (*inputs.items(), *rates.items()):
            if isinstance(value, sp.Expr):
                if value.free_symbols - {time} or value.has(sp.nan, sp.zoo, sp.oo, sp.I):
                    raise ArgumentError(f"input '{key}' is {shown(value)}; expected an expression of gearlib.bondgraph.time")
            elif isinstance(value, type) or not callable(value):
                real(f"input '{key}'", value, "a number, a function of time, or an expression of gearlib.bondgraph.time")
        needed = {str(symbol) for r in self.equations.residual for symbol in r.free_symbols}
        for symbol in self.equations.inputs:
            key, value = symbol.name, inputs.get(symbol.name)
            if isinstance(value, sp.Expr):
                rates.setdefault(key, sp.diff(value, time))
            elif callable(value) and key not in rates and rate_of(symbol).name in needed:
                raise ArgumentError(f"input '{key}' drives storage with derivative causality: give its derivative in `rates`")
        return signal([inputs.get(key, 0.0) for key in self.inputs]), signal([rates.get(key, 0.0) for key in self.inputs])

    # ------------------------------------------------------------------ functions of numbers

    @cached_property
    def _symbols(self) -> list[Any]:
        found = self.equations
        return [time, found.states, found.inputs, tuple(map(rate_of, found.inputs)), found.parameters]

    def _function(self, values: Any, *, of_unknowns: bool) -> Any:
        arguments = [*self._symbols, self.equations.unknowns] if of_unknowns else self._symbols
        function = sp.lambdify(arguments, values, modules="numpy", cse=True)

        def quiet(*numbers: Any) -> Any:
            with np.errstate(divide="ignore", invalid="ignore"):  # non-finite values are reported where they are used
                return function(*numbers)

        return quiet

    @cached_property
    def _matrix(self) -> Any:
        return self._function(self.equations.mass_matrix, of_unknowns=not self.equations.is_linear_in_unknowns)

    @cached_property
    def _vector_b(self) -> Any:
        flat = self._function(list(self.equations.right_side), of_unknowns=False)
        return lambda *arguments: np.array(flat(*arguments), dtype=float)

    @cached_property
    def _residual(self) -> Any:
        flat = self._function(list(self.equations.residual), of_unknowns=True)
        return lambda *arguments: np.array(flat(*arguments), dtype=float)

    @cached_property
    def _slopes(self) -> list[Any]:
        """Derivatives of the residual with respect to the unknowns, the states and the inputs."""
        residual = sp.Matrix(self.equations.residual)
        wanted = (self.equations.unknowns, self.equations.states, self.equations.inputs)
        return [residual.jacobian(list(v)) if v and residual else sp.zeros(len(residual), len(v)) for v in wanted]

    @cached_property
    def _bends(self) -> bool:
        """Whether the derivatives depend on the unknowns, so that these must be solved for first."""
        unknowns = set(self.equations.unknowns)
        return any(slope.free_symbols & unknowns for slope in self._slopes)

    @cached_property
    def _jacobians(self) -> Any:
        return self._function(self._slopes, of_unknowns=True)

    @cached_property
    def _bonds(self) -> Any:
        found, known = self.equations, dict(self.equations.elimination)
        values = [[value.xreplace(known) for value in of.values()] for of in (found.efforts, found.flows)]
        return self._function(values, of_unknowns=True)

    def _solve(self, M: Array, right: Array) -> Array:
        try:
            if np.isfinite(M).all():  # it is not finite if the values lock a rigid loop
                return np.asarray(np.linalg.solve(M, right), dtype=np.float64)
            raise np.linalg.LinAlgError
        except np.linalg.LinAlgError:
            names = ", ".join(map(str, self.equations.unknowns))
            raise SingularError(f"{self.equations.graph.name}: these values make the equations for {names} singular") from None

    def _check_finite(self, right: Array, x: Array) -> None:
        if not np.isfinite(right).all() and np.isfinite(x).all():
            raise SingularError(
                f"{self.equations.graph.name}: with these values something is divided by zero (an inertia, a compliance)"
            )

    def _unknowns(self, *arguments: Any) -> Array:
        """The vector y = (x', z)."""
        if self.equations.is_linear_in_unknowns:
            right = self._vector_b(*arguments)
            found = self._solve(self._matrix(*arguments), right)
            self._check_finite(right, arguments[1])
            return found
        return self._newton(arguments)

    def _newton(self, arguments: tuple[Any, ...]) -> Array:
        """Newton's method from zero, with step halving until the residual decreases."""
        y = np.zeros(len(self.equations.unknowns))
        r = self._residual(*arguments, y)
        for _ in range(NEWTON_STEPS):
            step = self._solve(self._matrix(*arguments, y), r)
            if np.max(np.abs(step)) <= NEWTON_ACCURACY * (1 + np.max(np.abs(y))):
                return y - step
            scale = 1.0
            while scale > 1e-8:
                trial = self._residual(*arguments, y - scale * step)
                if np.linalg.norm(trial) < np.linalg.norm(r) or not np.any(trial):
                    break
                scale /= 2
            else:
                if np.max(np.abs(r)) <= 1e-10 * (1 + np.max(np.abs(y))):
                    return y
                break
            y, r = y - scale * step, trial
        name = self.equations.graph.name
        raise SolverError(f"{name}: Newton's method found no solution of the algebraic loops at t = {arguments[0]:.6g} s")


def signal(values: list[Input]) -> Callable[[float], Array]:
    """All inputs as one function of time."""
    if not any(callable(value) or isinstance(value, sp.Expr) for value in values):
        constant = np.array(values, dtype=float)
        return lambda t: constant
    functions = [sp.lambdify(time, v) if isinstance(v, sp.Expr) else v if callable(v) else _constant(float(v)) for v in values]
    return lambda t: np.array([function(t) for function in functions], dtype=float)


def _constant(value: float) -> Callable[[float], float]:
    return lambda t: value
