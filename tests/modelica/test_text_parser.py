"""Modelica's grammar: sections of a class, and how deeply texts may be nested."""

from __future__ import annotations

import re
from typing import Any

import pytest

from gearlib.errors import ModelicaError
from gearlib.modelica.syntax_tree import ClassNode, ComponentNode, ExtendsNode, ImportNode, SyntaxNode
from gearlib.modelica.text_parser import DEEPEST_TEXT, parsed


def test_sections_of_a_class_may_follow_in_any_order() -> None:
    text = """
        model M
          Real a;
        protected
          Real b = 1;
          annotation(Documentation(info="between"));
        equation
          a = b;
        public
          parameter Real c = 2;
        initial equation
          a = c;
        equation
          b = a;
        protected
        end M;
        model N end N;"""
    first, second = parsed(text).classes
    assert (first.name, second.name) == ("M", "N")
    assert [element.name for element in first.elements] == ["a", "b", "c"]  # type: ignore[union-attr]
    assert (len(first.equations), len(first.initial_equations)) == (2, 1)


def nested(levels: int, beside: int = 0) -> str:
    """An expression in so many brackets, behind others that are not nested."""
    others = " ".join(f"Real y{k} = if true then (1) else (2);" for k in range(beside))
    return f"model M {others} Real x = {'(' * levels}1{')' * levels}; end M;"


@pytest.mark.parametrize("beside", [0, 2 * DEEPEST_TEXT])
def test_depth_is_that_of_what_is_open(beside: int) -> None:
    """Of the class, the expression and its brackets; what was closed before does not count."""
    assert parsed(nested(DEEPEST_TEXT - 2, beside)).classes[0].name == "M"
    with pytest.raises(ModelicaError, match="nested too deeply; give parts of it to variables"):
        parsed(nested(DEEPEST_TEXT - 1, beside))


@pytest.mark.parametrize("beside", [0, 2 * DEEPEST_TEXT])
def test_classes_nest_as_deeply(beside: int) -> None:
    def text(levels: int) -> str:
        others, inner = " ".join(f"model N{k} end N{k};" for k in range(beside)), ""
        for k in range(levels - 1):
            inner = f"package P{k} {inner} end P{k};"
        return f"package Q {others} {inner} end Q;"

    assert parsed(text(DEEPEST_TEXT)).classes[0].name == "Q"
    with pytest.raises(ModelicaError, match="nested too deeply"):
        parsed(text(DEEPEST_TEXT + 1))


# ---------------------------------------------------------------- expressions


def element(text: str) -> Any:
    """The first element of a model with these declarations."""
    return parsed(f"model M {text} end M;").classes[0].elements[0]


def form(node: Any) -> Any:
    """A syntax tree without places: the name of each node, and what it holds."""
    if isinstance(node, SyntaxNode):
        return type(node).__name__, *(form(value) for name, value in vars(node).items() if name != "at")
    return tuple(map(form, node)) if isinstance(node, tuple) else node


def written(text: str) -> Any:
    """The form of an expression."""
    return form(element(f"Real x = {text};").value)


