"""Start values of made-up models: which numbers contradict each other, by how much, what moves, and what is said."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import NameLookupError, StartError
from gearlib.run.start_values import Start, fixed_values, start_named, start_values, start_variable, starts_of_runs


class Names(gl.Component):
    """A state under two names, its opposite, what is always zero, an input, and a discrete variable."""

    x, same = gl.Variable("any"), gl.Variable("any")
    opposite, nothing = gl.Variable("any", nominal=100.0), gl.Variable("any")
    u, n = gl.Input("any"), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(self.same, self.x),
            gl.Eq(self.opposite, -self.x),
            gl.Eq(self.nothing, 0.0),
            gl.When(gl.time > 1.0, gl.Eq(self.n, 1.0)),
        ]


class Given(gl.Component):
    """The same with start values that are parameters."""

    x, same, opposite, nothing = (gl.Parameter("any", default=v) for v in (2.0, 2.0, -2.0, 0.0))

    def assemble(self) -> list[Any]:
        self.part = Names(start={name: getattr(self, name) for name in ("x", "same", "opposite", "nothing")})
        return []


@cache
def given() -> Any:
    return gl.compile(Given()).translation


def fixed(overrides: dict[str, float] | None = None, **values: float) -> list[float]:
    """The fixed values, of which there is one."""
    model = given().model
    own = {model.variable(f"part.{name}"): value for name, value in (overrides or {}).items()}
    found = fixed_values(model, given().parameter_values(values), own)
    x = model.variable("part.x")
    assert set(found) <= {int(model.representative[x])}
    return [int(model.sign[x]) * value for value, _ in found.values()]


def refusal(overrides: dict[str, float] | None = None, **values: float) -> str:
    try:
        fixed(overrides, **values)
    except StartError as refused:
        return str(refused)
    return ""


def test_names_of_one_variable_have_one_value() -> None:
    """With its sign; those of a run replace all of the model's, not only that of the same name."""
    assert fixed() == [2.0]
    assert fixed(x=3.0, same=3.0, opposite=-3.0) == [3.0]
    assert fixed({"opposite": 5.0}) == fixed({"same": -5.0}) == [-5.0]
    assert fixed({"nothing": 0.0}) == [2.0]


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"same": 2.0 * (1 + 0.9e-10)}, ""),
        (
            {"same": 2.0 * (1 + 1.2e-10)},
            "part.x and part.same are one variable (up to its sign), but are fixed at 2 and 2.00000000024",
        ),
        ({"opposite": 2.0}, "part.same and part.opposite are one variable (up to its sign), but are fixed at 2 and -2"),
        ({"opposite": -2.5}, "part.same and part.opposite are one variable (up to its sign), but are fixed at 2 and 2.5"),
        ({"same": 2.000001}, "part.x and part.same are one variable (up to its sign), but are fixed at 2 and 2.000001"),
        ({"x": 0.9e-9, "same": 0.0, "opposite": 0.0}, ""),  # of a nominal value of 100
        ({"x": 1.1e-9, "same": 0.0, "opposite": 0.0}, "part.x and part.same are one"),
    ],
)
def test_how_much_two_names_may_differ(values: dict[str, float], told: str) -> None:
    """By 1e-10, beside 1e-12 at most; what is smaller than 1e-11 of the nominal value counts as zero."""
    found = refusal(**values)
    assert found.startswith(f"start values contradict each other: {told}") if told else not found


@pytest.mark.parametrize(
    ("values", "nothing", "is_refused"),
    [
        ({}, 0.9e-11, False),
        ({}, 1.1e-11, True),
        ({}, -1.1e-11, True),
        ({"x": 1e3, "same": 1e3, "opposite": -1e3}, 1.1e-11, True),
    ],
)
def test_how_far_from_zero_what_is_always_zero_may_be(values: dict[str, float], nothing: float, is_refused: bool) -> None:
    """1e-11 of its nominal value."""
    told = f"start of part.nothing is {nothing:g}, but it is always zero" if is_refused else ""
    assert refusal(**values, nothing=nothing) == told
    assert refusal({"nothing": nothing}, **values) == told


