"""Campbell diagrams: natural frequencies over speed, excitation orders, critical speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import by_name, check_axes, increasing, real, reals, shown
from gearlib.drawing.printed import fitted
from gearlib.drawing.style import COLOURS, MARK
from gearlib.errors import ArgumentError
from gearlib.optional import optional
from gearlib.progress import RunProgress, check_progress, reporting
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled
from gearlib.vibration.mode_matching import branches, same_modes
from gearlib.vibration.modes import Modes, modes

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
RPM = 30 / np.pi  # 1/min per rad/s
MEETS = 1e-6  # of a frequency: a mode that is farther from the order has jumped over it


@dataclass(frozen=True)
class Crossing:
    """A critical speed, where an excitation order meets a natural frequency.

    Attributes
    ----------
    speed : float
        Speed of the reference shaft, rad/s.
    order : str
        Name of the excitation.
    mode : int
        Index of the mode in `modes` at the operating point of that speed, counting free motions: ``modes.draw(mode)`` shows it.
    frequency : float
        Hz.
    damping : float
        Damping ratio of the mode there.
    """

    speed: float
    order: str
    mode: int
    frequency: float
    damping: float


@dataclass(frozen=True, eq=False)
class Campbell:
    """Natural frequencies over speed, and their crossings with excitation orders.

    Attributes
    ----------
    speeds : array (speeds,)
        Speeds of the reference shaft, rad/s.
    frequencies, damping : arrays (speeds, modes)
        Hz, and ratios; modes are tracked by the similarity of their shapes. NaN where a mode does not oscillate, as inside a gap.
    modes : array of int (speeds, modes)
        Indices of these modes in `modes` at each speed, where free motions are counted, too; they are omitted here. -1: none.
    conditions : tuple of str
        Operating points in words, such as "open: mesh m".
    orders : dict of str to float
        Events per revolution of the reference shaft.
    crossings : tuple of Crossing
        Sorted by speed.
    """

    speeds: Floats
    frequencies: Floats
    damping: Floats
    modes: NDArray[np.int64]
    orders: dict[str, float]
    crossings: tuple[Crossing, ...]
    conditions: tuple[str, ...] = ()

    def to_dataframe(self) -> pandas.DataFrame:
        """The crossings as a pandas DataFrame."""
        pandas = optional("pandas")

        rows = [(c.speed, c.speed * RPM, c.order, c.mode, c.frequency, c.damping) for c in self.crossings]
        return pandas.DataFrame(
            rows, columns=["speed, rad/s", "speed, 1/min", "order", "mode", "frequency, Hz", "damping ratio"]
        )

    def __str__(self) -> str:
        lines = ["speed, 1/min   order                 mode   frequency, Hz    damping"]
        lines += [
            f"{c.speed * RPM:12.6g}   {c.order:<20}  {c.mode:4d}   {c.frequency:13.6g}  {c.damping:9.5f}"
            for c in self.crossings
        ]
        lines = lines if self.crossings else ["no order meets a natural frequency in this range of speed"]
        return fitted("\n".join([*lines, *([f"Operating point: {'; '.join(self.conditions)}."] if self.conditions else [])]))

    @property
    def highest(self) -> float:
        """Upper limit of the diagram (Hz): the range of the excitations, and at least one natural frequency."""
        excited = max((float(_excited(order, self.speeds).max()) for order in self.orders.values()), default=np.inf)
        lowest, highest = (f.reduce(self.frequencies, None, initial=x) for f, x in ((np.fmin, np.inf), (np.fmax, 0.0)))
        return float(1.1 * min(max(excited, lowest), highest)) or 1.0

    def plot(self, *, axes: Any = None) -> Any:
        """Plot the diagram; returns the matplotlib axes."""
        plt = optional("matplotlib.pyplot")

        if axes is None:
            _, axes = plt.subplots(figsize=(9, 5.5), layout="constrained")
        check_axes(axes, 1)
        rpm = self.speeds * RPM
        for k in range(self.frequencies.shape[1]):
            axes.plot(rpm, self.frequencies[:, k], color="black", lw=1.2, label="natural frequencies" if not k else None)
            i = int(np.argmax(self.modes[:, k] >= 0))  # where it begins
            start = (rpm[i], self.frequencies[i, k])
            axes.annotate(
                f"{self.modes[i, k]}", start, xytext=(-3, 0), textcoords="offset points", fontsize=8, ha="right", va="center"
            )
        for k, (name, order) in enumerate(self.orders.items()):
            colour = COLOURS[k % len(COLOURS)]
            axes.plot(rpm, _excited(order, self.speeds), color=colour, lw=1.2, ls="--", label=f"{name} (order {order:g})")
        if self.crossings:
            x, y = [c.speed * RPM for c in self.crossings], [c.frequency for c in self.crossings]
            axes.plot(x, y, "o", color=MARK, ms=5, label="crossings")
            for c in self.crossings:
                axes.annotate(
                    f"{c.mode}",
                    (c.speed * RPM, c.frequency),
                    xytext=(5, -9),
                    textcoords="offset points",
                    fontsize=8,
                    color=MARK,
                )
        axes.set_xlim(rpm[0] - 0.02 * np.ptp(rpm), rpm[-1])
        axes.set_ylim(0, self.highest)
        axes.set_xlabel("speed of the reference shaft, 1/min")
        axes.set_ylabel("frequency, Hz")
        axes.set_title("Campbell diagram")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
        return axes


def campbell(
    system: Compiled, speeds: ArrayLike, orders: Mapping[str, float] | Sequence[float], *, count: int | None = None,
    at: Callable[[float], Any] | Any = None, parameters: Callable[[float], Mapping[str, float]] | Mapping[str, float] | None = None,
    progress: Any = False,
) -> Campbell:  # fmt: skip
    """Campbell diagram of a system, with the crossings of orders and natural frequencies.

    Parameters
    ----------
    system : System
    speeds : array
        Speeds of the reference shaft, rad/s, increasing; with 0, if there are speeds of both signs. Where frequencies depend on the
        speed, two crossings between neighbouring speeds are not seen; take them close enough.
    orders : mapping of str to float, or sequence of float
        Events per revolution of the reference shaft: 1 for unbalance, the number of teeth for a mesh on that shaft, multiplied by the
        speed ratio for a mesh on another shaft. Signs do not matter, whether of ratios or of speeds.
    count : int, optional
        Number of oscillating modes, from the lowest.
    at, parameters
        Operating point and parameters as for `System.linearize`, or functions of the speed that return them: where natural frequencies
        depend on speed or load, they are then computed at every speed.
    progress : bool or callable
        True shows a bar on a terminal; a callback receives the fraction of the speeds done, and the elapsed seconds.

    Returns
    -------
    Campbell

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Rotor(gl.Component):
    ...     def assemble(self):
    ...         self.ground, self.shaft, self.disc = gp.Fixed(), gp.Spring(c=400.0), gp.Inertia(J=1.0)
    ...         return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]
    >>> diagram = gl.campbell(gl.compile(Rotor()), [0.0, 30.0], {"mesh, 2 teeth": 2.0})
    >>> [(round(c.speed, 9), c.order) for c in diagram.crossings]
    [(10.0, 'mesh, 2 teeth')]
    """
    translation_of(system)
    grid = increasing("speeds", speeds, 2, ", rad/s")
    if grid[0] < 0 < grid[-1] and 0.0 not in grid:
        raise ArgumentError(
            f"speeds go from {grid[0]:g} to {grid[-1]:g} rad/s without 0, where the excitation has a corner; add it"
        )
    named = _named(orders)

    def at_speed(speed: float) -> Modes:
        point, values = _at(speed, "at", at), _at(speed, "parameters", parameters)
        return modes(system, count, at=point, parameters=values)

    varies = callable(at) or callable(parameters)
    check_progress(progress)
    with reporting(progress, f"Campbell diagram, {len(grid)} speeds") as tell:
        watch = None if tell is None else RunProgress(tell, float(grid[0]), float(grid[-1]))
        runs: list[Modes] = []
        for w in grid:
            runs.append(at_speed(float(w)) if varies or not runs else runs[0])
            if watch is not None:
                watch(float(w))
        if watch is not None:
            watch.end(float(grid[-1]))
    places = _followed(runs) if varies else np.tile(_followed(runs[:1]), (len(grid), 1))
    frequencies, damping = (_of_modes(runs, places, what) for what in ("frequencies", "damping"))
    crossings = [c for given in named.items() for c in _crossings(at_speed if varies else None, runs, grid, places, *given)]
    found = {(c.order, c.mode, round(c.speed, 9)): c for c in crossings}
    said = tuple(dict.fromkeys(text for run in runs for text in run.conditions))
    return Campbell(grid, frequencies, damping, places, named, tuple(sorted(found.values(), key=lambda c: c.speed)), said)


def _excited(order: float, speeds: ArrayLike) -> Floats:
    """Frequency of an excitation, Hz; the sense of rotation does not matter."""
    return np.asarray(np.abs(order * np.asarray(speeds)) / (2 * np.pi))


def _at(speed: float, name: str, given: Any) -> Any:
    """Value at a speed; a user's function may fail."""
    if not callable(given):
        return given
    try:
        return given(speed)
    except Exception as problem:
        raise ArgumentError(
            f"{name}, a function, raised {type(problem).__name__} at {speed:g} rad/s: {problem}; expected a function of the speed"
        ) from problem


