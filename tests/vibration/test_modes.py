"""Mode shapes and energies against M, C and K by hand; large trains; drawings."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.linalg import eig, eigh, eigh_tridiagonal

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibWarning, NameLookupError, SolverError
from gearparts.interfaces import TwoFlanges
from tests.linear.random_trains import Train, draw, matrices
from tests.stress.test_right_calls import given


def chain_matrices(n: int, J: float, c: float, d: float, d_load: float = 0.0) -> tuple[Any, Any, Any]:
    """M, C, K of the chain of conftest, by hand."""
    M, C, K = np.diag([J * (1 + 0.3 * i) for i in range(n)]), np.zeros((n, n)), np.zeros((n, n))
    for i in range(n - 1):
        row = np.zeros(n)
        row[i], row[i + 1] = -1, 1
        K += c * (1 + 0.2 * i) * np.outer(row, row)
        C += d * np.outer(row, row)
    C[-1, -1] += d_load
    return M, C, K


def test_undamped_chain_has_the_modes_and_energies_of_its_matrices(chain: Callable[..., gl.System]) -> None:
    M, _, K = chain_matrices(4, 1.0, 100.0, 0.0)
    squares, shapes = eigh(K, M)
    found = given(lambda: gl.modes(chain(n=4)))
    assert found.omega[1:] == pytest.approx(np.sqrt(squares[1:]), rel=1e-12)
    assert found.free == 1
    for k in range(4):
        x = shapes[:, k]
        mine = found.shape(k, *(f"body[{i}].flange_a.phi" for i in range(4)))
        assert mine / mine[0] == pytest.approx(x / x[0], rel=1e-9)
        kinetic = 100 * np.diag(M) * x**2 / (x @ M @ x)
        assert [found.kinetic[k, found.components.index(f"body[{i}]")] for i in range(4)] == pytest.approx(kinetic, abs=1e-8)
        if k:
            stretched = np.array([100 * (1 + 0.2 * i) * (x[i + 1] - x[i]) ** 2 for i in range(3)])
            potential = [found.potential[k, found.components.index(f"shaft[{i}]")] for i in range(3)]
            assert potential == pytest.approx(100 * stretched / stretched.sum(), abs=1e-8)
    assert not found.potential[0].any()


def test_heavily_damped_chain(chain: Callable[..., gl.System]) -> None:
    """Energies of a complex mode, with damping that is not proportional: 1/2 x* M x |s|^2 and 1/2 x* K x."""
    M, C, K = chain_matrices(3, 1.0, 100.0, 3.0, 2.0)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    values, vectors = eig(A)
    ringing = [k for k in np.argsort(np.abs(values)) if values[k].imag > 0]
    found = gl.modes(chain(n=3, grounded=True), parameters={"d": 3.0, "d_load": 2.0})
    assert found.eigenvalues == pytest.approx(values[ringing], rel=1e-11)
    assert found.decays == pytest.approx(
        np.sort(values[(np.abs(values.imag) < 1e-9) & (values.real < -1e-9)].real)[::-1], rel=1e-9
    )
    assert found.free == 0  # the load brakes it
    for row, k in enumerate(ringing):
        x = vectors[:3, k]
        kinetic = np.diag(M) * np.abs(x) ** 2
        assert [found.kinetic[row, found.components.index(f"body[{i}]")] for i in range(3)] == pytest.approx(
            100 * kinetic / kinetic.sum(), rel=1e-9
        )


@pytest.mark.parametrize("seed", range(12))
def test_random_trains_have_the_damping_and_energies_of_matrices_by_hand(seed: int) -> None:
    """Eigenvalues, and 1/2 J |w|^2 and 1/2 c |twist|^2 of every body and shaft along the eigenvectors, in percent."""
    drawn = draw(np.random.default_rng(500 + seed))
    A, _, _ = matrices(drawn)
    values, vectors = eig(A)
    n = len(drawn.J)
    found = gl.modes(gl.compile(Train(drawn=drawn)))
    ringing = [k for k in np.argsort(np.abs(values)) if values[k].imag > 1e-6 * np.abs(values).max()]
    assert found.eigenvalues[found.free :] == pytest.approx(values[ringing], rel=1e-9, abs=1e-9 * np.abs(values).max())
    ratios = -values[ringing].real / np.abs(values[ringing])
    assert found.damping[found.free :] == pytest.approx(ratios, rel=1e-7, abs=1e-11)
    bodies = [found.components.index(f"body[{i}]") for i in range(n)]
    for row, k in enumerate(ringing, found.free):
        w = vectors[-n:, k]
        kinetic = np.array(drawn.J) * np.abs(w) ** 2
        assert found.kinetic[row, bodies] == pytest.approx(100 * kinetic / kinetic.sum(), abs=1e-6)
        twists = [w[right] - w[left] / ratio for left, ratio, right, _, _ in drawn.edges] + [
            -w[body] for body, *_ in drawn.ground
        ]
        stiffness = [e[3] for e in drawn.edges] + [g[1] for g in drawn.ground]
        names = [f"shaft[{i}]" for i in range(len(drawn.edges))] + [f"support[{i}]" for i in range(len(drawn.ground))]
        potential = np.array(stiffness) * np.abs(np.array(twists)) ** 2
        for name, share in zip(names, 100 * potential / potential.sum(), strict=True):
            mine = found.potential[row, found.components.index(name)] if name in found.components else 0.0
            assert mine == pytest.approx(share, abs=2e-5)
        assert found.kinetic[row].sum() == pytest.approx(100, abs=1e-4)
        assert found.potential[row].sum() == pytest.approx(100, abs=1e-4)


@pytest.mark.parametrize("n", [3, 300])
def test_free_motion_is_a_speed_without_twist(chain: Callable[..., gl.System], n: int) -> None:
    """All bodies turn alike, whether angles, speeds or their derivatives are asked for; nothing is stretched."""
    found = gl.modes(chain(n=n), 2, parameters={"d": 1.0})
    assert found.free == 1
    speeds = found.shape(0, *(f"body[{i}].w" for i in range(n)))
    assert speeds == pytest.approx(np.full(n, speeds[0]), rel=1e-9)
    assert abs(speeds[0]) > 0
    assert found.shape(0, "body[0].a", "der(body[0].flange_a.phi)") == pytest.approx(
        [speeds[0] * 1j * found.omega[1], speeds[0]]
    )
    assert np.abs(found.shape(0, "shaft[0].tau", "shaft[1].phi_rel")).max() < 1e-9 * abs(speeds[0])


class OpenGap(gl.Component):
    """Two bodies, a gap between them."""

    def assemble(self) -> list[Any]:
        self.a, self.gap, self.b = gp.Inertia(J=1.0), gp.ElastoBacklash(c=1e3, d=1.0, b=0.1), gp.Inertia(J=3.0)
        return [gl.connect(self.a.flange_b, self.gap.flange_a), gl.connect(self.gap.flange_b, self.b.flange_a)]


def test_a_position_that_a_free_motion_changes_moves_with_it() -> None:
    """Its rate is the difference of the speeds, and it is the integral of that."""
    found = gl.modes(gl.compile(OpenGap()))
    assert (found.free, found.positions[0].split(" ")[0]) == (2, "gap.phi_rel")
    for mode in range(2):
        a, b, rate, position = found.shape(mode, "a.w", "b.w", "der(gap.phi_rel)", "gap.phi_rel")
        assert abs(rate) == pytest.approx(1.0)
        assert rate == pytest.approx(b - a)
        assert position == pytest.approx(rate / 1j)


def test_a_position_inside_a_gap_is_that_of_a_swing_as_slow_as_the_slowest_mode() -> None:
    class Beside(gl.Component):
        def assemble(self) -> list[Any]:
            self.open, self.ground, self.shaft, self.disc = OpenGap(), gp.Fixed(), gp.Spring(c=50.0), gp.Inertia(J=2.0)
            return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]

    found = gl.modes(gl.compile(Beside()))
    assert found.omega == pytest.approx([0.0, 0.0, 5.0])
    moved = [found.shape(mode, "der(open.gap.phi_rel)", "open.gap.phi_rel") for mode in range(2)]
    assert max(abs(rate) for rate, _ in moved) > 0.5
    assert [position for _, position in moved] == pytest.approx([rate / 5j for rate, _ in moved])
    a, b, position = (found.shapes[found.states.index(f"open.{name}"), :2] for name in ("a.w", "b.w", "gap.phi_rel"))
    assert position == pytest.approx((b - a) / 5j)


@pytest.mark.parametrize("factor", [1.0, 1e-14, 1e14])
def test_a_position_inside_a_gap_moves_in_any_unit_of_time(factor: float) -> None:
    """Free motions are shown larger in a train of larger frequencies: their sizes are as arbitrary as those of any mode."""

    class Ahead(gl.Component):
        def assemble(self) -> list[Any]:
            self.open, self.shaft, self.disc = OpenGap(), gp.Spring(c=6.0 * factor), gp.Inertia(J=6.0)
            return [gl.connect(self.open.b.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]

    found, slowest = gl.modes(gl.compile(Ahead())), np.sqrt(3.0 * factor)
    assert found.omega == pytest.approx([0.0, 0.0, slowest])
    a, b, position = (found.shapes[found.states.index(f"open.{name}"), :2] for name in ("a.w", "b.w", "gap.phi_rel"))
    assert (np.abs(b - a) > 0).any()
    np.testing.assert_allclose(position, (b - a) / (1j * slowest), rtol=1e-6, atol=1e-9 * np.abs(position).max())


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.3, 0.0, 0.0), (-0.3, 0.3, 0.3)])
def test_free_motions_across_open_gaps_are_those_whose_bodies_have_different_speeds(at: tuple[float, ...]) -> None:
    """Of gaps of 0.2 rad, some closed; a spring of no stiffness, which nothing feels either, is no gap."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0 + k) for k in range(5)]
            self.gap, self.loose = [gp.ElastoBacklash(c=50.0, d=0.0, b=0.2) for _ in range(3)], gp.Spring(c=0.0)
            ends = zip(self.body, [*self.gap, self.loose], self.body[1:], strict=False)
            return [
                link
                for a, part, b in ends
                for link in (gl.connect(a.flange_b, part.flange_a), gl.connect(part.flange_b, b.flange_a))
            ]

    class Nested(gl.Component):
        def assemble(self) -> list[Any]:
            self.row = Row()
            return []

    found = gl.modes(gl.compile(Nested()), at={f"row.gap[{k}].phi_rel": value for k, value in enumerate(at)})
    assert found.free == 2 + at.count(0.0)
    expected: dict[int, str] = {}
    for mode in range(found.free):
        speeds = found.shape(mode, *(f"row.body[{k}].w" for k in range(5)))
        across = [f"row.gap[{k}]" for k in range(3) if at[k] == 0.0 and abs(speeds[k + 1] - speeds[k]) > 1e-9]
        expected |= {mode: ", ".join(across)} if across else {}
    assert found.gaps == expected


