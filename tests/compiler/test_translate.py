"""The compiler of generated functions, against Python that carries out the same source, and numpy."""

from __future__ import annotations

import ctypes
import gc
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from gearlib.compiler.data_flow import carried, is_elementwise, is_never_empty, stored
from gearlib.compiler.instructions import LANED, Unsupported
from gearlib.compiler.native_module import native_text
from gearlib.compiler.object_code import compiled
from gearlib.compiler.translate import intermediate
from gearlib.equations.kernel import residual_kernel
from gearlib.equations.template import KNOWN, template_of
from gearlib.language.expressions import SquareWave
from gearlib.native.linear_solve import SOLVE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
POINTER = ctypes.c_void_p
SPECIAL = [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, 1.7976931348623157e308, 1e-8, 3.5, -2.25]


@pytest.fixture(autouse=True)
def own_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path_factory.getbasetemp() / "machine_code"
    monkeypatch.setenv("GEARLIB_CACHE", str(folder))
    return folder


def module(body: str) -> str:
    return "def f(t: float, data: floats, index: ints) -> int32:\n" + indent(body, "    ")


def by_machine(source: str, name: str, t: float, *arrays: NDArray[Any]) -> int:
    try:
        function = compiled(source, name)  # must outlive the call
    except Unsupported as refused:
        pytest.fail(f"refused: {refused}")
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(POINTER,) * len(arrays))(function.address)
    return int(call(t, *(a.ctypes.data for a in arrays)))


def multiplied(base: Any, exponent: int) -> Any:
    """A power by multiplications, as it is compiled."""
    left, result = abs(exponent), base * 0 + 1 if exponent == 0 else None
    while left:
        if left & 1:
            result = base if result is None else result * base
        left >>= 1
        base = base * base
    return 1 / result if exponent < 0 else result


class Number(float):
    """Python's numbers with the two exceptions that the compiled language makes."""

    def __truediv__(self, other: float) -> Number:
        with np.errstate(all="ignore"):
            return Number(np.float64(self) / np.float64(other))

    def __pow__(self, exponent: float) -> Number:  # type: ignore[override]
        return Number(multiplied(Number(self), exponent) if isinstance(exponent, int) else math.pow(self, exponent))

    def _with(self, operation: Callable[[float, float], float], other: float) -> Number:
        return Number(operation(float(self), float(other)))

    def __add__(self, other: float) -> Number:
        return self._with(float.__add__, other)

    __radd__ = __add__

    def __mul__(self, other: float) -> Number:
        return self._with(float.__mul__, other)

    __rmul__ = __mul__

    def __sub__(self, other: float) -> Number:
        return self._with(float.__sub__, other)

    def __rsub__(self, other: float) -> Number:
        return Number(float(other) - float(self))

    def __rtruediv__(self, other: float) -> Number:
        return Number(other).__truediv__(self)

    def __neg__(self) -> Number:
        return Number(-float(self))

    def __abs__(self) -> Number:
        return Number(abs(float(self)))


def wrapped(function: Callable[..., float]) -> Callable[..., Number]:
    return lambda *arguments: Number(function(*arguments))


FUNCTIONS = {name: wrapped(function) for name, function in vars(math).items() if callable(function)}
SCOPE = FUNCTIONS | {"pi": Number(math.pi), "e": Number(math.e), "inf": Number(math.inf), "parallel": range}


def by_python(source: str, name: str, t: float, *arrays: NDArray[Any]) -> int:
    """The same source as Python; floating-point arrays get its results."""
    names = dict(SCOPE)
    exec("from __future__ import annotations\n" + source, names)
    lists = [[Number(v) for v in a.tolist()] if a.dtype == float else a.tolist() for a in arrays]
    code = int(names[name](Number(t), *lists))
    for array, values in zip(arrays, lists, strict=True):
        array[:] = values
    return code


def check(body: str, data: Sequence[float], index: Sequence[int] = (), t: float = 0.75) -> None:
    """Both roads leave the same numbers behind, to the last bit."""
    source, numbers, whole = module(body), np.array(data, float), np.array(index, np.int64)
    others = numbers.copy()
    assert by_machine(source, "f", t, numbers, whole) == by_python(source, "f", t, others, whole), source
    assert same(numbers, others), (source, numbers, others)


def same(a: Floats, b: Floats) -> bool:
    """Equal with the signs of zeros; not-a-number is one, whatever its bits are."""
    return bool((((a == b) & (np.signbit(a) == np.signbit(b))) | (np.isnan(a) & np.isnan(b))).all())


