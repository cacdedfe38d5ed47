"""Everything public, with every wrong kind of argument: what a call does with it, and whether that is right."""

from __future__ import annotations

import datetime
import inspect
import re
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import sympy

import gearlib as gl
import gearparts as gp

ANSWERED, REFUSED, CALL = "answered", "refused", "wrong call"
RAW, UNNAMED, NOT_FINITE, HANG = "RAW EXCEPTION", "ARGUMENT NOT NAMED", "NOT FINITE", "HANG"
SHORT = (RAW, UNNAMED, NOT_FINITE, HANG)
SECONDS = 10  # for one call
NAN = float("nan")
HUGE = 10**400  # a whole number that no float holds


# ---------------------------------------------------------------- objects that mean harm


class Hostile:
    """Fails whatever is asked of it."""

    def _fail(self, *_: Any) -> Any:
        raise RuntimeError("a hostile object")

    __repr__ = __str__ = __bool__ = __len__ = __iter__ = __getitem__ = __contains__ = __call__ = _fail
    __float__ = __int__ = __index__ = __complex__ = __array__ = __hash__ = __eq__ = __ne__ = _fail  # type: ignore[assignment]
    __lt__ = __le__ = __gt__ = __ge__ = __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __neg__ = _fail


class Unequal:
    """Equal to nothing, since comparing fails; unhashable, too."""

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("cannot be compared")

    __hash__ = None  # type: ignore[assignment]


class Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError("cannot be printed")


class NotAFloat:
    """Promises a float, and breaks the promise."""

    def __float__(self) -> float:
        raise RuntimeError("no float")


class Endless:
    """A sequence by its methods, without an end."""

    def __getitem__(self, key: Any) -> Any:
        raise RuntimeError("no item")

    def __len__(self) -> int:
        return 3


class BadMapping(Mapping[str, float]):
    def __getitem__(self, key: str) -> float:
        raise RuntimeError("no value")

    def __iter__(self) -> Iterator[str]:
        yield "load.w"
        raise RuntimeError("no more keys")

    def __len__(self) -> int:
        return 2


def raising(*_: Any, **__: Any) -> Any:
    raise RuntimeError("a function that fails")


def used_up() -> Iterator[float]:
    made = (x for x in (1.0, 2.0))
    list(made)
    return made


class Empty(gl.Component):
    """A component without anything."""


