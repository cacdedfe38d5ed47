"""`steady_state`: a system's steady operating point, with derivatives with respect to parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, name_list, one_name
from gearlib.errors import GearlibWarning, InputWarning, NameLookupError, nearest, warn
from gearlib.flatten.followers import products_in_time
from gearlib.flatten.time_means import held_in_time, in_words
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import operating_point
from gearlib.linear.poles import poles
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.reduce.coefficients import some
from gearlib.run.scene import needed_states
from gearlib.run.simulate import warn_of_zero_inputs
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled, Translation

Floats = NDArray[np.float64]
MOST_EXAMINED = 500  # states


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Values of variables in a steady state: nothing accelerates, and nothing changes that an equation depends on.

    Attributes
    ----------
    names : tuple of str
    values : array
    units : tuple of str
    """

    names: tuple[str, ...]
    values: Floats
    units: tuple[str, ...]
    _find_changes: Callable[[str], Floats]

    def __getitem__(self, name: str) -> float:
        """Value of a variable."""
        return float(self.values[self._place(name)])

    def sensitivity(self, name: str, parameter: str) -> float:
        """Derivative of a variable's steady value with respect to a parameter, by the implicit function theorem.

        Everything bound to the parameter changes with it; steadily growing states, such as angles, keep their start values.

        Parameters
        ----------
        name : str
            One of `names`.
        parameter : str
            Its path.

        Returns
        -------
        float
            In units of the variable per unit of the parameter.

        Raises
        ------
        ArgumentError, NameLookupError, StartError
            Unknown variable or parameter, or no derivative with respect to it; the message says why.
        """
        place = self._place(name)
        return float(self._find_changes(one_name("parameter", parameter, "brake.d"))[place])

    def _place(self, name: str) -> int:
        if one_name("name", name, "load.w") not in self.names:
            raise NameLookupError(f"the steady state was not asked for '{name}'; {nearest(name, self.names)}")
        return self.names.index(name)

    def __str__(self) -> str:
        width = max(map(len, self.names), default=0)
        return "\n".join(
            f"{n:{width}s}  {v:12.6g} {u}".rstrip() for n, v, u in zip(self.names, self.values, self.units, strict=True)
        )


def steady_state(
    system: Compiled, outputs: Sequence[str] | None = None, *, parameters: Mapping[str, float] | None = None,
    inputs: Mapping[str, Any] | None = None,
) -> SteadyState:  # fmt: skip
    """The steady state that the motion from the start values reaches, with its derivatives with respect to parameters.

    Where that motion reaches none (a self-excited vibration goes on for ever), it is one that exists; a warning tells that it is unstable.
    Where friction holds, or in an open gap, a train may rest in many places: the search follows its motion, and warns if that goes on.

    Parameters
    ----------
    system : System
    outputs : sequence of str, optional
        Variables; by default the outputs that the system was compiled for, or its states.
    parameters : mapping, optional
        Values by path.
    inputs : mapping, optional
        Values of unbound inputs, at time 0. What is bound to a function of time also counts with its value then, with a warning
        (`InputWarning`) unless that is its mean.

    Returns
    -------
    SteadyState

    Raises
    ------
    StartError
        There is none, or the search does not find it; the message says what keeps changing.
    ArgumentError, NameLookupError
        The message names what was found and what was expected.

    Examples
    --------
    A torque against a damper: w = tau / d.

    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
    ...         self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
    ...         links = [(self.torque.flange, self.load.flange_a), (self.load.flange_b, self.brake.flange_a)]
    ...         return [gl.connect(a, b) for a, b in [*links, (self.brake.flange_b, self.ground.flange)]]
    >>> found = gl.steady_state(gl.compile(Drive(), outputs=["load.w"]))
    >>> round(found["load.w"], 9), round(found.sensitivity("load.w", "brake.d"), 9)
    (6.0, -12.0)
    """
    general = translation_of(system)
    translation, _ = general.fitted(parameters)
    default = general.states if general.outputs is None else general.outputs
    names = tuple(name_list("outputs", default if outputs is None else outputs, "load.w"))
    given = by_name("inputs", inputs, "a mapping of paths to numbers, functions of time or tables", "torque.tau")
    known = [translation.structure.named(name, "output", ("cannot be an output", "can")) for name in names]
    nodes = [node for node, sign in known if sign]
    states = tuple(sorted({*translation.scene.states, *needed_states(translation.structure, nodes)}))
    scene, numbers, point = operating_point(translation, states, "steady", parameters, given, nodes)
    warn_of_zero_inputs(
        translation, tuple(n for n in translation.needed_inputs if n not in given), "this state", "steady_state"
    )
    _warn_of_time(translation, numbers)
    program = build(translation.structure, [*dict.fromkeys(nodes)], states, dynamic=True)
    at = LinearizedProgram(scene, prepare(program, translation.structure, numbers), point, tuple(range(len(states))))

    warn_of_instability(translation.name, at)

    def of(slots: Floats) -> Floats:
        return np.array([sign * slots[program.slots[node]] if sign else 0.0 for node, sign in known])

    return SteadyState(
        names, of(at.slots), tuple(translation.unit(n) for n in names), lambda name: of(at.slot_changes([name])[:, 0])
    )


def _warn_of_time(translation: Translation, numbers: Floats) -> None:
    """Warn of what changes with time, and is off its mean at time 0, also in products."""
    names = held_in_time(translation.structure.model, numbers, means=False)
    if names := names or products_in_time(translation.structure.model, numbers):
        warn(f"{translation.name}: {some(names, ', ')} {in_words(names)} in the steady state", InputWarning)


def warn_of_instability(name: str, at: LinearizedProgram) -> None:
    """Warn of a steady state that a run leaves, where it has no more than `MOST_EXAMINED` states."""
    states, slots = at.scene.states, at.prepared.program.slots
    if 0 < len(states) <= MOST_EXAMINED:
        found = poles(at.derivatives[[slots[v, k + 1] for v, k in states]])
        if found.right:
            warn(
                f"{name}: the steady state is unstable, a motion near it grows by a factor of e in {1 / found.values.real.max():.3g} s; "
                "a run from other states does not end there",
                GearlibWarning,
            )
