"""Steady states of one or two equations whose roots are known: which is found, what grows, and why there is none."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import StartError
from gearlib.run.start_values import Start
from gearlib.run.steady import Search, growing, search_steady, steady_changes

Law = Callable[[Any, Any, Any, Any], tuple[Any, Any]]  # of x, y and the parameters p, q: the rates of x and y


class Pair(gl.Component):
    """Two states with rates that are given."""

    law = gl.Structural(None)
    p, q = gl.Parameter("any", default=1.0), gl.Parameter("any", default=2.0)
    x, y = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        rates = self.law(self.x, self.y, self.p, self.q)
        return [gl.Eq(gl.der(self.x), rates[0]), gl.Eq(gl.der(self.y), rates[1])]


class Angle(Pair):
    """The same, of which y is an angle."""

    y = gl.Variable("rad")


@cache
def compiled(law: Law, kind: type[Pair] = Pair) -> Any:
    return gl.compile(kind(law=law)).translation


def asked(law: Law, x: float, y: float, kind: type[Pair] = Pair, changes: Any = None, **values: float) -> tuple[Any, ...]:
    """The arguments of a search."""
    translation = compiled(law, kind)
    scene = translation.with_states(translation.structure.states)
    start = np.array([{"x": x, "y": y}[name] for name in scene.state_names])
    begin = Start(start, np.zeros(scene.model.n_variables), (), changes=changes)
    return scene, scene.prepared(translation.parameter_values(values)), begin, np.zeros(0), 0.0


def steady(law: Law, x: float = 0.0, y: float = 0.0, kind: type[Pair] = Pair, **values: float) -> list[float]:
    given = asked(law, x, y, kind, **values)
    found = dict(zip(given[0].state_names, search_steady(*given).tolist(), strict=True))
    return [found["x"], found["y"]]


def reason(law: Law, x: float = 0.0, y: float = 0.0, kind: type[Pair] = Pair, **values: float) -> str:
    with pytest.raises(StartError) as refused:
        steady(law, x, y, kind, **values)
    said = str(refused.value)
    assert said.startswith("no steady state was found: ")
    return said.removeprefix("no steady state was found: ")


def linear(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
    return p - 2 * x + y, 3 * q - x - 4 * y


def cubic(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
    return -(x - p) * (x - q) * (x - 4.0), x - y


def circle(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
    return p - x * y, x - y


def test_a_linear_pair() -> None:
    """p = 2 x - y and 3 q = x + 4 y: x = (4 p + 3 q) / 9, y = (6 q - p) / 9."""
    assert steady(linear) == pytest.approx([10 / 9, 11 / 9], rel=1e-12)
    assert steady(linear, 1e3, -1e6) == pytest.approx([10 / 9, 11 / 9], rel=1e-9)
    assert steady(linear, p=-3.0, q=1e6) == pytest.approx([(3e6 - 12) / 9, (6e6 + 3) / 9], rel=1e-12)


@pytest.mark.parametrize(("begin", "end"), [(0.5, 1.0), (1.9, 1.0), (2.1, 4.0), (3.0, 4.0), (9.0, 4.0), (-50.0, 1.0)])
def test_it_is_the_one_that_the_motion_reaches(begin: float, end: float) -> None:
    """1 and 4 attract, 2 does not; y follows x."""
    assert steady(cubic, begin, 7.0) == pytest.approx([end, end], rel=1e-8)


@pytest.mark.parametrize("begin", [0.1, 1.0, 30.0])
def test_a_product_that_balances(begin: float) -> None:
    assert steady(circle, begin, begin, p=9.0) == pytest.approx([3.0, 3.0], rel=1e-9)


def test_what_nothing_depends_on_may_grow() -> None:
    """y, which keeps its value; not a speed, whose angle would grow faster and faster."""
    assert steady(lambda x, y, p, q: (p - x, x + q), 5.0, 0.7) == pytest.approx([1.0, 0.7], rel=1e-9)
    said = reason(lambda x, y, p, q: (p + 0 * y, x))
    assert said.startswith(
        "der(x) stays at 1, and no speed, angle or deflection has an effect on that; a load that grows with the"
    )


def test_rates_without_a_root() -> None:
    said = reason(lambda x, y, p, q: (p + x**2, x - y), 0.0, 0.0)
    assert said.startswith("der(x) stays at ")
    assert said.endswith("balance the drive. Start nearer to one (guess={...}), or run the train to see where it goes")


def test_rates_that_cannot_be_computed() -> None:
    said = reason(lambda x, y, p, q: (p - x, gl.sqrt(y) - 2.0), 0.0, -1.0)
    assert said == "der(y) cannot be computed; give start values near it: guess={...}"


def test_an_angle_that_would_turn_for_ever() -> None:
    """The rate of x repeats every turn of y, which rises; with a rate of y that vanishes somewhere it does not."""

    def turning(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
        return -x + gl.sin(y), 2 + q + gl.sin(y)

    said = reason(turning, kind=Angle)
    assert said.startswith(
        "the equations vary with y, which would grow for ever, and repeat every turn of two pi; such a train has"
    )
    x, y = steady(turning, 0.0, 0.0, Angle, q=-2.5)
    assert (x, np.sin(y)) == (pytest.approx(0.5), pytest.approx(0.5))
    assert "repeat every turn" not in reason(turning)  # of a unit that is no angle


def test_an_angle_that_turns_beside_what_may_grow() -> None:
    """Nothing depends on x, so that it may grow; its rate varies with y all the same."""
    said = reason(lambda x, y, p, q: (p + gl.sin(y), 2 + q + gl.sin(y)), kind=Angle)
    assert said.startswith("the equations vary with y, which would grow for ever")


@pytest.mark.parametrize("slow", [1.0, 1e-8, 1e-14])
@pytest.mark.parametrize("unit", [1.0, 1e7])
def test_rates_and_states_of_very_different_sizes(slow: float, unit: float) -> None:
    """Each equation counts by its own size, each state in its own unit."""
    apart = steady(lambda x, y, p, q: (p - x, slow * (q * unit - y)), 5.0, 7.0 * unit, q=3.0)
    assert apart == [pytest.approx(1.0, rel=1e-9), pytest.approx(3.0 * unit, rel=1e-9)]
    coupled = steady(lambda x, y, p, q: (p - 2 * x + y / unit, slow * (unit * (3 * q - x) - 4 * y)), 5.0, 7.0 * unit)
    assert coupled == [pytest.approx(10 / 9, rel=1e-9), pytest.approx(11 / 9 * unit, rel=1e-9)]


class Thousands(Pair):
    """The same, in thousands."""

    x, y = gl.Variable("any", nominal=1e3), gl.Variable("any", nominal=1e3)


@pytest.mark.parametrize(("kind", "p"), [(Pair, 1.0), (Thousands, 1.0), (Thousands, 1e6)])
def test_what_was_wrongly_taken_to_grow_is_noticed(kind: type[Pair], p: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The motion is looked at again where what grows has grown: x follows y, unless y rests."""
    monkeypatch.setattr("gearlib.run.steady.growing", lambda scene, numbers: np.eye(2)[:, [scene.state_names.index("y")]])

    def follows(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
        return p - x + y / 100, q

    assert reason(follows, kind=kind, p=p).startswith("der(x) stays at ")
    assert steady(follows, 0.0, 5.0, kind, p=p, q=0.0) == pytest.approx([p + 0.05, 5.0], rel=1e-9)


def test_directions_that_may_grow() -> None:
    """Orthonormal; none where each state matters, one where only a difference does."""

    def along(law: Law, **values: float) -> Any:
        scene, numbers, *_ = asked(law, 0.0, 0.0, **values)
        return growing(scene, numbers)

    assert along(linear).shape == (2, 0)
    (direction,) = along(lambda x, y, p, q: (p - (x - q * y), q - (x - q * y))).T
    scene = compiled(linear).with_states(compiled(linear).structure.states)
    by_name = dict(zip(scene.state_names, direction / np.abs(direction).max(), strict=True))
    assert by_name["x"] / by_name["y"] == pytest.approx(2.0)
    assert np.linalg.norm(direction) == pytest.approx(1.0)


def test_a_difference_that_settles_while_both_grow() -> None:
    """x' = 1 - (x - y), y' = -1/2 + (x - y): the same rate of 1/4 where x - y = 3/4; their sum keeps its start value."""
    x, y = steady(lambda x, y, p, q: (p - (x - y), -p / 2 + (x - y)), 3.0, 1.0)
    assert x - y == pytest.approx(0.75, rel=1e-9)
    assert x + y == pytest.approx(4.0, rel=1e-9)


def slopes(law: Law, x: float, y: float, *names: str, changes: Any = None, **values: float) -> Any:
    """Derivatives of the steady state by parameters, rows x and y."""
    translation = compiled(law)
    begin = np.zeros((2, len(names))) if changes is None else changes
    scene, numbers, start, inputs, t = asked(law, x, y, changes=begin, **values)
    seeds = [(translation.model.parameters.index[name], k, 1.0) for k, name in enumerate(names)]
    found = search_steady(scene, numbers, start, inputs, t)
    moved = steady_changes(scene, numbers, start, inputs, t, found, seeds)
    return moved[[scene.state_names.index(name) for name in "xy"]]


def test_how_a_steady_state_follows_its_parameters() -> None:
    assert slopes(linear, 0.0, 0.0, "p", "q") == pytest.approx(np.array([[4 / 9, 3 / 9], [-1 / 9, 6 / 9]]), rel=1e-9)
    assert slopes(cubic, 0.5, 0.5, "p", "q") == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.0]]), rel=1e-6, abs=1e-9)
    assert slopes(circle, 1.0, 1.0, "p", p=9.0) == pytest.approx(np.array([[1 / 6], [1 / 6]]), rel=1e-6)


