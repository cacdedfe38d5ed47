"""Mobility, speed ratios, and torque and power through every shaft of a train, from its equations and without a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gearlib.analysis.circulation import Branch, Circulation, circulations
from gearlib.analysis.steady_motion import CONTRADICTION, VALUE, Given, Motion, kinematics, refuse_contradiction, solve
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.flatten.model import FlatModel
from gearlib.flatten.templates import parse_column
from gearlib.language.declarations import Flow, Potential

if TYPE_CHECKING:
    import pandas

    from gearlib.system import System

UNDETERMINED = 1e-8  # part of a unit vector; orthonormal directions are exact to about 1e-13


@dataclass(frozen=True)
class FlangePower:
    """Speed, torque and power at one flange; torque and power are positive into the component."""

    component: str
    flange: str
    speed: float
    torque: float
    power: float
    shaft: int  # flanges on one rigid shaft have the same number
    leaf: bool  # False for the flanges of a composite, which repeat those of its parts

    @property
    def name(self) -> str:
        """Path of the flange."""
        return f"{self.component}.{self.flange}" if self.component else self.flange


@dataclass(frozen=True)
class PowerFlow:
    """Torque and power in a train that turns steadily.

    Attributes
    ----------
    flanges : tuple of FlangePower
    mobility : int
        Independent speeds of the train.
    """

    flanges: tuple[FlangePower, ...]
    mobility: int

    def __getitem__(self, name: str) -> FlangePower:
        """A flange by its path."""
        found = self._by_name.get(name)
        if found is None:
            raise NameLookupError(f"the model has no flange '{name}'; {nearest(str(name), self._by_name)}")
        return found

    @cached_property
    def _by_name(self) -> dict[str, FlangePower]:
        return {f.name: f for f in self.flanges}

    @cached_property
    def _branches(self) -> tuple[Branch, ...]:
        """Net power of each basic component at each rigid shaft."""
        power: dict[tuple[str, int], float] = {}
        for f in self.flanges:
            if f.leaf:
                power[f.component, f.shaft] = power.get((f.component, f.shaft), 0.0) + f.power
        least = 1e-12 * self.largest
        return tuple(Branch(c, s, p) for (c, s), p in power.items() if abs(p) > least)

    @property
    def largest(self) -> float:
        """Largest power at any flange, W."""
        return max((abs(f.power) for f in self.flanges), default=0.0)

    @cached_property
    def absorbed(self) -> dict[str, float]:
        """Power that each basic component takes up, W: negative for a drive, positive for a load, the loss of a gear."""
        total: dict[str, float] = {}
        for f in self.flanges:
            if f.leaf:
                total[f.component] = total.get(f.component, 0.0) + f.power
        return total

    @cached_property
    def outer(self) -> tuple[str, ...]:
        """Components that exchange power through one shaft only: drives and loads."""
        shafts: dict[str, int] = {}
        for branch in self._branches:
            shafts[branch.component] = shafts.get(branch.component, 0) + 1
        return tuple(c for c, count in shafts.items() if count == 1)

    @property
    def input_power(self) -> float:
        """What the drives deliver, W."""
        return -sum(min(self.absorbed[c], 0.0) for c in self.outer)

    @property
    def output_power(self) -> float:
        """What the loads take, W."""
        return sum(max(self.absorbed[c], 0.0) for c in self.outer)

    @property
    def efficiency(self) -> float:
        """Power of the loads over power of the drives; NaN where nothing drives."""
        return self.output_power / self.input_power if self.input_power else float("nan")

    @property
    def losses(self) -> dict[str, float]:
        """Power lost in the components between drives and loads, W."""
        least = 1e-12 * self.largest
        return {c: p for c, p in self.absorbed.items() if c not in self.outer and abs(p) > least}

    @property
    def imbalance(self) -> float:
        """Sum of the power at all basic flanges over the largest of them: rounding, since connections pass on all power."""
        total = sum(f.power for f in self.flanges if f.leaf)
        return abs(total) / self.largest if self.largest else 0.0

    @cached_property
    def circulating(self) -> tuple[Circulation, ...]:
        """Power that flows in a circle, and through which components."""
        return circulations(self._branches)

    @property
    def circulating_power(self) -> float:
        """Sum of the circulating powers, W."""
        return sum(c.power for c in self.circulating)

    def willis(self, sun: str, ring: str, carrier: str) -> tuple[float, float]:
        """Basic ratio of a planetary set from its speeds, and from its torques; without losses they are equal.

        Parameters
        ----------
        sun, ring, carrier : str
            Paths of its flanges.

        Returns
        -------
        tuple of float
            ``(w_sun - w_carrier) / (w_ring - w_carrier)`` and ``-tau_ring / tau_sun``; NaN where the set turns as a block or
            carries no torque.
        """
        s, r, c = self[sun], self[ring], self[carrier]
        relative = r.speed - c.speed
        turning = abs(relative) > 1e-12 * max(abs(s.speed), abs(r.speed), abs(c.speed))
        return (s.speed - c.speed) / relative if turning else float("nan"), -r.torque / s.torque if s.torque else float("nan")

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per flange."""
        import pandas

        table = [(f.name, f.speed, f.torque, f.power) for f in self.flanges]
        return pandas.DataFrame(table, columns=["flange", "speed", "torque", "power"]).set_index("flange")

    def __str__(self) -> str:
        basic = [f for f in self.flanges if f.leaf]
        width = max((len(f.name) for f in basic), default=6)
        lines = [f"{'flange':{width}}  {'speed, rad/s':>13} {'torque, N.m':>13} {'power, W':>13}"]
        lines += [f"{f.name:{width}}  {_tidy(f.speed):13.6g} {_tidy(f.torque):13.6g} {_tidy(f.power):13.6g}" for f in basic]
        lines.append(
            f"mobility {self.mobility}; drives deliver {self.input_power:.6g} W, loads take {self.output_power:.6g} W, "
            f"efficiency {self.efficiency:.6g}"
        )
        lines += [f"lost in {c}: {p:.6g} W" for c, p in self.losses.items()]
        lines += [f"circulating: {c.power:.6g} W through {', '.join(c.components)}" for c in self.circulating]
        return "\n".join(lines)


