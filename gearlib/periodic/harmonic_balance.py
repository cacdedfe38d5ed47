"""Harmonic balance of a periodically forced train, continued in frequency through folds and unstable branches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearlib.arguments import by_name, name_list, one_name, real, shown, whole
from gearlib.errors import ArgumentError, SolverError
from gearlib.periodic.continuation import Path, follow
from gearlib.periodic.first_motion import BEGUN, LATER, REPEATING, UNRELATED, Forced, check_periodic
from gearlib.periodic.fourier_balance import HarmonicEquations
from gearlib.periodic.harmonic_response import HarmonicBalance
from gearlib.periodic.periods import Driven, Floats, fourier, moments, transform
from gearlib.program.interpret import evaluate
from gearlib.progress import RunProgress, check_progress, reporting
from gearlib.run.scene import Scene
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled

HARMONICS = (4, 8, 16, 32, 64)  # numbers of harmonics, tried in turn
OFF = 1e-2  # relative to the vibration: an error at the retained harmonics that truncation does not explain
BETWEEN = 0.3819660  # of the interval of frequencies: a place that is no round number
SLOWEST, FASTEST = 1e-50, 1e50  # rad/s; outside, squares of derivatives (fourth powers of a frequency) overflow or underflow
Input = float | Callable[[float, float], float]


def harmonic_balance(
    system: Compiled, start: float, end: float, *, frequency: str | None = None, harmonics: int | None = None, samples: int | None = None,
    outputs: Sequence[str] | None = None, inputs: Mapping[str, Input] | None = None, turning: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None, guess: Mapping[str, float] | None = None, step: float = 0.02,
    points: int = 2000, accuracy: float = 5e-3, progress: Any = False,
) -> HarmonicBalance:  # fmt: skip
    """Continue the periodic response of a forced system in its forcing frequency.

    States are Fourier series, ``x = c_0 + sum(c_k cos(k w t) + s_k sin(k w t))``, means included. The rates are evaluated over a period
    and transformed back (alternating frequency/time method); where a relation switches, the period is split, so that backlash costs no
    accuracy. The branch is followed by pseudo-arclength continuation. Stability is determined by the Floquet multipliers of each
    motion.

    Parameters
    ----------
    system : System
        Its discrete variables must have no memory (no sticking clutch). A freely rotating train keeps the mean speed of its start
        values.
    start, end : float
        First and last frequency, rad/s; in between the branch may turn back at folds. Start where the response is small or linear.
    frequency : str, optional
        Parameter that is the angular frequency of the forcing, if the forcing is part of the model; all functions of time must be
        periodic with it.
    harmonics : int, optional
        Number of harmonics. By default as many as the accuracy requires at every point; the achieved one is in the result's ``error``.
        A given number is fixed: one harmonic is the describing function, which may be far off.
    samples : int, optional
        Number of collocation points per period (at least 64, and 8 per harmonic; 256 where something switches).
    outputs : sequence of str, optional
        Variables; by default the system's outputs, or its states.
    inputs : mapping, optional
        Unbound inputs: a number, or a function of phase (rad, ``w t``) and frequency (rad/s), 2 pi periodic in the phase.
    turning : mapping, optional
        Growing states in rad, by path, with the multiple of 2 pi by which each grows per period: ``{"mesh.turned": 1.0}`` where the
        phase of a mesh excites the train (``frequency`` is then not needed). The mean speed follows from the frequency, so the torques
        that drive and load the train must be constant and balanced.
    parameters : mapping, optional
        Values by path.
    guess : mapping, optional
        Start values by path: initial means at ``start``, and the mean speed of a freely rotating train.
    step : float
        Largest continuation step, relative to the length of the interval.
    points : int
        Largest number of points.
    accuracy : float
        With automatic harmonics: largest error of a state's waveform relative to its vibration.
    progress : bool or callable
        True shows a bar on a terminal; a callback receives the fraction of the way from ``start`` to ``end`` (back again with more
        harmonics, or at a fold), and the elapsed seconds.

    Returns
    -------
    HarmonicBalance

    Raises
    ------
    ArgumentError
        The forcing or an output is not periodic with the frequency, or nothing forces the system; or it has memory.
    SolverError
        No periodic motion was found at ``start`` (or there is none, since a freely rotating train accelerates), or the step became too
        small; or the mean of a state is undetermined; or the motion does not satisfy the equations in time to the requested accuracy.

    References
    ----------
    T. M. Cameron, J. H. Griffin, Journal of Applied Mechanics 56 (1989) 149-154, https://doi.org/10.1115/1.3176036.
    M. Krack, J. Gross, "Harmonic Balance for Nonlinear Vibration Problems", Springer 2019,
    https://doi.org/10.1007/978-3-030-14023-6.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp, numpy as np
    >>> class Rotor(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.body, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Fixed()
    ...         self.shaft = gp.SpringDamper(c=1.0, d=0.2)
    ...         return [gl.connect(self.torque.flange, self.body.flange_a),
    ...                 gl.connect(self.body.flange_b, self.shaft.flange_a),
    ...                 gl.connect(self.shaft.flange_b, self.ground.flange)]
    >>> drive = {"torque.tau": lambda phase, w: np.cos(phase)}
    >>> response = gl.harmonic_balance(gl.compile(Rotor()), 0.5, 1.5, inputs=drive, outputs=["body.phi"])
    >>> w = response.omega
    >>> bool(np.allclose(response.amplitude("body.phi"), 1 / np.abs(1 - w**2 + 0.2j * w), rtol=1e-9))
    True
    """
    translation = translation_of(system)
    check_numbers(start, end, harmonics, step, points, accuracy)
    if frequency is not None:
        one_name("frequency", frequency, "mesh.w")
    parameters = by_name("parameters", parameters, "a mapping of paths to numbers")
    inputs = by_name("inputs", inputs, "a mapping of paths to numbers, or functions of phase and frequency")
    turning = by_name("turning", turning, "a mapping of states to periods of 2 pi, such as {'mesh.turned': 1.0}")
    guess = by_name("guess", guess, "a mapping of start values by path")
    forced = Forced(translation, frequency, parameters, inputs, 0, turning)
    translation.parameter_values(forced.values(float(end)))
    translation, _ = translation.fitted(forced.values(float(start)))
    cases = HARMONICS if harmonics is None else (harmonics,)
    known = None
    check_progress(progress)
    with reporting(progress, f"harmonic balance of {translation.name}") as tell:
        seen = None if tell is None else RunProgress(tell, float(start), float(end))
        for count_ in cases:
            task = Forced(translation, frequency, parameters, inputs, count_, turning)
            default = translation.outputs if translation.outputs is not None else task.repeating()
            names = name_list("outputs", outputs if outputs is not None else default, "mesh.q")
            scene = task.scene(names)
            observed = task.observed(scene, names)
            for name, given in inputs.items():
                if callable(given):  # a fixed frequency may happen to be a multiple of the first one
                    check_periodic(name, given, start + BETWEEN * (end - start))
            count = samples_of_a_period(samples, count_, scene.relations is not None)
            first = task.first(scene, float(start), count, guess, known)
            known = first.balance.coefficients(first.z)
            watch = Acceptance(first.balance, accuracy if harmonics is None else np.inf, seen)
            if not watch(first.z, float(start)):
                continue
            path = follow(
                first.balance.equations, first.z, float(start), float(end), float(step), points, len(scene.states), watch
            )
            if watch.worst <= watch.accuracy:
                if seen is not None:
                    seen.end(float(path.w[-1]))
                return _result(task, observed, first.balance, path, names)
    raise SolverError(
        f"{count_} harmonics leave an error of {watch.worst:.2g} of the vibration at {watch.where:g} rad/s, more than "
        f"accuracy={accuracy:g}; ask for less, or take that many with harmonics=..."
    )


def samples_of_a_period(samples: int | None, harmonics: int, switching: bool) -> int:
    count = samples if samples is not None else max(256 if switching else 64, 8 * harmonics)
    least = 2 * harmonics + 2
    return whole("samples", count, least, f"a whole number from {least} on ({harmonics} harmonics need as many)")


class Acceptance:
    """Acceptance test: the motion at a point must satisfy the equations in time."""

    def __init__(self, balance: HarmonicEquations, accuracy: float, seen: RunProgress | None = None) -> None:
        self.balance, self.accuracy, self._seen = balance, accuracy, seen
        self.worst, self.where = 0.0, 0.0

    def __call__(self, z: Floats, omega: float) -> bool:
        if self._seen is not None:
            self._seen(omega)
        if self.accuracy == np.inf:  # a given number of harmonics is accepted as it is
            return True
        _, error = self.balance.error(z, omega)
        if not error <= self.worst:
            self.worst, self.where = error, omega
        return bool(error <= self.accuracy)


def check_numbers(start: float, end: float, harmonics: int | None, step: float, points: int, accuracy: float) -> None:
    for name, value in (("start", start), ("end", end), ("step", step), ("accuracy", accuracy)):
        real(name, value)
    if not 0 < accuracy < 1:
        raise ArgumentError(f"accuracy is {shown(accuracy)}; expected an error over the vibration, above 0 and below 1")
    if not (start > 0 and end > 0 and start != end):
        raise ArgumentError(
            f"start and end are {shown(start)} and {shown(end)}; expected two different positive frequencies, rad/s"
        )
    for name, value in (("start", start), ("end", end)):
        if not SLOWEST <= value <= FASTEST:
            raise ArgumentError(f"{name} is {shown(value)}; expected a frequency from {SLOWEST:g} to {FASTEST:g} rad/s")
    if harmonics is not None:
        whole("harmonics", harmonics, 1)
    if not 0 < step <= 1:
        raise ArgumentError(f"step is {shown(step)}; expected a number above 0, up to 1")
    whole("points", points, 2)


def _result(task: Forced, scene: Scene, balance: HarmonicEquations, path: Path, names: list[str]) -> HarmonicBalance:
    """Outputs and stability along a path."""
    model = scene.model
    variables = [(model.variable(base), order) for base, order in map(model.column, names)]
    targets = [(int(model.representative[v]), order) for v, order in variables]
    signs = np.array([float(model.sign[v]) for v, _ in variables])
    rows = [scene.program.slots.get(t, 0) for t in targets]
    numbers = None
    coefficients: list[Floats] = []
    multipliers = []
    errors = []
    count = balance.samples
    for z, omega in zip(path.z, path.w, strict=True):
        driven = balance.driven(float(omega))
        if numbers is None or task.frequency is not None:
            numbers = scene.numbers(driven.numbers.parameters)
        driven = replace(driven, scene=scene, numbers=numbers)
        c = balance.coefficients(z)
        if not coefficients or balance.rigid.free.shape[1]:
            other = balance.driven(UNRELATED * omega)
            other = replace(other, scene=scene, numbers=scene.numbers(other.numbers.parameters))
            for tried in (driven, other):  # what has a frequency of its own may happen to repeat at one of them
                check_repeating(names, tried, c, balance.growth(z, float(omega)), rows)
        found = moments(driven, c, count)
        values = observed_values(driven, found.phase, driven.states(found.phase, c), found.discrete)[rows]
        back = transform(found.weights, fourier(found.phase, balance.harmonics))
        coefficients.append(back @ (signs[:, None] * values).T)
        multipliers.append(balance.multipliers(z, float(omega)))
        low, error = balance.error(z, float(omega))
        if not low <= OFF:
            raise SolverError(
                f"at {omega:g} rad/s the motion that was found does not obey the equations between the {count} samples of a period "
                f"(off by {low:.2g} of its vibration); take more samples"
            )
        errors.append(error)
    table = np.full((len(multipliers), max(map(len, multipliers))), np.nan, np.complex128)
    for row, found_there in zip(table, multipliers, strict=True):
        row[: len(found_there)] = found_there
    units = tuple(task.translation.unit(name) for name in names)
    return HarmonicBalance(
        path.w, np.array(coefficients), table, path.folds, tuple(names), units, path.complete, np.array(errors)
    )


def observed_values(driven: Driven, phase: Floats, x: Floats, discrete: Floats) -> Floats:
    return evaluate(driven.numbers, phase / driven.omega, x, driven.inputs(phase, driven.omega), discrete)


def check_repeating(names: Sequence[str], driven: Driven, c: Floats, growth: Floats, rows: Sequence[int]) -> None:
    """Refuse outputs that do not repeat: that grow with the mesh phase or with an angle, or depend on time by themselves."""

    def values(turns: float, x: Floats) -> Floats:
        phase = BEGUN + turns
        return observed_values(driven, phase, x, driven.discrete(phase, x))[rows]

    x = driven.states(BEGUN, c)
    once, by_rounding = values(0.0, x), 1 + 1e-12 * np.random.default_rng(1).uniform(-1, 1, x.shape)
    for periods in LATER:
        turns = 2 * np.pi * periods
        moved = x + turns * growth[:, None]
        again, shaken = values(turns, moved), values(turns, moved * by_rounding)  # by more than rounding
        grown = np.abs(again - once).max(axis=1)
        rounding = 1e-12 * np.abs(once).max(axis=1) + np.abs(shaken - again).max(axis=1)
        bad = np.flatnonzero(grown > periods * (REPEATING * np.ptp(once, axis=1) + rounding))
        if len(bad):
            growing = (again - once)[bad[0]]
            if periods == 1 and np.ptp(growing) <= 1e-6 * grown[bad[0]]:
                raise ArgumentError(f"{names[bad[0]]} grows by {growing[0]:g} in each period; leave it out, or take its rate")
            raise ArgumentError(
                f"{names[bad[0]]} does not repeat after 2 pi / {driven.omega:g} rad/s, but differs by up to {grown[bad[0]]:g}: it depends "
                "on time in another way than the forcing; leave it out"
            )
