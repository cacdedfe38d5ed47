"""Frequency responses against long simulations and closed forms; Campbell diagrams; order analysis."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.linear.linear_model import is_sparse
from tests.stress.misuse import BadMapping


def amplitude(time: Any, signal: Any, w: float) -> complex:
    """Complex amplitude of exp(i w t) in a signal, by least squares with a constant."""
    columns = np.column_stack([np.cos(w * time), np.sin(w * time), np.ones_like(time)])
    a, b, _ = np.linalg.lstsq(columns, signal, rcond=None)[0]
    return complex(a, -b)


class Shaken(gl.Component):
    """The paper's system with a torque cos(w t)."""

    w = gl.Parameter("rad/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.system = gp.ZhouCui2022(tau_in=gl.cos(self.w * gl.time), e_amplitude=0.0)
        return []


@pytest.fixture(scope="module")
def shaken() -> gl.System:
    return gl.compile(Shaken())


@pytest.mark.parametrize("w", [40.0, 3500.0, 5900.0])
def test_response_to_torque_is_the_ratio_of_amplitudes_in_a_long_run(shaken: gl.System, w: float) -> None:
    outputs = [f"system.{name}" for name in ("w_out", "q_ring", "q_pair", "train.x_unit.sun_mesh.f")]
    response = gl.frequency_response(shaken, [w], ["system.tau_in"], outputs)
    end = 1.2  # the slowest motion has died to exp(-28)
    times = np.concatenate([[0.0], np.linspace(end - (0.3 if w < 200 else 0.02), end, 801)])
    run = shaken.simulate(end, times=times, rtol=1e-10, parameters={"w": w})
    for name in outputs:
        measured = amplitude(times[1:], run[name][1:], w)
        assert measured == pytest.approx(complex(response[name][0]), rel=1e-7)


def test_response_to_transmission_error_is_that_of_a_run(paper: gl.System) -> None:
    """e = E sin(w t), so its rate is E w cos(w t): the amplitude of e is -i E."""
    w, E = 5000.0, 1e-6
    response = gl.transmission_error_response(paper, [w], ["q_ring", "q_sun", "w_out"])
    assert response.per == "m"
    times = np.concatenate([[0.0], np.linspace(1.18, 1.2, 801)])
    run = paper.simulate(
        1.2, times=times, rtol=1e-10, inputs={"tau_in": 0.0}, parameters={"e_amplitude": E * w, "e_omega": w, "e_phase": 0.0}
    )
    for name in response.outputs:
        assert amplitude(times[1:], run[name][1:], w) / (-1j * E) == pytest.approx(complex(response[name][0]), rel=1e-7)


def test_response_about_a_steady_state_is_that_of_small_swings_in_a_long_run() -> None:
    """A motor, a nonlinear load and a gap that stays closed; the error is of second order in the swing."""

    class Swung(gl.Component):
        w = gl.Parameter("rad/s", default=150.0)
        swing = gl.Parameter("N.m", default=0.0)

        def assemble(self) -> list[Any]:
            self.torque, self.motor = gp.Torque(tau=8 + self.swing * gl.cos(self.w * gl.time)), gp.Inertia(J=0.1)
            self.mesh, self.rotor = gp.ElastoBacklash(c=1e4, d=3.0, b=0.01), gp.Inertia(J=0.5, guess={"w": 10.0})
            self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-4.0, w_nominal=10.0)
            return [
                gl.connect(self.torque.flange, self.motor.flange_a),
                gl.connect(self.motor.flange_b, self.mesh.flange_a),
                gl.connect(self.mesh.flange_b, self.rotor.flange_a),
                gl.connect(self.rotor.flange_b, self.load.flange),
            ]

    w, swing = 150.0, 0.05
    system = gl.compile(Swung(), outputs=["motor.w", "rotor.w", "mesh.phi_rel"])
    response = gl.frequency_response(system, [w], ["torque.tau"], at="steady")
    times = np.concatenate([[0.0], np.linspace(11.8, 12.0, 401)])
    run = system.simulate(12.0, times=times, rtol=1e-10, start="steady", parameters={"w": w, "swing": swing})
    for name in response.outputs:
        assert amplitude(times[1:], run[name][1:], w) / swing == pytest.approx(complex(response[name][0]), rel=1e-4)


