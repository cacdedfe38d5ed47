"""Mobility, speed ratios and power flow of a train from its equations, without simulation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, name_list, one_name, real
from gearlib.errors import ArgumentError, InputWarning, ModelError, SolverError, StartError, warn
from gearlib.flatten.followers import products_in_time
from gearlib.flatten.model import FlatModel
from gearlib.flatten.time_means import held_in_time, in_words
from gearlib.language.declarations import Flow, Potential
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import Point
from gearlib.linear.steady_state import warn_of_instability
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.reduce.coefficients import some
from gearlib.run.refusals.limits import refuse_too_small_in
from gearlib.run.sampling.controllers import check_instants
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled, Translation
from gearlib.solvers.inputs.table import values
from gearlib.statics.closed_gaps import drifting, refuse_change, refuse_drift, with_gaps_closed
from gearlib.statics.load_sharing import shared
from gearlib.statics.power_flow import FlangePower, PowerFlow
from gearlib.statics.steady_motion import (
    CONTRADICTION,
    REST,
    UNDETERMINED,
    VALUE,
    Given,
    Motion,
    guesses,
    held,
    kinematics,
    motion_from,
    refuse_contradiction,
    refuse_unsettled,
    solve,
    speeds_only,
)

Floats = NDArray[np.float64]
SAME = 1e-6  # relative to the fastest speed: motions that differ by less are equal
MOST_JUDGED = 100  # states of a linear train whose stability is worth a search for its steady state


def power_flow(
    system: Compiled, speeds: Mapping[str, float] | None = None, torques: Mapping[str, float] | None = None, *,
    parameters: Mapping[str, float] | None = None,
) -> PowerFlow:  # fmt: skip
    """Speeds, torques and powers of a train in steady motion.

    Nothing accelerates, so inertias take no torque; springs and meshes turn with constant deflections, as if rigid. Unbound inputs that
    are not given are solved for: given the speed of the drive and the torque of the load, the drive's torque follows. A bound input
    that is a function of time counts with its mean where it is a constant with sinusoids, and otherwise with its value at t = 0 and a
    warning (`InputWarning`). Quantities that vary with the mesh phase are averaged over its period. Where speed-dependent loads allow
    several motions, the result is the one that the train reaches from its start values, or the one closest to these. Parallel paths
    that could be preloaded against each other, such as planets with separate meshes, share the load by stiffness, equal planets equally
    (`PowerFlow.shared`). A motion that a run would leave, since it is unstable, comes with a warning. If all torques are given, gaps
    are closed or open, and clutches and brakes locked or sliding, as in the steady state that the train reaches. If a speed is given,
    gaps are closed on the side that the torques press together; of a clutch that is locked, the speeds of both sides are needed, of a
    brake the speed 0.

    Parameters
    ----------
    system : System
    speeds : mapping, optional
        Speeds by the path of a variable or of a flange, rad/s (m/s).
    torques : mapping, optional
        Values of inputs by path (torques, also others); these replace bindings.
    parameters : mapping, optional
        Values by path; setting its backlash to 0 closes a gap.

    Returns
    -------
    PowerFlow

    Raises
    ------
    ArgumentError
        Too much is given (no steady motion has these values), or too little (the message says what remains undetermined).
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
    translation = _fitting(translation_of(system), parameters)
    check_instants(translation.structure, translation.scene.states, "a steady motion")
    model = translation.structure.complete  # with the equations that leave torques of rigid parallel paths undetermined
    numbers = translation.parameter_values(parameters)
    given = given_values(model, speeds, torques)
    _warn_of_time(translation, numbers, given)
    motion, given = _reached(translation, numbers, given)
    _refuse_passing(model, numbers, motion, given)
    ports = [int(model.representative[flow]) for _, _, flow, _ in mechanical(model) if model.sign[flow]]
    places = np.unique(np.array(ports, np.int64))
    if (motion.undetermined[places] > UNDETERMINED).any():
        motion = shared(model, numbers, given, motion, places)
        _refuse_passing(model, numbers, motion, given)  # without its preload a gap may open, and what sticks may slide
    refuse_open(model, motion)
    paths = shared_names(model, set(places[motion.undetermined[places] > UNDETERMINED].tolist()))
    freedoms = _mobility(translation.model, numbers)
    flanges, beside = tuple(flange_powers(model, motion)), exchanged_beside(model, motion)
    return PowerFlow(flanges, freedoms, translation.name, paths, translation.component, beside)


