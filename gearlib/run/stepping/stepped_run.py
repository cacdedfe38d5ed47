"""Runs advanced from outside, step by step: watched, controlled in closed loop, stopped and restored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import real, shown
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.program.interpret import Prepared
from gearlib.run.methods.method import Method
from gearlib.run.methods.method_table import BY_TURNS, method_of
from gearlib.run.methods.native_problem import begun_at_instants
from gearlib.run.methods.run import Run
from gearlib.run.refusals.limits import refuse_too_small
from gearlib.run.request import LONGEST, SHORTEST, absolute_tolerance
from gearlib.run.sampling.instants import begun_with, given_before, integrate_sampled
from gearlib.run.scene import Scene
from gearlib.run.segment import Segment
from gearlib.run.simulate import earlier_run
from gearlib.run.start_values import Start
from gearlib.run.state_switching import integrate_through
from gearlib.run.stepping.live_run import LiveRun, can_live
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import unrolled

Floats = NDArray[np.float64]
RESOLVED = 1e-13  # of time: a limit below it would be a step too small; a call may advance by less, the rounding of time


@dataclass(frozen=True, eq=False)
class Moment:
    """Complete state of a run: returned by `SteppedRun.state`, accepted by `SteppedRun.restore`.

    Attributes
    ----------
    t : float
        s.
    states : array
        Integrated states, in the order of ``scene.state_names``.
    """

    t: float
    states: Floats
    discrete: Floats | None  # relations and discrete variables, with their values before the last event
    guess: Floats  # initial guess of the iterations
    scene: Scene
    numbers: Prepared
    atol: Floats | None
    signals: tuple[Any, ...]
    n_events: int


class Inputs(MutableMapping[str, Any]):
    """Unbound inputs of a stepped run, by path: numbers, functions of time, or tables."""

    def __init__(self, translation: Translation, given: Mapping[str, Any] | None) -> None:
        self._translation = translation
        self.signals = tuple(translation.input_signals(given))

    def _number(self, name: str) -> int:
        names = self._translation.inputs
        if name not in self._translation.open_inputs:
            self._translation.input_signals({name: 0.0})  # raises for an invalid name or value
        return names.index(name)

    def __getitem__(self, name: str) -> Any:
        return self.signals[self._number(name)]

    def __setitem__(self, name: str, value: Any) -> None:
        k = self._number(name)
        signal = self._translation.input_signals({name: value})[k]
        self.signals = (*self.signals[:k], signal, *self.signals[k + 1 :])

    def __delitem__(self, name: str) -> None:
        raise ArgumentError(f"the input {name} cannot be taken away; set it to 0 instead")

    def __iter__(self) -> Iterator[str]:
        return iter(self._translation.open_inputs)

    def __len__(self) -> int:
        return len(self._translation.open_inputs)


class SteppedRun:
    """A run at its current time, begun by `System.stepper`.

    ``run.advance(t)`` integrates up to a time, ``run["load.w"]`` is the current value of a variable, ``run.inputs["torque.tau"] = 3.0``
    sets an input from now on. Between calls the run keeps its complete state: integrated states, discrete variables, the modes of
    clutches and friction, and its method's step sizes, orders and Jacobians. Setting an input to a number keeps these as well; setting
    a function or a table restarts the method.

    Attributes
    ----------
    t : float
        Current time, s.
    inputs : mapping
        The unbound inputs, by path.
    events : list of (float, str)
        Time, and component with equation, of each event so far.
    """

    def __init__(
        self, translation: Translation, parameters: Floats, t_start: float, start: Any, inputs: Mapping[str, Any] | None,
        method: str | Method, rtol: float, atol: ArrayLike | None, max_step: float | None,
    ) -> None:  # fmt: skip
        self._translation, self._rtol, self._max_step, self._begin = translation, rtol, max_step, t_start
        self._method = BY_TURNS if method == "auto" else method_of(method)
        structure = translation.structure
        scene = translation.scene if translation.outputs is not None else translation.with_states(structure.states)
        self.inputs = Inputs(translation, inputs)
        earlier = earlier_run(translation, start)
        self._begun = earlier is not None
        self._acted = earlier is not None and earlier[1] == t_start  # the earlier run has handled an instant at its end
        if earlier:
            begin, was = earlier[0].moment(scene, earlier[1]), (earlier[1], earlier[0].request.parameters)
            begin = replace(begin, discrete=scene.going_on(begin.discrete, was, (t_start, parameters)))
            self.inputs.signals = given_before(
                translation.controllers, earlier[0], self.inputs.signals, scene.model, parameters
            )
        else:
            begin = self._start(scene, parameters, t_start, start)
        self.events: list[Any] = []
        self._live: LiveRun | None = None
        self._now = Moment(
            t_start, begin.states, begin.discrete, begin.guess, scene, scene.prepared(parameters),
            absolute_tolerance(atol, len(scene.states)), self.inputs.signals, 0,
        )  # fmt: skip
        self._go_to(np.array([t_start]))

    def _start(self, scene: Scene, parameters: Floats, t: float, start: Any) -> Start:
        """The start values; delays give their signal's value at the start."""
        translation = self._translation

        def begin(signals: tuple[Any, ...]) -> Start:
            return translation.start(scene, parameters, t, start, signals, accepts_discrete=True)

        found = begin(self.inputs.signals)
        if translation.controllers:
            run = Run(
                scene, scene.prepared(parameters), found, self.inputs.signals, np.array([t]), self._rtol, None, found.discrete
            )
            run = begun_with(begin, run, translation.controllers)
            found, self.inputs.signals = run.start, run.signals
        return found

    @property
    def t(self) -> float:
        return self._now.t

    def advance(self, t: float) -> None:
        """Integrate up to a time (s) with the current inputs.

        Raises
        ------
        ArgumentError
            The time is not later than the current one.
        SolverError
            The integration failed; the run stays where it was.
        """
        t = real("t", t, "a finite number of seconds")
        if not SHORTEST <= t - self.t <= LONGEST:
            raise ArgumentError(f"advance({t!r}): expected a time later than the run's, {self.t!r} s, by {LONGEST:g} s at most")
        if self._translation.controllers or not self._lives_on(t):
            self._go_to(np.array([self.t, t]))

    def _run(self, times: Floats) -> Run:
        """The integration that a step asks of the method."""
        now = self._now
        longest = self._max_step
        if longest is None and len(times) > 1:
            longest = max(float(times[-1] - times[0]), RESOLVED * max(abs(self._begin), *map(abs, times.tolist())))
        start, signals = Start(now.states, now.guess, ()), unrolled(self.inputs.signals, float(times[0]), float(times[-1]))
        run = Run(now.scene, now.numbers, start, signals, times, self._rtol, now.atol, now.discrete, longest)
        return run if self._translation.controllers else begun_at_instants(run)

    def _lives_on(self, t: float) -> bool:
        """Continue with the method's state; returns whether that was possible."""
        now, live, signals = self._now, self._live, self.inputs.signals
        self._live = None  # unless it arrives
        run = self._run(np.array([now.t, t]))
        if live is None or not live.takes(signals):
            if live is not None:
                live.close()
            live = LiveRun(run, self._method) if can_live(run, self._method) else None
        if live is None:
            return False
        try:
            arrived = live.to(run)
            here = replace(now, t=t, states=live.states, discrete=live.discrete, signals=signals)
            if arrived:
                if here.scene.model.bounded:
                    refuse_too_small([_part(here, signals, before=now)], self._rtol, goes_on=True)
                here = _on_branch(here)
        except BaseException:
            live.close()
            raise
        if not arrived:
            live.close()
            return False
        self.events += live.events
        self._live, self._now = live, replace(here, n_events=len(self.events))
        return True

    def _go_to(self, times: Floats) -> None:
        now, controllers, switched = self._now, self._translation.controllers, self._translation.switched
        if controllers:
            whole, found, pieces = integrate_sampled(
                self._run(times), self._method, switched, controllers, begun=self._begun, acted=self._acted
            )
            parts, self.inputs.signals = [(whole, found)], pieces.after
        else:
            parts = integrate_through(self._run(times), self._method, switched)
        refuse_too_small([Segment.of(part, found) for part, found in parts], self._rtol, goes_on=self._begun)
        self._begun, self._acted, signals = True, True, self.inputs.signals
        run, outcome = parts[-1]
        discrete = outcome.discrete[-1].copy() if run.scene.n_discrete else None
        here = replace(
            now, t=float(times[-1]), states=outcome.x[-1].copy(), discrete=discrete, scene=run.scene, numbers=run.numbers,
            atol=run.atol, signals=signals, guess=run.start.guess,
        )  # fmt: skip
        here = _on_branch(here)
        self.events += [event for _, found in parts for event in found.events()]
        self._now = replace(here, n_events=len(self.events))

    def __getitem__(self, name: str) -> float:
        """Current value of a variable, a derivative or a discrete variable."""
        if not isinstance(name, str):
            raise ArgumentError(f"run[{shown(name)}]: expected one name, such as run['load.w']")
        now, part = self._now, _part(self._now, self.inputs.signals)
        if name in now.scene.model.discretes:
            return float(part.discrete_variable(name)[0])
        node, sign = now.scene.named(name)
        if sign == 0:
            return 0.0
        if now.scene.missing(node):
            raise NameLookupError(f"{name} is not known in this run: its states are not integrated; name it in outputs=[...]")
        return float(sign * part.history(node)[0])

    def state(self) -> Moment:
        """The complete state, for `restore`. The next step restarts the method, as it will after `restore`."""
        self._let_go()
        return replace(self._now, signals=self.inputs.signals)

    def restore(self, state: Moment) -> None:
        """Return to a state of this run, or of another run of the same system: the same steps reproduce the same numbers.

        Raises
        ------
        ArgumentError
            Not such a state.
        """
        if not isinstance(state, Moment) or state.scene.structure is not self._translation.structure:
            raise ArgumentError(f"restore({shown(state)}): expected what state() of a run of {self._translation.name} gave")
        self._let_go()
        self._now, self.inputs.signals = state, state.signals
        del self.events[state.n_events :]

    def _let_go(self) -> None:
        """Discard the method's state."""
        if self._live is not None:
            self._live.close()
            self._live = None

    def __repr__(self) -> str:
        return f"<SteppedRun of {self._translation.name} at {self.t:g} s>"


def _on_branch(here: Moment) -> Moment:
    """The same with guesses on its solution branch."""
    return replace(here, guess=_part(here, here.signals).guess_on_branch()) if here.scene.program.iterated else here


def _part(now: Moment, signals: tuple[Any, ...], before: Moment | None = None) -> Segment:
    """The current state as a run of one sample, from which other variables are computed; or of two, from the one ``before``."""
    moments = [now] if before is None else [before, now]
    discrete = [np.zeros(0) if each.discrete is None else each.discrete for each in moments]
    return Segment(
        now.scene, np.array([each.t for each in moments]), np.array([each.states for each in moments]), np.array(discrete),
        now.numbers.parameters, signals, now.guess, moments[0].t,
    )  # fmt: skip
