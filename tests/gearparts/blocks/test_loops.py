"""Controllers in closed loops: Modelica's example of a PID controller, and python-control's feedback."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from tests.gearparts.blocks.bench import Driven, close

B = gp.blocks
K, TI, NI, Y_MAX = 100.0, 0.1, 0.1, 12.0


class PIDController(gl.Component):
    """Modelica.Blocks.Examples.PID_Controller: a drive follows a reference speed until its controller meets its limit."""

    def assemble(self) -> list[gl.Connection]:
        self.kinematicPTP = B.KinematicPTP(deltaq=np.pi / 2, qd_max=1.0, qdd_max=1.0, start_time=0.5)
        self.integrator = B.Integrator()
        self.PI = B.LimPID(controller_type="PI", k=K, Ti=TI, Ni=NI, y_max=Y_MAX, start={"x_I": -0.1})
        self.torque, self.inertia1 = gp.Torque(), gp.Inertia(J=1.0, start={"phi": 0.0, "w": 0.0})
        self.spring, self.inertia2 = gp.SpringDamper(c=1e4, d=100.0, start={"phi_rel": 1e-3, "w_rel": 0.0}), gp.Inertia(J=2.0)
        self.load, self.speed = gp.ConstantTorque(tau_constant=10.0), gp.SpeedSensor()
        return [
            gl.connect(self.kinematicPTP.y, self.integrator.u), gl.connect(self.integrator.y, self.PI.u_s),
            gl.connect(self.speed.w, self.PI.u_m), gl.connect(self.PI.y, self.torque.tau),
            gl.connect(self.torque.flange, self.inertia1.flange_a),
            gl.connect(self.inertia1.flange_b, self.spring.flange_a, self.speed.flange),
            gl.connect(self.spring.flange_b, self.inertia2.flange_a), gl.connect(self.inertia2.flange_b, self.load.flange),
        ]  # fmt: skip


# Published reference (modelica/MAP-LIB_ReferenceResults, Modelica/Blocks/Examples/PID_Controller, tolerance 1e-6): time, integral
# part, angle, speed, reference speed, twist of the spring
PUBLISHED = np.array(
    [
        [0.4, -0.1, 0.0, 0.0, 0.0, 1e-3],
        [2.24, -0.0636237918849672, 1.23189119538752, 0.896769835022191, 0.830796326794898, 0.00113333277783474],
        [2.28, -0.051623782997468, 1.26722865754436, 0.870103201841909, 0.790796326794897, 0.00113333300676592],
        [2.32, -0.0396238043534154, 1.30149945287214, 0.84343655876073, 0.750796326794897, 0.00113333347928589],
        [4.0, -0.100004194829465, 1.83633879230247, -8.73419763384692e-06, 0.0, 0.000999965119678185],
    ]
)
SIGNALS = ["PI.x_I", "inertia1.phi", "inertia1.w", "integrator.y", "spring.phi_rel"]


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_the_example_of_modelica_meets_its_published_trajectory(method: str) -> None:
    system = gl.compile(PIDController(), outputs=SIGNALS)
    r = system.simulate(4.0, times=PUBLISHED[:, 0], rtol=1e-8, method=method)
    for name, expected in zip(SIGNALS, PUBLISHED[:, 1:].T, strict=True):
        assert np.abs(r[name] - expected).max() <= 2e-6 * np.abs(expected).max(), name


def by_hand(times: Any) -> Any:
    """Reference speed, integral part, angle and speed of the first body, twist and its rate."""

    def f(t: float, z: Any) -> list[float]:
        reference, integral, _, w, twist, rate = z
        v = K * (reference - w + integral)
        y = min(max(v, -Y_MAX), Y_MAX)
        spring = 1e4 * twist + 100.0 * rate
        a1, a2 = y + spring, (10.0 - spring) / 2.0
        plan = 1.0 if 0.5 <= t < 1.5 else -1.0 if 0.5 + np.pi / 2 <= t < 1.5 + np.pi / 2 else 0.0
        return [plan, (reference - w + (y - v) / (K * NI)) / TI, w, a1, rate, a2 - a1]

    z, found = np.array([0.0, -0.1, 0.0, 0.0, 1e-3, 0.0]), []
    ends = [0.0, 0.5, 1.5, 0.5 + np.pi / 2, 1.5 + np.pi / 2, times[-1]]
    for a, b in zip(ends[:-1], ends[1:], strict=True):
        inner = times[(times >= a) & (times < b)] if b < times[-1] else times[times >= a]
        run = solve_ivp(lambda t, z, m=(a + b) / 2: f(m, z), (a, b), z, "DOP853", rtol=1e-10, atol=1e-13, dense_output=True)
        found.append(run.sol(inner))
        z = run.y[:, -1]
    return np.hstack(found)


def test_the_example_of_modelica_agrees_with_equations_by_hand() -> None:
    times = np.linspace(0.0, 4.0, 161)
    r = gl.simulate(PIDController(), 4.0, times=times, rtol=1e-10)
    reference, integral, phi, w, twist, _ = by_hand(times)
    for name, expected in zip(SIGNALS, (integral, phi, w, reference, twist), strict=True):
        assert np.abs(r[name] - expected).max() <= 1e-7 * np.abs(expected).max(), name
    assert r["PI.y"].max() <= Y_MAX
    assert r["PI.y"].min() == -Y_MAX


@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
def test_a_controller_is_the_sum_of_its_parts_with_the_weights_of_the_set_point(kind: str) -> None:
    """Within its limits: k (wp + 1 / (Ti s) + wd Td s / (1 + Td s / Nd)) from u_s; the measurement has the weights 1."""
    given = {"wp": 0.6} | ({"Ti": 0.4} if "I" in kind else {}) | ({"Td": 0.1, "Nd": 5.0, "wd": 0.3} if "D" in kind else {})
    make = lambda: B.LimPID(controller_type=kind, k=2.0, y_max=1e3, **given)  # noqa: E731
    system, s = gl.compile(Driven(make=make), outputs=["block.y"]), 1j * np.array([0.2, 1.0, 30.0])
    for signal, sign, wp, wd in (("u_s", 1, 0.6, 0.3), ("u_m", -1, 1.0, 1.0)):
        law = wp + (1 / (0.4 * s) if "I" in kind else 0) + (wd * 0.1 * s / (1 + 0.02 * s) if "D" in kind else 0 * s)
        linear = system.linearize([f"block.{signal}"], ["block.y"])
        assert np.asarray([complex(np.squeeze(linear(x))) for x in s]) == pytest.approx(sign * 2.0 * law, rel=1e-9)


def test_a_controller_of_control_in_the_loop_agrees_with_its_feedback() -> None:
    controller = control.ss(control.tf([4.0, 20.0, 30.0], [0.01, 1.0, 0.0]))

    class Servo(gl.Component):
        command = gl.Input("rad", "angle that is asked for")

        def assemble(self) -> list[gl.Connection]:
            self.error = B.Feedback()
            self.controller = B.StateSpace.of(controller)
            self.torque, self.motor, self.shaft = gp.Torque(), gp.Inertia(J=0.5), gp.SpringDamper(c=80.0, d=0.4)
            self.load, self.angle = gp.Inertia(J=0.8), gp.AngleSensor()
            return [
                gl.connect(self.command, self.error.u1), gl.connect(self.angle.phi, self.error.u2),
                gl.connect(self.error.y, self.controller.u), gl.connect(self.controller.y, self.torque.tau),
                gl.connect(self.torque.flange, self.motor.flange_a, self.angle.flange),
                gl.connect(self.motor.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.load.flange_a),
            ]  # fmt: skip

    J, L, c, d = 0.5, 0.8, 80.0, 0.4
    plant = control.tf([L, d, c], [J * L, (J + L) * d, (J + L) * c, 0.0, 0.0])
    loop = control.feedback(plant * controller, 1)
    system = gl.compile(Servo(), outputs=["angle.phi"])
    r = system.simulate(3.0, samples=301, rtol=1e-10, inputs={"command": ([0.0, 0.1, 0.1], [0.0, 0.0, 2.0])})
    assert r.stats["method"] == "exact"
    t = np.linspace(0.0, 2.9, 2901)
    expected = np.concatenate([np.zeros(10), 2.0 * control.forced_response(loop, t, np.ones(2901)).outputs[::10]])
    assert close(r["angle.phi"], expected, 1e-9)
    poles = np.sort_complex(control.poles(system.linearize(["command"], ["angle.phi"])))
    assert poles == pytest.approx(np.sort_complex(control.poles(loop)), rel=1e-6, abs=1e-6)
