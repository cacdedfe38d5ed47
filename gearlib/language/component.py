"""`Component`: base class of models, with declared variables and equations, with parts and connections, or both.

Inside ``equations`` and ``assemble`` an attribute is a symbol named by its path from there: ``self.w`` is ``w`` and
``self.load.w`` is ``load.w``, so that one set of equations stands for every instance of the class.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from copy import deepcopy
from dataclasses import dataclass
from operator import is_
from typing import TYPE_CHECKING, Any, ClassVar, TypeGuard

import numpy as np
import sympy

from gearlib.arguments import shown
from gearlib.errors import AttributeNameError, BindingError, BoundError, ConnectionError, DeclarationError, ModelError, nearest
from gearlib.language.declarations import (
    NO_VALUE,
    Connector,
    Declaration,
    Input,
    Parameter,
    StatePreference,
    Structural,
    as_tuple,
)
from gearlib.language.energy import Energy
from gearlib.language.expressions import TOO_DEEP, Eq, When, as_number, real_symbol
from gearlib.language.interior import ASSEMBLING, parts_of, path_of, reads_parts

if TYPE_CHECKING:
    from gearlib.drawing.diagram import Diagram
    from gearlib.drawing.gears.gear_set import GearSet
    from gearlib.drawing.gears.gear_view import GearView
    from gearlib.drawing.scheme.stick_diagram import Scheme

_scope: ContextVar[Component | None] = ContextVar("scope", default=None)
RESERVED = frozenset({"time", "start", "guess", "nominal", "state", "equations", "assemble"})
NOTHING: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())  # attributes and parts made by assemble()
PRIVATE = frozenset({
    "_parent", "_name", "_parts", "_connections", "_made", "_start", "_guess", "_nominal", "_state", "_structural", "_bindings",
    "_given", "_read",
})  # fmt: skip


@dataclass(frozen=True, repr=False)
class Port:
    """A connector of one component, as passed to `connect`."""

    component: Component
    connector: Connector

    def __getattr__(self, name: str) -> Any:
        if name in ("component", "connector"):  # the port is being unpickled
            raise AttributeError(name)
        if name.startswith("_") or name not in self.connector.variables:
            raise AttributeNameError(
                f"{type(self.connector).__name__} '{self.connector.name}' has no variable '{name}'; "
                f"it has {', '.join(self.connector.variables)}"
            )
        return self.component._symbol(f"{self.connector.name}.{name}")

    def __repr__(self) -> str:
        path = path_of(self.component) or type(self.component).__name__
        return f"<{type(self.connector).__name__} {path}.{self.connector.name}>"


@dataclass(frozen=True)
class Connection:
    """Ports with equal potentials and flows that sum to zero; or signals that are equal."""

    ports: tuple[Port, ...]
    signals: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        if not (isinstance(self.ports, tuple) and all(isinstance(port, Port) for port in self.ports)):
            raise ConnectionError(f"Connection: ports is {shown(self.ports)}; expected connectors, as connect() takes them")
        if not (isinstance(self.signals, tuple) and all(isinstance(signal, sympy.Symbol) for signal in self.signals)):
            raise ConnectionError(f"Connection: signals is {shown(self.signals)}; expected signals, as connect() takes them")


def connect(*ports: Port) -> Connection:
    """Connect ports (potentials become equal, flows sum to zero) or signals (inputs take the value of the source).

    Parameters
    ----------
    *ports : Port, or variables and inputs
        Two or more connectors of one kind, such as ``self.motor.flange_b``; or a source signal, such as ``self.controller.y`` or
        ``self.sensor.w``, and the inputs of parts that it drives, such as ``self.torque.tau``. Seen from inside, variables of the
        enclosing component are outputs to be driven, and its inputs are sources.

    Raises
    ------
    ConnectionError
        Fewer than two arguments, something that is not a connector, different kinds, a repeated connector; or signals with no possible
        source or several.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.ramp, self.torque, self.load = gp.blocks.Ramp(height=3.0, duration=1.0), gp.Torque(), gp.Inertia(J=1.5)
    ...         return [gl.connect(self.ramp.y, self.torque.tau), gl.connect(self.torque.flange, self.load.flange_a)]
    >>> float(gl.simulate(Drive(), t_end=1.0, samples=3)["load.w"][-1])
    1.0
    """
    if ports and all(isinstance(port, sympy.Symbol) for port in ports):
        return _joined_signals(ports)
    for port in ports:
        if not isinstance(port, Port):
            hint = " (name one of its connectors)" if isinstance(port, Component) else ""
            if isinstance(port, sympy.Expr):
                hint = " (an expression is bound where the part is made, as in tau=2 * self.controller.y)"
            raise ConnectionError(
                f"connect() joins connectors, such as motor.flange_b; got {shown(port)}{hint}; or signals, such as gain.y and torque.tau"
            )
    if len(ports) < 2:
        raise ConnectionError(f"connect() needs two connectors, got {len(ports)}")
    first = ports[0]
    for other in ports:
        if type(other.connector) is not type(first.connector):
            raise ConnectionError(
                f"cannot connect {_port_path(first)} ({type(first.connector).__name__}) to {_port_path(other)} "
                f"({type(other.connector).__name__}): connectors of different kinds; a gear such as IdealGearR2T joins "
                "rotation to translation"
            )
    seen: set[tuple[int, int]] = set()
    for port in ports:
        if (place := (id(port.component), id(port.connector))) in seen:
            raise ConnectionError(f"{_port_path(port)} is connected to itself")
        seen.add(place)
    return Connection(ports)


def _joined_signals(signals: tuple[Any, ...]) -> Connection:
    if len(signals) < 2:
        raise ConnectionError(f"connect() needs two signals, got only {signals[0]}")
    for k, signal in enumerate(signals):
        if signal in signals[:k]:
            raise ConnectionError(f"{signal} is connected to itself")
    return Connection((), signals)


def _port_path(port: Port) -> str:
    path = path_of(port.component)
    return f"{path}.{port.connector.name}" if path else f"{type(port.component).__name__}.{port.connector.name}"


@dataclass(frozen=True)
class PartGiven:
    """Arguments given to an instance."""

    values: Mapping[str, Any]  # of parameters and inputs
    choices: Mapping[str, Any]  # structural choices
    start: Mapping[str, Any]
    guess: Mapping[str, Any]
    nominal: Mapping[str, float]
    state: Mapping[str, StatePreference]


class Component:
    """Base class of all models.

    A leaf implements ``equations`` and returns a list of `Eq`; a composite implements ``assemble``, assigns its parts to attributes and
    returns a list of `connect` calls; a component may do both. Values of parameters, structural choices and inputs are passed as
    keywords when an instance is made.

    A class inherits the declarations and equations of its bases: ``equations`` returns what the class adds to them, and is called once
    for every class along the method resolution order, bases first. ``super().equations()`` is not called, and an equation of a base
    cannot be replaced. If a base needs something from derived classes, it declares a variable that these equate, or a method that they
    define. ``assemble`` and ``energies`` are ordinary methods with ordinary overriding.

    Parameters
    ----------
    start : mapping of str to float, optional
        Fixed start values, such as ``{"phi": 0, "w": 100}``.
    guess : mapping of str to float, optional
        Start values that only help the solver.
    nominal : mapping of str to float, optional
        Typical magnitudes of variables, where these differ from the class's.
    state : mapping of str to {"never", "avoid", "default", "prefer"}, optional
        State preferences of variables, where these differ from the class's.
    **bindings
        Values by name: numbers, or expressions of the enclosing component's parameters; inputs also accept expressions of ``time`` and
        of variables.

    Raises
    ------
    BindingError
        A name that the class does not declare.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     J_load = gl.Parameter("kg.m2", "load inertia", default=2.0, min=0)
    ...     def assemble(self):
    ...         self.torque = gp.Torque(tau=10.0)
    ...         self.load = gp.Inertia(J=self.J_load)
    ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
    >>> gl.simulate(Drive(), t_end=1.0, samples=3)["load.w"]
    array([0. , 2.5, 5. ])

    >>> class Compliant(gp.interfaces.TwoFlanges):
    ...     tau = gl.Variable("N.m", "torque between the flanges")
    ...     def equations(self):
    ...         return [gl.Eq(self.flange_b.tau, self.tau), gl.Eq(self.flange_a.tau, -self.tau)]
    >>> class Spring(Compliant):
    ...     c = gl.Parameter("N.m/rad", "stiffness", min=0)
    ...     def equations(self):
    ...         return [gl.Eq(self.tau, self.c * (self.flange_b.phi - self.flange_a.phi))]
    >>> [str(equation.left) for equation in gl.language.component.equations_of(Spring(c=2.0))]
    ['flange_b.tau', 'flange_a.tau', 'tau']
    """

    icon: ClassVar[str] = ""  # icon of the class in diagrams (gearlib.drawing.icons); empty: a labelled box
    radii: ClassVar[tuple[str, ...]] = ()  # for an icon with gears: the parameters with their radii, or one with the ratio

    _parent: Component | None  # the following are instance attributes
    _name: str
    _parts: dict[str, Any]
    _made: tuple[frozenset[str], frozenset[str]]
    _read: set[str]  # structural choices read by equations and assemble
    _structural: dict[str, Any]
    _bindings: dict[str, Any]
    _given: dict[str, Any]
    _declarations: ClassVar[dict[str, Declaration]] = {}
    _bindable: ClassVar[dict[str, Declaration]] = {}
    _choices: ClassVar[dict[str, Structural]] = {}
    _bounded: ClassVar[tuple[Structural, ...]] = ()
    # signals of the enclosing component, and the instance's own signals that are joined to them
    _joined: tuple[tuple[Any, str], ...] = ()
    _changes: tuple[Callable[[Any], None], ...] = ()  # callbacks applied to an instance once its parts are made (`changed`)
    _members: ClassVar[list[list[Any]]] = []  # members of the class and its bases, as validated by `check_declarations`

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        inherited: dict[str, Declaration] = {}
        for base in reversed(cls.__mro__[1:]):
            inherited.update((n, d) for n, d in vars(base).get("_declarations", {}).items() if n in vars(base))
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Declaration)}
        for name, declared in own.items():
            if name.startswith("_") or name in RESERVED:
                raise DeclarationError(f"{cls.__name__}.{name}: this name is reserved")
            if declared.name != name:
                raise DeclarationError(
                    f"{cls.__name__}.{name} is the declaration of '{declared.name}'; make one for each name: "
                    f"{type(declared).__name__}(...)"
                )
        for name, value in vars(cls).items():
            if isinstance(value, Component):
                raise DeclarationError(
                    f"{cls.__name__}.{name}: parts are made in assemble(), one for each instance: self.{name} = {type(value).__name__}(...)"
                )
            if isinstance(value, type) and issubclass(value, Declaration):
                raise DeclarationError(
                    f"{cls.__name__}.{name} is the class {value.__name__}; make a declaration: {value.__name__}(...)"
                )
        cls._declarations = {**inherited, **own}
        cls._members = []
        cls._bindable = {n: d for n, d in cls._declarations.items() if isinstance(d, (Parameter, Input, Structural))}
        cls._choices = {n: d for n, d in cls._declarations.items() if isinstance(d, Structural)}
        cls._bounded = tuple(d for d in cls._choices.values() if d.is_bounded)
        for name, declared in cls._declarations.items():
            if isinstance(declared, Connector) and declared.when is not None:
                if not isinstance(cls._declarations.get(declared.when), Structural):
                    raise DeclarationError(f"{cls.__name__}.{name}: when={declared.when!r} is not a Structural of the class")

    def __init__(
        self, *positional: Any, start: Mapping[str, Any] | None = None, guess: Mapping[str, Any] | None = None,
        nominal: Mapping[str, float] | None = None, state: Mapping[str, StatePreference] | None = None, **bindings: Any,
    ) -> None:  # fmt: skip
        kind = type(self).__name__
        if positional:
            raise BindingError(
                f"{kind}({shown(positional[0])}): give values by name, such as {kind}({next(iter(self._bindable), 'start')}=...)"
            )
        for what, given, kind_of, example in (
            ("start", start, "start values", "100.0"), ("guess", guess, "start values", "100.0"),
            ("nominal", nominal, "typical sizes", "0.01"), ("state", state, "preferences", "'prefer'"),
        ):  # fmt: skip
            if given is not None and not _is_readable(given):
                names = given if isinstance(given, (set, frozenset, list, tuple)) else ()
                name = next((n for n in names if isinstance(n, str)), "w")
                raise BindingError(
                    f"{kind}: {what} is {shown(given)}; expected {kind_of} by name, such as {what}={{'{name}': {example}}}"
                )
        for name in bindings:
            if name not in self._bindable:
                if name in self._declarations:
                    what, advice = "a variable or connector", f"a start value is given as start={{'{name}': ...}}"
                else:
                    what, advice = "not a parameter, input or structural choice", nearest(name, self._bindable)
                raise BindingError(f"{kind}: '{name}' is {what}, and cannot be given by keyword; {advice}")
        structural: dict[str, Any] = {}
        chosen: dict[str, Any] = {}
        for name, choice in self._choices.items():
            structural[name] = self._structural_value(choice, bindings.get(name, choice.default))
            if name in bindings:
                chosen[name] = structural[name]
                del bindings[name]
        self.__dict__.update(
            _parent=None, _name="", _parts={}, _connections=None, _made=NOTHING, _start=dict(start or {}), _guess=dict(guess or {}),
            _nominal=dict(nominal or {}), _state=dict(state or {}), _structural=structural, _bindings=bindings, _given=chosen, _read=set(),
        )  # fmt: skip

    def equations(self) -> Sequence[Eq | When]:
        """The equations that the class adds to those of its bases, on symbols that stand for any instance."""
        return []

    def assemble(self) -> Sequence[Connection]:
        """Make the parts (assign them to attributes) and return their connections."""
        return []

    def energies(self) -> Energy | None:
        """Energy stored, dissipated and supplied, as expressions; None if not declared.

        Only `Result.energy_balance` uses it.
        """
        return None

    def diagram(self, depth: int = 1, *, fold: bool = True, width: float = 1400.0) -> Diagram:
        """Block diagram with the parts as icons, joined by their connections: an SVG picture that notebooks display.

        Parameters
        ----------
        depth : int
            Number of levels of nested parts to show.
        fold : bool
            Whether to draw a family of identical parts once, with its count.
        width : float
            Width (pixels) at which a row of parts wraps.

        Examples
        --------
        >>> import gearparts as gp
        >>> picture = gp.ZhouCui2022().diagram(depth=2)
        >>> picture
        <Diagram of ZhouCui2022: 4 boxes, 8 wires; save('train.svg') writes it>
        """
        from gearlib.language.outline import drawn

        return drawn(self, depth, fold, width)

    def _repr_html_(self) -> str:
        """Notebook representation: the diagram, or the reason why there is none."""
        from gearlib.language.outline import html_of

        return html_of(self)

    def scheme(self) -> Scheme:
        """Stick diagram: shafts as lines, gears as bars at their radii, planetary sets, clutches, brakes and the hatched housing.

        Planetary sets are shown by their upper half, with planets in blue. Only rotating parts are shown, at all depths; bodies belong
        to their shafts. `PowerFlow.scheme` adds speeds, torques and powers, `Modes.scheme` the
        motion of a mode.

        Raises
        ------
        ModelError
            Nothing in it turns, or gears whose axes are carried by a shaft without being a planetary set.

        Examples
        --------
        >>> import gearparts as gp
        >>> gp.ZhouCui2022().scheme()
        <Scheme of ZhouCui2022: 5 shafts, 6 parts; save('train.svg') writes it>
        """
        from gearlib.language.outline import scheme_of

        return scheme_of(self)

    def drawn_gears(self) -> GearSet | None:
        """The gears of the component with their teeth, as `gear_view` shows them; None: it has none, or their teeth are not known."""
        return None

    def gear_view(
        self, part: str | None = None, *, angle: float | Sequence[float] = 0.0, held: str | None = None, gears: GearSet | None = None
    ) -> GearView:  # fmt: skip
        """Gears seen along their axes, with the flanks of their teeth; an SVG picture that notebooks show.

        Shown are pairs and planetary sets whose numbers of teeth are known: meshes with ``z_a``, units with ``Z_s, Z_p, Z_r`` or
        ``Z_1``. Where a model knows nothing of profile shifts, a pair's teeth are as thick as each other at the pitch circles; `gears`
        gives the true ones. `Result.gear_view` shows a run with the forces of the meshes.

        Parameters
        ----------
        part : str, optional
            Path of a pair or of a set, or of what contains some; all without.
        angle : float or sequence of float
            Of each pair's first gear, of each set's sun (of its carrier, where the sun is held), rad; several make the picture move.
        held : {"ring", "carrier", "sun"}, optional
            The shaft of planetary sets that stands still; the ring without.
        gears : GearSet, optional
            The gears of ``part``, such as ``GearPair(...).drawn_gears()``.

        Raises
        ------
        ModelError
            There are no gears whose teeth are known.

        Examples
        --------
        >>> import gearparts as gp
        >>> gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81).gear_view("train.x_unit", angle=[0.0, 0.1, 0.2])
        <GearView of ZhouCui2022: 5 gears, 3 frames; save('gears.svg') or save('gears.html') writes it>
        """
        from gearlib.language.gears_of import turned

        return turned(self, part, angle, held, gears)

    def _structural_value(self, declared: Structural, value: Any) -> Any:
        where = f"{type(self).__name__}: structural choice '{declared.name}'"
        if declared.choices:
            alike = (
                c for c in declared.choices if isinstance(value, type(c)) and isinstance(value, bool) == isinstance(c, bool)
            )
            if not any(_is_same(value, choice) for choice in alike):
                raise BindingError(f"{where} is {shown(value)}; valid choices: {', '.join(map(shown, declared.choices))}")
            return value
        expected = type(declared.default)
        if expected is int and isinstance(value, (sympy.Integer, np.integer)) and not isinstance(value, np.timedelta64):
            value = int(value)
        if expected is tuple and isinstance(value, (list, np.ndarray)):  # a table, stored in hashable form
            value = as_tuple(value)
        if declared.default is not None and (not isinstance(value, expected) or isinstance(value, bool) != (expected is bool)):
            raise BindingError(f"{where} is {shown(value)} ({type(value).__name__}); expected {expected.__name__}")
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._declarations:
            raise DeclarationError(
                f"{type(self).__name__}.{name} is declared by the class; give its value when the component is made: "
                f"{type(self).__name__}({name}=...)"
            )
        parent = self._parent
        if parent is not None and self._name in parent._made[1] and _scope.get() is None and not name.startswith("_"):
            raise ModelError(
                f"{path_of(self)}.{name}: {type(parent).__name__}.assemble() made this part, and makes it again whenever the model is "
                "compiled; give the value there"
            )
        if isinstance(value, Component):
            self._adopt(name, value)
        elif isinstance(value, type) and issubclass(value, Component):
            raise ModelError(
                f"{type(self).__name__}.{name} is the class {value.__name__}; make an instance: {value.__name__}(...)"
            )
        elif isinstance(value, (list, tuple)) and any(isinstance(v, Component) for v in value):
            for i, part in enumerate(value):
                if not isinstance(part, Component):
                    raise ModelError(
                        f"{type(self).__name__}.{name}[{i}] is {shown(part)}; a family of parts holds components only"
                    )
                self._adopt(f"{name}[{i}]", part)
        elif isinstance(value, dict) and any(isinstance(v, Component) for v in value.values()):
            raise ModelError(f"{type(self).__name__}.{name} is a dict of components; a family of parts is a list of them")
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        parts = [part for part in self._parts if part == name or part.startswith(f"{name}[")]
        if self._made[1].intersection(parts):
            raise ModelError(
                f"{type(self).__name__}.{name}: assemble() made this part, and makes it again whenever the model is compiled"
            )
        object.__delattr__(self, name)
        for part in parts:
            object.__setattr__(self._parts.pop(part), "_parent", None)

    def _adopt(self, name: str, part: Component) -> None:
        if part._parent is not None:
            raise ModelError(
                f"{type(self).__name__}.{name}: this {type(part).__name__} already is the part '{path_of(part)}' of another "
                "component; make a new one"
            )
        if name in self._parts:
            raise ModelError(f"{type(self).__name__}.{name} is assigned twice")
        ancestor: Component | None = self
        while ancestor is not None:
            if ancestor is part:
                raise ModelError(f"{type(self).__name__}.{name}: a component cannot be a part of itself")
            ancestor = ancestor._parent
        object.__setattr__(part, "_parent", self)
        object.__setattr__(part, "_name", name)
        self._parts[name] = part

    def __getattr__(self, name: str) -> Any:
        # Reached only for unknown names: a part of a composite that has not been assembled, or a mistake.
        if not name.startswith("_"):
            if self._connections is None and type(self).assemble is not Component.assemble:
                self._assembled()
                if name in self.__dict__:
                    return self.__dict__[name]
            valid = [*self._declarations, *self._parts]
            where = f"{path_of(self)}: {type(self).__name__}" if path_of(self) else type(self).__name__
            raise AttributeNameError(f"{where} has no '{name}'; {nearest(name, valid)}")
        if name in PRIVATE:
            raise ModelError(f"{type(self).__name__}.__init__() must call super().__init__() before anything else")
        raise AttributeError(name)

    def _assembled(self) -> Sequence[Connection]:
        """The connections of a composite, which is assembled on first use."""
        with ASSEMBLING:
            if self._connections is None:
                self._check_bounds()
                object.__setattr__(self, "_connections", [])
                if type(self).assemble is not Component.assemble or self._changes:
                    self._assemble()
            result: Sequence[Connection] = self._connections
            return result

    def _assemble(self) -> None:
        attributes, parts = set(self.__dict__), set(self._parts)
        try:
            with inside(self), _explained(f"{type(self).__name__}.assemble()"):
                returned = self.assemble()
            connections = list(returned) if isinstance(returned, Iterable) else [returned]
            if not isinstance(returned, Iterable) or not all(isinstance(c, Connection) for c in connections):
                bad = next((c for c in connections if not isinstance(c, Connection)), returned)
                raise ModelError(f"{type(self).__name__}.assemble() must return a list of connect(...) calls; got {shown(bad)}")
            object.__setattr__(self, "_connections", connections)
            if self._changes:
                with inside(self):
                    for change in self._changes:
                        change(self)
        except BaseException:
            self._remember_made(attributes, parts)
            self._forget()
            raise
        self._remember_made(attributes, parts)

    def _check_bounds(self) -> None:
        for declared in self._bounded:
            value = self._structural[declared.name]
            if not declared.min <= value <= declared.max:
                where = path_of(self) or type(self).__name__
                raise BoundError(f"{where}: {declared.name} is {shown(value)}; expected {declared.bounds}")

    def _remember_made(self, attributes: set[str], parts: set[str]) -> None:
        made = frozenset(self.__dict__.keys() - attributes), frozenset(self._parts.keys() - parts)
        object.__setattr__(self, "_made", made if any(made) else NOTHING)

    def _forget(self) -> None:
        """Discard what `assemble` has made, so that it runs again: what it reads may have changed."""
        if self._connections is not None:
            attributes, parts = self._made
            for name in attributes:
                self.__dict__.pop(name, None)
            for name in parts:
                object.__setattr__(self._parts.pop(name), "_parent", None)  # assemble may assign the same part again
            object.__setattr__(self, "_connections", None)
            object.__setattr__(self, "_made", NOTHING)
        for part in self._parts.values():
            part._forget()

    def __getstate__(self) -> dict[str, Any]:
        """Pickle without the parts that `assemble` made; they are made again when needed."""
        if self._connections is None:
            return self.__dict__
        attributes, parts = self._made
        kept = {k: v for k, v in self.__dict__.items() if k not in attributes}
        own = {name: part for name, part in self._parts.items() if name not in parts}
        return kept | {"_parts": own, "_connections": None, "_made": NOTHING}

    def __copy__(self) -> Component:
        """As `deepcopy`: a part belongs to one component, so that a copy has parts of its own."""
        return deepcopy(self)

    def _symbol(self, local: str) -> Any:
        scope = _scope.get()
        if scope is self:
            return real_symbol(local)
        path = path_of(self, scope)
        return real_symbol(f"{path}.{local}" if path else local)

    def _parameter(self, name: str) -> Any:
        if _scope.get() is None:
            value = self._bindings.get(name, self._bindable[name].default)  # type: ignore[attr-defined]
            return None if value is NO_VALUE else value
        return self._symbol(name)

    def _radii(self) -> tuple[float, ...]:
        """Values of the parameters listed in the class's ``radii``; NaN for missing values."""
        names: Any = self.radii
        if not isinstance(names, (tuple, list)) or not all(isinstance(n, str) and n in self._bindable for n in names):
            raise DeclarationError(
                f"{type(self).__name__}.radii is {shown(names)}; expected a tuple of names of its parameters"
            )
        found = [self._number(name) for name in names]
        return tuple(np.nan if value is None else value for value in found)

    def _number(self, name: str) -> float | None:
        """Value of a parameter as given, by its default, or by the enclosing component."""
        declared: Any = self._bindable[name]
        if isinstance(declared, Structural):
            return float(self._structural[name])
        value, scope = self._bindings.get(name, NO_VALUE), self._parent
        if value is NO_VALUE:
            value, scope = declared.default, self
            if callable(value):
                with inside(self):
                    value = value(self)
        numbers = {}
        for symbol in getattr(value, "free_symbols", ()):
            owner, (*way, last) = scope, str(symbol).split(".")
            for part in way:
                owner = None if owner is None else parts_of(owner).get(part)
            found = None if owner is None or last not in owner._bindable else owner._number(last)
            if found is None:
                return None
            numbers[symbol] = found
        try:
            return float(as_number(value.subs(numbers) if numbers else value, name))
        except (DeclarationError, TypeError):  # not a number: none was given, or what is refused where the model is compiled
            return None

    def _choice(self, name: str) -> Any:
        self._read.add(name)
        return self._structural[name]

    def _port(self, connector: Connector) -> Port:
        if connector.when is not None and not self._structural[connector.when]:
            raise ConnectionError(
                f"{path_of(self) or type(self).__name__} has no '{connector.name}' here; make it with {connector.when}=True"
            )
        return Port(self, connector)

    def _as_given(self) -> PartGiven:
        return PartGiven(self._bindings, self._given, self._start, self._guess, self._nominal, self._state)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}{' ' + path_of(self) if path_of(self) else ''}>"


