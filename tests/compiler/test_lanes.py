"""Lanes in the small language: the same numbers as numpy's, lane by lane."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gearlib.compiler.instructions import LANED, LANES
from gearlib.compiler.object_code import compiled
from gearlib.compiler.translate import Unsupported, intermediate
from gearlib.native.lane_functions import FUNCTIONS, FURTHEST

Floats = NDArray[np.float64]
HEAD = "def f(x: lanes, y: lanes) -> int32:\n"


def computed(value: str, *rows: Floats) -> Floats:
    """A function of lanes ``a, b, ...``."""
    names = "".join(f"    {name} = x[{k}]\n" for k, name in zip(range(len(rows)), "abcd", strict=False))
    source = "".join(FUNCTIONS.values()) + HEAD + names + f"    y[0] = {value}\n    return 0\n"
    x, y = np.ascontiguousarray(rows, float), np.empty(LANES)
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)(compiled(source, "f").address)
    assert call(x.ctypes.data, y.ctypes.data) == 0
    return y


A = np.array([-3.0, -1.0, -0.0, 0.5, 1.0, 2.0, 7.0, 1e3])
B = np.array([2.0, -1.0, 4.0, 0.5, -8.0, 3.0, 7.0, -1e-3])


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ("2 * a - b / 3", 2 * A - B / 3),
        ("a**3 + abs(b)", A**3 + np.abs(B)),
        ("max(a, b, 1)", np.maximum(np.maximum(A, B), 1)),
        ("(a if a < b else b)", np.minimum(A, B)),
        ("(1.0 if a > 0 else (0 if b > 0 else -1))", np.where(A > 0, 1.0, np.where(B > 0, 0.0, -1.0))),
        ("(a if a > 0 and b > 0 else -b)", np.where((A > 0) & (B > 0), A, -B)),
        ("(a if not (a > 0 or b > 0) else 5.0)", np.where(~((A > 0) | (B > 0)), A, 5.0)),
        ("(a if -1 < a <= 2 else b)", np.where((A > -1) & (A <= 2), A, B)),
        ("sqrt(abs(a)) + tanh(b) + atan2(a, b)", np.sqrt(np.abs(A)) + np.tanh(B) + np.arctan2(A, B)),
        ("exp(-abs(a)) + log(abs(b))", np.exp(-np.abs(A)) + np.log(np.abs(B))),
        ("abs(b)**0.3", np.abs(B) ** 0.3),
        ("where(both(a > 0, b > 0), a, in_lanes(2.0))", np.where((A > 0) & (B > 0), A, 2.0)),
    ],
)
def test_lanes_are_numpy(value: str, wanted: Floats) -> None:
    assert np.allclose(computed(value, A, B), wanted, rtol=4e-16, atol=1e-300)


@pytest.mark.parametrize(
    ("value", "instructions"),
    [
        ("where(both(a > 0, b > 0), a, b)", ["and"]), ("where(either(a > 0, b > 0), a, b)", ["or"]),
        ("where(both(a > 0, b > 0, a > b), a, b)", ["and"] * 2), ("a if a > 0 and b > 0 else b", ["and"]),
        ("a if a > 0 or b > 0 else b", ["or"]), ("a if -1 < a <= 2 else b", ["and"]), ("max(a, b, 1)", ["fcmp ogt"] * 2),
        ("min(a, b)", ["fcmp olt"]), ("a if a <= b else b", ["fcmp ole"]), ("a if not a != b else b", ["fcmp une", "xor"]),
        ("abs(a)", ["call"]), ("sqrt(a)", ["call"]), ("atan2(a, 1)", ["call"] * LANES), ("a**5", ["fmul"] * 3), ("in_lanes(2.5)", []),
        ("in_lanes(total(a))", ["fadd"] * (LANES - 1)), ("-a", ["fneg"]), ("a - 2 / b", ["fdiv", "fsub"]),
    ],
)  # fmt: skip
def test_operations_of_lanes_are_instructions(value: str, instructions: list[str]) -> None:
    """As few as there are operations; comparisons that are joined or chosen by are there, too."""
    text = intermediate(f"{HEAD}    a, b = x[0], x[1]\n    y[0] = {value}\n    return 0\n")
    compared = [] if instructions[:1] and instructions[0].startswith("fcmp") else ["fcmp"]
    others = ("getelementptr", "load", "insertelement", "extractelement", "shufflevector", "select", *compared)
    done = [line.split(" = ")[1] for line in text.partition("}")[0].splitlines() if " = " in line]
    found = [line for line in done if not line.startswith(others)]
    assert [next((i for i in instructions if line.startswith(f"{i} ")), line) for line in found] == instructions
    assert f"store {LANED} " in text


def test_any_of_looks_at_all_lanes() -> None:
    body = "    y[0] = 1.0 * x[0]\n    if any_of(x[0] > 5.0):\n        y[0] = 0.0 * x[0]\n    return 0\n"
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)(compiled(HEAD + body, "f").address)
    for top, wanted in ((5.0, 5.0), (6.0, 0.0)):
        x, y = np.array([0.0] * (LANES - 1) + [top]), np.empty(LANES)
        call(x.ctypes.data, y.ctypes.data)
        assert y[-1] == wanted


def test_a_branch_on_lanes_is_refused() -> None:
    with pytest.raises(Unsupported):
        compiled(HEAD + "    if x[0] > 5.0:\n        return 1\n    return 0\n", "f")


@settings(max_examples=60)
@given(st.lists(st.floats(-2 * FURTHEST, 2 * FURTHEST), min_size=LANES, max_size=LANES))
def test_sine_and_cosine_are_as_exact_as_the_library(angles: list[float]) -> None:
    x = np.array(angles)
    for name, function in (("sin", np.sin), ("cos", np.cos)):
        assert np.abs(computed(f"{name}(a)", x) - function(x)).max() < 2.3e-16


def test_sine_and_cosine_near_multiples_of_a_quarter_turn() -> None:
    for whole in range(-64, 64, LANES):
        x = np.arange(whole, whole + LANES) * (np.pi / 2)
        assert np.allclose(computed("sin(a)", x), np.sin(x), rtol=4e-16, atol=1e-30)
        assert np.allclose(computed("cos(a)", x), np.cos(x), rtol=4e-16, atol=1e-30)
    assert np.isnan(computed("sin(a)", np.full(LANES, np.inf))).all()


def test_lanes_have_a_sine_of_their_own() -> None:
    """It is called for all lanes at once, and calls the C library's lane by lane itself, for angles far away."""
    text = intermediate(FUNCTIONS["sin"] + HEAD + "    y[0] = sin(x[0])\n    return 0\n")
    assert text.count("@sin_of_lanes(") == 2
    assert text.count("call double @llvm.sin.f64(") == LANES
    without = intermediate(HEAD + "    y[0] = sin(x[0])\n    return 0\n")
    assert (without.count("@sin_of_lanes("), without.count("call double @llvm.sin.f64(")) == (0, LANES)