NUMBERS: dict[str, Callable[[], Any]] = {
    "nan": lambda: NAN,
    "inf": lambda: np.inf,
    "-inf": lambda: -np.inf,
    "-1": lambda: -1,
    "0": lambda: 0,
    "-2.5": lambda: -2.5,
    "1e308": lambda: 1e308,
    "5e-324": lambda: 5e-324,
    "10**400": lambda: HUGE,
    "-10**400": lambda: -HUGE,
    "10**5000": lambda: 10**5000,
    "1+1j": lambda: 1 + 1j,
    "float32 nan": lambda: np.float32(NAN),
    "complex128": lambda: np.complex128(1j),
    "Decimal": lambda: Decimal("1.5"),
    "Decimal NaN": lambda: Decimal("NaN"),
    "Decimal sNaN": lambda: Decimal("sNaN"),
    "Fraction": lambda: Fraction(1, 3),
    "huge Fraction": lambda: Fraction(HUGE, 3),
    "sympy 2": lambda: sympy.Integer(2),
    "sympy 1/3": lambda: sympy.Rational(1, 3),
    "sympy pi": lambda: sympy.pi,
    "sympy huge": lambda: sympy.Integer(HUGE),
    "sympy nan": lambda: sympy.nan,
    "sympy zoo": lambda: sympy.zoo,
    "sympy oo": lambda: sympy.oo,
    "sympy I": lambda: sympy.I,
    "sympy symbol": lambda: sympy.Symbol("x"),
    "sympy expression": lambda: sympy.Symbol("x") ** 2 + 1,
    "gl.time": lambda: gl.time,
    "sympy condition": lambda: sympy.Symbol("x") > 1,
    "sympy true": lambda: sympy.true,
    "sympy matrix": lambda: sympy.eye(2),
    "sympy tuple": lambda: sympy.Tuple(1, 2),
    "sympy function": lambda: sympy.Function("f")(sympy.Symbol("x")),
}
KINDS: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "True": lambda: True,
    "text": lambda: "nonsense",
    "no text": lambda: "",
    "bytes": lambda: b"load.w",
    "Ellipsis": lambda: ...,
    "NotImplemented": lambda: NotImplemented,
    "slice": lambda: slice(1),
    "date": lambda: datetime.date(2020, 1, 1),
    "NaT": lambda: np.datetime64("NaT"),
    "timedelta": lambda: np.timedelta64(1, "s"),
    "lone surrogate": lambda: "\ud800",
    "NUL": lambda: "load\0w",
    "long text": lambda: "x" * 10_000,
}
COLLECTIONS: dict[str, Callable[[], Any]] = {
    "[]": lambda: [],
    "()": lambda: (),
    "{}": dict,
    "set()": set,
    "[nan]": lambda: [NAN],
    "[1, nan]": lambda: [1.0, NAN],
    "[2, 1]": lambda: [2.0, 1.0],
    "[1, 1]": lambda: [1.0, 1.0],
    "[-1, 0]": lambda: [-1.0, 0.0],
    "[1, [2]]": lambda: [1.0, [2.0]],
    "[[1, 2], [3]]": lambda: [[1, 2], [3]],
    "['a']": lambda: ["a"],
    "[None]": lambda: [None],
    "[1j]": lambda: [1j],
    "[True]": lambda: [True],
    "[10**400]": lambda: [HUGE],
    "[1, 10**400]": lambda: [1, HUGE],
    "(None, None)": lambda: (None, None),
    "[b'a']": lambda: [b"a"],
    "[[]]": lambda: [[]],
    "{1, 2}": lambda: {1, 2},
    "range": lambda: range(3),
    "empty range": lambda: range(0),
    "used up": used_up,
    "generator": lambda: (x for x in (1.0, 2.0)),
    "iterator": lambda: iter([1.0]),
    "map": lambda: map(float, ["a"]),
    "array of 0": lambda: np.array([]),
    "array 0d": lambda: np.array(1.0),
    "array nan": lambda: np.array([0.1, NAN]),
    "array 2d": lambda: np.ones((2, 2)),
    "array 3d": lambda: np.ones((2, 2, 2)),
    "array (0, 3)": lambda: np.ones((0, 3)),
    "array text": lambda: np.array(["a", "b"]),
    "array object": lambda: np.array([None, {}], object),
    "array complex": lambda: np.array([1 + 1j, 2]),
    "array bool": lambda: np.array([True, False]),
    "array dates": lambda: np.array(["NaT"], "M8[s]"),
    "array record": lambda: np.zeros(2, [("a", float)]),
    "array longdouble": lambda: np.array([1e308], np.longdouble) * 1e100,
    "masked": lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    "memoryview": lambda: memoryview(b"abc"),
    "(1, 2, 3)": lambda: (1, 2, 3),
    "('a', 'b')": lambda: ("a", "b"),
    "[(1, 2)]": lambda: [(1, 2)],
    "[['load.w']]": lambda: [["load.w"]],
}
MAPPINGS: dict[str, Callable[[], Any]] = {
    "{unknown: 1}": lambda: {"nonsense": 1.0},
    "{1: 2}": lambda: {1: 2},
    "{None: None}": lambda: {None: None},
    "{('a',): 1}": lambda: {("a",): 1},
    "{'': 1}": lambda: {"": 1.0},
    "{b'': 1}": lambda: {b"load.w": 1.0},
    "{nan: 1}": lambda: {NAN: 1},
    "{a component: 1}": lambda: {Empty(): 1},
    "a mapping that fails": BadMapping,
    **{
        f"{{{name}: {label}}}": lambda n=name, v=value: {n: v()}  # type: ignore[misc]
        for name in ("torque.tau", "load.w", "load.J")
        for label, value in {
            "None": lambda: None,
            "text": lambda: "1",
            "nan": lambda: NAN,
            "inf": lambda: np.inf,
            "huge": lambda: HUGE,
            "1j": lambda: 1j,
            "True": lambda: True,
            "list": lambda: [1.0],
            "array": lambda: np.array([1.0]),
            "hostile": Hostile,
            "Decimal": lambda: Decimal(1),
            "Fraction": lambda: Fraction(1, 2),
            "sympy": lambda: sympy.Symbol("x"),
            "-1": lambda: -1.0,
            "function": lambda: raising,
            "no number": lambda: lambda *_: "a",
            "nan function": lambda: lambda *_: NAN,
            "class": lambda: float,
            "no float": NotAFloat,
            "dict": dict,
            "tuple": lambda: (1.0, 2.0),
            "0": lambda: 0,
        }.items()
    },
}
OBJECTS: dict[str, Callable[[], Any]] = {
    "hostile": Hostile,
    "[hostile]": lambda: [Hostile()],
    "(hostile, hostile)": lambda: (Hostile(), Hostile()),
    "unequal": Unequal,
    "[unequal]": lambda: [Unequal()],
    "unprintable": Unprintable,
    "no float": NotAFloat,
    "[no float]": lambda: [NotAFloat()],
    "no items": Endless,
    "object": object,
    "class": lambda: gp.Inertia,
    "Exception": lambda: ValueError("x"),
    "module": lambda: np,
    "component": lambda: gp.Inertia(J=1.0),
    "[component]": lambda: [gp.Inertia(J=1.0)],
    "component without anything": Empty,
    "connector": lambda: gp.Inertia(J=1.0).flange_a,
    "table": lambda: gl.Table([0.0, 1.0], [0.0, 1.0]),
    "declaration": lambda: gl.Variable("1"),
    "connection": lambda: gl.connect(gp.Inertia(J=1.0).flange_a, gp.Inertia(J=1.0).flange_a),
    "equation": lambda: gl.Eq(1, 2),
    "raises": lambda: raising,
    "returns None": lambda: lambda *_: None,
    "returns nan": lambda: lambda *_: NAN,
    "no arguments": lambda: lambda: 1.0,
    "returns text": lambda: lambda *_: "a",
    "returns 10**400": lambda: lambda *_: HUGE,
    "type": lambda: type,
    "property": lambda: property(),
}
WRONG = {**NUMBERS, **KINDS, **COLLECTIONS, **MAPPINGS, **OBJECTS}