def no_component(given: Any) -> ModelError:
    """What to raise where something else was given for a component."""
    hint = f"; make an instance: {given.__name__}()" if isinstance(given, type) else ""
    return ModelError(f"expected a component, got {shown(given)}{hint}")


def reconnect(component: Component, connections: Sequence[Connection]) -> None:
    """Replace the connections of an assembled composite."""
    object.__setattr__(component, "_connections", list(connections))


def insert_part(component: Component, name: str, part: Component) -> None:
    """Add a part to an assembled composite, as if its ``assemble`` had made it."""
    setattr(component, name, part)
    attributes, parts = component._made
    object.__setattr__(component, "_made", (attributes | {name}, parts | {name}))


def name_of(component: Component) -> str:
    """Name of a part in its enclosing component."""
    name: str = component._name
    return name


def enclosing(component: Component) -> Iterator[Component]:
    """The enclosing components of a part, from the innermost outwards."""
    node = component._parent
    while node is not None:
        yield node
        node = node._parent


def changed(component: Component, change: Callable[[Component], None]) -> Component:
    """A copy with a callback applied whenever its parts have been made: ``change`` may add parts and reconnect them."""
    copy = deepcopy(component)
    copy._forget()
    object.__setattr__(copy, "_changes", (*copy._changes, change))
    copy._assembled()
    return copy


