"""The other solvers: SciPy, CasADi, heyoka and rumoca on the benchmark's scenes.

``prepare(scene)`` does everything that is done once (compiling, too) and returns a function of the tolerance that returns the
scene's outputs. It raises `Unavailable` where a package is missing or cannot do a scene; the tables say so.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import diags_array

from gearlib.solvers.problem import Floats
from tests.benchmarks.equations import ByHand
from tests.benchmarks.references import BenchScene, flank_event

RunAt = Callable[[float], Floats]
BANDED_FROM = 50  # states


class Unavailable(Exception):
    """A competitor that is not installed, or cannot do a scene."""


@dataclass(frozen=True)
class Competitor:
    """A solver and how it gets at a scene."""

    name: str
    kind: str  # "floor", "IDA floor", "gearlib", "acausal" or "other"
    prepare: Callable[[BenchScene], RunAt]


def scipy_with(method: str) -> Callable[[BenchScene], RunAt]:
    """scipy.integrate.solve_ivp with the numba right-hand side; band or sparsity of the Jacobian where there are many states."""

    def prepare(scene: BenchScene) -> RunAt:
        hand = scene.by_hand()
        n, options = hand.x0.size, {}

        def f(t: float, x: Floats) -> Floats:
            dx = np.empty(n)
            hand.rhs(t, x, dx, hand.data, hand.index)
            return dx

        if hand.band is not None and n > BANDED_FROM and method == "LSODA":
            options = {"lband": hand.band[0], "uband": hand.band[1]}
        if hand.band is not None and n > BANDED_FROM and method == "Radau":
            offsets = range(-hand.band[0], hand.band[1] + 1)
            options = {"jac_sparsity": diags_array([np.ones(n - abs(k)) for k in offsets], offsets=list(offsets))}

        def run(rtol: float) -> Floats:
            found = solve_ivp(
                f,
                scene.times[[0, -1]],
                hand.x0,
                method,
                scene.times,
                rtol=max(rtol, 2.3e-14),
                atol=rtol * hand.nominal,
                **options,
            )
            if not found.success:
                raise Unavailable(found.message)
            return np.asarray(found.y.T @ hand.outputs.T)

        return run

    return prepare


def casadi_with(plugin: str) -> Callable[[BenchScene], RunAt]:
    """CasADi's interface to SUNDIALS, states scaled by their nominal values, compiled with the C compiler where there is one."""

    def prepare(scene: BenchScene) -> RunAt:
        try:
            import casadi as ca
        except ImportError:
            raise Unavailable("CasADi is not installed") from None
        hand = scene.by_hand()
        n = hand.x0.size
        z, t = ca.SX.sym("z", n), ca.SX.sym("t")
        states = [z[i] * float(hand.nominal[i]) for i in range(n)]

        def contact(x: Any, v: Any) -> Any:
            side = ca.sign(x)
            return ca.if_else(ca.fabs(x) > 50e-6, 2e8 * (x - side * 50e-6) + 2000.0 * v, 0.0)

        derivatives = hand.symbolic(states, t, SimpleNamespace(sin=ca.sin, cos=ca.cos, contact=contact))
        ode = ca.vertcat(*(d / float(s) for d, s in zip(derivatives, hand.nominal, strict=True)))
        compiled: dict[str, Any] = {}
        if shutil.which("cc") is not None and n <= 200:
            flags = {"flags": ["-O3", "-march=native"], "compiler": "cc", "cleanup": False}
            compiled = {"jit": True, "compiler": "shell", "jit_options": flags, "jit_temp_suffix": True, "jit_cleanup": False}
        made: dict[float, Any] = {}

        def run(rtol: float) -> Floats:
            if rtol not in made:
                options = {"reltol": rtol, "abstol": rtol, "max_num_steps": 10**7, **compiled}
                with tempfile.TemporaryDirectory() as folder, chdir(folder):
                    made[rtol] = ca.integrator("run", plugin, {"x": z, "t": t, "ode": ode}, 0.0, scene.times[1:], options)
            try:
                found = np.array(made[rtol](x0=hand.x0 / hand.nominal)["xf"]).T
            except RuntimeError as problem:
                raise Unavailable(str(problem).strip().splitlines()[-1][:80]) from None
            return np.asarray(np.vstack([hand.x0, found * hand.nominal]) @ hand.outputs.T)

        return run

    return prepare


