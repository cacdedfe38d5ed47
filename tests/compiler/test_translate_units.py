"""Statements and expressions of the small language one by one: compiled anew each time, against what Python makes of them."""

from __future__ import annotations

import ast
import ctypes
import math
from typing import Any

import numpy as np
import pytest

from gearlib.compiler import translate
from gearlib.compiler.instructions import LANED, Unsupported
from gearlib.compiler.object_code import linked, optimised
from gearlib.compiler.small_language import Prototype, record
from gearlib.compiler.translate import LARGEST_POWER, chain, intermediate


@record
class Box(ctypes.Structure):
    """Two numbers, and an address."""

    n: int
    x: float
    at: int


FACTORS, EMPTY, LIMIT, RATE, ON = (2.0, 3.0, 5.0), (), 7, 0.25, True
ENVIRONMENT = {"FACTORS": FACTORS, "EMPTY": EMPTY, "LIMIT": LIMIT, "RATE": RATE, "ON": ON, "Box": Box}
HELPERS = """
def half(x: float) -> float:
    return x / 2

def both_of(x: float, n: int) -> tuple[float, int, bool]:
    return x + 1, n * 2, x > n

def passed_on(x: float, n: int) -> tuple[float, int, bool]:
    return both_of(x - 1, n)

def fill(d: floats, value: float) -> None:
    if value < 0:
        return
    d[0] = value

def is_large(x: float) -> bool:
    return x > 10

def whole(n: int) -> int:
    return n + ON
"""


def code_of(source: str) -> str:
    """What a source is compiled to, which has to be of the language."""
    try:
        return intermediate(source, ENVIRONMENT)
    except Unsupported as refused:
        return pytest.fail(f"refused: {refused}")


def by_machine(body: str, floats: Any, ints: Any, t: float) -> int:
    source = (
        HELPERS + "\ndef f(t: float, d: floats, i: ints) -> int32:\n" + "".join(f"    {line}\n" for line in body.splitlines())
    )
    addresses, library = linked(optimised(code_of(source)), ["f"])
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)(addresses["f"])
    code = int(call(t, floats.ctypes.data, ints.ctypes.data))
    del library
    return code


def by_python(body: str, floats: list[float], ints: list[int], t: float) -> int:
    text = HELPERS + "\ndef f(t, d, i):\n" + "".join(f"    {line}\n" for line in body.splitlines())
    names: dict[str, Any] = {**vars(math), "math": math, "parallel": range, "blocks": range, **ENVIRONMENT}
    exec("from __future__ import annotations\n" + text, names)
    return int(names["f"](t, floats, ints))


