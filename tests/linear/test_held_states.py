"""Linear models of locked trains: the states that a mode holds are no poles; those of the rigid train are all there is."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.gearparts.msl_hybrid_examples import CoupledClutches

LOSSES = ((0.0, 0.5, 0.4, 1.0, 1.0),)


def _element(kind: str) -> Any:
    made = {
        "clutch": lambda: gp.Clutch(fn_max=10.0, f_normalized=1.0),
        "freewheel": lambda: gp.OneWayClutch(fn_max=10.0, f_normalized=1.0),
        "brake": lambda: gp.Brake(fn_max=10.0, f_normalized=1.0),
        "bearing": lambda: gp.BearingFriction(tau_pos=[[0.0, 2.0], [10.0, 3.0]]),
        "gear": lambda: gp.LossyGear(ratio=2.0, loss_table=LOSSES),
        "rigid": lambda: gp.IdealGear(ratio=1.0),
        "wall": lambda: gp.Fixed(),
    }
    return made[kind]()


class Line(gl.Component):
    """Torque, body, the element, body, elastic shaft with damping, body with drag."""

    element = gl.Structural("clutch")
    drag = gl.Parameter("N.m.s/rad", "drag of the last body", default=0.4)

    def assemble(self) -> list[Any]:
        self.torque, self.element_ = gp.Torque(), _element(self.element)
        self.a, self.b, self.c = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Inertia(J=3.0)
        self.shaft, self.drag_, self.ground = gp.SpringDamper(c=100.0, d=0.1), gp.Damper(d=self.drag), gp.Fixed()
        through = [self.element_.flange_a, self.element_.flange_b] if self.element != "wall" else [self.element_.flange] * 2
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, through[0]),
            gl.connect(through[1], self.b.flange_a),
            gl.connect(self.b.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.c.flange_a),
            gl.connect(self.c.flange_b, self.drag_.flange_a),
            gl.connect(self.drag_.flange_b, self.ground.flange),
        ]


@pytest.fixture(scope="module")
def rigid() -> dict[str, gl.System]:
    return {"joined": gl.compile(Line(element="rigid")), "grounded": gl.compile(Line(element="wall"))}


def _same(found: Any, expected: Any) -> None:
    assert len(found) == len(expected)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "like"),
    [("clutch", "joined"), ("freewheel", "joined"), ("brake", "grounded"), ("bearing", "grounded"), ("gear", "grounded")],
)
def test_locked_train_has_the_poles_of_the_rigid_one(kind: str, like: str, rigid: dict[str, gl.System]) -> None:
    system, model = gl.compile(Line(element=kind)), rigid[like]
    report, expected = gl.stability(system), gl.stability(model)
    _same(report.eigenvalues, expected.eigenvalues)
    assert report.verdict == expected.verdict == "stable"
    outputs = ["c.w", "shaft.tau"]
    _same(system.linearize(["torque.tau"], outputs).poles(), model.linearize(["torque.tau"], outputs).poles())
    omega = np.geomspace(0.01, 100, 60)
    mine, theirs = (gl.frequency_response(s, omega, ["torque.tau"], outputs).values for s in (system, model))
    assert np.abs(mine - theirs).max() < 1e-12
    mine_, theirs_ = gl.modes(system), gl.modes(model)
    assert (mine_.free, mine_.preloads) == (theirs_.free, theirs_.preloads) == (0, 0)
    assert mine_.eigenvalues == pytest.approx(theirs_.eigenvalues, rel=1e-9)
    assert mine_.shape(0, "b.w", "c.w", "shaft.phi_rel") / mine_.shape(0, "c.w") == pytest.approx(
        theirs_.shape(0, "b.w", "c.w", "shaft.phi_rel") / theirs_.shape(0, "c.w"), abs=1e-9
    )


def test_slip_is_a_state_where_the_clutch_slips(rigid: dict[str, gl.System]) -> None:
    """Sliding, the two halves are two trains; the first of them is a body under a torque that does not depend on speed."""
    system = gl.compile(Line(element="clutch"))
    model = system.linearize([], ["shaft.tau", "a.w"], at={"element_.w_rel": 5.0}, sparse=True)
    assert len(model.states) == len(rigid["joined"].states) + 1
    assert gl.stability(model).poles.at_zero == 1


def test_angle_of_a_locked_coupling_is_held_and_that_of_the_train_is_not() -> None:
    system = gl.compile(Line(element="clutch"))
    model = system.linearize(["torque.tau"], ["element_.phi_rel", "a.phi", "c.phi"], sparse=True)
    assert gl.stability(model).poles.chains == (1,)  # the angle through which the whole train has turned
    assert not np.asarray(model.C)[0].any()
    assert np.asarray(model.C)[1:].any(axis=1).all()


@pytest.mark.parametrize("kind", ["clutch", "brake", "wall"])
def test_large_models_are_reduced_as_small_ones_are(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sparse matrices in place of full ones: the states that are left, the response, and its derivatives."""
    system = gl.compile(Line(element=kind))
    outputs = ["c.w", "c.phi", "a.phi", "shaft.tau"]

    def model() -> Any:
        return system.linearize(["torque.tau"], outputs, sparse=True)

    full = model()
    small = [full, *full.changes(["drag", "shaft.c"])]
    monkeypatch.setattr("gearlib.program.derivatives.MOST_DENSE", 0)
    monkeypatch.setattr("gearlib.linear.linearized_program.MOST_DENSE", 0)
    large = model()
    assert hasattr(large.A, "tocsr")
    assert large.states == full.states
    for mine, other in zip([large, *large.changes(["drag", "shaft.c"])], small, strict=True):
        for name in "ABCD":
            matrix = getattr(mine, name)
            found = matrix.toarray() if hasattr(matrix, "toarray") else matrix
            assert found == pytest.approx(np.asarray(getattr(other, name)), rel=1e-12, abs=1e-14), name