def test_modes_slower_than_the_rounding_of_the_fastest_are_told() -> None:
    """A body of 1e-14 kg.m2 behind a damper: its pole of 1e14 rad/s leaves hardly a digit of a swing of 1 rad/s."""

    class Light(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.body = gp.Fixed(), gp.Spring(c=1.0), gp.Inertia(J=1.0)
            self.damper, self.light = gp.Damper(d=1.0), gp.Inertia(J=1e-14)
            return [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.body.flange_a),
                gl.connect(self.body.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.light.flange_a),
            ]

    system = gl.compile(Light())
    with pytest.warns(GearlibWarning, match=r"since the fastest one, mostly of light\.w, is 1e\+14 rad/s"):
        gl.modes(system)
    assert gl.modes(system, parameters={"light.J": 1e-3}).omega.max() == pytest.approx(1.0, rel=1e-2)


def test_a_rate_without_a_slope_is_refused_by_its_name() -> None:
    class Draining(gl.Component):
        x, y = gl.Variable("1", start=1.0), gl.Variable("1", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), -gl.sqrt(self.y))]

    with pytest.raises(SolverError, match=r"the slope of der\(y\) is not finite there"):
        gl.modes(gl.compile(Draining()))


class DrivenEnd(gl.Component):
    """A torque on the end of a spring without inertia: this end's speed follows the derivative of the torque."""

    def assemble(self) -> list[Any]:
        self.torque, self.shaft, self.body = gp.Torque(), gp.Spring(c=50.0), gp.Inertia(J=2.0)
        self.coupling, self.load = gp.SpringDamper(c=600.0, d=1.0), gp.Inertia(J=6.0)
        return [
            gl.connect(self.torque.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.body.flange_a),
            gl.connect(self.body.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.load.flange_a),
        ]


def test_a_speed_that_needs_the_derivative_of_an_input_has_no_amplitude() -> None:
    found = gl.modes(gl.compile(DrivenEnd()))
    assert found.frequencies == pytest.approx([0.0, 20.0 / (2 * np.pi)], rel=1e-12)
    assert found.shape(1, "shaft.phi_rel") == pytest.approx(0.0, abs=1e-15)  # its torque is given
    assert found.shape(1, "load.w", "coupling.w_rel") == pytest.approx(found.shape(1, "body.w") * [-1 / 3, -4 / 3], rel=1e-9)
    with pytest.raises(NameLookupError, match=r"^torque\.flange\.phi has no amplitude in the mode; "):
        found.shape(1, "torque.flange.phi")