PROGRAMS = {
    "unrolled over numbers": "for c in FACTORS:\n    d[0] += c * d[1]\nreturn 0",
    "unrolled over nothing": "for c in EMPTY:\n    d[0] = 9.0\nreturn 0",
    "unrolled, with a condition": "for c in FACTORS:\n    if d[2] > c:\n        d[0] += 1.0\n    else:\n        d[1] += c\nreturn 3",
    "how many numbers": "return len(FACTORS) + len(EMPTY) + LIMIT",
    "numbers by their places": "d[0], d[1] = FACTORS[1], FACTORS[2]\nreturn 0",
    "numbers of the environment": "d[0] = RATE * LIMIT\nreturn 5 if ON else 6",
    "a name hides a number of the environment": "LIMIT = 3\nreturn LIMIT",
    "several targets": "a = d[1] = d[2] = d[0] * 2\nd[3] = a\nreturn 0",
    "swapped elements": "d[i[0]], d[i[1]] = d[i[1]], d[i[0]]\nreturn 0",
    "a name with its kind": "a: float = 3\nb: int = i[1]\nd[0] = a / 2\nreturn b",
    "a call of another function": "d[0] = half(d[1]) + half(i[1])\nreturn whole(4)",
    "a tuple of another function": "a, b, c = both_of(d[1], i[1])\nd[0] = a\nreturn b if c else -b",
    "a tuple that is passed on": "a, b, c = passed_on(20.0, 3)\nd[0] = a\ni[0] = b\nreturn 1 if c else 2",
    "a call for its effect": "fill(d, 8.0)\nfill(d, -1.0)\nreturn 0",
    "a condition of another function": "if is_large(d[0]) or is_large(11.0):\n    return 1\nreturn 2",
    "a truth as a number": "return is_large(11.0)",
    "an element of whole numbers": "i[0] = i[1] + 3\ni[1] += 2\ni[2] -= i[0]\ni[0] *= 4\nreturn i[2]",
    "an element changed": "d[0] += 1\nd[1] -= 2.5\nd[2] *= d[0]\nd[3] /= 4\nreturn 0",
    "a name changed": "a = d[0]\na += 1\na *= 3\na -= d[1]\na /= 2\nd[0] = a\nreturn 0",
    "floor division and remainder": (
        "k = 0\nfor a in range(-7, 8):\n    for b in range(1, 4):\n        k = 31 * k + a // b + a % b * 5\n"
        "        k = (k + a // -b) % 10007\nreturn k"
    ),
    "a chain of operations": "return 2 + 3 * i[1] - i[2] * i[2] // 2 % 5 + 100 // 7 * 2",
    "powers of whole numbers": "return i[1]**3 - (-2)**3 + 2**0 + i[2]**1",
    "powers of numbers": "d[0] = d[1]**5 + d[1]**-2 + d[2]**0 - d[3]**1\nreturn 0",
    "powers by the library": "d[0] = d[1]**d[2] + 2**d[1] + d[2]**0.5 + d[1]**i[1]\nreturn 0",
    "constants of mathematics": "d[0] = pi + e\nd[1] = -inf\nreturn 0",
    "a truth of numbers": "k = 0\nif d[0]:\n    k += 1\nif not i[0]:\n    k += 2\nif d[3] - d[3]:\n    k += 4\nreturn k",
    "not, and signs": "a = d[0] > 1\nd[0] = -d[1] - -d[2]\nreturn 1 if not a else 2",
    "comparisons in a row": (
        "return (1 if 0 < i[1] <= i[2] < 9 else 0) + (10 if 0 < i[2] < i[1] < 9 else 0) + (100 if 1 == i[1] != 3 else 0)"
    ),
    "chosen of three kinds": "a = i[1] if d[0] > 1 else (d[1] if d[0] < -1 else d[2] > 1)\nd[3] = a\nreturn 0",
    "chosen of whole numbers": "return 4 if d[0] > 1 else (i[1] if d[1] > 100 else -3)",
    "chosen in a chain": "d[0] = 1.5 if t < 0 else 2.5 if t < 0.5 else 3.5 if t < 1 else 4.5\nreturn 0",
    "chosen values are not computed in vain": "d[0] = d[i[0]] if i[0] < 4 and i[0] >= 0 else 0.0\nreturn 0",
    "joined names": "if t > 0:\n    a = 1.0\n    b = 2\nelse:\n    a = 3.0\n    b = 4\nd[0] = a\nreturn b",
    "joined names that are equal": "a = d[1]\nif t > 9:\n    d[0] = a\nelif t > 8:\n    d[0] = 2 * a\nd[2] = a\nreturn 0",
    "a name that ends with its branch": "b = 1\nif t > 0:\n    a = 1.0\n    d[0] = a\nelse:\n    b = 2\nreturn b",
    "left by all ways": "if t > 0:\n    return 1\nelif t < -1:\n    return 2\nelse:\n    return 3\nd[0] = 9.0",
    "a loop backwards": "s = 0\nfor k in range(6, 1, -1):\n    s = 10 * s + k\nreturn s",
    "a loop with a stride": "s = 0\nfor k in range(1, 9, 3):\n    s = 10 * s + k\nreturn s",
    "a loop that ends where it begins": "s = 5\nfor k in range(i[1], i[1]):\n    s = 6\nfor k in range(3, 3, -1):\n    s = 7\nreturn s",
    "a loop that never begins": "s = 5\nfor k in range(4, i[0]):\n    s = 6\nreturn s",
    "what a loop leaves": "s = 0.0\nfor k in range(1, 4):\n    last = d[k]\n    s += last\nd[0] = s - last\nreturn k",
    "loops within loops": (
        "s = 0\nfor a in range(3):\n    for b in range(a, 3):\n        for c in range(b):\n            s += 100 * a + 10 * b + c\nreturn s"
    ),
    "break and continue": (
        "s = 0\nfor a in range(9):\n    if a == 2:\n        continue\n    if a == 6:\n        break\n    s = 10 * s + a\nreturn s"
    ),
    "while": (
        "n, s = 27, 0\nwhile n != 1 and s < 200:\n    if n % 2 == 0:\n        n = n // 2\n"
        "    else:\n        n = 3 * n + 1\n    s += 1\nreturn s"
    ),
    "while for ever": (
        "n = 0\nwhile True:\n    n += 3\n    if n > 20:\n        break\n    if n % 2 == 0:\n        continue\n    d[0] += n\nreturn n"
    ),
    "while with a return": "n = 0\nwhile n < 50:\n    n += 7\n    if n > 30:\n        return n\nreturn -1",
    "for ever, with nothing behind": "n = 0\nwhile True:\n    n += 1\n    if n > 5:\n        return n",
    "never": "while False:\n    d[0] = 9.0\nwhile ON:\n    d[1] = 8.0\n    break\nreturn 0",
    "while not": "n = 0\nwhile not (n > 4 or d[0] > 99):\n    n += 1\n    d[0] += 30\nreturn n",
    "extremes": "d[0] = max(d[1], d[2], 1) - min(d[1], i[1], 2.5)\nreturn max(i[1], i[2]) - min(i[0], 3)",
    "whole parts": "return int(2.9) + int(-2.9) * 10 + int(i[1]) * 100",
    "magnitudes": "d[0] = abs(d[1] - 9) + abs(-2.5)\nreturn abs(i[0] - 4) + abs(i[2])",
    "functions": "d[0] = sin(d[1]) + cos(1) + atan2(d[1], -d[2]) + copysign(2, -d[0]) + math.sqrt(d[2]) + math.pi\nreturn 0",
    "neighbours": "for k in parallel(3):\n    d[k] = d[k + 1] * 2 - d[0 + k]\nreturn 0",
    "nothing": "pass\n'text'\nreturn 0",
}  # fmt: skip


