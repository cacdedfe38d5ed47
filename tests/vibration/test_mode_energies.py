"""Energies of components in a mode, from linearised equations made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

import gearlib as gl
import gearparts as gp
from gearlib.vibration.mode_energies import Family, energies
from gearparts.interfaces import TwoFlanges


def family(L: Any, unknown: list[int], given: list[int], *pairs: tuple[int, int, float], copies: int = 1) -> Family:
    """Equal components; ``L`` by order, rows and columns, unknowns first."""
    shape = (copies, 1)
    table = np.repeat(np.asarray(L, float)[:, None], copies, axis=1)
    return Family(tuple(range(copies)), np.tile(unknown, shape), np.tile(given, shape), table, pairs)


@pytest.mark.parametrize("seed", range(6))
def test_masses_springs_and_dampers_between_any_number_of_flanges(seed: int) -> None:
    """Forces ``(M s^2 + C s + K) x`` at the flanges, some of them counted the other way round: mean energies of a swing."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    M, C, K = (a @ a.T for a in rng.normal(size=(3, n, n)))
    C *= 1e-6
    turned = rng.choice([-1.0, 1.0], n)  # of the forces
    L = np.zeros((3, n, 2 * n))
    for order, part in enumerate((K, C, M)):
        L[order, :, n:] = -turned[:, None] * part
    L[0, :, :n] = np.eye(n)
    scale = 10.0 ** rng.uniform(-6, 6, n)  # of the equations
    L *= scale[:, None]
    pairs = tuple((i, n + i, float(turned[i])) for i in range(n))
    amplitude = rng.normal(size=2 * n) + 1j * rng.normal(size=2 * n)
    x, omega = amplitude[n:], float(rng.uniform(0.5, 20))
    kinetic, potential, off = energies(family(L, list(range(n)), list(range(n, 2 * n)), *pairs), amplitude, omega)
    assert kinetic == pytest.approx([omega**2 * (x.conj() @ M @ x).real / 4], rel=1e-9)
    assert potential == pytest.approx([(x.conj() @ K @ x).real / 4], rel=1e-9)
    assert off == pytest.approx([0.0], abs=1e-12 * (kinetic[0] + potential[0]))


@pytest.mark.parametrize(("unit", "written"), [(1e-3, 1.0), (1.0, 1e-14), (1e12, 1.0), (1.0, 1e14)])
@pytest.mark.parametrize("omega", [0.3, 1.7, 40.0])
def test_a_mass_behind_a_spring_has_the_energies_of_both(omega: float, unit: float, written: float) -> None:
    """Inside: force k (x - y) on a mass m, with y and this equation in any unit. Twice the same component, with other amplitudes.

    A third variable inside, on which nothing depends at that point, changes nothing.
    """
    k, m = 5.0, 0.8
    L = np.zeros((3, 2, 4))  # unknowns f, y, z; given x
    L[0] = [[1.0, k * unit, 0.0, -k], [0.0, k * unit, 0.0, -k]]
    L[2, 1, 1] = m * unit
    L[:, 1] *= written
    two = family(L, [0, 1, 4], [2], (0, 3, 1.0), copies=2)
    two = Family(two.instances, two.unknown, np.array([[2], [3]]), two.L, two.pairs)
    amplitude = np.array([0.0, 0.0, 2.0, 1.0 - 3.0j, 0.0])
    kinetic, potential, off = energies(two, amplitude, omega)
    for i, x in enumerate(amplitude[2:4]):
        y = x / (1 - m * omega**2 / k)
        assert kinetic[i] == pytest.approx(m * omega**2 * abs(y) ** 2 / 4, rel=1e-9)
        assert potential[i] == pytest.approx(k * abs(x - y) ** 2 / 4, rel=1e-9)
        assert off[i] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("omega", [0.01, 2.0, 300.0])