def test_shafts_without_an_amplitude_are_left_out_of_a_diagram() -> None:
    scheme: Any = gl.modes(gl.compile(DrivenEnd())).scheme(1)
    assert (len(scheme.results.turns), scheme.train.shafts) == (2, 3)
    assert sorted(value.real for value in scheme.results.turns.values()) == pytest.approx([-1 / 3, 1.0])


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_diagram_shows_how_shafts_between_springs_without_bodies_turn(n: int, driven: bool) -> None:
    """``n`` equal springs in a row between the ground and a body: their ends turn in proportion, also where torques are given."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.body, row = gp.Fixed(), gp.Inertia(J=2.0), []
            end = self.ground.flange
            for i in range(n):
                spring = gp.Spring(c=18.0 * n)
                setattr(self, f"spring{i}", spring)
                row.append((end, spring.flange_a))
                end = spring.flange_b
                if driven and i < n - 1:
                    torque = gp.Torque()
                    setattr(self, f"torque{i}", torque)
                    row.append((end, torque.flange))
            return [gl.connect(*pair) for pair in [*row, (end, self.body.flange_a)]]

    found = gl.modes(gl.compile(Row()))
    scheme: Any = found.scheme(0)
    assert found.omega == pytest.approx([3.0])
    assert sorted(np.abs(list(scheme.results.turns.values()))) == pytest.approx(np.arange(n + 1) / n)


@pytest.mark.parametrize("exact", [False, True])
def test_a_carrier_turns_with_the_ring_where_the_speed_of_the_sun_is_given(exact: bool) -> None:
    """phi_sun + 3 phi_ring = 4 phi_carrier, of which a change of the given speed knows nothing; the ring hangs on a spring."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.gear, self.ring = gp.Speed(exact=exact), gp.IdealPlanetary(ratio=3.0), gp.Inertia(J=2.0)
            self.shaft, self.ground = gp.Spring(c=50.0), gp.Fixed()
            return [
                gl.connect(self.drive.flange, self.gear.sun),
                gl.connect(self.gear.ring, self.ring.flange_a, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.ground.flange),
            ]

    found = gl.modes(gl.compile(Driven()))
    assert found.omega == pytest.approx([5.0])
    sun, carrier, ring, w = found.shape(0, "gear.sun.phi", "gear.carrier.phi", "ring.phi", "ring.w")
    assert (sun, carrier / ring, w / ring) == pytest.approx((0.0, 0.75, 5j), rel=1e-9, abs=1e-12)


class Marked(TwoFlanges):
    """A spring whose twist is a number."""

    c, twist = gl.Parameter("N.m/rad"), gl.Variable("1", state="prefer")

    def equations(self) -> list[gl.Eq]:
        torque = self.c * self.twist
        return [
            gl.Eq(self.twist, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.flange_b.tau, torque),
            gl.Eq(self.flange_a.tau, -torque),
        ]