@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_are_pythons(name: str) -> None:
    body = PROGRAMS[name]
    for t, numbers, whole in ((0.75, [0.5, 1.5, 2.25, 4.0], [0, 2, 5]), (-2.0, [3.0, 1.25, 0.5, -1.0], [1, 1, 3])):
        floats, ints = np.array(numbers), np.array(whole, np.int64)
        others, wholes = list(numbers), list(whole)
        expected = by_python(body, others, wholes, t)
        assert by_machine(body, floats, ints, t) == expected
        assert floats.tolist() == pytest.approx([float(x) for x in others], rel=1e-15)
        assert ints.tolist() == wholes


def function(source: str, name: str, *kinds: Any) -> Any:
    """A compiled function and what owns it."""
    addresses, library = linked(optimised(code_of(source)), [name])
    call: Any = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(addresses[name])
    call.library = library
    return call


def test_fields_of_records_and_what_stands_at_addresses() -> None:
    """Also of a record whose address is a field of another: a call of its name gives it, as one of floats_at gives an array."""
    source = """
def f(b: Box, k: int) -> int32:
    b.n += k
    b.x = b.x * 2 + b.n
    c = Box(b.at)
    c.x = 1.5 - b.x
    d, m, j = floats_at(c.at), ints_at(c.n), int32s_at(k)
    d[1] = c.x / 2
    m[0] = 7 * m[1]
    j[1] = j[0] + 1
    return j[1]
"""
    numbers, whole, short = np.zeros(3), np.array([0, 6]), np.array([41, 0, 9], np.int32)
    inner = Box(n=whole.ctypes.data, x=0.0, at=numbers.ctypes.data)
    outer = Box(n=1, x=4.0, at=ctypes.addressof(inner))
    k = short.ctypes.data
    assert function(source, "f", ctypes.c_void_p, ctypes.c_int64)(ctypes.addressof(outer), k) == 42
    assert (outer.n, outer.x) == (1 + k, 8.0 + 1 + k)
    assert inner.x == 1.5 - outer.x
    assert numbers.tolist() == [0.0, inner.x / 2, 0.0]
    assert (whole.tolist(), short.tolist()) == ([42, 6], [41, 42, 9])