def test_angle_of_a_braked_shaft_is_held() -> None:
    system = gl.compile(Line(element="brake"))
    model = system.linearize(["torque.tau"], ["element_.phi", "c.phi"], sparse=True)
    assert gl.stability(model).verdict == "stable"


class Differential(gl.Component):
    """Planetary set with a clutch from sun to carrier, one from ring to carrier, a brake on the ring; two degrees of freedom."""

    f_sun = gl.Parameter("1", "normal force", default=0.0)
    f_ring = gl.Parameter("1", "normal force", default=0.0)
    f_brake = gl.Parameter("1", "normal force", default=0.0)

    def assemble(self) -> list[Any]:
        self.torque, self.set = gp.Torque(), gp.IdealPlanetary(ratio=2.0)
        self.sun, self.ring, self.carrier, self.load = (gp.Inertia(J=float(j)) for j in (1, 2, 3, 4))
        self.at_sun = gp.Clutch(fn_max=10.0, f_normalized=self.f_sun)
        self.at_ring = gp.Clutch(fn_max=10.0, f_normalized=self.f_ring)
        self.brake = gp.Brake(fn_max=10.0, f_normalized=self.f_brake)
        self.shaft = gp.SpringDamper(c=100.0, d=0.1)
        return [
            gl.connect(self.torque.flange, self.sun.flange_a, self.set.sun, self.at_sun.flange_b),
            gl.connect(self.set.ring, self.ring.flange_a, self.brake.flange_a, self.at_ring.flange_a),
            gl.connect(
                self.set.carrier, self.carrier.flange_a, self.shaft.flange_a, self.at_sun.flange_a, self.at_ring.flange_b
            ),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


def _eigenvalues(J: float, joined: bool) -> list[complex]:
    """A body J on a shaft of 100 N.m/rad and 0.1 N.m.s/rad to one of 4 kg.m2."""
    A = np.array([[-0.1 / J, 0.1 / J, 100 / J], [0.025, -0.025, -25.0], [-1.0, 1.0, 0.0]])
    return list(np.linalg.eigvals(A if joined else A[1:, 1:]))


def test_speeds_that_are_no_states_are_held_too() -> None:
    """Three couplings on two degrees of freedom: not all their slips are states. Inertias are referred to the carrier."""
    system = gl.compile(Differential())
    assert sum(name.endswith(".v") for name in system.states) < 3
    for at_sun, at_ring, brake, J in (
        (1, 0, 0, 6.0),
        (0, 1, 0, 6.0),
        (0, 0, 1, 3.0 + 9.0),
    ):  # sun = 3 carrier with the ring held
        given = {"f_sun": at_sun, "f_ring": at_ring, "f_brake": brake}
        expected = _eigenvalues(J, True)
        report = gl.stability(system, parameters=given)
        assert np.sort_complex(report.eigenvalues) == pytest.approx(np.sort_complex(expected), abs=1e-6)
        assert report.poles.chains == (1,)
        assert gl.modes(system, parameters=given).free == 1
    still = gl.stability(system, parameters={"f_ring": 1.0, "f_brake": 1.0})
    assert np.sort_complex(still.eigenvalues) == pytest.approx(np.sort_complex(_eigenvalues(1.0, False)), abs=1e-9)
    free = gl.stability(system)
    assert free.poles.chains == (2,)  # both degrees of freedom


class Coasting(gl.Component):
    """A rotor whose drive is off: its speed does not change, but nothing holds it."""

    w = gl.Variable("rad/s", "speed")
    tau = gl.Variable("N.m", "torque of the drive")
    x = gl.Variable("N.m", "torque that the throttle asks for")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(2.0 * gl.der(self.w), gl.Piecewise((0, self.x < 1), (self.tau, True))),
            gl.Eq(self.tau, 3 * self.x - 0.1 * self.w),
            gl.Eq(gl.der(self.x), -1.0 * self.x),
        ]


