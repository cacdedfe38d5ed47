"""Sampled controllers of a compiled model: their sample instants, the signals they read and the inputs they set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import is_real, shown
from gearlib.equations.quasipolynomials import OutsideClassError
from gearlib.equations.switch_times import instants, rounding
from gearlib.errors import ArgumentError, GearlibWarning, warn
from gearlib.language.component import Component, with_parts
from gearlib.language.delayed import Delayed
from gearlib.language.expressions import JustBefore
from gearlib.language.sampled import Sampled
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import needed_discretes, needed_states
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    from gearlib.run.sampling.delays import Delay

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Controller:
    """A sampled controller of a compiled model: the signals it reads, and the indices of the inputs it sets."""

    path: str
    part: Sampled
    reads: tuple[str, ...]
    gives: tuple[int, ...]

    def instants(self, t0: float, t1: float) -> list[float]:
        """Its sample instants in a closed interval."""
        same = rounding(t0, t1)
        try:
            times = instants(self.part.period, self.part.offset, t0 - same, t1 + same)
        except OutsideClassError as problem:
            raise ArgumentError(f"period of {self.path} is {self.part.period:g} s: from {t0:g} to {t1:g} s {problem}") from None
        found: list[float] = np.clip(times, t0, t1).tolist()
        return found

    def __call__(self, t: float, values: Floats) -> list[float]:
        """Return value of its function, as numbers."""
        called = f"the function of {self.path}, called at t = {t:.9g} s,"
        try:
            found = self.part.function(t, values)
        except Exception as problem:
            raise ArgumentError(f"{called} raised {type(problem).__name__}: {problem}") from problem
        numbers = list(np.ravel(found)) if isinstance(found, (np.ndarray, list, tuple)) else [found]
        if len(numbers) != len(self.gives) or not all(map(is_real, numbers)):
            expected = f"{len(self.gives)} finite number{'s' if len(self.gives) > 1 else ''}"
            raise ArgumentError(f"{called} returned {shown(found)}; expected {expected}")
        return [float(number) for number in numbers]


def controllers_of(component: Component, inputs: Sequence[str], parameters: Sequence[str]) -> tuple[Controller | Delay, ...]:
    """The sampled controllers and delays in a component, with the indices of their inputs among the unbound inputs."""
    found: list[Controller | Delay] = []
    for path, part in with_parts(component):
        if isinstance(part, Sampled):
            read, given = part.counts
            gives = tuple(inputs.index(f"{path}.outputs[{k}].u") for k in range(given))
            found.append(Controller(path, part, tuple(f"{path}.inputs[{k}].y" for k in range(read)), gives))
        elif isinstance(part, Delayed):
            from gearlib.run.sampling.delays import Delay

            head = f"{path}." if path else ""
            places = (inputs.index(f"{head}past"),)
            found.append(Delay(path or type(part).__name__, (f"{head}now",), places, parameters.index(f"{head}delay_time")))
    return tuple(found)


def read_by_controllers(component: Component) -> tuple[str, ...]:
    """Paths of the signals that the sampled controllers and delays in a component read."""
    found: list[str] = []
    for path, part in with_parts(component):
        if isinstance(part, Sampled):
            found += [f"{path}.inputs[{k}].y" for k in range(part.counts[0])]
        elif isinstance(part, Delayed):
            found += [f"{path}.{name}" if path else name for name in ("now", "total")]
    return tuple(found)


def refuse_controllers(component: Component, what: str) -> None:
    """Raise `ArgumentError` if a component has sampled controllers or delays, whose equations ``what`` does not know."""
    delays = ", ".join(path or type(part).__name__ for path, part in with_parts(component) if isinstance(part, Delayed))
    if delays:
        raise ArgumentError(
            f"{what} needs equations without a history, and {delays} delays a signal; put a rational approximation in its place, "
            "gearparts.blocks.PadeDelay(delay_time=..., n=3)"
        )
    refuse_programs(component, what)


def refuse_programs(component: Component, what: str) -> None:
    """Raise `ArgumentError` if a component has sampled controllers."""
    named = ", ".join(path for path, part in with_parts(component) if isinstance(part, Sampled))
    if named:
        raise ArgumentError(
            f"{what} needs equations, and {named} is a Python function (gl.Sampled); leave it out of the model, or put a block of "
            "gearparts.blocks in its place"
        )


def check_instants(structure: Structure, states: Sequence[Node], what: str, outputs: Sequence[Node] = ()) -> None:
    """Refuse what acts at single instants (`gl.sample`) if the rates of some states, or outputs, depend on it.

    Warn of values that other events hold.
    """
    model, given, held = structure.model, set[int](), dict[int, list[str]]()
    for update in model.updates:
        template, targets = update.equations.template, update.targets.tolist()
        if update.reinit:
            continue
        if template.residual.has(JustBefore):
            given.update(targets)
        for (j, k), target, row in (
            (c, *r) for c in template.local_columns for r in zip(targets, update.equations.variables, strict=True)
        ):
            if needed_states(structure, [(int(row[j]), k)]):
                held.setdefault(target, []).append(model.name(int(row[j])))
    if not given and not held:
        return
    needed = needed_discretes(structure, [*((v, k + 1) for v, k in states), *outputs])
    if acting := given.intersection(needed):
        paths = dict.fromkeys(model.discretes[k].rpartition(".")[0] or "the model" for k in sorted(acting))
        raise ArgumentError(
            f"{what} needs equations that act at all times, and {', '.join(paths)} acts at single instants (gl.sample): what it holds in "
            "between would never change; put a continuous block in its place, such as gearparts.blocks.LimPID, or simulate it"
        )
    if kept := [k for k in needed if k in held]:
        names = ", ".join(model.discretes[k] for k in kept)
        read = ", ".join(dict.fromkeys(name for k in kept for name in held[k]))
        warn(
            f"{what} takes {names} as constant, which events set from {read}: it holds as long as none does. If they come again and "
            "again, as those of a sampled controller, put a continuous block in its place, or simulate it",
            GearlibWarning,
        )