def _refuse_passing(model: FlatModel, numbers: Floats, motion: Motion, given: Sequence[Given]) -> None:
    """Refuse what is no motion, or does not last."""
    refuse_contradiction(motion, given)
    refuse_too_small_in(model, motion.constants)
    refuse_unsettled(model, numbers, motion)
    refuse_drift(model, numbers, motion, given)
    refuse_change(model, numbers, motion, given)


def _fitting(translation: Translation, parameters: Mapping[str, float] | None) -> Translation:
    """The translation that fits the parameters, for the steady state; if nothing accelerates, a train may do without one."""
    try:
        return translation.fitted(parameters)[0]
    except ModelError:
        return translation


def _reached(translation: Translation, numbers: Floats, given: list[Given]) -> tuple[Motion, list[Given]]:
    """The motion that the train reaches, where speed-dependent loads allow several, and what is given with what sticks in it.

    If everything that drives the train is given, it is the motion reached from the start values. If a speed is given, or the start
    values indicate which motion is meant, it is the closest one; ambiguous cases are refused.
    """
    model = translation.structure.complete
    motion = solve(model, numbers, given)
    is_linear = all(group.template.linear for group in model.groups)
    point = steady_point(translation, numbers, given, MOST_JUDGED if is_linear else np.inf)
    if is_linear:
        _warn_of_instability(translation, numbers, point)
        return motion, given
    reached, twisted = ([], []) if point is None else speeds_and_deflections(model, point)
    close = [*reached, *twisted]
    for found in _looks(model, numbers, given, close, motion) if reached else ():
        sticking = held(model, numbers, found)
        if sticking:
            found = solve(model, numbers, [*given, *sticking], close)
        if not (found.residual > CONTRADICTION).any() and agree(found, reached):
            _warn_of_instability(translation, numbers, point)
            return found, [*given, *sticking]
    if meant := guesses(model, numbers):
        near = solve(model, numbers, given, meant)
        motion = motion if (near.residual > CONTRADICTION).any() else near
    motion = with_gaps_closed(model, numbers, given, motion)
    if (motion.residual > CONTRADICTION).any() or meant:
        return motion, given
    other = motion_from(model, numbers, given, -np.concatenate([motion.constants, motion.rates]))
    other = with_gaps_closed(model, numbers, given, other)
    same = max(SAME * np.abs(motion.rates).max(initial=0.0), REST)
    different = np.abs(other.rates - motion.rates)
    if (other.residual > CONTRADICTION).any() or drifting(model, numbers, other) or not different.max(initial=0.0) > same:
        return motion, given
    fastest = int(np.argmax(different))
    raise ArgumentError(
        f"several steady motions have the given {', '.join(g.name for g in given) or 'torques'}: der({model.name(fastest)}) is "
        f"{motion.rates[fastest]:.6g} in one and {other.rates[fastest]:.6g} in another; give a speed, or say near which one it "
        "turns: guess={'w': ...} of a body"
    )


def _looks(
    model: FlatModel, numbers: Floats, given: Sequence[Given], close: Sequence[Given], from_rest: Motion
) -> Iterator[Motion]:
    """Motions to tell what sticks close to a steady state."""
    yield speeds_only(model, numbers, given, close)  # in one that leaves this open, what sticks may run away
    yield solve(model, numbers, given, close)
    yield from_rest  # where friction holds everything, rounding may set in motion what is close


