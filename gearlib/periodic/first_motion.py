"""Periodic forcing of a train, and the initial periodic solution for harmonic balance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import finite, is_real, name_list, shown
from gearlib.errors import ArgumentError, NameLookupError, SolverError, nearest
from gearlib.linear.balancing import balance as balanced_matrix
from gearlib.periodic.fourier_balance import HarmonicEquations, rigid_motions, terms
from gearlib.periodic.periods import Driven, fourier, moments
from gearlib.program.build import build
from gearlib.program.newton import Correction, newton
from gearlib.program.program import Program
from gearlib.run.request import Request
from gearlib.run.scene import Scene, needed_states, node_name
from gearlib.run.simulate import run
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]
SINGULAR = 1e-14  # relative to the largest singular value: a smaller one is rounding
ROUNDING = 1e-12  # relative to the terms of a rate
EXACT, REFINED = 1e-11, 1e-9  # last correction of Newton's method, in nominal values and relative to each vibration
CANCELLED = 1e-9  # relative to the terms of its rate: a smaller vibration may be what rounding leaves of them
IRREGULAR = 2 * np.pi * np.arange(16) / 16 + 0.1234567  # phases at which nothing is likely to switch
BEGUN = np.append(1e-6, IRREGULAR)  # and one at which a step soon after the start has not come yet
LATER = (1, 100, 10_000)  # periods after which forcing has to be the same, since a step may come at any time
REPEATING = 1e-6  # of the swing: a smaller change in each period is none
UNRELATED = 1.2345678  # ratio of frequencies at both of which a function of time of another frequency does not repeat
SETTLE = 100  # periods of a run from which the initial solution is taken


@dataclass(frozen=True, eq=False)
class First:
    """Scaled equations of harmonic balance, and an initial solution."""

    balance: HarmonicEquations
    z: Floats


class ObservedScene(Scene):
    """A scene whose outputs are part of the program, so that relations on which only they depend switch as well."""

    @cached_property
    def program(self) -> Program:
        return build(self.structure, self.outputs, self.states, dynamic=True)


@dataclass(frozen=True, eq=False)
class Forced:
    """Forcing, frequency range and harmonics of a requested branch."""

    translation: Translation
    frequency: str | None
    parameters: dict[str, float]
    inputs: dict[str, Any]
    harmonics: int
    turning: dict[str, float]

    def scene(self, outputs: Sequence[str]) -> Scene:
        """Scene with the states that the outputs need.

        Raises
        ------
        ArgumentError
            There are no states, or there is discrete state with memory.
        """
        translation = self.translation
        outputs = name_list("outputs", outputs, "mesh.q")
        if not outputs:
            raise ArgumentError("outputs is []; expected a list of names, such as ['mesh.q']")
        states = needed_states(translation.structure, translation.nodes(outputs))
        if not states:
            raise ArgumentError(f"{', '.join(outputs)} depend on no states, so there is nothing to balance")
        scene = translation.scene_of(states)
        if scene.wanted:  # of discrete variables, only those count on which the motion or an output depends
            scene = Scene(translation.structure, states)
        _refuse_memory(scene)
        return scene

    def observed(self, scene: Scene, outputs: Sequence[str]) -> Scene:
        """The scene with the outputs.

        Raises
        ------
        ArgumentError
            An output has a memory.
        """
        found = ObservedScene(scene.structure, scene.states, outputs=tuple(self.translation.nodes(outputs)))
        _refuse_memory(found)
        return found

    def values(self, omega: float) -> dict[str, float]:
        if self.frequency is None:
            return self.parameters
        return {**self.parameters, self.frequency: omega / (2 * np.pi) if self._in_hertz else omega}

    @cached_property
    def _in_hertz(self) -> bool:
        """Whether the frequency parameter is declared in Hz."""
        for instance in self.translation.model.instances:
            for name, declared in instance.declared.parameters.items():
                if (f"{instance.path}.{name}" if instance.path else name) == self.frequency:
                    return declared.unit == "Hz"
        return False

    def repeating(self) -> tuple[str, ...]:
        """All states except pure integrals: absolute angles and mesh phases, which may grow."""
        structure = self.translation.structure
        names = {node_name(structure.model, s): s for s in structure.states}
        left = []
        for name in self.translation.states:
            v, k = names[name]
            follows = needed_states(structure, [(v, k + 1)])
            others = [(u, j + 1) for u, j in structure.states if (u, j) != (v, k)]
            if name not in self.turning and not (follows and (v, k) not in {*follows, *needed_states(structure, others)}):
                left.append(name)
        return tuple(left or [n for n in self.translation.states if n not in self.turning])

    def driven(self, scene: Scene) -> Callable[[float], Driven]:
        """The scene at a frequency; the most recent ones are cached."""
        translation, given = self.translation, self._signals
        translation.input_signals({name: 0.0 if callable(g) else g for name, g in self.inputs.items()})

        def signals(phase: Floats, omega: float) -> Floats:
            rows = [
                [_finite(name, g(float(p), omega)) for p in phase % (2 * np.pi)] if callable(g) else np.full(len(phase), g)
                for name, g in given
            ]
            return np.array(rows, float).reshape(len(given), len(phase))

        growth = self.growth(scene)

        @lru_cache(maxsize=8)
        def at(omega: float) -> Driven:
            # bounds hold at both ends of the interval; other frequencies are tried beyond them, for one step or one look
            numbers = translation.parameter_values(self.values(omega), bounded=False)
            return Driven(scene, *scene.compiled_numbers(numbers), signals, omega, growth)

        if self.frequency is not None:
            return at
        fixed = scene.compiled_numbers(translation.parameter_values(self.parameters))
        return lambda omega: Driven(scene, *fixed, signals, omega, growth)

    def growth(self, scene: Scene) -> Floats:
        """Growth of each state per radian of phase."""
        for name, turns in self.turning.items():
            if name not in scene.state_names:
                raise NameLookupError(f"the system has no state '{name}'; {nearest(name, scene.state_names)}")
            if not is_real(turns) or not turns:
                raise ArgumentError(
                    f"turning[{shown(name)}] is {shown(turns)}; expected the periods of 2 pi in one period of the motion"
                )
        return np.array([float(self.turning.get(name, 0.0)) for name in scene.state_names])

    @property
    def _signals(self) -> list[tuple[str, Any]]:
        """The number or function of each input."""
        return [(name, self.inputs.get(name, 0.0)) for name in self.translation.inputs]

    def first(
        self, scene: Scene, omega: float, samples: int, guess: Mapping[str, float] | None, known: Floats | None = None
    ) -> First:
        """A periodic motion at the first frequency: by Newton's method from the start values, or from the end of a run.

        ``known`` are the coefficients of an approximation with fewer harmonics.
        """
        translation = self.translation
        driven = self.driven(scene)
        numbers = translation.parameter_values(self.values(omega))
        now = [_finite(name, g(0.0, omega)) if callable(g) else g for name, g in self._signals]
        for name, g in self._signals:
            if callable(g):
                check_periodic(name, g, omega)
        means = translation.start(scene, numbers, 0.0, dict(guess) if guess else None, now).states
        size = (2 * self.harmonics + 1, len(scene.states))
        for tried in (omega, UNRELATED * omega):  # forcing with a fixed frequency may happen to be periodic at one of them
            check_forcing(driven(tried), means, self.frequency)
        varies = self.frequency is not None or any(callable(g) for g in self.inputs.values())
        nominal = np.maximum(scene.nominal, 1e-300)
        rigid = rigid_motions(driven(omega), means, nominal, nominal)
        balance = HarmonicEquations(driven, self.harmonics, samples, nominal, rigid, varies)
        c = np.zeros(size)
        c[0] = means
        if known is not None:
            c[: len(known)] = known
        z = solved(balance, balance.unknowns(c), omega)
        if z is None and not self.turning:
            c = self._settled(scene, omega, samples, guess)
            z = solved(balance, balance.unknowns(c), omega)
        if z is None:
            refuse_undetermined(balance, balance.unknowns(c), omega)
            raise SolverError(
                f"no periodic motion was found at {omega:g} rad/s, neither from the start values nor from a run over {SETTLE} "
                "periods; start where the response is small or linear, or give a guess of the means"
            )
        refuse_undetermined(balance, z, omega)
        return rescaled(balance, z, driven(omega), nominal)

    def _settled(self, scene: Scene, omega: float, samples: int, guess: Mapping[str, float] | None) -> Floats:
        """Fourier coefficients of the last period of a run."""
        period = 2 * np.pi / omega
        times = np.append(0.0, (SETTLE + np.arange(samples) / samples) * period)
        timed = {
            name: (lambda t, g=g: g((omega * t) % (2 * np.pi), omega)) if callable(g) else g for name, g in self.inputs.items()
        }
        translation, numbers = self.translation.fitted(self.values(omega))
        start = dict(guess) if guess else None
        signals = tuple(translation.input_signals(timed))
        request = Request(0.0, times, "auto", 1e-8, None, numbers, start, signals, progress=False, max_step=None)
        found = run(translation, request)
        x = np.array([found.history_of(s)[1:] for s in scene.states])
        basis = fourier(omega * times[1:], self.harmonics)
        result: Floats = np.linalg.lstsq(basis, x.T, rcond=None)[0]
        return result


def _finite(name: str, value: Any) -> float:
    return finite(lambda: f"the input {name} returned", value)


def check_periodic(name: str, function: Callable[[float, float], Any], omega: float) -> None:
    """Check that a function of the phase repeats after 2 pi."""
    once, again = ([_finite(name, function(float(p), omega)) for p in IRREGULAR + turns] for turns in (0.0, 2 * np.pi))
    off = np.abs(np.subtract(again, once)).max()
    if off > 1e-6 * np.ptp(once) + 1e-9 * np.abs(once).max():
        raise ArgumentError(
            f"the input {name} is not 2 pi periodic in the phase: it differs by {off:.3g} after a period at {omega:g} rad/s. "
            "Give it the slowest frequency, of which all others are multiples"
        )


def _refuse_memory(scene: Scene) -> None:
    """Refuse discrete variables that have memory; those that follow from the states are admissible in a Fourier series."""
    relations = scene.relations
    if relations is None:
        return
    model = scene.model
    n, d = model.n_relations, len(model.discretes)
    batches = [*relations.batches, *relations.discretes]
    kept = {int(r) - n - d for b in batches for r in b.relations.ravel() if n + d <= r < n + 2 * d}
    if kept or relations.reinits:
        names = ", ".join(model.discretes[k] for k in sorted(kept)) or "a state that is reinitialised"
        raise ArgumentError(f"the system has a memory ({names}), which harmonic balance cannot take; simulate it")


def check_forcing(driven: Driven, means: Floats, frequency: str | None) -> None:
    """Check that the rates vary over a period, and repeat after it."""
    phase = BEGUN
    x = means[:, None] + driven.growth[:, None] * phase
    once, slopes = driven.linear_rates(phase, x, driven.discrete(phase, x))
    names = driven.scene.state_names
    if not np.isfinite(once).all():
        bad = names[int(np.flatnonzero(~np.isfinite(once).all(axis=1))[0])]
        raise ArgumentError(f"der({bad}) is not finite at the start values; give a guess of the means")
    addends = np.abs(slopes).max(axis=0) @ np.abs(x).max(axis=1)  # balanced forces leave rounding errors
    nominal = driven.scene.nominal
    swing, size = np.ptp(once, axis=1), np.abs(once).max(axis=1)
    varying = np.maximum(swing, 1e-9 * nominal * float((swing / nominal).max()) + 1e-300)
    for periods in LATER:
        then = phase + 2 * np.pi * periods
        moved = x + 2 * np.pi * periods * driven.growth[:, None]
        again = driven.rates(then, moved, driven.discrete(then, moved))
        rounding = ROUNDING * periods * (addends + size)
        off = np.maximum(np.abs(again - once).max(axis=1) - rounding, 0.0) / varying
        if (off > REPEATING * periods).any():
            raise ArgumentError(_not_repeating(names[int(np.argmax(off))], driven.omega, frequency))
    if (swing <= 1e-12 * size).all():
        raise ArgumentError(
            "nothing varies over the period: bind an input to a function of the phase, give frequency=..., or, where the phase of a "
            "mesh excites the train, turning={'mesh.turned': 1.0}"
        )


def _not_repeating(state: str, omega: float, frequency: str | None) -> str:
    """Message about a state whose rate does not repeat with the forcing."""
    return f"der({state}) does not repeat after 2 pi / {omega:g} rad/s; " + (
        "name the parameter that is the forcing frequency (frequency=...), and make all functions of time repeat with it"
        if frequency is None
        else f"{frequency} was set to that frequency, and something varies with time otherwise: a frequency that does not follow "
        f"from it, a ramp or a step, or {frequency} counts in Hz and is not declared so"
    )


def refuse_undetermined(balance: HarmonicEquations, z: Floats, omega: float) -> None:
    """Refuse a motion whose mean is undetermined, such as the position of an unloaded wheel in its gap: it cannot be continued."""
    _, matrix, _ = balance.equations(z, omega)
    balanced, units = balanced_matrix(matrix)  # at 1e9 rad/s, a speed and its angle are that far apart
    _, sizes, directions = np.linalg.svd(balanced)
    if sizes[-1] > SINGULAR * sizes[0]:
        return
    scene = balance.driven(omega).scene
    size = np.abs((directions[-1] * units).reshape(-1, len(scene.states)) * balance.scale / scene.nominal)
    wave, state = divmod(int(np.argmax(size)), len(scene.states))
    name, times = scene.state_names[state], (wave + 1) // 2
    if times:
        raise SolverError(
            f"at {omega:g} rad/s the {times}. harmonic of {name} is undetermined: the train vibrates freely at {times * omega:g} rad/s, "
            "and nothing damps that. Give it some damping, or another frequency"
        )
    raise SolverError(
        f"at {omega:g} rad/s the mean of {name} is undetermined: it can have other values with the same motion, as inside a gap that stays "
        "open. Load the train so that its teeth touch, or give a guess of the means with contact"
    )


def solved(balance: HarmonicEquations, z: Floats, omega: float, exact: float = EXACT) -> Floats | None:
    """Newton's method at a fixed frequency; steps that do not help are halved. ``exact``: last correction relative to the unknowns."""

    def equations(z: Floats) -> tuple[Floats, Correction]:
        rest, matrix, _ = balance.equations(z, omega)
        return rest, partial(np.linalg.solve, matrix)

    def settled(z: Floats, step: Floats, rest: Floats) -> bool:
        small = np.abs(step).max() <= exact * np.abs(z).max() + 1e-300
        return bool(small or np.linalg.norm(rest) <= 1e-13 * max(float(np.linalg.norm(z)), 1e-300))

    found = newton(equations, z, settled, 60, (1.0, 0.5, 0.25, 0.1))
    return found.x if found.settled else None


def rescaled(balance: HarmonicEquations, z: Floats, driven: Driven, nominal: Floats) -> First:
    """The same motion, with states scaled by their vibration."""
    c = balance.coefficients(z)
    spread = np.abs(c[1:]).max(axis=0)
    largest = float((spread / nominal).max())
    if largest == 0.0:
        raise SolverError("the forcing moves nothing: no state vibrates at the first frequency")
    found = moments(driven, c, balance.samples)
    _, slopes = driven.linear_rates(found.phase, driven.states(found.phase, c), found.discrete)
    cancelling = terms(driven, found, slopes, spread + np.abs(c[0]))
    others = terms(driven, found, slopes, spread)
    scale = np.where(spread > CANCELLED * cancelling, spread, np.where(others > 0, others, largest * nominal))
    rigid = rigid_motions(driven, balance.rigid.means, scale, nominal)
    new = HarmonicEquations(balance.driven, balance.harmonics, balance.samples, scale, rigid, balance.varies)
    z = new.unknowns(c)
    better = solved(new, z, driven.omega, REFINED)  # in other scales Newton's method may have found large states only
    return First(new, z if better is None else better)
