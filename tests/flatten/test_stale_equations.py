"""What `equations` and `assemble` read may change between two compilations: the second one sees it."""

from __future__ import annotations

import copy
import pickle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.class_record import class_record
from gearlib.errors import DeclarationError, ModelError

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


class Bound(gl.Component):
    """A body with a load that is written with a constant of this module, at the end of a spring."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body, self.spring = gp.Torque(tau=GAIN), gp.Inertia(J=1.0), gp.SpringDamper(c=50.0, d=1.0)
        self.end, self.load = gp.Inertia(J=1.0), gp.Damper(d=1.0 if GAIN < 5 else 4.0)
        self.ground = gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.end.flange_a),
            gl.connect(self.end.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]  # fmt: skip


def test_a_system_whose_component_has_changed_does_not_mix_old_and_new_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Equations are derived once more where a coefficient is zero, and in other processes: as they were, or not at all."""
    system = gl.compile(Bound(), outputs=["end.w"])
    massless, data = {"end.J": 0.0}, pickle.dumps(system)
    right = system.simulate(1.0, samples=3)["end.w"]
    known = system.simulate(1.0, samples=3, parameters=massless)["end.w"]
    monkeypatch.setitem(globals(), "GAIN", 6.0)
    np.testing.assert_array_equal(system.simulate(1.0, samples=3)["end.w"], right)
    np.testing.assert_array_equal(system.simulate(1.0, samples=3, parameters=massless)["end.w"], known)
    with pytest.raises(
        ModelError, match=r"Bound has changed since it was compiled, and with body\.J = 0 the equations are derived anew"
    ):
        system.simulate(1.0, samples=3, parameters={"body.J": 0.0})
    for copied in (lambda: pickle.loads(data), lambda: copy.deepcopy(system)):
        with pytest.raises(
            ModelError, match="Bound has changed since it was compiled, and this process derives its equations anew"
        ):
            copied()
    new = gl.compile(Bound(), outputs=["end.w"])
    expected = new.simulate(1.0, samples=3)["end.w"]
    assert np.abs(expected - right).max() > 0.1
    np.testing.assert_array_equal(copy.deepcopy(new).simulate(1.0, samples=3)["end.w"], expected)
    monkeypatch.undo()
    np.testing.assert_array_equal(copy.deepcopy(system).simulate(1.0, samples=3)["end.w"], right)


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
