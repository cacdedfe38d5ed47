"""All that can be asked of a train, to be compared between the orders in which its parts are made and connected."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import gearlib as gl
from tests.stress.analyses_campaign import analysed_train
from tests.stress.described import Model, Train
from tests.stress.linear_draw import linear_train
from tests.stress.verdicts import RIGHT, WRONG, Verdict, attempted

TIMES = np.linspace(0.0, 0.5, 4)
METHODS = ("rk", "ida", "exact", "auto")


def ordered_train(seed: int) -> Train:
    """A linear train, every second one under constant torques."""
    return (analysed_train if seed % 2 else linear_train)(seed)


def judge_order(train: Train, seed: int = 0) -> Verdict:
    """Whether all answers, and the kinds of refusals, are the same in another order."""

    def compared() -> Verdict:
        wrong = differences(train, seed + 1, [METHODS[seed // 2 % 3], "auto"])
        return Verdict(WRONG, wrong[0]) if wrong else Verdict(RIGHT)

    return attempted(compared, None)


def answers(train: Train, order: int, methods: Sequence[str] = METHODS) -> dict[str, Any]:
    """What each method and each analysis says and warns of; of a refusal, its kind."""
    try:
        system = gl.compile(Model(train=train, order=order))
    except gl.GearlibError as refusal:
        return {"compile": type(refusal).__name__}
    found: dict[str, Any] = {"redundant": redundant(system)}
    for name, action in questions(system, train, methods):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", gl.InputWarning)  # a torque between two flanges of one shaft has no effect
            try:
                found |= {f"{name}: {what}": value for what, value in action().items()}
            except gl.GearlibError as refusal:
                found[name] = type(refusal).__name__
        found[f"{name}: warnings"] = sorted(f"{w.category.__name__}: {w.message}" for w in said)
    return found


def redundant(system: gl.System) -> list[str]:
    """What the summary says of redundant connections."""
    return [line for line in system.summary().split("\n") if line.startswith("  redundant")]


def questions(system: gl.System, train: Train, methods: Sequence[str]) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """Names of analyses, and what gives their answers."""
    given = train.unbound()
    names = sorted(system.variables)
    bodies = [f"{p.name}.w" for p in train.parts if p.kind == "Inertia"]
    shafts = [(f"{p.name}.flange_a", f"{p.name}.flange_b") for p in train.parts if p.kind == "IdealGear"]

    def run(method: str) -> Callable[[], dict[str, Any]]:
        def values() -> dict[str, Any]:
            result = system.simulate(TIMES[-1], times=TIMES, inputs=given, method=method, rtol=1e-9)
            return {n: result[n] for n in names}

        return values

    def steady() -> dict[str, Any]:
        result = system.simulate(0.1, samples=2, inputs=given, start="steady", rtol=1e-9)
        return {n: result[n] for n in bodies}

    def linear() -> dict[str, Any]:
        matrices = system.linearize(outputs=bodies)
        s = 0.7 + 1.3j
        gain = matrices.C @ np.linalg.solve(s * np.eye(len(matrices.A)) - matrices.A, matrices.B) + matrices.D
        inputs = [system.inputs.index(n) for n in sorted(system.inputs)]
        return {"transfer": gain[:, inputs]}

    def poles() -> dict[str, Any]:
        return {"poles": moving(gl.stability(system).eigenvalues)}

    def modes() -> dict[str, Any]:
        found = gl.modes(system)
        return {"frequencies": moving(found.frequencies), "decays": moving(found.decays)}

    def response() -> dict[str, Any]:
        found = gl.frequency_response(system, np.array([2.0, 40.0]), sorted(given), bodies)
        return {f"{i} {o}": found[o, i] for i in given for o in bodies}

    def flow(what: str) -> dict[str, Any]:
        found = system.power_flow(torques=given)
        flanges = [f"{p.name}.{f}" for p in train.parts if "Sensor" not in p.kind for f in p.flanges]
        return {flange: getattr(found[flange], what) for flange in flanges}

    def energies() -> dict[str, Any]:
        balance = system.simulate(TIMES[-1], times=TIMES, inputs=given, rtol=1e-9).energy_balance()
        parts = {"work": balance.work, "stored": balance.stored, "heat": balance.heat}
        return {f"{what} {path}": values for what, by_path in parts.items() for path, values in by_path.items()}

    for method in methods:
        yield method, run(method)
    yield "mobility", lambda: {"freedoms": gl.mobility(system)}
    for a, b in shafts:
        yield f"speed ratio {a}", lambda a=a, b=b: {"ratio": gl.speed_ratio(system, a, b)}  # type: ignore[misc]
    if bodies:
        yield "steady", steady
        if given:
            yield "linear", linear
            yield "response", response
    yield "stability", poles
    yield "modes", modes
    yield "power flow", lambda: flow("speed")
    yield "torques", lambda: flow("torque")
    yield "energies", energies


def moving(values: Any) -> Any:
    """Eigenvalues that are not zero, sorted so that rounding does not reorder them."""
    values = np.asarray(values)
    size = float(np.abs(values).max(initial=1.0))
    kept = values[np.abs(values) > 1e-5 * size]
    return np.array(sorted(kept, key=lambda v: (round(float(v.real / size), 7), round(float(v.imag / size), 7))))


def differences(train: Train, order: int, methods: Sequence[str] = METHODS, tolerance: float = 1e-6) -> list[str]:
    """Where the answers depend on the order."""
    one, other = answers(train, 0, methods), answers(train, order, methods)
    wrong = [f"only once: {name}" for name in sorted(one.keys() ^ other.keys())]
    sizes: dict[str, float] = {}
    for name in one.keys() & other.keys():
        if not isinstance(one[name], (str, list)):
            analysis = name.split(":")[0]
            sizes[analysis] = max(sizes.get(analysis, 1.0), float(np.abs(one[name]).max(initial=0.0)))
    for name in sorted(one.keys() & other.keys()):
        a, b = one[name], other[name]
        if isinstance(a, (str, list)):
            same = a == b
        else:
            a, b = np.asarray(a), np.asarray(b)
            same = a.shape == b.shape and float(np.abs(a - b).max(initial=0.0)) <= tolerance * sizes[name.split(":")[0]]
        if not same:
            wrong.append(f"{name}: {a} or {b}")
    return wrong
