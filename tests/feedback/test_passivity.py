"""The certificate of passivity: against the paper's explicit matrices, at the ports, and where there is none."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.feedback import passivity as parts
from gearlib.feedback.passivity import Passivity
from gearparts import blocks
from gearparts.trains import zhou_cui_2022 as zc


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_xp_train_for_any_positive_parameters(seed: int | None) -> None:
    system = gl.compile(gp.ZhouCui2022())
    rng = np.random.default_rng(seed)
    names = ("I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v")
    given = {} if seed is None else {n: zc.TABLE_4[n].value * float(rng.uniform(0.1, 10)) for n in names}
    proof = gl.passivity(system, parameters=given)
    assert proof.holds
    assert str(gl.stability(system, parameters=given)).count("passive: the stored energy") == 1
    # the same energy from the printed equations: momenta p and deflections q, with the dependent inertias
    params = zc.bond_parameters(**given)
    x = rng.normal(size=8) * [1, 1e-5, 1, 1, 1e-5, 1, 1e-5, 1]
    flows = zc.flows(x, params)
    energy = sum(params.I[b] * flows[b] ** 2 for b in zc.INERTIAS) / 2
    energy += sum(x[k] ** 2 / params.C[b] for k, b in ((1, 6), (4, 30), (6, 74))) / 2
    lost = sum(params.R[b] * flows[b] ** 2 for b in zc.RESISTANCES)
    values = {
        "w_in": flows[2], "q_ring": x[1], "q_sun": x[4], "q_pair": x[6], "train.x_unit.planets_at_ring.w": flows[11],
        "train.x_unit.planets_at_sun.w": -flows[35], "w_sun": flows[69], "w_out": -flows[78],
    }  # fmt: skip
    state = np.array([values[name] for name in proof.states])
    assert state @ proof.Q @ state / 2 == pytest.approx(energy, rel=1e-9)
    assert state @ proof.W @ state == pytest.approx(lost, rel=1e-6)


def test_output_of_a_torque_is_the_speed_of_its_shaft() -> None:
    system = gl.compile(gp.ZhouCui2022())
    proof, linear = gl.passivity(system), system.linearize(inputs=["tau_in"], outputs=["w_in"])
    assert proof.states == tuple(linear.state_labels)
    assert pytest.approx(np.asarray(linear.C), abs=1e-12) == np.asarray(linear.B).T @ proof.Q


class Motor(gl.Component):
    """A motor whose torque grows with its speed."""

    flange = gp.Flange("shaft")
    d = gl.Parameter("N.m.s/rad", default=0.5)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, -self.d * self.w)]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=-self.d * self.w**2)


class Silent(Motor):
    """A motor of which nothing is declared."""

    energies = gl.Component.energies


class Shaft(gl.Component):
    """A body on a spring, with something on its shaft."""

    other = gl.Structural("inertia")

    def assemble(self) -> list[Any]:
        self.body, self.spring, self.ground = gp.Inertia(J=2.0), gp.Spring(c=5.0), gp.Fixed()
        links = [
            gl.connect(self.body.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.ground.flange),
        ]
        if self.other == "backlash":
            self.end = gp.ElastoBacklash(c=10.0, d=1.0, b=0.1)
            return [
                *links,
                gl.connect(self.body.flange_a, self.end.flange_a),
                gl.connect(self.end.flange_b, self.ground.flange),
            ]
        if self.other == "inertia":
            self.end = gp.Inertia(J=1.0)
            return [*links, gl.connect(self.body.flange_a, self.end.flange_a)]
        self.end = {"motor": Motor, "silent": Silent}[self.other]()
        return [*links, gl.connect(self.body.flange_a, self.end.flange)]


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        ("motor", "there is a motion that gains energy without an input"),
        ("silent", "end (Silent) does not declare what it stores and loses"),
        ("backlash", "the equations are not linear with constant coefficients"),
    ],
)
def test_no_certificate_without_a_proof(other: str, reason: str) -> None:
    system = gl.compile(Shaft(other=other))
    assert not gl.passivity(system).holds
    assert gl.passivity(system).Q.shape == gl.passivity(system).W.shape == ((0, 0) if other != "motor" else (2, 2))
    assert str(gl.passivity(system)) == f"no certificate of passivity: {reason}"
    assert "passive" not in str(gl.stability(system))


def test_an_undamped_train_is_passive_and_loses_nothing() -> None:
    system = gl.compile(Shaft())
    proof = gl.passivity(system)
    assert proof.holds
    assert np.abs(proof.W).max() < 1e-12
    with pytest.raises(ArgumentError, match="expected a compiled system"):
        gl.passivity(gp.ZhouCui2022())  # type: ignore[arg-type]


class Oscillator(gl.Component):
    """``2 w' = -5 phi - 0.5 w``, with an energy that is declared below."""

    loss = gl.Parameter("N.m.s/rad", default=0.5)
    w = gl.Variable("rad/s", start=1.0)
    phi = gl.Variable("rad", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.phi), self.w), gl.Eq(2.0 * gl.der(self.w), -5.0 * self.phi - self.loss * self.w)]