def test_phases_of_meshes_are_taken() -> None:
    """One gear between two equal meshes with opposite errors does not turn; with equal ones it does."""

    class Idler(gl.Component):
        def assemble(self) -> list[Any]:
            self.gear, self.ground = gp.Inertia(J=1e-3), gp.Fixed()
            self.left = gp.ExternalMesh(r_a=0.05, r_b=0.05, c=1e6, d=50.0)
            self.right = gp.ExternalMesh(r_a=0.05, r_b=0.05, c=1e6, d=50.0)
            return [
                gl.connect(self.gear.flange_b, self.left.flange_a, self.right.flange_a),
                gl.connect(self.left.flange_b, self.right.flange_b, self.ground.flange),
            ]

    system = gl.compile(Idler())
    w = np.array([100.0, 2000.0])
    both = gl.transmission_error_response(system, w, ["gear.w"])["gear.w"]
    against = gl.transmission_error_response(
        system, w, ["gear.w"], meshes={"left.e_rate": 1.0, "right.e_rate": np.exp(1j * np.pi)}
    )
    assert np.abs(against["gear.w"]).max() < 1e-12 * np.abs(both).max()
    for third in (Fraction(1, 3), sympy.Rational(1, 3)):
        one = gl.transmission_error_response(system, w, ["gear.w"], meshes={"left.e_rate": third, "right.e_rate": third})
        assert one["gear.w"] == pytest.approx(both / 3, rel=1e-12)
    stiffness = 1e6 + 50j * w
    expected = 1j * w * -2 * 0.05 * stiffness / (2 * 0.05**2 * stiffness - 1e-3 * w**2)
    assert both == pytest.approx(expected, rel=1e-10)


def test_large_model_uses_sparse_matrices(chain: Callable[..., gl.System]) -> None:
    """Response of the first of 600 bodies against a recursion along the chain."""
    n, J, c, d, w = 600, 1.0, 1e4, 2.0, 37.0
    response = gl.frequency_response(chain(n=n), [w], ["torque.tau"], ["body[0].w"], parameters={"J": J, "c": c, "d": d})
    stiffness = -J * (1 + 0.3 * (n - 1)) * w**2 + 0j
    for i in range(n - 2, -1, -1):
        shaft = c * (1 + 0.2 * i) + 1j * w * d
        stiffness = -J * (1 + 0.3 * i) * w**2 + shaft * stiffness / (shaft + stiffness)
    assert response["body[0].w"][0] == pytest.approx(1j * w / stiffness, rel=1e-8)


def test_a_large_model_of_python_control_has_its_signals_names() -> None:
    """Fifty first-order lags in series from each of two inputs, 1 / (1 + j w T)**50 each; a sampled model is refused at any size."""
    n, T = 50, 0.01
    lags = (np.eye(n, k=-1) - np.eye(n)) / T
    A, B, C = np.kron(np.eye(2), lags), np.kron(np.eye(2), np.eye(n, 1) / T), np.kron(np.eye(2), np.eye(1, n, n - 1))
    model = control.ss(A, B, C, np.zeros((2, 2)), inputs=["a", "b"], outputs=["x", "y"])
    assert is_sparse(model.A)
    w = np.array([0.0, 5.0, 40.0])
    response = gl.frequency_response(model, w)
    assert response["x", "a"] == pytest.approx((1 + 1j * w * T) ** -float(n), rel=1e-12)
    assert np.abs(response["x", "b"]).max() == 0.0
    assert response["y", "b"] == pytest.approx(response["x", "a"], rel=1e-12)
    with pytest.raises(gl.GearlibError, match="sampled"):
        gl.frequency_response(control.ss(A, B, C, np.zeros((2, 2)), 0.1), w)


def test_a_large_dense_model_is_solved_frequency_by_frequency() -> None:
    """Coupled by a reflection: (jw - H D H) x = b has the modes of D."""
    n, rng = 450, np.random.default_rng(5)
    a, v = -rng.uniform(1, 2, n), rng.normal(size=n)
    b, H = rng.normal(size=(n, 1)), np.eye(n) - 2 * np.outer(v, v) / (v @ v)
    model, w = control.ss(H @ np.diag(a) @ H, b, b.T, np.zeros((1, 1)), inputs=["u"], outputs=["y"]), np.array([0.3, 2.0, 9.0])
    assert not is_sparse(model.A)
    assert gl.frequency_response(model, w)["y"] == pytest.approx(
        [((H @ b)[:, 0] ** 2 / (1j * x - a)).sum() for x in w], rel=1e-9
    )