@pytest.mark.parametrize("spring", [gp.Spring, Marked])
def test_energies_are_not_given_where_the_amplitude_of_a_flange_is_not_known(spring: Any) -> None:
    """On the free end of a spring a torque is given: it stores nothing, and is not taken for one whose end stands still."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.shaft, self.body = gp.Torque(), spring(c=50.0), gp.Inertia(J=2.0)
            self.coupling, self.load = gp.Spring(c=600.0), gp.Inertia(J=6.0)
            row = [self.torque.flange, self.shaft.flange_a, self.shaft.flange_b, self.body.flange_a]
            row += [self.body.flange_b, self.coupling.flange_a, self.coupling.flange_b, self.load.flange_a]
            return [gl.connect(*row[i : i + 2]) for i in range(0, len(row), 2)]

    found = gl.modes(gl.compile(Driven()))
    assert found.omega == pytest.approx([0.0, 20.0])
    assert found.not_given == {1: "shaft stores energy as a flange moves whose amplitude needs the derivative of an input"}
    assert np.isnan(found.potential[1]).all()
    assert np.isnan(found.kinetic[1]).all()
    assert dict(zip(found.components, found.kinetic[0], strict=True))["load"] == pytest.approx(75.0)


class Warm(gl.Connector):
    """Thermal."""

    T, P = gl.Potential("K"), gl.Flow("W")


class Brush(gl.Component):
    """A body that is as warm as it is fast, in surroundings whose warmth is given."""

    flange, port = gp.Flange("shaft"), Warm("housing")
    J, rise = gl.Parameter("kg.m2", default=2.0), gl.Parameter("K.s/rad", default=7.0)
    w, around = gl.Variable("rad/s"), gl.Input("K")

    def equations(self) -> list[gl.Eq]:
        warmth = gl.Eq(self.port.T, self.around + self.rise * self.w)
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.J * gl.der(self.w), self.flange.tau), warmth]


class Room(gl.Component):
    """Takes heat from what is warmer."""

    port, G, T = Warm("wall"), gl.Parameter("W/K", default=3.0), gl.Parameter("K", default=300.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.port.P, self.G * (self.port.T - self.T))]


@pytest.mark.parametrize("cooled", [False, True])
def test_potentials_other_than_angles_have_the_amplitudes_of_what_they_follow(cooled: bool) -> None:
    class Warmed(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.brush = gp.Fixed(), gp.Spring(c=50.0), Brush()
            links = [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.brush.flange)]
            if cooled:
                self.room = Room()
                links.append(gl.connect(self.brush.port, self.room.port))
            return links

    found = gl.modes(gl.compile(Warmed()))
    assert found.omega == pytest.approx([5.0])
    warmth, w, phi = found.shape(0, "brush.port.T", "brush.w", "brush.flange.phi")
    assert warmth == pytest.approx(7 * w)
    assert w == pytest.approx(5j * phi)
    assert found.not_given == {}  # warmth and heat are no energy of a motion
    assert found.components == ("shaft", "brush")
    assert (found.kinetic[0].tolist(), found.potential[0].tolist()) == ([0.0, 100.0], [100.0, 0.0])


class Thermal(gl.Component):
    """A spring to the ground whose torque grows with its warmth, and which loses heat as it is warm."""

    flange, port = gp.Flange("shaft"), Warm("housing")
    c, k, G = gl.Parameter("N.m/rad"), gl.Parameter("N.m/K"), gl.Parameter("W/K", default=5.0)

    def equations(self) -> list[gl.Eq]:
        torque = self.c * self.flange.phi + self.k * self.port.T
        return [gl.Eq(self.flange.tau, torque), gl.Eq(self.port.P, self.G * self.port.T)]


class Twisted(gl.Component):
    """What is as warm as a shaft is turned; it takes no torque."""

    flange, port, rise = gp.Flange("shaft"), Warm("housing"), gl.Parameter("K/rad")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0), gl.Eq(self.port.T, self.rise * self.flange.phi)]


@pytest.mark.parametrize("warmed", [False, True])
def test_a_warmth_beside_a_heat_is_given_to_a_spring(warmed: bool) -> None:
    """Its stiffness is ``c + k rise``; without anything that warms it, ``c``."""

    class Hung(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.disc = gp.Fixed(), gp.Spring(c=9.0), gp.Inertia(J=2.0)
            self.warm = Thermal(c=3.0, k=2.0)
            links = [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.disc.flange_a, self.warm.flange),
            ]
            if warmed:
                self.twisted = Twisted(rise=4.0)
                links.append(gl.connect(self.twisted.port, self.warm.port))
                links.append(gl.connect(self.twisted.flange, self.disc.flange_b))
            return links

    stiffness = 11.0 if warmed else 3.0
    found = gl.modes(gl.compile(Hung()))
    assert found.omega == pytest.approx([np.sqrt((9.0 + stiffness) / 2.0)])
    assert (found.components, found.not_given) == (("shaft", "disc", "warm"), {})
    assert found.potential[0] == pytest.approx(np.array([900.0, 0.0, 100 * stiffness]) / (9.0 + stiffness))


class Pin(gl.Connector):
    """Electric, to the ground."""

    v, i = gl.Potential("V"), gl.Flow("A")


class Generator(gl.Component):
    """A rotor with a winding."""

    flange, pin = gp.Flange("shaft"), Pin("winding")
    J, k, R = gl.Parameter("kg.m2", default=2.0), gl.Parameter("V.s/rad", default=3.0), gl.Parameter("Ohm", default=1.0)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        voltage = gl.Eq(self.pin.v, self.R * self.pin.i + self.k * self.w)
        torque = gl.Eq(self.flange.tau, self.J * gl.der(self.w) - self.k * self.pin.i)
        return [gl.Eq(self.w, gl.der(self.flange.phi)), torque, voltage]


class Resistor(gl.Component):
    pin, R = Pin("end"), gl.Parameter("Ohm", default=8.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.pin.v, self.R * self.pin.i)]


def test_a_voltage_beside_a_current_is_given_to_a_generator() -> None:
    """2 s**2 + 3**2 / (1 + 8) s + 50 = 0."""

    class Loaded(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.generator, self.load = gp.Fixed(), gp.Spring(c=50.0), Generator(), Resistor()
            return [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.generator.flange),
                gl.connect(self.generator.pin, self.load.pin),
            ]

    found = gl.modes(gl.compile(Loaded()))
    assert found.eigenvalues == pytest.approx([-0.25 + 1j * np.sqrt(25 - 0.0625)])
    assert found.not_given == {}
    assert found.components == ("shaft", "generator")
    assert found.kinetic[0].tolist() == [0.0, 100.0]


class Motor(gl.Component):
    """A winding that moves a shaft."""

    flange, pin = gp.Flange("shaft"), Pin("winding")
    k, L, R = gl.Parameter("V.s/rad", default=3.0), gl.Parameter("H", default=0.2), gl.Parameter("Ohm", default=0.0)
    w, i = gl.Variable("rad/s"), gl.Variable("A")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.i, self.pin.i), gl.Eq(self.flange.tau, -self.k * self.i),
            gl.Eq(self.pin.v, self.R * self.i + self.L * gl.der(self.i) + self.k * self.w),
        ]  # fmt: skip


class Capacitor(gl.Component):
    pin, C, G = Pin("end"), gl.Parameter("F", default=0.05), gl.Parameter("A/V", default=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.C * gl.der(self.pin.v) + self.G * self.pin.v, self.pin.i)]


@pytest.mark.parametrize(("R", "G", "accurate"), [(0.0, 0.0, 1e-9), (1e-3, 0.0, 1e-3), (0.0, 0.02, 1e-3)])
def test_electrical_energies_beside_mechanical_ones(R: float, G: float, accurate: float) -> None:
    """J w**2 / 2 and C v**2 / 2 are one kind, c phi**2 / 2 and L i**2 / 2 the other."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.body = gp.Fixed(), gp.Spring(c=100.0), gp.Inertia(J=2.0)
            self.motor, self.store = Motor(R=R), Capacitor(G=G)
            links = [(self.ground.flange, self.shaft.flange_a), (self.shaft.flange_b, self.body.flange_a)]
            links += [(self.body.flange_b, self.motor.flange)]
            return [*(gl.connect(*link) for link in links), gl.connect(self.motor.pin, self.store.pin)]

    found = gl.modes(gl.compile(Driven()))
    assert (len(found), found.not_given) == (2, {})
    assert found.components == ("shaft", "body", "motor", "store")
    for mode in range(2):
        phi, w, i, v = np.abs(found.shape(mode, "body.phi", "body.w", "motor.i", "store.pin.v")) ** 2
        kinetic, potential = np.array([0, 2.0 * w, 0, 0.05 * v]), np.array([100.0 * phi, 0, 0.2 * i, 0])
        assert found.kinetic[mode] == pytest.approx(100 * kinetic / kinetic.sum(), abs=100 * accurate)
        assert found.potential[mode] == pytest.approx(100 * potential / potential.sum(), abs=100 * accurate)
    assert [name for name, *_ in found.motions(0)] == ["body"]


class Twins(gl.Component):
    """A disc on whose springs two equal rings hang."""

    flange = gp.Flange("shaft")
    J, m, c, d = (gl.Parameter(unit) for unit in ("kg.m2", "kg.m2", "N.m/rad", "N.m.s/rad"))
    phi, a, b = (gl.Variable("rad") for _ in range(3))
    w, w_a, w_b = (gl.Variable("rad/s") for _ in range(3))

    def equations(self) -> list[gl.Eq]:
        a = self.c * (self.phi - self.a) + self.d * (self.w - self.w_a)
        b = self.c * (self.phi - self.b) + self.d * (self.w - self.w_b)
        speeds = ((self.phi, self.w), (self.a, self.w_a), (self.b, self.w_b))
        return [
            gl.Eq(self.phi, self.flange.phi), *(gl.Eq(gl.der(x), v) for x, v in speeds),
            gl.Eq(self.J * gl.der(self.w), self.flange.tau - a - b),
            gl.Eq(self.m * gl.der(self.w_a), a), gl.Eq(self.m * gl.der(self.w_b), b),
        ]  # fmt: skip


@pytest.mark.parametrize("d", [0.0, 1e-4, 0.3])
def test_what_swings_inside_of_a_component_that_stands_still_is_told(d: float) -> None:
    """The rings against each other, and the disc at rest."""

    class Hung(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.shaft, self.disc = gp.Fixed(), gp.Spring(c=100.0), Twins(J=1.0, m=0.5, c=30.0, d=d)
            return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange)]

    found = gl.modes(gl.compile(Hung()))
    assert found.omega[1] == pytest.approx(np.sqrt(60.0))
    assert found.not_given[1] == "inside of disc something moves that its flanges do not"
    assert np.isnan(found.kinetic[1]).all()
    if d < 0.1:
        assert (list(found.not_given), found.kinetic[[0, 2]].tolist()) == ([1], [[0.0, 100.0]] * 2)


