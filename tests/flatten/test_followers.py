"""What follows, by equations alone, from variables that move with a phase or with time, for equations whose answer is seen at a glance."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearlib.flatten.followers import (
    determined,
    followers_of,
    nonlinear_terms,
    others_of,
    products_in_time,
    rates_of,
    slopes_of,
)
from gearlib.flatten.model import FlatModel

Laws = Callable[[Any], list[Any]]


def flat(laws: Laws) -> FlatModel:
    """Laws of plain variables; those of n, m and the parameters k and none are numbers."""

    def equations(self: Any) -> list[Any]:
        return [*laws(self), gl.Eq(self.m, gl.Piecewise((1.0, gl.time > 1.0), (2.0, True)))]

    names = {name: gl.Variable("1") for name in "abcdpqsxyz"} | {"m": gl.Discrete("1", start=2.0)}
    names |= {
        "none": gl.Parameter("1", default=0.0),
        "k": gl.Parameter("1", default=3.0),
        "rate": gl.Parameter("1/s", default=1.0),
    }
    return flatten(type("Laws", (gl.Component,), names | {"equations": equations})())


def swinging(laws: Laws) -> list[str]:
    model = flat(laws)
    return products_in_time(model, model.parameters.defaults)


def wave(s: Any) -> Any:
    return gl.sin(s.rate * gl.time)


def rate(s: Any, x: Any) -> Any:
    """The rate of a variable as a number: rates are in 1/s."""
    return gl.der(x) / s.rate


def branch(condition: Any, one: Any, other: Any) -> Any:
    return gl.Piecewise((one, condition), (other, True))


FOLLOWING: dict[str, tuple[Laws, list[str], str]] = {  # laws, what follows from p in this order, and what of it turns as p does
    "a chain": (lambda s: [gl.Eq(s.y, 3 * s.x), gl.Eq(s.x, 2 * s.p)], ["x", "y"], "pxy"),
    "a function, and what is linear in it": (lambda s: [gl.Eq(s.x, gl.sin(s.p)), gl.Eq(s.y, 3 * s.x)], ["x", "y"], "p"),
    "constants": (lambda s: [gl.Eq(2 * s.x, 3 * s.p + s.a), gl.Eq(2 * s.a, 3 * s.b), gl.Eq(s.b, 5)], ["x"], "px"),
    "a sum of what turns and what does not": (
        lambda s: [gl.Eq(s.x, gl.sin(s.p)), gl.Eq(2 * s.y, 3 * s.p), gl.Eq(s.z, 2 * s.x + 3 * s.y)], ["x", "y", "z"], "py",
    ),
    "a sum of what turns": (
        lambda s: [gl.Eq(2 * s.x, 3 * s.p), gl.Eq(2 * s.y, 5 * s.p + s.a), gl.Eq(s.a, 7), gl.Eq(s.z, 2 * s.x + 3 * s.y)],
        ["x", "y", "z"], "pxyz",
    ),
    "a coefficient that is a parameter": (lambda s: [gl.Eq(s.k * s.x, s.p), gl.Eq(s.none * s.y, s.p)], ["x"], "px"),
    "a coefficient that varies": (lambda s: [gl.Eq(s.x * (1 + s.p**2), 2 + s.p)], [], "p"),
    "a coefficient of a condition": (lambda s: [gl.Eq(s.x * branch(s.b > 0, 2, 3), 2 + s.p), gl.Eq(s.b, 5)], [], "p"),
    "a coefficient of time": (lambda s: [gl.Eq(s.x * (2 + wave(s)), 2 * s.p)], [], "p"),
    "a condition": (lambda s: [gl.Eq(2 * s.x, branch(s.p > 0, 1, 2)), gl.Eq(s.y, branch(s.y > 3, s.p, 2))], ["x"], "p"),
    "what is zero everywhere": (
        lambda s: [gl.Eq(2 * s.x, gl.sin(s.p) + 5 * s.z), gl.Eq(s.z, 0), gl.Eq(2 * s.y, 3 * s.p + 7 * s.z)], ["x", "y"], "py",
    ),
    "the rate of what is zero everywhere": (
        lambda s: [gl.Eq(2 * s.x, 3 * s.p + rate(s, s.z)), gl.Eq(s.z, 0)], ["x"], "px",
    ),
    "what is written for it, beside the rate of a constant": (
        lambda s: [gl.Eq(s.x, 3 * s.p + rate(s, s.z) + 2 * s.z + 5 * s.b), gl.Eq(2 * s.z, 7)], ["x"], "p",
    ),
    "opposite variables": (
        lambda s: [gl.Eq(s.x, -s.y), gl.Eq(2 * s.y, 3 * s.p), gl.Eq(s.a, -s.b), gl.Eq(2 * s.a, 3 * s.p + 5 * s.x)],
        ["y", "a"], "pya",
    ),
    "nothing that moves": (lambda s: [gl.Eq(s.x, 2 * s.y), gl.Eq(s.y, 5)], [], "p"),
    "a part that is unknown": (lambda s: [gl.Eq(2 * s.x, 3 * s.p + 5 * s.s), gl.Eq(gl.der(s.s), -s.rate * s.s)], [], "p"),
    "what is written for it, beside an unknown speed": (
        lambda s: [gl.Eq(s.x, 3 * s.p + 5 * s.s), gl.Eq(rate(s, s.s), -s.s), gl.Eq(2 * s.y, 3 * s.s)], ["x"], "p",
    ),
    "a part that changes with time": (lambda s: [gl.Eq(2 * s.x, 3 * s.p + 5 * s.y), gl.Eq(s.y, wave(s))], [], "p"),
    "a part that grows": (lambda s: [gl.Eq(2 * s.x, 3 * s.p + 5 * s.y), gl.Eq(rate(s, s.y), 7)], [], "p"),
    "what is written for it, beside a rate and an unknown speed": (
        lambda s: [gl.Eq(s.x, 3 * s.p + rate(s, s.p) + 5 * s.s), gl.Eq(rate(s, s.s), -s.s)], [], "p",
    ),
    "a deflection": (lambda s: [gl.Eq(s.x, 3 * s.p + 5 * s.a), gl.Eq(rate(s, s.x), s.b)], [], "p"),
    "an unknown deflection": (lambda s: [gl.Eq(s.x, 3 * s.p + 5 * s.s), gl.Eq(rate(s, s.s), s.y)], [], "p"),
    "two it may be written for": (lambda s: [gl.Eq(s.x + s.y, 3 * s.p + 5 * s.a)], [], "p"),
    "the rate of what moves": (lambda s: [gl.Eq(2 * s.x, rate(s, s.p))], [], "p"),
    "the rate of what moves unsteadily": (
        lambda s: [gl.Eq(s.y, gl.sin(s.p)), gl.Eq(2 * s.x, rate(s, s.y))], ["y", "x"], "p",
    ),
    "a rate beside what moves": (lambda s: [gl.Eq(2 * s.x, rate(s, s.p) + s.p)], ["x"], "px"),
    "a rate that is not known": (lambda s: [gl.Eq(2 * s.x, rate(s, s.s) + s.p)], [], "p"),
    "its own rate": (lambda s: [gl.Eq(rate(s, s.x), 2 * gl.sin(s.p))], [], "p"),
}  # fmt: skip


@pytest.mark.parametrize("kind", FOLLOWING)
def test_what_follows_from_a_phase(kind: str) -> None:
    laws, expected, turning = FOLLOWING[kind]
    model = flat(laws)

    def of(names: Iterable[str]) -> list[int]:
        return [int(model.representative[model.variable(name)]) for name in names]

    moved = np.arange(model.n_variables) == model.variable("p")
    found, turns = followers_of(model, model.parameters.defaults, moved)
    assert [determined(model, f) for f in found] == of(expected)
    assert sorted(np.flatnonzero(turns)) == sorted(of(turning))
    for follower in found:
        names = {model.name(int(v)) for v in others_of(model, follower)}
        assert names == {model.name(int(v)) for v in model.groups[follower[0]].variables[follower[2]]} - {
            model.name(determined(model, follower))
        }


def test_coefficients_of_each_equation_of_a_group() -> None:
    class Half(gl.Component):
        x, y, n = gl.Variable("1"), gl.Variable("1"), gl.Parameter("1", default=2.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(self.n * self.x, gl.sin(self.y))]

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two = Half(), Half(n=-5.0)
            return []

    model = flatten(Two())
    (group,) = model.groups
    c = [name for name, _ in group.template.columns].index("x")
    slopes = slopes_of(group, c, model.parameters.defaults)
    assert (slopes / slopes[0]).tolist() == [1.0, -2.5]
    assert abs(slopes).tolist() == [2.0, 5.0]


PRODUCTS: dict[str, tuple[Laws, list[str]]] = {
    "a square": (lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.z, s.x**2), gl.Eq(3 * s.a, s.z)], ["x"]),
    "a square that nothing depends on": (lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.z, s.x**2)], []),
    "a square of what follows": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.y, 3 * s.x), gl.Eq(s.z, s.y**2), gl.Eq(3 * s.a, s.z)], ["y"],
    ),
    "a square of what is at rest": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(2 * s.y, 3 * s.b), gl.Eq(s.b, 5), gl.Eq(s.z, s.y**2), gl.Eq(3 * s.a, s.z + s.x)], [],
    ),
    "a product with what its rate follows from": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(rate(s, s.y), s.x), gl.Eq(s.z, s.y * s.x), gl.Eq(3 * s.a, s.z)], ["x", "y"],
    ),
    "a square of what its rate follows from, by a condition": (
        lambda s: [
            gl.Eq(s.x, wave(s)), gl.Eq(rate(s, s.y), branch(rate(s, s.x) > 0, 1, 2)), gl.Eq(s.z, s.y**2), gl.Eq(3 * s.a, s.z),
        ],
        ["x", "y"],
    ),
    "a product with a constant": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.b, 5), gl.Eq(s.z, s.b * s.x), gl.Eq(3 * s.a, s.z)], [],
    ),
    "a comparison": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.b, 5), gl.Eq(s.z, branch(s.x > s.b, 1, 2)), gl.Eq(3 * s.a, s.z)], ["x"],
    ),
    "a square beside what is zero everywhere": (
        lambda s: [gl.Eq(s.b, 0), gl.Eq(2 * s.x, wave(s) + 3 * s.b), gl.Eq(s.z, s.x**2 + 5 * s.b), gl.Eq(3 * s.a, s.z)], ["x"],
    ),
    "a square with what is zero everywhere and nowhere else": (
        lambda s: [gl.Eq(s.b, 0), gl.Eq(s.x, wave(s)), gl.Eq(s.z, s.x**2 + 5 * s.b), gl.Eq(3 * s.a, s.z)], ["x"],
    ),
    "a square of a rate": (lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.z, rate(s, s.x) ** 2), gl.Eq(3 * s.a, s.z)], ["x"]),
    "a condition on a rate": (
        lambda s: [gl.Eq(s.x, wave(s)), gl.Eq(s.z, branch(rate(s, s.x) > 0, 1, 2)), gl.Eq(3 * s.a, s.z)], ["x"],
    ),
    "a decay": (lambda s: [gl.Eq(s.x, gl.exp(-s.rate * gl.time)), gl.Eq(s.z, s.x**2), gl.Eq(3 * s.a, s.z)], []),
    "a constant written with time": (
        lambda s: [gl.Eq(s.x, branch(gl.time < 0, 1, 2)), gl.Eq(s.z, s.x**2), gl.Eq(3 * s.a, s.z)], [],
    ),
    "a wave added to what is linear": (
        lambda s: [gl.Eq(s.b, 5), gl.Eq(2 * s.x, s.b + wave(s)), gl.Eq(s.z, s.x**3), gl.Eq(3 * s.a, s.z)], ["x"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", PRODUCTS)
def test_products_of_what_swings_with_time(kind: str) -> None:
    laws, expected = PRODUCTS[kind]
    assert swinging(laws) == expected


def test_terms_that_are_not_linear_and_what_they_depend_on() -> None:
    """The partial derivatives with respect to each variable, and what conditions compare; a discrete variable is none of them."""

    def terms(law: Callable[[Any], Any]) -> dict[str, list[str]]:
        def text(name: str, order: int) -> str:
            return name + "'" * order

        model = flat(lambda s: [gl.Eq(s.x, law(s))])
        (template,) = (g.template for g in model.groups if "x" in g.template.locals)
        found = nonlinear_terms(template)
        return {text(name, order): sorted(text(*other) for other in others) for name, order, others in found}

    assert terms(lambda s: 2 * s.y + s.k * s.z) == {}
    assert terms(lambda s: s.k * s.p * s.y + s.q) == {"x": [], "p": ["y"], "y": ["p"], "q": []}
    assert terms(lambda s: s.y * rate(s, s.y) * s.s) == {"x": [], "y'": ["s", "y"], "s": ["y", "y'"], "y": ["s", "y'"]}
    assert terms(lambda s: rate(s, s.y) ** 2) == {"x": [], "y'": ["y'"]}
    assert terms(lambda s: s.m * s.y + branch(s.a > s.b, 1, 2)) == {"x": [], "y": [], "a": ["a"], "b": ["b"]}
    assert terms(lambda s: s.y + branch(rate(s, s.a) > s.b, 1, 2)) == {"x": [], "y": [], "a'": ["a'"], "b": ["b"]}
    assert terms(lambda s: branch(s.a > s.b, s.y**2, 3 * s.y) + s.q * s.p) == {
        "x": [], "y": ["a", "b", "y"], "p": ["q"], "q": ["p"], "a": ["a"], "b": ["b"],
    }  # fmt: skip


def test_rates_of_equations() -> None:
    model = flat(lambda s: [gl.Eq(s.x, s.y * rate(s, s.p) + s.q + branch(rate(s, s.a) > 0, 1, 2))])
    (group,) = (g for g in model.groups if "x" in g.template.locals)
    assert [model.name(v) for v in rates_of(group)[0].tolist()] == ["p", "a"]
