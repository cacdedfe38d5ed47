"""`compile` turns a component into a `System`; a system is simulated, linearised, and says what it is made of."""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import by_name, flag, name_list, real, shown
from gearlib.errors import ArgumentError, ModelError, NameLookupError, SingularError, nearest
from gearlib.flatten.flatten import check_bounds, flatten
from gearlib.flatten.model import FlatModel
from gearlib.language.component import Component
from gearlib.native.layout import Shared, lay_out
from gearlib.native.scene_functions import rhs_source
from gearlib.reduce.coefficients import numbers_of
from gearlib.reduce.reduction import Structure, analyse, confirm, discrete_nodes
from gearlib.reduce.rows import some
from gearlib.run.integrate import Run
from gearlib.run.jumps import refuse_jumps
from gearlib.run.limits import refuse_too_small
from gearlib.run.request import Request, absolute_tolerance, check_options, output_times
from gearlib.run.result import Result
from gearlib.run.scene import Numbers, Scene, needed_states, node_name
from gearlib.run.segment import Part
from gearlib.run.start_values import Start, start_values, start_variable
from gearlib.run.state_switching import Charts, integrate_through
from gearlib.run.steady import steady_state
from gearlib.run.summary import summary
from gearlib.run.zeros import can_be_solved, factors
from gearlib.solvers.inputs.table import Function, Table, values
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    from gearlib.run.energy_balance import EnergyBalance
    from gearlib.statics.power_flow import PowerFlow

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def compile(component: Component, outputs: Sequence[str] | None = None) -> System:
    """Flatten a component, reduce its index, choose its states.

    Parameters
    ----------
    component : Component
        The outermost one.
    outputs : sequence of str, optional
        Variables that are wanted. What none of them depends on is not computed. By default everything can be asked for later;
        absolute angles that nothing depends on are then integrated only if they are asked for.

    Returns
    -------
    System

    Raises
    ------
    ModelError
        Anything that is wrong with the model, by path.
    NameLookupError
        An output that the model does not have.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
    ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
    >>> system = gl.compile(Drive(), outputs=["load.w"])
    >>> system.states
    ('load.w',)
    >>> system.simulate(t_end=2.0, samples=3)["load.w"]
    array([0., 2., 4.])
    """
    chosen = None if outputs is None else tuple(name_list("outputs", outputs, "load.w"))
    return _compiled(component, chosen)


def _compiled(component: Component, outputs: tuple[str, ...] | None) -> System:
    """The system that fits the parameters' defaults."""
    model = flatten(component)
    variants = Variants(component, outputs, factors(model), model.parameters.names)
    defaults = model.parameters.defaults
    if variants.zeros(defaults):
        try:
            return variants.fitting(defaults)
        except SingularError:
            pass  # other parameters may be given for a run
    return variants.translated(frozenset(), defaults, model)


@dataclass(frozen=True)
class Variants:
    """The translations of one component, which differ by the parameters that are zero and left out of the equations."""

    component: Component
    outputs: tuple[str, ...] | None
    factors: Integers  # parameters that a variable is multiplied by
    names: tuple[str, ...]
    known: dict[frozenset[int], System] = field(default_factory=dict)  # by the parameters that are left out
    chosen: dict[frozenset[int], System] = field(default_factory=dict)  # by the factors that are zero

    def zeros(self, parameters: Floats) -> frozenset[int]:
        """The factors that are zero."""
        values = parameters[self.factors]
        return frozenset() if values.all() else frozenset(self.factors[values == 0.0].tolist())

    def translated(self, absent: frozenset[int], parameters: Floats, model: FlatModel | None = None) -> System:
        """The system without some parameters."""
        if absent not in self.known:
            model = model or flatten(self.component, absent)
            structure = analyse(model, numbers_of(model, parameters, 0.0))
            self.known[absent] = System(structure, self.outputs, self.component, self, absent)
        return self.known[absent]

    def fitting(self, parameters: Floats) -> System:
        """The translation that can be solved with these parameters: with all of them, or without those that are zero.

        Raises
        ------
        ModelError
            Neither can.
        """
        zero = self.zeros(parameters)
        if zero not in self.chosen:
            self.chosen[zero] = self._tried(zero, parameters)
        return self.chosen[zero]

    def _tried(self, zero: frozenset[int], parameters: Floats) -> System:
        if not zero:
            return self.translated(zero, parameters)
        try:
            system = self.translated(frozenset(), parameters)
            if can_be_solved(system._scene, parameters):
                return system
        except ModelError:
            pass  # not solved with the zeros in it: tried without
        try:
            system = self.translated(zero, parameters)
            system._scene.numbers(parameters)
        except ModelError as problem:
            raise SingularError(f"with {some(self.zero_names(zero))}: {problem}") from None
        return system

    def zero_names(self, absent: frozenset[int]) -> list[str]:
        """Parameters as ``body.J = 0``."""
        return [f"{self.names[p]} = 0" for p in sorted(absent)]


