"""Runs per second: ``python -m tests.benchmarks.many_runs 2048`` writes the tables of docs/many_runs.md, and prints another.

The XP train (8 states, 0.5 s, rtol 1e-6): a loop over `System.simulate`, sweeps in this process (one after another, in lanes, by matrix
exponentials), by threads, by processes and on dask (where it is installed), and SciPy, joblib and heyoka beside them. Then the scenes of
the work-precision page, one after another and side by side. The times are the least of some repetitions, in one process.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp
from tests.measured import Part, table

T_END, SAMPLES = 0.5, 501
INPUTS = {"tau_in": 100.0}


def least(function: Callable[[], Any], count: int, repeat: int = 3) -> float:
    """Microseconds a run."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / count


def ways(system: gl.System, K_g: Any, method: str) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Ways to carry out the same runs."""
    options: dict[str, Any] = {"samples": SAMPLES, "method": method, "inputs": INPUTS}

    def loop() -> None:
        for value in K_g.tolist():
            system.simulate(T_END, parameters={"K_g": value}, **options)["w_out"]

    def sweep(**more: Any) -> Callable[[], Any]:
        return lambda: system.sweep({"K_g": K_g}, T_END, outputs=["w_out"], **options, **more)

    yield "loop over simulate", loop
    yield "sweep, one run after another", sweep(lanes=1)
    yield "sweep", sweep()
    yield "sweep, end values", lambda: system.sweep({"K_g": K_g}, T_END, reduce={"end": gl.final("w_out")}, **options)
    yield "sweep, peaks", lambda: system.sweep({"K_g": K_g}, T_END, reduce={"peak": gl.peak("w_out")}, **options)
    yield (
        "sweep, end values by a function of the result",
        lambda: system.sweep({"K_g": K_g}, T_END, reduce={"end": end}, **options),
    )
    if importlib.util.find_spec("joblib") is not None:
        from joblib import Parallel, delayed

        def one(value: float) -> float:
            return end(system.simulate(T_END, parameters={"K_g": value}, **options))

        yield "joblib, 2 processes, end values", lambda: Parallel(2)(delayed(one)(value) for value in K_g.tolist())
    for threads in (2, 4):
        yield f"sweep, {threads} threads", sweep(threads=threads)
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
        yield "sweep, 2 processes", sweep(executor=pool)
    if importlib.util.find_spec("distributed") is not None:
        from distributed import Client, LocalCluster

        cluster = LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None)
        with cluster, Client(cluster) as client, client.get_executor() as executor:
            yield "sweep, dask with 2 workers", sweep(executor=executor)


def end(result: gl.Result) -> float:
    return float(result["w_out"][-1])


def others(system: gl.System, count: int) -> Iterator[tuple[str, Callable[[], Any]]]:
    """SciPy and heyoka on the same linear equations."""
    from scipy.integrate import solve_ivp

    linear = system.linearize(["tau_in"], ["w_out"], sparse=True)
    A, b = np.asarray(linear.A), np.asarray(linear.B)[:, 0] * INPUTS["tau_in"]
    times = np.linspace(0.0, T_END, SAMPLES)

    def scipy_loop() -> None:
        for _ in range(count):
            solve_ivp(lambda t, x: A @ x + b, (0.0, T_END), np.zeros(len(A)), "RK45", times, rtol=1e-6, atol=1e-9)

    yield "SciPy RK45, a loop", scipy_loop
    if importlib.util.find_spec("heyoka") is not None:
        import heyoka as hy

        x = hy.make_vars(*[f"x{i}" for i in range(len(A))])
        right = [(x[i], sum((A[i, j] * x[j] for j in range(len(A)) if A[i, j]), hy.expression(b[i]))) for i in range(len(A))]
        one = hy.taylor_adaptive(right, [0.0] * len(A), tol=1e-6)
        eight = hy.taylor_adaptive_batch(right, np.zeros((len(A), 8)), tol=1e-6)

        def scalar() -> None:
            for _ in range(count):
                one.time, one.state[:] = 0.0, 0.0
                one.propagate_until(T_END)

        def batch() -> None:
            for _ in range(-(-count // 8)):
                eight.set_time(0.0)
                eight.state[:] = 0.0
                eight.propagate_until(T_END)

        yield "heyoka, end value (without transmission error)", scalar
        yield "heyoka, batches of 8, end value", batch


def scenes(count: int) -> Iterator[tuple[str, str, Callable[[], Any], int]]:
    """Sweeps of the scenes of the work-precision page: name, way, what does it, number of runs."""
    from tests.benchmarks.contestants import START, TURNED, compiled
    from tests.benchmarks.references import SCENES

    for name in ("XP", "M1-10", "M2", "M3"):
        system, times, turned = compiled(name), SCENES[name].times, TURNED[name[:2]]
        values = system.parameters[turned] * np.linspace(0.9, 1.1, count)
        few = max(8, count // 16)
        ways: list[tuple[str, int, dict[str, Any]]] = [("rk5, one after another", few, {"method": "rk5", "lanes": 1})]
        ways += [("rk5", count, {"method": "rk5"}), ("auto", count, {})]
        for way, runs, more in ways:
            given = {"times": times, "start": START.get(name), "outputs": list(SCENES[name].outputs), **more}
            chosen = values[:: count // runs][:runs]
            yield name, way, lambda s=system, t=turned, v=chosen, g=given, e=times[-1]: s.sweep({t: v}, e, **g), len(chosen)  # type: ignore[misc]


FAST, EXACT, ANCHOR = 10.0, 30.0, 47.0
"""Aims: lanes against a loop; us a run of a linear sweep where heyoka's batches take `ANCHOR`."""