def declared(stored: Callable[[Any], Any]) -> gl.System:
    class Declared(Oscillator):
        def energies(self) -> gl.Energy:
            return gl.Energy(stored=stored(self), heat=self.loss * self.w**2)

    return gl.compile(Declared())


GAINS, NOT_QUADRATIC = "there is a motion that gains energy without an input", r"the energy of .*\(Declared\) is not quadratic"


@pytest.mark.parametrize(
    ("stored", "Q", "reason"),
    [
        (lambda m: m.w**2 + 2.5 * m.phi**2, [[2.0, 0.0], [0.0, 5.0]], ""),
        (lambda m: 0.5 * m.w**2 + 2.5 * m.phi**2, [[1.0, 0.0], [0.0, 5.0]], GAINS),
        (lambda m: (m.w + m.phi) ** 2, [[2.0, 2.0], [2.0, 2.0]], GAINS),
        (
            lambda m: -(m.w**2) - 2.5 * m.phi**2,
            [[-2.0, 0.0], [0.0, -5.0]],
            "a component declares a stored energy that is negative",
        ),
        (lambda m: m.w**2 + 2.5 * m.phi**2 + 1.0, None, NOT_QUADRATIC),
        (lambda m: m.w**2 + 2.5 * m.phi**2 + m.phi, None, NOT_QUADRATIC),
        (lambda m: m.w**2 + m.phi**4, None, NOT_QUADRATIC),
        (lambda m: m.w**2 + 2.5 * m.phi**2 * (1 + gl.time), None, r"the energy of .*\(Declared\) changes with time"),
    ],
)
def test_a_declared_energy_proves_what_it_can(stored: Any, Q: Any, reason: str) -> None:
    """Twice the energy is x'Qx, and the losses are x'Wx; an energy that the equations contradict proves nothing."""
    proof = gl.passivity(declared(stored))
    assert proof.holds == (not reason)
    assert re.fullmatch(reason, proof.reason)
    if Q is not None:
        order = np.ix_(*[[proof.states.index(name) for name in ("w", "phi")]] * 2)
        assert proof.Q[order] == pytest.approx(np.array(Q))
        A = np.array([[-0.25, -2.5], [1.0, 0.0]])
        assert proof.W[order] == pytest.approx(-(np.array(Q) @ A + A.T @ np.array(Q)) / 2)
    if not reason:
        assert str(proof).endswith("(2 states, rank of Q 2, of W 1)")


def test_losses_of_either_sign_decide_however_small() -> None:
    system = declared(lambda m: m.w**2 + 2.5 * m.phi**2)
    for loss, holds in ((1e-6, True), (0.0, True), (-1e-6, False)):
        assert gl.passivity(system, parameters={"loss": loss}).holds == holds


class Undamped(gl.Component):
    def assemble(self) -> Any:
        self.a, self.first, self.b = gp.Inertia(J=0.137), gp.IdealGear(ratio=3.7), gp.Inertia(J=2.9)
        self.soft, self.second, self.c = gp.Spring(c=1.3e5), gp.IdealGear(ratio=-1 / 7.3), gp.Inertia(J=0.033)
        self.stiff = gp.Spring(c=7.7e3)
        line = [self.a, self.first, self.soft, self.b, self.second, self.stiff, self.c]
        return [gl.connect(one.flange_b, other.flange_a) for one, other in zip(line, line[1:], strict=False)]


def test_rounding_of_gear_ratios_gains_no_energy() -> None:
    proof = gl.passivity(gl.compile(Undamped()))
    assert proof.holds
    assert not proof.W.any()


# ---------------------------------------------------------------- the parts of the proof


@pytest.mark.parametrize(
    ("names", "numbers", "formula", "matrix"),
    [
        ("k a b", {"k": 2.0}, lambda k, a, b: k * a**2 + 3 * a * b - b**2, [[2.0, 1.5], [1.5, -1.0]]),
        ("a k b", {"k": 2.0}, lambda a, k, b: 1e-30 * (k * a**2 + 3 * a * b), [[2e-30, 1.5e-30], [1.5e-30, 0.0]]),
        ("a b c", {}, lambda a, b, c: 1e30 * (a - 2 * b + 3 * c) ** 2, 1e30 * np.outer([1, -2, 3], [1, -2, 3])),
        ("a", {}, lambda a: 5.0 * a * a, [[5.0]]),
        ("a", {}, lambda a: 0.0, [[0.0]]),
        ("k", {"k": 2.0}, lambda k: k - 2.0, np.zeros((0, 0))),
        ("k", {"k": 3.0}, lambda k: k - 2.0, None),
        ("a", {}, lambda a: a, None),
        ("a", {}, lambda a: a**2 + 1e-3, None),
        ("a", {}, lambda a: a**2 + 1e-6 * a**4, None),
        ("a b", {}, lambda a, b: a**2 * b**2, None),
        ("a b", {}, lambda a, b: a**2 + abs(b) * b, None),
    ],
)
def test_the_matrix_of_an_energy(names: str, numbers: dict[str, float], formula: Callable[..., float], matrix: Any) -> None:
    found = parts.quadratic(SimpleNamespace(names=tuple(names.split()), function=formula), numbers)  # type: ignore[arg-type]
    if matrix is None:
        assert found is None
    else:
        assert found is not None
        assert found.shape == np.shape(matrix)
        assert found == pytest.approx(np.array(matrix), rel=1e-12)


