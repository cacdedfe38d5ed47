"""What `equations` and `assemble` read may change between two compilations: the second one sees it."""

from __future__ import annotations

import copy
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.class_record import class_record
from gearlib.errors import DeclarationError, ModelError
from gearlib.flatten.energies import audited
from gearlib.run.sampling.controllers import read_by_controllers

GAIN = 1.0


def end(component: gl.Component, name: str = "x") -> float:
    return float(gl.simulate(component, 1.0, samples=2)[name][-1])


class Global(gl.Component):
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), GAIN)]


class Attribute(gl.Component):
    x = gl.Variable("1")
    gain = 1.0

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.gain)]


class Inherited(Attribute):
    pass


class Held(gl.Component):
    x = gl.Variable("1")

    def __init__(self, held: Any, **bindings: Any) -> None:
        super().__init__(**bindings)
        self.held = held


class Holder(Held):
    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.held.gain)]


class Assembled(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.part = [Attribute() for _ in range(int(GAIN))]
        self.torque, self.body = gp.Torque(tau=GAIN), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.body.flange_a)]


class Outer(gl.Component):
    def __init__(self, **bindings: Any) -> None:
        super().__init__(**bindings)
        self.kept = Assembled()

    def assemble(self) -> list[gl.Connection]:
        self.extra = gp.Inertia(J=GAIN)
        return [gl.connect(self.kept.body.flange_b, self.extra.flange_a)]


def test_a_constant_of_the_module(monkeypatch: pytest.MonkeyPatch) -> None:
    assert end(Global()) == 1.0
    monkeypatch.setitem(globals(), "GAIN", 2.0)
    assert end(Global()) == 2.0


def test_an_attribute_of_the_class_and_of_its_base(monkeypatch: pytest.MonkeyPatch) -> None:
    both = Attribute(), Inherited()
    assert [end(c) for c in both] == [1.0, 1.0]
    monkeypatch.setattr(Attribute, "gain", 2.0)
    assert [end(c) for c in both] == [2.0, 2.0]
    assert end(Attribute()) == 2.0


def test_an_object_held_by_an_attribute() -> None:
    held = SimpleNamespace(gain=1.0)

    class Hashable:
        gain = 1.0

    for held in (SimpleNamespace(gain=1.0), Hashable()):
        one = Holder(held)
        assert end(one) == 1.0
        held.gain = 3.0
        assert end(one) == 3.0
        assert end(Holder(held)) == 3.0


def test_a_closure_and_a_method_that_was_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    gain = 1.0

    class Closure(gl.Component):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), gain)]

    assert end(Closure()) == 1.0
    gain = 2.0
    assert end(Closure()) == 2.0
    monkeypatch.setattr(Closure, "equations", lambda self: [gl.Eq(gl.der(self.x), 5.0)])
    assert end(Closure()) == 5.0


def test_numbers_of_different_type_that_are_equal() -> None:
    """1 and True and 1.0 are equal as keys."""
    kind = type("Kind", (Held,), {"equations": lambda s: [gl.Eq(gl.der(s.x), 7.0 if s.held is True else s.held)]})
    assert [end(kind(v)) for v in (1, True, 1.0)] == [1.0, 7.0, 1.0]


def test_the_parts_that_assemble_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    one, outer = Assembled(), Outer()
    assert end(one, "body.w") == 1.0
    assert end(outer, "kept.body.w") == 0.5
    assert outer.extra is outer.extra
    monkeypatch.setitem(globals(), "GAIN", 3.0)
    assert end(one, "body.w") == 3.0
    assert end(one, "part[2].x") == 1.0
    assert end(outer, "kept.body.w") == 3.0 / 4.0
    for copied in (pickle.loads(pickle.dumps(outer)), copy.deepcopy(outer)):
        assert end(copied, "kept.body.w") == 3.0 / 4.0


class Load(gl.Component):
    """A load that is written with a constant of this module."""

    flange = gp.Flange("shaft")
    w = gl.Variable("rad/s")
    d = gl.Parameter("N.m.s/rad", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, GAIN * self.d * self.w)]


class Driven(gl.Component):
    """A body that a torque drives, written with the same constant, at the end of a spring."""

    load = gl.Structural("damper")

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body, self.spring = gp.Torque(tau=GAIN), gp.Inertia(J=1.0), gp.SpringDamper(c=50.0, d=1.0)
        self.end, self.ground = gp.Inertia(J=1.0), gp.Fixed()
        links = [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.end.flange_a),
        ]
        if self.load == "damper":
            self.damper = gp.Damper(d=GAIN)
            return [
                *links,
                gl.connect(self.end.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.ground.flange),
            ]
        self.fan = Load()
        return [*links, gl.connect(self.end.flange_b, self.fan.flange)]


def speed(system: gl.System, **parameters: float) -> Any:
    given = {name.replace("_", "."): value for name, value in parameters.items()}
    return system.simulate(1.0, samples=3, parameters=given)["end.w"]


