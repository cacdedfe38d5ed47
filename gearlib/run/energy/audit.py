"""Energy audit: quadrature of the powers over a run, repeated with refined nodes as samples until it converges.

Between breakpoints (samples and events) all powers are smooth. Each panel between them has the 15 nodes of the Kronrod rule, which
contain the 7 of the Gauss rule: the difference between the two decides which panels are split into four. Stored energies at the ends of
a panel are extrapolated from its nodes, from the left and from the right, so that jumps at events show up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import GearlibError, NameLookupError
from gearlib.flatten.energies import Audited, Term
from gearlib.run.energy.energy_balance import EnergyBalance
from gearlib.run.request import Request
from gearlib.run.scene import Scene
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]
MOST_SAMPLES = 1000  # that panels begin at; with more, every second, third, ... sample
MOST_PANELS, PASSES = 20_000, 8  # refinement, which cuts coarse panels into four, ends there
NARROW = 1e-10  # of the run: narrower panels, between events at one place, are left out
EXPLAINED = 100.0  # times the relative tolerance: a residual up to that, relative to the throughput, needs no explanation

# Kronrod's 15 nodes and weights, and Gauss's weights at every other node (Piessens et al., QUADPACK, 1983, routine QK15).
_HALF = np.array([
    0.9914553711208126, 0.9491079123427585, 0.8648644233597691, 0.7415311855993945, 0.5860872354676911, 0.4058451513773972,
    0.20778495500789848, 0.0,
])  # fmt: skip
_KRONROD = np.array([
    0.022935322010529224, 0.06309209262997856, 0.10479001032225019, 0.14065325971552592, 0.1690047266392679, 0.19035057806478542,
    0.20443294007529889, 0.20948214108472782,
])  # fmt: skip
_GAUSS = np.array([0.0, 0.1294849661688697, 0.0, 0.27970539148927664, 0.0, 0.3818300505051189, 0.0, 0.4179591836734694])
NODES = np.concatenate([-_HALF, _HALF[-2::-1]])
KRONROD = np.concatenate([_KRONROD, _KRONROD[-2::-1]])
GAUSS = np.concatenate([_GAUSS, _GAUSS[-2::-1]])


def _to_the_ends() -> Floats:
    """Weights that evaluate the interpolating polynomial at -1 and 1 from its values at the nodes, shape (2, nodes)."""
    found = np.empty((2, len(NODES)))
    for row, end in enumerate((-1.0, 1.0)):
        for i, node in enumerate(NODES):
            others = np.delete(NODES, i)
            found[row, i] = np.prod((end - others) / (node - others))
    return found


ENDS = _to_the_ends()


class Histories(Protocol):
    """The part of a run's interface that the audit reads: its samples and the histories of its variables."""

    time: Floats

    def __getitem__(self, name: str) -> Floats: ...


def energy_balance(
    translation: Translation, request: Request, samples: Floats, events: Sequence[float],
    run: Callable[[Translation, Request, Scene], Histories],
) -> EnergyBalance:  # fmt: skip
    """Energy balance of a run; `Result.energy_balance` is the public interface.

    Parameters
    ----------
    translation : Translation
    request : Request
        The run's request.
    samples : array
        The start of the run, and times of the result.
    events : sequence of float
        Times at which powers may jump.
    run : callable
        Repeats the run with other samples, in a scene with the states that the powers need.
    """
    parts, scene = translation.energies, translation.energy_scene
    atol = None if np.ndim(request.atol or 0.0) else request.atol

    def again(times: Floats) -> Histories:
        return run(translation, replace(request, times=times, atol=atol, progress=False, directions=None), scene)

    values_of = dict(zip(translation.model.parameters.names, request.parameters.tolist(), strict=True))
    return balance(
        parts, samples, events, request.rtol, again, values_of, request.rtol if atol is None else float(np.asarray(atol, float))
    )