@pytest.mark.parametrize(
    ("text", "bracketed"),
    [
        ("a - b - c + d", "((a - b) - c) + d"),
        ("a / b * c / d", "((a / b) * c) / d"),
        ("a + b * c ^ d", "a + (b * (c ^ d))"),
        ("a .- b .* c .^ d ./ e", "a .- ((b .* (c .^ d)) ./ e)"),
        ("-a ^ b + c", "(-(a ^ b)) + c"),
        ("-a * b - c", "(-(a * b)) - c"),
        ("+a .+ b", "(+a) .+ b"),
        ("a < b + c", "a < (b + c)"),
        ("not a > b and c or d and not e", "((not (a > b)) and c) or (d and (not e))"),
        ("a or b or c and d and e", "(a or b) or ((c and d) and e)"),
        (
            "if a or b then c + d elseif e == f then g else h + i",
            "if (a or b) then (c + d) elseif (e == f) then g else (h + i)",
        ),
        ("if a then b else if c then d else e", "if a then b else (if c then d else e)"),
        ("a + b : c * d", "(a + b) : (c * d)"),
        ("1 : 2 + 3 : n - 1", "1 : (2 + 3) : (n - 1)"),
        ("f(a + b, c) ^ g", "(f((a + b), (c))) ^ g"),
        ("{a + b, c}", "{(a + b), (c)}"),
        ("{a * k for k in 1:n + 1}", "{(a * k) for k in (1:(n + 1))}"),
        ("a[k + 1, 2].b[:] * c", "(a[(k + 1), (2)].b[:]) * (c)"),
    ],
)
def test_operators_bind_as_in_modelica(text: str, bracketed: str) -> None:
    assert written(text) == written(bracketed)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("12", ("NumberNode", 12)),
        ("1.5e-3", ("NumberNode", 0.0015)),
        ("true", ("TruthNode", True)),
        ("false", ("TruthNode", False)),
        ('"a"', ("StringNode", "a")),
        ("{}", ("ArrayNode", ())),
        ("{1}", ("ArrayNode", (("NumberNode", 1),))),
        ("-1", ("OperationNode", "-", (("NumberNode", 1),))),
        ("1 <> 2", ("OperationNode", "<>", (("NumberNode", 1), ("NumberNode", 2)))),
        ("1:2", ("RangeNode", ("NumberNode", 1), None, ("NumberNode", 2))),
        ("1:2:3", ("RangeNode", ("NumberNode", 1), ("NumberNode", 2), ("NumberNode", 3))),
        (".a.b[2]", ("ReferenceNode", ("a", "b"), ((), (("NumberNode", 2),)))),
        ("a[:]", ("ReferenceNode", ("a",), ((("RangeNode", None, None, None),),))),
        ("P.f(1, b = 2)", ("CallNode", "P.f", (("NumberNode", 1),), (("b", ("NumberNode", 2)),))),
        ("f()", ("CallNode", "f", (), ())),
        ("der(1)", ("CallNode", "der", (("NumberNode", 1),), ())),
        ("if true then 1 else 2", ("ChoiceNode", ((("TruthNode", True), ("NumberNode", 1)),), ("NumberNode", 2))),
    ],
)  # fmt: skip
def test_what_an_expression_holds(text: str, expected: Any) -> None:
    assert written(text) == expected


def test_rows_of_a_matrix_are_arrays() -> None:
    assert written("[1, 2; 3, 4]") == written("{{1, 2}, {3, 4}}")
    assert written("[1]") == written("{{1}}")
    assert written("sum(k for k in 1:3)") == ("CallNode", "sum", (written("{k for k in 1:3}"),), ())


def test_long_numbers_are_kept() -> None:
    """As integers as long as a floating-point number can hold them."""
    assert element(f"Real x = 1{'0' * 298};").value.value == 10**298
    assert element(f"Real x = 1{'0' * 299};").value.value == 1e299


# ---------------------------------------------------------------- declarations and equations