@pytest.mark.parametrize("load", ["damper", "fan"])
def test_a_system_does_not_mix_old_and_new_equations(load: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Equations are derived once more where a coefficient is zero, and in copies: as they were when it was compiled, or not at all."""
    system, twin = (gl.compile(Driven(load=load), outputs=["end.w"]) for _ in range(2))
    data = pickle.dumps(system)
    right, massless, known = speed(system), speed(twin, body_J=0.0), speed(system, end_J=0.0)
    monkeypatch.setitem(globals(), "GAIN", 6.0)
    np.testing.assert_array_equal(speed(system), right)
    np.testing.assert_array_equal(speed(system, end_J=0.0), known)
    if load == "damper":  # what was assembled stays
        np.testing.assert_array_equal(speed(system, body_J=0.0), massless)
    else:
        with pytest.raises(
            ModelError, match=r"Driven has changed since it was compiled, and with body\.J = 0 the equations are derived"
        ):
            speed(system, body_J=0.0)
    for copied in (lambda: pickle.loads(data), lambda: copy.deepcopy(system)):
        with pytest.raises(
            ModelError, match="Driven has changed since it was compiled, and this process derives its equations anew"
        ):
            copied()
    new = gl.compile(Driven(load=load), outputs=["end.w"])
    assert np.abs(speed(new) - right).max() > 0.1
    np.testing.assert_array_equal(speed(copy.deepcopy(new)), speed(new))
    monkeypatch.undo()
    np.testing.assert_array_equal(speed(copy.deepcopy(system)), right)


@pytest.fixture
def restless() -> Iterator[None]:
    """Threads that take turns as often as possible."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("restless")
def test_threads_share_components_and_systems() -> None:
    one = Driven()
    right = [speed(gl.compile(one)), speed(gl.compile(one), body_J=0.0), speed(gl.compile(one), end_J=0.0)]

    def compiled(k: int) -> Any:
        return speed(gl.compile(one), **[{}, {"body_J": 0.0}, {"end_J": 0.0}][k % 3])

    def shared(k: int) -> Any:
        return speed(system, **[{}, {"body_J": 0.0}, {"end_J": 0.0}][k % 3])

    system = gl.compile(one)
    with ThreadPoolExecutor(6) as pool:
        for run in (compiled, shared):
            np.testing.assert_array_equal(list(pool.map(run, range(9))), right * 3)


@pytest.mark.usefixtures("restless")
def test_what_threads_read_of_a_component_is_not_that_of_an_assembly_under_way() -> None:
    one = Driven()
    readings: list[Callable[[], object]] = [
        lambda: gl.compile(one).states,
        lambda: read_by_controllers(one),
        lambda: one.diagram().svg,
        lambda: one.scheme().svg,
        lambda: gl.to_modelica(one),
        lambda: gl.check_units(one),
        lambda: [each.path for each in audited(one)],
        lambda: gl.compile(gl.cut(one, "end")).states,
    ]
    right = [reading() for reading in readings]
    with ThreadPoolExecutor(6) as pool:
        for found in pool.map(lambda k: readings[k % len(readings)](), range(12 * len(readings))):
            assert found in right


def test_an_assembly_that_failed_is_not_taken_for_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fails(gl.Component):
        broken = True

        def assemble(self) -> list[gl.Connection]:
            self.torque, self.body = gp.Torque(tau=2.0), gp.Inertia(J=1.0)
            if self.broken:
                raise RuntimeError("halfway")
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    one = Fails()
    for _ in range(2):
        with pytest.raises(RuntimeError, match="halfway"):
            gl.compile(one)
    monkeypatch.setattr(Fails, "broken", False)
    assert end(one, "body.w") == 2.0


def test_a_change_that_compile_would_lose_is_refused() -> None:
    one = Outer()
    with pytest.raises(ModelError, match=r"extra\.note: Outer\.assemble\(\) made this part, and makes it again"):
        one.extra.note = 3
    one.kept.note = 3


def test_a_declaration_that_was_changed_is_refused() -> None:
    class Changed(gl.Component):
        x = gl.Variable("1")
        k = gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.k)]

    assert end(Changed()) == 1.0
    for value in (3.0, gl.Parameter("1", default=3.0)):
        Changed.k = value  # type: ignore[assignment]
        with pytest.raises(DeclarationError, match=r"Changed\.k is .* where .* was declared; declare it in the body"):
            gl.compile(Changed())
    with pytest.raises(DeclarationError, match=r"Sub\.x is 2\.0 where"):
        gl.compile(type("Sub", (Global,), {"x": 2.0})())


def test_the_analysis_is_shared_where_the_equations_are_the_same() -> None:
    assert class_record(Attribute()) is class_record(Attribute())
    assert class_record(Holder(SimpleNamespace(gain=np.float64(2)))) is class_record(Holder(SimpleNamespace(gain=2.0)))


def test_equations_are_written_once_in_a_compilation_for_many_instances() -> None:
    calls = []

    class Counted(gl.Component):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            calls.append(1)
            return [gl.Eq(gl.der(self.x), 1.0)]

    class Many(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.part = [Counted() for _ in range(50)]
            return []

    for k in range(1, 4):
        gl.compile(Many())
        assert len(calls) == k


def test_a_declaration_outside_of_a_class_body_is_refused_after_a_compilation_too() -> None:
    class Base(gl.Component):
        x = gl.Variable("1")
        gain = 1.0

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.gain)]

    class Derived(Base):
        y = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.y, self.x)]

    assert end(Base()) == end(Derived()) == 1.0
    Base.gain = 2.0  # no declaration, and noticed as well
    assert end(Base()) == end(Derived()) == 2.0
    Base.gain = gl.Parameter("1", default=3.0)  # type: ignore[assignment]
    for kind in (Derived, Base):
        with pytest.raises(DeclarationError, match=rf"{kind.__name__}\.gain was declared outside of a component class"):
            gl.compile(kind())
