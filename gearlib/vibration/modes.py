"""`modes`: natural frequencies, damping, mode shapes and modal energy distribution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import one_name, shown
from gearlib.arguments import whole as whole_number
from gearlib.drawing.page import paragraph, table
from gearlib.drawing.printed import COLUMNS, fitted, shortened
from gearlib.drawing.scheme.shown_motion import ShownMotion
from gearlib.drawing.scheme.stick_diagram import Scheme
from gearlib.drawing.scheme.train import Train, members
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.flatten.model import FlatModel
from gearlib.language.component import Component
from gearlib.language.declarations import Flow, Potential
from gearlib.language.outline import train_in
from gearlib.linear.condition import conditions, described, frozen, matters_elsewhere
from gearlib.linear.eigenvalue_changes import eigenvalue_changes
from gearlib.linear.held_states import remaining
from gearlib.linear.linear_model import full
from gearlib.linear.linearize import refuse_infinite, refuse_undetermined
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import fitting, operating_point
from gearlib.linear.poles import warn_of_rounding
from gearlib.optional import optional
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import needed_states, node_name
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled
from gearlib.structure.incidence import Node
from gearlib.vibration.animate_mode import animate_mode
from gearlib.vibration.draw_mode import ModePicture, aligned, draw_mode
from gearlib.vibration.mode_energies import Family, energies, families, moving_alone
from gearlib.vibration.mode_sensitivity import ModeSensitivity, mode_sensitivity
from gearlib.vibration.spectrum import Spectrum, dense_spectrum, sparse_spectrum, without_preloads

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
MOST_DENSE = 500  # states up to which all eigenvalues are computed
COLUMN = 33  # column at which energies are printed
ALONE = 1e-6  # of the largest amplitude: what moves that much inside of a component, without its flanges, stores energy unseen
UNSURE = 1e-3  # of a mode's energy: shares with a larger error bound are not reported
SLOW = 1e-3  # of the lowest frequency: at this one, what is inside of components follows a free motion
AT_REST = 1e-9  # of a mode's largest amplitude: rounding
NEGATIVE = 1e-6  # of a mode's energy: a more negative energy is not rounding


@dataclass(frozen=True, eq=False)
class _Shares:
    """Energy shares (percent) of the components that store energy in some mode, which of them move, and why modes have no shares."""

    numbers: list[int]
    kinetic: Floats
    potential: Floats
    bodies: NDArray[np.bool_]
    unknown: dict[int, str]


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a system about an operating point: free motions first, then sorted by natural frequency.

    Attributes
    ----------
    eigenvalues : complex array (modes,)
        Rad/s; one of each conjugate pair. 0 for free motions.
    shapes : complex array (states, modes)
        Amplitudes of the states.
    states : tuple of str
    free : int
        Number of free motions (rigid-body motions), in which no spring is strained.
    preloads : int or None
        Poles at 0 that are not motions but constant preloads locked into a loop of meshes (not counted for large systems).
    positions : tuple of str
        States on which nothing depends, each a pole at 0 of neither kind: the phase of a mesh, a position inside an open gap.
    gaps : dict of int to str
        Free motions that are relative motions across something open, with the description of that.
    conditions : tuple of str
        Operating point in words, such as "open: mesh m".
    decays : array
        Poles (1/s) of non-oscillating, decaying motions; for large systems those not much faster than the modes.
    """

    eigenvalues: Complexes
    shapes: Complexes
    states: tuple[str, ...]
    free: int
    preloads: int | None
    decays: Floats
    positions: tuple[str, ...]
    gaps: dict[int, str]
    conditions: tuple[str, ...]
    _model: FlatModel
    _rows: Any  # (variables, states): amplitude of each representative variable ...
    _orders: Any  # ... in this derivative order, -1 where unknown
    _find_families: Callable[[], list[Family]]
    _preloaded: bool  # whether the free motions include preloads
    _find_changes: Callable[[Sequence[str]], list[ModeSensitivity]]
    _component: Component

    def __len__(self) -> int:
        return len(self.eigenvalues)

    @property
    def omega(self) -> Floats:
        """Natural angular frequencies, rad/s."""
        return np.abs(self.eigenvalues)

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies (Hz): magnitude of the eigenvalue over 2 pi (the undamped ones where damping is proportional)."""
        result: Floats = self.omega / (2 * np.pi)
        return result

    @property
    def damped_frequencies(self) -> Floats:
        """Damped frequencies, Hz."""
        result: Floats = np.abs(self.eigenvalues.imag) / (2 * np.pi)
        return result

    @property
    def damping(self) -> Floats:
        """Damping ratios; 0 for free motions."""
        size = self.omega
        return np.divide(0.0 - self.eigenvalues.real, size, out=np.zeros(len(size)), where=size > 0)

    def amplitudes(self, mode: int) -> Complexes:
        """Complex amplitude of every representative variable; for free motions, rates are real and finite."""
        self._check(mode)
        s = self._s(mode)
        known = np.asarray(self._rows @ self.shapes[:, mode]).ravel()
        with np.errstate(all="ignore"):
            value = known / s**self._orders
        if self.eigenvalues[mode] == 0 and self._preloaded:  # what neither moves nor is moved is a preload
            value = np.where((self._orders == 0) & ~self._are_speeds, 1j * value.imag, value)
        return np.where(self._orders < 0, 0.0, value)

    def _s(self, mode: int) -> complex:
        value = complex(self.eigenvalues[mode])
        return value if value else 1j * _slowest(self.eigenvalues)

    @cached_property
    def _are_speeds(self) -> NDArray[np.bool_]:
        model = self._model
        return np.array([model.unit(v) in ("rad/s", "m/s") for v in range(model.n_variables)], bool)

    def shape(self, mode: int, *names: str) -> Complexes:
        """Complex amplitudes of variables (or derivatives, ``"der(load.w)"``) in a mode.

        For a free motion these are the limits for a slow oscillation, so that ratios of speeds are right.
        """
        self._check(mode)
        amplitude, s = self.amplitudes(mode), self._s(mode)
        result = []
        for name in names:
            base, order = self._model.column(name)
            v = self._model.variable(base)
            rep = int(self._model.representative[v])
            if self._model.sign[v] and self._orders[rep] < 0:
                raise NameLookupError(f"{name} has no amplitude in the mode; {nearest(name, self.states)}")
            result.append(int(self._model.sign[v]) * amplitude[rep] * s**order)
        return np.array(result)

    def _check(self, mode: int) -> None:
        if isinstance(mode, bool) or not isinstance(mode, (int, np.integer)) or not -len(self) <= mode < len(self):
            raise ArgumentError(f"there is no mode {shown(mode)}; there are {len(self)}, from 0")

    @cached_property
    def _families(self) -> list[Family]:
        return self._find_families()

    @cached_property
    def components(self) -> tuple[str, ...]:
        """Components that store energy in some mode, in model order."""
        return tuple(self._model.instances[i].name for i in self._energies.numbers)

    @cached_property
    def _energies(self) -> _Shares:
        numbers = [i for family in self._families for i in family.instances]
        kinetic, potential, off, alone, untold = (np.zeros((len(self), len(numbers))) for _ in range(5))
        for mode, value in enumerate(self.eigenvalues):
            amplitude, s = self.amplitudes(mode), self._s(mode)
            omega = abs(s) * (1.0 if value else SLOW)
            parts = [energies(family, amplitude, omega, s) for family in self._families]
            if parts:
                kinetic[mode], potential[mode], off[mode] = (np.concatenate(kind) for kind in zip(*parts, strict=True))
                potential[mode] *= bool(value)
            if parts and value:
                sizes = self._sizes(amplitude)
                alone[mode] = np.concatenate([moving_alone(family, amplitude, s, sizes) for family in self._families])
                if self._untold.any():
                    moved = [sum(map(abs, energies(family, self._untold, omega, s))) for family in self._families]
                    untold[mode] = np.concatenate(moved)
        unknown = self._unknown_shares(numbers, kinetic, potential, off, alone, untold)
        for shares in (kinetic, potential):
            np.maximum(shares, 0.0, out=shares)  # smaller values are rounding, or are not reported
            total = shares.sum(axis=1, keepdims=True)
            np.divide(100 * shares, total, out=shares, where=total > 0)
            shares[:, shares.max(axis=0, initial=0.0) < 1e-5] = 0.0  # percent: rounding in components without energy
        order = [k for k in np.argsort(numbers) if kinetic[:, k].any() or potential[:, k].any()]
        kinetic, potential = kinetic[:, order], potential[:, order]
        bodies = np.asarray(kinetic.any(axis=0), bool)
        for shares in (kinetic, potential):
            shares[list(unknown)] = np.nan
        return _Shares([numbers[k] for k in order], kinetic, potential, bodies, unknown)

    @cached_property
    def _untold(self) -> Complexes:
        """1 for each potential whose amplitude is not known, 0 for others, and for what is given from outside, which is held."""
        found = np.where(self._model.potential & (self._orders < 0), 1.0 + 0j, 0.0)
        found[self._model.representative[self._model.inputs]] = 0.0
        return found

    def _sizes(self, amplitude: Complexes) -> Floats:
        """Of each variable that moves the largest amplitude in its unit; of others it is infinite."""
        sizes = np.full(len(amplitude), np.inf)
        for own in self._alike:
            sizes[own] = np.abs(amplitude[own]).max(initial=1e-300)
        return sizes

    @cached_property
    def _alike(self) -> list[NDArray[np.int64]]:
        """Positions and speeds whose amplitudes are known, by unit."""
        units = np.array([self._model.unit(v) for v in range(len(self._orders))])
        return [np.flatnonzero((units == unit) & (self._orders >= 0)) for unit in ("rad", "rad/s", "m", "m/s")]

    def _unknown_shares(
        self, numbers: list[int], kinetic: Floats, potential: Floats, off: Floats, alone: Floats, untold: Floats
    ) -> dict[int, str]:
        """Modes without energy shares, with the reasons."""
        unknown: dict[int, str] = {}
        if not numbers:
            return unknown
        for mode in range(len(self)):
            total = max(np.abs(kinetic[mode]).sum(), np.abs(potential[mode]).sum())
            paths = [
                self._model.instances[numbers[int(k)]].name
                for k in (off[mode].argmax(), kinetic[mode].argmin(), potential[mode].argmin())
            ]
            if untold[mode].any():
                stores = self._model.instances[numbers[int(untold[mode].argmax())]].name
                unknown[mode] = f"{stores} stores energy as a flange moves whose amplitude needs the derivative of an input"
            elif alone[mode].max() > ALONE:
                inside = self._model.instances[numbers[int(alone[mode].argmax())]].name
                unknown[mode] = f"inside of {inside} something moves that its flanges do not"
            elif off[mode].sum() > UNSURE * total:
                unknown[mode] = (
                    f"{paths[0]} stores energy and damps inside, which its equations at the flanges do not tell apart"
                )
            elif kinetic[mode].min() < -NEGATIVE * total:
                unknown[mode] = f"the kinetic energy of {paths[1]} is negative"
            elif potential[mode].min() < -NEGATIVE * total:
                unknown[mode] = f"the potential energy of {paths[2]} is negative: its stiffness pushes away"
        return unknown

    @property
    def kinetic(self) -> Floats:
        """Percentage of each component in the mode's kinetic energy, shape (modes, components); NaN where `not_given`."""
        return self._energies.kinetic

    @property
    def potential(self) -> Floats:
        """Percentage of each component in the mode's potential energy; 0 for free motions, NaN where `not_given`."""
        return self._energies.potential

    @property
    def not_given(self) -> dict[int, str]:
        """Modes for which no energy shares are reported, with the reasons."""
        return self._energies.unknown

    def motions(self, mode: int) -> list[tuple[str, str, complex]]:
        """Amplitudes of the bodies: (component, "rad" or "m", amplitude) for those with kinetic energy in some mode."""
        self._check(mode)
        result = []
        for number, moves in zip(self._energies.numbers, self._energies.bodies, strict=True):
            instance = self._model.instances[number]
            own = [
                (n, d.unit)
                for n, d in instance.declared.variables.items()
                if isinstance(d, Potential) and d.unit in ("rad", "m")
            ]
            if moves and own:
                first = [(n, unit) for n, unit in own if n.split(".")[0] == own[0][0].split(".")[0]]
                value = self.shape(mode, *(f"{instance.path}.{n}" if instance.path else n for n, _ in first))
                labels = [n.rsplit(".", 1)[1] for n, _ in first]
                for (_, unit), label, amplitude in zip(first, labels, value, strict=True):
                    result.append((instance.name + (f".{label}" if len(first) > 1 else ""), unit, complex(amplitude)))
        return result

    def sensitivity(self, parameter: str) -> ModeSensitivity:
        """Derivatives of eigenvalues, frequencies and damping ratios with respect to a parameter, from exact derivatives.

        Everything bound to the parameter changes with it, and so does the operating point: start values, or the steady state. For modes
        of equal frequency these are the derivatives of the branches into which the change splits it.

        Parameters
        ----------
        parameter : str
            Path.

        Returns
        -------
        ModeSensitivity

        Raises
        ------
        ArgumentError, NameLookupError, SolverError
            Unknown parameter, or no derivative with respect to it; the message says why.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Rotor(gl.Component):
        ...     def assemble(self):
        ...         self.ground, self.shaft, self.disc = gp.Fixed(), gp.Spring(c=400.0), gp.Inertia(J=1.0)
        ...         return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]
        >>> print(gl.modes(gl.compile(Rotor())).sensitivity("shaft.c"))
        Change with shaft.c = 400 N.m/rad
        mode  frequency, Hz per N.m/rad       damping ratio    frequency, % per % of the parameter
           0                      0.00397887              0    0.5000
        """
        return self._find_changes([one_name("parameter", parameter, "shaft.c")])[0]

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per mode: frequencies, damping, and energy shares in columns ``("kinetic", component)``, as a pandas DataFrame."""
        pandas = optional("pandas")

        table = {
            ("mode", "frequency, Hz"): self.frequencies,
            ("mode", "damped frequency, Hz"): self.damped_frequencies,
            ("mode", "damping ratio"): self.damping,
        }
        for kind, shares in (("kinetic, %", self.kinetic), ("potential, %", self.potential)):
            table |= {(kind, c): shares[:, k] for k, c in enumerate(self.components) if shares[:, k].any()}
        return pandas.DataFrame(table, index=pandas.RangeIndex(len(self), name="mode"))

    def __str__(self) -> str:
        most = [[self._largest(shares[k]) for shares in (self.kinetic, self.potential)] for k in range(len(self))]
        width = max([34, *(len(kinetic) for kinetic, _ in most)])
        if COLUMN + width + 2 + max([0, *(len(potential) for _, potential in most)]) > COLUMNS:
            return fitted("\n".join([*self._below_each_other(), *self._remarks]))
        lines = [f"mode  frequency, Hz    damping   {'kinetic energy':{width}}  potential energy"]
        for k, (kinetic, potential) in enumerate(most):
            line = f"{k:4d}  {self.frequencies[k]:13.6g}  {self.damping[k]:9.5f}   {kinetic:{width}}  {potential}"
            lines.append(line.rstrip())
        return fitted("\n".join([*lines, *self._remarks]))

    def _below_each_other(self) -> list[str]:
        """Layout for long names: a mode's potential energy is printed below its kinetic energy."""
        lines = [f"{'mode  frequency, Hz    damping':{COLUMN}}kinetic energy, and potential energy below it"]
        for k in range(len(self)):
            kinetic, potential = (self._largest(shares[k], 26) for shares in (self.kinetic, self.potential))
            lines.append(f"{f'{k:4d}  {self.frequencies[k]:13.6g}  {self.damping[k]:9.5f}':{COLUMN}}{kinetic}".rstrip())
            lines += [" " * COLUMN + potential] if potential else []
        return lines

    @property
    def _remarks(self) -> list[str]:
        """Notes printed below the modes."""
        lines = [f"Shares of energy of mode {k} are not given: {why}." for k, why in self.not_given.items()]
        lines += [f"Mode {k} is a free relative motion across {across}." for k, across in self.gaps.items()]
        if self.positions:
            lines.append(f"Nothing here depends on {', '.join(self.positions)}.")
        if self.conditions:
            lines.append(f"Operating point: {'; '.join(self.conditions)}.")
        if self.preloads is None:
            lines.append(f"Constant preloads in loops of meshes are not counted above {MOST_DENSE} states.")
        if self.preloads:
            are = "pole at 0 is a constant preload" if self.preloads == 1 else "poles at 0 are constant preloads"
            lines.append(f"Besides these, {self.preloads} {are}, locked into loops of meshes.")
        if len(self.decays):
            lines.append(f"Decays without oscillation, 1/s: {', '.join(f'{-d:.6g}' for d in self.decays[:8])}")
        return lines

    def _repr_html_(self) -> str:
        """Notebook representation: one line per mode, followed by the notes."""
        rows: list[list[str | float]] = [
            [float(k), float(f), float(d), *map(self._largest, (self.kinetic[k], self.potential[k]))]
            for k, (f, d) in enumerate(zip(self.frequencies, self.damping, strict=True))
        ]
        head = ["mode", "frequency, Hz", "damping", "kinetic energy", "potential energy"]
        return table(head, rows) + "".join(map(paragraph, self._remarks))

    def _largest(self, shares: Floats, longest: int = 1000) -> str:
        best = [i for i in np.argsort(-shares, kind="stable")[:2] if shares[i] > 0.5]
        return ", ".join(f"{shortened(self.components[i], longest)} {shares[i]:.0f} %" for i in best)

    def draw(self, mode: int, *, axes: Any = None) -> Any:
        """Draw a mode: amplitudes of the bodies, and energy shares. Returns the matplotlib axes."""
        return draw_mode(self._picture(mode), axes)

    def _picture(self, mode: int) -> ModePicture:
        """Data for drawing a mode."""
        self._check(mode)
        k, why = int(mode) % len(self), self.not_given.get(int(mode) % len(self))
        named = enumerate([] if why else self.components)
        shares = [(name, float(self.kinetic[k, i]), float(self.potential[k, i])) for i, name in named]
        return ModePicture(k, float(self.frequencies[k]), float(self.damping[k]), self.motions(k), shares, why)

    def animate(self, mode: int, *, frames: int = 48, degrees: float = 40.0) -> Any:
        """Animate a mode over one period: every body swings about its rest position. Returns a matplotlib ``FuncAnimation``.

        Keep a reference to it, and show or save it: ``animation.save("mode.gif", writer="pillow")``.

        Parameters
        ----------
        mode : int
        frames : int
            Frames per period.
        degrees : float
            Swing of the body that turns most.
        """
        return animate_mode(self._picture(mode), frames, degrees)

    def scheme(self, mode: int) -> Scheme:
        """Stick diagram of the train that shows a mode: every shaft has a dial whose hand swings, and bands in the colour of its sense.

        The picture moves where SVG is animated; amplitudes, senses and phases are readable without that, and a table below the drawing
        states them. Planets, which are shown inside of their set, do not move. The amplitude is constant over the period, even for
        damped modes.

        Parameters
        ----------
        mode : int

        Raises
        ------
        ArgumentError
            There is no such mode.
        ModelError
            Nothing rotates that a stick diagram could show (see `Component.scheme`).

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> gl.modes(gl.compile(gp.ZhouCui2022())).scheme(0)
        <Scheme of ZhouCui2022: 5 shafts, 6 parts; save('train.svg') writes it>
        """
        self._check(mode)
        train = train_in(self._component)
        return Scheme(train, ShownMotion(self._picture(mode).title, self._turns(mode, train)))

    def _turns(self, mode: int, train: Train) -> dict[int, complex]:
        """Amplitude of each shaft of a stick diagram over the largest, where it is known."""
        found: dict[int, str] = {}
        for shaft, symbol, port in members(train):
            own = symbol.icon == "port" or symbol.name == train.name  # of the model itself, not of a part
            name = self._angles.get(port if own else f"{symbol.name}.{port}")
            if name is not None:
                found.setdefault(shaft, name)
        values = self.shape(mode, *found.values())
        largest = max([*np.abs(values), *(abs(value) for _, _, value in self.motions(mode))], default=0.0)
        values = np.where(np.abs(values) > AT_REST * largest, values, 0.0)
        turns = aligned([(str(shaft), "rad", complex(value)) for shaft, value in zip(found, values, strict=True)])
        return {int(shaft): value for shaft, _, value in turns}

    @cached_property
    def _angles(self) -> dict[str, str]:
        """Angles of all flanges by the paths of these, where the amplitude is known."""
        model, found = self._model, {}
        for instance in model.instances:
            for variable, (local, declared) in enumerate(instance.declared.variables.items(), instance.first_variable):
                known = not model.sign[variable] or self._orders[model.representative[variable]] >= 0
                if known and isinstance(declared, Potential) and declared.unit == "rad":
                    name = f"{instance.path}.{local}".lstrip(".")
                    found[name.rpartition(".")[0]] = name
        return found