def test_a_prototype_is_called_with_arguments_of_its_kinds() -> None:
    seen: list[Any] = []
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_int64, ctypes.c_int32)
    callback = kind(lambda x, n, i: seen.append((x, n, i)) or -5)  # type: ignore[func-returns-value]
    address = ctypes.cast(callback, ctypes.c_void_p).value
    source = "def f(a: int, x: float) -> int32:\n    ask(a, x, 3, 4)\n    return ask(a, 2, 9, 7) * 2\n"
    environment = {"ask": Prototype("int32", ("float", "int", "int32"))}
    text = intermediate(source, environment)
    assert text.count(" = inttoptr i64 %a.a to ptr\n") == 2
    addresses, library = linked(optimised(text), ["f"])
    assert ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double)(addresses["f"])(address, 0.5) == -10
    assert seen == [(0.5, 3, 4), (2.0, 9, 7)]
    del library


BLOCKS = {
    "x[k] + 2 * y[k]": lambda x, y, t: x + 2 * y, "x[k] * t - block(3)": lambda x, y, t: x * t - 3,
    "where(x[k] > y[k], x[k], 0.5)": lambda x, y, t: np.where(x > y, x, 0.5), "abs(x[k]) / y[k]": lambda x, y, t: np.abs(x) / y,
    "max(x[k], y[k], 0.0)": lambda x, y, t: np.maximum(np.maximum(x, y), 0.0), "-x[k] + x[2]": lambda x, y, t: -x + x[2],
    "one_by_one(y, k) * total(block(t))": lambda x, y, t: y * 4 * t, "y[k]**3": lambda x, y, t: y**3,
}  # fmt: skip


@pytest.mark.parametrize("text", BLOCKS)
def test_blocks_of_elements(text: str) -> None:
    source = (
        "def f(n: int, t: float, x: floats, y: floats, z: floats) -> int32:\n    s = 0.0\n    for k in blocks(n):\n"
        f"        z[k] = {text}\n        s += total(z[k])\n    z[n] = s\n    return 0\n"
    )
    rng = np.random.default_rng(2)
    call = function(source, "f", ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * 3)
    for n in (4, 12):
        x, y, z = rng.normal(size=n), rng.uniform(1.0, 2.0, n), np.zeros(n + 1)
        call(n, 0.75, x.ctypes.data, y.ctypes.data, z.ctypes.data)
        expected = BLOCKS[text](x, y, 0.75)
        assert z == pytest.approx([*expected, expected.sum()])


@pytest.mark.parametrize(
    ("exponent", "multiplied"), [(LARGEST_POWER, True), (-LARGEST_POWER, True), (LARGEST_POWER + 1, False)]
)
def test_very_large_powers_are_left_to_the_library(exponent: int, multiplied: bool) -> None:
    text = intermediate(f"def f(x: float) -> float:\n    return x**{exponent}")
    assert ("@llvm.pow.f64" in text) != multiplied
    assert (text.count("fmul") == 16) == multiplied