def given_to(component: Component) -> PartGiven:
    """Arguments given to an instance."""
    return component._as_given()


def evaluated_in(component: Component, value: Any) -> Any:
    """The value in a declaration; if it is a function of the component, its result."""
    if not callable(value) or isinstance(value, type) or value is NO_VALUE:
        return value
    with inside(component):
        return value(component)


def signals_of(component: Component) -> list[tuple[Any, ...]]:
    """The signal connections of a composite: symbols as seen from inside it."""
    found = [connection.signals for connection in component._assembled() if connection.signals]
    for name, part in parts_of(component).items():
        found += [(signal, real_symbol(f"{name}.{own}")) for signal, own in part._joined]
    return found


@reads_parts
def with_parts(component: Component, path: str = "") -> list[tuple[str, Component]]:
    """An assembled component and all of its parts, recursively, with their paths."""
    found = [(path, component)]
    for name, part in parts_of(component).items():
        found += with_parts(part, f"{path}.{name}" if path else name)
    return found


@contextmanager
def inside(component: Component) -> Iterator[None]:
    token = _scope.set(component)
    try:
        yield
    finally:
        _scope.reset(token)


@contextmanager
def reads_of(component: Component) -> Iterator[set[str]]:
    """Collect the structural choices read inside the block; they do not count as read by ``equations`` and ``assemble``."""
    before, reads = component._read, set[str]()
    object.__setattr__(component, "_read", reads)
    try:
        yield reads
    finally:
        object.__setattr__(component, "_read", before)


