"""Models of any size: a chain, a star of planetary sets, a random tree of gears with loops, many trains side by side."""

from __future__ import annotations

import random

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import expm_multiply

import gearlib as gl
import gearparts as gp

C, D, DRAG, AMPLITUDE, OMEGA = 1e5, 5.0, 1.0, 100.0, 2 * np.pi * 50  # of the chain: N.m/rad, N.m.s/rad, N.m.s/rad, N.m, rad/s


class Chain(gl.Component):
    """N inertias joined by N - 1 spring-dampers, a sinusoidal torque on the first, a damper to ground on the last."""

    N = gl.Structural(10)

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=100 * gl.sin(2 * gl.pi * 50 * gl.time))
        self.body = [gp.Inertia(J=0.01 * (1 + i / self.N)) for i in range(self.N)]
        self.shaft = [gp.SpringDamper(c=1e5, d=5.0) for _ in range(self.N - 1)]
        self.drag = gp.Damper(d=1.0)
        self.ground = gp.Fixed()
        links = [gl.connect(self.torque.flange, self.body[0].flange_a)]
        for left, shaft, right in zip(self.body[:-1], self.shaft, self.body[1:], strict=True):
            links += [gl.connect(left.flange_b, shaft.flange_a), gl.connect(shaft.flange_b, right.flange_a)]
        links += [gl.connect(self.body[-1].flange_b, self.drag.flange_a), gl.connect(self.drag.flange_b, self.ground.flange)]
        return links