def text(kept: dict[str, Any]) -> str:
    """The table, and what was aimed at."""
    us = {(r["way"], r["method"]): r["us"] for r in kept["rows"]}
    rows = [[way, method and f'`"{method}"`', f"{value:.0f}"] for (way, method), value in us.items()]
    first = table([f"{kept['count']} runs of the XP train", "method", "us a run"], rows)
    return f"{first}\n\n{table(['aimed at', 'reached', 'why not'], list(aims(us, kept.get('scenes', []))))}"


def aims(us: Mapping[tuple[str, str], float], scenes: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """What was aimed at, what is reached, and why not."""
    loop, lanes = us["loop over simulate", "rk5"], us["sweep", "rk5"]
    slow = "eight lanes are two vectors of this processor" if loop < FAST * lanes else ""
    yield [f"XP, lanes: {FAST:.0f} times as fast as a loop over `simulate`", f"{loop / lanes:.1f} times", slow]
    alone = {row["name"]: row["us"] for row in scenes if row["way"] == "rk5, one after another"}
    for row in scenes:
        if row["way"] != "rk5" or row["name"] == "XP":
            continue
        gain = alone[row["name"]] / row["us"]
        why = (
            ""
            if gain >= FAST
            else f"not in lanes: {row['how']}"
            if "lanes" not in row["how"]
            else "eight lanes are two vectors of this processor, and preparing a run in Python remains"
        )
        yield [f"{row['name']}, lanes: {FAST:.0f} times as fast as one after another", f"{gain:.1f} times", why]
    batch = us.get(("heyoka, batches of 8, end value", ""))
    if batch is not None:
        share = us["sweep, end values", "rk5"] / batch
        why = "" if share <= 1.0 else "some 1900 steps of six evaluations; heyoka's Taylor series takes fewer and longer ones"
        yield ["XP, end values: not slower than heyoka's batches of 8", f"{share:.2f} of their time", why]
    for way in ("sweep, end values", "sweep, peaks"):
        found = us[way, "auto"]
        why = (
            "" if found <= EXACT else "501 samples of each run are computed" if "peaks" in way else "products of small matrices"
        )
        more = "" if batch is None else f", {found / batch:.2f} of heyoka's time (aim: {EXACT / ANCHOR:.2f})"
        yield [f"XP, exponentials, {way.removeprefix('sweep, ')}: at most {EXACT:.0f} us", f"{found:.0f} us{more}", why]


TABLE = Part("many_runs", "many_runs", text)
PARTS = [TABLE]


def main(count: int) -> None:
    """Write the table of the XP train's runs, and print that of other scenes."""
    system = gl.compile(gp.ZhouCui2022(), outputs=["w_out"])
    K_g = np.linspace(1e8, 3e8, count)
    rows = []
    for method in ("rk5", "auto"):
        for name, function in ways(system, K_g, method):
            function()  # compiled, and workers begun
            rows.append({"way": name, "method": method, "us": least(function, count)})
    for name, function in others(system, min(count, 16)):
        rows.append({"way": name, "method": "", "us": least(function, min(count, 16))})
    others_found = []
    print("| scene | method | how | us a run |\n|---|---|---|---|")
    for name, way, function, runs in scenes(min(count, 512)):
        stats = function().stats
        how = f"{stats['lanes']} lanes" if stats["lanes"] > 1 else stats["why"]
        others_found.append({"name": name, "way": way, "how": how, "us": least(function, runs)})
        print(f"| {name} | {way} | {how} | {others_found[-1]['us']:.0f} |", flush=True)
    TABLE.store({"count": count, "rows": rows, "scenes": others_found})
    print(TABLE.shown(), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