def test_a_large_model_s_feedthrough_is_added() -> None:
    """Modes of their own: D + sum of c b / (jw - a)."""
    rng = np.random.default_rng(3)
    a, b, c = -rng.uniform(1, 2, 150), rng.normal(size=(150, 2)), rng.normal(size=(1, 150))
    D = np.array([[3.0, -40.0]])
    w = np.array([0.1, 1.0, 30.0])
    model = control.ss(np.diag(a), b, c, D, inputs=["a", "b"], outputs=["x"])
    assert is_sparse(model.A)
    response = gl.frequency_response(model, w)
    for k, name in enumerate(("a", "b")):
        assert response["x", name] == pytest.approx(np.array([D[0, k] + c[0] / (1j * at - a) @ b[:, k] for at in w]), rel=1e-10)


def test_response_says_what_is_wrong(paper: gl.System, chain: Callable[..., gl.System]) -> None:
    with pytest.raises(gl.GearlibError, match="has a pole at 0 rad/s"):
        gl.frequency_response(chain(n=2), [0.0], ["torque.tau"], ["body[1].w"])
    for grid in ([-1.0], [-1.0, 1.0], [1.0, -1.0], [0.0, -1e-300]):
        with pytest.raises(gl.GearlibError, match="finite numbers that are not negative"):
            gl.frequency_response(paper, grid)
    with pytest.raises(gl.GearlibError, match="has no 'w'; Valid names: w_in"):
        gl.frequency_response(paper, [1.0], ["tau_in"], ["w_in"])["w"]
    with pytest.raises(gl.GearlibError, match=r"w_in is in rad/s; a transmission error is in m"):
        gl.transmission_error_response(paper, [1.0], meshes=["w_in"])
    with pytest.raises(gl.GearlibError, match=r"meshes is .*; expected names, or a mapping of names to amplitudes"):
        gl.transmission_error_response(paper, [1.0], meshes=BadMapping())
    frame = gl.frequency_response(paper, [1.0, 2.0], ["tau_in"], ["w_in"]).to_dataframe()
    assert list(frame.columns) == [("w_in", "tau_in", "magnitude"), ("w_in", "tau_in", "phase, deg")]


def test_campbell_of_constant_frequencies_is_exact(paper: gl.System) -> None:
    diagram = gl.campbell(paper, np.linspace(0, 150, 7), {"mesh": 81.0, "teeth 19": 19.0})
    f = gl.modes(paper).frequencies
    expected = [(2 * np.pi * f[k] / 81, k) for k in range(3)]
    assert [(c.speed, c.mode) for c in diagram.crossings] == [(pytest.approx(w, rel=1e-12), k) for w, k in expected]
    assert "mesh" in str(diagram)
    assert diagram.to_dataframe()["speed, 1/min"][0] == pytest.approx(expected[0][0] * 30 / np.pi)
    assert "no order meets" in str(gl.campbell(paper, [0, 1.0], [1.0]))


def test_campbell_follows_modes_that_depend_on_speed(chain: Callable[..., gl.System]) -> None:
    """A shaft that hardens with speed, c = 100 (1 + w^2 / 100): omega = w_0 sqrt(1 + w^2 / 100) meets order 3 in closed form."""
    system = chain(n=2)
    w_0 = gl.modes(system, parameters={"J": 1.0, "c": 100.0}).omega[1]
    diagram = gl.campbell(
        system, np.linspace(0, 20, 9), {"third": 3.0}, parameters=lambda w: {"J": 1.0, "c": 100 * (1 + w**2 / 100)}
    )
    assert diagram.frequencies[:, 0] == pytest.approx(w_0 * np.sqrt(1 + diagram.speeds**2 / 100) / (2 * np.pi), rel=1e-11)
    assert [c.speed for c in diagram.crossings] == pytest.approx([w_0 / np.sqrt(9 - w_0**2 / 100)], rel=1e-8)


