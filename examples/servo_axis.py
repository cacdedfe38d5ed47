r"""
A servo axis with friction, backlash and a PID controller
=========================================================

A motor turns a table through a gear with backlash; a PID controller that measures the table's angle moves it from point to point.
Where the guide's dry friction holds the table short of its target, the integral grows until it breaks away, and then it goes too far:
the axis hunts around its target for ever, stick and slip in turn. Without friction a gap alone makes it hunt, quickly and little.

The check is written by hand for SciPy: the same axis without dry friction, whose equations are smooth but for the gap.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp

J_MOTOR, J_TABLE, RATIO = 2.0e-3, 1.2, 20.0
C_GEAR, D_GEAR, GAP = 2.0e5, 150.0, 2.0e-3  # at the table, N.m/rad, N.m.s/rad, rad
K, TI, TD, ND = 60.0, 0.2, 0.05, 6.0  # N.m/rad, s, s, 1
TARGET, D_TABLE = 0.5, 0.6  # rad, N.m.s/rad


class Axis(gl.Component):
    """Motor, gear, gap, table."""

    gap = gl.Parameter("rad", "backlash at the table", default=GAP, min=0)
    friction = gl.Structural(True, "whether the table's guide has dry friction")

    def assemble(self):
        self.motor, self.gear = gp.Inertia(J=J_MOTOR), gp.IdealGear(ratio=RATIO)
        self.flex, self.table = gp.ElastoBacklash(c=C_GEAR, d=D_GEAR, b=self.gap), gp.Inertia(J=J_TABLE)
        self.guide, self.ground = gp.Damper(d=D_TABLE), gp.Fixed()
        self.move = gp.blocks.Ramp(height=TARGET, duration=0.4)
        self.controller = gp.blocks.PID(k=K, Ti=TI, Td=TD, Nd=ND, u=self.move.y - self.table.phi)
        self.drive = gp.Torque(tau=self.controller.y)
        links = [
            gl.connect(self.drive.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.flex.flange_a),
            gl.connect(self.flex.flange_b, self.table.flange_a),
            gl.connect(self.table.flange_b, self.guide.flange_a),
            gl.connect(self.guide.flange_b, self.ground.flange),
        ]
        if self.friction:
            self.dry = gp.BearingFriction(tau_pos=((0.0, 6.0), (5.0, 6.0)), peak=1.5)
            links.append(gl.connect(self.table.flange_b, self.dry.flange_a))
        return links


# %%
# Four axes
# ---------

T_END = 8.0
times = np.linspace(0.0, T_END, 16001)
runs = {}
for friction in (False, True):
    system = gl.compile(Axis(friction=friction), outputs=["table.phi", "drive.tau", "flex.phi_rel", "motor.w", "table.w"])
    for gap in (0.0, GAP):
        runs[friction, gap] = system.simulate(T_END, times=times, rtol=1e-8, parameters={"gap": gap})
for (friction, gap), run in runs.items():
    error = run["table.phi"][-9000:] - TARGET
    print(
        f"dry friction {friction!s:5}, gap {1e3 * gap:g} mrad: stays within {1e3 * np.abs(error).max():.3f} mrad of the target"
    )

# %%
# By hand
# -------


def by_hand(t, x, gap):
    phi_m, w_m, phi, w, integral, lagged = x
    u = min(t / 0.4, 1.0) * TARGET - phi
    tau = K * (u + integral + ND * (u - lagged))
    twist, rate = phi - phi_m / RATIO, w - w_m / RATIO
    pressed, damped = C_GEAR * max(abs(twist) - gap / 2, 0.0), D_GEAR * rate * np.sign(twist)
    force = np.sign(twist) * max(0.0, pressed + min(pressed, damped)) if gap else C_GEAR * twist + D_GEAR * rate
    return [w_m, (tau + force / RATIO) / J_MOTOR, w, (-force - D_TABLE * w) / J_TABLE, u / TI, (u - lagged) * ND / TD]


for gap in (0.0, GAP):
    part = times <= 1.5
    own = solve_ivp(by_hand, (0, 1.5), np.zeros(6), "LSODA", times[part], args=(gap,), rtol=1e-9, atol=1e-11, max_step=2e-3)
    apart = np.abs(own.y[2] - runs[False, gap]["table.phi"][part]).max()
    print(f"gap {1e3 * gap:g} mrad: SciPy's table is at most {apart:.1e} rad elsewhere")
    assert apart < 1e-7

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.2), layout="constrained")
for k, ((friction, gap), run) in enumerate(runs.items()):
    label = f"{'dry friction' if friction else 'smooth'}, {'gap' if gap else 'no gap'}"
    left.plot(times, 1e3 * (run["table.phi"] - TARGET), color=f"C{k}", label=label, lw=1.2)
left.set(xlabel="time, s", ylabel="table beyond the target, mrad", ylim=(-8, 8), xlim=(0.3, T_END))
left.legend(fontsize=8)
hunting = runs[True, GAP]
late = times > 3.0
right.plot(1e3 * (hunting["table.phi"][late] - TARGET), hunting["table.w"][late] * 1e3, lw=1.0, color="C3")
right.set(xlabel="table beyond the target, mrad", ylabel="its speed, mrad/s", title="dry friction and a gap, after 3 s")