def test_a_form_in_states_that_store_half_a_joule_each() -> None:
    """States without an energy of their own keep their unit."""
    form = np.arange(9.0).reshape(3, 3)
    found = parts.rescaled_form(form, np.array([[4.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 9.0]]))
    assert found == pytest.approx(np.array([[0, 1 / 2, 2 / 6], [3 / 2, 4, 5 / 3], [6 / 6, 7 / 3, 8 / 9]]))
    assert parts.rescaled_form(form, -np.eye(3)) == pytest.approx(form)


GAINED, NEGATIVE = (
    "there is a motion that gains energy without an input",
    "a component declares a stored energy that is negative",
)


@pytest.mark.parametrize(
    ("Q", "W", "said"),
    [
        (np.eye(2), np.zeros((2, 2)), ""),
        (np.eye(2), np.diag([1.0, -5e-10]), ""),
        (np.eye(2), np.diag([1.0, -2e-9]), GAINED),
        (np.eye(2), np.diag([1e-20, -2e-29]), GAINED),
        (np.diag([1e12, 1e-12]), np.diag([1e12, -5e-13]), GAINED),  # half of what the second state stores
        (np.diag([1e12, 1e-12]), np.diag([1e12, 5e-13]), ""),
        (np.array([[1.0, 1 + 5e-10], [1 + 5e-10, 1.0]]), np.zeros((2, 2)), ""),
        (np.array([[1.0, 1 + 2e-9], [1 + 2e-9, 1.0]]), np.zeros((2, 2)), NEGATIVE),
        (-np.eye(1), -np.eye(1), NEGATIVE),
        (np.zeros((0, 0)), np.zeros((0, 0)), ""),
    ],
)
def test_what_speaks_against_a_proof(Q: Any, W: Any, said: str) -> None:
    """Both forms are positive semidefinite but for rounding, in units of what each state stores."""
    assert parts.doubt(Q, W) == said


def test_ranks_do_not_depend_on_the_units_of_the_states() -> None:
    proof = Passivity(("a", "b", "c"), np.diag([1e14, 1e-14, 0.0]), np.diag([0.0, 1e-16, 0.0]))
    assert str(proof).endswith(" alone (3 states, rank of Q 2, of W 1)")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ""),
        ({"stored": None}, ""),
        ({"unknown": True}, "a.b (Kind) does not declare what it stores and loses"),
        ({"declares": False}, "a.b (Kind) does not declare what it stores and loses"),
        ({"stored": SimpleNamespace(names=("x", "time"))}, "the energy of a.b (Kind) changes with time"),
        ({"stored": SimpleNamespace(names=("x", "switch"))}, "the energy of a.b (Kind) changes with time"),
    ],
)
def test_components_whose_energy_is_not_known(changes: dict[str, Any], said: str) -> None:
    part = {"path": "a.b", "kind": "Kind", "unknown": False, "declares": True, "stored": SimpleNamespace(names=("x",))}
    model: Any = SimpleNamespace(model=SimpleNamespace(discretes=("switch",)))
    assert parts.undeclared(model, [SimpleNamespace(**part), SimpleNamespace(**part | changes)]) == said


@pytest.mark.parametrize("T", [0.1, -3.0])
def test_a_signal_that_grows_is_no_part_of_a_proof(T: float) -> None:
    """A filter of a speed, which acts on nothing: its pole is -1 / T. The energies of the train say nothing of it."""

    class Filtered(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.shaft, self.body, self.ground = gp.SpringDamper(c=4.0, d=0.5), gp.Inertia(J=1.0), gp.Fixed()
            self.torque, self.sensor = gp.Torque(), gp.SpeedSensor()
            self.filter = blocks.TransferFunction(b=[1.0], a=[T, 1.0])
            return [
                gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.ground.flange), gl.connect(self.sensor.flange, self.body.flange_b),
                gl.connect(self.sensor.w, self.filter.u),
            ]  # fmt: skip

    system = gl.compile(Filtered())
    proof = gl.passivity(system)
    assert proof.holds == (T > 0)
    assert proof.reason == ("" if T > 0 else "a motion that stores no energy, of signals for example, grows")
    report = gl.stability(system, loop=("torque.tau", "body.w"), gain=2.0)
    vibrating = np.roots([1.0, 0.5, 4.0]), np.roots([1.0, 2.5, 4.0])
    for found, pair in zip((report.eigenvalues, report.loop.closed_poles.values), vibrating, strict=True):
        assert np.sort_complex(found) == pytest.approx(np.sort_complex([*pair, -1 / T]), rel=1e-9)
    assert {report.verdict, report.loop.verdict, gl.stability(system).verdict} == {"stable" if T > 0 else "unstable"}
