"""The analysis of a class: what its instances share, and which equations say nothing."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.equations.class_record import check_values, class_record, descend, refuse_misfits
from gearlib.equations.template import Template
from gearlib.errors import BalanceError, DeclarationError
from gearlib.language.expressions import DEEPEST
from gearlib.language.interior import connections_of


class Leaf(gl.Component):
    side = gl.Structural(False)
    k, m = gl.Parameter("1", default=1.0), gl.Parameter("1", default=2.0)
    flange = gp.Flange("always")
    extra = gp.Flange("at times", when="side")
    x, y, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    n = gl.Discrete("count")


def leaf(*equations: Any, **given: Any) -> gl.Component:
    made: gl.Component = type("Leaf", (Leaf,), {"equations": lambda s: [e(s) for e in equations]})(**given)
    return made


COUNT = (lambda s: gl.Eq(s.n, 1),)


def test_what_a_record_knows_of_its_class() -> None:
    plain = class_record(leaf(lambda s: gl.Eq(s.x, s.k * s.y), *COUNT))
    assert plain.variable_index == {"flange.phi": 0, "flange.tau": 1, "x": 2, "y": 3, "z": 4}
    assert (plain.parameter_index, plain.connector_index) == ({"k": 0, "m": 1}, {"flange": 0})
    assert plain.own_names == {"x", "y", "k"}
    assert plain.choices == {"side"}, "the connectors depend on it"
    assert [t.label for t in plain.templates] == ["Leaf: x = k*y"]
    assert [u.target for u in plain.updates] == ["n"]
    assert not plain.local, "an update needs the numbers of its instance"
    assert class_record(leaf(lambda s: gl.Eq(s.n, 1), side=True)).connector_index == {"flange": 0, "extra": 1}
    law = {"x": gl.Variable("1"), "k": gl.Parameter("1", default=1.0), "equations": lambda s: [gl.Eq(s.x, s.k)]}
    assert class_record(type("Plain", (gl.Component,), law)()).local


def test_equations_of_parts_and_with_discrete_variables_are_not_local() -> None:
    class Whole(gl.Component):
        x = gl.Variable("rad/s")

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=1.0)
            return []

        def equations(self) -> list[Any]:
            return [gl.Eq(self.x, self.body.w)]

    whole = Whole()
    connections_of(whole)
    record = class_record(whole)
    assert not record.local
    assert record.templates[0].locals == ("body.w", "x")
    assert descend(whole, "body.flange_a.phi") == (whole.body, "flange_a.phi")
    assert descend(whole, "body") == (whole, "body")
    assert descend(whole, "other.w") == (whole, "other.w")


def test_records_are_shared_within_a_compilation_and_between() -> None:
    met: dict[Any, Any] = {}
    one = class_record(gp.Inertia(J=1.0), met)
    assert class_record(gp.Inertia(J=2.0), met) is one
    assert len(met) == 1
    assert class_record(gp.Inertia(J=2.0), {}) is one
    assert class_record(gp.IdealGear(ratio=2.0, use_support=True)) is not class_record(gp.IdealGear(ratio=2.0))


class Scaled(gl.Component):
    """Its equation holds a number that is neither a parameter nor a structural choice."""

    x, y = gl.Variable("1"), gl.Variable("1")

    def __init__(self, gain: Any) -> None:
        super().__init__()
        self.gain = gain

    def equations(self) -> list[Any]:
        return [gl.Eq(self.y, float(np.sum(self.gain)) * self.x)]


def test_attributes_of_an_instance_tell_its_equations() -> None:
    """Within one compilation, too; those that cannot be compared are analysed one by one."""
    met: dict[Any, Any] = {}
    gains: list[Any] = [2.0, 3.0, 2.0, np.array([1.0, 4.0]), [1.0, 5.0], True]
    found = [class_record(Scaled(gain), met).templates[0].label for gain in gains]
    assert found == [f"Scaled: y = {gain}*x" for gain in ("2.0", "3.0", "2.0", "5.0", "6.0", "1.0")]
    assert class_record(Scaled(2.0), met) is class_record(Scaled(2.0), met)


def test_equations_are_analysed_again_for_other_parts() -> None:
    """What a name stands for follows from the part: a variable of one class may be a parameter of another."""
    varying = type("Varying", (gl.Component,), {"x": gl.Variable("1")})
    given = type("Given", (gl.Component,), {"x": gl.Parameter("1", default=2.0)})
    parts = [varying]

    class Whole(gl.Component):
        y = gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.part = parts[-1]()
            return []

        def equations(self) -> list[Any]:
            return [gl.Eq(self.y, self.part.x)]

    def names() -> tuple[tuple[str, ...], tuple[str, ...]]:
        whole = Whole()
        connections_of(whole)
        (template,) = class_record(whole).templates
        return template.locals, template.parameters

    assert names() == (("part.x", "y"), ())
    parts.append(given)
    assert names() == (("y",), ("part.x",))


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        ([lambda s: gl.Eq(s.k, 2)], r"over-determined: Leaf: k = 2 holds no variable that it could determine"),
        ([lambda s: gl.Eq(s.x, s.y), lambda s: gl.Eq(s.y, s.x)], r"Leaf: x = y and Leaf: y = x say the same; leave one of them out"),
        ([lambda s: gl.Eq(s.x * s.y, 2), lambda s: gl.Eq(s.x * s.y, 2)], r"two equations Leaf: x\*y = 2 say the same"),
        (
            [lambda s: gl.Eq(s.x, s.y), lambda s: gl.Eq(s.y, s.z), lambda s: gl.Eq(s.z, s.x)],
            r"one of these equations follows from the others: Leaf: x = y; Leaf: y = z; ",
        ),
        (
            [lambda s: gl.Eq(s.x, 0), lambda s: gl.Eq(s.y, 0), lambda s: gl.Eq(s.x, -s.y)],
            r"one of these equations follows from the others: Leaf: x = 0; Leaf: y = 0; Leaf: x = -y",
        ),
    ],
)  # fmt: skip
def test_equations_of_a_class_that_say_nothing_new(equations: Any, message: str) -> None:
    with pytest.raises(BalanceError, match=message):
        class_record(leaf(*equations, *COUNT))


LINEAR = (
    "x - k*y", "3*x - 3*k*y", "y - z", "x - k*z", "(x - k*z)*m - x + y", "x - y + z - 1", "2*x - 2*y + 2*z - 3",
    "x/1000 + z/1000 - 1", "x*m + z*m - 1000*m",
)  # fmt: skip


@pytest.mark.parametrize("count", [2, 3, 4])
def test_sums_of_equations_that_repeat_others_are_refused_whatever_the_parameters_are(count: int) -> None:
    """Against exact ranks at some parameters; named are those without which the rank is the same."""
    given = {sympy.Symbol("k"): sympy.Rational(17, 10), sympy.Symbol("m"): sympy.Rational(-3, 7)}
    unknowns = sympy.symbols("x y z")
    exact = {text: sympy.sympify(text).subs(given).expand() for text in LINEAR}
    rows = {text: [*map(f.coeff, unknowns), f.subs(dict.fromkeys(unknowns, 0))] for text, f in exact.items()}

    def rank(texts: Any) -> int:
        return int(sympy.Matrix([rows[text] for text in texts]).rank())

    def equation(text: str) -> Any:
        return lambda s: gl.Eq(eval(text, {"x": s.x, "y": s.y, "z": s.z, "k": s.k, "m": s.m}), 0)

    for texts in list(itertools.combinations(LINEAR, count))[:: (2, 6, 11)[count - 2]]:
        known, told = rank(texts), ""
        try:
            class_record(leaf(*map(equation, texts), *COUNT))
        except BalanceError as error:
            told = str(error)
        assert bool(told) == (known < count), texts
        assert told.count("Leaf: ") == (sum(rank(set(texts) - {text}) == known for text in texts) if told else 0), texts


def test_equalities_with_opposite_signs_are_two() -> None:
    """x = y and x = -y make both zero; so do x + y = 0 and y = 0."""
    for other in (lambda s: gl.Eq(s.x, -s.y), lambda s: gl.Eq(s.y, 0), lambda s: gl.Eq(s.z, s.x)):
        assert len(class_record(leaf(lambda s: gl.Eq(s.x, s.y), other, *COUNT)).templates) == 2


@pytest.mark.parametrize(
    ("equation", "message"),
    [
        (lambda s: gl.Eq(s.x, gl.language.expressions.real_symbol("w")), r"Leaf: x = w: 'w' is not declared; .*x"),
        (lambda s: gl.Eq(s.x, "y"), r"Leaf\.equations\(\): x == 'y' is not an equation: the right side is 'y'"),
        (lambda s: gl.Eq(None, s.x), r"None == x is not an equation: the left side is None"),
        (lambda s: gl.Eq(s.x, s.flange.phi * gl.language.expressions.real_symbol("flange.omega")), r"'flange\.omega' is not declared"),
        (lambda s: gl.Eq(s.x, gl.pre(s.y)), r"Leaf: x = pre\(y\): pre\(y\) is for a gl\.Discrete, and y changes continuously; in a"),
        (lambda s: gl.Eq(s.x, gl.language.expressions.real_symbol("pre(w)")), r"'pre\(w\)' is not declared"),
    ],
)  # fmt: skip
def test_names_and_sides_are_checked(equation: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        class_record(leaf(equation, *COUNT))


def test_values_that_cannot_be_compared() -> None:
    class Odd:
        def __hash__(self) -> int:
            raise RuntimeError("no")

    with pytest.raises(DeclarationError, match=r"Free: values of structural choices must be hashable, got "):
        class_record(type("Free", (gl.Component,), {"s": gl.Structural(None)})(s=Odd()))
    with pytest.raises(
        DeclarationError, match=r"units do not match \(gl\.check_units lists all mismatches of a component\): a; b$"
    ):
        refuse_misfits(["a", "b"])
    refuse_misfits([])


class Reader(gl.Component):
    """Its equation reads what the part that it was given is, at some depth."""

    y = gl.Variable("1")

    def __init__(self, part: gl.Component) -> None:
        super().__init__()
        self.part = part

    def equations(self) -> list[Any]:
        part: Any = self.part
        while isinstance(part, Reader):
            part = part.part
        return [gl.Eq(self.y, part.n * int(np.sum(part.gain)) * part.x)]


def test_parts_given_to_an_instance_tell_its_equations() -> None:
    """Within one compilation, too: their classes, choices and attributes, and those of parts within them."""
    common = {"n": gl.Structural(1), "gain": 1}
    varying = type("Varying", (gl.Component,), {"x": gl.Variable("1"), **common})
    given = type("Given", (gl.Component,), {"x": gl.Parameter("1", default=2.0), **common})

    def part(kind: Any, n: int, gain: Any = None) -> Any:
        made = kind(n=n)
        if gain is not None:
            made.gain = gain
        return made

    parts = [
        part(varying, 1),
        part(varying, 2),
        part(given, 1),
        part(varying, 1, 3),
        part(varying, 1, [3, 1]),
    ]  # what is in a list cannot be compared
    parts += [Reader(part(varying, 1)), Reader(part(varying, 5)), Reader(part(given, 1)), Reader(part(given, 1, 6))]
    met: dict[Any, Any] = {}
    found = [class_record(Reader(one), met).templates[0] for one in parts]
    wanted = ["part.x", "2*part.x", "part.x", "3*part.x", "4*part.x"]
    wanted += ["part.part.x", "5*part.part.x", "part.part.x", "6*part.part.x"]
    assert [t.label for t in found] == [f"Reader: y = {text}" for text in wanted]
    assert [t.parameters for t in found] == [(), (), ("part.x",), (), (), (), (), ("part.part.x",), ("part.part.x",)]
    assert class_record(Reader(part(varying, 2)), met) is class_record(Reader(part(varying, 2)), met)


def test_equations_are_asked_for_once_per_compilation_class_and_choice() -> None:
    asked: list[Any] = []

    class Asked(gl.Component):
        n = gl.Structural(1)
        x = gl.Variable("1")

        def equations(self) -> list[Any]:
            asked.append(self.n)
            return [gl.Eq(self.x, self.n)]

    met: dict[Any, Any] = {}
    for n in (1, 2, 1, 2):
        class_record(Asked(n=n), met)
    assert asked == [1, 2]
    class_record(Asked(), {})
    class_record(Asked())
    assert asked == [1, 2, 1, 1]


def test_values_of_parts_that_cannot_be_compared() -> None:
    class Odd:
        def __hash__(self) -> int:
            raise RuntimeError("no")

    free = type("Free", (gl.Component,), {"s": gl.Structural(None), "x": gl.Variable("1")})
    with pytest.raises(DeclarationError, match=r"Free: values of structural choices must be hashable, got "):
        class_record(Reader(free(s=Odd())))


@pytest.mark.parametrize(
    ("equations", "names"),
    [
        ([lambda s: gl.Eq(s.k * s.n, 2)], [("n",)]),
        ([lambda s: gl.Eq(s.k, s.n), lambda s: gl.Eq(s.x, s.y), lambda s: gl.Eq(s.x, 2 * s.y)], [("n",), (), ()]),
        ([lambda s: gl.Eq(s.x, gl.pre(s.n) + s.n * s.k)], [("n", "pre(n)")]),
        ([lambda s: gl.Eq(s.x, gl.Piecewise((s.k, gl.initial()), (s.y, True)))], [("initial()",)]),
        ([lambda s: gl.Eq(s.k, gl.Piecewise((1, s.x > 0), (2, True)))], [()]),
    ],
)  # fmt: skip
def test_discrete_variables_in_equations(equations: Any, names: Any) -> None:
    """An equation without a variable that it determines may still hold one of those, or one in a comparison."""
    record = class_record(leaf(*equations, *COUNT))
    assert [t.discretes for t in record.templates] == names
    assert not any(name in ("n", "pre(n)", "initial()") for t in record.templates for name in t.locals)


@pytest.mark.parametrize(
    "equations",
    [
        [lambda s: gl.Eq(s.x, s.k * s.y), lambda s: gl.Eq(s.x, s.m * s.y)],
        [lambda s: gl.Eq(s.x + 1e-12 * s.y, 0), lambda s: gl.Eq(s.x - 1e-12 * s.y, 0)],
        [lambda s: gl.Eq(s.x + 1e12 * s.y, 0), lambda s: gl.Eq(s.x - 1e12 * s.y, 0)],
        [lambda s: gl.Eq(s.x, s.y + s.z), lambda s: gl.Eq(s.y, s.z), lambda s: gl.Eq(s.x, s.z + 3 * s.y)],
        [lambda s: gl.Eq(s.x, s.y), lambda s: gl.Eq(1e-12 * s.x, -1e-12 * s.y)],
        [lambda s: gl.Eq(s.x, 1), lambda s: gl.Eq(1e-12 * s.x, 2e-12)],
        [lambda s: gl.Eq(s.x, 1e12), lambda s: gl.Eq(1e-12 * s.y, 0), lambda s: gl.Eq(s.x, -s.y)],
    ],
)  # fmt: skip
def test_equations_that_differ_by_a_parameter_or_by_little_are_several(equations: Any) -> None:
    assert len(class_record(leaf(*equations, *COUNT)).templates) == len(equations)


def test_equations_with_a_variable_of_their_own_are_not_examined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor those that have one without these."""
    names = "abcdefgh"
    made = {name: gl.Variable("1") for name in names}

    def equations(s: Any) -> list[Any]:
        a, b, c, d, e, f, g, h = (getattr(s, name) for name in names)
        return [gl.Eq(a, b), gl.Eq(b, c), gl.Eq(c, d + e), gl.Eq(d + e, f), gl.Eq(d, e * f), gl.Eq(g, h), gl.Eq(2 * g, h)]

    asked: list[str] = []
    monkeypatch.setattr(Template, "linear", property(lambda t: asked.append(t.label)))
    class_record(type("Chain", (gl.Component,), {**made, "equations": equations})())
    assert asked == [f"Chain: {text}" for text in ("d + e = f", "d = e*f", "g = h", "2*g = h")]


