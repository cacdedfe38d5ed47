"""What loops hand on from one iteration to the next, and which of them work on neighbours, by hand."""

from __future__ import annotations

import ast
from textwrap import indent
from typing import Any

import pytest

from gearlib.compiler.data_flow import carried, grows_with, is_elementwise, is_never_empty, stored


def loop(body: str, head: str = "for k in range(n):") -> Any:
    (found,) = ast.parse(f"{head}\n{indent(body, '    ')}").body
    return found


CARRIED: dict[str, tuple[str, str]] = {
    "nothing": ("y[k] = x[k]", ""),
    "set before it is read": ("a = x[k]\ny[k] = a", ""),
    "read before it is set": ("y[k] = a\na = x[k]", "a"),
    "added to": ("s += x[k]", "s"),
    "added to after it was set": ("s = 1.0\ns += x[k]", ""),
    "an element added to": ("y[k] += s", ""),
    "set in one branch": ("if x[k]:\n    a = 1.0", "a"),
    "set in both branches": ("if x[k]:\n    a = 1.0\nelse:\n    a = 2.0", ""),
    "set in all branches": ("if x[k]:\n    a = 1.0\nelif b:\n    a = 2.0\nelse:\n    a = 3.0", ""),
    "set in all but the last branch": ("if x[k]:\n    a = 1.0\nelif b:\n    a = 2.0", "a"),
    "read in a condition": ("if a > 0:\n    pass\na = x[k]", "a"),
    "read in one branch": ("if b:\n    y[k] = a\na = x[k]", "a"),
    "set unless it goes on": ("if x[k]:\n    continue\na = 1.0", "a"),
    "set unless it is left": ("if x[k]:\n    break\na = 1.0", "a"),
    "set or returned": ("if x[k]:\n    return a\na = 1.0", "a"),
    "set, or returned without it": ("if x[k]:\n    return b\na = 1.0", ""),
    "set before it is left": ("a = 1.0\nif x[k]:\n    break", ""),
    "left on both ways": (
        "if x[k]:\n    a = 1.0\n    continue\nelse:\n    a = 2.0\n    break\nb = a",
        "b",
    ),  # which is not reached
    "set in a loop that may be empty": ("for j in range(n):\n    a = x[j]", "a j"),
    "set in a loop that is not empty": ("for j in range(3):\n    a = x[j]", ""),
    "set in a loop that is left at first": ("for j in range(3):\n    if x[j]:\n        break\n    a = x[j]", "a"),
    "read in an inner loop": ("for j in range(3):\n    y[j] = a\na = 2.0", "a"),
    "read in the bounds of an inner loop": ("for j in range(a):\n    b = 1\na = 2", "a b j"),
    "set in a while loop": ("while b:\n    a = 1.0\n    b = x[k]", "a b"),
    "read in the test of a while loop": ("while a:\n    y[k] = 1.0\na = x[k]", "a"),
    "a counter of its own": ("y[k] = 1.0\nk = 3", ""),
    "several at once": ("a, b = b, a", "a b"),
    "several, one of which was set": ("a = 1.0\na, b = b, a", "b"),
    "set with its kind": ("a: float = x[k]\ny[k] = a", ""),
    "only declared": ("y[k] = s[a]", ""),
}


@pytest.mark.parametrize("kind", CARRIED)
def test_names_that_are_handed_on(kind: str) -> None:
    body, names = CARRIED[kind]
    assert sorted(carried(loop(body))) == names.split()


@pytest.mark.parametrize(("body", "names"), [("a = x[b]\nb += 1", "a b"), ("b = 1\na = b", "a b"), ("y[0] = 1.0", "")])
def test_names_that_while_loops_hand_on(body: str, names: str) -> None:
    """Its body may not be reached, so that whatever it sets is handed on where the test reads it or it is not set in each turn."""
    found = carried(loop(body, "while b < n:"))
    assert found <= set(names.split())
    assert ("b" in found) == ("b" in names.split())
    assert "a" not in found


def test_names_that_are_set_anywhere() -> None:
    text = (
        "a = 1\nb, c[0] = 2, 3\nd += 1\ne: float = 2\nif p:\n    f = 1\nelse:\n    g = 1\n"
        "for h in range(3):\n    i = 1\nwhile q:\n    j = 1\nr.s = 4\nt(u)\nreturn v"
    )
    assert stored(ast.parse(f"def f():\n{indent(text, ' ')}").body[0].body) == set("abdefghij")  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("bounds", "never"),
    [
        ("1", True), ("0", False), ("2, 3", True), ("3, 3", False), ("3, 2", False), ("3, 2, -1", False), ("0, 5, 7", True),
        ("n", False), ("0, n", False), ("2.0", False), ("3, n", False), ("n, 3", False), ("0, 3, n", False), ("0, 3, 2.0", False),
    ],
)  # fmt: skip
def test_ranges_that_are_never_empty(bounds: str, never: bool) -> None:
    assert is_never_empty(loop("pass", f"for k in range({bounds}):").iter) == never
    assert not is_never_empty(ast.parse("names", mode="eval").body)


ELEMENTWISE = {
    "y[k] = x[k]": True, "y[a + k] = x[k + b]": True, "y[k + 1] = 2 * x[k] - x[3] / s": True, "y[a + (b + k)] = -x[k]": True,
    "y[k] = 0.0": True, "y[k] = x[a - b]": True, "y[k] = k": False, "y[0] = x[k]": False, "y[k] = x[2 * k]": False,
    "y[k - 1] = x[k]": False, "y[k + k] = x[k]": False, "y[k] = x[-k]": False, "y[k] = x[k] * k": False, "y[k] = sin(x[k])": False,
    "y[k] = x[k] ** 2": False, "y[k] = x[k] > 0": False, "y[k] = x[i[k]]": False, "y[k] += x[k]": False, "y = x[k]": False,
    "y[k] = x[k]; z[k] = x[k]": False, "y[k] = x[k] // 2": False, "y[k] = 1.0 if a else x[k]": False,
}  # fmt: skip


@pytest.mark.parametrize("body", ELEMENTWISE)
def test_loops_over_neighbours(body: str) -> None:
    assert is_elementwise(loop(body), "k") == ELEMENTWISE[body]


def test_indices_that_grow_with_a_name() -> None:
    found = [grows_with(ast.parse(text, mode="eval").body, "k") for text in ("k", "a + k", "x[k]", "a", "kk", "3")]
    assert found == [True, True, True, False, False, False]