def heyoka_taylor(scene: BenchScene) -> RunAt:
    """heyoka's Taylor method; backlash by terminal events that switch parameters."""
    try:
        import heyoka as hy
    except ImportError:
        raise Unavailable("heyoka is not installed") from None
    hand = scene.by_hand()
    names = hy.make_vars(*(f"x_{i}" for i in range(hand.x0.size)))

    def contact(x: Any, v: Any) -> Any:  # par[0]: whether in contact, par[1]: the flank's place
        return hy.par[0] * (2e8 * (x - hy.par[1]) + 2000.0 * v)

    derivatives = hand.symbolic(names, hy.time, SimpleNamespace(sin=hy.sin, cos=hy.cos, contact=contact))
    system = list(zip(names, derivatives, strict=True))
    options: dict[str, Any] = {"compact_mode": hand.x0.size > BANDED_FROM}
    if scene.name == "M3":
        options["t_events"] = [flank_event(hy, names[0], side) for side in (1.0, -1.0)]
        options["pars"] = [0.0, 0.0]
    made: dict[float, Any] = {}

    def run(rtol: float) -> Floats:
        if rtol not in made:
            # events are located as well as the tolerance allows: the coarser ones lose them
            made[rtol] = hy.taylor_adaptive(
                system, hand.x0.tolist(), tol=1e-6 * rtol if scene.name == "M3" else rtol, **options
            )
        integrator = made[rtol]
        integrator.time = float(scene.times[0])
        integrator.state[:] = hand.x0
        integrator.pars[:] = 0.0
        if scene.name == "M3":
            integrator.reset_cooldowns()
            integrator.state[0] -= 1e-19  # off the flank that it starts to leave
        return np.asarray(integrator.propagate_grid(scene.times)[-1] @ hand.outputs.T)

    return run


def rumoca_with(solver: str) -> Callable[[BenchScene], RunAt]:
    """rumoca, a Modelica compiler, on the same equations in Modelica."""

    def prepare(scene: BenchScene) -> RunAt:
        try:
            import rumoca
        except ImportError:
            raise Unavailable("rumoca is not installed") from None
        try:
            model = rumoca.Session().loads(scene.modelica(), model="Scene")
        except rumoca.RumocaError as problem:
            raise Unavailable(f"does not compile: {str(problem)[:60]}") from None
        names, step = modelica_names(scene), float(scene.times[1] - scene.times[0])
        span = (float(scene.times[0]), float(scene.times[-1]))

        def run(rtol: float) -> Floats:
            config = rumoca.SimConfig(solver=solver, rtol=rtol, atol=rtol * 1e-4, max_wall_seconds=60.0)
            try:
                found = model.simulate(span, dt=step, config=config)
            except rumoca.RumocaError as problem:
                raise Unavailable(f"fails: {str(problem)[:60]}") from None
            values = np.column_stack([np.asarray(found[name]) for name in names])
            if len(values) != len(scene.times):
                time = np.asarray(found.time)
                values = values[np.searchsorted(time, scene.times - 1e-9 * step)]
            return values @ modelica_outputs(scene.by_hand(), scene).T

        return run

    return prepare


def modelica_names(scene: BenchScene) -> list[str]:
    """What the Modelica text calls the outputs (or, written out densely, the states)."""
    if scene.name.startswith("M1"):
        return [f"w[{int(name.split('[')[1].split(']')[0]) + 1}]" for name in scene.outputs]
    if scene.name == "M2":
        return ["wc", "wl"]
    if scene.name == "M3":
        return ["x"]
    return [f"x{i}" for i in range(scene.by_hand().x0.size)]


def modelica_outputs(hand: ByHand, scene: BenchScene) -> Floats:
    return hand.outputs if scene.name.startswith("XP") else np.eye(len(scene.outputs))


@cache
def others() -> tuple[Competitor, ...]:
    """All of them, installed or not."""
    return (
        *(Competitor(f"SciPy {m}", "other", scipy_with(m)) for m in ("LSODA", "Radau", "DOP853")),
        *(Competitor(f"CasADi {p}", "other", casadi_with(p)) for p in ("idas", "cvodes")),
        Competitor("heyoka", "other", heyoka_taylor),
        *(Competitor(f"rumoca {s}", "acausal", rumoca_with(s)) for s in ("rk-like", "bdf")),
    )