def steady_point(translation: Translation, numbers: Floats, given: Sequence[Given], most: float) -> Point | None:
    """The steady state that the train reaches from its start values, if it has no more than ``most`` states.

    None if there is none, or not all that drives the train is given.
    """
    scene, model = translation.scene, translation.structure.complete
    inputs = {int(model.representative[v]): int(model.sign[v]) for v in model.inputs}
    known = {g.variable: g.value for g in given if g.order == VALUE}
    if len(scene.states) > most or any(g.order for g in given) or set(known) != set(inputs):
        return None
    signals = [known[v] * sign for v, sign in inputs.items()]
    try:
        begin = translation.start(scene, numbers, 0.0, "steady", signals)
    except (StartError, SolverError, ModelError):
        return None
    states = dict(zip(scene.states, begin.states.tolist(), strict=True))
    return Point(0.0, states, values(signals, np.array([0.0]))[:, 0], begin.guess, steady=True)


def speeds_and_deflections(model: FlatModel, point: Point) -> tuple[list[Given], list[Given]]:
    """Speeds at a steady state, and deflections, which tell where gaps are closed."""
    speeds, deflections = [], []
    for (v, k), value in point.states.items():
        if (k == 0 and model.unit(v) in ("rad/s", "m/s")) or (k == 1 and model.potential[v]):
            speeds.append(Given("speed", v, k, value))
        elif k == 0 and not model.potential[v]:
            deflections.append(Given("deflection", v, k, value))
    return speeds, deflections


def _warn_of_instability(translation: Translation, numbers: Floats, point: Point | None) -> None:
    """Warn of a steady state that a run leaves: the power flow is no run's mean."""
    if point is not None and point.states:
        structure, states = translation.structure, tuple(point.states)
        program = build(structure, [], states, dynamic=True)
        prepared = prepare(program, structure, numbers)
        warn_of_instability(translation.name, LinearizedProgram(translation.scene, prepared, point, tuple(range(len(states)))))


def agree(motion: Motion, speeds: Sequence[Given]) -> bool:
    same = max(SAME * max(abs(s.value) for s in speeds), REST)
    return all(abs((motion.rates if s.order else motion.constants)[s.variable] - s.value) <= same for s in speeds)


def mobility(system: Compiled, *, parameters: Mapping[str, float] | None = None) -> int:
    """Number of independent speeds of a train: its degrees of freedom with springs and meshes taken as rigid.

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
    translation = translation_of(system)
    return _mobility(translation.model, translation.parameter_values(parameters))


def _mobility(model: FlatModel, parameters: Floats) -> int:
    moving = sorted({int(model.representative[v]) for _, v, _, _ in mechanical(model) if model.sign[v]})
    speeds = model.n_variables + np.array(moving, np.int64)
    if not moving:
        return 0
    _, factors, _ = kinematics(model, parameters, speeds)
    looks = 8
    while True:  # random free motions: once they are dependent, their rank is known
        rank = int(np.linalg.matrix_rank(factors.directions(looks)[speeds], tol=1e-8))
        if rank < looks:
            return rank
        looks *= 4


def speed_ratio(
    system: Compiled, driving: str, driven: str, *, held: Sequence[str] = (), parameters: Mapping[str, float] | None = None
) -> float:
    """Ratio of the speed of ``driving`` to the speed of ``driven``, from the kinematics alone.

    Parameters
    ----------
    system : System
    driving, driven : str
        Paths of speeds or flanges.
    held : sequence of str, optional
        Speeds or flanges at standstill, for trains with several degrees of freedom; with the carrier held, the result is Willis' basic
        ratio.
    parameters : mapping, optional
        Values by path.

    Raises
    ------
    ArgumentError
        The ratio is undetermined (more must be held) or infinite, or ``driving`` cannot turn.

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
    translation = translation_of(system)
    held = name_list("held", held, "unit.carrier")
    model = translation.model
    given = given_values(model, {one_name("driving", driving, "unit.sun"): 1.0, **dict.fromkeys(held, 0.0)}, None)
    variable, order, sign = speed_named(model, driven)
    place = variable + order * model.n_variables
    wanted = np.array([place, *(g.variable + g.order * model.n_variables for g in given)])
    rows, factors, chosen = kinematics(model, translation.parameter_values(parameters), wanted, given)
    residual = rows.residual[chosen]
    x = -factors.solve(residual)
    x -= factors.solve(residual + factors.matrix @ x)
    if driving in held or factors.contradiction(residual + factors.matrix @ x, x).max(initial=0.0) > CONTRADICTION:
        raise ArgumentError(f"{driving} cannot turn{' with ' + ', '.join(held) + ' held' if held else ''}")
    if sign == 0:
        raise ArgumentError(f"{driven} always stands still")
    if factors.undetermined[place] > UNDETERMINED:
        raise ArgumentError(f"{driven} does not follow from {driving} alone; name the speeds that are held (held=[...])")
    speed = sign * float(x[place])
    if abs(speed) < 1e-12:
        raise ArgumentError(f"{driven} stands still while {driving} turns: the ratio is infinite")
    return 1.0 / speed