@contextmanager
def _explained(where: str) -> Iterator[None]:
    """Add the location to errors, and explain in modelling terms what Python's ``if`` and number functions cannot do with a symbol."""
    try:
        yield
    except DeclarationError as problem:
        raise DeclarationError(f"{where}: {problem}") from problem
    except RecursionError:
        raise DeclarationError(f"{where}: {TOO_DEEP}") from None
    except TypeError as problem:
        text = str(problem)
        if "truth value of Relational" in text:
            advice = "a condition between variables is not known yet; use gl.Piecewise((value, condition), (other, True)) instead of if"
        elif "expression to float" in text or "loop of ufunc" in text:
            advice = "functions of numbers cannot take variables; use gl.sin, gl.sqrt, ... instead of those of math or numpy"
        elif "'Port'" in text:
            advice = "a connector is not a variable; name one that it has, such as self.flange_a.phi"
        else:
            raise
        raise DeclarationError(f"{where}: {advice} ({text})") from None


def check_declarations(kind: type[Component]) -> None:
    """Refuse attributes that have replaced declarations since the class was made, which would otherwise be ignored silently.

    Raises
    ------
    DeclarationError
        Names the attribute.
    """
    bases = kind.__mro__[:-1]  # except object
    if kind._members and all(map(_has_members, bases, kind._members)):
        return
    now: dict[str, Any] = {}
    for base in reversed(bases):
        now.update((n, v) for n, v in vars(base).items() if n in kind._declarations or isinstance(v, Declaration))
    for name, value in now.items():
        declared = kind._declarations.get(name)
        if value is not declared:
            was = f"is {shown(value)} where {shown(declared)} was declared"
            what = was if declared else "was declared outside of a component class"
            raise DeclarationError(
                f"{kind.__name__}.{name} {what}; declare it in the body of the class, or again in a subclass of gl.Component"
            )
    kind._members[:] = [list(vars(base).values()) for base in bases]