def test_what_a_spring_and_a_damper_in_series_store_is_known_to_a_bound(omega: float) -> None:
    """f = c (x - y) = d s y: the spring's true energy differs from the one that is found by no more than the bound says."""
    c, d = 3.0, 1.5
    L = np.zeros((3, 2, 3))  # unknowns f, y; given x
    L[0] = [[1.0, c, -c], [0.0, c, -c]]
    L[1, 1, 1] = d
    (kinetic,), (potential,), (off,) = energies(family(L, [0, 1], [2], (0, 2, 1.0)), np.array([0.0, 0.0, 1.0]), omega)
    stored = c * abs(1 - c / (c + 1j * d * omega)) ** 2 / 4
    assert off > 0
    assert abs(potential - stored) <= 2 * max(off, abs(kinetic))
    # f = c d s / (c + d s) x, its slope c**2 d / (c + d s)**2 and half its curvature, -(c d)**2 / (c + d s)**3
    s = 1j * omega
    force, slope, bend = c * d * s / (c + d * s), c**2 * d / (c + d * s) ** 2, -((c * d) ** 2) / (c + d * s) ** 3
    mass = slope.imag / (2 * omega)
    assert (kinetic, potential) == pytest.approx((mass * omega**2 / 4, (force.real + mass * omega**2) / 4))
    inside = abs(bend - mass) * omega**2 / 4
    assert off == pytest.approx(inside * min(force.imag / 4 / max(abs(kinetic) + abs(potential), inside), 1.0) ** 2)
    (still,), (strained,), (none,) = energies(family(L, [0, 1], [2], (0, 2, 1.0)), np.zeros(3), omega)
    assert (still, strained, none) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("omega", [0.4, 3.0])
def test_forces_of_any_order_have_the_energies_of_their_slopes(omega: float) -> None:
    """A force Z(s) x with derivatives up to the fifth, as a filter behind a spring makes them: slope and curvature of Z tell."""
    Z = np.polynomial.Polynomial([7.0, 0.3, 2.0, 0.2, 0.5, 0.1])
    L = np.array([[[1.0 if k == 0 else 0.0, -z]] for k, z in enumerate(Z.coef)])  # unknown f; given x
    x = 1.5 - 0.5j
    (kinetic,), (potential,), (off,) = energies(family(L, [0], [1], (0, 1, 1.0)), np.array([0.0, x]), omega)
    size, s = abs(x) ** 2, 1j * omega
    force, mass, bend = size * Z(s), size * Z.deriv()(s).imag / (2 * omega), size * Z.deriv(2)(s) / 2
    assert (kinetic, potential) == pytest.approx((mass * omega**2 / 4, (force.real + mass * omega**2) / 4))
    inside = abs(bend - mass) * omega**2 / 4
    assert off == pytest.approx(inside * min(abs(force.imag) / 4 / max(abs(kinetic) + abs(potential), inside), 1.0) ** 2)


class Wired(gl.Component):
    """Two bodies and a spring; the whole and a part without any flange have equations, too, which store nothing."""

    swing = gl.Variable("rad/s", "twice the difference of the speeds")

    def assemble(self) -> list[Any]:
        self.filter = gp.blocks.FirstOrder(k=1.0, T=0.1, u=self.swing)
        self.a, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
        return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.swing, 2 * (self.a.w - self.b.w))]


def test_what_has_no_flanges_takes_no_part() -> None:
    found = gl.modes(gl.compile(Wired()))
    assert found.components == ("a", "b", "shaft")
    (mode,) = np.flatnonzero(found.frequencies > 0)
    assert found.frequencies[mode] == pytest.approx(1 / np.pi)
    assert found.kinetic[mode] == pytest.approx([75.0, 25.0, 0.0])
    assert found.potential[mode] == pytest.approx([0.0, 0.0, 100.0])


class Cubic(TwoFlanges):
    """A spring that stiffens."""

    k = gl.Parameter("N.m/rad3")

    def equations(self) -> list[gl.Eq]:
        twist = self.flange_b.phi - self.flange_a.phi
        return [gl.Eq(self.flange_b.tau, self.k * twist**3), gl.Eq(self.flange_a.tau, -self.k * twist**3)]


class Meter(gl.Component):
    """What it shows follows from a speed; it takes no torque."""

    flange = gp.Flange("of the shaft")
    rpm = gl.Variable("1", "revolutions per minute")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0), gl.Eq(self.rpm, gl.der(self.flange.phi) * 30 / np.pi)]


class Held(gl.Component):
    """A body on a spring that stiffens and a linear one, both to the ground; its parts in either order."""

    turned = gl.Structural(False)

    def assemble(self) -> list[Any]:
        if self.turned:
            self.disc, self.linear, self.cubic = gp.Inertia(J=2.0), gp.Spring(c=3.0), Cubic(k=4.0)
            self.ground, self.meter = gp.Fixed(), Meter()
        else:
            self.meter, self.ground, self.cubic, self.linear = Meter(), gp.Fixed(), Cubic(k=4.0), gp.Spring(c=3.0)
            self.disc = gp.Inertia(J=2.0)
        return [
            gl.connect(self.disc.flange_a, self.linear.flange_b, self.cubic.flange_b, self.meter.flange),
            gl.connect(self.ground.flange, self.linear.flange_a, self.cubic.flange_a),
        ]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("angle", [0.5, -2.0])
