"""Linear trains under constant torques: every analysis against what the matrices say.

The steady state is the rigid motion in which dampers take what the torques give; modes are the eigenvalues of the state matrix; a
frequency response is the dynamic stiffness solved at a frequency; the power flow is the steady motion once more.
"""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import gearlib as gl
from tests.stress.described import Model, Part, Signal, Train
from tests.stress.linear_draw import linear_train
from tests.stress.linear_reference import PRESCRIBED, SMALL, Floats, LinearTrain, Unclear, constrained
from tests.stress.verdicts import ANSWERED, REFUSED, RIGHT, UNCLEAR, WRONG, Verdict, attempted


def analysed_train(seed: int) -> Train:
    """A linear train whose torques and prescribed speeds are constant; three in four have a load at each body, and so a steady state."""
    train, rng = linear_train(seed), random.Random(seed)
    parts = [constant(p) for p in train.parts]
    if rng.random() < 0.75:
        nodes = sorted({p.at[0] for p in parts if p.kind == "Inertia"})
        parts += [load(f"load{node}", node, rng) for node in nodes]
    return replace(train, parts=tuple(parts))


def load(name: str, node: int, rng: random.Random) -> Part:
    values = (("tau_nominal", -rng.uniform(0.1, 5)), ("w_nominal", rng.uniform(0.5, 5)), ("torque_direction", False))
    return Part(name, "LinearSpeedDependentTorque", (node,), values)


def constant(part: Part) -> Part:
    if part.kind in ("Speed", "Position", "Accelerate", "Move"):
        speed = next(s.bias for _, s in part.signals())
        return Part(part.name, "ConstantSpeed", part.at, (("w_fixed", speed),))
    if part.kind == "TorqueStep":
        return Part(part.name, "ConstantTorque", part.at, (("tau_constant", part.value("step_torque")),))
    values = tuple((n, Signal(s.bias, bound=s.bound) if isinstance(s, Signal) else s) for n, s in part.values)
    return replace(part, values=values)


def judge_analyses(train: Train, seed: int = 0) -> Verdict:
    """The verdict on all analyses of one train."""
    rng = random.Random(seed)
    try:
        solved = LinearTrain(train)
        steady = steady_motion(solved)
    except Unclear as reason:
        return Verdict(UNCLEAR, str(reason))
    if solved.problems or solved.locked or solved.held_twice:
        return Verdict(UNCLEAR, "no unique motion: judged among the linear trains")
    verdicts: list[Verdict] = []

    compiled: list[gl.System] = []
    order = rng.choice([0, seed + 1])

    def system() -> gl.System:
        if not compiled:
            compiled.append(gl.compile(Model(train=train, order=order)))
        return compiled[0]

    def asked(what: str, refusal: str | None, action: Callable[[gl.System], Verdict]) -> None:
        with warnings.catch_warnings():  # at a corner of a load at rest, the slope of either side is right
            warnings.filterwarnings("ignore", "at this operating point there is a corner", gl.GearlibWarning)
            verdict = attempted(lambda: action(system()), refusal or solved.differentiated)
        said = f"{verdict.detail} | {what}" if verdict.kind == REFUSED else f"{what}: {verdict.detail}"
        verdicts.append(Verdict(verdict.kind, said))

    asked("mobility", None, lambda system: mobility(system, solved))
    if solved.nodes:
        A = without_angles(solved)
        asked("poles", None, lambda system: poles(system, A))
        asked("modes", None, lambda system: modes(system, A))
        asked("response", None, lambda system: response(system, solved, rng))
        asked("steady state", steady.none or steady.doubtful, lambda system: steady_state(system, solved, steady))
        asked("power flow", steady.none or steady.open or steady.doubtful, lambda system: power_flow(system, solved, steady))
    short = [v for v in verdicts if v.short]
    if short:
        return short[0]
    refused = [v for v in verdicts if v.kind == REFUSED]  # a train with a question that is rightly refused counts as refused
    return refused[0] if refused else Verdict(RIGHT)


# ---------------------------------------------------------------- what is right


@dataclass(frozen=True)
class Steady:
    """Speeds in the steady motion; why there is none; why there are many; why it may be refused although the speeds are known."""

    speeds: Floats | None
    none: str | None
    open: str | None
    doubtful: str | None = None