@pytest.mark.parametrize(("slow", "unit"), [(1e-8, 1.0), (1e8, 1.0), (1e-12, 1.0), (1e-8, 1e9)])
def test_derivatives_where_rates_and_states_differ_in_size(slow: float, unit: float) -> None:
    """Each equation counts by its own size, each state in its own unit."""
    found = slopes(lambda x, y, p, q: (p - 2 * x + y / unit, slow * (unit * (3 * q - x) - 4 * y)), 0.0, 0.0, "p", "q")
    assert found[0] == pytest.approx([4 / 9, 3 / 9], rel=1e-9)
    assert found[1] / unit == pytest.approx([-1 / 9, 6 / 9], rel=1e-9)
    apart = slopes(lambda x, y, p, q: (p - x, slow * (q - y)), 0.0, 0.0, "p", "q")
    assert apart == pytest.approx(np.eye(2), rel=1e-9, abs=1e-12)


def test_what_grows_keeps_how_its_start_changes() -> None:
    """x = p settles, whatever its start does; y keeps its start value."""
    own = compiled(linear).with_states(compiled(linear).structure.states).state_names
    begin = np.zeros((2, 1))
    begin[own.index("y")], begin[own.index("x")] = 3.0, 5.0
    found = slopes(lambda x, y, p, q: (p - x, q + x), 0.0, 0.0, "p", changes=begin)
    assert found == pytest.approx(np.array([[1.0], [3.0]]), rel=1e-9)