def test_start_values_by_their_names() -> None:
    assert [start_named(name) for name in ("start(a.w)", "start(a.w", "starts(a.w)", "a.w", "start()")] == [
        "a.w",
        None,
        None,
        None,
        "",
    ]
    model = given().model
    assert start_variable(model, "part.opposite") == model.variable("part.opposite")
    for name, said in (
        ("der(part.x)", "der(part.x) is a derivative, which has no start value; part.x has one"),
        ("part.u", "part.u is an input, which has no start value; give inputs={'part.u': ...}"),
        ("part.n", "part.n is a discrete variable; its start value is part of the model: start={'n': ...} of part"),
    ):
        with pytest.raises(NameLookupError) as refused:
            start_variable(model, name)
        assert str(refused.value) == said
    alone = gl.compile(Names()).translation.model
    with pytest.raises(NameLookupError, match=r"^n is a discrete variable; .* start=\{'n': \.\.\.\} of it$"):
        start_variable(alone, "n")
    for wrong in ("der(part.xx)", "part.xx"):
        with pytest.raises(NameLookupError, match=r"the model has no variable '.*part\.xx\)?'; did you mean"):
            start_variable(model, wrong)


def test_starts_of_many_runs_at_once() -> None:
    """Runs whose fixed values contradict each other get no numbers; those with a rest of what is zero neither."""
    kinds: list[dict[str, float]] = [
        {}, {"x": 3.0, "same": 3.0, "opposite": -3.0}, {"same": 3.0}, {"opposite": 2.0}, {"nothing": 1.0},
        {"x": -1.0, "same": -1.0, "opposite": 1.0},
    ]  # fmt: skip
    table = np.stack([given().parameter_values(kind) for kind in kinds], axis=1)
    scene = given().with_states(given().structure.states)
    found = starts_of_runs(scene, table)
    assert found is not None
    assert found.shape == (6, 1)
    sign = -1.0 if scene.state_names == ("part.opposite",) else 1.0
    np.testing.assert_array_equal(sign * found[:, 0], [2.0, 3.0, np.nan, np.nan, np.nan, -1.0])


class Sums(gl.Component):
    """States, and sums of them that have start values: the equations must be solved."""

    n = gl.Structural(3)
    k = gl.Parameter("any", default=2.0)
    a, b, c = gl.Variable("any", guess=1.0), gl.Variable("any", guess=2.0, nominal=10.0), gl.Variable("any")
    s, t = gl.Variable("any", "of a and b"), gl.Variable("any", "square")

    def equations(self) -> list[Any]:
        rates = [gl.Eq(gl.der(x), -x) for x in (self.a, self.b, self.c)]
        return [*rates, gl.Eq(self.s, self.a + self.k * self.b), gl.Eq(self.t, self.c**2 + self.a)]


def begun(
    start: dict[str, float], own: dict[str, float] | None = None, seeds: Any = None, more: Any = (), **values: float
) -> Start:
    translation = sums(tuple(start.items()))
    overrides = {translation.model.variable(name): value for name, value in (own or {}).items()}
    table = translation.parameter_values(values)
    if seeds is not None:
        seeds = [(translation.model.parameters.index[name], k, weight) for name, k, weight in seeds]
        more = [(translation.model.variable(name), k, sign) for name, k, sign in more]
    return start_values(translation.scene, table, np.empty(0), 0.0, overrides, None, seeds, more)


@cache
def sums(start: tuple[Any, ...]) -> Any:
    return gl.compile(Sums(start=dict(start))).translation


def states(found: Start, start: dict[str, float]) -> dict[str, float]:
    return dict(zip(sums(tuple(start.items())).scene.state_names, found.states.tolist(), strict=True))


