"""Blocks given by matrices and polynomials, as in Modelica.Blocks.Continuous; also from python-control systems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearlib.language.expressions import real_symbol
from gearparts.blocks.continuous import Gain, Integrator
from gearparts.blocks.interfaces import SISO, Block

Row = tuple[float, ...]


class TransferFunction(SISO):
    """Transfer function: ``y = (b[0] s**m + ... + b[m]) / (a[0] s**n + ... + a[n]) u``, with at most as many zeros as poles.

    Its states ``x[0].y`` to ``x[n-1].y`` are those of the controllable canonical form: ``der(x[i].y) = x[i+1].y`` and ``der(x[n-1].y) =
    u - (a[n] x[0].y + ... + a[1] x[n-1].y) / a[0]``. The coefficients are numbers.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Filtered(gl.Component):
    ...     def assemble(self):
    ...         self.step = gp.blocks.Step()
    ...         self.filter = gp.blocks.TransferFunction(b=[1.0], a=[0.1, 1.0])
    ...         return [gl.connect(self.step.y, self.filter.u)]
    >>> float(round(gl.simulate(Filtered(), t_end=0.1, samples=2)["filter.y"][-1], 9))  # 1 - exp(-1)
    0.632120559
    """

    b = gl.Structural((1.0,), "coefficients of the numerator, the highest power first")
    a = gl.Structural((1.0,), "coefficients of the denominator, the highest power first")

    def assemble(self) -> Sequence[gl.Connection]:
        b, a = _numbers(self, "b", self.b), _numbers(self, "a", self.a)
        if a[0] == 0 or len(b) > len(a):
            raise BindingError(
                f"{_name(self)}: b is {shown(self.b)} and a is {shown(self.a)}; expected a first coefficient of a that is not 0, and "
                "at most as many coefficients in b"
            )
        n = len(a) - 1
        b = (0.0,) * (len(a) - len(b)) + b
        feedback = tuple(-c / a[0] for c in a[:0:-1])  # feedback of x[0], x[1], ...
        direct = b[0] / a[0]
        out = tuple((c - direct * d) / a[0] for c, d in zip(b[:0:-1], a[:0:-1], strict=True))
        rows = tuple(tuple(float(j == i + 1) for j in range(n)) for i in range(n - 1)) + ((feedback,) if n else ())
        return _realised(self, rows, tuple(float(i == n - 1) for i in range(n)), out, direct)


class StateSpace(SISO):
    """Linear system: ``der(x) = A x + B u``, ``y = C x + D u``, with one input and one output.

    The states are ``x[0].y``, ``x[1].y``, .... The matrices are numbers. `StateSpace.of` converts a ``control.StateSpace``;
    `MultiStateSpace` has several inputs and outputs.
    """

    A = gl.Structural((), "n x n")
    B = gl.Structural((), "n x 1, or n numbers")
    C = gl.Structural((), "1 x n, or n numbers")
    D = gl.Structural(0.0, "what goes through at once")

    @classmethod
    def of(cls, system: Any, **values: Any) -> StateSpace:
        """Convert a continuous ``control.StateSpace`` or ``control.TransferFunction``.

        Raises
        ------
        BindingError
            A discrete system, or one with several inputs or outputs.

        Examples
        --------
        >>> import control
        >>> lag = StateSpace.of(control.ss(-1.0, 1.0, 2.0, 0.0))
        >>> lag.A, lag.C
        (((-1.0,),), (2.0,))
        """
        A, B, C, D = _matrices(system, cls.__name__)
        if D.shape != (1, 1):
            raise BindingError(
                f"StateSpace.of: the system has {D.shape[1]} inputs and {D.shape[0]} outputs; MultiStateSpace.of takes it"
            )
        return cls(A=A, B=B.ravel(), C=C.ravel(), D=D.item(), **values)

    def assemble(self) -> Sequence[gl.Connection]:
        A, B, C = _matrix(self, "A", self.A), _numbers(self, "B", self.B), _numbers(self, "C", self.C)
        if not len(A) == len(B) == len(C) or any(len(row) != len(A) for row in A):
            raise BindingError(
                f"{_name(self)}: A is {shown(self.A)}, B is {shown(self.B)}, C is {shown(self.C)}; expected n x n, n and n numbers"
            )
        return _realised(self, A, B, C, _numbers(self, "D", (self.D,))[0])


class MultiStateSpace(Block):
    """Linear system with several inputs and outputs: ``der(x) = A x + B u``, ``y = C x + D u``.

    The inputs are ``inputs[0].u``, ``inputs[1].u``, ..., the outputs ``outputs[0].y``, ..., the states ``x[0].y``, ....

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Two(gl.Component):
    ...     def assemble(self):
    ...         self.step = gp.blocks.Step()
    ...         self.plant = gp.blocks.MultiStateSpace(A=[[-1.0]], B=[[1.0, 2.0]], C=[[1.0], [3.0]], D=[[0.0, 0.0], [0.0, 1.0]])
    ...         return [gl.connect(self.step.y, *(i.u for i in self.plant.inputs))]
    >>> float(round(gl.simulate(Two(), t_end=50.0, samples=2)["plant.outputs[1].y"][-1], 6))
    10.0
    """

    A = gl.Structural((), "n x n")
    B = gl.Structural((), "n x number of inputs")
    C = gl.Structural((), "number of outputs x n")
    D = gl.Structural((), "number of outputs x number of inputs; nothing: zeros")

    @classmethod
    def of(cls, system: Any, **values: Any) -> MultiStateSpace:
        """Convert a continuous ``control.StateSpace`` or ``control.TransferFunction``."""
        A, B, C, D = _matrices(system, cls.__name__)
        return cls(A=A, B=B, C=C, D=D, **values)

    def assemble(self) -> Sequence[gl.Connection]:
        A, B, C = _matrix(self, "A", self.A), _matrix(self, "B", self.B), _matrix(self, "C", self.C)
        n, m = len(A), len(B[0]) if B else 0
        D = _matrix(self, "D", self.D) or tuple((0.0,) * m for _ in C)
        shapes = ((A, n, n), (B, n, m), (C, len(C), n), (D, len(C), m))
        if not (m and all(len(rows) == height and {*map(len, rows)} == {width} for rows, height, width in shapes)):
            sizes = ", ".join(f"{k} {len(v)} x {len(v[0]) if v else 0}" for k, v in (("A", A), ("B", B), ("C", C), ("D", D)))
            raise BindingError(f"{_name(self)}: the matrices do not fit each other: {sizes}")
        x, u = _symbols("x[{}].y", n), _symbols("inputs[{}].y", m)
        self.inputs = [Gain(k=1.0) for _ in u]
        self.x = [Integrator(u=_sum(a, x) + _sum(b, u)) for a, b in zip(A, B, strict=True)]
        self.outputs = [Gain(k=1.0, u=_sum(c, x) + _sum(d, u)) for c, d in zip(C, D, strict=True)]
        return []


def _realised(block: SISO, A: Sequence[Row], B: Row, C: Row, D: float) -> Sequence[gl.Connection]:
    """The parts of a block with one input and one output."""
    x = _symbols("x[{}].y", len(A))
    block.x = [Integrator(u=_sum((*row, b), (*x, block.u))) for row, b in zip(A, B, strict=True)]
    block.sum = Gain(k=1.0, u=_sum((*C, D), (*x, block.u)))
    return [gl.connect(block.sum.y, block.y)]


def _symbols(name: str, count: int) -> list[Any]:
    """Symbols for parts that are yet to be made."""
    return [real_symbol(name.format(i)) for i in range(count)]


def _sum(coefficients: Sequence[float], signals: Sequence[Any]) -> Any:
    """Linear combination of signals, without zero terms."""
    return sum((c * s for c, s in zip(coefficients, signals, strict=True) if c != 0), 0)


def _matrices(system: Any, name: str) -> tuple[Any, Any, Any, Any]:
    import control

    if isinstance(system, control.TransferFunction):
        system = control.ss(system)
    if not isinstance(system, control.StateSpace):
        raise BindingError(f"{name}.of({shown(system)}): expected a control.StateSpace or control.TransferFunction")
    if system.dt not in (0, None):
        raise BindingError(
            f"{name}.of: the system is discrete, with a sample time of {system.dt}; gl.Sampled takes a function that steps it"
        )
    return system.A, system.B, system.C, system.D


def _name(block: gl.Component) -> str:
    return repr(block).strip("<>")


def _numbers(block: gl.Component, name: str, values: Any) -> Row:
    try:
        found = np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        found = np.array(np.nan)
    if found.ndim == 2 and 1 in found.shape:
        found = found.ravel()
    if found.ndim != 1 or not np.isfinite(found).all():
        raise BindingError(f"{_name(block)}: {name} is {shown(values)}; expected a sequence of finite numbers")
    return tuple(found.tolist())


def _matrix(block: gl.Component, name: str, values: Any) -> tuple[Row, ...]:
    return tuple(_numbers(block, f"a row of {name}", (row,) if np.ndim(row) == 0 else row) for row in values)