STATEMENTS = {
    "swap": "data[0], data[1] = data[1], data[0]\na, b = data[2], data[3]\na, b = b, a\ndata[2], data[3] = a, b - a\nreturn 0",
    "chained comparison": "data[0] = 1 if -2.0 < data[1] <= data[2] < 9 else 2\nreturn 0",
    "conditions as values": "a = data[1] > 0.5 and data[2] > 0.5 or not data[3] > 2\ndata[0] = 3.0 if a else 4.0\nreturn 0",
    "numbers as conditions": "data[0] = 1.0 if data[1] and not index[1] else 2.0\nreturn 0 if index[0] else 1",
    "conditions that guard": "k = index[0]\nif k < 3 and data[k] > 0 or k > 100:\n    return 1\nreturn 2",
    "elif": "if data[0] > 1:\n    y = 1\nelif data[1] > 1:\n    y = 2\nelse:\n    y = index[2]\nreturn y",
    "one branch": "y = data[0]\nif y > 0.3:\n    y = -y\ndata[1] = y\nreturn 0",
    "returns on the way": "for k in range(5):\n    data[0] += data[k]\n    if data[0] > 3:\n        return k\nreturn 9",
    "return in both branches": "if data[0] > 0:\n    return 1\nelse:\n    return -2\n",
    "loop of no turn": "s = 1.5\nfor k in range(index[0], index[0]):\n    s = 2.5\ndata[0] = s\nreturn 0",
    "backwards": "s = 0.0\nfor k in range(5, 0, -2):\n    s = s / 3 + data[k]\ndata[0] = s\nreturn 0",
    "loop variable afterwards": "k = 7\nfor k in range(index[0], index[3]):\n    data[k] = k\nreturn k",
    "loop variable written": "s = 0.0\nfor k in range(4):\n    s += data[k]\n    k = 0\ndata[0] = s\nreturn k",
    "bounds are read once": "n = 3\nfor k in range(n):\n    n = 5\n    data[k] += n\nreturn n",
    "break": "y = 0\nfor k in range(6):\n    if data[k] > 2:\n        y = k\n        break\n    data[k] += 1\nreturn y",
    "break out of the inner": (
        "n = 0\nfor i in range(3):\n    for j in range(4):\n        n += 1\n        if j == index[1]:\n            break\n"
        "    data[i] = n\nreturn n"
    ),
    "go on in the inner": (
        "n = 0\nfor i in range(3):\n    for j in range(4):\n        if j == index[1]:\n            continue\n"
        "        n += 1 + i\n    data[i] = n\nreturn n"
    ),
    "go on in the outer, behind an inner": (
        "n = 0\nfor i in range(4):\n    for j in range(3):\n        if j > i:\n            break\n        n += j\n"
        "    if i == index[2]:\n        continue\n    data[i] = n\nreturn n"
    ),
    "go on and leave in loops of three": (
        "n = 0\nfor i in range(3):\n    k = 0\n    while k < 5:\n        k += 1\n        if k == 2:\n            continue\n"
        "        for j in range(3):\n            if j == i:\n                continue\n            if j + k > 4:\n                break\n"
        "            n += j + 10 * k\n        if n > 200:\n            break\n    data[i] = n\nreturn n"
    ),
    "value from a loop that is never empty": "for k in range(3):\n    e = data[k]\n    if e > 0.6:\n        break\ndata[0] = e\nreturn 0",
    "a name of two kinds": "y = index[0]\ndata[y] = 1\nfor k in range(2):\n    y = data[k] * 2\n    data[k] = y\nreturn 0",
    "a name of two kinds in turn": (
        "h = 1\nfor k in range(3):\n    h = index[k]\n    data[h] += 1\n    h = data[k]\n    data[0] += h\nreturn 0"
    ),
    "conditional in a loop": "r = 0\nfor k in range(4):\n    if data[k] > 0.5:\n        r = k\n    elif r == 0:\n        r = -1\nreturn r",
    "fibonacci": "a, b = 0, 1\nfor k in range(40):\n    a, b = b, a + b\ndata[0] = a\nreturn 0",
    "kinds of loops by number": (
        "for s in range(4):\n    kind, at = index[s], s\n    if kind == 0:\n        data[at] += 1\n    elif kind == 1:\n"
        "        data[at] *= 2\n    elif kind == 2:\n        data[at] /= 3\n    else:\n        data[at] -= 4\nreturn 0"
    ),
    "whole arithmetic": "a = 3 * index[3] - -index[1]\ndata[0] = (a - 7) / 2\ndata[1] = int(-data[4]) + int(2.99)\nreturn a",
    "powers": "data[0] = data[1]**2 + data[2]**-3 - data[3]**0 + index[3]**3 + 2**5\nreturn 0",
    "large numbers": "data[0] = 123456789012345678901234567890 * data[1] + 1e-300\nreturn 0",
    "true and false": "a = True\nfor k in range(3):\n    if data[k] > 0.9:\n        a = False\nreturn 1 if a else 2",
    "constants": "data[0], data[1], data[2] = pi, e, -inf\nreturn 0",
    "after the return": "return 1\ndata[0] = 5",
}  # fmt: skip