def modes(
    system: Compiled, count: int | None = None, *, at: Any = None, parameters: Mapping[str, float] | None = None
) -> Modes:
    """Natural frequencies, damping ratios and mode shapes, with the energy of each component.

    Parameters
    ----------
    system : System
    count : int, optional
        Number of oscillating modes, from the lowest; by default all (20 above 500 states, where sparse matrices are used).
    at : None, "steady", mapping, or (Result, time)
        Operating point, as for `System.linearize`.
    parameters : mapping, optional
        Values by path.

    Returns
    -------
    Modes

    Raises
    ------
    SolverError
        The equations leave a speed undetermined at that point.

    Notes
    -----
    For a repeated frequency the shapes are one choice of basis, and so are the energy shares of each mode; their sums are unique.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Pair(gl.Component):
    ...     def assemble(self):
    ...         self.a, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
    ...         return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]
    >>> found = gl.modes(gl.compile(Pair()))
    >>> print(found)
    mode  frequency, Hz    damping   kinetic energy                      potential energy
       0              0    0.00000   b 75 %, a 25 %
       1       0.31831    0.00000   a 75 %, b 25 %                      shaft 100 %
    """
    translation = translation_of(system)
    if count is not None:
        count = whole_number("count", count, 1)
    translation = fitting(translation, at, parameters)
    structure = translation.structure
    states = _moving_states(structure)
    scene, numbers, point = operating_point(translation, states, at, parameters)
    nodes = _amplitude_nodes(structure, states)
    program = build(structure, nodes.items(), states, dynamic=True)
    prepared = prepare(program, structure, numbers)
    rates = [program.slots[v, k + 1] for v, k in states]
    linearized = LinearizedProgram(scene, prepared, point, tuple(range(len(states))))
    refuse_undetermined(linearized)
    slots, discrete, d = linearized.slots, linearized.discrete, linearized.derivatives
    A = whole = d[rates]
    refuse_infinite([node_name(structure.model, (v, k + 1)) for v, k in states], A)
    n_variables = structure.model.n_variables
    orders = np.full(n_variables, -1)
    pick = np.zeros(n_variables, np.int64)
    for v, k in nodes.items():
        if (v, k) in program.slots:
            orders[v], pick[v] = k, program.slots[v, k]
    rows, kept = d[pick], states
    left = remaining(structure, prepared, point.t, slots, discrete, A)
    if left is None:
        linearized.warn_of_corners(rates)
    else:
        linearized.warn_of_corners([rates[i] for i in left.keep], left.basis)
        A, rows, kept = A[left.keep] @ left.basis, rows @ left.basis, tuple(states[i] for i in left.keep)
    angles = any(k == 0 and structure.model.potential[v] for v, k in states)
    speeds, forces = rows[np.flatnonzero(orders == 1)], rows[_forces(structure.model, orders)]
    spectrum = _spectrum(A, speeds, forces, count, angles)
    if spectrum.found is not None:
        warn_of_rounding(translation.name, [node_name(structure.model, s) for s in kept], A, spectrum.found)
    free, alone = without_preloads(A, speeds, spectrum.free)
    unused, words = _unused(A, speeds, forces), conditions(scene, numbers, point)
    eigenvalues = np.concatenate([np.zeros(spectrum.free.shape[1]), spectrum.values])
    carried = _carried(A, free) / (1j * _slowest(eigenvalues))

    def find_changes(names: Sequence[str]) -> list[ModeSensitivity]:
        """Derivatives for the whole matrix: held states have poles at 0 of their own, and affect no other mode."""
        found = eigenvalue_changes(whole, linearized.changes(names, rates), eigenvalues)
        table, units = structure.model.parameters, translation.parameter_units
        return [
            mode_sensitivity(name, units.get(name, ""), float(numbers[table.index[name]]), eigenvalues, change)
            for name, change in zip(names, found, strict=True)
        ]

    return Modes(
        eigenvalues, np.hstack([free + carried, spectrum.vectors]),
        tuple(node_name(structure.model, s) for s in kept), spectrum.free.shape[1], spectrum.preloads, spectrum.decays,
        tuple(described(structure, kept[i]) for i in unused), _gaps(structure, kept, A, free, unused, words.open),
        (*words.said, *frozen(linearized, rates)), structure.model, rows, orders,
        lambda: families(structure, prepared, slots, discrete, point.t), not alone, find_changes, translation.component,
    )  # fmt: skip


