"""Users' scenes measured: gearlib's methods, and SciPy and heyoka with the equations by hand; a table of docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.solvers.problem import Floats
from tests.benchmarks.competitors import Competitor, RunAt, Unavailable
from tests.benchmarks.page import TARGETS, Row, number
from tests.benchmarks.users import USERS, UserScene
from tests.benchmarks.work_precision import best

ALLOWED = 1.3  # of auto's time over that of the best method


def with_gearlib(method: str) -> Callable[[Any], RunAt]:
    """A call of ``simulate``, and reading the outputs."""

    def prepare(scene: UserScene) -> RunAt:
        system = gl.compile(scene.component(), outputs=list(scene.outputs))

        def run(rtol: float) -> Floats:
            try:
                result = system.simulate(
                    scene.times[-1], times=scene.times, inputs=scene.inputs, start=scene.start, method=method, rtol=rtol
                )
            except ArgumentError as reason:
                raise Unavailable(str(reason)) from None
            return np.column_stack([result[name] for name in scene.outputs])

        return run

    return prepare


def with_scipy(method: str) -> Callable[[Any], RunAt]:
    """scipy.integrate.solve_ivp on the equations by hand, in Python."""

    def prepare(scene: UserScene) -> RunAt:
        if scene.by_hand is None:
            raise Unavailable("the scene has tables or events, for which the reference has a loop of its own")
        hand = scene.by_hand
        if hand.minutes:
            raise Unavailable("a run takes minutes")

        def run(rtol: float) -> Floats:
            found = solve_ivp(hand.rhs, scene.times[[0, -1]], hand.start, method, scene.times, rtol=rtol, atol=rtol * 1e-3)
            if not found.success:
                raise Unavailable(found.message)
            return np.asarray(found.y[hand.outputs].T * hand.signs)

        return run

    return prepare


def with_heyoka(scene: UserScene) -> RunAt:
    """heyoka's Taylor method on the equations by hand, compiled."""
    hand = scene.by_hand
    if hand is None or not hand.series:
        raise Unavailable("the equations by hand are not smooth")
    try:
        import heyoka as hy
    except ImportError:
        raise Unavailable("heyoka is not installed") from None
    names = hy.make_vars(*(f"x_{i}" for i in range(hand.start.size)))
    system = list(zip(names, hand.rhs(hy.time, np.array(names, object), hy.sin), strict=True))
    made: dict[float, Any] = {}

    def run(rtol: float) -> Floats:
        if rtol not in made:
            made[rtol] = hy.taylor_adaptive(system, hand.start.tolist(), tol=rtol)
        integrator = made[rtol]
        integrator.time = float(scene.times[0])
        integrator.state[:] = hand.start
        return np.asarray(integrator.propagate_grid(scene.times)[-1][:, hand.outputs] * hand.signs)

    return run


SOLVERS = (
    *(Competitor(f"gearlib {m}", "gearlib", with_gearlib(m)) for m in ("auto", "exact", "rk5", "rk8", "taylor", "ida")),
    *(Competitor(f"SciPy {m}", "other", with_scipy(m)) for m in ("DOP853", "LSODA")),
    Competitor("heyoka", "other", with_heyoka),
)


def table(measured: dict[str, list[Row]]) -> list[str]:
    """Whole calls at equal error, and what is not met."""
    lines = [
        "| scene | error | best method | its time, ms | `auto`, ms | over best | SciPy over `auto` | heyoka over `auto` |",
        "|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    missed = []
    for name, curves in measured.items():
        auto = next(c for c in curves if c.solver == "gearlib auto")
        series = [c for c in curves if c.solver == "heyoka"]
        scipy = [c for c in curves if c not in series]
        methods = [c for c in curves if c.kind == "gearlib" and c is not auto]
        for target in TARGETS:
            ours, picked = best(curves, "gearlib", target), auto.time_to(target)
            which = next((c.solver.removeprefix("gearlib ") for c in methods if c.time_to(target) == ours), "-")
            cells = [USERS[name].title, f"{target:.0e}", which, number(ours, 1e3), number(picked, 1e3), number(picked / ours),
                     *(number(best(rival, "other", target) / picked) for rival in (scipy, series))]  # fmt: skip
            lines.append("| " + " | ".join(cells) + " |")
            if not picked <= ALLOWED * ours:
                missed.append(f"{USERS[name].title} at {target:.0e} ({number(picked / ours)})")
    verdict = f"`auto` takes more than {ALLOWED} times the best method's time on: {'; '.join(missed)}." if missed else (
        f"`auto` is within {ALLOWED} of the best method everywhere."
    )  # fmt: skip
    return [*lines, "", verdict, ""]