def _has_members(base: type, members: list[Any]) -> bool:
    """Whether the members of a class are these very objects."""
    now = vars(base).values()
    return len(now) == len(members) and all(map(is_, now, members))


def _is_same(value: Any, choice: Any) -> bool:
    """Whether a value equals a choice; comparing a user's object may fail."""
    try:
        return bool(np.all(value == choice))
    except Exception:
        return False


def _is_readable(given: Any) -> bool:
    """Whether a value is a mapping; testing a user's object may fail."""
    try:
        return isinstance(given, Mapping) and dict(given) is not None
    except Exception:
        return False


def equations_of(component: Component) -> list[Eq | When]:
    """Equations of a component's class and its bases, on symbols named from the component's scope.

    Each class that defines ``equations`` is called once, bases first, in the order in which declarations are inherited.
    """
    equations: list[Eq | When] = []
    stated: dict[Eq, str] = {}  # and the class that states each
    owners = [o for o in reversed(type(component).__mro__) if "equations" in vars(o) and o is not Component]
    for owner in owners:
        own = _equations_by(owner, vars(owner)["equations"].__get__(component, type(component)), component)
        if len(owners) == 1:
            return own
        for equation in filter(_is_hashable, own):
            if stated.get(equation, owner.__name__) != owner.__name__:
                raise DeclarationError(
                    f"{owner.__name__}.equations() repeats {shown(equation.left)} = {shown(equation.right)} of its base "
                    f"{stated[equation]}; a class has its bases' equations anyway: return only what it adds, without super().equations()"
                )
            stated[equation] = owner.__name__
        equations += own
    return equations