def test_crossings_are_numbered_as_modes(chain: Callable[..., gl.System]) -> None:
    """The number of a crossing is that of `modes` at its speed, whatever turns freely, and however modes change places."""
    system = chain(n=4)

    def values(w: float) -> dict[str, float]:
        return {"J": 1.0, "c": 100 * (1 + w**2 / 100)}

    def opened(w: float) -> dict[str, float]:
        return {"pair.q": 6e-5 if w < 15 else 0.0}

    class Two(gl.Component):
        """A rotor whose frequency falls past that of another one, and gears that part."""

        k = gl.Parameter("N.m/rad", default=100.0)

        def assemble(self) -> list[Any]:
            self.f, self.a, self.b = gp.Fixed(), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            self.s, self.t = gp.Spring(c=self.k), gp.Spring(c=150.0)
            self.pinion, self.wheel = gp.Inertia(J=0.01), gp.Inertia(J=0.1)
            self.pair = gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=1e6, d=0.0, b=1e-4, backlash=True)
            return [
                gl.connect(self.f.flange, self.s.flange_a, self.t.flange_a),
                gl.connect(self.s.flange_b, self.a.flange_a),
                gl.connect(self.t.flange_b, self.b.flange_a),
                gl.connect(self.pinion.flange_b, self.pair.flange_a),
                gl.connect(self.pair.flange_b, self.wheel.flange_a),
            ]

    two = gl.compile(Two())
    moving: list[tuple[gl.System, Any, Any]] = [
        (system, None, values),
        (two, opened, lambda w: {"k": 300.0 - 10 * w}),
        (two, {"pair.q": 0.0}, None),
    ]
    for found, at, parameters in moving:
        diagram = gl.campbell(found, np.linspace(1.0, 20.0, 9), {"a": 0.7, "b": 1.3, "c": 3.0}, at=at, parameters=parameters)
        assert diagram.crossings
        for crossing in diagram.crossings:
            point = at(crossing.speed) if callable(at) else at
            there = gl.modes(found, at=point, parameters=parameters(crossing.speed) if parameters else None)
            assert there.frequencies[crossing.mode] == pytest.approx(crossing.frequency, rel=1e-7)
            assert there.damping[crossing.mode] == pytest.approx(crossing.damping, abs=1e-9)
            axes = there.draw(crossing.mode)
            assert f"Mode {crossing.mode}: {crossing.frequency:.5g} Hz" in axes[0].figure.get_suptitle()
            plt.close(axes[0].figure)
        for k, speed in enumerate(diagram.speeds):
            point = at(speed) if callable(at) else at
            there = gl.modes(found, at=point, parameters=parameters(speed) if parameters else None)
            swings = diagram.modes[k] >= 0  # inside the gap the mesh does not
            assert there.frequencies[diagram.modes[k, swings]] == pytest.approx(diagram.frequencies[k, swings], rel=1e-12)
            assert np.isnan(diagram.frequencies[k, ~swings]).all()
    labels = {text.get_text() for text in diagram.plot().texts}
    assert labels == {str(n) for n in diagram.modes[0]}
    plt.close("all")


def test_campbell_wants_growing_speeds(paper: gl.System) -> None:
    with pytest.raises(gl.GearlibError, match="increasing sequence"):
        gl.campbell(paper, [3.0, 2.0], [1.0])


class RunUp(gl.Component):
    """A rotor that speeds up, and a signal with known orders on it."""

    def assemble(self) -> list[Any]:
        self.torque, self.rotor = gp.Torque(tau=2.0), gp.Inertia(J=0.1, start={"w": 30.0, "phi": 0.0})
        return [gl.connect(self.torque.flange, self.rotor.flange_a)]

    signal = gl.Variable("N")

    def equations(self) -> list[gl.Eq]:
        phi = self.rotor.phi
        small = 0.25 * gl.sin(21.5 * phi) + 0.001 * gl.cos(34 * phi) + 0.05 * gl.cos(39.77 * phi)
        return [gl.Eq(self.signal, 4 + 3.0 * gl.cos(17 * phi + 0.4) + small)]


def test_orders_of_a_run_up_are_found_though_the_speed_changes() -> None:
    run = gl.compile(RunUp(), outputs=["signal", "rotor.phi", "rotor.w"]).simulate(t_end=4.0, samples=40_001, rtol=1e-10)
    spectrum = gl.order_spectrum(run, "signal", "rotor.phi", max_order=50)
    assert [spectrum.at(k) for k in (0, 17, 21.5, 34)] == pytest.approx([4, 3, 0.25, 0.001], rel=2e-3)
    quiet = [spectrum.at(k) for k in (5, 19, 28, 45)]  # order 39.77 makes no whole number of waves: the window keeps it there
    assert max(quiet) < 1e-5
    by_speed = gl.order_spectrum(run, "signal", "rotor.w", max_order=50)
    assert by_speed.at(17) == pytest.approx(3, rel=2e-3)
    waterfall = gl.order_waterfall(run, "signal", "rotor.w", revolutions=8, max_order=50)
    assert (np.diff(waterfall.speeds) > 0).all()
    assert waterfall.speeds == pytest.approx(30 + 20 * waterfall.times, rel=1e-3)
    line = waterfall.amplitudes[:, np.flatnonzero(waterfall.orders == 17.0)[0]]
    assert line == pytest.approx(3.0, rel=1e-4)