def test_deflections_are_differences_of_angles_and_integrals_of_relative_speeds(paper: gl.System) -> None:
    """Also of dampers to the ground, whose absolute angles no mode depends on; some parts alike have a state, others none."""
    found = gl.modes(paper)
    parts = [i.path for i in paper.translation.model.instances if "w_rel" in i.declared.variables]
    assert len(parts) > 3
    for mode in range(len(found)):
        for part in parts:
            names = (f"{part}.{local}" for local in ("phi_rel", "w_rel", "flange_a.phi", "flange_b.phi"))
            deflection, speed, a, b = found.shape(mode, *names)
            assert deflection == pytest.approx(speed / found.eigenvalues[mode], rel=1e-9, abs=1e-15), part
            assert deflection == pytest.approx(b - a, rel=1e-9, abs=1e-15), part


def test_component_with_inside_bodies_and_springs_is_split() -> None:
    """One component that hides two bodies and a spring keeps both kinds of energy: the sums are those of separate parts."""

    class Black(gp.interfaces.TwoFlanges):  # type: ignore[name-defined,misc]
        J = gl.Parameter("kg.m2")
        c = gl.Parameter("N.m/rad")
        w_a = gl.Variable("rad/s")
        w_b = gl.Variable("rad/s")
        twist = gl.Variable("rad", state="prefer")

        def equations(self) -> list[gl.Eq]:
            torque = self.c * self.twist
            return [
                gl.Eq(self.w_a, gl.der(self.flange_a.phi)),
                gl.Eq(self.w_b, gl.der(self.flange_b.phi)),
                gl.Eq(self.twist, self.flange_b.phi - self.flange_a.phi),
                gl.Eq(self.J * gl.der(self.w_a), self.flange_a.tau + torque),
                gl.Eq(2 * self.J * gl.der(self.w_b), self.flange_b.tau - torque),
            ]

    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.black, self.shaft, self.end = Black(J=1.0, c=50.0), gp.Spring(c=30.0), gp.Inertia(J=0.7)
            return [gl.connect(self.black.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.end.flange_a)]

    M = np.diag([1.0, 2.0, 0.7])
    K = np.array([[50.0, -50, 0], [-50, 80, -30], [0, -30, 30]])
    squares, shapes = eigh(K, M)
    found = gl.modes(gl.compile(Whole()))
    assert found.omega[1:] == pytest.approx(np.sqrt(squares[1:]), rel=1e-11)
    for k in (1, 2):
        x = shapes[:, k]
        share = found.components.index("black")
        assert found.kinetic[k, share] == pytest.approx(100 * (x[0] ** 2 + 2 * x[1] ** 2), abs=1e-7)
        stretched = 50 * (x[0] - x[1]) ** 2
        assert found.potential[k, share] == pytest.approx(100 * stretched / squares[k], abs=1e-7)


class Series(TwoFlanges):
    """A spring and a damper in series, in one component."""

    c = gl.Parameter("N.m/rad")
    d = gl.Parameter("N.m.s/rad")
    slip = gl.Variable("rad", state="prefer")

    def equations(self) -> list[gl.Eq]:
        tau = self.c * (self.flange_b.phi - self.flange_a.phi - self.slip)
        return [
            gl.Eq(self.flange_b.tau, tau),
            gl.Eq(self.flange_a.tau, -self.flange_b.tau),
            gl.Eq(self.d * gl.der(self.slip), tau),
        ]


class Link(gl.Component):
    """Two bodies, a spring, and a spring and a damper in series beside it: as one component, or as two."""

    whole = gl.Structural(True)
    c = gl.Parameter("N.m/rad", default=300.0)
    d = gl.Parameter("N.m.s/rad", default=20.0)

    def assemble(self) -> list[Any]:
        self.a, self.b, self.s = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Spring(c=100.0)
        links = [gl.connect(self.a.flange_b, self.s.flange_a), gl.connect(self.s.flange_b, self.b.flange_a)]
        if self.whole:
            self.series = Series(c=self.c, d=self.d)
            return [
                *links,
                gl.connect(self.a.flange_a, self.series.flange_a),
                gl.connect(self.series.flange_b, self.b.flange_b),
            ]
        self.spring, self.damper = gp.Spring(c=self.c), gp.Damper(d=self.d)
        return [
            *links,
            gl.connect(self.a.flange_a, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.b.flange_b),
        ]


def test_shares_of_energy_are_from_0_to_100_percent_or_not_given() -> None:
    """What a component stores that also damps inside does not follow from its flanges; as two parts it does."""
    found, parts = gl.modes(gl.compile(Link())), gl.modes(gl.compile(Link(whole=False)))
    assert found.eigenvalues == pytest.approx(parts.eigenvalues, rel=1e-10)
    assert list(found.not_given) == [1]
    assert "series stores energy and damps inside" in str(found)
    assert np.isnan(found.kinetic[1]).all()
    assert np.isnan(found.potential[1]).all()
    assert found.kinetic[0].sum() == pytest.approx(100)
    assert [name for name, _, _ in found.motions(1)] == ["a", "b"]
    assert [label.get_text() for label in found.draw(0)[1].get_yticklabels()] == ["a", "b"]
    axes = found.draw(-1)
    assert axes[0].figure.get_suptitle().startswith("Mode 1:")
    assert any("not given" in text.get_text() for text in axes[1].texts)
    plt.close("all")
    # by hand: the twist of the part's spring is d s / (c + d s) of the whole one
    s = parts.eigenvalues[1]
    twist = abs(20 * s / (300 + 20 * s)) ** 2
    assert parts.not_given == {}
    shares = [parts.potential[1, parts.components.index(name)] for name in ("s", "spring")]
    assert shares == pytest.approx(100 * np.array([100.0, 300 * twist]) / (100 + 300 * twist), rel=1e-9)
    assert parts.kinetic[1, parts.components.index("a")] == pytest.approx(100 * 2 / 3, rel=1e-9)
    for d in (1e-4, 1e6):  # a damper that hardly carries, or hardly gives: what it stores is known
        found, parts = (gl.modes(gl.compile(Link(whole=w)), parameters={"d": d}) for w in (True, False))
        assert found.not_given == {}
        bodies = [found.components.index(name) for name in ("a", "b", "s")]
        for mine, theirs in ((found.kinetic, parts.kinetic), (found.potential, parts.potential)):
            assert mine[1, bodies] == pytest.approx(theirs[1, [parts.components.index(n) for n in ("a", "b", "s")]], abs=0.1)


class Drum(gl.Component):
    """A body that a damper drags along inside of a component."""

    flange, w = gp.Flange("outside"), gl.Variable("rad/s", "inside")
    J, d = gl.Parameter("kg.m2"), gl.Parameter("N.m.s/rad")

    def equations(self) -> list[gl.Eq]:
        drag = self.d * (gl.der(self.flange.phi) - self.w)
        return [gl.Eq(self.flange.tau, drag), gl.Eq(self.J * gl.der(self.w), drag)]