def _is_hashable(equation: Eq | When) -> TypeGuard[Eq]:
    """Whether it is an equation between hashable expressions."""
    try:
        hash(equation)
    except Exception:  # a user's object may have a failing hash()
        return False
    return isinstance(equation, Eq)


def _equations_by(owner: type, write: Callable[[], Any], component: Component) -> list[Eq | When]:
    """The equations that one class adds to a component."""
    with inside(component), _explained(f"{owner.__name__}.equations()"):
        returned = write()
        equations = list(returned) if isinstance(returned, Iterable) else [returned]
    if not isinstance(returned, Iterable) or not all(isinstance(e, (Eq, When)) for e in equations):
        bad = next((e for e in equations if not isinstance(e, (Eq, When))), returned)
        raise DeclarationError(f"{owner.__name__}.equations() must return a list of gl.Eq(left, right); got {shown(bad)}")
    return equations


def energies_of(component: Component) -> Energy | None:
    """Energy declaration of `component`, on symbols named from its own scope."""
    with inside(component), _explained(f"{type(component).__name__}.energies()"):
        returned = component.energies()
    if returned is not None and not isinstance(returned, Energy):
        raise DeclarationError(
            f"{type(component).__name__}.energies() must return gl.Energy(stored=..., heat=...); got {shown(returned)}"
        )
    return returned