@pytest.mark.parametrize("body", STATEMENTS.values(), ids=STATEMENTS)
@pytest.mark.parametrize("data", [[0.25, 0.5, 0.75, 1.0, 1.25, 3.5], [4.0, -3.0, 2.0, -1.0, 0.0, 0.7]], ids=["rising", "mixed"])
def test_statements(body: str, data: list[float]) -> None:
    check(body, data, [0, 1, 2, 3])


CONDITIONS = [
    "a and b and c", "a or b or c", "a and b or not c and d", "not (a or b) and (c or d or a)", "(a and b and c and d) or not a",
    "not (a and b and c)", "not a and not b and not c and not d", "a == b and b != c", "not not a", "a and (b or c or (d and a))",
]  # fmt: skip


@pytest.mark.parametrize("text", CONDITIONS)
def test_conditions_of_several_parts(text: str) -> None:
    """For all values of their parts: in branches and loops, as values, and where one of two is chosen."""
    lines = [
        "for k in range(16):", "    a, b, c, d = k % 2 == 1, k // 2 % 2 == 1, k // 4 % 2 == 1, k // 8 == 1", f"    if {text}:",
        "        data[k] = 1.0", "    else:", "        data[k] = 2.0", f"    y = {text}", "    data[16 + k] = 3.0 if y else 4.0",
        f"    data[32 + k] = 5.0 if {text} else 6.0", "    n = 0", f"    while n < 2 and ({text}):", "        n += 1",
        "    data[48 + k] = n", f"    if not ({text}):", "        n = 7", f"    elif n == 2 and ({text}):", "        n = 8",
        "    data[64 + k] = n", "return 0",
    ]  # fmt: skip
    data = np.zeros(80)
    assert by_machine(module("\n".join(lines)), "f", 0.0, data) == 0
    for k in range(16):
        true = bool(eval(text, {name: bool(k >> i & 1) for i, name in enumerate("abcd")}))
        assert data[k::16].tolist() == ([1.0, 3.0, 5.0, 2.0, 8.0] if true else [2.0, 4.0, 6.0, 0.0, 7.0]), k


EXPRESSIONS = [
    "a + b", "a - b", "a * b", "a / b", "-a", "a**2", "a**-1", "abs(a)", "copysign(1, a)", "max(a, b)", "min(a, b)", "max(a, b, 1)",
    "sqrt(abs(a))", "1 if a < b else 0", "2 if a <= b else 0.5", "1.5 if a > b else a", "1 if a >= b else b", "a == b", "a != b",
    "(a if a > 0 else b) / (b if b > a else 2)", "max(a, 0) - min(0, b)", "not a > b", "a / 0", "0 / a", "(a > 0) + (b > 0)",
]  # fmt: skip


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_special_values(text: str) -> None:
    pairs = [x for a in SPECIAL for b in SPECIAL for x in (a, b, 0.0)]
    check(
        f"for k in range({len(SPECIAL) ** 2}):\n    a, b = data[3 * k], data[3 * k + 1]\n    data[3 * k + 2] = {text}\nreturn 0",
        pairs,
    )


def expressions() -> Any:
    leaves = st.one_of(
        st.sampled_from(["data[0]", "data[1]", "data[2]", "t", "index[0]", "index[1]", "2", "7", "0.5"]),
        st.floats(allow_nan=False, allow_infinity=False).map(lambda x: f"({x!r})"),
    )  # fmt: skip

    def grown(parts: Any) -> Any:
        condition = st.tuples(parts, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), parts).map(
            lambda p: f"{p[0]} {p[1]} {p[2]}"
        )
        both = st.tuples(condition, st.sampled_from(["and", "or"]), condition).map(lambda p: f"({p[0]} {p[1]} not ({p[2]}))")
        test = st.one_of(condition, both)
        return st.one_of(
            st.tuples(parts, st.sampled_from("+-*"), parts).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
            st.tuples(parts, parts).map(lambda p: f"({p[0]} / data[3] / (1.0 * {p[1]}))"),
            parts.map(lambda p: f"(-{p})"),
            parts.map(lambda p: f"sqrt(abs(1.0 * {p}))"),
            parts.map(lambda p: f"copysign(1, {p})"),
            st.tuples(st.sampled_from(["max", "min"]), parts, parts).map(lambda p: f"{p[0]}({p[1]}, {p[2]})"),
            st.tuples(parts, test, parts).map(lambda p: f"(1.0 * {p[0]} if {p[1]} else 1.0 * {p[2]})"),
            st.tuples(test, test, parts).map(lambda p: f"((2 if {p[0]} else 7) if {p[1]} else 1.0 * {p[2]})"),
            st.tuples(parts, st.integers(-4, 5)).map(lambda p: f"(t / t * {p[0]})**{p[1]}"),
        )  # fmt: skip

    return st.recursive(leaves, grown, max_leaves=12)