def test_classes_of_many_equations_are_not_examined(monkeypatch: pytest.MonkeyPatch) -> None:
    circle = (lambda s: gl.Eq(s.x, s.y), lambda s: gl.Eq(s.y, s.z), lambda s: gl.Eq(s.z, s.x))
    monkeypatch.setattr("gearlib.equations.class_record.MOST", 2)
    assert len(class_record(leaf(*circle, *COUNT)).templates) == 3
    monkeypatch.setattr("gearlib.equations.class_record.MOST", 3)
    with pytest.raises(BalanceError, match="one of these equations follows from the others"):
        class_record(type("Circle", (Leaf,), {"equations": lambda s: [e(s) for e in (*circle, *COUNT)]})())


def test_sides_that_are_nested_too_deeply_are_refused() -> None:
    def tower(s: Any) -> Any:
        found = s.y
        for _ in range(3 * DEEPEST):
            found = sympy.sin(found, evaluate=False)
        return found

    for equation in (lambda s: gl.Eq(s.x, tower(s)), lambda s: gl.Eq(tower(s), s.x)):
        told = ""
        try:
            class_record(leaf(equation, *COUNT))
        except (DeclarationError, RecursionError) as error:
            told = f"{type(error).__name__}: {error}"
        assert told.startswith("DeclarationError: Leaf: an expression is nested too deeply")


