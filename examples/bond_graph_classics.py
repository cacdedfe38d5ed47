r"""
Bond graphs that every textbook has
===================================

A DC motor with a gear, a quarter car, two inertias that turn as one, and a loop of resistances: causality, state equations, and
known results beside them [1]_. At the end the motor's bond graph becomes a component and drives a train made of components.

.. [1] D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, "System Dynamics", 5th ed., Wiley, 2012.
   https://doi.org/10.1002/9781118152812
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import GY, TF, BondGraph, C, I, One, R, RunTime, Se, Sf, Zero, draw, state_equations, time

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)

# %%
# A DC motor with a gear
# ----------------------
# A bond is a number and its two ends; the half arrow points from the first to the second. The gyrator turns current into torque,
# the transformer is a gear. Rotor and load turn together: only one of their inertias stores a state of its own, and the other one
# has derivative causality.

current, rotor, load, gy, tf = One("current"), One("rotor"), One("load"), GY("K"), TF("n")
source, coil, copper, inertia, friction, load_inertia, load_friction = (
    Se("V"), I("L"), R("R_a"), I("J"), R("b"), I("J_load"), R("b_load"),
)  # fmt: skip
motor = BondGraph(
    (1, source, current), (2, current, coil), (3, current, copper), (4, current, gy), (5, gy, rotor), (6, rotor, inertia),
    (7, rotor, friction), (8, rotor, tf), (9, tf, load), (10, load, load_inertia), (11, load, load_friction), name="DC motor",
)  # fmt: skip
equations = state_equations(motor)
print("DC motor with gear")
print(equations.causality.report())

places = {source: (-2, 0), current: (0, 0), coil: (0, 1.3), copper: (0, -1.3), gy: (1.8, 0), rotor: (3.6, 0), inertia: (3.6, 1.3),
          friction: (3.6, -1.3), tf: (5.4, 0), load: (7.2, 0), load_inertia: (7.2, 1.3), load_friction: (7.2, -1.3)}  # fmt: skip
axis = draw(motor, places, causality=equations.causality, scale=0.8)
axis.set_title("DC motor with gear; red: causal strokes, and storage with derivative causality", fontsize=9)
axis.figure.savefig(FIGURES / "bond_graph_motor.png", dpi=90)

# %%
# Explicit state equations, in symbols. Both storages of the load, reflected through the gear, are in the denominator.

for rate, value in equations.explicit().items():
    print(f"  {rate} = {value}")

L, R_a, K, J, b, n, J_load, b_load, V = sp.symbols("L R_a K J b n J_load b_load V", real=True)
i, w = equations.states[0] / L, equations.states[1] / J
textbook = [V - R_a * i - K * w, J * (K * i - (b + n**2 * b_load) * w) / (J + n**2 * J_load)]
same = [sp.simplify(a - b) == 0 for a, b in zip(equations.explicit().values(), textbook)]
print(f"  equal to the textbook's: {all(same)}")

# %%
# A step of 24 V, beside the closed form (the matrix exponential of the second-order system).

values = {"L": 0.012, "R_a": 0.4, "K": 0.21, "J": 0.05, "b": 0.002, "n": 0.25, "J_load": 1.3, "b_load": 0.3, "V": 24.0}
times = np.linspace(0, 0.8, 161)
run = RunTime(equations)
found = solve_ivp(run.bind(values), (0, 0.8), [0, 0], "LSODA", times, rtol=1e-10, atol=1e-12).y
J_all, b_all = 0.05 + 0.25**2 * 1.3, 0.002 + 0.25**2 * 0.3
A = np.array([[-0.4 / 0.012, -0.21 / 0.012, 24 / 0.012], [0.21 / J_all, -b_all / J_all, 0], [0, 0, 0]])
closed = np.array([(expm(A * t) @ [0, 0, 1])[:2] for t in times]).T
speeds = np.array([found[0] / 0.012, found[1] / 0.05])
print(f"  largest difference from the closed form: {abs(speeds - closed).max() / abs(closed).max():.1e}")

# %%
# A quarter car
# -------------
# The road moves the tyre's spring; wheel and body are masses with spring and damper between them. Everything has integral
# causality, and the matrix is the one in every book on vibration.

road, wheel, body, suspension, relative = Zero("tyre"), One("wheel"), One("body"), Zero("suspension"), One("relative")
car = BondGraph(
    (1, Sf(), road), (2, road, C("c_t")), (3, road, wheel), (4, wheel, I("m_u")), (5, wheel, suspension), (6, suspension, relative),
    (7, relative, C("c_s")), (8, relative, R("d")), (9, suspension, body), (10, body, I("m_s")), name="quarter car",
)  # fmt: skip
run = RunTime(state_equations(car))
k_t, m_u, k_s, d, m_s = 1.6e5, 36.0, 1.6e4, 980.0, 240.0
numbers = {"c_t": 1 / k_t, "m_u": m_u, "c_s": 1 / k_s, "d": d, "m_s": m_s}
A, B = run.matrices(numbers)
book = np.array([[0, -1 / m_u, 0, 0], [k_t, -d / m_u, -k_s, d / m_s], [0, 1 / m_u, 0, -1 / m_s], [0, d / m_u, k_s, -d / m_s]])
print(f"\nquarter car\n{run.equations.causality.report()}\n  states: {', '.join(run.states)}")
print(f"  largest difference from the book's matrix: {abs(A - book).max():.1e}")
for pole in np.linalg.eigvals(A):
    if pole.imag > 0:
        print(f"  natural frequency {abs(pole) / (2 * np.pi):6.3f} Hz, damping ratio {-pole.real / abs(pole):.3f}")

drive = run.bind(numbers, inputs={"Sf_1": sp.Piecewise((0.4 * sp.sin(10 * sp.pi * time), time < 0.2), (0, True))})
bump = np.linspace(0, 2, 801)
hit = solve_ivp(drive, (0, 2), np.zeros(4), "LSODA", bump, rtol=1e-9, atol=1e-12, max_step=0.01).y
fig, axes = plt.subplots(1, 3, figsize=(11, 2.9), layout="constrained")
for axis, row, dots, label in zip(axes, closed, speeds, ["current, A", "speed of the motor, rad/s"]):
    axis.plot(times, row, label="closed form")
    axis.plot(times[::8], dots[::8], "k.", ms=3, label="bond graph")
    axis.set(title="DC motor: 24 V at t = 0", xlabel="time, s", ylabel=label)
axes[2].plot(bump, hit[1] / m_u, label="wheel", lw=0.9)
axes[2].plot(bump, hit[3] / m_s, label="body")
axes[2].set(title="quarter car: a bump of 0.2 s", xlabel="time, s", ylabel="vertical velocity, m/s")
for axis in axes:
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
fig.savefig(FIGURES / "bond_graph_classics.png", dpi=90)

# %%
# Two inertias that turn as one
# -----------------------------
# Whichever inertia is preferred becomes the state. The other momentum and its rate are eliminated.

a, b_, pair_tf = One("a"), One("b"), TF("m")
pair = BondGraph(
    (1, Se(), a), (2, a, I()), (3, a, pair_tf), (4, pair_tf, b_), (5, b_, I()), (6, b_, R()), name="pair of inertias"
)
print("\nrigidly coupled pair of inertias")
for bond in (2, 5):
    found = state_equations(pair, prefer=[bond])
    (state,), ((rate, value),) = found.states, found.explicit().items()
    print(f"  state {state}: printed d{state}/dt = {found.printed[state]}")
    print(f"            solved  d{state}/dt = {value}")

# %%
# A loop of resistances
# ---------------------
# A voltage divider feeds a coil. The flow through one resistance depends on the effort of the other and the other way round: an
# algebraic loop, found by its bonds. Linear ones are solved in symbols, others by Newton's method at run time.

mesh, node = One("mesh"), Zero("node")
divider = BondGraph(
    (1, Se("V"), mesh), (2, mesh, R("R_1")), (3, mesh, node), (4, node, R("R_2")), (5, node, I("L")), name="divider"
)
found = state_equations(divider)
(value,) = found.explicit().values()
V, R_1, R_2, L, p = sp.symbols("V R_1 R_2 L p_5", real=True)
print(f"\nloop of resistances\n{found.causality.report()}")
print(f"  dp_5/dt = {value}")
print(
    f"  equal to (V / R_1 - i) R_1 R_2 / (R_1 + R_2): {sp.simplify(value - (V / R_1 - p / L) * R_1 * R_2 / (R_1 + R_2)) == 0}"
)

# %%
# A bond graph among components
# -----------------------------
# `gp.from_bond_graph` makes a component class of a graph. A source without a value can become a flange: here the torque on the
# rotor, where the gear with its load was. The drive is translated like any other model, and gives the same motion as above.

shaft = Se()
bare = BondGraph(
    (1, Se(), current), (2, current, coil), (3, current, copper), (4, current, gy), (5, gy, rotor), (6, rotor, inertia),
    (7, rotor, friction), (8, shaft, rotor), name="DC motor",
)  # fmt: skip
Motor = gp.from_bond_graph(bare, ports={"shaft": 8})


class Drive(gl.Component):
    """The motor is a bond graph; gear, load and friction are components."""

    def assemble(self):
        self.motor = Motor(Se_1=24.0, **{name: values[name] for name in ("L", "R_a", "K", "J", "b")})
        self.gear, self.load = gp.IdealGear(ratio=1 / values["n"]), gp.Inertia(J=values["J_load"])
        self.friction, self.ground = gp.Damper(d=values["b_load"]), gp.Fixed()
        return [
            gl.connect(self.motor.shaft, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.friction.flange_a),
            gl.connect(self.friction.flange_b, self.ground.flange),
        ]


result = gl.simulate(Drive(), t_end=0.8, samples=161, rtol=1e-10)
difference = max(abs(result["motor.f_2"] - closed[0]).max(), abs(result["motor.f_6"] - closed[1]).max())
print(f"\nmotor as a component: largest difference from the closed form {difference / abs(closed).max():.1e}")
plt.show()