@settings(max_examples=150)
@given(expressions(), st.lists(st.one_of(st.sampled_from(SPECIAL), st.floats()), min_size=4, max_size=4))
def test_random_expressions(text: str, numbers: list[float]) -> None:
    data = np.array([*numbers, 0.0])
    assert by_machine(module(f"data[4] = {text}\nreturn 0"), "f", 1.5, data, np.array([3, -2])) == 0
    expected = float(eval(text, SCOPE | {"t": Number(1.5), "index": [3, -2], "data": [Number(x) for x in numbers]}))
    assert same(data[4:], np.array([expected])), (text, data[4], expected)


def test_functions_of_equations() -> None:
    """Every function that equations may hold can be compiled, and is the C library's."""
    x, y = sympy.symbols("x y", real=True)
    data = np.array([0.3, 0.6, 0.0])
    for function in KNOWN:
        if function is not sympy.Piecewise:
            two = function in (sympy.atan2, sympy.Max, sympy.Min)
            shifted = x + 1 if function is sympy.acosh else x
            expression = function(y, x) if two else function(shifted)
            if function is SquareWave:
                expression = function(x, 0.7, 0.1)
            text = residual_kernel(template_of(gl.Eq(gl.no_event(expression), 0), "test", lambda name: False)).scalar
            body = f"x0, x1 = data[{1 if 'x1' in text and two else 0}], data[1]\ndata[2] = {text}\nreturn 0"
            assert by_machine(module(body), "f", 0.0, data) == 0
            x0 = data[1] if "x1" in text and two else data[0]
            assert data[2] == pytest.approx(eval(text, SCOPE | {"x0": x0, "x1": data[1]}), rel=2e-16), text