def balance(
    parts: Sequence[Audited], samples: Floats, events: Sequence[float], rtol: float, run: Callable[[Floats], Histories],
    parameters: dict[str, float], slowest: float,
) -> EnergyBalance:  # fmt: skip
    """Energy balance over some components of a run.

    Parameters
    ----------
    parts : sequence of Audited
    samples : array
        Times of the result.
    events : sequence of float
        Times at which powers may jump.
    rtol : float
        Relative tolerance of the run.
    run : callable
        Repeats the run with these samples.
    parameters : dict
        Values by path.
    slowest : float
        Absolute tolerance of speeds, rad/s or m/s.
    """
    step = -(-len(samples) // MOST_SAMPLES)
    reported = np.unique(np.append(samples[::step], samples[-1]))
    span = float(reported[-1] - reported[0])
    marks = np.unique([t for t in events if reported[0] < t <= reported[-1] + NARROW * span])
    cuts = np.unique(np.concatenate([reported, marks[marks < reported[-1]]]))
    cuts = cuts[np.append(True, np.diff(cuts) > NARROW * span)]
    cuts[-1] = reported[-1]
    tolerance = max(0.1 * rtol, 1e-11)
    for attempt in range(PASSES):
        middle, half = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts) / 2
        times = (middle[:, None] + half[:, None] * NODES).ravel()
        found = run(np.append(times, reported[-1]))
        powers = _Powers(parts, found, parameters, half, slowest)
        coarse = powers.error > tolerance * powers.throughput * np.maximum(half * 2 / span, 1e-3)
        coarse &= half > 1e-9 * span
        if not coarse.any() or len(cuts) + 3 * coarse.sum() > MOST_PANELS or attempt == PASSES - 1:
            break
        quarters = [(middle + x * half)[coarse] for x in (-0.5, 0.0, 0.5)]
        cuts = np.sort(np.concatenate([cuts, *quarters]))
    place = np.searchsorted(cuts, reported, side="right") - 1
    # a cut stands for the events beside it as well, such as one that a sample misses by rounding
    before, until = np.searchsorted(marks, cuts - NARROW * span), np.searchsorted(marks, cuts + NARROW * span, side="right")
    return powers.summed(reported, place, until > before, rtol)