def test_rotor_that_coasts_keeps_its_pole() -> None:
    report = gl.stability(gl.compile(Coasting()))
    assert sorted(report.eigenvalues.real) == [-1.0, 0.0]
    assert report.verdict == "marginal"


class Bent(gl.Component):
    """A brake of a speed ``s = w (1 + x^2)`` that is not a state: it holds s, and w changes where x does."""

    held = gl.Parameter("1", default=1.0)
    x, w = gl.Variable("1", "position", state="prefer"), gl.Variable("1", "its speed", state="prefer")
    s, r = gl.Variable("1", "braked speed"), gl.Variable("1", "reaction")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.w),
            gl.Eq(self.s, self.w * (1 + self.x**2)),
            gl.Eq(2 * gl.der(self.w), -self.r * (1 + self.x**2)),
            gl.Eq(gl.Piecewise((gl.der(self.s), self.held > 0.5), (self.r - self.s, True)), 0),
        ]


def test_a_speed_that_is_held_at_one_point_only_leaves_all_states() -> None:
    """``w' = -2 x w^2 / (1 + x^2)`` where s is held, ``-s (1 + x^2) / 2`` where it is not; at rest all is held."""
    system = gl.compile(Bent())

    def matrix(x: float, w: float, held: float) -> Any:
        return system.linearize([], ["s"], at={"x": x, "w": w}, parameters={"held": held}, sparse=True).A

    x, w = 0.6, 1.5
    size = 1 + x**2
    assert matrix(x, w, 1.0) == pytest.approx(np.array([[0, 1], [-2 * w**2 * (1 - x**2) / size**2, -4 * x * w / size]]))
    assert matrix(x, w, 0.0) == pytest.approx(np.array([[0, 1], [-2 * w * x * size, -(size**2) / 2]]))
    assert matrix(x, 0.0, 1.0).shape == (0, 0)
    assert matrix(x, 0.0, 0.0).shape == (2, 2)


class Followers(gl.Component):
    """Two bodies joined by a clutch, each on a spring whose torque depends on its absolute angle: both angles are states."""

    def assemble(self) -> list[Any]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.clutch = gp.Clutch(fn_max=10.0, f_normalized=1.0)
        self.pull_a, self.pull_b = Pendulum(k=3.0), Pendulum(k=4.0)
        return [
            gl.connect(self.a.flange_a, self.pull_a.flange),
            gl.connect(self.a.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.pull_b.flange),
        ]


class Pendulum(gl.Component):
    """Torque that grows with the sine of the angle."""

    flange = gp.Flange()
    k = gl.Parameter("N.m", "weight times length")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, self.k * gl.sin(self.flange.phi))]


def test_difference_of_two_angles_is_held() -> None:
    """3 kg.m2 on 7 N.m/rad: one vibration, and no pole at 0 for the angle between the bodies."""
    report = gl.stability(gl.compile(Followers()))
    assert np.sort_complex(report.eigenvalues) == pytest.approx(np.array([-1j, 1j]) * np.sqrt(7 / 3), rel=1e-12)


class Winch(gl.Component):
    """A rope on a drum, with a spring at its end."""

    flange = gp.Flange()
    r, k = gl.Parameter("m", "radius"), gl.Parameter("N/m", "stiffness")
    q, v = gl.Variable("m", "length that is pulled in", state="prefer"), gl.Variable("m/s", "speed of the rope")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(self.v, self.r * gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, self.r * self.k * self.q),
        ]


