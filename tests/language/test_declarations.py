"""What a class declares, and what it may not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BindingError, BoundError, DeclarationError
from gearlib.language.declarations import as_tuple, declared_by


def test_declarations_are_inherited_in_order() -> None:
    class Base(gl.Component):
        a = gl.Parameter("m", "first")
        x = gl.Variable("m", "second")

    class Derived(Base):
        b = gl.Parameter("m", "third", default=1.0)

    assert list(Derived._declarations) == ["a", "x", "b"]
    assert Derived.a is Base.a
    assert (Derived.b.unit, Derived.b.description) == ("m", "third")


def test_of_several_bases_that_declares_a_name_which_python_finds_first() -> None:
    """A base that only inherits a declaration does not hide the one of a class behind it."""
    plain = {"k": gl.Parameter("1", default=1.0), "n": gl.Parameter("1", default=7.0)}
    first = type("First", (gl.Component,), {**plain, "x": gl.Variable("1"), "equations": lambda s: [gl.Eq(s.x, s.k)]})
    other, same = type("Other", (first,), {"k": gl.Parameter("1", default=2.0)}), type("Same", (first,), {})
    for bases in ((other, same), (same, other)):
        part: Any = type("Both", bases, {})()
        assert part.k == 2.0
        assert gl.compile(part).parameters["k"] == 2.0
        assert list(declared_by(part).parameters) == ["k", "n"]


def test_outside_equations_a_parameter_is_the_value_given() -> None:
    assert gp.Inertia(J=3.0).J == 3.0
    assert gp.Inertia().J is None
    assert gp.Fixed().phi0 == 0.0


def test_structural_choices_are_plain_values() -> None:
    assert gp.PlanetaryUnit(planets=5).planets == 5
    assert gp.PlanetaryUnit().planet_meshes == "lumped"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"planets": "3"}, r"structural choice 'planets' is '3' \(str\); expected int"),
        ({"planets": 3.0}, r"structural choice 'planets' is 3.0 \(float\); expected int"),
        ({"planet_meshes": "single"}, r"'planet_meshes' is 'single'; valid choices: 'lumped', 'separate'"),
    ],
)
def test_wrong_structural_choices_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        gp.PlanetaryUnit(**given)


def test_a_value_that_cannot_be_compared_is_no_choice() -> None:
    class Odd:
        def __eq__(self, other: object) -> bool:
            raise RuntimeError("no")

        __hash__ = None  # type: ignore[assignment]

    kind = type("Kind", (gl.Component,), {"mode": gl.Structural(None, choices=("one", None))})
    assert kind(mode="one").mode == "one"
    with pytest.raises(BindingError, match=r"'mode' is <.* \.\.\.; valid choices: 'one', None"):
        kind(mode=Odd())
    with pytest.raises(BindingError, match=r"'mode' is 'one'; valid choices: 'one', None"):
        kind(mode=type("OddText", (str,), {"__eq__": Odd.__eq__, "__hash__": None})("one"))


def declare(name: str, value: Any) -> type[gl.Component]:
    return type("Wrong", (gl.Component,), {name: value})


@pytest.mark.parametrize("name", ["time", "start", "guess", "equations", "assemble", "_x"])
def test_reserved_names(name: str) -> None:
    with pytest.raises(DeclarationError, match=rf"Wrong\.{name}: this name is reserved"):
        declare(name, gl.Variable("m", "x"))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (gl.Variable, r"Wrong\.x is the class Variable; make a declaration: Variable\(\.\.\.\)"),
        (gp.Flange, r"Wrong\.x is the class Flange; make a declaration: Flange\(\.\.\.\)"),
        (gp.Inertia(J=1.0), r"Wrong\.x: parts are made in assemble\(\).*self\.x = Inertia\(\.\.\.\)"),
        (gp.Flange("support", when="nope"), r"Wrong\.x: when='nope' is not a Structural of the class"),
    ],
)
def test_slips_in_the_class_body(value: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        declare("x", value)


def test_each_name_has_a_declaration_of_its_own() -> None:
    """Two names of one declaration would stand for the same symbol."""
    shared = gl.Parameter("1", default=1.0)
    with pytest.raises(
        DeclarationError, match=r"^Wrong\.b is the declaration of 'a'; make one for each name: Parameter\(\.\.\.\)$"
    ):
        type("Wrong", (gl.Component,), {"a": shared, "b": shared})
    right: Any = type("Right", (gl.Component,), {"a": shared})
    with pytest.raises(DeclarationError, match=r"^Wrong\.c is the declaration of 'a'"):
        type("Wrong", (right,), {"c": right.a})
    assert type("Again", (gl.Component,), {"a": shared})(a=2.0).a == 2.0  # type: ignore[attr-defined]
    assert right.a.name == "a"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"state": "prefered"}, "state='prefered'.*'never', 'avoid', 'default', 'prefer'"),
        ({"nominal": 0.0}, "nominal=0.0.*expected a positive number"),
        ({"nominal": -1.0}, "nominal=-1.0.*expected a positive number"),
        ({"nominal": float("nan")}, "nominal is nan; expected a finite number"),
    ],
)
def test_wrong_attributes_of_a_variable(given: dict[str, Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        gl.Variable("m", "x", **given)


def test_a_connector_needs_both_halves() -> None:
    with pytest.raises(DeclarationError, match="Half declares only one half; a Potential and a Flow are needed"):
        type("Half", (gl.Connector,), {"phi": gl.Potential("rad", "angle")})


def test_a_connector_of_several_bases_has_the_variables_of_all() -> None:
    class Hot(gl.Connector):
        T, Q = gl.Potential("K"), gl.Flow("W")

    assert {*type("HotShaft", (gp.Flange, Hot), {}).variables} == {"phi", "tau", "T", "Q"}
    assert {*gp.Flange.variables} == {"phi", "tau"}


def test_conditional_connector() -> None:
    assert gp.IdealGear(ratio=2.0, use_support=True).support.connector.name == "support"
    with pytest.raises(gl.GearlibError, match="IdealGear has no 'support' here; make it with use_support=True"):
        gp.IdealGear(ratio=2.0).support  # noqa: B018


def test_unknown_variable_of_a_port() -> None:
    with pytest.raises(AttributeError, match="Flange 'flange_a' has no variable 'phii'; it has phi, tau"):
        gp.Inertia(J=1.0).flange_a.phii  # noqa: B018


class Row(gl.Component):
    count = gl.Structural(2, "number of bodies", min=1, max=4)
    share = gl.Structural(0.5, "of the whole", max=1)

    def assemble(self) -> Any:
        self.body = [gp.Inertia(J=self.share) for _ in range(self.count)]
        return []


class Shed(gl.Component):
    count = gl.Structural(2)

    def assemble(self) -> Any:
        self.row = Row(count=self.count)
        return []


def test_structural_choices_have_bounds_and_are_refused_by_path() -> None:
    for count in (1, 4):
        assert len(gl.compile(Row(count=count), outputs=["body[0].w"]).summary()) > 0
    with pytest.raises(BoundError, match=r"^Row: count is 0; expected 1 to 4$"):
        gl.compile(Row(count=0))
    with pytest.raises(BoundError, match=r"^row: count is 5; expected 1 to 4$"):
        gl.compile(Shed(count=5))
    with pytest.raises(BoundError, match=r"^Row: share is 1\.5; expected 1 or less$"):
        gl.compile(Row(share=1.5))
    with pytest.raises(BoundError, match=r"^Row: share is nan; expected 1 or less$"):
        gl.compile(Row(share=float("nan")))


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: gl.Structural((), min=1), r"Structural: min and max bound a number; the default is \(\)"),
        (lambda: gl.Structural(True, max=1), r"Structural: min and max bound a number; the default is True"),
        (lambda: gl.Structural(0, min=1), r"Structural: the default is 0; expected 1 or more"),
        (lambda: gl.Structural(3, min=1, max=2), r"Structural: the default is 3; expected 1 to 2"),
        (lambda: gl.Structural(3, min="a"), r"Structural: min"),
    ],
)
def test_bounds_of_a_structural_choice_fit_its_default(declare: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        declare()


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: gl.Parameter(2.0), r"Parameter: unit is 2\.0; expected text, such as 'kg\.m2' \(a value is given by name"),
        (lambda: gl.Parameter("m", 3), "Parameter: description is 3; expected text, such as 'load"),
        (lambda: gl.Parameter("rpm"), "the unit 'rpm' is not accepted"),
        (lambda: gl.Parameter("m", min=2, max=1), "Parameter: min is 2, above max, which is 1"),
        (lambda: gl.Parameter("m", min=float("nan")), "Parameter: min is nan"),
        (lambda: gl.Parameter("m", max="a"), "Parameter: max is 'a'"),
        (lambda: gl.Parameter("m", default="a"), "Parameter: default is 'a'"),
        (lambda: gl.Parameter("m", default=float("inf")), "Parameter: default is inf"),
        (lambda: gl.Parameter("m", default=gl.Parameter), "Parameter: default is <class"),
        (lambda: gl.Input("m", default="a"), "Input: default is 'a'"), (lambda: gl.Variable("m", start="a"), "Variable: start is 'a'"),
        (lambda: gl.Variable("m", guess=None), "Variable: guess is None"), (lambda: gl.Variable("m", min="a"), "Variable: min is 'a'"),
        (lambda: gl.Variable("m", state=3), r"Variable\(state=3\): valid choices: 'never'"),
        (lambda: gl.Derivative(3), "Derivative: of is 3; expected text, such as 'w'"),
        (lambda: gl.Discrete(start="a"), "Discrete: start is 'a'"), (lambda: gl.Discrete(3), "Discrete: description is 3"),
        (lambda: gl.Discrete(start=float("inf")), "Discrete: start is inf"),
        (lambda: gl.Structural(3, 4), "Structural: description is 4"), (lambda: gl.Structural(3, max="a"), "Structural: max is 'a'"),
        (lambda: gl.Structural(3, choices=3), "Structural: choices is 3; expected a tuple of the valid values"),
        (lambda: gp.Flange("a", when=3), "Flange: when is 3; expected the name of a Structural"),
        (lambda: gp.Flange(3), "Flange: description is 3"),
    ],
)  # fmt: skip
def test_what_a_declaration_does_not_take(declare: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        declare()


@pytest.mark.parametrize(
    "words",
    [
        "open",
        3,
        ["open", "closed"],
        {0: 5},
        {"a": "open"},
        {0: "open {} {}"},
        {0: "{x}"},
        {0: "open {0.y}"},
        {float("nan"): "open"},
    ],
)
def test_words_are_texts_by_value(words: Any) -> None:
    with pytest.raises(
        DeclarationError, match=r"^Variable: words is .*; expected texts by value, such as \{0: 'open: mesh \{\}'"
    ):
        gl.Variable("1", words=words)
    right = {0: "open: mesh {}", 1.5: "closed", True: "in {{contact}}"}
    assert gl.Variable("1", words=right).words == right


def test_what_a_declaration_takes() -> None:
    assert (gl.Parameter("m", min=1, max=1).min, gl.Parameter("m").max) == (1.0, float("inf"))
    assert type(gl.Parameter("m", min=1).min) is float
    for default in (None, 2, 2.5, gl.pi / 2, lambda s: s.a):
        assert gl.Parameter("m", default=default).default is default
    assert gl.Structural(2, min=2, max=2).bounds == "2 to 2"
    assert [
        s.is_bounded for s in (gl.Structural(2), gl.Structural(2, min=0), gl.Structural(2, max=9), gl.Structural(True))
    ] == [False, True, True, False]
    assert (gl.Structural(2, max=9).bounds, gl.Structural(2.0, min=0.5).bounds) == ("9 or less", "0.5 or more")
    assert gl.Variable("m", start=2.0, min=-float("inf")).start == 2.0
    assert gl.Discrete().start == gl.Variable().guess == 0.0
    assert gl.Variable().nominal == 1.0


def test_offered_values_are_numbers_by_name() -> None:
    values = gl.offered({"a": 2, "b": 0.5})
    assert values == {"a": 2.0, "b": 0.5}
    with pytest.raises(ArgumentError, match=r"values: a is 'x'"):
        gl.offered({"a": "x"})  # type: ignore[dict-item]


def test_lists_and_arrays_become_tuples() -> None:
    assert as_tuple([[1, 2], (3, [4])]) == ((1, 2), (3, (4,)))
    assert as_tuple(np.array([[1, 2], [3, 4]])) == ((1, 2), (3, 4))
    assert as_tuple("ab") == "ab"


class Everything(gl.Component):
    side = gl.Structural(False)
    flange = gp.Flange("always")
    x = gl.Variable("m", "place", start=1.0)
    extra = gp.Flange("at times", when="side")
    u, v = gl.Input("m", "given"), gl.Variable("m/s", "speed")
    g = gl.Variable("m", guess=2.0)
    k, n = gl.Parameter("1", default=1.0), gl.Discrete("count")
    a = gl.Derivative("v", "m/s2")


def test_declarations_of_an_instance_follow_its_choices() -> None:
    without, with_side = declared_by(Everything()), declared_by(Everything(side=True))
    assert list(without.variables) == ["flange.phi", "flange.tau", "x", "u", "v", "g"]
    assert list(with_side.variables) == ["flange.phi", "flange.tau", "x", "extra.phi", "extra.tau", "u", "v", "g"]
    assert (list(with_side.parameters), list(with_side.discretes), with_side.derivatives) == (["k"], ["n"], {"a": "der(v)"})
    assert list(without.connectors) == ["flange"]
    assert list(with_side.valued) == ["x", "u", "g"]
    assert with_side.ends == {"flange": ([0], [1]), "extra": ([3], [4])}


@pytest.mark.parametrize("side", [True, False])
def test_a_connector_on_a_condition_is_there_where_it_holds(side: bool) -> None:
    kind = type("Kind", (gl.Component,), {"side": gl.Structural(False), "extra": gp.Flange("at times", when="side")})
    found = declared_by(kind(side=side))
    assert (list(found.connectors), list(found.variables)) == ((["extra"], ["extra.phi", "extra.tau"]) if side else ([], []))


def test_a_class_is_asked_for_its_declarations_and_an_instance_for_symbols() -> None:
    for name in ("side", "flange", "x", "u", "k", "n", "a"):
        assert getattr(Everything, name).name == name
    made = Everything(side=True)
    assert (str(made.x), str(made.a), made.side, str(made.extra.phi)) == ("x", "der(v)", True, "extra.phi")


@pytest.mark.parametrize(
    ("default", "given", "kept"),
    [(3, np.int64(4), 4), (3, 4, 4), (True, False, False), ((), [[1, 2]], ((1, 2),)), ((), np.array([1, 2]), (1, 2)),
     (None, "anything", "anything"), (None, [1, 2], [1, 2]), (2.5, 1.5, 1.5)],
)  # fmt: skip
def test_structural_choices_have_the_type_of_their_default(default: Any, given: Any, kept: Any) -> None:
    made = type("Made", (gl.Component,), {"s": gl.Structural(default)})(s=given)
    assert (made.s, type(made.s)) == (kept, type(kept))


@pytest.mark.parametrize(
    ("declared", "given", "message"),
    [
        (gl.Structural(3), True, r"structural choice 's' is True \(bool\); expected int"),
        (gl.Structural(True), 1, r"'s' is 1 \(int\); expected bool"), (gl.Structural(3), None, "expected int"),
        (gl.Structural(3), np.timedelta64(3, "s"), "expected int"),
        (gl.Structural(1, choices=(1, 2)), True, r"'s' is True; valid choices: 1, 2"),
        (gl.Structural(1, choices=(1, 2)), 3, "valid choices: 1, 2"),
        (gl.Structural("a", choices=("a", True)), 1, "valid choices: 'a', True"),
        (gl.Structural(1.5), 2, r"'s' is 2 \(int\); expected float"), (gl.Structural(()), 3, "expected tuple"),
    ],
)  # fmt: skip
def test_structural_choices_of_other_types_are_refused(declared: Any, given: Any, message: str) -> None:
    with pytest.raises(BindingError, match=f"^Made: .*{message}"):
        type("Made", (gl.Component,), {"s": declared})(s=given)
