"""Declarations of a component class: parameters, variables, inputs, structural choices, and connectors composed of them.

A declaration is a descriptor: accessed on the class it returns itself, inside ``equations`` and ``assemble`` the symbol that it stands
for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, Protocol, Self, get_args, overload

import numpy as np
import sympy

from gearlib.arguments import by_name, is_real, real, shown
from gearlib.errors import ArgumentError, DeclarationError
from gearlib.language.expressions import der
from gearlib.language.units import dimension

StatePreference = Literal["never", "avoid", "default", "prefer"]
NO_VALUE: Any = type("NoValue", (), {"__repr__": lambda self: "no value"})()


class Offered(float):
    """A number that may be ignored where it has no meaning: see `offered`."""


def offered(values: Mapping[str, float]) -> dict[str, float]:
    """Optional values by name, which need not all be used: such as gear data of which a simple mesh needs only a part.

    Ordinarily a value without any effect is refused as a mistake.

    Parameters
    ----------
    values : mapping of str to float
        Passed to a component as keywords.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> data = gl.offered({"r_a": 0.03, "r_b": 0.06, "c": 2e8, "alpha": 0.35})  # the pressure angle counts with friction
    >>> mesh = gp.DetailedExternalMesh(**data, d=100.0)
    """
    given = by_name("values", values, "numbers by name, such as {'alpha': 0.35}", "alpha")
    return {name: Offered(real(f"values: {name}", value)) for name, value in given.items()}


class Owner(Protocol):
    """Interface of a component that its declarations and its diagram use."""

    @property
    def icon(self) -> Any: ...
    @property
    def _name(self) -> str: ...

    _declarations: ClassVar[dict[str, Declaration]]

    @property
    def _structural(self) -> Mapping[str, Any]: ...
    @property
    def _bindings(self) -> Mapping[str, Any]: ...
    @property
    def _given(self) -> Mapping[str, Any]: ...
    @property
    def _parts(self) -> Mapping[str, Owner]: ...
    def _symbol(self, local: str) -> Any: ...
    def _parameter(self, name: str) -> Any: ...
    def _choice(self, name: str) -> Any: ...
    def _port(self, connector: Connector) -> Any: ...
    def _assembled(self) -> Sequence[Any]: ...
    def _forget(self) -> None: ...
    def _radii(self) -> tuple[float, ...]: ...


class Declaration:
    """Base of everything declared in a component class."""

    name: str = ""

    def __set_name__(self, owner: type, name: str) -> None:
        if not self.name:
            object.__setattr__(self, "name", name)

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Owner, owner: type) -> Any: ...
    def __get__(self, instance: Owner | None, owner: type) -> Any:
        return self if instance is None else instance._symbol(self.name)


def _check_text(declared: Declaration, *names: str) -> None:
    examples = {"unit": "'kg.m2'", "description": "'load inertia'", "of": "'w'"}
    for what in names:
        value = getattr(declared, what)
        if not isinstance(value, str):
            raise DeclarationError(
                f"{type(declared).__name__}: {what} is {shown(value)}; expected text, such as {examples[what]} (a value is given by "
                "name: default=...)"
            )
        if what == "unit":
            dimension(value)


def _check_number(declared: Declaration, what: str, infinite: bool = False) -> None:
    value = getattr(declared, what)
    if infinite and isinstance(value, float) and math.isinf(value):
        return
    try:
        real(f"{type(declared).__name__}: {what}", value)
    except ArgumentError as problem:
        raise DeclarationError(str(problem)) from None


def _check_default(declared: Parameter | Input) -> None:
    """Check a default value of a parameter or input: a number, an expression, or a function of the component."""
    value = declared.default
    if value is NO_VALUE or value is None or (callable(value) and not isinstance(value, type)) or isinstance(value, sympy.Expr):
        return
    _check_number(declared, "default")


def _are_words(words: Any) -> bool:
    """Whether these are texts by number, each with a placeholder for a path or without."""
    try:
        return isinstance(words, Mapping) and all(
            (isinstance(value, bool) or is_real(value)) and isinstance(text, str) and text.format("path") is not None
            for value, text in words.items()
        )
    except Exception:  # a placeholder that cannot be filled
        return False


@dataclass(frozen=True, eq=False)
class Parameter(Declaration):
    """A number that is constant during a run and may change between runs without retranslation.

    Parameters
    ----------
    unit : str
        SI unit, such as ``"kg.m2"``.
    description : str
        A few words, shown in reports.
    default : float or expression, optional
        Required at instantiation if there is none.
    min, max : float, optional
        Inclusive bounds, checked at compilation and before every run.
    """

    unit: str = "1"
    description: str = ""
    default: Any = NO_VALUE
    min: float = -float("inf")
    max: float = float("inf")

    def __post_init__(self) -> None:
        _check_text(self, "unit", "description")
        for bound in ("min", "max"):
            _check_number(self, bound, infinite=True)
            object.__setattr__(self, bound, float(getattr(self, bound)))
        if self.min > self.max:
            raise DeclarationError(f"Parameter: min is {self.min:g}, above max, which is {self.max:g}")
        _check_default(self)

    def __get__(self, instance: Owner | None, owner: type) -> Any:
        return self if instance is None else instance._parameter(self.name)


@dataclass(frozen=True, eq=False)
class Variable(Declaration):
    """An unknown function of time.

    Parameters
    ----------
    unit, description : str
        SI unit and a few words.
    state : {"never", "avoid", "default", "prefer"}
        Preference as a state. Potentials of connectors (absolute angles) are avoided by default.
    nominal : float
        Typical magnitude; the absolute tolerance of a state is ``rtol * nominal``.
    guess : float
        Start value unless another one is fixed.
    start : float, optional
        Fixed start value.
    words : mapping of float to str, optional
        Meanings of its values, ``{0: "open: mesh {}", 1: "in contact: mesh {}"}`` with a placeholder for the component's path: linear
        analyses use them to describe their operating point. 0 stands for a state without force transmission.
    min : float, optional
        Minimum on which the equations rely, such as the relative speed of a freewheel. A start below it is refused, and so is a run in
        which a ``reinit`` leads there.
    """

    unit: str = "1"
    description: str = ""
    state: StatePreference = "default"
    nominal: float = 1.0
    guess: float = 0.0
    start: float | None = None
    words: Mapping[float, str] | None = None
    min: float = -float("inf")

    def __post_init__(self) -> None:
        _check_text(self, "unit", "description")
        _check_number(self, "min", infinite=True)
        if not (isinstance(self.state, str) and self.state in get_args(StatePreference)):
            raise DeclarationError(
                f"Variable(state={shown(self.state)}): valid choices: {', '.join(map(repr, get_args(StatePreference)))}"
            )
        _check_number(self, "guess")
        if self.start is not None:
            _check_number(self, "start")
        _check_number(self, "nominal")
        if not self.nominal > 0.0:
            raise DeclarationError(
                f"Variable(nominal={shown(self.nominal)}): expected a positive number, the typical size of the variable"
            )
        if self.words is not None and not _are_words(self.words):
            raise DeclarationError(
                f"Variable: words is {shown(self.words)}; expected texts by value, such as {{0: 'open: mesh {{}}', 1: 'in contact'}}"
            )


@dataclass(frozen=True, eq=False)
class Input(Variable):
    """A variable set from outside: bound when the part is made, or otherwise an input of the whole system.

    ``default`` binds it unless something else does: a number, an expression, or a function of the component that returns one.

    Examples
    --------
    >>> e_rate_sun = Input("m/s", "rate of the transmission error at the sun", default=lambda unit: unit.e_rate)
    """

    default: Any = NO_VALUE

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_default(self)


@dataclass(frozen=True, eq=False)
class Derivative(Declaration):
    """An alias of a variable's time derivative, such as ``a`` for ``der(w)``; it adds no unknown and no equation.

    If no equation of the model contains the derivative, it is computed on demand.

    Parameters
    ----------
    of : str
        Name of the variable.
    unit, description : str
        SI unit and a few words.
    """

    of: str
    unit: str = "1"
    description: str = ""

    def __post_init__(self) -> None:
        _check_text(self, "of", "unit", "description")

    def __get__(self, instance: Owner | None, owner: type) -> Any:
        return self if instance is None else der(instance._symbol(self.of))


@dataclass(frozen=True, eq=False)
class Discrete(Declaration):
    """A variable that changes at events only: the mode of a clutch, a counter.

    Its equation ``gl.Eq(self.mode, ...)`` is evaluated at events; ``gl.pre(self.mode)`` is its value before the event.
    """

    description: str = ""
    start: float = 0.0

    def __post_init__(self) -> None:
        _check_text(self, "description")
        _check_number(self, "start")


@dataclass(frozen=True, eq=False)
class Structural(Declaration):
    """A choice that changes the equations: the number of planets, backlash or not. Its value is a plain Python object.

    Parameters
    ----------
    default : object
        Default value. Other values must be of its type, unless it is None.
    description : str
        A few words.
    choices : tuple, optional
        The valid values, if there are few.
    min, max : float, optional
        Inclusive bounds of a number, checked at compilation.

    Examples
    --------
    >>> planets = Structural(3, "number of planets", min=1)
    """

    default: Any
    description: str = ""
    choices: tuple[Any, ...] = ()
    min: float = -float("inf")
    max: float = float("inf")

    def __post_init__(self) -> None:
        _check_text(self, "description")
        _check_number(self, "min", infinite=True)
        _check_number(self, "max", infinite=True)
        if self.is_bounded and (isinstance(self.default, bool) or not isinstance(self.default, (int, float))):
            raise DeclarationError(f"Structural: min and max bound a number; the default is {shown(self.default)}")
        if self.is_bounded and not self.min <= self.default <= self.max:
            raise DeclarationError(f"Structural: the default is {shown(self.default)}; expected {self.bounds}")
        if not isinstance(self.choices, (tuple, list)):
            raise DeclarationError(f"Structural: choices is {shown(self.choices)}; expected a tuple of the valid values")

    @property
    def is_bounded(self) -> bool:
        """Whether its value is a number with bounds."""
        return self.min > -float("inf") or self.max < float("inf")

    @property
    def bounds(self) -> str:
        """The valid numbers, in words."""
        if self.max == float("inf"):
            return f"{shown(self.min)} or more"
        return f"{shown(self.max)} or less" if self.min == -float("inf") else f"{shown(self.min)} to {shown(self.max)}"

    def __get__(self, instance: Owner | None, owner: type) -> Any:
        if instance is None:
            return self
        return instance._choice(self.name)


@dataclass(frozen=True, eq=False)
class Potential(Variable):
    """The connector variable that is equal at all connected ports (an angle, a displacement, a temperature)."""


@dataclass(frozen=True, eq=False)
class Flow(Variable):
    """The connector variable that sums to zero over all connected ports, positive into the component."""


@dataclass(frozen=True, eq=False)
class Connector(Declaration):
    """Base of connector classes; a subclass declares one or more pairs of `Potential` and `Flow`.

    Parameters
    ----------
    description : str
        A few words.
    when : str, optional
        Name of a `Structural` of the component; the connector exists only if that is true.
    """

    description: str = ""
    when: str | None = field(default=None, kw_only=True)
    variables: ClassVar[dict[str, Variable]] = {}
    ends: ClassVar[dict[str, Any]] = {}  # component classes for the ends of a cut connection

    def __post_init__(self) -> None:
        _check_text(self, "description")
        if not (self.when is None or isinstance(self.when, str)):
            raise DeclarationError(
                f"{type(self).__name__}: when is {shown(self.when)}; expected the name of a Structural of the component"
            )

    def __init_subclass__(cls) -> None:
        members = (member for base in reversed(cls.__mro__) for member in vars(base).items())
        cls.variables = {name: value for name, value in members if isinstance(value, (Potential, Flow))}
        cls.ends = {}
        if len({type(v) for v in cls.variables.values()}) == 1:
            raise DeclarationError(f"connector {cls.__name__} declares only one half; a Potential and a Flow are needed")

    def __get__(self, instance: Owner | None, owner: type) -> Any:
        return self if instance is None else instance._port(self)


def as_tuple(value: Any) -> Any:
    """Convert lists and arrays to nested tuples."""
    if isinstance(value, np.ndarray):
        return as_tuple(value.tolist())
    return tuple(as_tuple(v) for v in value) if isinstance(value, (list, tuple)) else value


@dataclass(frozen=True)
class Declared:
    """The variables and parameters of an instance, given its structural choices, in declaration order."""

    variables: dict[str, Variable]  # connectors' variables as "flange_a.phi"
    parameters: dict[str, Parameter]
    connectors: dict[str, Connector]
    discretes: dict[str, Discrete]
    derivatives: dict[str, str]  # aliases of derivatives, such as {"a": "der(w)"}

    @cached_property
    def valued(self) -> dict[str, Variable]:
        """The variables that are given a value by their declaration or where a part is made: inputs, and those with a start value."""
        return {n: v for n, v in self.variables.items() if isinstance(v, Input) or v.start is not None or v.guess}

    @cached_property
    def ends(self) -> dict[str, tuple[list[int], list[int]]]:
        """For each connector the positions of its potentials and of its flows among the variables."""
        position = {n: i for i, n in enumerate(self.variables)}
        found: dict[str, tuple[list[int], list[int]]] = {}
        for name, connector in self.connectors.items():
            places = [(position[f"{name}.{n}"], v) for n, v in connector.variables.items()]
            found[name] = [i for i, v in places if isinstance(v, Potential)], [i for i, v in places if isinstance(v, Flow)]
        return found


def declared_by(component: Owner) -> Declared:
    """Declarations of `component` under its structural choices."""
    variables: dict[str, Variable] = {}
    parameters: dict[str, Parameter] = {}
    connectors: dict[str, Connector] = {}
    discretes: dict[str, Discrete] = {}
    for name, declared in component._declarations.items():
        if isinstance(declared, Parameter):
            parameters[name] = declared
        elif isinstance(declared, Discrete):
            discretes[name] = declared
        elif isinstance(declared, Variable):
            variables[name] = declared
        elif isinstance(declared, Connector) and (declared.when is None or component._structural[declared.when]):
            connectors[name] = declared
            variables.update({f"{name}.{inner}": v for inner, v in declared.variables.items()})
    derivatives = {n: f"der({d.of})" for n, d in component._declarations.items() if isinstance(d, Derivative)}
    return Declared(variables, parameters, connectors, discretes, derivatives)
