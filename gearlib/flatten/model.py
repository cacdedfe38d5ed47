"""`FlatModel`: the flat equations of a component tree, as index arrays, names and parameter values."""

from __future__ import annotations

import hashlib
import math
import re
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.equations.bindings import parameter_function
from gearlib.equations.class_record import ClassRecord
from gearlib.equations.kernel import Kernel, differentiated, scalar_source
from gearlib.equations.template import Column, Template, columns_among, parse_column
from gearlib.errors import NameLookupError, nearest
from gearlib.language.declarations import Declared, Variable
from gearlib.language.units import NONE, dimension
from gearlib.recent import recent

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]
NUMBERS = re.compile(r"([0-9]+)")
MOST_AFFECTED = 64  # cached sets of dependents, by the sets of given parameters


def alphabetical(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key for names by which ``body[10]`` follows ``body[9]``.

    >>> sorted(["body[10].w", "body[9].w", "axle"], key=alphabetical)
    ['axle', 'body[9].w', 'body[10].w']
    """
    return tuple([(1, int(part), part) if part.isdigit() else (0, 0, part) for part in NUMBERS.split(name) if part])


class Instance(NamedTuple):
    """An instance of a class: its path, the record of its class, and its first variable and parameter numbers."""

    path: str
    kind: str  # class name
    record: ClassRecord
    first_variable: int
    first_parameter: int

    @property
    def name(self) -> str:
        """Its path; of the model itself, which has none, the name of its class."""
        return self.path or self.kind

    @property
    def declared(self) -> Declared:
        return self.record.declared

    def variable(self, name: str) -> int:
        """Number of one of its variables, by its local name."""
        return self.first_variable + self.record.variable_index[name]

    def parameter(self, name: str) -> int:
        """Number of one of its parameters, by its local name."""
        return self.first_parameter + self.record.parameter_index[name]


@dataclass(frozen=True)
class EquationGroup:
    """All equations that share a template, one per row.

    ``variables[i, j]`` is the variable that local j stands for, times ``signs[i, j]`` (+1, -1, or 0 if it is identically zero). While a
    model is flattened, any variables stand there; in a `FlatModel` representatives of those that are equal.
    """

    template: Template
    variables: Integers
    signs: Integers
    parameters: Integers
    owners: Integers  # number of the instance that each row comes from
    discretes: Integers  # indices of the discrete names in the discrete state, see `FlatModel`

    def __len__(self) -> int:
        return len(self.variables)

    @cached_property
    def lists(self) -> tuple[list[list[int]], list[list[int]]]:
        """Variables and signs as lists, which are read faster one by one."""
        return self.variables.tolist(), self.signs.tolist()

    @cached_property
    def nodes(self) -> list[list[tuple[int, int]]]:
        """Variables and derivative orders in each equation. (No variable occurs twice, see `gearlib.flatten.specialise`.)"""
        template = self.template
        if not template.columns:
            return [[] for _ in range(len(self))]
        parts = [[(v, order) for v in self.variables[:, j].tolist()] for j, order in template.local_columns]
        rows = [list(r) for r in zip(*parts, strict=True)]
        for i in np.flatnonzero((self.signs == 0).any(axis=1)).tolist():
            rows[i] = [node for node, (j, _) in zip(rows[i], template.local_columns, strict=True) if self.signs[i, j]]
        return rows

    def take(self, rows: Integers, template: Template) -> EquationGroup:
        """Some of the rows, with another template over a part of the same locals, parameters and discrete variables."""
        own = self.template
        columns, parameters, discretes = (
            [known.index(name) for name in wanted]
            for known, wanted in (
                (own.locals, template.locals), (own.parameters, template.parameters), (own.discretes, template.discretes),
            )
        )  # fmt: skip
        return EquationGroup(
            template, self.variables[rows][:, columns], self.signs[rows][:, columns], self.parameters[rows][:, parameters],
            self.owners[rows], self.discretes[rows][:, discretes],
        )  # fmt: skip

    def values(
        self,
        kernel: Kernel,
        t: float,
        argument: Callable[[str, int], Floats],
        parameters: Floats,
        flag: Callable[[int], Floats],
    ) -> Floats:
        """Values of a kernel of the template, one for each row.

        ``argument`` gives what stands for a derivative of a local, ``flag`` what stands for a relation or a discrete variable.
        """
        template = kernel.template
        columns = [*template.columns, *template.relation_columns]
        arguments = [argument(*columns[c]) for c in kernel.columns]
        constants = [parameters[self.parameters[:, p]] for p in kernel.parameters]
        with np.errstate(all="ignore"):
            value = np.asarray(kernel.function(t, *arguments, *constants, *map(flag, kernel.relations)), float)
        return value if value.shape == (len(self),) else np.broadcast_to(value, (len(self),))


@dataclass(frozen=True)
class Dependent:
    """Parameters that are computed by the same function of other parameters."""

    expression: Any  # over a0, a1, ...
    arguments: Integers  # (instances, arguments)
    targets: Integers  # (instances,)

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(f"a{i}" for i in range(self.arguments.shape[1]))

    @cached_property
    def function(self) -> Callable[..., Any]:
        """The vectorised function of its arguments."""
        return parameter_function(self.expression, self._names)

    @property
    def scalar(self) -> str:
        """Source of the function for scalars a0, a1, ..."""
        return scalar_source(self.expression)

    @cached_property
    def derivatives(self) -> list[Callable[..., Any]]:
        """Its partial derivative with respect to each argument."""
        return [parameter_function(self.expression, self._names, name) for name in self._names]


@dataclass(frozen=True)
class ParameterTable:
    """All parameters: independent values, and those computed from them."""

    names: tuple[str, ...]
    values: Floats  # defaults; NaN where dependent
    dependents: tuple[Dependent, ...]  # sorted so that arguments come first
    lower: Floats
    upper: Floats
    written: frozenset[int]  # numbers in expressions that inputs are bound to, which have no name of their own, and
    starts: frozenset[int]  # start values: neither is a parameter that a component declares
    _affected: dict[tuple[int, ...], tuple[Dependent, ...]] = field(default_factory=dict)

    @cached_property
    def index(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def finite_bounds(self) -> tuple[Floats, Floats]:
        """The bounds, where none is given the largest numbers: what lies between them is finite."""
        largest = np.finfo(float).max
        return np.maximum(self.lower, -largest), np.minimum(self.upper, largest)

    def within_bounds(self, values: Floats, given: Mapping[int, float] | None = None) -> bool:
        """Whether a complete vector is within its bounds, and finite; given: if `evaluate` has returned it, and defaults are."""
        least, most = self.finite_bounds
        if given is not None and not self._affected.get(tuple(given), True):  # nothing else has changed
            return all(least[k] <= value <= most[k] for k, value in given.items())
        return bool(np.logical_and.reduce((values >= least) & (values <= most)))

    @cached_property
    def own(self) -> tuple[int, ...]:
        """Those that components declare, and inputs that are bound to a number."""
        return tuple(i for i in range(len(self.names)) if i not in self.written and i not in self.starts)

    @property
    def own_names(self) -> list[str]:
        return [self.names[i] for i in self.own]

    def number(self, name: str, purpose: str = "") -> int:
        """The number of a parameter.

        Raises
        ------
        NameLookupError
            There is no such parameter; ``purpose`` says what it was named for.
        """
        if name not in self.index:
            raise NameLookupError(f"the model has no parameter '{name}'{purpose}; {nearest(name, self.own_names)}")
        return self.index[name]

    @cached_property
    def defaults(self) -> Floats:
        """The complete vector of default values. Read-only."""
        return self._computed(self.values, self.dependents, [])

    def evaluate(self, given: Mapping[int, float]) -> Floats:
        """The complete vector for given values; dependents are recomputed unless they are given themselves."""
        if not given:
            return self.defaults.copy()
        values = self.defaults.copy()
        for k, value in given.items():
            values[k] = value
        changed = tuple(given)
        affected = recent(self._affected, changed, lambda: self._depending_on(changed), MOST_AFFECTED)
        return self._computed(values, affected, list(changed)) if affected else values

    def evaluate_many(self, given: Mapping[int, float | Floats], count: int) -> Floats:
        """The complete vectors of many runs, shape (parameters, runs), with some numbers given; what is given differs from run to run."""
        values = np.repeat(self.defaults[:, None], count, axis=1)
        for k, value in given.items():
            values[k] = value
        return self._computed(values, self._depending_on(tuple(given)), list(given))

    def derivatives(self, values: Floats, seeds: Sequence[int], given: Collection[int] = ()) -> list[tuple[int, int, float]]:
        """Derivatives of parameters with respect to some of them, themselves included: (parameter, index of the seed, derivative).

        Parameters
        ----------
        values : array
            The complete vector, as `evaluate` returns it.
        seeds : sequence of int
            Parameters to differentiate with respect to.
        given : collection of int
            Those given to `evaluate`, which are independent of others.
        """
        fixed = {*seeds, *given}
        rows: dict[int, dict[int, float]] = {p: {k: 1.0} for k, p in enumerate(seeds)}
        for d in self._depending_on(tuple(seeds)):
            with np.errstate(all="ignore"):
                found = [derivative(*values[d.arguments.T]) for derivative in d.derivatives]
            slopes = [np.broadcast_to(np.asarray(f, float), len(d.targets)).tolist() for f in found]
            for r, (target, arguments) in enumerate(zip(d.targets.tolist(), d.arguments.tolist(), strict=True)):
                if target in fixed:
                    continue
                row = rows[target] = {}
                for slope, argument in zip(slopes, arguments, strict=True):
                    for k, weight in rows.get(argument, {}).items():
                        row[k] = row.get(k, 0.0) + slope[r] * weight
        return [(p, k, weight) for p, row in rows.items() for k, weight in row.items()]

    @staticmethod
    def _computed(values: Floats, dependents: Sequence[Dependent], given: list[int]) -> Floats:
        result = values.copy()
        with np.errstate(all="ignore"):
            for d in dependents:
                result[d.targets] = d.function(*result[d.arguments.T])
                if given:
                    result[given] = values[given]
        return result

    def _depending_on(self, changed: tuple[int, ...]) -> tuple[Dependent, ...]:
        reached = np.zeros(len(self.values), bool)
        reached[list(changed)] = True
        found = []
        for d in self.dependents:
            rows = reached[d.arguments].any(axis=1)
            if rows.any():
                found.append(Dependent(d.expression, d.arguments[rows], d.targets[rows]))
                reached[d.targets[rows]] = True
        return tuple(found)


@dataclass(frozen=True)
class UpdateGroup:
    """Equations of discrete variables, or new values of states (``reinit``), that share a template."""

    equations: EquationGroup
    targets: Integers  # discrete variables, or variables
    reinit: bool


@dataclass(frozen=True)
class FlatModel:
    """Flat equations over representative variables.

    Of n variables that change at events only (discretes), the discrete values are laid out so: d is variable d, n + d is pre(d), 2 n is
    initial(), which is 1 while the run is being started.
    """

    instances: tuple[Instance, ...]
    groups: tuple[EquationGroup, ...]
    parameters: ParameterTable
    started: Integers  # variables with a start value,
    start_slots: Integers  # its position among the parameters,
    start_fixed: NDArray[np.bool_]  # and whether it is fixed
    inputs: Integers  # unbound inputs
    representative: Integers  # of each variable
    sign: Integers  # variable = sign * representative; 0: identically zero
    preference: Integers  # of each representative as a state: 0 never, 1 avoid, 2 default, 3 prefer
    potential: NDArray[np.bool_]  # absolute coordinates
    flow: NDArray[np.bool_]
    nominal: Floats
    auxiliary: int  # first of the auxiliary variables added by flattening
    redundant: int  # redundant equalities found
    n_equations: int  # before aliases were removed, and
    n_aliases: int  # how many of them these were
    n_connection_sets: int
    discretes: tuple[str, ...]  # variables that change at events only,
    discrete_starts: Floats  # their start values,
    updates: tuple[UpdateGroup, ...]  # and their equations
    loose_ports: tuple[tuple[int, str], ...] = ()  # instance and connector, for messages: connected to nothing outside,
    inner_ports: tuple[tuple[int, str], ...] = ()  # or to parts inside
    closed: tuple[int, ...] = ()  # flows set to zero since nothing determines them

    @cached_property
    def digest(self) -> str:
        """Digest of names, values and equations, also those at events and of parameters: the same in every process."""
        table, found = self.parameters, hashlib.sha256()

        def tell(*values: Any) -> None:
            found.update(b"".join(v.tobytes() if isinstance(v, np.ndarray) else repr(v).encode() + b"\0" for v in values))

        tell([i[:2] for i in self.instances], table.names, self.discretes, table.defaults, table.lower, table.upper)
        tell(self.started, self.start_slots, self.start_fixed, self.inputs, self.representative, self.sign, self.nominal)
        tell(self.preference, self.discrete_starts)
        for group in (*self.groups, *(update.equations for update in self.updates)):
            template = group.template
            relations = [(str(r.g), r.strict, r.negated, r.last) for r in template.relations]
            tell(template.label, str(template.residual), relations)
            tell(group.variables, group.signs, group.parameters, group.discretes)
        for update in self.updates:
            tell(update.targets, update.reinit)
        for d in table.dependents:
            tell(str(d.expression), d.arguments, d.targets)
        return found.hexdigest()

    @property
    def n_variables(self) -> int:
        return len(self.representative)

    @cached_property
    def places(self) -> list[tuple[int, int]]:
        """Group and row of each equation."""
        return [(g, i) for g, group in enumerate(self.groups) for i in range(len(group))]

    @cached_property
    def first_equations(self) -> list[int]:
        """Number of each group's first equation."""
        return list(accumulate(map(len, self.groups), initial=0))

    @cached_property
    def rows(self) -> list[list[tuple[int, int]]]:
        """Variables and derivative orders in each equation."""
        return [row for group in self.groups for row in group.nodes]

    def nodes(self, e: int, k: int) -> list[tuple[int, int]]:
        """Variables and derivative orders in the k-th derivative of equation e."""
        if k == 0:
            return self.rows[e]
        g, i = self.places[e]
        group = self.groups[g]
        if group.template.linear:
            return [(v, order + k) for v, order in self.rows[e]]
        variables, signs = group.lists
        columns = columns_among(differentiated(group.template, k), group.template.locals)
        return list(dict.fromkeys((variables[i][j], order) for j, order in columns if signs[i][j]))

    @cached_property
    def assignments(self) -> list[list[tuple[EquationGroup, int]]]:
        """Per discrete variable: the equations that give it its value at events, each as a group and a row."""
        found: list[list[tuple[EquationGroup, int]]] = [[] for _ in self.discretes]
        for update in self.updates:
            for i, d in enumerate([] if update.reinit else update.targets.tolist()):
                found[d].append((update.equations, i))
        return found

    @cached_property
    def _firsts(self) -> list[int]:
        return [i.first_variable for i in self.instances]

    @cached_property
    def _by_path(self) -> dict[str, int]:
        return {instance.path: i for i, instance in enumerate(self.instances)}

    @cached_property
    def ranks(self) -> list[int]:
        """Rank of each representative by path, the deepest first, then alphabetically, independent of the order of declaration.

        Among aliases the highest rank counts, since which of them is the representative depends on the order of declaration.
        """
        paths = [instance.path for instance in self.instances]
        by_path = sorted(range(len(paths)), key=lambda k: (-paths[k].count("."), alphabetical(paths[k])))
        counts = np.array([len(instance.declared.variables) for instance in self.instances])
        shifts = np.empty(len(paths), np.int64)  # from the number of a variable to its place
        shifts[by_path] = np.cumsum(counts[by_path]) - counts[by_path]
        own = np.arange(len(self.representative))
        own[: self.auxiliary] += np.repeat(shifts - self._firsts, counts)
        found = np.full(len(self.representative), -1)
        moving = self.sign != 0
        np.maximum.at(found, self.representative[moving], own[moving])
        result: list[int] = found.tolist()
        return result

    def name(self, variable: int) -> str:
        """Path of a variable."""
        if variable >= self.auxiliary:
            return f"{'flow_' * bool(self.flow[variable])}sum[{variable - self.auxiliary}]"
        instance = self.instances[bisect_right(self._firsts, variable) - 1]
        local = list(instance.declared.variables)[variable - instance.first_variable]
        return f"{instance.path}.{local}" if instance.path else local

    def declaration(self, variable: int) -> Variable | None:
        if variable >= self.auxiliary:
            return None
        instance = self.instances[bisect_right(self._firsts, variable) - 1]
        return list(instance.declared.variables.values())[variable - instance.first_variable]

    def unit(self, variable: int) -> str:
        """Declared unit of a variable; empty if it has none."""
        declared = self.declaration(variable)
        return "" if declared is None else declared.unit

    @cached_property
    def exponents(self) -> Floats:
        """Exponents of the base units in the units of all variables, shape (variables, base units); NaN where the unit is not known."""
        units = [d.unit for instance in self.instances for d in instance.declared.variables.values()]
        known = {unit: dimension(unit) for unit in {*units, "any"}}
        every = [known[unit] for unit in [*units, *["any"] * (self.n_variables - len(units))]]
        return np.array([[math.nan] * len(NONE) if d is None else d for d in every], float).reshape(len(every), len(NONE))

    def variable(self, name: str, what: str = "variable") -> int:
        """Number of the variable with a path."""
        if not isinstance(name, str):
            raise NameLookupError(f"{shown(name)} is not a name; names are strings, such as 'load.w'")
        found = self.find(name)
        if found is None:
            head = name.rpartition(".")[0]
            near = self._by_path.get(head)
            valid = [] if near is None else [*self._names_of(self.instances[near])]
            if name in self._by_path and name:
                inner = list(self._names_of(self.instances[self._by_path[name]]))
                raise NameLookupError(f"'{name}' is a component, no {what}; name one of its variables: {', '.join(inner[:12])}")
            raise NameLookupError(f"the model has no {what} '{name}'; {nearest(name, valid or self.names())}")
        return found

    def same_names(self, other: FlatModel) -> bool:
        """Whether another model has the same variables, discrete variables and relations, so that their numbers are interchangeable."""
        return (
            self.n_relations == other.n_relations
            and self.discretes == other.discretes
            and list(self.names()) == list(other.names())
        )

    def column(self, name: str) -> Column:
        """The variable's path and derivative order that a name stands for: "der(load.w)", or "load.a"."""
        base, order = parse_column(name)
        path, _, local = base.rpartition(".")
        instance = self._by_path.get(path)
        if instance is not None and local in (known := self.instances[instance].declared.derivatives):
            inner, more = parse_column(known[local])
            return f"{path}.{inner}" if path else inner, order + more
        return base, order

    def find(self, name: str) -> int | None:
        """Number of the variable with a path, or None."""
        parts = name.split(".")
        for cut in range(len(parts) - 1, -1, -1):
            number = self._by_path.get(".".join(parts[:cut]))
            if number is not None:
                local, instance = ".".join(parts[cut:]), self.instances[number]
                if local in instance.declared.variables:
                    return instance.variable(local)
        return None

    def _names_of(self, instance: Instance) -> Iterator[str]:
        prefix = f"{instance.path}." if instance.path else ""
        return (prefix + local for local in instance.declared.variables)

    def names(self) -> Iterator[str]:
        """Paths of all variables, in order."""
        for instance in self.instances:
            yield from self._names_of(instance)

    @cached_property
    def bounded(self) -> tuple[tuple[int, float], ...]:
        """Variables with a declared minimum, and the minimum."""
        known: dict[int, list[tuple[int, float]]] = {}
        found = []
        for instance in self.instances:
            if id(instance.record) not in known:
                least = [(i, v.min) for i, v in enumerate(instance.declared.variables.values()) if v.min > -math.inf]
                known[id(instance.record)] = least
            found += [(instance.first_variable + i, least) for i, least in known[id(instance.record)]]
        return tuple(found)

    @cached_property
    def guessed(self) -> tuple[Integers, Integers, Integers]:
        """Representatives with a start or guess value, its sign, and its position among the parameters."""
        order = np.argsort(self.start_fixed, kind="stable")  # fixed ones last, so that they take precedence
        variables = self.started[order]
        return self.representative[variables], self.sign[variables], self.start_slots[order]

    @cached_property
    def fixed(self) -> tuple[Integers, Integers, Integers]:
        """The same, for fixed start values."""
        variables = self.started[self.start_fixed]
        return self.representative[variables], self.sign[variables], self.start_slots[self.start_fixed]

    @cached_property
    def fixed_once(self) -> bool:
        """Whether fixed start values cannot contradict each other: none is of the same variable as another one, or of none."""
        representatives, signs, _ = self.fixed
        return len(np.unique(representatives)) == len(representatives) and bool(signs.all())

    @cached_property
    def first_relations(self) -> Integers:
        """First relation number of each group, followed by the total; relations of updates come last."""
        groups = [*self.groups, *(u.equations for u in self.updates)]
        return np.cumsum([0, *(len(g.template.relations) * len(g) for g in groups)])

    @cached_property
    def n_relations(self) -> int:
        return int(self.first_relations[-1])

    @cached_property
    def n_discrete(self) -> int:
        """Number of relations and discrete values (see `FlatModel`)."""
        return self.n_relations + (2 * len(self.discretes) + 1 if len(self.discretes) else 0)

    def initial_discrete(self, starts: Floats | None = None) -> Floats:
        """The discrete state before anything is evaluated: relations false, discrete variables at their start values or those given."""
        discrete = np.zeros(self.n_discrete)
        n, d = self.n_relations, len(self.discretes)
        discrete[n : n + d] = discrete[n + d : n + 2 * d] = self.discrete_starts if starts is None else starts
        discrete[n + 2 * d :] = 1.0  # initial()
        return discrete

    def owner(self, group: int, row: int) -> str:
        """Path of the component that an equation comes from."""
        i = int(self.groups[group].owners[row])
        return self.instances[i].name if i >= 0 else "connection"

    def with_groups(self, groups: tuple[EquationGroup, ...], redundant: int) -> FlatModel:
        return replace(self, groups=groups, redundant=redundant)