def test_guesses_hold_where_nothing_is_fixed() -> None:
    found = begun({})
    assert states(found, {}) == {"a": 1.0, "b": 2.0, "c": 0.0}
    assert sorted(found.free) == ["a", "b", "c"]
    found = begun({"b": 5.0})
    assert states(found, {"b": 5.0}) == {"a": 1.0, "b": 5.0, "c": 0.0}
    assert sorted(found.free) == ["a", "c"]
    found = begun({"b": 5.0}, {"b": 7.0, "c": 4.0})
    assert states(found, {"b": 5.0}) == {"a": 1.0, "b": 7.0, "c": 4.0}
    assert found.free == ("a",)


def test_a_sum_moves_the_state_with_the_largest_effect() -> None:
    """In nominal values: b counts 10 k times as much as a; where b is fixed, a moves."""
    given = {"s": 9.0}
    found = begun(given)
    assert states(found, given) == pytest.approx({"a": 1.0, "b": 4.0, "c": 0.0}, rel=1e-12)
    assert sorted(found.free) == ["a", "c"]
    assert states(begun(given, k=0.01), given) == pytest.approx({"a": 8.98, "b": 2.0, "c": 0.0}, rel=1e-12)
    found = begun(given, {"b": 3.0})
    assert states(found, given) == pytest.approx({"a": 3.0, "b": 3.0, "c": 0.0}, rel=1e-12)
    assert found.free == ("c",)
    found = begun(given, {"s": 5.0, "c": 1.5})
    assert states(found, given) == pytest.approx({"a": 1.0, "b": 2.0, "c": 1.5}, rel=1e-12)


def test_what_is_remembered_is_that_of_the_same_question() -> None:
    """Of other values, parameters and times the equations are solved anew; what was returned may be changed."""
    given = {"s": 9.0}
    first = begun(given)
    first.states[:], first.guess[:] = 77.0, 77.0
    assert states(begun(given), given) == pytest.approx({"a": 1.0, "b": 4.0, "c": 0.0}, rel=1e-12)
    assert states(begun(given, {"s": 11.0}), given) == pytest.approx({"a": 1.0, "b": 5.0, "c": 0.0}, rel=1e-12)
    assert states(begun(given, k=4.0), given) == pytest.approx({"a": 1.0, "b": 2.0, "c": 0.0}, rel=1e-12)
    assert states(begun(given), given) == pytest.approx({"a": 1.0, "b": 4.0, "c": 0.0}, rel=1e-12)


def test_a_contradiction_names_what_is_fixed_and_what_follows() -> None:
    given = {"a": 1.0, "b": 2.0, "s": 5.5}
    with pytest.raises(StartError) as refused:
        begun(given)
    assert str(refused.value) == (
        "start values contradict each other: s is fixed at 5.5, but the other fixed values (a, b) and the equations make it 5; fix "
        "fewer, or give some of them as guess={...}; s follows from a, b"
    )
    both = {"a": 1.0, "b": 2.0, "c": 3.0, "s": 5.5, "t": 11.0}
    for given, first in ((both, "s is fixed at 5.5"), (dict(reversed(both.items())), "t is fixed at 11")):
        with pytest.raises(
            StartError, match=f"^start values contradict each other: {first}, but"
        ):  # that which was given first
            begun(given)
    begun({"a": 1.0, "b": 2.0, "s": 5.0 * (1 + 0.9e-10)})
    with pytest.raises(StartError, match=r"s is fixed at 5\.000000002, but .* make it 5; fix"):
        begun({"a": 1.0, "b": 2.0, "s": 5.000000002})