def test_stiffness_is_that_at_the_operating_point(turned: bool, angle: float) -> None:
    """Slope 3 k phi**2 of the one, c of the other: their shares do not depend on the order of the parts."""
    found = gl.modes(gl.compile(Held(turned=turned)), at={"disc.phi": angle})
    slope = 12.0 * angle**2
    assert found.omega == pytest.approx([np.sqrt((slope + 3.0) / 2)])
    assert set(found.components) == {"cubic", "linear", "disc"}
    shares = dict(zip(found.components, found.potential[0], strict=True))
    assert shares == pytest.approx({"cubic": 100 * slope / (slope + 3), "linear": 300 / (slope + 3), "disc": 0.0})
    assert dict(zip(found.components, found.kinetic[0], strict=True)) == {"cubic": 0.0, "linear": 0.0, "disc": 100.0}


class Loose(gl.Component):
    """A body on a spring to the ground, with another spring that hangs loose on it; the parts in either order."""

    turned = gl.Structural(False)

    def assemble(self) -> list[Any]:
        if self.turned:
            self.loose, self.ground, self.shaft = gp.Spring(c=7.0), gp.Fixed(), gp.Spring(c=3.0)
            self.disc = gp.Inertia(J=2.0)
        else:
            self.disc, self.shaft, self.ground, self.loose = gp.Inertia(J=2.0), gp.Spring(c=3.0), gp.Fixed(), gp.Spring(c=7.0)
        return [
            gl.connect(self.disc.flange_a, self.shaft.flange_b, self.loose.flange_a),
            gl.connect(self.ground.flange, self.shaft.flange_a),
        ]


@pytest.mark.parametrize("turned", [False, True])
def test_a_loose_spring_stores_nothing(turned: bool) -> None:
    found = gl.modes(gl.compile(Loose(turned=turned)))
    assert found.omega == pytest.approx([np.sqrt(1.5)])
    assert set(found.components) == {"disc", "shaft"}
    assert dict(zip(found.components, found.potential[0], strict=True)) == pytest.approx({"disc": 0.0, "shaft": 100.0})
    assert dict(zip(found.components, found.kinetic[0], strict=True)) == pytest.approx({"disc": 100.0, "shaft": 0.0})
    assert found.not_given == {}


class Idle(TwoFlanges):
    """A spring with an offset of its torque that is switched off."""

    c, k = gl.Parameter("N.m/rad"), gl.Parameter("N.m/rad", default=5.0)
    off = gl.Variable("rad", "always zero")

    def equations(self) -> list[gl.Eq]:
        torque = self.c * (self.flange_b.phi - self.flange_a.phi) + self.k * self.off
        return [gl.Eq(self.off, 0), gl.Eq(self.flange_b.tau, torque), gl.Eq(self.flange_a.tau, -torque)]


class OnTwo(gl.Component):
    """A body between such a spring and another to the ground; its parts in either order."""

    turned = gl.Structural(False)

    def assemble(self) -> list[Any]:
        if self.turned:
            self.soft, self.ground, self.stiff, self.disc = gp.Spring(c=1.0), gp.Fixed(), Idle(c=4.0), gp.Inertia(J=2.0)
        else:
            self.disc, self.stiff, self.ground, self.soft = gp.Inertia(J=2.0), Idle(c=4.0), gp.Fixed(), gp.Spring(c=1.0)
        return [
            gl.connect(self.disc.flange_a, self.stiff.flange_b, self.soft.flange_b),
            gl.connect(self.ground.flange, self.stiff.flange_a, self.soft.flange_a),
        ]


@pytest.mark.parametrize("turned", [False, True])
def test_what_is_always_zero_inside_takes_no_part(turned: bool) -> None:
    found = gl.modes(gl.compile(OnTwo(turned=turned)))
    assert found.omega == pytest.approx([np.sqrt(2.5)])
    shares = dict(zip(found.components, found.potential[0], strict=True))
    assert shares == pytest.approx({"disc": 0.0, "stiff": 80.0, "soft": 20.0})