def test_a_class_without_choices_depends_on_none() -> None:
    assert (
        class_record(type("Ends", (gl.Component,), {"a": gp.Flange("one"), "b": gp.Flange("other")})()).choices == frozenset()
    )


def test_lists_of_parts_are_no_attributes() -> None:
    """Those tell instances apart by what they are; a list of numbers could not be compared."""
    asked: list[Any] = []

    class Row(gl.Component):
        y = gl.Variable("1")

        def __init__(self, gain: Any) -> None:
            super().__init__()
            self.gain = gain

        def assemble(self) -> list[Any]:
            self.bodies = [gp.Inertia(J=1.0), gp.Inertia(J=2.0)]
            return []

        def equations(self) -> list[Any]:
            asked.append(self.gain)
            return [gl.Eq(self.y, np.sum(self.gain) * self.bodies[1].w)]

    met: dict[Any, Any] = {}
    for gain in (2.0, 3.0, 2.0, [1.0, 5.0], [1.0, 5.0], 3.0):
        row = Row(gain)
        connections_of(row)
        assert class_record(row, met).templates[0].label == f"Row: y = {np.sum(gain)}*bodies[1].w"
    assert asked == [2.0, 3.0, [1.0, 5.0], [1.0, 5.0]]


def test_units_of_given_values_are_compared_once_for_each() -> None:
    class Given(gl.Component):
        right = gl.Structural(True)
        m, c = gl.Parameter("kg.m2", default=1.0), gl.Parameter("N.m/rad", default=1.0)

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=self.m if self.right else self.c)
            return []

    one, other, plain = Given(), Given(right=False), gp.Inertia(J=1.0)
    for whole in (one, other, plain):
        connections_of(whole)
    record = class_record(one)
    check_values(one, record)
    assert len(record.fitting) == 1
    check_values(one, record)
    check_values(plain, record)
    assert len(record.fitting) == 1
    with pytest.raises(DeclarationError, match=r"units do not match .*body\.J is in .*"):
        check_values(other, record)
    assert len(record.fitting) == 1