def _named(orders: Mapping[str, float] | Sequence[float]) -> dict[str, float]:
    """The orders, keyed by name."""
    if isinstance(orders, Mapping):
        named = by_name("orders", orders, "orders by name, such as {'mesh': 21}", "mesh")
        return {name: real(f"order {name}", order) for name, order in named.items()}
    expected = "events for each revolution: a sequence of numbers, or a mapping of names to numbers, such as {'mesh': 21}"
    found = reals("orders", orders, expected)
    if found.ndim != 1:
        raise ArgumentError(f"orders is {shown(orders)}; expected {expected}")
    names = [f"{order:g}" for order in found.tolist()]  # with all digits where two would share a name
    return {name if names.count(name) == 1 else repr(x): x for name, x in zip(names, found.tolist(), strict=True)}


def _followed(runs: Sequence[Modes]) -> NDArray[np.int64]:
    """Indices of the modes at each speed, with each tracked mode in its own column; -1 where it has none."""
    free = np.array([[run.free] for run in runs])
    some = [i for i, run in enumerate(runs) if len(run) > run.free]
    found = branches(zip(some, [-1, *some], strict=False), _shapes(runs), [run.frequencies[run.free :] for run in runs])
    return np.where(found < 0, -1, found + free)


def _shapes(runs: Sequence[Modes]) -> list[NDArray[np.complex128]]:
    """Shapes of the oscillating modes in the states of all runs; those that friction holds in a run do not move there."""
    place = {name: k for k, name in enumerate(dict.fromkeys(name for run in runs for name in run.states))}
    found = [np.zeros((len(place), len(run) - run.free), complex) for run in runs]
    for table, run in zip(found, runs, strict=True):
        table[[place[name] for name in run.states]] = run.shapes[:, run.free :]
    return found


