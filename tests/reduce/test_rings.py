"""Rings of springs against matrices written by hand: their twists are states, and no absolute angle is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError, SingularError

BODIES, SPRINGS = [0.1, 0.2, 0.3, 0.4], [300.0, 400.0, 500.0, 200.0, 700.0]  # kg.m2, N.m/rad
DAMPING, BRAKE = 0.002, 0.3  # s, N.m.s/rad: of the springs per stiffness, of the last body
JOINED = {  # the bodies that each spring joins
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "turned": [(0, 1), (2, 1), (2, 0)],
    "square with a diagonal": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)],
    "two beside one": [(0, 1), (1, 0), (1, 2), (2, 0), (0, 2)],
    "star and ring": [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)],
}


class Net(gl.Component):
    """Bodies joined by springs, free to turn but for a brake on the last one; in any order of declaration."""

    joined = gl.Structural("triangle", choices=tuple(JOINED))
    order = gl.Structural(0, choices=tuple(range(9)))

    def assemble(self) -> list[Any]:
        pairs = JOINED[self.joined]
        n = 1 + max(max(pair) for pair in pairs)
        parts: dict[str, Any] = {f"body{i}": gp.Inertia(J=J) for i, J in enumerate(BODIES[:n])}
        parts |= {f"spring{k}": gp.SpringDamper(c=c, d=DAMPING * c) for k, c in enumerate(SPRINGS[: len(pairs)])}
        parts |= {"brake": gp.Damper(d=BRAKE), "ground": gp.Fixed(), "torque": gp.Torque()}
        links = [
            gl.connect(parts["torque"].flange, parts["body0"].flange_a),
            gl.connect(parts[f"body{n - 1}"].flange_b, parts["brake"].flange_a),
            gl.connect(parts["brake"].flange_b, parts["ground"].flange),
        ]
        for k, (a, b) in enumerate(pairs):
            links.append(gl.connect(parts[f"body{a}"].flange_b, parts[f"spring{k}"].flange_a))
            links.append(gl.connect(parts[f"spring{k}"].flange_b, parts[f"body{b}"].flange_a))
        mixed = np.random.default_rng(self.order).permutation
        names, places = list(parts), range(len(links))
        for name in mixed(names).tolist() if self.order else names:
            setattr(self, name, parts[name])
        return [links[i] for i in (mixed(places).tolist() if self.order else places)]


def by_hand(joined: str) -> np.ndarray:
    """Poles of the net without that of its free rotation."""
    pairs = JOINED[joined]
    n = 1 + max(max(pair) for pair in pairs)
    K = np.zeros((n, n))
    for (a, b), c in zip(pairs, SPRINGS, strict=False):
        K[[a, b, a, b], [a, b, b, a]] += [c, c, -c, -c]
    D = DAMPING * K + BRAKE * np.diag(np.eye(n)[-1])
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / np.array(BODIES[:n])[:, None], -D / np.array(BODIES[:n])[:, None]]])
    values = np.linalg.eigvals(A)
    return np.sort_complex(values[np.argsort(np.abs(values))[1:]])


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("joined", JOINED)
def test_a_ring_is_as_stable_as_its_vibrations(joined: str, order: int) -> None:
    system = gl.compile(Net(joined=joined, order=order))
    report = gl.stability(system)
    assert report.verdict == "stable"
    assert np.sort_complex(report.eigenvalues) == pytest.approx(by_hand(joined), rel=1e-9)
    assert not any(state.endswith(".phi") for state in system.states)


@pytest.mark.parametrize("joined", ["triangle", "square with a diagonal"])
def test_a_ring_that_turns_has_a_periodic_motion(joined: str) -> None:
    system, omega = gl.compile(Net(joined=joined, order=1)), 23.0
    (last,) = [f"body{i}.w" for i in (2 + (joined != "triangle"),)]
    push, twist = {"torque.tau": lambda phase, omega: 3 * np.cos(phase) + 0.6}, "spring1.phi_rel"
    found = gl.harmonic_balance(system, omega, 1.1 * omega, inputs=push, points=2, outputs=[last, twist])
    assert found.mean(last) == pytest.approx(0.6 / BRAKE)
    response = gl.frequency_response(system, [omega], ["torque.tau"], [last, twist])
    for name in (last, twist):
        assert found.amplitude(name)[0] == pytest.approx(3 * abs(response[name, "torque.tau"][0]), rel=1e-6)


def test_twists_stay_exact_however_far_the_ring_has_turned() -> None:
    system = gl.compile(Net())
    run = system.simulate(
        2.0, samples=5, start={f"body{i}.w": 1e7 for i in range(3)}, parameters={"brake.d": 0.0}, inputs={"torque.tau": 1.0}
    )
    twists = np.array([run[f"spring{k}.phi_rel"] for k in range(3)])
    assert np.abs(twists.sum(axis=0)).max() <= 1e-15
    assert run["body2.w"][-1] == pytest.approx(1e7 + 2.0 / 0.6, rel=1e-9)


@pytest.mark.parametrize("joined", ["triangle", "two beside one"])
def test_each_spring_of_a_ring_has_its_own_energy_in_a_mode(joined: str) -> None:
    """Computed from the equation that defines its twist, also where the sum around the ring stands in for it."""
    pairs = JOINED[joined]
    undamped = {"brake.d": 0.0} | {f"spring{k}.d": 0.0 for k in range(len(pairs))}
    modes = gl.modes(gl.compile(Net(joined=joined)), parameters=undamped)
    springs = [modes.components.index(f"spring{k}") for k in range(len(pairs))]
    for mode in range(modes.free, len(modes)):
        shape = modes.shape(mode, *(f"body{i}.w" for i in range(3)))
        strained = np.array([c * abs(shape[b] - shape[a]) ** 2 for (a, b), c in zip(pairs, SPRINGS, strict=False)])
        assert modes.potential[mode, springs] == pytest.approx(100 * strained / strained.sum(), rel=1e-9)


def test_a_long_ring_is_split() -> None:
    """Into short sums over auxiliary variables, so that no equation grows with the model."""

    class Wheel(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=0.1) for _ in range(40)]
            self.spring = [gp.SpringDamper(c=100.0, d=0.1) for _ in range(40)]
            follow = [*self.body[1:], self.body[0]]
            return [
                *(gl.connect(b.flange_b, s.flange_a) for b, s in zip(self.body, self.spring, strict=True)),
                *(gl.connect(s.flange_b, b.flange_a) for s, b in zip(self.spring, follow, strict=True)),
            ]

    system = gl.compile(Wheel())
    assert max(len(group.template.columns) for group in system.translation.model.groups) <= 8
    assert not any(state.endswith(".phi") for state in system.states)
    pairs = gl.modes(system).frequencies[1:5]
    assert pairs == pytest.approx(np.sqrt(1000.0) / np.pi * np.sin(np.pi * np.array([1, 1, 2, 2]) / 40), rel=1e-9)


class Floating(gl.Component):
    """Nodes without inertia, joined by springs to nothing but each other, beside a body; the damping of one spring may be zero."""

    d = gl.Parameter("N.m.s/rad", default=0.0, min=0)

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=1.0)
        joined = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3)]
        damping = [0.5, 0.8, self.d, 3.0, 0.4]
        self.springs = [gp.SpringDamper(c=100.0 + k, d=damping[k]) for k in range(5)]
        ends: dict[int, list[Any]] = {}
        for (i, j), spring in zip(joined, self.springs, strict=True):
            ends.setdefault(i, []).append(spring.flange_a)
            ends.setdefault(j, []).append(spring.flange_b)
        return [gl.connect(*flanges) for flanges in ends.values()]


@pytest.mark.parametrize("d", [0.0, 0.7])
def test_a_ring_without_bodies_that_floats_is_refused(d: float) -> None:
    """Nothing determines how it turns as a whole; added round the rings, the equations hold no angle that would."""
    with pytest.raises(
        (BalanceError, SingularError), match=r"not balanced\. under-determined: nothing determines springs.*phi"
    ):
        gl.compile(Floating(d=d)).simulate(1.0, samples=2)
