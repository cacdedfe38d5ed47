"""Kinetic and potential energy of each component in a mode, from the component's own equations.

Only the equations are used, so that every component with mechanical connectors is covered, including user-defined ones. With ``x`` the
amplitudes of its positions and ``f(s)`` those of the forces that its linearised equations then require at its connectors, the
component's dynamic stiffness along the mode is ``d(s) = x* f(s) = m s^2 + c s + k``. Its value and its derivative at ``s = i w``, w
being the mode's natural frequency, determine the three coefficients::

    m = Im(d') / (2 w)        c = Re(d')        k = Re(d) + m w^2

and with them the kinetic energy ``m w^2 / 4`` and the potential energy ``k / 4`` (means over a period). For a component with internal
dynamics the same two formulas are the energy theorem of reactance networks: exact without damping, and of second order in it otherwise.
What a component with both kinds of storage does inside cannot be seen from its flanges: a spring and a damper in series would get a
negative mass. Internal motion shows in the second derivative, which is ``2 m`` without it; together with the share of dissipation it
bounds the error of the two energies. A constraint does no work, so gears, grounds and kinematics have zero energy.

At an electrical connector, and any other whose potential times its flow is a power, the integral of the potential is the position: a
capacitor is a mass, an inductance a spring.

References
----------
R. M. Foster, "A reactance theorem", Bell System Technical Journal 3 (1924) 259-267, doi 10.1002/j.1538-7305.1924.tb01358.x
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import partial_kernel
from gearlib.flatten.model import EquationGroup, FlatModel, Instance
from gearlib.language.declarations import Flow, Input, Potential
from gearlib.language.units import Dimension, dimension
from gearlib.program.build import Builder
from gearlib.program.interpret import Prepared, batch_values
from gearlib.reduce.reduction import Structure

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
POSITIONS = {"rad", "m"}
WORK, POWER = dimension("J"), dimension("W")


@dataclass(frozen=True)
class Family:
    """Components whose linearised equations share a sparsity pattern, with the values of each.

    Attributes
    ----------
    instances : tuple of int
    unknown, given : arrays (components, columns)
        Variables that the component determines, and those given to it: connector positions, and inputs.
    L : array (orders, components, rows, columns)
        Partial derivatives with respect to each derivative order; unknowns first.
    pairs : tuple of (int, int, float)
        Per connector: column of its flow, column of its potential, product of their signs.
    rates : tuple of int
        Columns of ``given`` that are rates, such as voltages: ``L`` is that of their integrals.
    """

    instances: tuple[int, ...]
    unknown: Any
    given: Any
    L: Floats
    pairs: tuple[tuple[int, int, float], ...]
    rates: tuple[int, ...] = ()

    def positions(self, amplitude: Complexes, s: complex) -> Complexes:
        """Amplitudes of what is given, at an eigenvalue; of rates those of their integrals."""
        given: Complexes = np.array(amplitude[self.given], complex)
        given[:, self.rates] /= s
        return given


def families(structure: Structure, prepared: Prepared, slots: Floats, discrete: Floats, t: float) -> list[Family]:
    """Linearised equations of every component with connectors that do work and no parts, grouped by pattern."""
    model = structure.declared
    rows = _rows(structure, prepared, slots, discrete, t)
    found: dict[Any, list[tuple[int, list[int], list[int], list[tuple[int, int, int, float]]]]] = defaultdict(list)
    kinds: dict[Any, tuple[tuple[tuple[int, int, float], ...], tuple[int, ...]]] = {}
    for number, entries in rows.items():
        ports = _ports(model, model.instances[number])
        if not ports:
            continue
        present = dict.fromkeys(v for _, v, _, _ in entries)
        given = _given(model, model.instances[number], present)
        unknown = [v for v in present if v not in given]
        known = list(dict.fromkeys([*(v for v in present if v in given), *(p for p, _, _ in ports)]))
        place = {v: j for j, v in enumerate([*unknown, *known])}
        pairs = tuple((place[f], place[p], sign) for p, f, sign in ports if f in place)
        if not pairs:
            continue
        rates = {p for p, _, _ in ports if model.unit(p) not in POSITIONS}
        inner = [(r, place[v], order + (v in rates), value) for r, v, order, value in entries]
        columns = tuple(k for k, v in enumerate(known) if v in rates)
        key = (tuple((r, c, order) for r, c, order, _ in inner), len(unknown), len(known), pairs, columns)
        found[key].append((number, unknown, known, inner))
        kinds[key] = pairs, columns
    return [_family(members, *kinds[key]) for key, members in found.items()]


def _family(members: Any, pairs: tuple[tuple[int, int, float], ...], rates: tuple[int, ...]) -> Family:
    first = members[0][3]
    n_rows, n_columns = 1 + max(r for r, _, _, _ in first), len(members[0][1]) + len(members[0][2])
    L = np.zeros((1 + max(2, *(o for _, _, o, _ in first)), len(members), n_rows, n_columns))
    values = np.array([[value for _, _, _, value in m[3]] for m in members])
    for k, (r, c, order, _) in enumerate(first):
        L[order, :, r, c] += values[:, k]
    unknown = np.array([m[1] for m in members], np.int64).reshape(len(members), -1)
    given = np.array([m[2] for m in members], np.int64).reshape(len(members), -1)
    return Family(tuple(m[0] for m in members), unknown, given, L, pairs, rates)


def _rows(
    structure: Structure, prepared: Prepared, slots: Floats, discrete: Floats, t: float
) -> dict[int, list[tuple[int, int, int, float]]]:
    """Per instance, the entries (row, variable, order, value) of its linearised equations."""
    model, program = structure.declared, prepared.program
    builder = Builder(replace(structure, model=model), (), program.states)
    builder.table = np.zeros((1 + max([3, *(k for _, k in program.slots)]), structure.model.n_variables), np.int64)
    for (v, k), slot in program.slots.items():
        builder.table[k, v] = slot
    count: dict[int, int] = defaultdict(int)
    result: dict[int, list[tuple[int, int, int, float]]] = defaultdict(list)
    for g, group in enumerate(model.groups):
        owners = group.owners.tolist()
        numbers = []
        for owner in owners:
            numbers.append(count[owner])
            count[owner] += 1
        if group.template.binds:
            continue
        silent = _silent(model, group)
        variables, signs = (np.where(silent < 0, *pair).tolist() for pair in ((silent, group.variables), (1, group.signs)))
        for c, (j, order) in enumerate(group.template.local_columns):
            kernel = partial_kernel(group.template, c)
            batch = builder.batch(kernel, g, 0, [(i, i, 1) for i in range(len(group))])
            value = batch_values(batch, np.array([t]), slots[:, None], prepared.parameters, discrete[:, None])
            value = np.broadcast_to(value, (len(group), 1))[:, 0].tolist()
            for i, owner in enumerate(owners):
                if owner >= 0 and signs[i][j]:
                    result[owner].append((numbers[i], variables[i][j], order, signs[i][j] * value[i]))
    return result


def _silent(model: FlatModel, group: EquationGroup) -> Any:
    """Numbers of the forces that are zero at unconnected ports, see `_force`; zero for all other variables."""
    result = np.zeros(group.variables.shape, np.int64)
    for j, name in enumerate(group.template.locals):
        for i in np.flatnonzero(group.signs[:, j] == 0).tolist():
            instance = model.instances[int(group.owners[i])]
            if isinstance(instance.declared.variables.get(name), Flow):
                result[i, j], _ = _force(model, instance.variable(name))
    return result


def _force(model: FlatModel, v: int) -> tuple[int, int]:
    """Number and sign of a flow. One that is zero, at an unconnected port, stands for the force that would hold the port: -1 - v."""
    return (int(model.representative[v]), int(model.sign[v])) if model.sign[v] else (-1 - v, 1)


def _product(potential: str, flow: str) -> Dimension | None:
    """Dimension of a potential times its flow."""
    a, b = dimension(potential), dimension(flow)
    return None if a is None or b is None else tuple(x + y for x, y in zip(a, b, strict=True))


def _ports(model: FlatModel, instance: Instance) -> list[tuple[int, int, float]]:
    """(potential, flow, sign of their product) of each pair in an instance's connectors that does work."""
    halves: dict[str, tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))
    units: dict[str, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
    for offset, (name, declared) in enumerate(instance.declared.variables.items()):
        if "." in name and isinstance(declared, (Potential, Flow)):
            side = int(isinstance(declared, Flow))
            port = name.rsplit(".", 1)[0]
            halves[port][side].append(instance.first_variable + offset)
            units[port][side].append(declared.unit)
    result = []
    for port, (potentials, flows) in halves.items():
        for p, f, unit in zip(potentials, flows, zip(*units[port], strict=True), strict=True):
            if model.sign[p] and _product(*unit) == (WORK if unit[0] in POSITIONS else POWER):
                flow, sign = _force(model, f)
                result.append((int(model.representative[p]), flow, float(sign * int(model.sign[p]))))
    return result


def _given(model: FlatModel, instance: Instance, present: Collection[int]) -> set[int]:
    """Variables that a component does not determine: potentials of its connectors, and its inputs.

    One that is no angle or position, such as a temperature, it does determine if the flow beside it occurs in no equation of its own.
    """
    named = [(name, d, instance.first_variable + k) for k, (name, d) in enumerate(instance.declared.variables.items())]
    acting = {name.rpartition(".")[0] for name, d, v in named if isinstance(d, Flow) and _force(model, v)[0] in present}
    return {
        int(model.representative[v])
        for name, d, v in named
        if isinstance(d, Input) or (isinstance(d, Potential) and (d.unit in ("rad", "m") or name.rpartition(".")[0] in acting))
    }


def energies(family: Family, amplitude: Complexes, omega: float, s: complex | None = None) -> tuple[Floats, Floats, Floats]:
    """Kinetic and potential energy (J, means over a period) of a family's components, and their error bounds.

    Parameters
    ----------
    family : Family
    amplitude : array (variables,)
        Complex amplitude of every variable in the mode.
    omega : float
        Natural frequency, rad/s.
    s : complex
        Eigenvalue; ``1j * omega`` by default.
    """
    given = family.positions(amplitude, 1j * omega if s is None else s)
    L, slope, bend = _polynomial(family.L, 1j * omega)
    n = family.unknown.shape[1]
    inverse, scale = _pseudo_inverse(L[:, :, :n])
    unknown = -_solve(inverse, scale, np.einsum("irc,ic->ir", L[:, :, n:], given))
    both = np.concatenate([unknown, given], axis=1)
    change = -_solve(inverse, scale, np.einsum("irc,ic->ir", slope, both))
    second = np.einsum("irc,ic->ir", slope[:, :, :n], change) + np.einsum("irc,ic->ir", bend, both)
    second = -_solve(inverse, scale, second)
    d, derivative, half = (np.zeros(len(given), complex) for _ in range(3))
    for flow, potential, sign in family.pairs:
        x = np.conj(given[:, potential - n]) * sign
        d += x * unknown[:, flow]
        derivative += x * change[:, flow]
        half += x * second[:, flow]
    m = derivative.imag / (2 * omega)
    kinetic, potential_ = m * omega**2 / 4, (d.real + m * omega**2) / 4
    inside = np.abs(half - m) * omega**2 / 4
    stored = np.maximum(np.abs(kinetic) + np.abs(potential_), inside)
    lost = np.divide(np.abs(d.imag) / 4, stored, out=np.zeros(len(d)), where=stored > 0)
    return kinetic, potential_, inside * np.minimum(lost, 1.0) ** 2


def moving_alone(family: Family, amplitude: Complexes, s: complex, size: Floats) -> Floats:
    """Amplitude of what moves inside of components without their connectors, over the ``size`` of each variable, the largest of each."""
    n = family.unknown.shape[1]
    L, *_ = _polynomial(family.L, s)
    follows = -_solve(*_pseudo_inverse(L[:, :, :n]), np.einsum("irc,ic->ir", L[:, :, n:], family.positions(amplitude, s)))
    apart = np.abs(amplitude[family.unknown] - follows) / size[family.unknown]
    return np.asarray(np.where(family.unknown < 0, 0.0, apart).max(axis=1, initial=0.0), float)


def _polynomial(parts: Floats, s: complex) -> tuple[Complexes, Complexes, Complexes]:
    """The polynomial with these coefficients, its derivative and half its second derivative, by Horner's scheme."""
    value, slope, bend = parts[-1].astype(complex), np.zeros(parts.shape[1:], complex), np.zeros(parts.shape[1:], complex)
    for part in parts[-2::-1]:
        bend = bend * s + slope
        slope = slope * s + value
        value = value * s + part
    return value, slope, bend


def _pseudo_inverse(L: Complexes) -> tuple[Complexes, tuple[Floats, Floats]]:
    """Pseudo-inverses with scaled rows and columns; a torque that does no work is undetermined, and its minimum-norm value is taken."""
    row = np.abs(L).max(axis=2, initial=0.0)
    row = np.where(row > 0, row, 1.0)
    scaled = L / row[:, :, None]
    column = np.abs(scaled).max(axis=1, initial=0.0)
    column = np.where(column > 0, column, 1.0)
    inverse: Complexes = np.asarray(np.linalg.pinv(scaled / column[:, None, :], rcond=1e-10), complex)
    return inverse, (np.asarray(row, float), np.asarray(column, float))


def _solve(inverse: Complexes, scale: tuple[Floats, Floats], rhs: Complexes) -> Complexes:
    result: Complexes = np.einsum("icr,ir->ic", inverse, rhs / scale[0]) / scale[1]
    return result