def simulate(component: Component, t_end: float, **options: Any) -> Result:
    """`compile` and `System.simulate` in one call; ``outputs`` goes to the first, all other options to the second.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Spin(gl.Component):
    ...     def assemble(self):
    ...         self.body = gp.Inertia(J=1.0, start={"w": 2.0})
    ...         return []
    >>> gl.simulate(Spin(), t_end=1.0, samples=2)["body.w"]
    array([2., 2.])
    """
    outputs = options.pop("outputs", None)
    return compile(component, outputs).simulate(t_end, **options)


class System:
    """A compiled model.

    Attributes
    ----------
    states : tuple of str
        What is integrated.
    outputs : tuple of str or None
        What was asked for.
    """

    def __init__(
        self, structure: Structure, outputs: tuple[str, ...] | None, component: Component, variants: Variants,
        absent: frozenset[int],
    ) -> None:  # fmt: skip
        self._structure = structure
        self._component = component
        self._variants = variants
        self._absent = absent
        self.outputs = outputs
        self.name = type(component).__name__
        model = structure.model
        if outputs is None:
            targets = [(v, k + 1) for v, k in structure.states if (v, k) not in structure.angles]
            discretes = list(range(len(model.discretes)))
            targets += [n for d in discretes for n in discrete_nodes(model, d)]
            wanted = [s for s in structure.states if s not in structure.angles]
            states = tuple(sorted({*wanted, *needed_states(structure, targets)}))
            computed: list[Node] = []
        else:
            discretes = [model.discretes.names.index(n) for n in outputs if n in model.discretes.names]
            nodes = self._nodes([n for n in outputs if n not in model.discretes.names])
            targets = [*nodes, *(n for d in discretes for n in discrete_nodes(model, d))]
            states = needed_states(structure, targets)
            computed = [n for n in dict.fromkeys(nodes) if n in structure.choice.solved_by and n not in states]
        self._scene = Scene(structure, states, tuple(discretes), tuple(computed))
        self._scenes: dict[tuple[Node, ...], Scene] = {states: self._scene}
        self._charts: Charts = {}
        self._numbers: dict[tuple[Node, ...], tuple[bytes, Numbers]] = {}
        self.states = tuple(node_name(model, s) for s in states)

    @property
    def _model(self) -> FlatModel:
        return self._structure.model

    def _node(self, name: str, what: str = "variable") -> Node:
        return self._structure.named(name, what, (f"cannot be an {what}", "can"))[0]

    def _nodes(self, outputs: Iterable[str]) -> list[Node]:
        """What has to be computed for some outputs: all but those that are always zero, as the torque of a free flange is."""
        named = [(n, self._node(n, "output")) for n in outputs]
        return [node for n, node in named if self._model.sign[self._model.variable(self._model.column(n)[0])] != 0]

    @property
    def variables(self) -> tuple[str, ...]:
        """Paths of all variables."""
        return tuple(self._model.names())

    @property
    def parameters(self) -> dict[str, float]:
        """Paths and default values of all parameters."""
        table = self._model.parameters
        return dict(zip(table.names, table.defaults.tolist(), strict=True))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Inputs that nothing is bound to."""
        return tuple(self._model.name(int(v)) for v in self._model.inputs)

    def summary(self) -> str:
        """What came in, what each phase did, and what is integrated."""
        parameters = self._parameters(None)
        free = self._start(self._scene, parameters, 0.0, None, [0.0] * len(self.inputs)).free
        return summary(self.name, self._scene, self.outputs, free, self._variants.zero_names(self._absent))

    @cached_property
    def source(self) -> str:
        """The generated source of the derivatives."""
        scene, names = self._scene, self._model.parameters.names
        shared = Shared(len(names), scene.n_modes, len(scene.program.inputs))
        return rhs_source(scene.program, lay_out(scene.program, shared, shared.size), lambda: scene.slot_names, names)[0]

    def simulate(
        self, t_end: float, *, t_start: float | None = None, samples: int | None = None, times: ArrayLike | None = None,
        method: str = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None, parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None, progress: bool = False,
        audit: bool = False,
    ) -> Result:  # fmt: skip
        """Integrate from ``t_start`` to ``t_end``.

        Parameters
        ----------
        t_end, t_start : float
            Interval, s. It begins at 0 unless given, or where a run that goes on had got to.
        samples : int, optional
            Number of equidistant output times (501).
        times : array, optional
            Output times instead, s, increasing, from ``t_start`` on or later.
        method : {"auto", "exact", "ida", "rk", "rk5", "rk8"}
            ``"exact"``: matrix exponential of a linear scene. ``"ida"``: SUNDIALS IDA. ``"rk"``: explicit Runge-Kutta, order by
            tolerance. ``"auto"`` picks, and ``result.stats`` says why.
        rtol : float
            Relative tolerance, 1e-13 .. 0.1.
        atol : float or array, optional
            Absolute tolerance of the states; by default ``rtol`` times their nominal values.
        parameters : mapping, optional
            Values for this run, by path.
        start : mapping, "steady", Result or (Result, float), optional
            Start values for this run, by path, of discrete variables, too; a search for a steady state; or a run that goes on from
            its last sample or from a time, with all of its state: integrated states, discrete variables, the modes of clutches
            and friction. Its parameters and inputs stay as well, unless ``parameters`` or ``inputs`` are given.
        inputs : mapping, optional
            Of unbound inputs: a number, a function of time, or a `Table`.
        max_step : float, optional
            Longest step, s. No event that lasts longer is stepped over, and no pulse. By default a hundredth of the run where there are
            comparisons of variables; where time drives the scene, that or two sample intervals, whichever is less.
        progress : bool
            Whether to print what is done.
        audit : bool
            Whether to check the run's energies at once: ``result.stats["energy_residual"]`` is the largest residual of
            `Result.energy_balance` over the energy that was exchanged, and a warning says if the tolerance does not explain it.

        Returns
        -------
        Result

        Raises
        ------
        ArgumentError, NameLookupError, BoundError, StartError, SolverError
            Each names what was found and what was expected.
        """
        earlier = self._earlier(start)
        t_start = real(
            "t_start", (earlier[1] if earlier else 0.0) if t_start is None else t_start, "a finite number of seconds"
        )
        t_end = real("t_end", t_end, "a finite number of seconds")
        grid = output_times(t_start, t_end, samples, times, len(self.states))
        check_options(method, rtol, max_step)
        show, audit = flag("progress", progress), flag("audit", audit)
        numbers = self._parameters(parameters) if parameters is not None or not earlier else earlier[0]._parameters
        fitting = self.fitting(numbers)
        if fitting is not self:
            return fitting.simulate(
                t_end, t_start=t_start, samples=samples, times=times, method=method, rtol=rtol, atol=atol, parameters=parameters,
                start=start, inputs=inputs, max_step=max_step, progress=progress, audit=audit,
            )  # fmt: skip
        signals = self._signals(inputs) if inputs is not None or not earlier else list(earlier[0]._signals)
        result = self._run(
            self._scene, Request(t_start, grid, method, float(rtol), atol, numbers, start, tuple(signals), show, max_step)
        )
        if audit:
            result.check_energy()
        return result

    def fitting(self, parameters: Mapping[str, float] | Floats | None, at: Any = None) -> System:
        """The translation of the same component that fits some parameters (or those of the run that ``at`` is a moment of).

        What is zero may decide which equation determines what (a body without inertia has no speed of its own), so that where a
        zero would be divided by the model is translated again, once for each set of zeros.
        """
        if parameters is None and isinstance(at, tuple) and len(at) == 2 and isinstance(at[0], Result):
            numbers = at[0]._parameters
        else:
            numbers = self._model.parameters.defaults
            if isinstance(parameters, np.ndarray) and parameters.shape == numbers.shape:
                numbers = parameters
            else:
                numbers = self._parameters(parameters)  # type: ignore[arg-type]
        if not self._absent and not self._variants.zeros(numbers):
            return self
        return self._variants.fitting(numbers)

    def _run(self, scene: Scene, asked: Request) -> Result:
        parameters, signals = asked.parameters, asked.signals
        numbers = self._prepared(scene, parameters)
        times = asked.times
        grid = times if times[0] == asked.t_start else np.concatenate([[asked.t_start], times])
        if self._structure.switching:
            refuse_jumps(self._structure, scene.program, parameters, float(grid[0]), float(grid[-1]))
        earlier = self._earlier(asked.start)
        if earlier:
            begin = earlier[0]._moment(scene, earlier[1])
        else:
            begin = self._start(scene, parameters, float(grid[0]), asked.start, signals, numbers, discrete=True)
        absolute = absolute_tolerance(asked.atol, len(scene.states))
        run = Run(scene, numbers, begin, signals, grid, asked.rtol, absolute, begin.modes, asked.max_step)
        if asked.progress:
            print(f"{self.name}: {len(scene.states)} states, {grid[0]:g} .. {grid[-1]:g} s, method {asked.method}")
        parts = integrate_through(run, asked.method, self._charts)
        if asked.progress:
            print(f"{self.name}: done with {parts[-1][1].stats['method']} in {sum(o.stats['seconds'] for _, o in parts):.3g} s")
        hidden = [len(grid) - len(times), *[0] * len(parts[1:])]  # the start, where it was not asked for
        found = [(Part.of(run, o, first), o.stats, o.events) for (run, o), first in zip(parts, hidden, strict=True)]
        asked = replace(asked, max_step=run.longest_step)  # a run that is done again takes the same steps
        refuse_too_small([part for part, _, _ in found], asked.rtol)
        return Result(found, self.outputs if self.outputs is not None else self.states, partial(self._again, asked))

    def _again(self, asked: Request, states: tuple[Node, ...], times: Floats | None = None) -> Result:
        """The same run with other states, or other times."""
        atol = asked.atol if states == self._scene.states or np.ndim(asked.atol) == 0 else None  # type: ignore[arg-type]
        return self._run(self._with(states), replace(asked, times=asked.times if times is None else times, atol=atol))

    def energy_balance(self, asked: Request, samples: Floats, events: Sequence[float]) -> EnergyBalance:
        """Of the run that was asked for; `Result.energy_balance` is what a user calls."""
        from gearlib.flatten.energies import audited
        from gearlib.run.audit import balance

        self._component._assembled()
        parts = audited(self._component)
        names = {n for p in parts for term in p.terms for n in term.names} - {"time", *self._model.parameters.index}
        discretes = sorted({self._model.discretes.names.index(n) for n in names if n in self._model.discretes.names})
        nodes: list[Node] = []
        for name in sorted(names):
            if name not in self._model.discretes.names:
                with suppress(NameLookupError):  # then the component is named as one of which nothing is known
                    node, sign = self._structure.named(name, "variable", ("is not computed", "is"))
                    nodes += [node] if sign else []
        targets = [*nodes, *(n for d in discretes for n in discrete_nodes(self._model, d))]
        states = tuple(sorted({*self._scene.states, *needed_states(self._structure, targets)}))
        computed = tuple(n for n in dict.fromkeys(nodes) if n in self._structure.choice.solved_by and n not in states)
        scene = Scene(self._structure, states, tuple(sorted({*self._scene.wanted, *discretes})), computed)
        atol = None if np.ndim(asked.atol or 0.0) else asked.atol
        table = self._model.parameters

        def run(times: Floats) -> Result:
            return self._run(scene, replace(asked, times=times, atol=atol, progress=False))

        values_of = dict(zip(table.names, asked.parameters.tolist(), strict=True))
        return balance(parts, samples, events, asked.rtol, run, values_of)

    def _with(self, states: tuple[Node, ...]) -> Scene:
        """The scene that integrates some states."""
        if states not in self._scenes:
            self._scenes[states] = Scene(self._structure, states, self._scene.wanted, self._scene.outputs)
        return self._scenes[states]

    def __reduce__(self) -> tuple[Any, ...]:
        return _compiled_again, (pickle.dumps((self._component, self.outputs)), self._absent)

    def linearize(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None, *, at: Any = None,
        parameters: Mapping[str, float] | None = None, sparse: bool = False,
    ) -> Any:  # fmt: skip
        """Linear model about an operating point, with exact derivatives.

        Parameters
        ----------
        inputs : sequence of str, optional
            Unbound inputs (all, by default); bound ones may be named too, their binding is the operating point.
        outputs : sequence of str, optional
            Variables; by default the system's outputs, or its states.
        at : None, "steady", mapping, or (Result, time)
            The start values, a steady state (absolute angles may grow), values of states by path, or a moment of a run, with its
            inputs and parameters. Unbound inputs are 0 in the first three; ``simulate(start="steady", inputs=...)`` gives a run
            that begins in the steady state under others.
        parameters : mapping, optional
            Values by path.
        sparse : bool
            Return a `LinearModel` instead, whose matrices are sparse where full ones would be large.

        Returns
        -------
        control.StateSpace
            With the states that the outputs need and the mode does not hold. States are named by path, inputs and outputs too, but
            with "_" for "." (``linear["load_w", "torque_tau"]``), since python-control refuses dots in names of signals.

        Raises
        ------
        NameLookupError, ArgumentError, StartError
            No such input or output, two with one name, or no steady state.
        """
        from gearlib.linear.condition import conditions
        from gearlib.linear.linearize import linearize, operating_point, state_space

        fitting = self.fitting(parameters, at)
        if fitting is not self:
            return fitting.linearize(inputs, outputs, at=at, parameters=parameters, sparse=sparse)
        default = self.outputs if self.outputs is not None else self.states
        chosen_inputs = name_list("inputs", self.inputs if inputs is None else inputs, "torque.tau")
        chosen = name_list("outputs", default if outputs is None else outputs, "load.w")
        states = needed_states(self._structure, self._nodes(chosen))
        scene, numbers, point = operating_point(self, states, at, parameters)
        model = linearize(scene, numbers, chosen_inputs, chosen, point)
        if flag("sparse", sparse):
            return replace(model, conditions=conditions(scene, numbers, point).said)
        return state_space(model, self.name)

    def power_flow(
        self, speeds: Mapping[str, float] | None = None, torques: Mapping[str, float] | None = None, *,
        parameters: Mapping[str, float] | None = None,
    ) -> PowerFlow:  # fmt: skip
        """Speeds, torques and powers when the train turns steadily, without a simulation: `gearlib.power_flow`."""
        from gearlib.statics.statics import power_flow

        return power_flow(self, speeds, torques, parameters=parameters)

    def _parameters(self, given: Mapping[str, float] | None) -> Floats:
        table = self._model.parameters
        given = by_name("parameters", given, "a mapping of paths to numbers", "load.J")
        if not given:
            return table.defaults
        chosen: dict[int, float] = {}
        for name, value in given.items():
            k = table.index.get(name)
            if k is None:
                valid = [n for n in table.names if "#" not in n and not n.startswith("start(")]
                raise NameLookupError(f"the model has no parameter '{name}'; {nearest(name, valid)}")
            if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (Real, np.integer, np.floating)):
                raise ArgumentError(f"parameter {name} is {shown(value)} ({type(value).__name__}); expected a number")
            chosen[k] = float(value) if isinstance(value, float) else real(f"parameter {name}", value)  # bounds: below
        result = table.evaluate(chosen)
        check_bounds(table, result)
        if self._structure.redundant:
            confirm(self._structure, numbers_of(self._structure.complete, result, 0.0))
        return result

    def _prepared(self, scene: Scene, parameters: Floats) -> Numbers:
        """The numbers of a scene, kept for the parameters that were last used."""
        key = parameters.tobytes()
        last = self._numbers.get(scene.states)
        if last is None or last[0] != key:
            last = (key, scene.numbers(parameters))
            self._numbers[scene.states] = last
        return last[1]

    def _signals(self, given: Mapping[str, Any] | None) -> list[Any]:
        names = self.inputs
        given = by_name("inputs", given, "a mapping of paths to numbers, functions of time or tables", "torque.tau")
        for name, value in given.items():
            if name not in names:
                bound = self._model.find(name) is not None
                hint = "it is bound in the model, or no input" if bound else nearest(name, names)
                raise NameLookupError(f"the model has no unbound input '{name}'; {hint}")
            if not (isinstance(value, Table) or callable(value)):
                given[name] = real(f"input {name}", value, "a finite number, a function of time or a gl.Table")
        signals = [given.get(name, 0.0) for name in names]
        plain = [callable(signal) and not isinstance(signal, Table) for signal in signals]
        return [Function(name, s) if function else s for name, s, function in zip(names, signals, plain, strict=True)]

    def _earlier(self, start: Any) -> tuple[Result, float] | None:
        """The run that goes on, and from when; None where none does."""
        if isinstance(start, Result):
            start = (start, float(start.time[-1]))
        if not (isinstance(start, tuple) and len(start) == 2 and isinstance(start[0], Result)):
            return None
        result, t = start[0], real("the time of start=(result, time)", start[1], "a finite number of seconds")
        theirs, ours = result._scene.structure, self._structure
        variant = any(theirs is system._structure for system in self._variants.known.values())
        if not (theirs is ours or variant or (theirs.states == ours.states and theirs.model.same_names(ours.model))):
            raise ArgumentError(
                f"start is a run of another system than {self.name}; a run goes on with the system that made it"
            )
        if not result.time[0] <= t <= result.time[-1]:
            raise ArgumentError(f"start names the time {t:g} s; the run goes from {result.time[0]:g} to {result.time[-1]:g} s")
        return result, float(t)

    def _start(
        self, scene: Scene, parameters: Floats, t: float, start: Any, signals: Sequence[Any], numbers: Numbers | None = None,
        discrete: bool = False,
    ) -> Start:  # fmt: skip
        """Start values; with ``discrete``, those of discrete variables may be among them."""
        overrides: dict[int, float] = {}
        discretes, known = None, self._model.discretes
        if not (start is None or isinstance(start, Mapping) or (isinstance(start, str) and start == "steady")):
            raise ArgumentError(
                f"start is {shown(start)}; expected a mapping of start values, 'steady', a result, or (result, time)"
            )
        if isinstance(start, Mapping):
            for name, value in by_name("start", start, "a mapping of paths to start values").items():
                if discrete and name in known.names:
                    discretes = known.starts.copy() if discretes is None else discretes
                    discretes[known.names.index(name)] = real(f"start of {name}", value)
                else:
                    overrides[start_variable(self._model, name)] = real(f"start of {name}", value)
        inputs = values(signals, np.array([t]))[:, 0]
        inputs = np.concatenate([inputs, np.zeros(len(scene.program.inputs) - len(inputs))])
        begin = start_values(scene, parameters, inputs, t, overrides, discretes)
        if start == "steady":
            steady = steady_state(scene, numbers or self._prepared(scene, parameters), begin, inputs, t)
            return Start(steady, begin.guess, (), steady=True)
        if discretes is None:
            return begin
        prepared = numbers or self._prepared(scene, parameters)
        modes = scene.modes(prepared, np.array([t]), begin.states[:, None], inputs[:, None], discretes, begin.guess)
        return replace(begin, modes=modes[:, 0])

    def __repr__(self) -> str:
        return f"<System {self.name}: {len(self.states)} states>"


@lru_cache(maxsize=16)
def _compiled_again(recipe: bytes, absent: frozenset[int]) -> System:
    """A system in another process, or of a copy: compiled once for all results that come from there."""
    component, outputs = pickle.loads(recipe)
    system = compile(component, outputs)
    if system._absent == absent:
        return system
    numbers = system._model.parameters.defaults.copy()
    numbers[list(absent)] = 0.0
    return system._variants.translated(absent, numbers)