def _forces(model: FlatModel, orders: Any) -> Any:
    """Variables that are connector flows, as far as their amplitudes are known."""
    flows = [
        int(model.representative[v])
        for instance in model.instances
        for v, declared in enumerate(instance.declared.variables.values(), instance.first_variable)
        if isinstance(declared, Flow) and model.sign[v]
    ]
    found = np.unique(np.array(flows, np.int64))
    return found[orders[found] == 0]


def _unused(A: Any, speeds: Any, forces: Any) -> list[int]:
    """States on which no rate, speed or force depends."""
    total = sum(np.asarray(abs(m).sum(axis=0)).ravel() for m in (A, speeds, forces))
    return np.flatnonzero(total == 0).tolist()


def _gaps(
    structure: Structure, kept: tuple[Node, ...], A: Any, free: Complexes, unused: Sequence[int], open_: frozenset[str]
) -> dict[int, str]:
    """Free motions that change a deflection on which nothing depends here, since its component is open."""
    owners = {i: structure.model.name(kept[i][0]).rsplit(".", 1)[0] for i in unused}
    gaps = [i for i in unused if owners[i] in open_ and matters_elsewhere(structure, kept, kept[i])]
    result = {}
    if gaps:
        moved = _carried(A[gaps], free)
        for mode in range(free.shape[1]):
            across = [owners[i] for i, m in zip(gaps, moved[:, mode], strict=True) if m]
            if across:
                result[mode] = ", ".join(across)
    return result


