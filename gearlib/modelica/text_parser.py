"""Parser of Modelica text: recursive descent, one method per grammar rule.

References
----------
Modelica Language Specification 3.6, appendix A "Modelica concrete syntax".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NoReturn, TypeVar

from gearlib.errors import ModelicaError
from gearlib.modelica.lexer import TextPlace, Token, tokens
from gearlib.modelica.syntax_tree import (
    ArrayNode,
    CallNode,
    CallStatement,
    ChoiceNode,
    ClassNode,
    ComponentNode,
    ComprehensionNode,
    ConditionalNode,
    ConnectNode,
    EqualityNode,
    ExtendsNode,
    ImportNode,
    LoopNode,
    Modification,
    NumberNode,
    OperationNode,
    RangeNode,
    ReferenceNode,
    StringNode,
    SyntaxNode,
    TextNode,
    TruthNode,
)

KINDS = ("model", "block", "class", "connector", "package", "type", "record", "function", "operator")
CLASS_PREFIXES = ("encapsulated", "partial", "expandable", "pure", "impure")
TYPE_PREFIXES = ("flow", "stream", "discrete", "parameter", "constant", "input", "output")
ELEMENT_PREFIXES = ("redeclare", "final", "inner", "outer", "replaceable")
RELATIONS = ("<", "<=", ">", ">=", "==", "<>")
ENDS_OF_EQUATIONS = (
    "end", "else", "elseif", "elsewhen", "initial", "equation", "algorithm", "public", "protected", "annotation",
)  # fmt: skip
DEEPEST_TEXT = 60  # nesting depth of expressions and classes; each level takes several Python frames
Found = TypeVar("Found")


def parsed(text: str, source: str = "the text") -> TextNode:
    """Parse the classes of a text.

    Raises
    ------
    ModelicaError
        A syntax error, with line and column.

    Examples
    --------
    >>> text = parsed("model Body parameter Real J = 2; end Body;")
    >>> text.classes[0].name, text.classes[0].elements[0].name
    ('Body', 'J')
    >>> parsed("model Body parameter Real J = ; end Body;")
    Traceback (most recent call last):
    gearlib.errors.ModelicaError: the text, line 1, column 31: found ';', expected an expression
    """
    return _Parser(tokens(text, source)).text()


class _Parser:
    """Token stream with the position of the next token."""

    def __init__(self, found: list[Token]) -> None:
        self.tokens, self.next, self.depth = found, 0, 0

    # ------------------------------------------------------------ tokens

    @property
    def token(self) -> Token:
        return self.tokens[self.next]

    @property
    def at(self) -> TextPlace:
        return self.token.at

    def fail(self, expected: str) -> NoReturn:
        raise ModelicaError(f"{self.at}: found {self.token}, expected {expected}")

    def step(self) -> Token:
        token = self.token
        self.next += token.kind != "end of text"
        return token

    def sees(self, *words: str) -> bool:
        token = self.token
        return token.kind in ("keyword", "symbol") and token.text in words

    def takes(self, *words: str) -> bool:
        if self.sees(*words):
            self.next += 1
            return True
        return False

    def expect(self, word: str) -> None:
        if not self.takes(word):
            self.fail(f"'{word}'")

    def identifier(self, what: str = "a name") -> str:
        if self.token.kind != "identifier":
            self.fail(what)
        return self.step().text

    def path(self, what: str = "a name") -> tuple[str, ...]:
        self.takes(".")  # a global name
        names = [self.identifier(what)]
        while self.sees(".") and self.tokens[self.next + 1].kind == "identifier":
            self.step()
            names.append(self.identifier())
        return tuple(names)

    def string(self) -> str:
        """A comment string, with ``+`` concatenation; empty if there is none."""
        words = []
        while self.token.kind == "string":
            words.append(self.step().text)
            if not (self.sees("+") and self.tokens[self.next + 1].kind == "string"):
                break
            self.step()
        return "".join(words)

    def comment(self) -> str:
        """A comment string and an annotation; the annotation is skipped."""
        words = self.string()
        if self.takes("annotation"):
            self.class_modification()
        return words

    def series(self, rule: Callable[[], Found], separator: str = ",") -> tuple[Found, ...]:
        found = [rule()]
        while self.takes(separator):
            found.append(rule())
        return tuple(found)

    # ------------------------------------------------------------ classes

    def text(self) -> TextNode:
        at = self.at
        within: tuple[str, ...] = ()
        if self.takes("within"):
            within = self.path() if self.token.kind == "identifier" else ()
            self.expect(";")
        classes = []
        while self.token.kind != "end of text":
            self.takes("final")
            classes.append(self.class_definition())
            self.expect(";")
        if not classes:
            self.fail("a class, such as model Drive ... end Drive;")
        return TextNode(at, within, tuple(classes))

    def begins_class(self) -> bool:
        k = self.next
        while self.tokens[k].kind == "keyword" and self.tokens[k].text in (*ELEMENT_PREFIXES, *CLASS_PREFIXES):
            k += 1
        return self.tokens[k].kind == "keyword" and self.tokens[k].text in KINDS

    def class_definition(self) -> ClassNode:
        at, prefixes = self.at, set[str]()
        while self.sees(*CLASS_PREFIXES):
            prefixes.add(self.step().text)
        if not self.sees(*KINDS):
            self.fail("a class, such as model Drive ... end Drive;")
        kind = self.step().text
        if kind == "operator":
            raise ModelicaError(f"{at}: operator classes are not supported")
        if self.takes("extends"):
            raise ModelicaError(f"{at}: '{kind} extends' is not supported; write a class of another name with 'extends'")
        name = self.identifier("the name of the class")
        if self.takes("="):
            return self.short_class(ClassNode(at, kind, name, frozenset(prefixes)))
        self.depth += 1
        if self.depth > DEEPEST_TEXT:
            raise ModelicaError(f"{at}: nested too deeply")
        made = self.composition(ClassNode(at, kind, name, frozenset(prefixes), comment=self.string()))
        self.depth -= 1
        self.expect("end")
        if self.token.text != name:
            self.fail(f"'{name}', the name of the {kind} that ends here")
        self.step()
        return made

    def short_class(self, made: ClassNode) -> ClassNode:
        if self.takes("enumeration"):
            self.expect("(")
            literals: list[str] = []
            if not self.takes(":"):
                while self.token.kind == "identifier":
                    literals.append(self.identifier())
                    self.comment()
                    if not self.takes(","):
                        break
            self.expect(")")
            return replace(made, literals=tuple(literals), comment=self.comment())
        if made.kind == "function" and self.sees("der"):
            raise ModelicaError(f"{self.at}: functions that are partial derivatives are not supported")
        prefixes = set(made.prefixes)
        while self.sees(*TYPE_PREFIXES):
            prefixes.add(self.step().text)
        at, path = self.at, self.path("the name of a class")
        if self.sees("["):
            raise ModelicaError(f"{self.at}: a class of arrays is not supported; give dimensions where components are declared")
        base = ExtendsNode(at, path, self.class_modification() if self.sees("(") else ())
        return replace(made, prefixes=frozenset(prefixes), short_for=base, comment=self.comment())

    def composition(self, made: ClassNode) -> ClassNode:
        elements: list[ComponentNode | ExtendsNode | ImportNode] = []
        classes: dict[str, ClassNode] = {}
        equations: list[SyntaxNode] = []
        starting: list[SyntaxNode] = []
        while not self.sees("end"):
            at = self.at
            if self.takes("public", "protected"):
                continue
            if self.takes("annotation"):
                self.class_modification()
                self.expect(";")
            elif self.takes("external"):
                raise ModelicaError(f"{at}: external functions are not supported")
            elif self.sees("initial", "equation", "algorithm"):
                initial = self.takes("initial")
                if self.sees("algorithm"):
                    raise ModelicaError(f"{at}: algorithms are not supported; write equations")
                self.expect("equation")
                (starting if initial else equations).extend(self.equations())
            else:
                self.element(elements, classes)
        return replace(
            made, elements=tuple(elements), classes=classes, equations=tuple(equations), initial_equations=tuple(starting)
        )

    def element(self, elements: list[ComponentNode | ExtendsNode | ImportNode], classes: dict[str, ClassNode]) -> None:
        at = self.at
        if self.takes("import"):
            elements.extend(self.imports(at))
            self.comment()
        elif self.takes("extends"):
            path = self.path("the name of a class")
            elements.append(ExtendsNode(at, path, self.class_modification() if self.sees("(") else ()))
            if self.takes("annotation"):
                self.class_modification()
        elif self.begins_class():
            prefixes = set[str]()
            while self.sees(*ELEMENT_PREFIXES):
                prefixes.add(self.step().text)
            made = self.class_definition()
            if made.name in classes:
                raise ModelicaError(f"{at}: the class {made.name} is declared twice")
            classes[made.name] = self.constrained_class(replace(made, prefixes=made.prefixes | prefixes))
        else:
            elements.extend(self.components())
        self.expect(";")

    def constraint(self) -> tuple[Modification, ...] | None:
        """The modifications of ``constrainedby C(...)``, which hold for a declaration and for its redeclarations."""
        if not self.takes("constrainedby"):
            return None
        self.path("the name of a class")
        found = self.class_modification() if self.sees("(") else ()
        self.comment()
        return found

    def constrained_class(self, made: ClassNode) -> ClassNode:
        at, constraint = self.at, self.constraint()
        if not constraint:
            return replace(made, constraint=constraint)
        if made.short_for is None:
            raise ModelicaError(f"{at}: a constraint with modifications is supported for short classes and components only")
        own = replace(made.short_for, modifications=(*constraint, *made.short_for.modifications))
        return replace(made, short_for=own, constraint=constraint)

    def constrained(self, made: tuple[ComponentNode, ...]) -> tuple[ComponentNode, ...]:
        constraint = self.constraint()
        return tuple(replace(m, modifications=(*(constraint or ()), *m.modifications), constraint=constraint) for m in made)

    def imports(self, at: TextPlace) -> list[ImportNode]:
        names = [self.identifier("the name of a package")]
        if self.takes("="):
            return [ImportNode(at, self.path(), names[0])]
        while self.takes("."):
            if self.takes("{"):
                found = self.series(self.identifier)
                self.expect("}")
                return [ImportNode(at, (*names, name), name) for name in found]
            if self.takes("*"):
                return [ImportNode(at, tuple(names), "*")]
            names.append(self.identifier())
        if self.takes(".*"):
            return [ImportNode(at, tuple(names), "*")]
        return [ImportNode(at, tuple(names), names[-1])]

    def components(self) -> tuple[ComponentNode, ...]:
        prefixes = set[str]()
        while self.sees(*ELEMENT_PREFIXES, *TYPE_PREFIXES):
            prefixes.add(self.step().text)
        path = self.path("a declaration, an equation section or 'end'")
        dimensions = self.subscripts() if self.sees("[") else ()
        return self.constrained(self.series(lambda: self.component(path, frozenset(prefixes), dimensions)))

    def component(self, path: tuple[str, ...], prefixes: frozenset[str], dimensions: tuple[SyntaxNode, ...]) -> ComponentNode:
        at, name = self.at, self.identifier("the name of a component")
        if self.sees("["):
            dimensions = (*self.subscripts(), *dimensions)
        modifications = self.class_modification() if self.sees("(") else ()
        value = self.expression() if self.takes("=", ":=") else None
        condition = self.expression() if self.takes("if") else None
        return ComponentNode(at, name, path, prefixes, dimensions, modifications, value, condition, self.comment())

    def class_modification(self) -> tuple[Modification, ...]:
        self.expect("(")
        found = () if self.sees(")") else self.series(self.argument)
        self.expect(")")
        return found

    def argument(self) -> Modification:
        at, prefixes = self.at, set[str]()
        while self.sees("each", "final", "redeclare", "replaceable"):
            prefixes.add(self.step().text)
        each, final = "each" in prefixes, "final" in prefixes
        if "redeclare" in prefixes or "replaceable" in prefixes:
            if self.begins_class():
                new_class = self.constrained_class(self.class_definition())
                return Modification(at, (new_class.name,), each=each, final=final, redeclared=new_class)
            while self.sees(*TYPE_PREFIXES):
                prefixes.add(self.step().text)
            (component,) = self.constrained((self.component(self.path("the name of a class"), frozenset(prefixes), ()),))
            return Modification(at, (component.name,), each=each, final=final, redeclared=component)
        names = self.path("a modification, such as J = 2")
        if self.sees("["):
            raise ModelicaError(
                f"{self.at}: a modification of single elements is not supported; give an array, as in J = {{1, 2}}"
            )
        inner = self.class_modification() if self.sees("(") else ()
        value = self.expression() if self.takes("=", ":=") else None
        self.string()
        return Modification(at, names, value, inner, each, final)

    # ------------------------------------------------------------ equations

    def equations(self) -> list[SyntaxNode]:
        found: list[SyntaxNode] = []
        while not self.sees(*ENDS_OF_EQUATIONS):
            found.append(self.equation())
            self.comment()
            self.expect(";")
        return found

    def equation(self) -> SyntaxNode:
        at = self.at
        if self.takes("connect"):
            self.expect("(")
            left = self.reference()
            self.expect(",")
            right = self.reference()
            self.expect(")")
            return ConnectNode(at, left, right)
        if self.takes("for"):
            return self.loop(at)
        if self.takes("if"):
            return self.conditional(at, "if", "elseif")
        if self.takes("when"):
            return self.conditional(at, "when", "elsewhen")
        left_side = self.simple_expression()
        if self.takes("="):
            return EqualityNode(at, left_side, self.expression())
        if isinstance(left_side, CallNode):
            return CallStatement(at, left_side)
        self.fail("'='")

    def loop(self, at: TextPlace) -> LoopNode:
        indices = self.series(self.loop_index)
        self.expect("loop")
        body = tuple(self.equations())
        self.expect("end")
        self.expect("for")
        for index, values in reversed(indices):
            body = (LoopNode(at, index, values, body),)
        first = body[0]
        assert isinstance(first, LoopNode)
        return first

    def loop_index(self) -> tuple[str, SyntaxNode]:
        index = self.identifier("the index of a loop")
        if not self.takes("in"):
            self.fail("'in' and a range, as in 'for i in 1:n loop'")
        return index, self.expression()

    def conditional(self, at: TextPlace, word: str, further: str) -> ConditionalNode:
        branches: list[tuple[SyntaxNode | None, tuple[SyntaxNode, ...]]] = []
        while not branches or self.takes(further):
            condition = self.expression()
            self.expect("then")
            branches.append((condition, tuple(self.equations())))
        if word == "if" and self.takes("else"):
            branches.append((None, tuple(self.equations())))
        self.expect("end")
        self.expect(word)
        return ConditionalNode(at, tuple(branches), word == "when")

    # ------------------------------------------------------------ expressions

    def expression(self) -> SyntaxNode:
        at = self.at
        self.depth += 1
        if self.depth > DEEPEST_TEXT:
            raise ModelicaError(f"{at}: nested too deeply; give parts of it to variables with equations of their own")
        if self.takes("if"):
            branches: list[tuple[SyntaxNode, SyntaxNode]] = []
            while not branches or self.takes("elseif"):
                condition = self.expression()
                self.expect("then")
                branches.append((condition, self.expression()))
            self.expect("else")
            found: SyntaxNode = ChoiceNode(at, tuple(branches), self.expression())
        else:
            found = self.simple_expression()
        self.depth -= 1
        return found

    def simple_expression(self) -> SyntaxNode:
        at, first = self.at, self.logical_expression()
        if not self.takes(":"):
            return first
        second = self.logical_expression()
        if self.takes(":"):
            return RangeNode(at, first, second, self.logical_expression())
        return RangeNode(at, first, None, second)

    def logical_expression(self) -> SyntaxNode:
        return self.left_to_right(lambda: self.left_to_right(self.logical_factor, "and"), "or")

    def left_to_right(self, operand: Callable[[], SyntaxNode], *operators: str) -> SyntaxNode:
        at, found = self.at, operand()
        while self.sees(*operators):
            found = OperationNode(at, self.step().text, (found, operand()))
        return found

    def logical_factor(self) -> SyntaxNode:
        at = self.at
        if self.takes("not"):
            return OperationNode(at, "not", (self.relation(),))
        return self.relation()

    def relation(self) -> SyntaxNode:
        at, left = self.at, self.arithmetic_expression()
        if self.sees(*RELATIONS):
            return OperationNode(at, self.step().text, (left, self.arithmetic_expression()))
        return left

    def arithmetic_expression(self) -> SyntaxNode:
        at = self.at
        signed = self.sees("+", "-", ".+", ".-")
        found: SyntaxNode = OperationNode(at, self.step().text, (self.term(),)) if signed else self.term()
        while self.sees("+", "-", ".+", ".-"):
            found = OperationNode(at, self.step().text, (found, self.term()))
        return found

    def term(self) -> SyntaxNode:
        return self.left_to_right(self.factor, "*", "/", ".*", "./")

    def factor(self) -> SyntaxNode:
        at, base = self.at, self.primary()
        if self.sees("^", ".^"):
            return OperationNode(at, self.step().text, (base, self.primary()))
        return base

    def primary(self) -> SyntaxNode:
        at, token = self.at, self.token
        if token.kind == "number":
            self.step()
            whole = token.text.isdigit()
            return NumberNode(at, int(token.text) if whole and len(token.text) < 300 else float(token.text))
        if token.kind == "string":
            return StringNode(at, self.step().text)
        if self.sees("true", "false"):
            return TruthNode(at, self.step().text == "true")
        if self.takes("("):
            inner = self.expression()
            if self.sees(","):
                raise ModelicaError(f"{self.at}: functions with several outputs are not supported")
            self.expect(")")
            return inner
        if self.takes("{"):
            return self.array(at)
        if self.takes("["):
            rows = self.series(lambda: ArrayNode(self.at, self.series(self.expression)), ";")
            self.expect("]")
            return ArrayNode(at, rows)
        if self.sees("der", "initial"):
            word = self.step().text
            return self.call(at, word)
        if self.sees("end"):
            raise ModelicaError(f"{at}: 'end' as a subscript is not supported; write the last index")
        if token.kind == "identifier" or self.sees("."):
            found = self.reference()
            if self.sees("("):
                if any(found.subscripts):
                    self.fail("an operator")
                return self.call(at, ".".join(found.names))
            return found
        self.fail("an expression")

    def array(self, at: TextPlace) -> SyntaxNode:
        if self.takes("}"):
            return ArrayNode(at, ())
        first = self.expression()
        if self.takes("for"):
            index, values = self.loop_index()
            self.expect("}")
            return ComprehensionNode(at, first, index, values)
        items = (first, *self.series(self.expression)) if self.takes(",") else (first,)
        self.expect("}")
        return ArrayNode(at, items)

    def call(self, at: TextPlace, function: str) -> SyntaxNode:
        self.expect("(")
        arguments: list[SyntaxNode] = []
        named: list[tuple[str, SyntaxNode]] = []
        while not self.sees(")"):
            if self.token.kind == "identifier" and self.tokens[self.next + 1].text == "=":
                name = self.identifier()
                self.step()
                named.append((name, self.expression()))
            else:
                arguments.append(self.expression())
                if self.takes("for"):
                    index, values = self.loop_index()
                    arguments[-1] = ComprehensionNode(at, arguments[-1], index, values)
            if not self.takes(","):
                break
        self.expect(")")
        return CallNode(at, function, tuple(arguments), tuple(named))

    def reference(self) -> ReferenceNode:
        at = self.at
        self.takes(".")
        names, subscripts = [], []
        while True:
            names.append(self.identifier("a name"))
            subscripts.append(self.subscripts() if self.sees("[") else ())
            if not (self.sees(".") and self.tokens[self.next + 1].kind == "identifier"):
                return ReferenceNode(at, tuple(names), tuple(subscripts))
            self.step()

    def subscripts(self) -> tuple[SyntaxNode, ...]:
        self.expect("[")
        found = self.series(self.subscript)
        self.expect("]")
        return found

    def subscript(self) -> SyntaxNode:
        at = self.at
        if self.takes(":"):
            return RangeNode(at)
        return self.expression()
