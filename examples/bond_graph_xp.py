r"""
The bond graph of the XP single-loop train
==========================================

Zhou and Cui (2022) [1]_ draw the train as a bond graph and read its state equations from it. Here the graph is put together
again, causality is assigned, the equations are derived from it, and all is compared: with the printed equations, with any other
choice of states, and with the train made of components, whose equations are found by index reduction and share no code with
these.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import RunTime, assign_causality, state_equations
from gearparts.trains import zhou_cui_2022
from gearparts.trains.paper_graphs import PREFERENCE, single_loop_train
from gearparts.trains.structure_diagram import single_loop, unit_diagram

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)

# %%
# Structure
# ---------
# A P unit (a pair on fixed axes) is a square with two shafts, an X unit (a planetary differential) a circle with three. Two units
# whose shafts meet in two nodes make a single loop; the paper's train is XP.

fig, axes = plt.subplots(1, 5, figsize=(13, 2.6), width_ratios=[1, 1, 1.6, 1.6, 1.6], layout="constrained")
for axis, diagram in zip(axes, [unit_diagram("P"), unit_diagram("X"), *map(single_loop, ["XP", "PX", "XX"])]):
    diagram.draw(axis)
    print(f"{diagram.name}: loops {diagram.loops}, degrees of freedom {diagram.degrees_of_freedom}")
fig.savefig(FIGURES / "structure_diagrams.png", dpi=90)

# %%
# Causality
# ---------
# The sequential procedure gives integral causality to one storage element after the other, in an order of preference, with all
# that follows. With the paper's order it finds the paper's eight states; ten inertias follow them rigidly.

figure = single_loop_train()
causality = assign_causality(figure.graph, PREFERENCE)
print(f"\n{causality.report()}")
axis = figure.draw(causality)  # sphinx_gallery_thumbnail_number = 2
axis.figure.savefig(FIGURES / "bond_graph_xp.png", dpi=90)
axis.figure.savefig(FIGURES / "bond_graph_xp.svg")  # the same, readable at any size

# %%
# Equations
# ---------
# The equations in the paper's form: rates of the dependent momenta stand on the right. As LaTeX: ``equations.latex()``.

equations = state_equations(figure.graph, causality=causality)
for state, rate in equations.printed.items():
    print(f"\nd{state}/dt = {rate}")
print()
for momentum, value in equations.dependent_values.items():
    print(f"{momentum} = {value}")

# %%
# Three roads
# -----------
# The mass matrix of the solved form is inverted for numbers. The printed equations with their repairs, and the train of components
# through index reduction, must give the same linear system.

params = zhou_cui_2022.bond_parameters()
numbers = {f"m_{k}": params.m[k] for k in range(1, 23) if k != 7}
for kind in "IRC":
    numbers |= {f"{kind}_{bond}": value for bond, value in getattr(params, kind).items()}
run = RunTime(equations)
A, B = run.matrices({name: numbers[name] for name in run.parameters})
A_printed, _ = zhou_cui_2022.explicit_matrices(params)
order = [run.states.index(f"{name[0]}_{name[1:]}") for name in zhou_cui_2022.STATES]
system = gl.compile(gp.ZhouCui2022(tau_in=100.0), ["w_in", "w_out", "q_ring"])
linear = system.linearize(["tau_in"], sparse=True)


def by_size(matrix):
    eigenvalues = np.linalg.eigvals(matrix)
    return eigenvalues[np.lexsort((eigenvalues.imag, abs(eigenvalues).round(6)))]


difference = abs(A[np.ix_(order, order)] - A_printed) / abs(A_printed).max(axis=1, keepdims=True)
print(
    f"\nmatrix of the bond graph: largest difference from the printed equations, by the row's largest entry: {difference.max():.0e}"
)
print("\neigenvalues, 1/s: bond graph, then relative differences of the printed equations and of the components")
for one, two, three in zip(by_size(A), by_size(A_printed), by_size(linear.A)):
    print(f"  {one:24.6f} {abs(two / one - 1):9.0e} {abs(three / one - 1):9.0e}")

# %%
# Another order of preference gives other states and the same system.

other = RunTime(state_equations(figure.graph))
A_other, _ = other.matrices({name: numbers[name] for name in other.parameters})
print(f"\nlowest bond first: {', '.join(other.states)}")
print(f"largest relative difference of an eigenvalue: {abs(by_size(A_other) / by_size(A) - 1).max():.0e}")

# %%
# Frequency responses from the torque on the ring to the speed of the carrier.

omega = 2 * np.pi * np.logspace(-2, 3.7, 600)
w_out = np.zeros(8)
w_out[run.states.index("p_78")] = -1 / params.m[22] / params.I[78]
torque = B[:, run.inputs.index("Se_1")]
of_graph = np.array([w_out @ np.linalg.solve(1j * w * np.eye(8) - A, torque) for w in omega])
of_parts = np.array([(linear.C @ np.linalg.solve(1j * w * np.eye(8) - linear.A, linear.B))[1, 0] for w in omega])
print(f"\nfrequency response: largest relative difference {abs(of_parts / of_graph - 1).max():.0e}")

fig, axis = plt.subplots(figsize=(7, 3.2), layout="constrained")
axis.loglog(omega / (2 * np.pi), abs(of_graph), lw=4, color="#e8b35c", label="bond graph")
axis.loglog(omega / (2 * np.pi), abs(of_parts), lw=1, color="tab:blue", label="components")
axis.set(
    xlabel="frequency, Hz", ylabel="|w_out / tau_in|, rad/(N.m.s)", title="XP train: torque on the ring to speed of the carrier"
)
axis.grid(alpha=0.3, which="both")
axis.legend()
fig.savefig(FIGURES / "bond_graph_xp_response.png", dpi=90)
plt.show()