def _tidy(value: float) -> float:
    return 0.0 if abs(value) < 1e-12 else value


def power_flow(
    system: System, speeds: Mapping[str, float] | None = None, torques: Mapping[str, float] | None = None, *,
    parameters: Mapping[str, float] | None = None,
) -> PowerFlow:  # fmt: skip
    """Speeds, torques and powers of a train that turns steadily.

    Nothing accelerates, so inertia takes no torque; springs and meshes turn with their deflections constant, as if rigid. Unbound
    inputs that are not given are found: give the speed of the drive and the torque of the load, and the drive's torque follows.
    A bound input that is a function of time counts as zero unless it is given.

    Parameters
    ----------
    system : System
    speeds : mapping, optional
        Speeds by the path of a variable or of a flange, rad/s (m/s).
    torques : mapping, optional
        Values of inputs by path (torques, also others); these replace bindings.
    parameters : mapping, optional
        Values by path; a gap is closed by setting its backlash to 0.

    Returns
    -------
    PowerFlow

    Raises
    ------
    ArgumentError
        Too much is given (no steady motion has these values), or too little (says what stays open).
    NameLookupError
        A name that the model does not have.

    References
    ----------
    H. W. Mueller, "Epicyclic Drive Trains", Wayne State University Press, 1982.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Reducer(gl.Component):
    ...     def assemble(self):
    ...         self.drive, self.load = gp.Torque(), gp.Torque()
    ...         self.gear, self.body = gp.IdealGear(ratio=5), gp.Inertia(J=1.0)
    ...         return [
    ...             gl.connect(self.drive.flange, self.gear.flange_a),
    ...             gl.connect(self.gear.flange_b, self.body.flange_a),
    ...             gl.connect(self.body.flange_b, self.load.flange),
    ...         ]
    >>> flow = gl.power_flow(gl.compile(Reducer()), speeds={"gear.flange_a": 100}, torques={"load.tau": -50})
    >>> flow["gear.flange_b"].speed, flow["gear.flange_a"].torque, flow.input_power
    (20.0, 10.0, 1000.0)
    """
    model = system._structure.model
    numbers = system._parameters(parameters)
    given = _given(model, speeds, torques)
    motion = solve(model, numbers, given)
    refuse_contradiction(motion, given)
    flanges = tuple(_flanges(model, motion))
    return PowerFlow(flanges, mobility(system, parameters=parameters))


