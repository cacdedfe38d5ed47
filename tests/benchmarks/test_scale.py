"""What translation may cost, by processor time on a machine of two cores. The numbers are in docs/scale.md."""

from __future__ import annotations

import time

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.benchmarks.scale import exponent, measure, rumoca, run, second_process
from tests.test_scale import COUNT

pytestmark = pytest.mark.benchmark


def test_chain() -> None:
    small, hundred, thousand, large = (measure("chain", n) for n in (10, 100, 1000, 10_000))
    assert thousand["compile"] < 0.5
    assert large["compile"] < 6.0
    assert large["memory"] < 2 * 2**30
    assert exponent(thousand, large) <= 1.15
    assert large["source"] <= small["source"]
    assert (
        large["native"] <= 1.2 * hundred["native"]
    )  # loops do not grow; ten bodies are written out, which numba compiles faster


@pytest.mark.parametrize(("kind", "small", "large"), [("star", 50, 200), ("tree", 600, 1950)])
def test_others_scale_alike(kind: str, small: int, large: int) -> None:
    assert exponent(measure(kind, small), measure(kind, large), "again") <= 1.15
    assert measure(kind, large)["compile"] < 3.0


@pytest.mark.parametrize(("form", "factor"), [("rumoca_components", 20.0), ("rumoca_equations", 4.0)])
def test_beside_rumoca(form: str, factor: float) -> None:
    """20 times as fast at the same task; given flat equations, rumoca has less to do."""
    theirs = rumoca(form, 1000)
    if theirs is None:
        pytest.skip("rumoca is not installed")
    assert theirs["seconds"] > factor * measure("chain", 1000)["compile"]


def test_symbolic_work_of_ten_thousand() -> None:
    ten, many = (run(COUNT.replace("{model}", f"Chain(N={n})"))[0] for n in (10, 10_000))
    assert ten == many


def test_second_process() -> None:
    found = second_process("auto")
    assert found["total"] < 1.5
    assert found["total"] < 1.2 * (found["imports"] + found["run"])


def test_thousand_runs_with_other_parameters() -> None:
    """Beside the integrations themselves, a run costs less than 0.3 ms."""
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=["w_out"])
    rng = np.random.default_rng(1)
    values = [{"K_g": 1e8 * (1 + 0.1 * float(f))} for f in rng.random(1000)]
    system.simulate(t_end=0.05, samples=101, method="rk", parameters=values[0])
    beside = []
    for parameters in values:
        begin = time.perf_counter()
        result = system.simulate(t_end=0.05, samples=101, method="rk", parameters=parameters)
        beside.append(time.perf_counter() - begin - result.stats["seconds"])
    assert np.percentile(beside, 25) < 0.3e-3  # of elapsed time, on a machine that may do other work