def mechanical(model: FlatModel) -> list[tuple[int, int, int, str]]:
    """(instance, potential, flow, flange) of every shaft or rod."""
    found = []
    for i, instance in enumerate(model.instances):
        ports: dict[str, dict[type, list[tuple[int, str]]]] = {}
        for offset, (name, declared) in enumerate(instance.declared.variables.items()):
            kind = Potential if isinstance(declared, Potential) else Flow if isinstance(declared, Flow) else None
            if kind is not None:
                port = ports.setdefault(name.rpartition(".")[0], {Potential: [], Flow: []})
                port[kind].append((instance.first_variable + offset, declared.unit))
        for flange, port in ports.items():
            if len(port[Potential]) == len(port[Flow]) == 1 and port[Potential][0][1] in ("rad", "m"):
                found.append((i, port[Potential][0][0], port[Flow][0][0], flange))
    return found


def speed_named(model: FlatModel, name: str) -> tuple[int, int, int]:
    """(representative, order, sign) of a speed named by a variable, a flange or "der(angle)"."""
    base, order = model.column(name)
    variable = model.find(base)
    if variable is None:
        paths = {
            f"{p}.{flange}" if (p := model.instances[i].path) else flange: potential
            for i, potential, _, flange in mechanical(model)
        }
        variable = paths.get(base)
    if variable is None:
        variable = model.variable(base, "speed or flange")
    if order == 0 and (model.potential[model.representative[variable]] or model.unit(variable) == "rad"):
        order = 1
    if order > 1:
        raise ArgumentError(f"{name} is no speed")
    return int(model.representative[variable]), order, int(model.sign[variable])


def given_values(model: FlatModel, speeds: Mapping[str, float] | None, torques: Mapping[str, float] | None) -> list[Given]:
    found = []
    for what, given in (("speed", speeds), ("torque", torques)):
        for name, value in by_name(f"{what}s", given, "a mapping of paths to numbers, such as {'motor.flange': 100}").items():
            value = real(f"{what} {name}", value)
            if what == "speed":
                variable, order, sign = speed_named(model, name)
            else:
                v = model.variable(name, "input")
                variable, order, sign = int(model.representative[v]), VALUE, int(model.sign[v])
            if sign == 0 and value != 0.0:
                carries = f"{name} is always zero; a torque needs a source that is connected, such as gp.Torque"
                raise ArgumentError(f"{name} always stands still" if what == "speed" else carries)
            if sign:
                found.append(Given(name, variable, order, sign * value))
    return found