@pytest.mark.parametrize(
    "text",
    ["sin(a)", "cos(a)", "sin(a) * cos(a)", "tan(a)", "exp(a)", "log(a)", "atan2(a, b)", "a**b", "a**1.7", "tanh(a)", "2**a"],
)
def test_functions_outside_their_domains(text: str) -> None:
    pairs = np.array([x for a in SPECIAL for b in SPECIAL for x in (a, b, 0.0)])
    body = (
        f"for k in range({len(SPECIAL) ** 2}):\n    a, b = data[3 * k], data[3 * k + 1]\n    data[3 * k + 2] = {text}\nreturn 0"
    )
    by_machine(module(body), "f", 0.0, pairs)
    a, b, found = pairs.reshape(-1, 3).T
    scope = {"sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "atan2": np.arctan2, "tanh": np.tanh}
    with np.errstate(all="ignore"):
        expected = np.asarray(eval(text, scope | {"a": a, "b": b}), float)
    assert np.allclose(found, expected, rtol=1e-15, atol=0, equal_nan=True)


# ---------------------------------------------------------------- loops


@pytest.mark.parametrize(
    "text",
    [
        "data[y + k] = data[a + k]", "data[y + k] = -data[a + k] + data[k + b]", "data[y + k] = data[3]", "data[y + k] = 0",
        "data[y + k] = data[a + k] * data[b + k] - 2.5 * data[a + k] / s", "data[y + k] = n", "data[1 + y + k - 0] = 1 / data[k + a]",
        "data[y + k] = data[a + k]**2", "data[y + k] = max(data[a + k], data[b + k])", "data[y + k] = k * data[a + k]",
        "data[y + 2 * k] = data[a + k]", "data[y + k] = data[a + index[k]]",
    ],
)  # fmt: skip
def test_parallel_loops_of_all_lengths(text: str) -> None:
    rng = np.random.default_rng(0)
    body = f"n, s, y, a, b = index[20], data[0], 10, 100, 150\nfor k in parallel(n):\n    {text}\nreturn n"
    for n in [*range(19), -3]:
        check(body, rng.uniform(0.5, 2.0, 200).tolist(), [*range(20), n])


@pytest.mark.parametrize("bounds", ["16", "7, 31", "5, 40, 2", "3, 3", "20, 0, -1", "index[20], 20"])
def test_parallel_loops_of_all_ranges(bounds: str) -> None:
    rng = np.random.default_rng(0)
    check(
        f"for k in parallel({bounds}):\n    data[100 + k] = data[k] - data[50 + k]\nreturn 0",
        rng.normal(size=150).tolist(),
        [*range(21)],
    )


def test_neighbours_are_computed_together() -> None:
    """The linear equations that the bodies and shafts of a long chain share."""
    text = intermediate(gl.compile(Chain(n=120)).translation.scene.native.rhs.source)
    assert text.count(f"fadd {LANED}") == 4
    assert text.count(f"store {LANED}") == 5


def test_which_loops_work_on_neighbours() -> None:
    texts = [
        "data[y + k] = data[k] * s",
        "data[y] = data[k]",
        "data[k] = k",
        "data[k] += 1",
        "data[2 * k] = 0",
        "data[k + k] = 0",
    ]
    loops = [_loop(f"for k in parallel(n): {text}") for text in texts]
    assert [is_elementwise(loop, "k") for loop in loops] == [True, *[False] * 5]


def _loop(text: str) -> Any:
    import ast

    (loop,) = ast.parse(text).body
    return loop


def test_what_loops_hand_on() -> None:
    loop = _loop(
        "for i in range(n):\n    a = i\n    for j in range(a):\n        s += j\n        if s > 3: break\n    if a: c = 1\n    d, e = a, c"
    )
    assert stored([loop]) == {"i", "j", "a", "s", "c", "d", "e"}
    assert carried(loop) == {"s", "c", "j"}
    never_empty = _loop("for i in range(n):\n    for j in range(3):\n        s = j\n        if q: break\n    t = s")
    assert carried(never_empty) == set()
    assert [is_never_empty(_loop(f"for k in range({b}): pass").iter) for b in ("3", "0", "n", "2, 2", "2, 5, 3")] == [
        True, False, False, False, True,
    ]  # fmt: skip


# ---------------------------------------------------------------- the elimination


SOLVER = SOLVE + module("return solve(data, 1, 0 + index[0], index[1], index[3], index[3], index[2])")


def solved(matrix: Floats, right: Floats, lead: int = 0) -> tuple[int, Floats, Floats]:
    """Code, solutions and all data; ``right`` has the right-hand sides one after the other."""
    n = len(matrix)
    data = np.concatenate([[0.0], matrix.ravel(), np.zeros(2 * n + 1 + n * n), right])
    others = data.copy()
    index = np.array([1 + 2 * n * n + 2 * n + 1, n, lead, len(right) // n])
    code = by_machine(SOLVER, "f", 0.0, data, index)
    assert by_python(SOLVER, "f", 0.0, others, index) == code
    assert same(data, others)
    return code, data[-len(right) :], data


@pytest.mark.parametrize("n", [1, 2, 3, 5, 9])
@pytest.mark.parametrize("lead", [0, 1, 4])
def test_elimination(n: int, lead: int) -> None:
    """The first equations may each determine one unknown, so that only what these leave of the others is solved."""
    rng = np.random.default_rng(n)
    lead = min(lead, n)
    for _ in range(4):
        matrix, right = rng.normal(size=(n, n)), rng.normal(size=n)
        matrix[:lead, :lead] = np.diag(rng.uniform(1.0, 2.0, lead))
        code, x, data = solved(matrix, right, lead)
        assert code == 0
        assert x == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)
        assert data[1 + n * n + n] == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
        sides = rng.normal(size=(3, n))
        code, x, _ = solved(matrix, sides.ravel(), lead)
        assert code == 0
        assert x.reshape(3, n) == pytest.approx(np.linalg.solve(matrix, sides.T).T, rel=1e-9)


def test_elimination_of_dependent_equations() -> None:
    matrix = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 3.0]])
    code, x, _ = solved(matrix, np.array([2.0, 4.0, 6.0]))
    assert code == 0
    assert matrix @ x == pytest.approx([2.0, 4.0, 6.0])
    assert solved(matrix, np.array([2.0, 5.0, 6.0]))[0] == 1


@pytest.mark.parametrize("seed", range(8))
def test_elimination_shares_what_is_open_as_compliances_would(seed: int) -> None:
    """Several locked elements hold the same few motions: of all torques that do, the smallest by their squares; in each right-hand side."""
    rng = np.random.default_rng(seed)
    motions = int(rng.integers(1, 4))
    locked = motions + int(rng.integers(1, 5))
    ratios = rng.choice([-1, 1], (locked, motions)) * 10 ** rng.uniform(-0.5, 0.5, (locked, motions))
    matrix = np.block([[np.diag(rng.uniform(0.5, 2.0, motions)), ratios.T], [ratios, -1e-25 * np.eye(locked)]])
    right = np.zeros((2, motions + locked))
    right[:, :motions] = rng.normal(size=(2, motions))
    rows, columns = rng.permutation(motions + locked), rng.permutation(motions + locked)
    code, x, _ = solved(matrix[rows][:, columns], right[:, rows].ravel())
    assert code == 0
    found = np.empty_like(right)
    found[:, columns] = x.reshape(right.shape)
    assert found[:, :motions] == pytest.approx(np.zeros((2, motions)), abs=1e-12)
    assert found[:, motions:] == pytest.approx((np.linalg.pinv(ratios.T) @ right[:, :motions].T).T, rel=1e-9, abs=1e-12)