def test_orders_of_a_run_that_does_not_start_at_angle_0() -> None:
    """A spectrum of amplitudes does not know where the angle is counted from, nor the sense of turning, nor the clock."""

    class Shifted(RunUp):
        phi0 = gl.Parameter("rad", default=0.0)
        sense = gl.Parameter("1", default=1.0)

        def assemble(self) -> list[Any]:
            self.torque = gp.Torque(tau=2.0 * self.sense)
            self.rotor = gp.Inertia(J=0.1, start={"w": 30.0 * self.sense, "phi": self.phi0})
            return [gl.connect(self.torque.flange, self.rotor.flange_a)]

    system = gl.compile(Shifted(), outputs=["signal", "rotor.phi", "rotor.w"])
    for phi0, sense, begin in ((5.0, 1.0, 0.0), (-123.0, 1.0, 7.0), (40.0, -1.0, 0.0)):
        run = system.simulate(begin + 2.0, t_start=begin, samples=20_001, rtol=1e-10, parameters={"phi0": phi0, "sense": sense})
        for reference in ("rotor.phi", "rotor.w"):
            spectrum = gl.order_spectrum(run, "signal", reference, max_order=50)
            assert [spectrum.at(k) for k in (0, 17)] == pytest.approx([4, 3], rel=5e-3)
            assert spectrum.at(28) < 1e-3
            late = gl.order_spectrum(run, "signal", reference, t_start=begin + 1.0, max_order=50)
            assert late.at(17) == pytest.approx(3, rel=5e-3)
        waterfall = gl.order_waterfall(run, "signal", "rotor.phi", revolutions=4, max_order=50)
        assert waterfall.amplitudes[:, np.flatnonzero(waterfall.orders == 17.0)[0]] == pytest.approx(3.0, rel=1e-3)


def test_orders_that_the_samples_cannot_show_are_refused() -> None:
    """At the end it turns with 110 rad/s: a sample each 0.01 s is one for each 1.1 rad, two for each wave of order pi / 1.1."""
    run = gl.compile(RunUp(), outputs=["signal", "rotor.phi"]).simulate(t_end=4.0, samples=401)
    with pytest.warns(gl.GearlibWarning, match="signal is sampled too rarely"):
        spectrum = gl.order_spectrum(run, "signal", "rotor.phi")
    assert spectrum.orders[-1] == pytest.approx(np.pi / 1.1, abs=0.05)
    with pytest.raises(gl.GearlibError, match=r"order 17 is not in this spectrum of signal, which goes from 0 to 2\.8"):
        spectrum.at(17)


@pytest.mark.parametrize("third", [Fraction(1, 3), sympy.Rational(1, 3), np.float32(1 / 3)])
def test_orders_and_overlaps_may_be_numbers_of_any_kind(third: Any) -> None:
    run = gl.compile(RunUp(), outputs=["signal", "rotor.phi"]).simulate(t_end=0.5, samples=501)
    pieces, same = (gl.order_waterfall(run, "signal", "rotor.phi", revolutions=1, overlap=o) for o in (third, float(third)))
    assert np.array_equal(pieces.amplitudes, same.amplitudes)
    assert len(pieces.times) > 2
    spectra = [gl.order_spectrum(run, "signal", "rotor.phi", t_start=t, max_order=60 * t) for t in (third, float(third))]
    assert np.array_equal(*(s.amplitudes for s in spectra))
    assert spectra[0].at(third) == spectra[0].at(float(third))
    with pytest.raises(gl.GearlibError, match=r"order .* is not in this spectrum"):
        spectra[0].at(300 * third)


def test_order_analysis_says_what_is_wrong() -> None:
    run = gl.compile(RunUp(), outputs=["signal", "rotor.phi", "rotor.w"]).simulate(t_end=0.1, samples=101)
    with pytest.raises(gl.GearlibError, match=r"turns 0\.493 times in the interval"):
        gl.order_spectrum(run, "signal", "rotor.phi")
    with pytest.raises(gl.GearlibError, match=r"signal is in N; expected an angle"):
        gl.order_spectrum(run, "signal", "signal")
    with pytest.raises(gl.GearlibError, match="a piece needs 8"):
        gl.order_waterfall(run, "signal", "rotor.phi")