def _warn_of_time(translation: Translation, numbers: Floats, given: Sequence[Given]) -> None:
    """Warn of what changes with time without a mean, and counts with its value at time 0."""
    model, known = translation.model, {g.variable for g in given}
    found = {name: model.find(name) for name in held_in_time(model, numbers, means=True)}
    names = [name for name, v in found.items() if v is None or int(model.representative[v]) not in known]
    if names:
        inputs = [name for name in names if found[name] is not None]
        remedy = f"; pass power_flow(torques={{{inputs[0]!r}: ...}})" if inputs else ""
        warn(f"{translation.name}: {some(names, ', ')} {in_words(names)} in the power flow{remedy}", InputWarning)
    if products := products_in_time(model, numbers):
        what = (
            "swings with time, and counts with its mean"
            if len(products) == 1
            else "swing with time, and count with their means"
        )
        where = "in an equation that is not linear in what swings; run the train for the means of its torques"
        warn(f"{translation.name}: {some(products, ', ')} {what} {where}", InputWarning)


def refuse_open(model: FlatModel, motion: Motion) -> None:
    """Raise an error where a speed, or the torque of a drive or load, is undetermined. Internal torques may be: they are shared."""
    n = model.n_variables
    ports = mechanical(model)
    alone = Counter(i for i, _, _, _ in ports)  # components with one flange drive, load or hold the train
    inputs = {int(model.representative[v]) for v in model.inputs}
    open_ = [f"input {model.name(v)}" for v in sorted(inputs) if motion.undetermined[v] > UNDETERMINED]
    for i, potential, flow, flange in ports:
        path = model.instances[i].path
        p, f = int(model.representative[potential]), int(model.representative[flow])
        name = f"{path + '.' if path else ''}{flange}"
        if model.sign[potential] and motion.undetermined[p + n] > UNDETERMINED:
            open_.append(f"speed of {name}")
        turns = model.sign[potential] and motion.rates[p] != 0.0
        if alone[i] == 1 and turns and model.sign[flow] and motion.undetermined[f] > UNDETERMINED:
            open_.append(f"torque of {name}")
    if open_:
        more = f" and {len(open_) - 4} more" if len(open_) > 4 else ""
        raise ArgumentError(f"too little is given: the {', '.join(open_[:4])}{more} stay open; give more speeds or torques")


def shared_names(model: FlatModel, torques: set[int]) -> tuple[str, ...]:
    """Flanges of basic components whose torque is not determined by equilibrium alone."""
    composite, found = composites(model), []
    for i, _, flow, flange in mechanical(model):
        path = model.instances[i].path
        if path not in composite and model.sign[flow] and int(model.representative[flow]) in torques:
            found.append(f"{path + '.' if path else ''}{flange}")
    return tuple(found)


def flange_powers(model: FlatModel, motion: Motion) -> list[FlangePower]:
    composite, rows = composites(model), []
    for i, potential, flow, flange in mechanical(model):
        path = model.instances[i].path
        p, f = int(model.representative[potential]), int(model.representative[flow])
        speed = float(motion.rates[p]) * int(model.sign[potential]) + 0.0  # no -0
        torque = float(motion.constants[f]) * int(model.sign[flow]) + 0.0
        shaft = p if model.sign[potential] else -1
        sliding = model.unit(potential) == "m"
        rows.append(FlangePower(path, flange, speed, torque, speed * torque + 0.0, shaft, path not in composite, sliding))
    return rows


def exchanged_beside(model: FlatModel, motion: Motion) -> tuple[str, ...]:
    """Basic components that exchange something else than torques, forces and heat besides, through connectors that are no flanges."""
    composite, found = composites(model), []
    for i in dict.fromkeys(i for i, _, _, _ in mechanical(model)):
        instance = model.instances[i]
        for offset, declared in enumerate(instance.declared.variables.values()):
            v = int(model.representative[instance.first_variable + offset])
            if isinstance(declared, Flow) and declared.unit not in ("N.m", "N", "W") and motion.constants[v] != 0.0:
                found.append(instance.path)
    return tuple(path for path in dict.fromkeys(found) if path not in composite)


def composites(model: FlatModel) -> set[str]:
    """Paths of the components that have parts."""
    return {i.path.rpartition(".")[0] for i in model.instances if i.path}
