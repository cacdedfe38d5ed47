"""`Result`: the outcome of a run. Variables that were not integrated are computed from the states when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.evaluate import evaluate, prepare
from gearlib.codegen.modes import relations_of
from gearlib.codegen.program import Program
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.solve.scene import Scene, settle_once
from gearlib.solve.table import values
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]


class Result:
    """Time histories of one run.

    ``result["load.w"]`` is the history of a variable, ``result["der(load.w)"]`` that of its derivative, ``result.time`` the
    instants, ``result.stats`` what the solver did. Everything that the model holds can be asked for; what the run did not need is
    computed then, and an absolute angle that was not integrated is integrated then.
    """

    def __init__(
        self, scene: Scene, time: Floats, states: Floats, relations: Floats, parameters: Floats, signals: Sequence[Any],
        guess: Floats, stats: Mapping[str, Any], events: Sequence[Any], outputs: Sequence[str],
        again: Callable[[tuple[Node, ...]], Result],
    ) -> None:  # fmt: skip
        self.time = time
        self.stats = dict(stats)
        self.events = list(events)
        self._scene, self._states, self._relations = scene, states, relations
        self._parameters, self._signals, self._guess = parameters, signals, guess
        self._outputs, self._again = tuple(outputs), again
        self._known: dict[Node, Floats] = {}
        self._extended: Result | None = None

    def __getitem__(self, name: str) -> Floats:
        if name in self._scene.model.discretes.names:
            return self._discrete(name)
        node, sign = self._node(name)
        if sign == 0:
            return np.zeros_like(self.time)
        return sign * self._history(node)

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._scene.model.find(self._scene.model.column(name)[0]) is not None

    @property
    def states(self) -> Floats:
        """Histories of the integrated states, shape (samples, states)."""
        return self._states

    def _discrete(self, name: str) -> Floats:
        scene, model = self._scene, self._scene.model
        number = model.discretes.names.index(name)
        used = scene.relations
        place = model.n_relations + number
        if used is None or not any(place in b.targets for b in used.discretes):
            raise NameLookupError(f"the discrete variable {name} was not needed in this run; name it in outputs=[...]")
        return self._relations[:, place].copy()

    def _node(self, name: str) -> tuple[Node, int]:
        model = self._scene.model
        base, order = model.column(name)
        variable = model.variable(base)
        node = (int(model.representative[variable]), order)
        known = self._scene.structure.choice.solved_by
        state = node in self._scene.structure.dependence.is_state
        given = node[0] in self._scene.structure.dependence.given
        if not (state or node in known or given) and int(model.sign[variable]):
            raise NameLookupError(f"{name} does not occur in the model's equations, so it is not computed; {base} is")
        return node, int(model.sign[variable])

    def _history(self, node: Node) -> Floats:
        scene = self._scene
        if node in self._known:
            return self._known[node]
        if node in scene.place_of:
            found = self._states[:, scene.place_of[node]].copy()
        else:
            missing = scene.missing(node)
            if missing:
                if self._extended is None or any(s not in self._extended._scene.place_of for s in missing):
                    more = () if self._extended is None else self._extended._scene.states
                    self._extended = self._again(tuple(sorted({*scene.states, *more, *missing})))
                found = self._extended._history(node)
            else:
                found = self._compute(node)
        self._known[node] = found
        return found

    def _compute(self, node: Node) -> Floats:
        scene = self._scene
        program = scene.computing(node)
        prepared = prepare(program, scene.structure, self._parameters)
        inputs = values(self._signals, self.time)
        inputs = np.vstack([inputs, np.zeros((len(program.inputs) - len(inputs), len(self.time)))])
        modes = self._modes_for(program, inputs)
        slots = evaluate(prepared, self.time, self._states.T, inputs, modes, scene.guess(program, self._guess))
        for other, slot in program.slots.items():
            self._known.setdefault(other, slots[slot])
        return self._known[node]

    def _modes_for(self, program: Program, inputs: Floats) -> Floats:
        """The modes at all samples; relations that the run had no need of are evaluated here."""
        scene, model = self._scene, self._scene.model
        modes = self._relations.T
        if not scene.n_modes:
            return modes
        found = relations_of(scene.structure, program)
        tracked = np.empty(0, np.int64) if scene.relations is None else scene.relations.used
        held = {int(m) for b in found.discretes for m in b.targets}
        known = set() if scene.relations is None else {int(m) for b in scene.relations.discretes for m in b.targets}
        if held - known:
            names = ", ".join(model.discretes.names[m - model.n_relations] for m in sorted(held - known))
            raise NameLookupError(f"the discrete variables {names} were not needed in this run; name them in outputs=[...]")
        new = np.setdiff1d(found.used, tracked)
        if not len(new):
            return modes
        prepared = prepare(found.program, scene.structure, self._parameters)
        for _ in range(100):
            passed = settle_once(found, prepared, self.time, self._states.T, inputs, modes)
            if (passed[new] == modes[new]).all():
                break
            modes = modes.copy()
            modes[new] = passed[new]
        return modes

    def to_dataframe(self, names: Sequence[str] | None = None) -> pandas.DataFrame:
        """The outputs (or the variables named) as a pandas DataFrame over time."""
        import pandas

        chosen = list(names) if names is not None else list(self._outputs)
        return pandas.DataFrame({n: self[n] for n in chosen}, index=pandas.Index(self.time, name="time"))

    def plot(self, *names: str, axes: Any = None) -> Any:
        """Plot variables over time with matplotlib; returns the axes.

        Parameters
        ----------
        *names : str
            Variables; by default the outputs.
        axes : matplotlib Axes, optional
            To draw into.
        """
        import matplotlib.pyplot as plt

        chosen = names or self._outputs
        if not chosen:
            raise ArgumentError("plot() needs the names of variables")
        if axes is None:
            _, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
        units = []
        for name in chosen:
            axes.plot(self.time, self[name], label=name)
            base, order = self._scene.model.column(name)
            declared = self._scene.model.declaration(self._scene.model.variable(base))
            units.append("" if declared is None else declared.unit + "/s" * order)
        axes.set_xlabel("time, s")
        axes.set_ylabel(", ".join(dict.fromkeys(u for u in units if u)))
        axes.legend()
        axes.grid(alpha=0.3)
        return axes

    def __repr__(self) -> str:
        method = self.stats.get("method", "?")
        return f"<Result: {len(self.time)} samples, {self.time[0]:g} .. {self.time[-1]:g} s, {self._states.shape[1]} states, {method}>"