def steady_motion(solved: LinearTrain) -> Steady:
    """Speeds at which springs keep their twists and dampers take what the torques give."""
    n = len(solved.nodes)
    free = constrained(np.eye(n), list(solved.G))
    rigid = constrained(free, solved.elastic)
    z = solved.z.at(0.0)
    v = solved.v_p @ z
    doubtful = None
    if solved.elastic:
        E = np.array([row / np.abs(row).max() for row in solved.elastic if np.abs(row).max() > 0]).reshape(-1, n)
        held = np.abs(E @ free).max(axis=1, initial=0.0) < SMALL  # both ends are prescribed: no speed depends on what it takes
        if np.abs(E[held] @ v).max(initial=0.0) > 1e-9 * (1 + np.abs(v).max(initial=0.0)):
            doubtful = "a spring between prescribed motions is wound up for ever"
        elif held.any():
            doubtful = "the twist of a spring between prescribed motions follows from no speed"
        E = E[~held]
        v = v + free @ np.linalg.lstsq(E @ free, -E @ v, rcond=SMALL)[0]
        if np.abs(E @ v).max(initial=0.0) > 1e-9 * (1 + np.abs(v).max(initial=0.0)):
            return Steady(None, "a spring is wound up for ever", None)
    damping = rigid.T @ solved.D @ rigid
    force = rigid.T @ (solved.forces(0.0) @ z - solved.preload - solved.D @ v)
    undamped = constrained(rigid, solved.damped)
    if undamped.shape[1]:
        if np.abs(undamped.T @ (solved.forces(0.0) @ z - solved.preload)).max() > 1e-9:
            return Steady(None, "what is driven has no load", None)
        return Steady(None, None, "a motion that nothing drives or brakes", doubtful)
    return Steady(v + rigid @ np.linalg.solve(damping, force), None, None, doubtful)


def without_angles(solved: LinearTrain) -> Floats:
    """The state matrix without angles on which no torque depends; their poles are exact zeros, which would spread if computed."""
    A, T1, T2 = solved.system(0.0).A, solved.T1, solved.T2
    count = T1.shape[1] + T2.shape[1]
    whole = np.hstack([T1, T2, solved.T3])
    turning = whole.T @ constrained(whole, solved.elastic)  # T1, T2 and T3 are orthonormal
    kept = constrained(np.eye(count), list(turning[:count].T)).T
    P = np.zeros((len(kept) + T1.shape[1], len(A)))
    P[: len(kept), :count] = kept
    P[len(kept) :, count:] = np.eye(T1.shape[1])
    result: Floats = P @ A @ P.T
    return result


def dynamic(solved: LinearTrain, force: Floats, omega: float) -> Floats:
    """Speeds of the nodes under a harmonic torque."""
    n, m, s = len(solved.nodes), len(solved.G), 1j * omega
    whole = np.zeros((n + m, n + m), complex)
    whole[:n, :n] = s * solved.M + solved.D + solved.K / s
    whole[:n, n:], whole[n:, :n] = -solved.G.T, solved.G
    scale = np.concatenate([1 / np.sqrt(np.abs(np.diag(whole[:n, :n])) + 1e-6), np.ones(m)])
    scaled = scale[:, None] * whole * scale
    found: Floats = (scale * np.linalg.lstsq(scaled, scale * np.concatenate([force, np.zeros(m)]), rcond=1e-13)[0])[:n]
    return found


# ---------------------------------------------------------------- what gearlib says


def close(found: Any, right: Any, label: str, tolerance: float = 1e-6, size: float = 0.0) -> Verdict | None:
    found, right = np.atleast_1d(found), np.atleast_1d(right)
    size = max(size, float(np.abs(right).max(initial=0.0)), 1e-6)
    if found.shape == right.shape and np.abs(found - right).max(initial=0.0) <= tolerance * size:
        return None
    return Verdict(WRONG, f"{label} is {found}, right is {right}")


def mobility(system: gl.System, solved: LinearTrain) -> Verdict:
    rigid = constrained(constrained(np.eye(len(solved.nodes)), list(solved.G)), solved.elastic)
    found = gl.mobility(system)
    return Verdict(RIGHT) if found == rigid.shape[1] else Verdict(WRONG, f"{found}, right is {rigid.shape[1]}")


def matched(found: Floats, A: Floats, label: str) -> Verdict:
    """Whether eigenvalues are those of a matrix, but for zeros, as far as these are determined in double precision."""
    right = np.linalg.eigvals(A) if len(A) else np.zeros(0, complex)
    size = float(np.abs(right).max(initial=0.0)) or 1.0
    rng = np.random.default_rng(0)
    slack = np.zeros(len(right))
    for _ in range(3):
        shaken = np.linalg.eigvals(A * (1 + 1e-12 * rng.standard_normal(A.shape))) if len(A) else right
        near = np.abs(shaken[:, None] - right)
        i, j = linear_sum_assignment(near)
        slack[j] = np.maximum(slack[j], near[i, j])
    allowed = 1e-7 * np.abs(right) + 1e4 * slack + 1e-10 * size
    zero = np.abs(right) <= np.maximum(max(1e-9 * size, 1e-12), allowed)
    moving, allowed = right[~zero], allowed[~zero]
    least = 0.5 * np.abs(moving).min(initial=size)
    found = found[np.abs(found) > least]
    if len(found) != len(moving):
        return Verdict(
            WRONG,
            f"{label}: {len(found)} poles that are not zero, {np.sort_complex(found)}; right are {np.sort_complex(moving)}",
        )
    distances = np.abs(found[:, None] - moving)
    i, j = linear_sum_assignment(distances)
    far = distances[i, j] - allowed[j]
    if len(far) and far.max() > 0:
        k = int(np.argmax(far))
        return Verdict(WRONG, f"{label}: {found[i[k]]:.10g}, right is {moving[j[k]]:.10g}")
    return Verdict(RIGHT)


