"""The benchmark's scenes in Modelica, without the standard library: as flat equations, for rumoca."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.benchmarks.equations import ByHand


def chain(n: int) -> str:
    """M1, connected: every body with its two torques, every shaft with its twist."""
    return f"""
model Scene
  parameter Integer N = {n};
  parameter Real c = 1e5; parameter Real d = 5; parameter Real drag = 1;
  Real w[N](each start = 0, each fixed = true); Real q[N - 1](each start = 0, each fixed = true); Real tau[N + 1];
equation
  tau[1] = 100 * sin(2 * 3.141592653589793 * 50 * time);
  for i in 1:N loop
    0.01 * (1 + (i - 1) / N) * der(w[i]) = tau[i] - tau[i + 1];
  end for;
  for i in 1:N - 1 loop
    der(q[i]) = w[i] - w[i + 1];
    tau[i + 1] = c * q[i] + d * (w[i] - w[i + 1]);
  end for;
  tau[N + 1] = drag * w[N];
end Scene;
"""


def loop() -> str:
    """M2, each gear with its own equations."""
    return """
model Scene
  Real wm; Real ws; Real wr; Real wc(start = 0, fixed = true); Real wl(start = 0, fixed = true); Real q(start = 0, fixed = true);
  Real ta; Real tb; Real tr; Real ts; Real tc; Real tg; Real th; Real tk;
  parameter Real rho = 81 / 19;
equation
  0.01 * der(wm) = 10 + 5 * sin(20 * 3.141592653589793 * time) - ta;
  wm = 3 * ws; tb = 3 * ta;
  0.025 * der(ws) = tb - ts;
  (1 + rho) * wc = ws + rho * wr;
  tr = rho * ts; tc = (1 + rho) * ts;
  0.1 * der(wr) = -tr - tg;
  wr = 0.5 * wc; th = 0.5 * tg;
  0.05 * der(wc) = tc + th - tk;
  der(q) = wc - wl;
  tk = 1e4 * q + 10 * (wc - wl);
  2 * der(wl) = tk - 0.05 * wl * abs(wl);
end Scene;
"""


def pair() -> str:
    """M3, its contact as an if-expression that makes events."""
    return """
model Scene
  Real x(start = 50e-6, fixed = true); Real th(start = 0, fixed = true);
  Real w1(start = 800, fixed = true); Real w2(start = 400, fixed = true); Real v; Real F;
equation
  der(th) = w1;
  der(x) = v;
  v = 0.05 * w1 - 0.1 * w2 - 2e-4 * cos(20 * th) * w1;
  F = if x > 50e-6 then 2e8 * (x - 50e-6) + 2000 * v else if x < -50e-6 then 2e8 * (x + 50e-6) + 2000 * v else 0;
  0.001 * der(w1) = 40 - 0.002 * (w1 - 800) - 0.05 * F;
  0.016 * der(w2) = 0.1 * F - 80;
end Scene;
"""


def dense(hand: ByHand) -> str:
    """Linear equations x' = A x + b + r cos(omega t + phase), written out."""
    n, data = hand.x0.size, hand.data.tolist()
    lines = []
    for i in range(n):
        terms = [f"({data[2 + 2 * n + j * n + i]!r}) * x{j}" for j in range(n) if data[2 + 2 * n + j * n + i] != 0.0]
        drive = f"({data[2 + i]!r}) + ({data[2 + n + i]!r}) * cos({data[0]!r} * time + {data[1]!r})"
        lines.append(f"  der(x{i}) = {' + '.join([*terms, drive])};")
    states = "\n".join(f"  Real x{i}(start = 0, fixed = true);" for i in range(n))
    return f"model Scene\n{states}\nequation\n" + "\n".join(lines) + "\nend Scene;\n"