# ---------------------------------------------------------------- calls


@dataclass(frozen=True)
class Call:
    """Something public and its right arguments, made anew for each call; names without a value are left to their defaults."""

    name: str
    function: Callable[..., Any]
    right: Callable[[], dict[str, Any]] = dict
    positional: Callable[[], list[Any]] = list  # of a function that takes any number
    taken: frozenset[str] = frozenset()  # other names that it takes: of **options

    def places(self) -> list[str | int]:
        """Where a wrong argument can stand."""
        found: list[str | int] = []
        for p in inspect.signature(self.function).parameters.values():
            if p.kind is p.VAR_POSITIONAL:
                found += range(len(self.positional()))
            elif p.kind is not p.VAR_KEYWORD:
                found.append(p.name)
        return [*found, *sorted(self.taken)]

    def with_wrong(self, wrong: Mapping[str | int, Any]) -> Any:
        positional, named = self.positional(), self.right()
        for place, value in wrong.items():
            if isinstance(place, int):
                positional[place] = value
            else:
                named[place] = value
        only = [p.name for p in inspect.signature(self.function).parameters.values() if p.kind is p.POSITIONAL_ONLY]
        return self.function(*[named.pop(name) for name in only], *positional, **named)


@dataclass(frozen=True)
class Outcome:
    """What became of one call."""

    call: str
    wrong: str
    kind: str
    detail: str = ""

    @property
    def short(self) -> bool:
        return self.kind in SHORT

    def __str__(self) -> str:
        return f"{self.call}({self.wrong}): {self.kind}: {self.detail}"


class _Hang(BaseException):
    pass


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """A time limit."""

    def stop(*_: Any) -> None:
        raise _Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


