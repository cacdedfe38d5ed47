"""Symmetries of equations whose symmetries are known beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.invariance import symmetries

P = 3.0  # value of the parameter p


def model(rates: Any, more: Any = lambda s: []) -> gl.Component:
    """Three states with given rates, and unknowns y and z."""

    def equations(self: Any) -> list[Any]:
        right = zip((self.a, self.b, self.c), rates(self), strict=True)
        unknown = more(self) or [gl.Eq(self.y, 0)]
        unknown += [gl.Eq(self.z, 0)] if len(unknown) == 1 else []
        return [*(gl.Eq(gl.der(x), self.rate * f) for x, f in right), *unknown]

    names = (
        {name: gl.Variable("1") for name in "abcyz"}
        | {"p": gl.Parameter("1", default=P)}
        | {"none": gl.Parameter("1", default=0.0)}
    )
    rate = gl.Parameter("1/s", default=1.0)
    return type("Model", (gl.Component,), names | {"rate": rate, "equations": equations})()  # type: ignore[no-any-return]


# what the rates are, what else holds, and the directions (a, b, c) that change nothing
KNOWN: dict[str, tuple[Any, Any, list[list[float]]]] = {
    "nothing counts": (lambda s: (1, 2, gl.sin(s.rate * gl.time)), lambda s: [], np.eye(3).tolist()),
    "all count": (lambda s: (s.a, s.b - s.a, s.c), lambda s: [], []),
    "difference": (lambda s: (s.a - s.b, s.b - s.a, s.c), lambda s: [], [[1, 1, 0]]),
    "ratio": (lambda s: (s.p * s.a - s.b, s.b - s.p * s.a, 1e-4 * s.c), lambda s: [], [[1, P, 0]]),
    "weak spring": (lambda s: (1e-7 * (s.a - s.b), s.b - s.a, 1e7 * (s.c - s.a)), lambda s: [], [[1, 1, 1]]),
    "sine of a difference": (lambda s: (gl.sin(s.a - s.b), 0, s.c), lambda s: [], [[1, 1, 0]]),
    "function of a ratio's twist": (lambda s: ((s.a - s.p * s.b) ** 3, 0, s.c), lambda s: [], [[P, 1, 0]]),
    "product": (lambda s: (s.a * s.b, 0, 0), lambda s: [], [[0, 0, 1]]),
    "two functions": (lambda s: (gl.sin(s.a - s.b), gl.cos(s.b - s.c), 0), lambda s: [], [[1, 1, 1]]),
    "sum of functions": (lambda s: (gl.sin(s.a - s.b) + gl.exp(s.b - s.c), 0, 0), lambda s: [], [[1, 1, 1]]),
    "function of one": (lambda s: (gl.sin(s.a), 0, 0), lambda s: [], [[0, 1, 0], [0, 0, 1]]),
    "function of three": (lambda s: ((s.a + s.b - 2 * s.c) ** 2, 0, 0), lambda s: [], [[1, -1, 0], [2, 0, 1]]),
    "block": (
        lambda s: (s.y, 0, s.c),
        lambda s: [gl.Eq(s.y**3 + s.p * s.y, s.a - s.b)],
        [[1, 1, 0]],
    ),
    "block in which an unknown moves": (
        lambda s: (s.y, 0, s.c),
        lambda s: [gl.Eq(s.y - s.z, s.a), gl.Eq(gl.sin(s.y) + s.p * s.y + s.z, s.b)],
        [[1, -1, 0]],
    ),
    "two blocks": (
        lambda s: (s.y, s.z, 0),
        lambda s: [gl.Eq(s.y**3 + s.p * s.y, s.a - s.b), gl.Eq(s.z**3 + s.p * s.z, s.b - s.c)],
        [[1, 1, 1]],
    ),
    "block of two": (
        lambda s: (s.y, 0, 0),
        lambda s: [gl.Eq(s.y**3 + s.z, s.a - s.p * s.b), gl.Eq(s.z**3 - s.y, s.b - s.c)],
        [[P, 1, 1]],
    ),
    "linear and not": (lambda s: (gl.sin(s.a - s.b) + s.p * (s.a - s.c), 0, 0), lambda s: [], [[1, 1, 1]]),
    "block that is linear and not": (
        lambda s: (s.y - s.a, 0, s.c - s.b),
        lambda s: [gl.Eq(gl.sin(s.y - s.a) + s.p * (s.y - s.b), 0)],
        [[1, 1, 1]],
    ),
    "magnitudes": (lambda s: (abs(s.a) + abs(s.b), 0, 0), lambda s: [], [[0, 0, 1]]),
    "magnitude of a difference": (lambda s: (abs(s.a - s.b) * (s.a - s.b), 0, 0), lambda s: [], [[1, 1, 0], [0, 0, 1]]),
    "condition on a difference": (
        lambda s: (gl.Piecewise((1.0, s.a - s.b > 1), (2.0, True)), 0, s.c),
        lambda s: [],
        [[1, 1, 0]],
    ),
    "condition on one": (lambda s: (gl.Piecewise((1.0, s.a > 1), (2.0, True)), 0, s.c), lambda s: [], [[0, 1, 0]]),
    "condition on a block beside another": (
        lambda s: (gl.Piecewise((1.0, s.y > 1), (2.0, True)), 0, s.z),
        lambda s: [gl.Eq(s.y**3 + s.p * s.y, s.a - s.b), gl.Eq(s.z**3 + s.p * s.z, s.b - s.c)],
        [[1, 1, 1]],
    ),
    "condition on a block of two": (
        lambda s: (gl.Piecewise((1.0, s.y > 1), (2.0, True)), 0, 0),
        lambda s: [gl.Eq(s.y**3 + s.z, s.a - s.p * s.b), gl.Eq(s.z**3 - s.y, s.b - s.c)],
        [[P, 1, 1]],
    ),
    "condition on one unknown of a block that the rates need": (
        lambda s: (s.y, gl.Piecewise((1.0, s.z > 1), (2.0, True)), 0),
        lambda s: [gl.Eq(s.y**3 + s.z, s.a - s.b), gl.Eq(s.z**3 - s.y, s.b - s.c)],
        [[1, 1, 1]],
    ),
    "large and small parts of one function": (
        lambda s: ((s.a - s.b) ** 4 + gl.sin(s.b - s.c), 0, 0), lambda s: [], [[1, 1, 1]],
    ),
    "very weak spring": (lambda s: (1e-12 * (s.a - s.b), 1e3 * (s.b - s.c), 0), lambda s: [], [[1, 1, 1]]),
    "function of a sum with a parameter that is zero": (lambda s: (gl.sin(s.a + s.none), 0, 0), lambda s: [], [[0, 1, 0], [0, 0, 1]]),
    "spring that time changes": (lambda s: (gl.sin(s.rate * gl.time) * (s.a - s.b), 0, s.c), lambda s: [], [[1, 1, 0]]),
    "function that time changes": (
        lambda s: (gl.sin(s.rate * gl.time) * gl.sin(s.a - s.b), 0, (gl.cos(s.rate * gl.time) - 1) * (s.c - s.b)), lambda s: [],
        [[1, 1, 1]],
    ),
    "constant block": (  # y = a - b, but for rounding
        lambda s: (s.y, 0, 0),
        lambda s: [
            gl.Eq(0.1 * s.p * s.y + 0.7 * s.z, 0.1 * s.p * (s.a - s.b) + 0.7 * (s.b - s.c)),
            gl.Eq(0.3 * s.y - 0.9 * s.p * s.z, 0.3 * (s.a - s.b) - 0.9 * s.p * (s.b - s.c)),
        ],
        [[1, 1, 0], [0, 0, 1]],
    ),
    "function of a difference from nothing": (lambda s: (gl.sin(s.a - s.z), 0, 0), lambda s: [], [[0, 1, 0], [0, 0, 1]]),
    "another function later": (
        lambda s: (gl.Piecewise((gl.sin(s.a - s.b), s.rate * gl.time > 1), (gl.sin(s.a + s.b), True)), 0, 0),
        lambda s: [],
        [[0, 0, 1]],
    ),
    "vanishes with a parameter": (
        lambda s: ((1 - gl.cos(s.none)) * gl.sin(s.a) + s.b - s.c, gl.sin(s.none * s.a * s.b), 0),
        lambda s: [],
        [[1, 0, 0], [0, 1, 1]],
    ),
    "function of a difference in a narrow interval only": (  # no symmetry rather than a false one
        lambda s: (gl.exp(-1e12 * (s.a - s.b - 50) ** 2), 0, 0),
        lambda s: [],
        [[0, 0, 1]],
    ),
    "gap": (
        lambda s: (gl.Piecewise((s.a - s.b - 1, s.a - s.b > 1), (0.0, True)), 0, s.c),
        lambda s: [],
        [[1, 1, 0]],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KNOWN)
def test_symmetries(kind: str) -> None:
    rates, more, expected = KNOWN[kind]
    translation = gl.compile(model(rates, more)).translation
    scene = translation.scene
    numbers = scene.numbers(translation.parameter_values({}))
    order = ["abc".index(name) for name in scene.state_names]
    for scale in (np.ones(3), np.array([1.0, 1e-3, 50.0])):
        events = None if scene.relations is None else (scene.relations, numbers.relations)
        found = symmetries(numbers, scene.program.output_slots.tolist(), events, scale[order])
        basis = np.linalg.qr((np.array(expected).reshape(-1, 3) / scale).T)[0] if expected else np.zeros((3, 0))
        assert found.shape == basis.shape
        assert (found.T @ found) == pytest.approx(np.eye(found.shape[1]), abs=1e-12)
        assert found @ found.T == pytest.approx((basis @ basis.T)[np.ix_(order, order)], abs=1e-8)


@pytest.mark.parametrize("n", [14, 26])
@pytest.mark.parametrize("kind", ["of squares", "of two sums"])
def test_a_function_of_many_states(kind: str, n: int) -> None:
    """Nothing that leaves its sums alone changes it, however many terms they have."""
    free = {"of squares": 0, "of two sums": n - 2}[kind]
    weights = 1.0 + np.arange(n) % 3

    def equations(self: Any) -> list[Any]:
        x = [getattr(self, f"x{i}") for i in range(n)]
        one, other = (sum(float(w) * part for w, part in zip(weights[i::2], x[i::2], strict=True)) for i in (0, 1))
        functions = {"of squares": sum(a**4 for a in x), "of two sums": one * other}
        return [gl.Eq(gl.der(a), self.rate * (functions[kind] if i == 0 else 1.0)) for i, a in enumerate(x)]

    names = {f"x{i}": gl.Variable("1") for i in range(n)} | {"rate": gl.Parameter("1/s", default=1.0)}
    translation = gl.compile(type("Many", (gl.Component,), names | {"equations": equations})()).translation
    scene = translation.scene
    numbers = scene.numbers(translation.parameter_values({}))
    found = symmetries(numbers, scene.program.output_slots.tolist(), None, np.ones(n))
    assert found.shape == (n, free)
    places = np.array([int(name[1:]) for name in scene.state_names])
    for i in range(2):
        assert (weights * (np.arange(n) % 2 == i))[places] @ found == pytest.approx(np.zeros(free), abs=1e-8)


@pytest.mark.parametrize(
    "kinds",
    [
        ("ratio", "sine of a difference", "block of two", "magnitudes"),
        ("gap", "condition on a block beside another", "constant block", "function that time changes"),
        ("vanishes with a parameter", "block that is linear and not", "function of three", "two blocks", "very weak spring"),
    ],
    ids=" / ".join,
)
def test_systems_beside_each_other_have_the_symmetries_of_each(kinds: tuple[str, ...]) -> None:
    """With event functions or without, in units of any size."""

    class Beside(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [model(*KNOWN[kind][:2]) for kind in kinds]
            return []

    translation = gl.compile(Beside()).translation
    scene = translation.scene
    numbers = scene.numbers(translation.parameter_values({}))
    names = [f"part[{k}].{name}" for k in range(len(kinds)) for name in "abc"]
    order = [names.index(name) for name in scene.state_names]
    directions = [
        np.eye(len(kinds))[k].repeat(3) * np.tile(d, len(kinds)) for k, kind in enumerate(kinds) for d in KNOWN[kind][2]
    ]
    events = None if scene.relations is None else (scene.relations, numbers.relations)
    for scale in (np.ones(len(names)), 10.0 ** np.random.default_rng(len(kinds)).uniform(-2, 2, len(names))):
        found = symmetries(numbers, scene.program.output_slots.tolist(), events, scale[order])
        basis = np.linalg.qr((np.array(directions) / scale).T)[0]
        assert found.shape == basis.shape
        assert found.T @ found == pytest.approx(np.eye(found.shape[1]), abs=1e-12)
        assert found @ found.T == pytest.approx((basis @ basis.T)[np.ix_(order, order)], abs=1e-8)