def _carried(A: Any, free: Complexes) -> Complexes:
    """Rates of the states in free motions: of angles that are states, and of positions inside open gaps."""
    rates, sizes = np.asarray(A @ free), np.abs(free)
    rounding = np.asarray(abs(A) @ np.maximum(1e-9 * sizes, 1e-12 * sizes.max(axis=0, initial=0.0)))
    return np.where(np.abs(rates) > rounding, rates, 0.0)


def _slowest(eigenvalues: Complexes) -> float:
    """Frequency (rad/s) at which a free motion is shown as a slow oscillation."""
    sizes = np.abs(eigenvalues)
    return float(sizes[sizes > 0].min(initial=np.inf)) if sizes.any() else 1.0


def _spectrum(A: Any, speeds: Any, forces: Any, count: int | None, angles: bool) -> Spectrum:
    """All modes of a small matrix, the lowest of a large one."""
    if A.shape[0] <= MOST_DENSE:
        return dense_spectrum(full(A), full(speeds), count, full(forces))
    return sparse_spectrum(A, speeds, 20 if count is None else count, angles)


def _moving_states(structure: Structure) -> tuple[Node, ...]:
    """All states except irrelevant absolute angles."""
    wanted = [s for s in structure.states if s not in structure.angles]
    return tuple(sorted({*wanted, *needed_states(structure, [(v, k + 1) for v, k in wanted])}))