EXPECTED = re.compile(
    r"expected|must|valid|there (is|are) no|has no|no unbound|is no |did you mean|give|cannot|needs|not |joins|below|above|outside|"
    r"raised|returned|tolerance|only|too large|values for|no value for|no parameter|divided by|division by zero|depends on"
)


def outcome(call: Call, wrong: Mapping[str | int, Callable[[], Any]], labels: str, usual: bool) -> Outcome:
    """Make the call, and judge what comes back; with ``usual``, a right call gives finite numbers only."""
    try:
        with limited(SECONDS), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", gl.InputWarning)
            answer = call.with_wrong({place: make() for place, make in wrong.items()})
            if usual and not finite(answer):
                return Outcome(call.name, labels, NOT_FINITE, repr(answer)[:200])
            return Outcome(call.name, labels, ANSWERED)
    except _Hang:
        return Outcome(call.name, labels, HANG, f"{SECONDS} s")
    except gl.GearlibError as error:
        text = str(error)
        named = all(isinstance(p, int) or re.search(rf"\b{re.escape(p)}\b", text) for p in wrong) or call.name in text
        if text and (named or EXPECTED.search(text)):
            return Outcome(call.name, labels, REFUSED, f"{type(error).__name__}: {text}")
        return Outcome(call.name, labels, UNNAMED, f"{type(error).__name__}: {text}")
    except TypeError as error:
        if re.search(r"\(\) (missing|got an unexpected|takes) ", str(error)) and error.__traceback__ and depth(error) <= 3:
            return Outcome(call.name, labels, CALL, str(error))
        return Outcome(call.name, labels, RAW, said(error))
    except Exception as error:
        return Outcome(call.name, labels, RAW, said(error))


def frames(error: BaseException) -> list[Any]:
    import traceback

    return traceback.extract_tb(error.__traceback__)


def depth(error: BaseException) -> int:
    return len([f for f in frames(error) if "misuse" not in f.filename])


def said(error: BaseException) -> str:
    inner = [f for f in frames(error) if f.filename != __file__]
    ours = [f for f in inner if "/gearlib/" in f.filename or "/gearparts/" in f.filename] or inner or frames(error)
    try:
        text = str(error)
    except Exception:
        text = "?"
    return f"{type(error).__name__}: {text[:150]} ({ours[-1].filename.rsplit('/', 1)[-1]}:{ours[-1].lineno})"


def finite(value: Any, deep: int = 3) -> bool:
    """Whether all numbers in what came back are finite."""
    if isinstance(value, (float, complex, np.number)):
        return bool(np.isfinite(value))
    if isinstance(value, np.ndarray):
        return value.dtype.kind not in "fc" or bool(np.isfinite(value).all())
    if isinstance(value, sympy.Basic):
        return not value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo)
    if deep and isinstance(value, (list, tuple)):
        return all(finite(v, deep - 1) for v in value)
    if deep and isinstance(value, dict):
        return all(finite(v, deep - 1) for v in value.values())
    if isinstance(value, gl.Result):
        return finite(value.time) and finite(value.record().data)
    if isinstance(value, gl.Fit):  # the covariance of a parameter that the data leaves open is infinite, as documented
        return finite(value.numbers) and finite(value.residuals) and (finite(value.covariance) or not value.identifiable)
    if deep and is_dataclass(value) and not isinstance(value, type):
        return all(finite(getattr(value, f.name), deep - 1) for f in fields(value) if not f.name.startswith("_"))
    if type(value).__name__ == "StateSpace":
        return all(finite(m) for m in (value.A, value.B, value.C, value.D))
    return True


def misuses(call: Call, values: Mapping[str, Callable[[], Any]] = WRONG, first: int = 0, step: int = 1) -> Iterator[Outcome]:
    """One wrong argument at a time; every ``step``-th case only."""
    with limited(30 * SECONDS):
        usual = finite(call.with_wrong({}))
    cases = [(place, label) for place in call.places() for label in values]
    for place, label in cases[first::step]:
        where = place if isinstance(place, str) else f"argument {place}"
        yield outcome(call, {place: values[label]}, f"{where} = {label}", usual)


def counted(outcomes: list[Outcome]) -> Counter[str]:
    return Counter(o.kind for o in outcomes)