@pytest.mark.parametrize("r", [(0.5, 0.5), (0.02, 3.0), (4.0, 0.1)])
def test_a_combination_of_two_lengths_is_held(r: tuple[float, float]) -> None:
    """Two drums joined by a clutch: a spring of k r^2 each on both bodies, and no pole at 0."""

    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.clutch = gp.Clutch(fn_max=10.0, f_normalized=1.0)
            self.one, self.other = Winch(r=r[0], k=3.0), Winch(r=r[1], k=4.0)
            return [
                gl.connect(self.a.flange_a, self.one.flange),
                gl.connect(self.a.flange_b, self.clutch.flange_a),
                gl.connect(self.clutch.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.other.flange),
            ]

    w = np.sqrt((3.0 * r[0] ** 2 + 4.0 * r[1] ** 2) / 3.0)
    model = gl.compile(Pair()).linearize([], ["one.q", "other.q", "a.w"], sparse=True)
    _same(np.linalg.eigvals(np.asarray(model.A)), [-1j * w, 1j * w])
    lengths = np.asarray(model.C)[:2]
    assert lengths[0] * r[1] == pytest.approx(lengths[1] * r[0], rel=1e-12, abs=1e-12)
    assert lengths.any()


def test_moment_of_a_run_with_some_clutches_locked() -> None:
    """Four bodies and three clutches: a locked clutch takes a degree of freedom away, a sliding one does not."""
    system = gl.compile(CoupledClutches())
    run = system.simulate(1.5, rtol=1e-8)
    clutches = [n.removesuffix(".mode") for n in system.translation.model.discretes if n.endswith(".mode")]
    seen = set()
    for t in (0.2, 0.6, 1.0, 1.4):
        i = int(np.searchsorted(run.time, t))
        locked = sum(run[f"{c}.locked"][i] for c in clutches)
        model = system.linearize([], at=(run, float(run.time[i])), sparse=True)
        assert len(model.states) == len(system.states) - locked
        seen.add(locked)
    assert len(seen) > 1


@pytest.mark.parametrize("J", [1.0, 0.37e-3])
def test_elements_side_by_side_are_locked_together(J: float) -> None:
    """Two bearings on one shaft share the torque in any way; the motion is that of a shaft that stands still."""

    class TwoBearings(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.shaft = gp.Inertia(J=J), gp.Inertia(J=2.0), gp.SpringDamper(c=10.0, d=0.1)
            self.bearing = [gp.BearingFriction(tau_pos=[[0.0, t]]) for t in (1.0, 0.3)]
            return [
                gl.connect(self.a.flange_b, *(k.flange_a for k in self.bearing), self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a),
            ]

    system = gl.compile(TwoBearings())
    expected = np.roots([2.0, 0.1, 10.0])
    _same(gl.stability(system).eigenvalues, expected)
    assert gl.modes(system).frequencies == pytest.approx([np.sqrt(5.0) / (2 * np.pi)])
    torque = system.linearize([], ["shaft.tau", "bearing[0].tau", "bearing[1].tau"], sparse=True).C
    assert torque[1] + torque[2] == pytest.approx(torque[0], abs=1e-12)


class Clock(gl.Component):
    """A position whose speed depends on the time alone."""

    x, v = gl.Variable("m"), gl.Variable("m/s")
    speed = gl.Parameter("m/s", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(self.v, self.speed * (1 + gl.sin(3 * gl.time)))]


def test_positions_that_depend_on_no_state_are_not_held() -> None:
    """Beside a locked brake, behind which nothing else is: the brake's speed is held, the clock goes on."""

    class Beside(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.brake, self.clock = gp.Inertia(J=2.0), gp.Brake(fn_max=10.0, f_normalized=1.0), Clock()
            return [gl.connect(self.body.flange_b, self.brake.flange_a)]

    system = gl.compile(Beside())
    model = system.linearize([], ["clock.x", "body.w"], sparse=True)
    assert (model.states, np.asarray(model.A).tolist()) == (("clock.x",), [[0.0]])
    assert np.asarray(model.C).tolist() == [[1.0], [0.0]]


class Wear(gl.Component):
    """What is worn off in proportion to the way: no position, though its rate is a multiple of a speed."""

    flange = gp.Flange()
    rate = gl.Parameter("kg/rad", default=1e-3)
    worn = gl.Variable("kg")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.worn), self.rate * gl.der(self.flange.phi)), gl.Eq(self.flange.tau, 0)]