def test_derivatives_of_start_values() -> None:
    """Seeds: the parameter k, twice as fast; and the start of a. b = (9 - a) / k, so that db = -b dk / k - da / k."""
    given = {"s": 9.0, "a": 1.0}
    names = sums(tuple(given.items())).scene.state_names
    found = begun(given, seeds=[("k", 0, 2.0)], more=[("a", 1, 1.0)])
    assert found.changes is not None
    changes = dict(zip(names, found.changes.tolist(), strict=True))
    assert changes["a"] == pytest.approx([0.0, 1.0])
    assert changes["b"] == pytest.approx([-4.0 / 2.0 * 2.0, -0.5], rel=1e-9)
    assert changes["c"] == pytest.approx([0.0, 0.0])
    plain = begun({"a": 1.0}, seeds=[("k", 0, 1.0)], more=[("a", 0, -1.0), ("b", 1, 1.0)])
    assert plain.changes is not None
    order = sums((("a", 1.0),)).scene.state_names
    assert plain.changes[[order.index(name) for name in "abc"]].tolist() == [[-1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_square_takes_the_root_on_the_side_of_the_guess(sense: float) -> None:
    """t = c^2 + a with a fixed: c is the root of 9 that lies on the side of its guess; none is refused."""
    given = {"a": 1.0, "t": 10.0}
    translation = gl.compile(Sums(start=given, guess={"c": sense})).translation
    found = start_values(translation.scene, translation.parameter_values({}), np.empty(0), 0.0, {})
    assert found.states[translation.scene.state_names.index("c")] == pytest.approx(3.0 * sense, rel=1e-12)
    overrides = {translation.model.variable("t"): 0.5}
    with pytest.raises(StartError, match=r"t is fixed at 0\.5, but the other fixed values \(a\) and the equations make it"):
        start_values(translation.scene, translation.parameter_values({}), np.empty(0), 0.0, overrides)


class Many(gl.Component):
    """Seven states, and their sum."""

    x1, x2, x3, x4, x5, x6, x7 = (gl.Variable("any", start=float(k)) for k in range(1, 8))
    s = gl.Variable("any", start=30.0)

    def equations(self) -> list[Any]:
        own = [self.x1, self.x2, self.x3, self.x4, self.x5, self.x6, self.x7]
        return [*(gl.Eq(gl.der(x), -x) for x in own), gl.Eq(self.s, sum(own))]


def test_six_names_at_most_are_listed() -> None:
    with pytest.raises(StartError) as refused:
        gl.compile(Many()).simulate(1.0)
    six = ", ".join(f"x{k}" for k in range(1, 7))
    assert f"s is fixed at 30, but the other fixed values ({six}, ...) and the equations make it 28; fix" in str(refused.value)
    assert str(refused.value).endswith(f"; s follows from {six}, ...")


class Swinging(gl.Component):
    """x swings, and its derivative is a state of its own."""

    x = gl.Variable("any", start=3.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(gl.der(self.x)), -4.0 * self.x)]


def test_derivatives_that_are_states_begin_at_zero() -> None:
    """x = 3 cos 2 t."""
    translation = gl.compile(Swinging()).translation
    found = start_values(translation.scene, translation.parameter_values({}), np.empty(0), 0.0, {})
    assert dict(zip(translation.scene.state_names, found.states.tolist(), strict=True)) == {"x": 3.0, "der(x)": 0.0}
    run = gl.System(translation).simulate(1.0, samples=5, rtol=1e-9)
    assert run["x"] == pytest.approx(3.0 * np.cos(2.0 * run.time), abs=1e-7)


class Bent(gl.Component):
    """y is twice x where x is positive, and x elsewhere; d is a difference."""

    a, b, x = gl.Variable("any", guess=0.0), gl.Variable("any", guess=0.0), gl.Variable("any", guess=1.0)
    d, y = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        rates = [gl.Eq(gl.der(state), -state) for state in (self.a, self.b, self.x)]
        bent = gl.Piecewise((2.0 * self.x, self.x > 0.0), (self.x, True))
        return [*rates, gl.Eq(self.d, self.a - self.b), gl.Eq(self.y, bent)]


def of_bent(nominal: float = 1.0, **start: float) -> dict[str, float]:
    translation = gl.compile(Bent(start=start, nominal={"d": nominal})).translation
    found = start_values(translation.scene, translation.parameter_values({}), np.empty(0), 0.0, {})
    return dict(zip(translation.scene.state_names, found.states.tolist(), strict=True))


@pytest.mark.parametrize(("nominal", "refused"), [(1e4, False), (5.1e3, False), (4.9e3, True), (1.0, True), (1e-4, True)])
def test_what_follows_counts_as_zero_by_its_own_size(nominal: float, refused: bool) -> None:
    """5e-8 is 1e-11 of 5000."""
    if refused:
        with pytest.raises(StartError, match=r"^start values contradict each other: d is fixed at 0, but .* make it 5e-08"):
            of_bent(nominal, a=5e-8, b=0.0, d=0.0)
    else:
        assert of_bent(nominal, a=5e-8, b=0.0, d=0.0) == {"a": 5e-8, "b": 0.0, "x": 1.0}


@pytest.mark.parametrize(("y", "x"), [(4.0, 2.0), (-4.0, -4.0)])
def test_a_condition_holds_at_the_start_that_is_found(y: float, x: float) -> None:
    assert of_bent(y=y)["x"] == pytest.approx(x, rel=1e-12)


class Twice(gl.Component):
    """Two multiples of one sum."""

    a, b = gl.Variable("any", guess=1.0), gl.Variable("any", guess=2.0)
    s, t = gl.Variable("any", start=9.0), gl.Variable("any", start=-27.0)

    def equations(self) -> list[Any]:
        rates = [gl.Eq(gl.der(self.a), -self.a), gl.Eq(gl.der(self.b), -self.b)]
        return [*rates, gl.Eq(self.s, self.a + 2.0 * self.b), gl.Eq(self.t, -3.0 * self.a - 6.0 * self.b)]


def test_what_is_fixed_twice_moves_one_state() -> None:
    translation = gl.compile(Twice()).translation
    found = start_values(translation.scene, translation.parameter_values({}), np.empty(0), 0.0, {})
    values = dict(zip(translation.scene.state_names, found.states.tolist(), strict=True))
    assert values == pytest.approx({"a": 1.0, "b": 4.0}, rel=1e-12)
    assert found.free == ("a",)


class Follows(gl.Component):
    """Two states with start values, a multiple of one and the sum of both."""

    x, w = gl.Variable("any", start=1.0), gl.Variable("any", start=5.0)
    y, z = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        rates = [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.w), -self.w)]
        return [*rates, gl.Eq(self.y, 2.0 * self.x), gl.Eq(self.z, self.x + self.w)]