def mobility(system: System, *, parameters: Mapping[str, float] | None = None) -> int:
    """Independent speeds of a train: its degrees of freedom with springs and meshes taken as rigid.

    Prescribed motions (`gp.Speed`, `gp.Fixed`) count as constraints; dampers, brakes and clutches do not.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Differential(gl.Component):
    ...     def assemble(self):
    ...         self.unit = gp.IdealPlanetary(ratio=2)
    ...         self.body = [gp.Inertia(J=1.0) for _ in range(3)]
    ...         shafts = (self.unit.sun, self.unit.ring, self.unit.carrier)
    ...         return [gl.connect(shaft, body.flange_a) for shaft, body in zip(shafts, self.body)]
    >>> gl.mobility(gl.compile(Differential()))
    2
    """
    model = system._structure.model
    _, factors = kinematics(model, system._parameters(parameters))
    moving = sorted({int(model.representative[v]) for _, v, _, _ in _mechanical(model) if model.sign[v]})
    if not moving:
        return 0
    return int(np.linalg.matrix_rank(factors.free[model.n_variables + np.array(moving)], tol=1e-8))


def speed_ratio(
    system: System, driving: str, driven: str, *, held: Sequence[str] = (), parameters: Mapping[str, float] | None = None
) -> float:
    """Speed of ``driving`` over speed of ``driven``, from the kinematics alone.

    Parameters
    ----------
    system : System
    driving, driven : str
        Paths of speeds or flanges.
    held : sequence of str, optional
        Speeds or flanges that stand still, for trains with several degrees of freedom; with the carrier held this is the basic
        ratio of Willis.
    parameters : mapping, optional
        Values by path.

    Raises
    ------
    ArgumentError
        The ratio is not determined (more must be held), infinite, or ``driving`` cannot turn.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Differential(gl.Component):
    ...     def assemble(self):
    ...         self.unit = gp.IdealPlanetary(ratio=2)
    ...         self.body = [gp.Inertia(J=1.0) for _ in range(3)]
    ...         shafts = (self.unit.sun, self.unit.ring, self.unit.carrier)
    ...         return [gl.connect(shaft, body.flange_a) for shaft, body in zip(shafts, self.body)]
    >>> system = gl.compile(Differential())
    >>> gl.speed_ratio(system, "unit.sun", "unit.carrier", held=["unit.ring"])
    3.0
    >>> gl.speed_ratio(system, "unit.sun", "unit.ring", held=["unit.carrier"])
    -2.0
    """
    if isinstance(held, str):
        raise ArgumentError(f"held is a list of names, such as [{held!r}]")
    model = system._structure.model
    given = _given(model, {driving: 1.0, **dict.fromkeys(held, 0.0)}, None)
    rows, factors = kinematics(model, system._parameters(parameters), given)
    residual = rows.residual[rows.kinematic].copy()
    x = -factors.solve(residual)
    left = residual + rows.matrix[rows.kinematic] @ x
    if np.abs(left).max() > CONTRADICTION:
        raise ArgumentError(f"{driving} cannot turn{' with ' + ', '.join(held) + ' held' if held else ''}")
    variable, order, sign = _speed(model, driven)
    if sign == 0:
        raise ArgumentError(f"{driven} always stands still")
    place = variable + order * model.n_variables
    if np.abs(factors.free[place]).max(initial=0.0) > UNDETERMINED:
        raise ArgumentError(f"{driven} does not follow from {driving} alone; name the speeds that are held (held=[...])")
    speed = sign * float(x[place])
    if abs(speed) < 1e-12:
        raise ArgumentError(f"{driven} stands still while {driving} turns: the ratio is infinite")
    return 1.0 / speed