def test_events_that_are_written_otherwise_are_analysed_again() -> None:
    """Conditions, actions, new values of states, and further branches; equal ones are one record."""
    written: list[Any] = []

    class Switched(gl.Component):
        x = gl.Variable("1")
        n = gl.Discrete("count")

        def equations(self) -> list[Any]:
            limit, count, new, more = written[-1]
            other = gl.When(self.x < more, gl.Eq(self.n, 7)) if more is not None else None
            return [
                gl.Eq(gl.der(self.x), 1),
                gl.When(self.x > limit, gl.Eq(self.n, count), gl.reinit(self.x, new), elsewhen=other),
            ]

    found = []
    for given in ((2, 1, 0, None), (3, 1, 0, None), (2, 5, 0, None), (2, 1, -1, None), (2, 1, 0, 0), (2, 1, 0, -4)):
        written.append(given)
        record = class_record(Switched())
        assert class_record(Switched()) is record
        assert sorted(u.target for u in record.updates if u.reinit) == ["x"]
        hidden = ["when_0", "when_1"][: 1 + (given[3] is not None)]
        assert sorted(u.target for u in record.updates if not u.reinit) == ["n", *hidden]
        found.append(record)
    assert len({id(record) for record in found}) == len(found)
    written.append((2, 1, 0, None))
    assert class_record(Switched()) is found[0]