def test_plots_have_one_diagram_per_unit_and_units_as_printed(paper: gl.System) -> None:
    response = gl.frequency_response(paper, [1.0, 10.0, 100.0], ["tau_in"], ["w_in", "q_ring", "w_out"])
    axes = response.plot()
    assert [ax.get_ylabel() for ax in axes] == ["amplitude, rad/s per N·m", "amplitude, m per N·m", "phase, deg"]
    assert [len(ax.lines) for ax in axes] == [2, 1, 3]
    assert all(line.get_visible() for ax in axes for line in (*ax.get_xgridlines(), *ax.get_ygridlines()))
    assert {line.get_color() for ax in axes[:2] for line in ax.lines} == {line.get_color() for line in axes[2].lines}
    run = gl.compile(RunUp()).simulate(0.5, samples=2001)
    spectra = gl.order_waterfall(run, "torque.flange.tau", "rotor.w", revolutions=2).plot()
    assert spectra.figure.axes[1].get_ylabel().endswith(" N·m")
    assert gl.order_spectrum(run, "torque.flange.tau", "rotor.w").plot().get_ylabel().endswith(", N·m")
    plt.close("all")


class Based(gl.Component):
    """A mass on a spring, whose other end is moved."""

    k, m = gl.Parameter("N/m", default=50.0), gl.Parameter("kg", default=2.0)
    e = gl.Input("m", "where the other end is")
    x, v = gl.Variable("m"), gl.Variable("m/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(self.m * gl.der(self.v), self.k * (self.e - self.x))]


class Rated(gl.Component):
    """The same, by the speed of the other end."""

    k, m = gl.Parameter("N/m", default=50.0), gl.Parameter("kg", default=2.0)
    e_rate = gl.Input("m/s", "speed of the other end")
    q, v, x = gl.Variable("m"), gl.Variable("m/s"), gl.Variable("m")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.q), self.e_rate - self.v),
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(self.m * gl.der(self.v), self.k * self.q),
        ]


class Excited(gl.Component):
    """Both, and one inside of another component, by an input of this one; an error that nothing reads."""

    e = gl.Input("m", "of the inner one")

    def assemble(self) -> list[Any]:
        self.based, self.rated, self.inner = Based(), Rated(k=30.0), Inner(e=self.e)
        return []


class Inner(gl.Component):
    e = gl.Input("m", "of the part")
    unread_e = gl.Input("m", "with another name")

    def assemble(self) -> list[Any]:
        self.part = Based(k=20.0, e=self.e)
        return []


def test_errors_and_their_rates_are_applied_together() -> None:
    """k / (k - m w^2) of the amplitude each; a name that stands for another is counted once."""
    system = gl.compile(Excited())
    w = np.array([0.5, 3.0, 40.0])
    outputs = ["based.x", "rated.x", "inner.part.x"]
    each = np.array([k / (k - 2.0 * w**2) for k in (50.0, 30.0, 20.0)])
    found = gl.transmission_error_response(system, w, outputs)
    assert found.values[:, 0] == pytest.approx(each, rel=1e-9)
    assert (found.inputs, found.per, found.units) == (("transmission error",), "m", ("m",) * 3)
    factors = {"e": 2.0 - 1.0j, "rated.e_rate": 1j, "based.e": np.complex64(0.5)}
    weighted = gl.transmission_error_response(system, w, outputs, meshes=factors)
    assert weighted.values[:, 0] == pytest.approx(each * np.array([[0.5], [1j], [2.0 - 1.0j]]), rel=1e-7)
    one = gl.transmission_error_response(system, w, outputs, meshes=["rated.e_rate"])
    assert one.values[:, 0] == pytest.approx(each * np.array([[0], [1], [0]]), rel=1e-9)
    change = weighted.sensitivity("rated.k")[:, 0]
    assert change[1] == pytest.approx(1j * -2.0 * w**2 / (30.0 - 2.0 * w**2) ** 2, rel=1e-9)
    assert not change[[0, 2]].any()
    for inputs, per in ((["e", "based.e"], "m"), (["e", "rated.e_rate"], ""), (["rated.e_rate"], "m/s")):
        assert gl.frequency_response(system, w, inputs, outputs).per == per
    for wrong in (complex(np.nan, 1.0), np.inf, "1"):
        with pytest.raises(
            gl.GearlibError, match=r"the amplitude of e in meshes is .*; expected a finite number, which may be"
        ):
            gl.transmission_error_response(system, w, outputs, meshes={"e": wrong})
