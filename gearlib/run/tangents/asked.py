"""The directions that names stand for: parameters with all that is bound to them, and start values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import name_list
from gearlib.errors import ArgumentError, GearlibError, NameLookupError, nearest
from gearlib.language.declarations import Structural
from gearlib.run.start_values import start_variable
from gearlib.run.tangents.directions import TangentDirections
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]


def directions(
    translation: Translation, names: Any, parameters: Floats, given: Collection[str], start: Any
) -> TangentDirections | None:
    """The directions that some names stand for; None where there are none.

    Parameters
    ----------
    translation : Translation
    names : sequence of str
        As a user gave them.
    parameters : array
        The complete table.
    given : collection of str
        Parameters that were given for this run, which do not follow from others.
    start : object
        As `System.simulate` takes it.

    Raises
    ------
    ArgumentError, NameLookupError
        Not a list of names, no such parameter or start value, or one that there is no derivative with respect to.
    """
    chosen = name_list("sensitivities", names, "shaft.c")
    if not chosen:
        return None
    twice = next((name for k, name in enumerate(chosen) if name in chosen[:k]), None)
    if twice is not None:
        raise ArgumentError(f"sensitivities names {twice!r} twice")
    model, table = translation.model, translation.model.parameters
    seeds: list[int] = []
    columns: list[int] = []
    starts: list[tuple[int, int, int]] = []
    sizes = np.ones(len(chosen))
    for k, name in enumerate(chosen):
        if name.startswith("start(") and name.endswith(")"):
            v = start_variable(model, name[len("start(") : -1])
            rep, sign = int(model.representative[v]), int(model.sign[v])
            if sign == 0:
                raise ArgumentError(f"sensitivities names {name!r}, and {name[6:-1]} is always zero")
            starts.append((rep, k, sign))
            sizes[k] = model.nominal[rep]
            continue
        seeds.append(_parameter(translation, name))
        columns.append(k)
        sizes[k] = abs(parameters[seeds[-1]]) or 1.0
    fixed = [table.index[name] for name in given if name in table.index]
    moved = [(p, columns[c], weight) for p, c, weight in table.derivatives(parameters, seeds, fixed) if weight != 0.0]
    put_in = {p for p, _ in translation.put_in}
    for p, k, _ in moved:
        if p in put_in:
            raise ArgumentError(
                f"sensitivities names {chosen[k]!r}, and {table.names[p]} = {parameters[p]:g} is put into the equations, which are others "
                "where it is another number: there is no derivative with respect to it; give it a small number"
            )
    own = start if isinstance(start, Mapping) else {}
    overridden = frozenset(int(model.representative[v]) for v in map(model.find, own) if v is not None)
    return TangentDirections(
        tuple(chosen), tuple((p, k) for p, k, _ in moved), np.array([weight for *_, weight in moved]), tuple(starts), overridden,
        sizes,
    )  # fmt: skip


def _parameter(translation: Translation, name: str) -> int:
    """The entry of the table that a name stands for."""
    model, table = translation.model, translation.model.parameters
    found = table.index.get(name)
    if found is not None and "#" not in name:
        return found
    valid = [n for n in table.names if "#" not in n and not n.startswith("start(")]
    if _is_choice(translation, name):
        raise NameLookupError(
            f"sensitivities names {name!r}, a structural choice: the equations are others with another value, and there is no derivative "
            f"with respect to it; {nearest(name, valid)}"
        )
    if model.find(model.column(name)[0]) is not None:
        base = model.column(name)[0]
        what = (
            f"an input; a run is differentiated with respect to parameters: bind {base} to an expression of one"
            if base in translation.inputs
            else f"a variable; with respect to its start value write 'start({base})'"
        )
        raise NameLookupError(f"sensitivities names {name!r}, {what}")
    raise NameLookupError(f"the model has no parameter {name!r} to differentiate with respect to; {nearest(name, valid)}")


def _is_choice(translation: Translation, name: str) -> bool:
    """Whether a path is that of a structural choice."""
    path, _, local = name.rpartition(".")
    owner: Any = translation.component
    for step in filter(None, path.replace("[", ".").replace("]", "").split(".")):
        try:
            owner = owner[int(step)] if step.isdigit() else getattr(owner, step)
        except (GearlibError, AttributeError, LookupError, TypeError):
            return False
    return isinstance(getattr(type(owner), local, None), Structural)
