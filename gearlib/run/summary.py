"""Text of `System.summary`: counts of each phase, the states and the reasons for their choice."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from gearlib.flatten.model import FlatModel
from gearlib.program.program import Linear, Newton
from gearlib.program.residual_form import ResidualForm
from gearlib.run.scene import Scene, node_name

MOST = 12  # names in a line


def summary(
    name: str, scene: Scene, outputs: tuple[str, ...] | None, free: Sequence[str], special: Sequence[str],
    inputs: Sequence[str], handed: ResidualForm | None = None, sums: int = 0,
) -> str:  # fmt: skip
    """A few lines per phase."""
    structure, model, program = scene.structure, scene.model, scene.program
    result = structure.differentiation
    n_equations = sum(len(g) for g in model.groups)
    differentiated = sum(1 for c in result.counts if c)
    states = [node_name(model, s) for s in scene.states]
    left = [node_name(model, s) for s in structure.states if s not in scene.states]
    blocks = [len(s.unknowns) for s in program.steps if isinstance(s, (Linear, Newton))]
    newton = sum(isinstance(s, Newton) for s in program.steps)
    lines = [
        f"{name}: {len(model.instances)} components, {model.n_connection_sets} connection sets",
        f"  flatten     {model.n_equations} equations in {model.n_variables} variables; {model.n_aliases} aliases removed, "
        f"{n_equations} equations left in {len({id(g.template) for g in model.groups})} templates",
        f"  reduce      structural index {result.index}; {differentiated} equations differentiated"
        + (f", up to {max(result.counts)} times" if differentiated else ""),
        f"  states      {len(structure.states)} possible, {len(states)} integrated: {_some(states)}",
    ]
    if left:
        why = "no output depends on them" if outputs is not None else "nothing depends on them; integrated when asked for"
        lines.append(f"  dropped     {_some(left)} ({why})")
    lines.append(
        f"  sort        {program.n_unknowns} unknowns in {len(program.steps)} steps"
        + (f"; blocks of {_some([str(b) for b in blocks])}" if blocks else "; no blocks")
        + (f" ({newton} nonlinear or varying)" if newton else "")
    )
    if structure.redundant or structure.closed:
        lines.append(
            f"  redundant   equations of {_some(list(structure.redundant)) or 'connections'} follow from others; the split of torque "
            f"is undetermined there, and set so that these are zero: {_some(list(structure.closed))}"
        )
    if special:
        lines.append(f"  zeros       translated with these values, at which a coefficient is zero: {_some(list(special))}")
    if sums:
        lines.append(f"  sums        {sums} in which the highest derivatives cancel, each in place of one of its equations")
    kind = "linear, time-invariant" if program.is_linear else "nonlinear, or with coefficients that vary"
    lines.append(f"  scene       {kind}; outputs: {_some(list(outputs)) if outputs is not None else 'everything, on demand'}")
    if inputs:
        lines.append(f"  inputs      0 unless a run is given them: {_some(list(inputs))}")
    if free:
        lines.append(f"  start       at their guess, since nothing fixes them: {_some(list(free))}")
    return "\n".join([*lines, *([] if handed is None else _unknowns(model, handed))])


def _unknowns(model: FlatModel, handed: ResidualForm) -> list[str]:
    """The unknowns that IDA is given, by name."""
    names = [node_name(model, node) for node in handed.unknowns]
    n, form = handed.n_states, "dae" if handed.implicit else "torn"
    index = 1 if len(names) > n else 0
    count = f"{len(names)} unknown{'s' if len(names) != 1 else ''} and as many equations"
    lines = [f"  {form:<11} {count}, of which {len(names) - n} are algebraic; index {index}"]
    for label, part in (("differential", names[:n]), ("algebraic", names[n:])):
        text = textwrap.wrap(", ".join(part) or "none", 110, break_long_words=False, break_on_hyphens=False)
        lines += [f"    {label if i == 0 else '':<13} {line}" for i, line in enumerate(text)]
    return lines


def _some(items: Sequence[str]) -> str:
    return ", ".join(items[:MOST]) + (f" and {len(items) - MOST} more" if len(items) > MOST else "")