def test_what_a_declaration_holds() -> None:
    text = """final parameter input P.Q[2] a[3](start = 1, each final b.c(min = 0) = 2 "inner", redeclare R r(k = 3) constrainedby S(k = 1))
        = 4 if held "words " + "joined" annotation(Icon(x = 1)), b; """
    first, second = parsed(f"model M {text} end M;").classes[0].elements
    assert isinstance(first, ComponentNode)
    assert isinstance(second, ComponentNode)
    assert (first.name, first.type, first.prefixes) == ("a", ("P", "Q"), {"final", "parameter", "input"})
    assert [form(d) for d in first.dimensions] == [("NumberNode", 3), ("NumberNode", 2)], (
        "its own come before those of the type"
    )
    assert (form(first.value), form(first.condition)) == (("NumberNode", 4), ("ReferenceNode", ("held",), ((),)))
    assert first.comment == "words joined"
    start, inner, new = first.modifications
    assert (start.name, form(start.value), start.each, start.final) == (("start",), ("NumberNode", 1), False, False)
    assert (inner.name, form(inner.value), inner.each, inner.final) == (("b", "c"), ("NumberNode", 2), True, True)
    assert [(m.name, form(m.value)) for m in inner.inner] == [(("min",), ("NumberNode", 0))]
    assert isinstance(new.redeclared, ComponentNode)
    assert (new.name, new.redeclared.type, len(new.redeclared.modifications)) == (("r",), ("R",), 2)
    constraint = new.redeclared.constraint
    assert constraint is not None
    assert new.redeclared.modifications[0] is constraint[0], "the constraint's come first, and its own take precedence"
    assert (first.constraint, second.name) == (None, "b")
    assert (second.name, second.type, second.prefixes) == ("b", ("P", "Q"), first.prefixes)
    assert (second.value, second.condition, second.modifications, len(second.dimensions)) == (None, None, (), 1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("import A.B;", [(("A", "B"), "B")]),
        ("import C = A.B \"why\";", [(("A", "B"), "C")]),
        ("import A.B.*;", [(("A", "B"), "*")]),
        ("import A. *;", [(("A",), "*")]),
        ("import A.{B, C};", [(("A", "B"), "B"), (("A", "C"), "C")]),
    ],
)  # fmt: skip
def test_imports(text: str, expected: Any) -> None:
    found = parsed(f"model M {text} end M;").classes[0].elements
    assert [(node.path, node.alias) for node in found if isinstance(node, ImportNode)] == expected


def test_classes_within_a_class() -> None:
    text = """
    within A.B;
    final encapsulated package P "of several" + " kinds"
      type Mode = enumeration(slow "crawls", fast) "how fast";
      type Torque = parameter Real(unit = "N.m") "turns";
      type Open = enumeration(:);
      replaceable partial model R end R;
      redeclare model S = R constrainedby R(k = 1) "any";
      model T
        extends .A.R(k = 2) annotation(Icon());
        U u(redeclare model V = W(k = 3), replaceable X y, final z = 1);
      end T;
      annotation(version = "1");
    end P;"""
    whole = parsed(text)
    package = whole.classes[0]
    assert (whole.within, package.kind, package.comment, package.prefixes) == (
        ("A", "B"), "package", "of several kinds", {"encapsulated"},
    )  # fmt: skip
    classes = package.classes
    assert list(classes) == ["Mode", "Torque", "Open", "R", "S", "T"]
    assert (classes["Mode"].literals, classes["Mode"].comment, classes["Mode"].short_for) == (
        ("slow", "fast"),
        "how fast",
        None,
    )
    torque = classes["Torque"].short_for
    assert torque is not None
    assert (torque.type, torque.modifications[0].name) == (("Real",), ("unit",))
    assert (classes["Open"].literals, classes["R"].prefixes) == ((), {"replaceable", "partial"})
    short = classes["S"].short_for
    assert short is not None
    assert (short.type, short.modifications, classes["S"].prefixes) == (("R",), classes["S"].constraint, {"redeclare"})
    base, part = classes["T"].elements
    assert isinstance(base, ExtendsNode)
    assert (base.type, base.modifications[0].name) == (("A", "R"), ("k",))
    assert isinstance(part, ComponentNode)
    model, component, value = part.modifications
    assert isinstance(model.redeclared, ClassNode)
    assert (model.name, model.redeclared.kind) == (("V",), "model")
    assert isinstance(component.redeclared, ComponentNode)
    assert component.redeclared.type == ("X",)
    assert (component.final, value.final, value.redeclared) == (False, True, None)
    assert parsed("within; model M end M;").within == ()