class _Powers:
    """Integrals of all powers over each panel, and stored energies at the panels' ends and at the end of the run."""

    def __init__(
        self, parts: Sequence[Audited], found: Histories, parameters: dict[str, float], half: Floats, slowest: float
    ) -> None:
        self.parts, self.unknown = parts, [p.path for p in parts if p.unknown]
        self.through: dict[str, Floats] = {}
        self.heat_in: dict[str, Floats] = {}
        self.heat: dict[str, Floats] = {}
        self.supplied: dict[str, Floats] = {}
        self.ends: dict[str, Floats] = {}  # (2, panels)
        self.last: dict[str, float] = {}  # behind an event at the end
        self.error, self.throughput, self.unresolved = np.zeros(len(half)), 0.0, 0.0
        known: dict[str, Floats | float] = dict(parameters)

        def values(term: Term) -> Floats:
            for name in term.names:
                if name not in known:
                    known[name] = found.time if name == "time" else found[name]
            with np.errstate(all="ignore"):
                result = np.asarray(term.function(*(known[n] for n in term.names)), float)
            return np.broadcast_to(result, found.time.shape)

        def at_nodes(values: Floats) -> Floats:
            return values[:-1].reshape(len(half), len(NODES))

        def integral(term: Term) -> Floats:
            power = at_nodes(values(term)) * half[:, None]
            whole: Floats = power @ KRONROD
            self.error += np.abs(whole - power @ GAUSS)
            self.throughput += float(np.abs(power) @ KRONROD @ np.ones(len(half))) / 2
            return whole

        def at_slow_speeds(term: Term) -> float:
            speeds, total = [k for k, name in enumerate(term.names) if name.startswith("der(")], 0.0
            for slow in speeds:
                given = [known[name] if k not in speeds else slowest * (k == slow) for k, name in enumerate(term.names)]
                with np.errstate(all="ignore"):
                    power = np.broadcast_to(np.abs(term.function(*given)), found.time.shape)
                total += float((at_nodes(power) @ KRONROD) @ half) / 2
            return total

        for part in parts:
            try:
                self.through[part.path] = integral(part.through)
                self.unresolved += at_slow_speeds(part.through)
                for term, kept in ((part.heat_in, self.heat_in), (part.heat, self.heat), (part.supplied, self.supplied)):
                    if term is not None:
                        kept[part.path] = integral(term)
                if part.stored is not None:
                    energy = values(part.stored)
                    self.ends[part.path], self.last[part.path] = ENDS @ at_nodes(energy).T, float(energy[-1])
            except NameLookupError:  # the equations do not determine a speed: the power is unknown
                self.unknown.append(part.path)

    def summed(self, time: Floats, place: NDArray[np.int64], at_event: NDArray[np.bool_], rtol: float) -> EnergyBalance:
        n = len(self.error)

        def over_time(panels: Floats) -> Floats:
            total: Floats = np.concatenate([[0.0], np.cumsum(panels)])[place]
            return total

        zero = np.zeros(n)
        work: dict[str, Floats] = {}
        heat = {path: over_time(panels) for path, panels in self.heat.items()}
        stored: dict[str, Floats] = {}
        jumps: dict[str, Floats] = {}
        residuals: dict[str, Floats] = {}
        unaccounted: dict[str, Floats] = {}
        returned = np.zeros(len(time))
        for part in self.parts:
            path = part.path
            if path in self.unknown:
                continue
            through, heat_in = self.through[path], self.heat_in.get(path)
            supplied = self.supplied.get(path, zero)
            if not part.declares:
                unaccounted[path] = over_time(through + (zero if heat_in is None else heat_in))
                continue
            if part.source:
                supplied = self.heat.get(path, zero) - through
            if part.source or part.supplied is not None:
                work[path] = over_time(supplied)
            left = self.heat.get(path, zero) - supplied - through
            if part.stored is not None:
                start, end = self.ends[path]
                start = np.append(start, self.last[path] if at_event[-1] else end[-1])
                stored[path] = start[place]
                gap = np.append(0.0, start[1:] - end)  # jumps at the breakpoints
                jump = np.cumsum(np.where(at_event, gap, 0.0))[place]
                if np.abs(jump).max() > 1e-9 * np.abs(self.ends[path]).max():
                    jumps[path] = jump
                residual = stored[path] - stored[path][0] - (jump if path in jumps else 0.0) + over_time(left)
            else:
                residual = over_time(left)
            if heat_in is not None:
                returned = returned - over_time(heat_in)
                residual = residual - over_time(heat_in + self.heat.get(path, zero))
            residuals[path] = residual
        sums = [sum(values.values(), np.zeros(len(time))) for values in (stored, work, jumps, heat, unaccounted)]
        throughput = self.throughput + float(sum(np.abs(e - e[0]).max() for e in stored.values()))
        residual = sums[0] - sums[0][0] - sums[1] - sums[2] + sums[3] - returned + sums[4]
        return EnergyBalance(
            time, work, stored, heat, returned, jumps, unaccounted, tuple(dict.fromkeys(self.unknown)), residuals, residual,
            throughput, float(self.error.sum()), rtol, self.unresolved,
        )  # fmt: skip


def explained(found: EnergyBalance, tighter: Callable[[float], EnergyBalance]) -> bool:
    """Whether the run's tolerance explains a residual: it is small, or shrinks with the tolerance."""
    allowed = EXPLAINED * found.rtol + 10 * found.quadrature / max(found.scale, 1e-300)
    if found.unknown or found.relative_residual <= allowed:
        return True
    try:
        finer = tighter(max(found.rtol / 100, 1e-12))
    except GearlibError:
        return False
    return finer.largest_residual <= max(allowed * finer.scale, found.largest_residual) / 10