def poles(system: gl.System, A: Floats) -> Verdict:
    return matched(np.asarray(gl.stability(system).eigenvalues), A, "stability")


def modes(system: gl.System, A: Floats) -> Verdict:
    found = gl.modes(system)
    values = np.asarray(found.eigenvalues)
    swinging = values[np.abs(values.imag) > 0]
    real = values[np.abs(values.imag) == 0]
    return matched(np.concatenate([swinging, swinging.conj(), real, np.asarray(found.decays)]), A, "modes")


def response(system: gl.System, solved: LinearTrain, rng: random.Random) -> Verdict:
    """From one unbound torque to speeds of bodies and torques of springs."""
    train = solved.train
    drives = [p for p in train.parts if p.kind in ("Torque", "Torque2") and not p.value("tau").bound]
    outputs = [p for p in train.parts if p.kind in ("Inertia", "SpringDamper", "Spring")]
    if not drives or not outputs:
        return Verdict(RIGHT)
    drive = rng.choice(drives)
    outputs = rng.sample(outputs, min(len(outputs), 4))
    names = [f"{p.name}.{'w' if p.kind == 'Inertia' else 'tau'}" for p in outputs]
    force = solved.spread(drive, (-1.0, 1.0) if drive.kind == "Torque2" else (1.0, -1.0)[: len(drive.at)])
    omega = np.array([rng.uniform(0.5, 3), rng.uniform(3, 30), rng.uniform(30, 200)])
    found = gl.frequency_response(system, omega, [f"{drive.name}.tau"], names)
    for k, w in enumerate(omega):
        v = dynamic(solved, force, w)
        shaken = dynamic(solved, force, w * (1 + 1e-9))
        right = []
        for p in outputs:
            if p.kind == "Inertia":
                right.append(solved.spread(p, (1.0,)) @ v)
            else:
                right.append((p.value("d") + p.value("c") / (1j * w)) * (solved.spread(p, (-1.0, 1.0)) @ v))
        sharp = 1.0 + np.abs(shaken - v).max() / (1e-9 * max(np.abs(v).max(), 1e-300))
        most = float(np.abs(v).max())
        for p, name, value in zip(outputs, names, right, strict=True):
            # what cancels is known as well as what it is the difference of
            size = most if p.kind == "Inertia" else most * (p.value("d") + p.value("c") / w)
            wrong = close(found[name, f"{drive.name}.tau"][k], value, f"{name} at {w:.6g} rad/s", 1e-8 * sharp, size)
            if wrong is not None:
                return wrong
    return Verdict(RIGHT)


def steady_state(system: gl.System, solved: LinearTrain, steady: Steady) -> Verdict:
    result = system.simulate(1.0, start="steady", samples=3, inputs=solved.train.unbound(), rtol=1e-9)
    if steady.none is not None:
        return Verdict(ANSWERED, steady.none)
    bodies = [p for p in solved.train.parts if p.kind == "Inertia"]
    size = max([1e-3, *(float(np.abs(result[f"{p.name}.w"]).max()) for p in bodies)])
    if bodies:  # torques that cancel, and what they would bring all bodies to
        given = np.abs(solved.forces(0.0) @ solved.z.at(0.0)).max()
        size = max(size, float(given) / max(sum(p.value("J") for p in bodies), 1e-3) * float(result.time[-1]))
    for body in bodies:
        speeds = result[f"{body.name}.w"]
        wrong = close(speeds, np.full(3, speeds[0]), f"{body.name}.w, which should stay,", 1e-6, size)
        if wrong is None and steady.speeds is not None:
            wrong = close(speeds, np.full(3, solved.spread(body, (1.0,)) @ steady.speeds), f"{body.name}.w", 1e-6, size)
        if wrong is not None:
            return wrong
    return Verdict(RIGHT)


def power_flow(system: gl.System, solved: LinearTrain, steady: Steady) -> Verdict:
    given = {name: float(value) for name, value in solved.train.unbound().items()}
    flow = system.power_flow(torques=given)
    if steady.speeds is None:
        return Verdict(ANSWERED, f"{steady.none or steady.open}")
    size = max(1e-3, float(np.abs(steady.speeds).max(initial=0.0)))
    for part in solved.train.parts:
        if part.kind in ("AngleSensor", "RelAngleSensor"):
            continue
        for flange, node in zip(part.flanges, part.at, strict=True):
            right = steady.speeds[solved.place[node]]
            wrong = close(flow[f"{part.name}.{flange}"].speed, right, f"speed of {part.name}.{flange}", 1e-6, size)
            if wrong is not None:
                return wrong
        if part.kind in PRESCRIBED:
            continue
    return Verdict(RIGHT)