REFUSALS = {
    "d[0] = FACTORS": "`FACTORS` has no value there, or values of two kinds",
    "d[0] = FACTORS[i[0]]": "`FACTORS` has no value there, or values of two kinds",
    "d[0] = nothing": "`nothing` has no value there, or values of two kinds",
    "d[0] = LIMIT.real": "`LIMIT.real`: there is no such field",
    "a, b = both_of(t, 1)": "`both_of(t, 1)` is not in the language of generated functions",
    "a, b, c, e = both_of(t, 1)": "`both_of(t, 1)` is not in the language of generated functions",
    "a, b = t": "`t` is not in the language of generated functions",
    "d[0] = half(t, t)": "`half` takes 1 arguments, not 2",
    "d[0] = half()": "`half` takes 1 arguments, not 0",
    "d[0] = sin(t, t)": "`sin` with 2 arguments is not a function that can be compiled",
    "d[0] = atan2(t)": "`atan2` with 1 arguments is not a function that can be compiled",
    "d[0] = max(t)": "`max` with 1 arguments is not a function that can be compiled",
    "d[0] = abs(t, t)": "`abs` with 2 arguments is not a function that can be compiled",
    "d[0] = int(t, t)": "`int` with 2 arguments is not a function that can be compiled",
    "d[0] = where(t > 0, t)": "`where` with 2 arguments is not a function that can be compiled",
    "d[0] = both(t > 0)": "`both` with 1 arguments is not a function that can be compiled",
    "d[0] = total(t)": "`total` with 1 arguments is not a function that can be compiled",
    "d[0] = any_of(t > 0)": "`any_of` with 1 arguments is not a function that can be compiled",
    "d[0] = block(t, t)": "`block` with 2 arguments is not a function that can be compiled",
    "floats_at(t)": "`floats_at` with 1 arguments is not a function that can be compiled",
    "Box(t)": "`Box` with 1 arguments is not a function that can be compiled",
    "d[0] = d.sum()": "`d.sum()` is not in the language of generated functions",
    "d[0] = max(t, key=1)": "`max(t, key=1)` is not in the language of generated functions",
    "d[0] = t is i": "`t is i` is not in the language of generated functions",
    "d[0] //= 2": "`d[0] //= 2` is not in the language of generated functions",
    "d[0] = 1 ^ 2": "`1 ^ 2` is not in the language of generated functions",
    "d[0] = 5 % t": "`//` and `%` are for whole numbers",
    "d[0] = t > 0 and t": "`t > 0 and t` is not in the language of generated functions",
    "for k in range(): pass": "`range()` is not in the language of generated functions",
    "for k in range(2, 5, 0): pass": "`range(2, 5, 0)` is not in the language of generated functions",
    "for k in range(1.0): pass": "`range(1.0)` is not in the language of generated functions",
    "for k in d: pass": "`d` is not in the language of generated functions",
    "for k in other(3): pass": "`other(3)` is not in the language of generated functions",
    "for k, j in range(3): pass": "`for k, j in range(3):\n    pass` is not in the language of generated functions",
    "while t > 0: pass\nelse: d[0] = 1": "`while t > 0:\n    pass\nelse:\n    d[0] = 1` is not in the language of generated functions",
    "continue": "`continue` is not in the language of generated functions",
    "a: float": "`a: float` is not in the language of generated functions",
    "t > 0": "`t > 0` is not in the language of generated functions",
    "(d if t > 0 else i)[0] = 1": "`d if t > 0 else i` is not in the language of generated functions",
    "(a, b)[0] = 1": "`(a, b)` is not in the language of generated functions",
    "if t > 0:\n    a = 1.0\nelse:\n    a = 2\nd[0] = a": "`a` has no value there, or values of two kinds",
    "if t > 0:\n    a = 1.0\nd[0] = a": "`a` has no value there, or values of two kinds",
    "for k in range(i[0]):\n    a = 1.0\nd[0] = a": "`a` has no value there, or values of two kinds",
    "k = 1\nwhile k < 5:\n    k = k * 1.5": "`k` is of one kind before the loop and of another in it",
}  # fmt: skip