def test_a_steady_state_that_ends_at_a_parameter_is_refused() -> None:
    """x' = (p - 1) (1 + y^2) vanishes at p = 1 only, wherever x and y = q + x are."""

    def law(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
        return (p - 1.0) * (1.0 + y**2), q + x - y

    # x stays, so that y follows q
    assert slopes(law, 0.5, 0.0, "q") == pytest.approx(np.array([[0.0], [1.0]]), abs=1e-9)
    with pytest.raises(
        StartError, match=r"^the steady state does not go on where the parameter changes: no change of the states"
    ):
        slopes(law, 0.5, 0.0, "p")


def test_an_unstable_state_is_told_from_one_that_attracts() -> None:
    def at(x: float) -> Search:
        return Search(*asked(cubic, x, x), np.zeros((2, 0)))

    assert [at(x).attracts(at(x).begin.states) for x in (1.0, 2.0, 4.0)] == [True, False, True]


def test_without_states_there_is_nothing_to_search() -> None:
    class Nothing(gl.Component):
        y = gl.Variable("any")

        def equations(self) -> list[Any]:
            return [gl.Eq(self.y, 3.0)]

    scene = gl.compile(Nothing()).translation.scene
    numbers = scene.prepared(scene.model.parameters.defaults)
    begin = Start(np.zeros(0), np.zeros(scene.model.n_variables), (), changes=np.zeros((0, 2)))
    assert search_steady(scene, numbers, begin, np.zeros(0), 0.0).shape == (0,)
    assert steady_changes(scene, numbers, begin, np.zeros(0), 0.0, np.zeros(0), []).shape == (0, 2)


def test_a_steady_start_with_its_derivatives() -> None:
    """x = y = sqrt(p): 1/6 at p = 9; none where they are not asked for."""
    translation = compiled(circle)
    scene, numbers = translation.with_states(translation.structure.states), translation.parameter_values({"p": 9.0})
    seeds = [(translation.model.parameters.index["p"], 0, 1.0)]
    found = translation.start(scene, numbers, 0.0, "steady", (), seeds=seeds)
    assert found.steady
    assert found.changes == pytest.approx(np.full((2, 1), 1 / 6), rel=1e-6)
    plain = translation.start(scene, numbers, 0.0, "steady", ())
    assert plain.changes is None
    assert plain.states == pytest.approx([3.0, 3.0], rel=1e-9)


def beside_a_thousand(x: Any, y: Any, p: Any, q: Any) -> tuple[Any, Any]:
    away = x / p - 1000
    return -p * away * (40 + 9 * away**2), 20 * (x - y - 990 * p)


def test_the_search_is_the_same_in_any_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A power of two changes no digit: it evaluates the rates at the same states, in that unit; changes are small beside these."""

    def visited(unit: float) -> list[list[float]]:
        seen: list[list[float]] = []
        plain = Search.equations
        with monkeypatch.context() as patch:
            patch.setattr(Search, "equations", lambda self, x: seen.append((x / unit).tolist()) or plain(self, x))
            assert steady(beside_a_thousand, 1000.25 * unit, 9.5 * unit, p=unit) == pytest.approx([1000 * unit, 10 * unit])
        return seen

    assert visited(2.0**-20) == visited(1.0)