def _amplitude_nodes(structure: Structure, states: tuple[Node, ...]) -> dict[int, int]:
    """Per variable, a derivative order whose amplitude follows from these states, without integrating absolute angles."""
    model = structure.model
    unknown = _dependent(structure, set(structure.states) - set(states))
    known = {node for node in ({*structure.solved_by, *states} - {*structure.angles}) - unknown if structure.computes(node)}
    result: dict[int, int] = {}
    absolute = {v for v, _ in structure.angles}
    for v in sorted({int(r) for r in np.unique(model.representative[model.sign != 0])}):
        preferred = (1, 0) if model.potential[v] or v in absolute else (0, 1)
        for k in preferred:
            if (v, k) in known:
                result[v] = k
                break
        else:  # the speed of an angle that no equation needs follows from the derivative of its own equation
            if structure.computes((v, 1)) and set(needed_states(structure, [(v, 1)])) <= set(states):
                result[v] = 1
    return result


def _dependent(structure: Structure, states: set[Node]) -> set[Node]:
    """These states, and all that depends on one of them at the same instant."""
    readers: dict[Node, list[Node]] = {}
    for node in structure.solved_by:
        for read in structure.columns(*structure.equation(node)):
            readers.setdefault(read, []).append(node)
    found, waiting = set(states), list(states)
    while waiting:
        fresh = set(readers.get(waiting.pop(), ())) - found
        found |= fresh
        waiting += fresh
    return found