def chain_speeds(n: int, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Speeds of the chain's inertias at equidistant times, shape (times, n): the matrix exponential of equations written by hand.

    The states are the twists times sqrt(c / J_0), which keeps the matrix's norm small, the speeds, and sine and cosine of the torque.
    """
    J = 0.01 * (1 + np.arange(n) / n)
    scale = np.sqrt(C / J[0])
    twist = sparse.diags([1.0, -1.0], [0, 1], shape=(n - 1, n))  # its rate is the difference of two speeds
    inverse = sparse.diags(1 / J)
    drag = sparse.csr_matrix(([DRAG], ([n - 1], [n - 1])), shape=(n, n))
    drive = sparse.csr_matrix(([AMPLITUDE / J[0]], ([0], [0])), shape=(n, 2))
    A = sparse.bmat(
        [
            [None, scale * twist, None],
            [-C / scale * inverse @ twist.T, -inverse @ (D * twist.T @ twist + drag), drive],
            [None, None, OMEGA * np.array([[0.0, 1.0], [-1.0, 0.0]])],
        ],
        format="csr",
    )
    start = np.zeros(2 * n + 1)
    start[-1] = 1.0  # cosine
    x = expm_multiply(A, start, start=times[0], stop=times[-1], num=len(times), endpoint=True)
    return np.asarray(x[:, n - 1 : 2 * n - 1], float)


class Star(gl.Component):
    """N planetary sets with their suns on one driven hub, their rings held by springs, a load on each carrier."""

    N = gl.Structural(20)

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=10 * gl.sin(2 * gl.pi * 5 * gl.time))
        self.hub = gp.Inertia(J=0.1)
        self.planetary = [gp.IdealPlanetary(ratio=2 + i / self.N) for i in range(self.N)]
        self.load = [gp.Inertia(J=0.05 * (1 + i / self.N)) for i in range(self.N)]
        self.spring = [gp.SpringDamper(c=1e4, d=1.0) for _ in range(self.N)]
        self.ground = gp.Fixed()
        links = [gl.connect(self.torque.flange, self.hub.flange_a)]
        for planetary, load, spring in zip(self.planetary, self.load, self.spring, strict=True):
            links += [gl.connect(self.hub.flange_b, planetary.sun), gl.connect(planetary.carrier, load.flange_a)]
            links += [gl.connect(planetary.ring, spring.flange_a), gl.connect(spring.flange_b, self.ground.flange)]
        return links


class Tree(gl.Component):
    """N bodies joined by gears to a random tree, with one more gear for every twenty bodies, which closes a loop.

    A gear's far side is rigid (with probability ``rigid``) or elastic. A loop of rigid gears gets the ratio that lets it turn.
    """

    N = gl.Structural(100)
    seed = gl.Structural(1)
    rigid = gl.Structural(0.5)

    def assemble(self) -> list[gl.Connection]:
        rng = random.Random(self.seed)
        n = self.N
        self.torque = gp.Torque(tau=10 * gl.sin(2 * gl.pi * 5 * gl.time))
        self.body = [gp.Inertia(J=0.01 * (1 + rng.random())) for _ in range(n)]
        links = [gl.connect(self.torque.flange, self.body[0].flange_a)]
        gears, shafts = [], []
        speed, cluster = (
            [1.0],
            [0],
        )  # of each body: what it turns at when the first turns at 1; the rigid part that it belongs to

        def join(a: int, b: int, ratio: float, rigid: bool) -> None:
            gears.append(gp.IdealGear(ratio=ratio))
            links.append(gl.connect(self.body[a].flange_b, gears[-1].flange_a))
            if rigid:
                links.append(gl.connect(gears[-1].flange_b, self.body[b].flange_a))
            else:
                shafts.append(gp.SpringDamper(c=1e4, d=1.0))
                links.extend([gl.connect(gears[-1].flange_b, shafts[-1].flange_a),
                              gl.connect(shafts[-1].flange_b, self.body[b].flange_a)])  # fmt: skip

        for b in range(1, n):
            a, ratio, rigid = rng.randrange(max(0, b - 20), b), rng.choice([-1.25, -0.8, -1.0]), rng.random() < self.rigid
            join(a, b, ratio, rigid)
            speed.append(speed[a] / ratio)
            cluster.append(cluster[a] if rigid else b)
        for _ in range(n // 20):
            a, b = sorted(rng.sample(range(n), 2))
            join(a, b, speed[a] / speed[b], cluster[a] == cluster[b])
        self.gear, self.shaft = gears, shafts
        self.drag, self.ground = gp.Damper(d=0.1), gp.Fixed()
        links += [gl.connect(self.body[-1].flange_b, self.drag.flange_a), gl.connect(self.drag.flange_b, self.ground.flange)]
        return links


class Trains(gl.Component):
    """N complete systems of the paper, independent of each other."""

    N = gl.Structural(100)

    def assemble(self) -> list[gl.Connection]:
        self.train = [gp.ZhouCui2022(tau_in=100.0) for _ in range(self.N)]
        return []


def rumoca_components(n: int) -> str:
    """The chain in Modelica, put together from components as gearlib's is."""
    return f"""
connector Flange Real phi; flow Real tau; end Flange;
model Inertia
  Flange a; Flange b; parameter Real J; Real phi; Real w;
equation
  phi = a.phi; phi = b.phi; der(phi) = w; J*der(w) = a.tau + b.tau;
end Inertia;
model SpringDamper
  Flange a; Flange b; parameter Real c; parameter Real d; Real phi_rel; Real w_rel; Real tau;
equation
  phi_rel = b.phi - a.phi; der(phi_rel) = w_rel; tau = c*phi_rel + d*w_rel; b.tau = tau; a.tau = -tau;
end SpringDamper;
model Torque Flange b; equation b.tau = -{AMPLITUDE}*sin({OMEGA!r}*time); end Torque;
model Drag Flange a; parameter Real d; equation a.tau = d*der(a.phi); end Drag;
model Chain
  parameter Integer N = {n};
  Torque torque;
  Inertia body[N](J = {{0.01*(1 + (i - 1)/N) for i in 1:N}});
  SpringDamper shaft[N-1](each c = {C}, each d = {D});
  Drag drag(d = {DRAG});
equation
  connect(torque.b, body[1].a);
  for i in 1:N-1 loop
    connect(body[i].b, shaft[i].a);
    connect(shaft[i].b, body[i+1].a);
  end for;
  connect(body[N].b, drag.a);
end Chain;
"""


def rumoca_equations(n: int) -> str:
    """The chain in Modelica as 3 n - 1 equations, already flat: nothing to connect, no alias, no index to reduce."""
    lines = ["model Chain", f"  parameter Real c = {C}; parameter Real d = {D};"]
    lines += [f"  parameter Real J{i} = {0.01 * (1 + i / n)!r}; Real phi{i}; Real w{i};" for i in range(n)]
    lines += [f"  Real tau{i};" for i in range(n - 1)] + ["equation"]
    before = f"{AMPLITUDE}*sin({OMEGA!r}*time)"
    for i in range(n):
        after = f"tau{i}" if i < n - 1 else f"{DRAG}*w{i}"
        lines.append(f"  der(phi{i}) = w{i}; J{i}*der(w{i}) = {before} - {after};")
        if i < n - 1:
            lines.append(f"  tau{i} = c*(phi{i} - phi{i + 1}) + d*(w{i} - w{i + 1});")
        before = after
    return "\n".join([*lines, "end Chain;", ""])