@pytest.mark.parametrize("body", REFUSALS)
def test_what_is_not_of_the_language_is_refused_with_its_line(body: str) -> None:
    text = "".join(f"    {line}\n" for line in body.splitlines())
    with pytest.raises(Unsupported) as refused:
        intermediate(f"{HELPERS}\ndef f(t: float, d: floats, i: ints) -> int32:\n    e = 1\n{text}    return 0\n", ENVIRONMENT)
    first = HELPERS.count("\n") + 4
    place, _, said = str(refused.value).partition(": ")
    assert place.startswith("line ")
    assert first <= int(place[5:]) < first + text.count("\n")
    assert said == REFUSALS[body]


@pytest.mark.parametrize(
    ("head", "ending", "said"),
    [
        ("def f() -> None:", "return 1", "line 2: `return 1` is not in the language of generated functions"),
        ("def f() -> float:", "return", "line 2: `return` is not in the language of generated functions"),
        ("def f(x: float) -> float:", "x = 2.0", "`f` must end with a return"),
        ("def f(x: float) -> tuple[float, list]:", "return x, x", "line 1: `f` must declare the kinds of its arguments and of its result"),
        ("def f(x: list[float]) -> float:", "return 1.0", "line 1: `f` must declare the kinds of its arguments and of its result"),
        ("def f(x: 3) -> float:", "return 1.0", "line 1: `f` must declare the kinds of its arguments and of its result"),
        ("def f(x: float):", "return 1.0", "line 1: `f` must declare the kinds of its arguments and of its result"),
    ],
)  # fmt: skip
def test_what_a_function_declares_it_gives_back(head: str, ending: str, said: str) -> None:
    with pytest.raises(Unsupported) as refused:
        intermediate(f"{head}\n    {ending}\n")
    assert str(refused.value) == said


def annotation(text: str) -> Any:
    return ast.parse(text, mode="eval").body


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("float", "double"), ("int", "i64"), ("int32", "i32"), ("bool", "i1"), ("None", "void"), ("floats", "double*"), ("ints", "i64*"),
        ("int32s", "i32*"), ("lane", LANED), ("lanes", f"{LANED}*"), ("Box", "Box*"), ("tuple[float, int]", "{ double, i64 }"),
        ("tuple[bool, int32, float]", "{ i1, i32, double }"), ("tuple[float]", None), ("tuple[float, text]", None), ("text", None),
        ("3", None), ("LIMIT", None), ("a.b", None),
    ],
)  # fmt: skip
def test_kinds_of_annotations(text: str, kind: str | None) -> None:
    assert translate.kind_of(annotation(text), ENVIRONMENT) == kind
    assert translate.kind_of(None, ENVIRONMENT) is None


def test_parts_of_tuples_chains_of_operations_and_loops_that_go_on() -> None:
    assert translate.parts_of("{ double, i64, i1 }") == ["double", "i64", "i1"]
    assert translate.parts_of("double") == []
    first, later = chain(annotation("a ** 2 + b * c - d / 4"))
    assert ast.unparse(first) == "a ** 2"
    assert [ast.unparse(one.right) for one in later] == ["b * c", "d / 4"]
    first, later = chain(annotation("x ** y"))
    assert (ast.unparse(first), later) == ("x ** y", [])
    for text, goes_on in (
        ("a = 1", False), ("continue", True), ("if a:\n    b = 1\nelse:\n    continue", True), ("if a:\n    continue", True),
        ("while a:\n    if b:\n        continue", True), ("if a:\n    break", False), ("", False),
    ):  # fmt: skip
        assert translate.has_continue(ast.parse(text).body) == goes_on, text