def test_what_damps_inside_is_named_whatever_the_sign_of_its_energies() -> None:
    """The kinetic energy of this one seems to be positive, and the potential one negative; the other way round beside it."""

    class Dragged(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Spring(c=100.0)
            self.drum, self.end = Drum(J=0.5, d=3.0), gp.Spring(c=30.0)
            return [
                gl.connect(self.first.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a, self.drum.flange, self.end.flange_a),
            ]

    found = gl.modes(gl.compile(Dragged()))
    assert found.frequencies[1] > 0
    assert list(found.not_given) == [1]
    assert found.not_given[1].startswith("drum stores energy and damps inside")
    shares = dict(zip(found.components, found.kinetic[0], strict=True))  # turning freely, it is dragged along
    assert shares == pytest.approx({"first": 100 / 3.5, "b": 200 / 3.5, "drum": 50 / 3.5, "shaft": 0.0}, rel=1e-4)


class Absorber(gl.Component):
    """A body on a spring inside of a component."""

    flange, w = gp.Flange("outside"), gl.Variable("rad/s", "inside")
    J, c, twist = gl.Parameter("kg.m2"), gl.Parameter("N.m/rad"), gl.Variable("rad", start=0.0)

    def equations(self) -> list[gl.Eq]:
        torque = self.c * self.twist
        twist = gl.Eq(gl.der(self.twist), gl.der(self.flange.phi) - self.w)
        return [twist, gl.Eq(self.flange.tau, torque), gl.Eq(self.J * gl.der(self.w), torque)]


@pytest.mark.parametrize("stiffness", [40.0, 4e4])
def test_what_is_inside_follows_a_free_motion(stiffness: float) -> None:
    """Its kinetic energy is that of its inertia, though it would swing back where it has a frequency below that of the shaft."""

    class Absorbed(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Spring(c=100.0)
            self.inner = Absorber(J=0.5, c=stiffness)
            return [
                gl.connect(self.first.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a, self.inner.flange),
            ]

    found = gl.modes(gl.compile(Absorbed()))
    assert (found.free, found.not_given) == (1, {})
    shares = dict(zip(found.components, found.kinetic[0], strict=True))
    assert shares == pytest.approx({"first": 100 / 3.5, "b": 200 / 3.5, "inner": 50 / 3.5, "shaft": 0.0}, rel=1e-4)
    M, K = (
        np.diag([1.0, 2.0, 0.5]),
        np.array([[100.0, -100, 0], [-100, 100 + stiffness, -stiffness], [0, -stiffness, stiffness]]),
    )
    squares, shapes = eigh(K, M)
    assert found.omega[1:] == pytest.approx(np.sqrt(squares[1:]))
    for mode in (1, 2):
        assert found.kinetic[mode, found.components.index("inner")] == pytest.approx(50 * shapes[2, mode] ** 2, abs=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_shares_lie_in_their_range_whatever_the_damping(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(4):
        values = {"c": 10 ** rng.uniform(0, 4), "d": 10 ** rng.uniform(-3, 4)}
        for whole in (True, False):
            found = gl.modes(gl.compile(Link(whole=whole)), parameters=values)
            for table in (found.kinetic, found.potential):
                told = table[[k for k in range(len(found)) if k not in found.not_given]]
                assert ((told >= 0) & (told <= 100 + 1e-9)).all()
                assert all(np.isnan(table[k]).all() for k in found.not_given)
            assert whole or not found.not_given


def test_shapes_have_the_signs_of_their_variables(chain: Callable[..., gl.System]) -> None:
    """Of the two ends of a spring: the torques are opposite, and the twist is the difference of the angles, whichever is the alias."""
    found = gl.modes(chain(n=3), parameters={"c": 100.0})
    for mode in (1, 2):
        for k in (0, 1):
            a, b, twist, tau = found.shape(
                mode, f"shaft[{k}].flange_a.phi", f"shaft[{k}].flange_b.phi", f"shaft[{k}].phi_rel", f"shaft[{k}].tau"
            )
            at_a, at_b = found.shape(mode, f"shaft[{k}].flange_a.tau", f"shaft[{k}].flange_b.tau")
            left, right = found.shape(mode, f"body[{k}].flange_b.tau", f"body[{k + 1}].flange_a.tau")
            assert twist == pytest.approx(b - a, rel=1e-9)
            assert tau == pytest.approx(100.0 * (1 + 0.2 * k) * twist, rel=1e-9)
            assert [at_b, at_a, left, right] == pytest.approx([tau, -tau, tau, -tau], rel=1e-9)
        ends = found.shape(mode, "body[0].flange_a.phi", "body[0].w", "der(body[0].flange_b.phi)")
        assert ends[1:] == pytest.approx(found.eigenvalues[mode] * ends[:1].repeat(2), rel=1e-9)


def test_two_free_shafts_and_a_preload_are_told_apart() -> None:
    """An elastic loop of two parallel meshes carries a preload; a differential turns in two ways."""
    unit = gp.PlanetaryUnit(
        planets=3, planet_meshes="separate", R_s=0.03, R_p=0.04, I_s=1e-3, I_r=0.1, I_h=0.05, I_spin=1e-3, I_orbit=1e-3,
        K_ring=1e8, C_ring=0.0, K_sun=1e8, C_sun=0.0,
    )  # fmt: skip
    system = gl.compile(unit)
    found = gl.modes(system)
    # 6 meshes and 6 bodies (sun, ring, carrier, 3 planets): 12 states. Four modes and two free motions take 4 * 2 + 2 of them.
    assert (len(found), found.free, found.preloads) == (6, 2, 2)
    assert gl.stability(system).at_zero == "the train turns freely in 2 ways; loops of meshes keep preloads"


@pytest.mark.parametrize("n", [420, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("d", [0.0, 1.0])
def test_many_hundred_states(chain: Callable[..., gl.System], d: float, n: int) -> None:
    system = chain(n=n)
    mass, c = 1 + 0.3 * np.arange(n), 1e4 * (1 + 0.2 * np.arange(n - 1))
    diagonal = (np.append(c, 0) + np.append(0, c)) / mass
    squares = eigh_tridiagonal(diagonal, -c / np.sqrt(mass[1:] * mass[:-1]), True, "i", (0, 20))
    expected = np.sqrt(np.maximum(squares, 0))
    values = {"c": 1e4, "d": d}
    found = gl.modes(system, 20, parameters=values)
    assert len(system.states) == 2 * n - 1
    assert found.free == 1
    assert len(found) == 21
    assert found.omega[1:] == pytest.approx(expected[1:], rel=1e-6 if d else 1e-9)


@pytest.mark.slow
def test_two_thousand_states_are_linearised_and_have_their_modes_in_two_seconds(chain: Callable[..., gl.System]) -> None:
    system = chain(n=1000)
    values = {"c": 1e4, "d": 1.0}
    chain(n=4).linearize(["torque.tau"], ["body[3].w"])  # symbolic work, once for each class
    begin = time.process_time()
    model = system.linearize(["torque.tau"], ["body[999].w"], sparse=True, parameters=values)
    found = gl.modes(system, 20, parameters=values)
    shares = found.kinetic
    seconds = time.process_time() - begin  # of the processor; other processes do not count
    assert model.A.shape == (1999, 1999)
    assert shares[1:].sum(axis=1) == pytest.approx(100, abs=1e-2)
    assert seconds < 2.0


def test_preloads_do_not_hide_the_lowest_modes() -> None:
    """Planetary units in a row, each with loops of meshes: more than 100 poles at 0, and the lowest modes are still found."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.unit = [
                gp.PlanetaryUnit(
                    planets=4, planet_meshes="separate", R_s=0.03, R_p=0.04, I_s=1e-3, I_r=0.1, I_h=0.05, I_spin=1e-3, I_orbit=1e-3,
                    K_ring=1e8, C_ring=0.0, K_sun=1e8, C_sun=0.0,
                )
                for _ in range(35)
            ]  # fmt: skip
            self.shaft = [gp.Spring(c=1e4) for _ in range(34)]
            links = []
            for left, shaft, right in zip(self.unit, self.shaft, self.unit[1:], strict=False):
                links += [gl.connect(left.carrier, shaft.flange_a), gl.connect(shaft.flange_b, right.carrier)]
            return links

    system = gl.compile(Row())
    found = gl.modes(system, 10)
    full = np.array(system.linearize(inputs=[]).A)
    values = np.linalg.eigvals(full)
    expected = np.sort(values.imag[values.imag > 1.0])[:10]
    assert len(full) > 500
    assert (np.abs(values) < 1e-3).sum() > 100
    assert found.omega[found.free :] == pytest.approx(expected, rel=1e-6)
    assert found.free == 36  # each unit turns with its carrier still, and all turn as one
    turning = found.shapes[:, : found.free]
    assert np.linalg.matrix_rank(turning, tol=1e-8) == 36
    assert np.abs(full @ turning).max() < 1e-7 * np.abs(full).max() * np.abs(turning).max()


def test_text_and_table(paper: gl.System) -> None:
    found = gl.modes(paper)
    text = str(found)
    assert "train.x_unit.ring_mesh 96 %" in text
    assert "Decays without oscillation, 1/s: 32.1307, 393.955" in text
    lines = text.splitlines()  # the names are long: kinetic and potential energies below each other
    at = lines[0].index("kinetic energy, and potential energy below it")
    for k in range(3):
        assert lines[1 + 2 * k].startswith(f"{k:4d}  {found.frequencies[k]:13.6g}  {found.damping[k]:9.5f} ")
        for line, shares in zip(lines[1 + 2 * k : 3 + 2 * k], (found.kinetic[k], found.potential[k]), strict=True):
            assert line[at - 1] == " "
            assert [int(n) for n in re.findall(r"(\d+) %", line[at:])] == [round(share) for share in np.sort(shares)[:-3:-1]]
    table = found.to_dataframe()
    assert table["kinetic, %"].sum(axis=1).to_numpy() == pytest.approx(100, abs=1e-3)
    assert table["potential, %"].sum(axis=1).to_numpy() == pytest.approx(100, abs=1e-3)
    assert table["mode"]["frequency, Hz"].to_list() == pytest.approx([554.697, 929.687, 1228.543], abs=1e-3)


def test_drawing_shows_every_body(paper: gl.System) -> None:
    axes = gl.modes(paper).draw(1)
    assert "929.69 Hz" in axes[0].figure.get_suptitle()
    assert "train.x_unit.ring_gear" in [t.get_text() for t in axes[0].get_yticklabels()]
    with pytest.raises(gl.GearlibError, match="there is no mode 7; there are 3"):
        gl.modes(paper).draw(7)


def test_wrong_count_is_refused(paper: gl.System) -> None:
    with pytest.raises(gl.GearlibError, match="count is 0; expected a whole number"):
        gl.modes(paper, 0)


def test_large_trains_say_that_preloads_are_not_counted(
    chain: Callable[..., gl.System], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the lowest modes cannot be told from all others, so that all of them are computed."""
    from gearlib.vibration import modes, spectrum

    system = chain(n=6)
    assert gl.modes(system).preloads == 0
    assert "not counted" not in str(gl.modes(system))
    monkeypatch.setattr(modes, "MOST_DENSE", 5)
    assert gl.modes(system, 2).preloads is None
    assert "Constant preloads in loops of meshes are not counted above 5 states." in str(gl.modes(system, 2))
    monkeypatch.setattr(spectrum, "lowest", lambda *_: None)
    assert gl.modes(system, 2).preloads is None


def test_of_a_large_train_the_lowest_twenty_modes_are_found(
    chain: Callable[..., gl.System], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no number is given; of a small one all of them."""
    system = chain(n=30)
    assert len(gl.modes(system)) == 30
    monkeypatch.setattr("gearlib.vibration.modes.MOST_DENSE", 50)
    assert len(gl.modes(system)) == 1 + 20


class Oscillator(gl.Component):
    """A body on a spring-damper, damped critically."""

    rate = gl.Parameter("rad/s", default=10.0)

    def assemble(self) -> list[Any]:
        self.body, self.ground = gp.Inertia(J=0.3), gp.Fixed()
        self.shaft = gp.SpringDamper(c=0.3 * self.rate**2, d=0.6 * self.rate)
        return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.body.flange_a)]


def test_critical_damping_is_a_double_decay_however_rounding_splits_it() -> None:
    system = gl.compile(Oscillator())
    for rate in np.linspace(0.7, 90.0, 40):
        found = gl.modes(system, parameters={"rate": rate})
        assert len(found.eigenvalues) == 0
        assert found.decays == pytest.approx([-rate, -rate], rel=1e-6)


class Plane(gl.Connector):
    """Of something that moves in a plane."""

    x, y = gl.Potential("m"), gl.Potential("m")
    f_x, f_y = gl.Flow("N"), gl.Flow("N")


class Puck(gl.Component):
    """A mass in a plane, on springs of its own to the ground."""

    at = Plane("middle")
    m, c_x, c_y = gl.Parameter("kg", default=2.0), gl.Parameter("N/m", default=8.0), gl.Parameter("N/m", default=18.0)
    v_x, v_y = gl.Variable("m/s"), gl.Variable("m/s")

    def equations(self) -> list[gl.Eq]:
        at = self.at
        return [
            gl.Eq(self.v_x, gl.der(at.x)), gl.Eq(self.m * gl.der(self.v_x), at.f_x - self.c_x * at.x),
            gl.Eq(self.v_y, gl.der(at.y)), gl.Eq(self.m * gl.der(self.v_y), at.f_y - self.c_y * at.y),
        ]  # fmt: skip


class Geared(TwoFlanges):
    """A body whose second shaft turns three times as far, the other way round, as the first one, that of the body."""

    J, w = gl.Parameter("kg.m2", default=2.0), gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(b.phi, -3 * a.phi), gl.Eq(self.w, gl.der(a.phi)), gl.Eq(self.J * gl.der(self.w), a.tau - 3 * b.tau),
        ]  # fmt: skip


def test_motions_are_those_of_the_first_connector_of_a_body_each_way_by_its_name() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.shaft, self.body, self.puck = gp.Fixed(), gp.Spring(c=2.0), Geared(), Puck()
            return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.body.flange_b)]

    found = gl.modes(gl.compile(Both()))
    assert found.omega == pytest.approx([2.0, 3.0, 3.0])  # 2 * 3**2 = 18 N.m/rad for the body, too
    for mode in range(3):
        names, units, values = zip(*found.motions(mode), strict=True)
        assert (names, units) == (("body", "puck.x", "puck.y"), ("rad", "m", "m"))
        assert values == pytest.approx(found.shape(mode, "body.flange_a.phi", "puck.at.x", "puck.at.y"), abs=1e-12)
        assert found.shape(mode, "body.flange_b.phi")[0] == pytest.approx(-3 * values[0], abs=1e-12)


@pytest.mark.parametrize("slower", [1e-6, 1e-2, 1.0, 1e4])
def test_slow_modes_have_the_damping_of_fast_ones(slower: float) -> None:
    class Shaft(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.disc, self.loose = gp.Fixed(), gp.Inertia(J=2.0), gp.Spring(c=7.0)
            self.shaft = gp.SpringDamper(c=8.0 * slower**2, d=1.6 * slower)
            return [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.disc.flange_a, self.loose.flange_a),
            ]

    system = gl.compile(Shaft())
    found = gl.modes(system)
    assert found.omega == pytest.approx([2.0 * slower])
    assert found.damping == pytest.approx([0.2])
    model = system.translation.model  # what is always zero moves in no mode
    zero = [v for v in range(model.n_variables) if not model.sign[v]]
    assert zero
    assert found.amplitudes(0)[zero].tolist() == [0.0] * len(zero)


class Meshing(gl.Component):
    """Two free gears, whose mesh stiffness varies around its mean; a torque drives them."""

    stiffness = gl.Structural("sinusoidal")

    def assemble(self) -> list[Any]:
        self.a, self.b, self.drive = gp.Inertia(J=0.01), gp.Inertia(J=0.02), gp.ConstantTorque(tau_constant=10.0)
        self.mesh = gp.DetailedExternalMesh(
            r_a=0.1, r_b=0.12, z_a=20, c=1e8, d=1e4, stiffness=self.stiffness,
            **{"sinusoidal": {"c_amplitude": 0.4}, "rectangular": {"contact_ratio": 1.6}}.get(self.stiffness, {}),
        )  # fmt: skip
        return [
            gl.connect(self.drive.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.b.flange_a),
        ]


def test_a_frozen_mesh_phase_is_told() -> None:
    mean = np.sqrt(1e8 * (0.1**2 / 0.01 + 0.12**2 / 0.02)) / (2 * np.pi)
    system = gl.compile(Meshing())
    for phase in (0.0, 1.3, np.pi):
        found = gl.modes(system, at={"mesh.turned": phase})
        assert found.frequencies[-1] == pytest.approx(mean * np.sqrt(1 + 0.4 * np.cos(phase)))
        assert found.conditions == (f"frozen at mesh.turned = {phase:g} rad, with which the coefficients vary",)
        assert found.conditions[0] in str(gl.stability(system, at={"mesh.turned": phase}))


@pytest.mark.parametrize("stiffness", ["constant", "sinusoidal", "rectangular"])
def test_at_a_moment_of_a_run_the_phase_is_frozen_under_load_too(stiffness: str) -> None:
    system = gl.compile(Meshing(stiffness=stiffness))
    run = system.simulate(0.3)
    phase = run["mesh.turned"][-1]
    said = (f"frozen at mesh.turned = {phase:g} rad, with which the coefficients vary",) if stiffness != "constant" else ()
    found = gl.modes(system, at=(run, 0.3))
    assert found.conditions == said
    # under load the phase feels the vibration, too: a few parts in a million
    assert found.frequencies[-1] == pytest.approx(np.sqrt(run["mesh.c_now"][-1] * 1.72) / (2 * np.pi), rel=1e-5)
    assert gl.frequency_response(system, [10.0], outputs=["b.w"], at=(run, 0.3)).conditions == said


class Swinging(gl.Component):
    """A pendulum, whose length a motor changes in time."""

    g = gl.Parameter("1/s2", default=9.0)
    depth = gl.Parameter("1", default=0.0)
    rate = gl.Parameter("rad/s", default=5.0)
    phi = gl.Variable("rad")
    w = gl.Variable("rad/s")

    height = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.height, 1 - gl.cos(self.phi)),
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(gl.der(self.w), -self.g * (1 + self.depth * gl.sin(self.rate * gl.time)) * gl.sin(self.phi)),
        ]


def test_what_turns_is_frozen_but_no_equilibrium_and_no_linear_motion() -> None:
    system = gl.compile(Swinging())
    assert gl.modes(system, at={"phi": 0.0, "w": 0.0}).conditions == ()
    assert gl.modes(system, at={"phi": 0.5, "w": 20.0}).conditions == (
        "frozen at phi = 0.5 rad, with which the coefficients vary",
    )
    assert gl.modes(system, at={"phi": 0.0, "w": 0.0}, parameters={"depth": 0.1}).conditions == (
        "frozen at t = 0 s, with which the coefficients vary",
    )
    seen = gl.frequency_response(system, [1.0], outputs=["height"], at={"phi": 0.5, "w": 20.0}, parameters={"g": 0.0})
    assert seen.conditions == ("frozen at phi = 0.5 rad, with which the coefficients vary",)  # of the output alone


def test_only_the_phases_with_which_coefficients_vary_are_told() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.second, self.link = Meshing(), Meshing(), gp.SpringDamper(c=1e4, d=1.0)
            ends = (self.first.b.flange_b, self.link.flange_a), (self.link.flange_b, self.second.a.flange_a)
            return [gl.connect(*pair) for pair in ends]

    system = gl.compile(Two())
    for even, varying in (("first", "second"), ("second", "first")):
        found = gl.modes(system, parameters={f"{even}.mesh.c_amplitude": 0.0})
        assert found.conditions == (f"frozen at {varying}.mesh.turned = 0 rad, with which the coefficients vary",)