def test_bodies_behind_a_torque_that_is_given_have_their_energies() -> None:

    class Given(gl.Component):
        def assemble(self) -> list[Any]:
            self.first, self.ground, self.shaft = gp.Torque(tau=gl.sin(gl.time)), gp.Fixed(), gp.Spring(c=8.0)
            self.second, self.disc = gp.Torque(tau=gl.cos(gl.time)), gp.Inertia(J=2.0)
            return [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.disc.flange_a, self.first.flange, self.second.flange),
            ]

    found = gl.modes(gl.compile(Given()))
    assert found.omega == pytest.approx([2.0])
    assert set(found.components) == {"shaft", "disc"}
    assert found.kinetic.sum() == found.potential.sum() == pytest.approx(100.0)


class Ended(gl.Connector):
    """Mechanical; its torque is declared before its angle."""

    tau, phi = gl.Flow("N.m"), gl.Potential("rad")


class Bar(gl.Component):
    """A body on a spring that ends at a flange; nothing else is on the body."""

    end, flange = Ended("body"), gp.Flange("spring")
    J, c, w = gl.Parameter("kg.m2"), gl.Parameter("N.m/rad"), gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        torque = self.c * (self.end.phi - self.flange.phi)
        return [
            gl.Eq(self.w, gl.der(self.end.phi)),
            gl.Eq(self.end.tau, self.J * gl.der(self.w) + torque),
            gl.Eq(self.flange.tau, -torque),
        ]


@pytest.mark.parametrize("first", [False, True])
def test_what_moves_at_a_free_end_has_the_energies_of_its_body_and_spring(first: bool) -> None:
    """Whether its torque, which is zero, is the first of all variables of the model or a later one."""

    class Ends(gl.Component):
        def assemble(self) -> list[Any]:
            if first:
                self.bar = Bar(J=2.0, c=5.0)
            self.disc, self.ground, self.shaft = gp.Inertia(J=3.0), gp.Fixed(), gp.Spring(c=7.0)
            if not first:
                self.bar = Bar(J=2.0, c=5.0)
            return [
                gl.connect(self.ground.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.disc.flange_a, self.bar.flange),
            ]

    squares, shapes = eigh(np.array([[5.0, -5.0], [-5.0, 12.0]]), np.diag([2.0, 3.0]))
    found = gl.modes(gl.compile(Ends()))
    assert found.omega == pytest.approx(np.sqrt(squares))
    assert (set(found.components), found.not_given) == ({"bar", "disc", "shaft"}, {})
    bar = found.components.index("bar")
    assert found.kinetic[:, bar] == pytest.approx(200 * shapes[0] ** 2)
    assert found.potential[:, bar] == pytest.approx(500 * (shapes[0] - shapes[1]) ** 2 / squares)


class Rod(gl.Connector):
    """By its speed, not its position."""

    v, f = gl.Potential("m/s"), gl.Flow("N")


class Axle(gl.Connector):
    """By its speed, not its angle."""

    v, f = gl.Potential("rad/s"), gl.Flow("N.m")


@pytest.mark.parametrize("kind", [Rod, Axle])
def test_connectors_of_speeds_do_work(kind: type[gl.Connector]) -> None:
    """Two bodies on one spring: (1/1 + 1/3) 50 = omega^2; the light one has three quarters of what moves."""

    class Body(gl.Component):
        end, m = kind("end"), gl.Parameter("any")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.m * gl.der(self.end.v), self.end.f)]

    class Elastic(gl.Component):
        a, b, k = kind("one end"), kind("the other end"), gl.Parameter("any", default=50.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.b.f), self.k * (self.b.v - self.a.v)), gl.Eq(self.a.f, -self.b.f)]

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.rod = Body(m=1.0), Body(m=3.0), Elastic()
            return [gl.connect(self.a.end, self.rod.a), gl.connect(self.rod.b, self.b.end)]

    found = gl.modes(gl.compile(Two()))
    assert found.omega == pytest.approx([np.sqrt(50.0 * 4 / 3)])
    assert (found.components, found.not_given) == (("a", "b", "rod"), {})
    assert found.kinetic[0] == pytest.approx([75.0, 25.0, 0.0], abs=1e-9)
    assert found.potential[0] == pytest.approx([0.0, 0.0, 100.0], abs=1e-9)