def test_elimination_leaves_at_zero_what_no_compliance_tells() -> None:
    matrix = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1e-25, 0.0], [0.0, 0.0, 2.0, 2.0]])
    code, x, _ = solved(matrix, np.array([3.0, 5.0, 3.0, 10.0]))
    assert code == 0
    assert x[0] + x[1] == pytest.approx(3.0)
    assert 0.0 in x[:2]
    assert x[2:] == pytest.approx([0.0, 5.0], abs=1e-12)


@pytest.mark.parametrize("exponent", [15, 30])
def test_elimination_in_other_units(exponent: int) -> None:
    """A body of small inertia that slides: torque is its inertia times its acceleration; and two equations that say the same."""
    J = 2.0**-exponent * 2.0**-exponent
    matrix = np.array([[J, 1.0, 0.0, 0.0], [1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    code, x, _ = solved(matrix, np.array([3.0, 0.0, 2.0, 5.0]))
    assert code == 0
    assert x == pytest.approx([1.0 / J, 2.0, 1.0 / J, 5.0], rel=1e-9)
    matrix[3] = 0.3 * matrix[0] + 0.7 * matrix[1]
    assert solved(matrix, np.array([3.0, 0.0, 2.0, 0.9]))[0] == 0
    assert solved(matrix, np.array([3.0, 0.0, 2.0, 1.0]))[0] == 1


# ---------------------------------------------------------------- whole models


class Chain(gl.Component):
    """A chain that is stopped by friction and driven through play."""

    n = gl.Structural(3)
    friction = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=gl.sin(3 * gl.time))
        self.body = [gp.Inertia(J=1.0 + i) for i in range(self.n)]
        self.shaft = [gp.SpringDamper(c=50.0, d=0.5) for _ in range(self.n - 1)]
        links = [gl.connect(self.torque.flange, self.body[0].flange_a)]
        for a, s, b in zip(self.body, self.shaft, self.body[1:]):
            links += [gl.connect(a.flange_b, s.flange_a), gl.connect(s.flange_b, b.flange_a)]
        if self.friction:
            self.bearing = gp.BearingFriction(tau_pos=[[0.0, 1.0], [1.0, 2.0]])
            links += [gl.connect(self.body[-1].flange_b, self.bearing.flange_a)]
        return links


@pytest.mark.parametrize(("n", "friction"), [(3, False), (40, False), (120, False), (3, True), (120, True)])
def test_functions_of_models_do_what_their_source_says(n: int, friction: bool) -> None:
    system = gl.compile(Chain(n=n, friction=friction))
    native = system.translation.scene.native_with_jacobian
    rng = np.random.default_rng(n)
    data, x = rng.uniform(0.5, 1.5, native.size), rng.normal(size=len(system.translation.scene.states))
    data[native.shared.relations :][: native.shared.n_discrete] = 0.0
    for name in ("rhs", "jac", "roots", "update"):
        function = getattr(native, name)
        if function is None:
            assert not friction
            continue
        kind, size = (np.int32, 64) if name == "update" else (np.float64, max(len(native.pattern.indices), len(x)))
        codes, results = [], []
        for road in (by_machine, by_python):
            arrays = [x.copy(), np.zeros(size, kind), data.copy(), native.index.copy()]
            codes.append(road(function.source, name, 0.7, *arrays))
            results.append(np.concatenate(arrays))
        assert codes[0] == codes[1]
        assert same(*results)


TURNS = (
    "while a < t:\n    a += x[b]\n    b += 1", "while True:\n    b += 1\n    if b > n:\n        break",
    "while not a > t and b < n:\n    b = 2 * b\n    if x[b] > 0:\n        continue\n    a += 1.0",
    "for k in range(n, 0, -1):\n    a += x[k]",
    "for k in range(3):\n    for j in range(k, n):\n        if x[j] > a:\n            return j\n        if j > 5:\n            continue\n"
    "        a = x[k]",
    "if t > 0:\n    b = 2\nelif t < -1:\n    return 3\nelse:\n    b = n", "if t > 0 or n > 3 and not x[0] > 1:\n    b = n // 3 - n % 3",
    "while b < n:\n    j = 0\n    for k in range(b):\n        if x[k] < 0:\n            break\n        j += k\n    b += 1 + j",
)  # fmt: skip


def flaw(make: Callable[[], str]) -> str:
    """Why a source is not compiled, or what LLVM finds wrong in what it is compiled to; empty where it is right."""
    try:
        binding.parse_assembly(make()).verify()
    except Exception as problem:
        return f"{type(problem).__name__}: {problem}"
    return ""


def test_what_is_of_the_language_is_compiled_to_what_llvm_takes() -> None:
    expressions = [f"a, b = data[0], data[1]\ndata[2] = {text}\nreturn 0" for text in EXPRESSIONS]
    conditions = [f"a, b, c, d = t > 0, t > 1, t > 2, t > 3\nreturn 1 if {text} else 2" for text in CONDITIONS]
    for body in (*STATEMENTS.values(), *expressions, *conditions):
        assert flaw(lambda body=body: intermediate(module(body))) == "", body  # type: ignore[misc]


def test_records_callbacks_and_tuples_are_compiled_to_what_llvm_takes() -> None:
    assert flaw(lambda: native_text("tests.compiler.sample_loops")) == ""


def test_loops_and_lanes_are_compiled_to_what_llvm_takes() -> None:
    for loop in (*TURNS, "for k in parallel(n):\n    x[k] = 2.0 * x[k + 1]", "for k in parallel(1, n):\n    x[k] += t"):
        text = "def f(t: float, n: int, x: floats) -> int32:\n" + indent(f"a, b = 0.0, 1\n{loop}\nreturn b", "    ")
        assert flaw(lambda text=text: intermediate(text)) == "", loop  # type: ignore[misc]
    lanes = "def f(x: lanes, y: lanes, n: int, p: floats) -> int32:\n    a, b = x[0], x[1]\n    y[0] = {}\n    return 0\n"
    for value in (
        "in_lanes(2)", "in_lanes(p[n])", "a if a > 0 and not b > 1 or a < b else -b", "where(both(a > 0, b > 0), a, 1.0)",
        "where(either(a > 0, b > 0, a < b), a, b)", "max(a, b, 2)", "abs(a)**3 / b + a**-2", "sin(a) + atan2(a, 1) + sqrt(b)",
        "in_lanes(total(a) if any_of(a > 5) else 0.0)", "(1 if a < b else (2 if a < 1 else b))", "a * n - p[0] + 2",
    ):  # fmt: skip
        assert flaw(lambda value=value: intermediate(lanes.format(value))) == "", value  # type: ignore[misc]
    blocks = "def f(x: floats, y: floats, n: int) -> int32:\n    for k in blocks(n):\n        y[k] = {}\n    return 0\n"
    for value in ("x[k]", "2 * x[k] - block(3)", "where(x[k] > 1, x[k], 0.5)", "abs(x[k]) + max(x[k], y[k])", "one_by_one(x, k)",
                  "x[k] * total(x[k])"):  # fmt: skip
        assert flaw(lambda value=value: intermediate(blocks.format(value))) == "", value  # type: ignore[misc]


# ---------------------------------------------------------------- what is refused


REFUSED = {
    "unknown name": "data[0] = y\nreturn 0",
    "unknown function": "data[0] = gamma(t)\nreturn 0",
    "wrong number of arguments": "data[0] = atan2(t)\nreturn 0",
    "keyword": "data[0] = max(t, t, key=1)\nreturn 0",
    "text": "data[0] = 'a'\nreturn 0",
    "nothing": "data[0] = None\nreturn 0",
    "imaginary": "data[0] = 1j\nreturn 0",
    "slice": "data[0:2] = 1\nreturn 0",
    "real index": "data[t] = 1\nreturn 0",
    "no array": "t[0] = 1\nreturn 0",
    "real number for a whole one": "return t",
    "real number into whole ones": "index[0] = t\nreturn 0",
    "floor division": "data[0] = t // 2\nreturn 0",
    "remainder": "data[0] = t % 2\nreturn 0",
    "shift": "data[0] = 1 << 2\nreturn 0",
    "bits": "data[0] = 1 & 2\nreturn 0",
    "inversion": "data[0] = ~1\nreturn 0",
    "plus": "data[0] = +t\nreturn 0",
    "membership": "data[0] = t in data\nreturn 0",
    "no return": "data[0] = 1",
    "return on one way": "if t > 0:\n    return 1\n",
    "return of nothing": "return",
    "loop over an array": "for k in data:\n    data[0] = 1\nreturn 0",
    "loop with real bounds": "for k in range(t):\n    data[0] = 1\nreturn 0",
    "loop with a step": "for k in range(0, 5, index[0]):\n    data[0] = 1\nreturn 0",
    "loop with else": "for k in range(3):\n    data[0] = 1\nelse:\n    data[1] = 1\nreturn 0",
    "break outside": "break\nreturn 0",
    "number or truth": "data[0] = (t or data[1])\nreturn 0",
    "value on one way": "if t > 0:\n    y = 1.0\ndata[0] = y\nreturn 0",
    "value after a loop": "for k in range(index[0]):\n    y = 1.0\ndata[0] = y\nreturn 0",
    "two kinds in a loop": "s = 0\nfor k in range(3):\n    s += data[k]\ndata[0] = s\nreturn 0",
    "an array or a number": "y = data if t > 0 else t\nreturn 0",
    "a tuple": "a = 1, 2\nreturn 0",
    "unpacking": "a, b = data\nreturn 0",
    "call of itself": "return f(t, data, index)",
    "assertion": "assert t > 0\nreturn 0",
    "attribute": "data[0] = t.real\nreturn 0",
}  # fmt: skip


@pytest.mark.parametrize("body", REFUSED.values(), ids=REFUSED)
def test_refusals_say_where(body: str) -> None:
    with pytest.raises(Unsupported, match=r"line \d+: |`f` must end with a return"):
        intermediate(module(body))


@pytest.mark.parametrize("head", ["def f(t, data: floats) -> int32:", "def f(t: float):", "def f(t: list) -> int32:"])
def test_kinds_must_be_told(head: str) -> None:
    with pytest.raises(Unsupported, match="line 1: `f` must declare the kinds"):
        intermediate(f"{head}\n    return 0\n")


# ---------------------------------------------------------------- at large


def test_sums_of_thousands_of_terms() -> None:
    terms = " + ".join(f"data[{k % 7}]" for k in range(2000))
    data = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    by_machine(module(f"data[0] = {terms}\nreturn 0"), "f", 0.0, data)
    assert data[0] == sum(k % 7 + 1 for k in range(2000))


@pytest.mark.parametrize(
    ("head", "body", "vectors"),
    [
        ("range(n)", "y[k] = 2 * x[k]", False), ("parallel(n)", "y[k] = 2 * x[k]", True), ("parallel(1, n)", "y[k] = 2 * x[k]", True),
        ("parallel(0, n, 2)", "y[k] = 2 * x[k]", False), ("parallel(n)", "y[k] = x[2 * k]", False), ("range(3)", "y[k] = x[k]", False),
        ("parallel(n)", "y[k] += x[k]", False),
    ],
)  # fmt: skip
def test_only_loops_that_ask_for_it_are_made_of_vectors(head: str, body: str, vectors: bool) -> None:
    text = intermediate(f"def f(n: int, x: floats, y: floats) -> int32:\n    for k in {head}:\n        {body}\n    return 0\n")
    assert (LANED in text) == vectors
    assert text.count("ret ") == 1


@pytest.mark.parametrize("body", ["pass", "return", "n = 3", "x[0] = 1.0\n    return\n    x[1] = 2.0"])
def test_a_function_that_returns_nothing_ends_once(body: str) -> None:
    text = intermediate(f"def f(n: int, x: floats) -> None:\n    {body}\n")
    assert text.startswith("define internal void @f(i64 %a.n, ptr %a.x) nounwind {\nstart:\n")
    assert text.count("ret void") == 1
    assert text.endswith("  ret void\n}\n")


def test_hundreds_of_branches() -> None:
    cases = " else ".join(f"{k}.5 if t < {k}" for k in range(700))
    kinds = "".join(f"{'elif' if k else 'if'} index[0] == {k}:\n    data[1] = {k}.25\n" for k in range(600))
    data = np.zeros(2)
    by_machine(module(f"data[0] = {cases} else 9\n{kinds}return 0"), "f", 321.5, data, np.array([555]))
    assert data.tolist() == [322.5, 555.25]


def test_a_function_lives_as_long_as_it_is_held() -> None:
    source = module("data[0] = 6.5 * t\nreturn 7")
    held = compiled(source, "f")
    compiled.cache_clear()
    for number in range(5):
        compiled(module(f"return {number}"), "f")
    compiled.cache_clear()
    gc.collect()
    data = np.zeros(1)
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, POINTER, POINTER)(held.address)
    assert call(2.0, data.ctypes.data, None) == 7
    assert data[0] == 13.0


def test_threads() -> None:
    def run(number: int) -> int:
        return by_machine(module(f"s = 0\nfor k in range({number}):\n    s += k\nreturn s"), "f", 0.0)

    numbers = [1 + k % 20 for k in range(60)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(run, numbers)) == [n * (n - 1) // 2 for n in numbers]