def test_what_equations_hold() -> None:
    text = """model M equation
      connect(a.b[1], c);
      for i in 1:2, j in 3 loop x = i; y = j; end for;
      if a then x = 1; elseif b then x = 2; else x = 3; end if "words";
      when a then x = 1; elsewhen b then reinit(x, 2); end when;
    end M;"""
    connection, loop, choice, when = parsed(text).classes[0].equations
    assert form(connection) == ("ConnectNode", written("a.b[1]"), written("c"))
    x, y = (("EqualityNode", written(left), written(right)) for left, right in (("x", "i"), ("y", "j")))
    assert form(loop) == ("LoopNode", "i", written("1:2"), (("LoopNode", "j", written("3"), (x, y)),))
    one, two, three = (("EqualityNode", written("x"), written(k)) for k in "123")
    assert form(choice) == (
        "ConditionalNode", ((written("a"), (one,)), (written("b"), (two,)), (None, (three,))), False,
    )  # fmt: skip
    call = ("CallStatement", written("reinit(x, 2)"))
    assert form(when) == ("ConditionalNode", ((written("a"), (one,)), (written("b"), (call,))), True)


def test_places_are_where_constructs_begin() -> None:
    text = """model M
      Real x(start = 1) = - a + f(b [2 : 3], {4, 5}) * (if 6 > 7 then "8" else not c ^ 10);
    equation
      connect(d, e);
      x = [11, 12;
           13, {g for g in 14}] "15";
      when y > 0 then reinit(z, 16); end when;
    end M;"""
    lines, begins = text.splitlines(), dict[str, set[str]]()

    def look(node: Any) -> None:
        if isinstance(node, SyntaxNode):
            there = lines[node.at.line - 1][node.at.column - 1 :]
            begins.setdefault(type(node).__name__, set()).add(there[:3].strip())
            look(tuple(vars(node).values()))
        elif isinstance(node, tuple):
            for each in node:
                look(each)

    look(parsed(text))
    assert begins == {
        "TextNode": {"mod"}, "ClassNode": {"mod"}, "ComponentNode": {"x(s"}, "Modification": {"sta"}, "ConnectNode": {"con"},
        "EqualityNode": {"x ="}, "ConditionalNode": {"whe"}, "CallStatement": {"rei"}, "CallNode": {"f(b", "rei"},
        "OperationNode": {"- a", "f(b", "6 >", "not", "c ^", "y >"}, "RangeNode": {"2 :"}, "ChoiceNode": {"if"},
        "ArrayNode": {"{4,", "[11", "11,", "13,"}, "ComprehensionNode": {"{g"}, "StringNode": {'"8"'},
        "NumberNode": {"1)", "2 :", "3],", "4,", "5})", "6 >", "7 t", "10)", "11,", "12;", "13,", "14}", "0 t", "16)"},
        "ReferenceNode": {"a +", "b [", "c ^", "d,", "e);", "x =", "g f", "y >", "z,"},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("model M§; end M;", "a declaration, an equation section or 'end'"),
        ("model M end M§", "';'"),
        ("within A§ model M end M;", "';'"),
        ("§", "a class, such as model Drive ... end Drive;"),
        ("final §M a;", "a class, such as model Drive ... end Drive;"),
        ("partial §M a;", "a class, such as model Drive ... end Drive;"),
        ("model §2 end M;", "the name of the class"),
        ("model M end §N;", "'M', the name of the model that ends here"),
        ("type T = enumeration(a §b);", "')'"),
        ("type T = enumeration §a;", "'('"),
        ("type T = §2;", "the name of a class"),
        ("model M extends §2; end M;", "the name of a class"),
        ("model M import §2; end M;", "the name of a package"),
        ("model M import A.{B §C}; end M;", "'}'"),
        ("model M import A.§= B; end M;", "a name"),
        ("model M Real §= 2; end M;", "the name of a component"),
        ("model M Real x §y; end M;", "';'"),
        ("model M Real x(§2); end M;", "a modification, such as J = 2"),
        ("model M Real x(a = 2 §b = 3); end M;", "')'"),
        ("model M Real x(redeclare §2 y); end M;", "the name of a class"),
        ("model M equation connect §a, b); end M;", "'('"),
        ("model M equation connect(a §b); end M;", "','"),
        ("model M equation connect(a, b§; end M;", "')'"),
        ("model M equation connect(a, §1); end M;", "a name"),
        ("model M equation for §1 in 1:2 loop x = 1; end for; end M;", "the index of a loop"),
        ("model M equation for i §= 1:2 loop x = 1; end for; end M;", "'in' and a range, as in 'for i in 1:n loop'"),
        ("model M equation for i in 1:2 §x = 1; end for; end M;", "'loop'"),
        ("model M equation for i in 1:2 loop x = 1; end §if; end M;", "'for'"),
        ("model M equation if a §x = 1; end if; end M;", "'then'"),
        ("model M equation if a then x = 1; elseif b §x = 1; end if; end M;", "'then'"),
        ("model M equation if a then x = 1; end §when; end M;", "'if'"),
        ("model M equation when a then x = 1; §else x = 2; end when; end M;", "'end'"),
        ("model M equation x§; end M;", "'='"),
        ("model M equation x = 1§ y = 2; end M;", "';'"),
        ("model M initial §Real x; end M;", "'equation'"),
        ("model M Real x = a < b §< c; end M;", "';'"),
        ("model M Real x = a ^ b §^ c; end M;", "';'"),
        ("model M Real x = a * §-b; end M;", "an expression"),
        ("model M Real x = if a §b else c; end M;", "'then'"),
        ("model M Real x = if a then b§; end M;", "'else'"),
        ("model M Real x = (a §b); end M;", "')'"),
        ("model M Real x = {a §b}; end M;", "'}'"),
        ("model M Real x = {a for k in 1:2§; end M;", "'}'"),
        ("model M Real x = [a §b]; end M;", "']'"),
        ("model M Real x = f(a §b); end M;", "')'"),
        ("model M Real x = a[1]§(b); end M;", "an operator"),
        ("model M Real x = a[1 §2]; end M;", "']'"),
        ('model M Real x "a" §+ ; end M;', "';'"),
        ('model M Real x "a" + "b" §+ 1; end M;', "';'"),
    ],
)
def test_what_is_expected_where(text: str, expected: str) -> None:
    """At the sign, there is something else."""
    place, text = text.index("§"), text.replace("§", "")
    word = re.match(r"\w+|[^\w\s]|$", text[place:].lstrip())
    assert word is not None
    with pytest.raises(ModelicaError) as said:
        parsed(text, "M.mo")
    found = f"'{word[0]}'" if word[0] else "end of text"
    column = place + 1 + len(text[place:]) - len(text[place:].lstrip())
    assert str(said.value) == f"M.mo, line 1, column {column}: found {found}, expected {expected}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("§operator record C end C;", "operator classes are not supported"),
        ("§model extends M end M;", "'model extends' is not supported; write a class of another name with 'extends'"),
        ("function f = §der(g, x);", "functions that are partial derivatives are not supported"),
        ("type T = Real§[3];", "a class of arrays is not supported; give dimensions where components are declared"),
        ("function f §external; end f;", "external functions are not supported"),
        ("model M §initial algorithm x := 1; end M;", "algorithms are not supported; write equations"),
        ("model M model N end N; §model N end N; end M;", "the class N is declared twice"),
        ("model M Real x(y§[2] = 3); end M;",
         "a modification of single elements is not supported; give an array, as in J = {1, 2}"),
        ("model M equation (a§, b) = f(x); end M;", "functions with several outputs are not supported"),
        ("model M Real x = a[§end]; end M;", "'end' as a subscript is not supported; write the last index"),
    ],
)  # fmt: skip
def test_what_is_not_supported_and_where(text: str, said: str) -> None:
    place, text = text.index("§"), text.replace("§", "")
    with pytest.raises(ModelicaError) as problem:
        parsed(text)
    assert str(problem.value) == f"the text, line 1, column {place + 1}: {said}"