@pytest.mark.parametrize(
    ("given", "x"), [({}, 1.0), ({"y": 6.0}, 3.0), ({"y": 6.0, "x": 3.0}, 3.0), ({"y": 6.0, "w": 5.0}, 3.0), ({"z": 6.0}, 1.0)]
)
def test_what_is_given_for_a_run_stands_for_the_only_state_that_it_follows_from(given: dict[str, float], x: float) -> None:
    """The model's own start value of that state gives way."""
    begin = gl.compile(Follows()).simulate(0.1, samples=2, start=given)
    assert (begin["x"][0], begin["w"][0], begin["y"][0]) == pytest.approx((x, 5.0, 2.0 * x), rel=1e-12)


@pytest.mark.parametrize(("given", "made"), [({"z": 7.0}, 6.0), ({"y": 6.0, "x": 2.0}, 4.0), ({"y": 6.0, "z": 7.0}, 4.0)])
def test_a_contradiction_says_what_the_other_values_make_of_the_one(given: dict[str, float], made: float) -> None:
    """What follows from two states, or from one that is given, stands for none; with w = 5 and z = 7, x is 2, and not a compromise."""
    (name, value), *_ = given.items()
    told = rf"start values contradict each other: {name} is fixed at {value:g}, but the other .* make it {made:g};"
    with pytest.raises(StartError, match=told):
        gl.compile(Follows()).simulate(0.1, samples=2, start=given)