def _of_modes(runs: Sequence[Modes], places: NDArray[np.int64], what: str) -> Floats:
    """A number of each tracked mode at each speed, NaN where it has none."""
    return np.array([np.append(getattr(run, what), np.nan)[own] for run, own in zip(runs, places, strict=True)])


def _crossings(
    at_speed: Callable[[float], Modes] | None,
    runs: Sequence[Modes],
    grid: Floats,
    places: NDArray[np.int64],
    name: str,
    order: float,
) -> list[Crossing]:
    """Crossings of all modes with an order.

    Where a mode that is followed by its shape leaves its curve, as where two curves veer, speeds in between are taken.
    """
    gaps = _of_modes(runs, places, "frequencies").T - _excited(order, grid)
    cells: dict[int, list[Crossing]] = {}
    for k, i in np.argwhere(np.nan_to_num(np.diff(np.sign(gaps)))).tolist():
        cells.setdefault(i, []).append(_crossing(at_speed, runs[i], grid, gaps, places, i, k, name, order))
    found = []
    for i, own in cells.items():
        if all(abs(c.frequency - _excited(order, c.speed)) <= MEETS * c.frequency for c in own):
            found += own
            continue
        middle = float(grid[i : i + 2].mean())
        if at_speed is None or np.diff(grid[i : i + 2]) <= MEETS * np.abs(grid[i : i + 2]).max():
            raise ArgumentError(
                f"modes cannot be followed at {middle:g} rad/s, where their shapes change; take speeds closer there"
            )
        within = [runs[i], at_speed(middle), runs[i + 1]]
        found += _crossings(at_speed, within, np.array([grid[i], middle, grid[i + 1]]), _followed(within), name, order)
    return found


def _crossing(
    at_speed: Callable[[float], Modes] | None, last: Modes, grid: Floats, gaps: Floats, places: NDArray[np.int64], i: int, k: int,
    name: str, order: float,
) -> Crossing:  # fmt: skip
    """Crossing between two speeds: exact for constant frequencies, otherwise iterated with the modes at each speed."""
    gap, mode = gaps[k, i : i + 2], int(places[i, k])
    speed = float(grid[i] + (grid[i + 1] - grid[i]) * gap[0] / (gap[0] - gap[1]))
    f, ratio = float(last.frequencies[mode]), float(last.damping[mode])
    if at_speed is not None:
        from scipy.optimize import brentq

        own = np.flatnonzero(places[i] >= 0)
        ends = dict(zip(grid[i : i + 2].tolist(), gap.tolist(), strict=True))

        def followed(w: float) -> tuple[float, float, int]:
            found = at_speed(w)
            before, now = _shapes([last, found])
            before = before[:, places[i, own] - last.free]
            columns, chosen = same_modes(before, last.frequencies[places[i, own]], now, found.frequencies[found.free :])
            j = dict(zip(own[columns].tolist(), (found.free + chosen).tolist(), strict=True)).get(k)
            if j is None:
                raise ArgumentError(
                    f"mode {mode} at {grid[i]:g} rad/s does not oscillate at {w:g} rad/s; take speeds in between"
                )
            return float(found.frequencies[j]), float(found.damping[j]), j

        def distance(w: float) -> float:
            return ends[w] if w in ends else followed(w)[0] - float(_excited(order, w))

        speed = float(brentq(distance, grid[i], grid[i + 1], xtol=1e-10 * np.abs(grid[i : i + 2]).max()))
        f, ratio, mode = followed(speed)
    return Crossing(speed, name, mode, f, ratio)