def _mechanical(model: FlatModel) -> list[tuple[int, int, int, str]]:
    """(instance, potential, flow, flange) of every shaft or rod."""
    found = []
    for i, instance in enumerate(model.instances):
        ports: dict[str, dict[type, list[tuple[int, str]]]] = {}
        for offset, (name, declared) in enumerate(instance.variables.items()):
            kind = Potential if isinstance(declared, Potential) else Flow if isinstance(declared, Flow) else None
            if kind is not None:
                port = ports.setdefault(name.rpartition(".")[0], {Potential: [], Flow: []})
                port[kind].append((instance.first_variable + offset, declared.unit))
        for flange, port in ports.items():
            if len(port[Potential]) == len(port[Flow]) == 1 and port[Potential][0][1] in ("rad", "m"):
                found.append((i, port[Potential][0][0], port[Flow][0][0], flange))
    return found


def _speed(model: FlatModel, name: str) -> tuple[int, int, int]:
    """(representative, order, sign) of a speed named by a variable, a flange or "der(angle)"."""
    base, order = parse_column(name)
    variable = model.find(base)
    if variable is None:
        paths = {
            f"{p}.{flange}" if (p := model.instances[i].path) else flange: potential
            for i, potential, _, flange in _mechanical(model)
        }
        variable = paths.get(base)
    if variable is None:
        variable = model.variable(base, "speed or flange")
    declared = model.declaration(variable)
    if order == 0 and (model.potential[model.representative[variable]] or (declared is not None and declared.unit == "rad")):
        order = 1
    if order > 1:
        raise ArgumentError(f"{name} is no speed")
    return int(model.representative[variable]), order, int(model.sign[variable])


def _given(model: FlatModel, speeds: Mapping[str, float] | None, torques: Mapping[str, float] | None) -> list[Given]:
    found = []
    for what, mapping in (("speed", speeds or {}), ("torque", torques or {})):
        for name, value in mapping.items():
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
                raise ArgumentError(f"{what} {name} is {value!r}; expected a finite number")
            if what == "speed":
                variable, order, sign = _speed(model, name)
            else:
                v = model.variable(name, "input")
                variable, order, sign = int(model.representative[v]), VALUE, int(model.sign[v])
            if sign == 0 and value != 0.0:
                raise ArgumentError(f"{name} is always zero; a torque needs a source that is connected, such as gp.Torque")
            if sign:
                found.append(Given(name, variable, order, sign * float(value)))
    return found


def _flanges(model: FlatModel, motion: Motion) -> list[FlangePower]:
    n = model.n_variables
    composite = {i.path.rsplit(".", depth)[0] for i in model.instances for depth in range(1, i.path.count(".") + 1)}
    composite.add("")
    alone = len(model.instances) == 1
    rows, open_ = [], []
    for i, potential, flow, flange in _mechanical(model):
        path = model.instances[i].path
        p, f = int(model.representative[potential]), int(model.representative[flow])
        for place, sign, what in ((p + n, model.sign[potential], "speed"), (f, model.sign[flow], "torque")):
            if sign and np.abs(motion.free[place]).max(initial=0.0) > UNDETERMINED:
                open_.append(f"{what} of {path + '.' if path else ''}{flange}")
        speed = float(motion.rates[p]) * int(model.sign[potential])
        torque = float(motion.constants[f]) * int(model.sign[flow])
        shaft = p if model.sign[potential] else -1
        rows.append(FlangePower(path, flange, speed, torque, speed * torque, shaft, alone or path not in composite))
    if open_:
        more = f" and {len(open_) - 4} more" if len(open_) > 4 else ""
        raise ArgumentError(f"too little is given: the {', '.join(open_[:4])}{more} stay open; give more speeds or torques")
    return rows
