"""The event iteration carried out with numpy and the one that is printed settle on the same discrete state."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
from gearlib.program.event_iteration import DiscretesPhase, RelationsPhase, UnknownsPhase
from gearlib.program.interpret import labelled
from gearlib.run.scene import settle_once
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train

Floats = NDArray[np.float64]
UPDATE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)


class Latch(gl.Component):
    """A speed that grows; a flag that remembers whether it was above 1; a relation that depends on the flag; one of time."""

    x = gl.Variable("1")
    y = gl.Variable("1")
    z = gl.Variable("1")
    above = gl.Discrete("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[Any]:
        level = gl.Piecewise((2.0, self.above > 0.5), (1.0, True))
        return [
            gl.Eq(gl.der(self.x), self.rate * gl.Piecewise((0.5, self.y > 1.5), (1.0, True))),
            gl.Eq(self.y, self.x * level),
            gl.Eq(self.z, gl.Piecewise((self.y, gl.time >= 1.0), (-self.y, True))),
            gl.When(self.x >= 1.0, gl.Eq(self.above, 1.0)),
        ]


def native_settled(scene: Any, numbers: Any, t: float, x: Floats, flags: Floats) -> tuple[int, Floats]:
    """What the printed iteration returns, and the discrete state that it ends with."""
    native, model = scene.native, scene.model
    data = scene.data(native, numbers, np.zeros(len(scene.program.inputs)), flags, np.zeros(model.n_variables))
    fired = np.zeros(max(len(scene.root_names), 1), np.int32)
    states = x.copy()
    result = UPDATE(native.update.address)(t, *(a.ctypes.data for a in (states, fired, data, native.index)))
    return result, data[native.shared.relations :][: native.shared.n_discrete]


def agree(system: gl.System, seed: int) -> None:
    """From the discrete state that one settles on, the other changes nothing; also where relations begin anyhow."""
    scene, rng = system.translation.scene, np.random.default_rng(seed)
    numbers, n = scene.numbers(system.translation.parameter_values({})), scene.model.n_relations
    assert scene.relations is not None
    for _ in range(6):
        t, x = rng.uniform(0.1, 2.0), scene.nominal * rng.uniform(-2.0, 2.0, len(scene.states))
        at = np.array([t]), x[:, None], np.zeros((len(scene.program.inputs), 1))
        settled = scene.discrete(numbers, *at)
        if (settle_once(scene.relations, numbers.relations, *at, settled) != settled).any():
            continue  # nothing fits there
        result, found = native_settled(scene, numbers, t, x, settled[:, 0])
        assert result == 0
        np.testing.assert_array_equal(found, settled[:, 0])
        start = settled[:, 0].copy()
        start[:n] = rng.random(n) < 0.5
        result, found = native_settled(scene, numbers, t, x, start)
        if result >= 0:
            np.testing.assert_array_equal(settle_once(scene.relations, numbers.relations, *at, found[:, None])[:, 0], found)


@pytest.mark.parametrize("seed", [4, 23, 79])
def test_random_trains_that_switch(seed: int) -> None:
    agree(gl.compile(Model(train=hybrid_train(seed))), seed)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(60))
def test_many_random_trains_that_switch(seed: int) -> None:
    agree(gl.compile(Model(train=hybrid_train(seed))), seed)


def test_phases_are_in_order() -> None:
    """What the iteration consists of, from the model: unknowns, flags, unknowns with the flags, relations; those of time apart."""
    system = gl.compile(Latch(), outputs=["x", "z", "above"])
    relations = system.translation.scene.relations
    assert relations is not None
    phases = relations.event_iteration.passed
    kinds = [type(phase) for phase in phases]
    discretes = kinds.count(DiscretesPhase)
    first = kinds.index(RelationsPhase)
    assert kinds[:first][-discretes - 1 :] == [*[DiscretesPhase] * discretes, UnknownsPhase]
    assert set(kinds[first:]) == {RelationsPhase}
    tested = [(number, phase.on_time) for phase in phases[first:] for number in phase.batch.targets.tolist()]
    assert sorted(number for number, _ in tested) == relations.used.tolist()
    assert {number for number, on_time in tested if on_time} == set(relations.used[relations.on_time].tolist())
    agree(system, 1)


@pytest.mark.parametrize("text", [">", ">=", "<", "<="])
def test_a_comparison_holds_on_its_side_of_zero(text: str) -> None:
    """Of a relation with zero, as it is written: below, at and above it."""
    compare = {">": np.greater, ">=": np.greater_equal, "<": np.less, "<=": np.less_equal}[text]

    class One(gl.Component):
        x = gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.rate * gl.Piecewise((1.0, eval(f"x {text} 0", {"x": self.x})), (2.0, True)))]

    relations = gl.compile(One()).translation.scene.relations
    assert relations is not None
    (phase,) = relations.event_iteration.event_functions
    assert phase.comparison == text
    around = np.array([-1e-9, 0.0, 1e-9])
    assert phase.hold(around).tolist() == compare(around, 0.0).astype(float).tolist()


@pytest.mark.parametrize("copied", [False, True])
def test_unknowns_are_evaluated_before_discrete_variables_that_read_them(copied: bool) -> None:
    """And after them in any case; what they are set to is a number, or an unknown."""

    class Sampled(gl.Component):
        x, n = gl.Variable("1"), gl.Discrete("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.rate * (1.0 + self.n)),
                gl.When(gl.time >= 1.0, gl.Eq(self.n, self.x if copied else self.rate)),
            ]

    relations = gl.compile(Sampled()).translation.scene.relations
    assert relations is not None
    kinds = [type(phase) for phase in relations.event_iteration.passed]
    discretes = [DiscretesPhase] * len(relations.discretes)
    assert kinds == [*[UnknownsPhase] * copied, *discretes, UnknownsPhase, RelationsPhase]
    assert relations.event_iteration.reinits == ()
    assert relations.event_iteration.event_functions == ()


@pytest.mark.parametrize(("read", "equations"), [("x", []), ("y", ["z", "y"]), ("a", None)])
def test_only_what_discrete_variables_read_is_evaluated_before_them(read: str, equations: list[str] | None) -> None:
    """A state as it is, ``y`` with what it is computed from; of equations that are solved together, all are."""

    class Sampled(gl.Component):
        x, y, z, a, b = (gl.Variable("1") for _ in range(5))
        n, shifted, copied = (gl.Discrete("1") for _ in range(3))
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(gl.der(self.x), self.rate * (1.0 + self.n + 0.1 * self.a)),
                gl.Eq(self.z, 2.0 * self.x + self.shifted),
                gl.Eq(self.y, self.z**2),
                gl.Eq(self.a, 0.5 * gl.sin(self.b)),
                gl.Eq(self.b, 0.5 * gl.cos(self.a) + self.shifted),
                gl.Eq(self.shifted, gl.time > 0.5),
                gl.Eq(self.copied, self.x),
                gl.When(gl.time >= 1.0, gl.Eq(self.n, getattr(self, read))),
            ]

    system = gl.compile(Sampled(), outputs=["x", "y", "a", "b", "copied"])
    relations = system.translation.scene.relations
    assert relations is not None
    first = relations.event_iteration.passed[0]
    assert isinstance(first, UnknownsPhase)
    slots = {slot: system.translation.scene.model.name(v) for (v, k), slot in relations.program.slots.items() if k == 0}
    found = None if first.batches is None else [slots[target] for batch in first.batches for target in batch.targets.tolist()]
    assert found == equations
    run = {method: system.simulate(2.0, samples=21, rtol=1e-9, method=method) for method in ("ida", "rk")}
    together = 0.0
    for _ in range(60):
        together = 0.5 * np.sin(0.5 * np.cos(together) + 1.0)
    for result in run.values():
        x, n = result["x"][10], result["n"]
        assert n[10] == pytest.approx({"x": x, "y": (2.0 * x + 1.0) ** 2, "a": together}[read], rel=1e-8)
        assert (n[:10] == 0.0).all()
        assert (n[10:] == n[10]).all()
    agree(system, 1)


def test_equations_of_discrete_variables_are_named_by_their_components() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = Latch(), Latch()
            return []

    system = gl.compile(Two())
    relations = system.translation.scene.relations
    assert relations is not None
    names = [[labelled(system.translation.structure, b, i) for i in range(len(b))] for b in relations.discretes]
    assert {text.split(":")[0] for texts in names for text in texts} == {"one", "other"}
    assert all(len(set(texts)) == len(texts) for texts in names)


class Stages(gl.Component):
    """At 1 s a stage passes from 0 through 1 to 2; two latches are set where x stands above a limit, which the stage 1 lowers."""

    x = gl.Variable("1", start=0.0)
    limit = gl.Parameter("1", default=4.0)
    stage, hasty, patient = gl.Discrete("1"), gl.Discrete("1"), gl.Discrete("1")
    lowered = gl.Discrete("1")

    def equations(self) -> list[Any]:
        excess = self.x - self.limit * (1 - self.lowered)
        return [
            gl.Eq(gl.der(self.x), 1.0),
            gl.Eq(self.stage, gl.Piecewise((gl.Min(2, gl.pre(self.stage) + 1), self.x > 1.0), (0, True))),
            gl.Eq(self.lowered, gl.equals(self.stage, 1)),
            gl.Eq(self.hasty, gl.Or(gl.holds(gl.pre(self.hasty)), excess > 0)),
            gl.Eq(self.patient, gl.Or(gl.holds(gl.pre(self.patient)), gl.settled(excess) > 0)),
        ]


@pytest.mark.parametrize("method", ["ida", "rk", "taylor"])
def test_what_is_decided_last_sees_no_passing_stage(method: str) -> None:
    """It is set at its own event, when x reaches its limit, whatever other events passed through; not at the start, either."""
    run = gl.compile(Stages()).simulate(6.0, samples=13, method=method)
    assert run["hasty"].tolist() == (run.time > 1.0 - 1e-9).tolist()
    assert run["patient"].tolist() == (run.time > 4.0 - 1e-9).tolist()
    assert run["stage"].tolist() == (2.0 * (run.time > 1.0 - 1e-9)).tolist()
    begun = gl.compile(Stages()).simulate(1.0, samples=2, method=method, start={"x": 2.0})
    assert (begun["stage"][0], begun["hasty"][0], begun["patient"][0]) == (2.0, 1.0, 0.0)


class Bent(gl.Component):
    """x rises twice as fast above 1, by a comparison that is decided last."""

    x = gl.Variable("1", start=0.0)
    unsettled = gl.Discrete("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((2.0, gl.settled(self.x) > 1.0), (1.0, True))),
            gl.Eq(self.unsettled, self.x > 2.0),
        ]


@pytest.mark.parametrize("method", ["ida", "rk", "taylor"])
def test_what_is_decided_last_may_change_equations_without_any_discrete_variable(method: str) -> None:
    run = gl.compile(Bent()).simulate(3.0, samples=13, method=method)
    assert run["x"] == pytest.approx(np.maximum(run.time, 2.0 * run.time - 1.0), rel=1e-9)
    assert run["unsettled"].tolist() == (run.time > 1.5 - 1e-12).tolist()