def test_what_is_no_position_stays() -> None:
    class Worn(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.brake, self.wear = gp.Inertia(J=2.0), gp.Brake(fn_max=10.0, f_normalized=1.0), Wear()
            return [gl.connect(self.body.flange_b, self.brake.flange_a, self.wear.flange)]

    model = gl.compile(Worn()).linearize([], ["wear.worn", "body.w"], sparse=True)
    assert (model.states, np.asarray(model.A).tolist()) == (("wear.worn",), [[0.0]])
    assert np.asarray(model.C).tolist() == [[1.0], [0.0]]


class HeldTwice(gl.Component):
    """A spring on a shaft that two bearings hold, one behind gears, and a loaded body that a clutch holds on it."""

    names = gl.Structural(())

    def assemble(self) -> list[Any]:
        line: list[Any] = [
            gp.Inertia(J=0.15), gp.Spring(c=800.0), gp.Inertia(J=0.19), gp.BearingFriction(tau_pos=[[0, 5.0]]), gp.IdealGear(ratio=0.3),
            gp.Inertia(J=0.93), gp.IdealGear(ratio=-1.7), gp.BearingFriction(tau_pos=[[0, 2.7]]),
            gp.Clutch(mu_pos=[[0, 0.5]], fn_max=10.8, f_normalized=1.0), gp.Inertia(J=0.62),
        ]  # fmt: skip
        for name, part in zip(self.names, line, strict=True):
            setattr(self, name, part)
        self.load, self.torque = gp.LinearSpeedDependentTorque(tau_nominal=-10.0, w_nominal=20.0), gp.Torque()
        return [
            *(gl.connect(a.flange_b, b.flange_a) for a, b in itertools.pairwise(line)),
            gl.connect(line[-1].flange_b, self.load.flange, self.torque.flange),
        ]


@pytest.mark.parametrize("seed", range(8))
def test_what_is_held_twice_is_held_whatever_its_name(seed: int) -> None:
    """800 N.m/rad on 0.15 kg.m2. The held body had a pole at 0 where elements in parallel left the equations singular."""
    names = tuple(f"part_{k}" for k in np.random.default_rng(seed).permutation(10))
    system, expected = gl.compile(HeldTwice(names=names)), np.array([-1j, 1j]) * np.sqrt(800.0 / 0.15)
    _same(gl.stability(system).eigenvalues, expected)
    _same(system.linearize().poles(), expected)


class HeldByTwoBearings(gl.Component):
    """A planetary gear whose ring and loaded carrier are held by bearings."""

    names = gl.Structural(())

    def assemble(self) -> list[Any]:
        parts: list[Any] = [
            gp.Inertia(J=0.8), gp.IdealGear(ratio=2.0), gp.Inertia(J=1.2), gp.IdealPlanetary(ratio=3.27), gp.Inertia(J=0.3),
            gp.BearingFriction(tau_pos=[[0, 3.7]]), gp.Inertia(J=1.7), gp.BearingFriction(tau_pos=[[0, 1.0]]),
            gp.LinearSpeedDependentTorque(tau_nominal=-10.0, w_nominal=20.0),
        ]  # fmt: skip
        for name, part in zip(self.names, parts, strict=True):
            setattr(self, name, part)
        motor, gear, sun, planetary, ring, ring_bearing, carrier, bearing, load = parts
        return [
            gl.connect(motor.flange_b, gear.flange_a),
            gl.connect(gear.flange_b, sun.flange_a),
            gl.connect(sun.flange_b, planetary.sun),
            gl.connect(planetary.ring, ring.flange_a, ring_bearing.flange_a),
            gl.connect(planetary.carrier, carrier.flange_a, bearing.flange_a, load.flange),
        ]


@pytest.mark.parametrize("seed", range(8))
def test_held_speeds_of_other_states_are_held_whatever_the_names(seed: int) -> None:
    """From some names, compliances of the bearings moved speeds of the train, which gave a pole near 0."""
    names = tuple(f"part_{k}" for k in np.random.default_rng(seed).permutation(9))
    system = gl.compile(HeldByTwoBearings(names=names))
    assert len(gl.stability(system).eigenvalues) == 0
    assert len(system.linearize().poles()) == 0
