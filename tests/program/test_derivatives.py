"""Derivatives of programs are exact: against differences of the same equations with 40 digits, on random trains and the paper's."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError
from gearlib.native.scene_functions import compile_scene
from gearlib.program.derivative_plan import TIME, derivative_plan, discrete_entry, state_plan
from gearlib.program.derivatives import At, dense, derivatives, entries, pulled_back
from gearlib.program.interpret import evaluate
from gearlib.program.program import Linear, Newton
from gearlib.program.scalars import linear_function
from gearlib.run.scene import guess_of
from tests.program.exact_program import ExactProgram, difference_quotients
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.trains import RandomTrain, random_parameters

Floats = NDArray[np.float64]


class Bound(gl.Component):
    """A train whose parts' parameters follow from those of the whole, over two levels, and whose loop of gears is a linear block."""

    size = gl.Parameter("m", default=0.2)
    density = gl.Parameter("kg/m3", default=7800.0)
    width = gl.Parameter("m", default=0.05)
    stiffness = gl.Parameter("N.m/rad", default=1e3)

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=self.stiffness * gl.sin(4 * gl.time) * 0.01)
        self.a = gp.Inertia(J=self.density * self.width * self.size**4)
        self.b = gp.Inertia(J=2 * self.a.J + 5.0 * self.density * self.size**5)
        relative = self.width / self.size
        self.gear, self.set = gp.IdealGear(ratio=1 + relative), gp.IdealPlanetary(ratio=2 + gl.exp(relative))
        self.arm, self.rim = gp.Inertia(J=0.3), gp.Inertia(J=self.a.J * gl.sqrt(relative))
        self.spring, self.ground = gp.SpringDamper(c=self.stiffness * relative, d=0.4), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.set.sun, self.b.flange_a), gl.connect(self.set.carrier, self.arm.flange_a),
            gl.connect(self.set.ring, self.rim.flange_a), gl.connect(self.rim.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.ground.flange),
        ]  # fmt: skip


class Loop(gl.Component):
    """A nonlinear algebraic loop: a rod on two cranks."""

    length = gl.Parameter("1", default=0.3)
    drive = gl.Input("rad/s")
    a = gl.Variable("rad", "driving crank", start=0.4)
    b = gl.Variable("rad", "driven crank", guess=0.3)
    w = gl.Variable("rad/s", "speed of the driven crank")
    rate = gl.Parameter("rad/s", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.a), self.drive + self.w * self.length),
            gl.Eq(gl.sin(self.b - self.a), self.length * gl.sin(self.b)),
            gl.Eq(self.w, self.rate * self.b**2 * gl.cos(self.b)),
        ]


def check(system: gl.System, values: dict[str, float], seed: int, most: int = 12, everything: bool = True) -> Any:
    """Compare all derivatives at a random point; returns the program."""
    rng = np.random.default_rng(seed)
    scene, table = system.translation.scene, system.translation.model.parameters
    parameters = system.translation.parameter_values(values)
    given = {table.index[name]: value for name, value in values.items() if name in table.index}
    prepared = scene.numbers(parameters)
    program = prepared.program
    n, m, t = len(program.states), len(program.inputs), float(rng.uniform(0.1, 2.0))
    x = scene.nominal * rng.uniform(-1.0, 1.0, n)
    u = rng.normal(size=m)
    flags = (
        (rng.random(scene.n_discrete) < 0.5).astype(float) if not any(isinstance(s, Newton) for s in program.steps) else None
    )
    if flags is None:
        flags = scene.discrete(scene.numbers(parameters), np.array([t]), x[:, None], u[:, None])[:, 0]
    guess = guess_of(program, np.zeros(system.translation.model.n_variables))
    slots = evaluate(prepared, np.array([t]), x[:, None], u[:, None], flags[:, None], guess)[:, 0]
    used = {int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()}
    upstream = {p for p in range(len(table.names)) if any(k in used for k, *_ in table.derivatives(parameters, [p], given))}
    chosen = rng.permutation(sorted(upstream))[:most].tolist()
    seeds = [*range(n + m), *(program.n_slots + p for p in chosen)]
    table_rows = [(k, i, w) for i, p in enumerate(chosen) for k, _, w in table.derivatives(parameters, [p], given)]
    entering = [*((k, k) for k in range(n + m)), *((program.n_slots + p, n + m + k) for p, k, _ in table_rows)]
    weights = np.array([*[1.0] * (n + m), *(w for *_, w in table_rows)])
    plan = derivative_plan(program, entering, None if everything else program.output_slots, len(seeds))
    at = At(prepared, np.array([t]), slots[:, None], flags[:, None])
    found = dense(plan, entries(plan, at, weights))[0]
    right, size = difference_quotients(
        ExactProgram(program, t, flags, slots), np.concatenate([x, u]), table,
        {k: float(parameters[k]) for k in given}, seeds,
    )  # fmt: skip
    right = right[plan.wanted]
    scale = np.array([*scene.nominal, *[1.0] * m, *(max(abs(parameters[p]), 1.0) for p in chosen)])
    # an entry is a sum of products: what cancels in it leaves rounding of the largest entries of its row and column
    noise = 1e-11 * np.maximum(np.abs(right) * 10, (np.abs(right) * scale).max(axis=1, keepdims=True) / scale)
    noise += (1e-13 * size[plan.wanted, None] + 1e-15 * np.abs(right * scale).max()) / scale
    np.testing.assert_array_less(np.abs(found - right), noise)
    assert np.abs(right[:, n + m :]).any() or not chosen
    return program


def _batches(step: Any) -> Sequence[Any]:
    return (
        step.matrix if isinstance(step, Linear) else [*step.residuals, *step.jacobian] if isinstance(step, Newton) else [step]
    )


@pytest.mark.parametrize("seed", [3, 11, 17])
def test_random_linear_trains(seed: int) -> None:
    check(gl.compile(RandomTrain(seed=seed)), random_parameters(seed, 1), 1, 3, everything=False)


@pytest.mark.parametrize("seed", [4, 23, 79])
def test_random_trains_that_switch(seed: int) -> None:
    """Backlash, friction, clutches: blocks that are solved by iteration."""
    check(gl.compile(Model(train=hybrid_train(seed))), {}, seed, 3)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(100))
def test_many_random_trains(seed: int) -> None:
    check(gl.compile(RandomTrain(seed=seed)), random_parameters(seed, seed), seed, 5)
    check(gl.compile(Model(train=hybrid_train(seed))), {}, seed, 5)


def test_the_papers_train() -> None:
    """Most of its parameters follow from others; every one of them is varied."""
    system = gl.compile(gp.ZhouCui2022())
    program = check(system, {"R_s": 0.031, "K_g": 9e8}, 3, 60, everything=False)
    assert sum(isinstance(s, Linear) for s in program.steps) == 2


@pytest.mark.parametrize("values", [{}, {"size": 0.31}, {"b.J": 0.02, "gear.ratio": 1.7}], ids=str)
def test_bound_parameters_and_a_constant_block(values: dict[str, float]) -> None:
    """What is given itself follows from nothing."""
    program = check(gl.compile(Bound()), values, 5, 30)
    assert any(isinstance(s, Linear) for s in program.steps)


def test_a_block_that_is_solved_by_iteration() -> None:
    system = gl.compile(Loop())
    program = check(system, {"length": 0.41}, 2)
    assert any(isinstance(s, Newton) and not s.linear for s in program.steps)


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (gp.DetailedExternalMesh, {"r_a": 0.1, "r_b": 0.2, "c": 1e7, "d": 200.0, "backlash": True, "b": 1e-5}),
        (gp.LossyGear, {"ratio": 2.0, "loss_table": [[0.0, 0.9, 0.8, 0.1, 0.2], [10.0, 0.85, 0.75, 0.2, 0.3]]}),
    ],
    ids=["DetailedExternalMesh", "LossyGear"],
)
def test_parts_with_blocks_that_switch(model: Any, values: dict[str, Any]) -> None:
    class Pair(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.one, self.other = gp.Torque(tau=2 * gl.sin(gl.time)), gp.Inertia(J=0.1), gp.Inertia(J=0.4)
            self.link = model(**values)
            return [
                gl.connect(self.torque.flange, self.one.flange_a), gl.connect(self.one.flange_b, self.link.flange_a),
                gl.connect(self.link.flange_b, self.other.flange_a),
            ]  # fmt: skip

    check(gl.compile(Pair()), {}, 1)


def test_unneeded_slots_change_nothing() -> None:
    check(gl.compile(Bound()), {}, 7, everything=False)


def test_many_times_are_as_many_points() -> None:
    for model in (Bound(), Loop(), RandomTrain(seed=6)):
        system = gl.compile(model)
        scene = system.translation.scene
        numbers = scene.numbers(system.translation.parameter_values({}))
        program, rng = scene.program, np.random.default_rng(3)
        n, m, times = len(program.states), len(program.inputs), 5
        t, x, u = rng.uniform(0, 1, times), rng.normal(size=(n, times)), rng.normal(size=(m, times))
        flags = scene.discrete(numbers, t, x, u)
        slots = evaluate(numbers, t, x, u, flags)
        plan = state_plan(program)
        found = dense(plan, entries(plan, At(numbers, t, slots, flags)))
        for i in range(times):
            one = derivatives(numbers, float(t[i]), slots[:, i], flags[:, i], range(n))[program.output_slots]
            np.testing.assert_allclose(found[i], one, rtol=1e-13, atol=1e-13 * np.abs(one).max())


def test_terms_that_are_added_with_weights() -> None:
    """A seed that enters at several slots; also at unknowns of a block, where it is added to the solution."""
    system = gl.compile(Bound())
    numbers = system.translation.scene.numbers(system.translation.parameter_values({}))
    program = numbers.program
    block = next(s for s in program.steps if isinstance(s, Linear))
    first, last = int(block.unknowns[0]), int(program.output_slots[-1])
    slots, flags = np.zeros(program.n_slots), np.zeros(0)
    single = [derivatives(numbers, 0.0, slots, flags, (), [(slot, 0, 1.0)])[:, 0] for slot in (first, last)]
    both = derivatives(numbers, 0.0, slots, flags, (), [(first, 0, 2.0), (last, 0, -3.0), (last, 1, 1.0)])
    np.testing.assert_allclose(both, np.column_stack([2 * single[0] - 3 * single[1], single[1]]), rtol=1e-14, atol=1e-14)
    assert single[0][first] == single[1][last] == 1.0


def native_values(scene: Any, numbers: Any, plan: Any, x: Floats, u: Floats, t: float, flags: Floats) -> Floats:
    """What the native code that is printed from a plan computes, shape (wanted, seeds)."""
    model = scene.model
    native = compile_scene(scene.program, scene.relations, lambda: scene.slot_names, model, plan)
    assert native.jac is not None and native.pattern is not None  # noqa: PT018
    data = scene.data(native, numbers, u, flags, np.zeros(model.n_variables))
    values = np.full(len(native.pattern.indices), np.nan)
    function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)(native.jac.address)
    assert function(t, *(a.ctypes.data for a in (x, values, data, native.index))) == 0
    found = np.zeros(plan.shape)
    found[native.pattern.indices, np.repeat(np.arange(plan.n_seeds), np.diff(native.pattern.indptr))] = values
    return found


@pytest.mark.parametrize("loops", [False, True], ids=["written out", "loops"])
@pytest.mark.parametrize("number", range(4))
def test_native_code_is_printed_from_the_same_plan(number: int, loops: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With respect to states, inputs and parameters, through constant blocks and such that are solved by iteration."""
    if loops:
        monkeypatch.setattr("gearlib.native.source.LONGEST", 0)
    model = [Bound(), Loop(), RandomTrain(seed=6), Model(train=hybrid_train(23))][number]
    system = gl.compile(model)
    scene = system.translation.scene
    numbers = scene.numbers(system.translation.parameter_values({}))
    program, rng = scene.program, np.random.default_rng(number)
    n, m, t = len(program.states), len(program.inputs), 0.3
    x, u = scene.nominal * rng.uniform(-1, 1, n), rng.normal(size=m)
    flags = scene.discrete(numbers, np.array([t]), x[:, None], u[:, None])
    slots = evaluate(numbers, np.array([t]), x[:, None], u[:, None], flags)
    used = sorted({int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()})
    seeds = [*range(n + m), *(program.n_slots + p for p in used)]
    plan = derivative_plan(program, [(slot, k) for k, slot in enumerate(seeds)], program.output_slots)
    expected = dense(plan, entries(plan, At(numbers, np.array([t]), slots, flags)))[0]
    found = native_values(scene, numbers, plan, x, u, t, flags[:, 0])
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * float(size.max()))
    assert expected[:, n + m :].any()


class Held(gl.Component):
    """Linear and cubic equations of a state, of time and of a value that only events change."""

    rate = gl.Parameter("1/s", default=2.0)
    x = gl.Variable("1")
    a = gl.Variable("1")
    b = gl.Variable("1")
    y = gl.Variable("1")
    h = gl.Discrete("1")

    def equations(self) -> list[Any]:
        t = self.rate * gl.time
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.a * self.h + gl.sin(t) + self.y)),
            gl.Eq(self.a + self.b, t * self.h),
            gl.Eq(self.a - 3 * self.b, self.x),
            gl.Eq(self.y**3 + self.y, self.h * self.x + t),
            gl.When(self.x >= 1.0, gl.Eq(self.h, 2.0)),
        ]


def test_time_and_discrete_variables_as_seeds() -> None:
    """a = (3 t h + x) / 4 with t the rate times time, and der(y) (3 y^2 + 1) = der(h x + t)."""
    system = gl.compile(Held())
    scene, now, x, h, p = system.translation.scene, 0.7, np.array([0.4]), 1.3, 2.0
    numbers, program, held = scene.numbers(system.translation.parameter_values({})), scene.program, scene.model.n_relations
    assert scene.model.discretes[0] == "h"
    flags = np.zeros(scene.n_discrete)
    flags[held] = h
    slots = evaluate(numbers, np.array([now]), x[:, None], np.zeros((0, 1)), flags[:, None])
    rate = int(next(k for b in program.steps if not isinstance(b, (Linear, Newton)) for k in b.parameters.ravel()))
    seeds = [(0, 0), (TIME, 1), (discrete_entry(held), 2), (program.n_slots + rate, 3)]
    plan = derivative_plan(program, seeds, program.output_slots)
    found = dense(plan, entries(plan, At(numbers, np.array([now]), slots, flags[:, None])))[0]
    y = float(min(np.roots([1.0, 0.0, 1.0, -(h * x[0] + p * now)]), key=lambda z: abs(z.imag)).real)
    t, a, slope = p * now, (3 * p * now * h + x[0]) / 4, 1 / (3 * y**2 + 1)
    expected = [
        p * (h / 4 + h * slope),
        p * (3 * p * h / 4 * h + p * np.cos(t) + p * slope),
        p * (a + 3 * t / 4 * h + x[0] * slope),
        a * h + np.sin(t) + y + p * now * (3 * h / 4 * h + np.cos(t) + slope),
    ]
    np.testing.assert_allclose(found[0], expected, rtol=1e-13)
    np.testing.assert_allclose(native_values(scene, numbers, plan, x, np.zeros(0), now, flags)[0], expected, rtol=1e-12)


@pytest.mark.parametrize("kind", ["state", "time", "discrete variable", "parameter", "slot"])
def test_each_seed_has_the_column_that_it_has_beside_others(kind: str) -> None:
    """Whatever else is differentiated by: seeds are numbered by where they enter, in any order; a number without a place is zero."""
    translation = gl.compile(Held()).translation
    scene, numbers = translation.scene, translation.scene.numbers(translation.parameter_values({}))
    program = scene.program
    t, x, flags = np.array([0.7, 1.1]), np.array([[0.4, -0.2]]), np.zeros((scene.n_discrete, 2))
    flags[scene.model.n_relations] = 1.3
    at = At(numbers, t, evaluate(numbers, t, x, np.zeros((0, 2)), flags), flags)
    used = sorted({int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()})
    places = {
        "state": 0, "time": TIME, "discrete variable": discrete_entry(scene.model.n_relations), "parameter": program.n_slots + used[0],
        "slot": int(program.output_slots[-1]),
    }  # fmt: skip

    def matrix(seeds: list[tuple[int, int]], n_seeds: int | None = None) -> Floats:
        plan = derivative_plan(program, seeds, program.output_slots, n_seeds)
        return dense(plan, entries(plan, at))

    whole = matrix([(place, k) for k, place in enumerate(places.values())])
    own = whole[:, :, [*places].index(kind)]
    assert own.any()
    assert matrix([(places[kind], 0)])[:, :, 0] == pytest.approx(own, rel=1e-14)
    assert matrix([(places[kind], 2)], 4) == pytest.approx(np.stack([0 * own, 0 * own, own, 0 * own], axis=2), rel=1e-14)
    for other, place in places.items():
        if other != kind:
            pair = matrix([(place, 1), (places[kind], 0)])
            assert pair[:, :, 0] == pytest.approx(own, rel=1e-14), other
            assert pair[:, :, 1] == pytest.approx(whole[:, :, [*places].index(other)], rel=1e-14), other
            together = matrix([(place, 0), (places[kind], 0)])[:, :, 0]
            assert together == pytest.approx(own + pair[:, :, 1], rel=1e-13), other


@pytest.mark.parametrize("number", range(4))
def test_reverse_mode_is_the_transpose(number: int) -> None:
    """Through sums, a constant block whose matrix depends on parameters, and blocks that are solved by iteration; at two times."""
    system = gl.compile([Bound(), Loop(), Held(), RandomTrain(seed=6)][number])
    scene, rng = system.translation.scene, np.random.default_rng(number)
    numbers, program = scene.numbers(system.translation.parameter_values({})), scene.program
    n, m = len(program.states), len(program.inputs)
    t, x, u = np.array([0.2, 0.9]), scene.nominal[:, None] * rng.uniform(-1, 1, (n, 2)), rng.normal(size=(m, 2))
    flags = scene.discrete(numbers, t, x, u)
    at = At(numbers, t, evaluate(numbers, t, x, u, flags), flags)
    used = sorted({int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()})
    places = [*range(n + m), *(program.n_slots + p for p in used), int(program.output_slots[-1])]
    one, each = (
        derivative_plan(program, [(slot, k * i) for k, slot in enumerate(places)], program.output_slots) for i in (0, 1)
    )
    matrices = dense(each, entries(each, at))
    weights = rng.normal(size=(len(program.output_slots), 2))
    expected = np.stack([matrices[i].T @ weights[:, i] for i in range(2)], axis=1)
    size = np.abs(matrices).max(axis=(0, 1))[:, None] + 1e-300
    np.testing.assert_allclose(pulled_back(one, at, weights) / size, expected / size, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("model", [Bound(), RandomTrain(seed=6)], ids=["block", "train"])
def test_derivatives_of_linear_programs_as_one_function_of_the_parameters(model: Any) -> None:
    system = gl.compile(model)
    numbers = system.translation.scene.numbers(system.translation.parameter_values({}))
    program = numbers.program
    places = [*range(len(program.states) + len(program.inputs)), int(program.output_slots[-1])]
    places += [
        int(s.unknowns[0]) for s in program.steps if isinstance(s, Linear)
    ]  # what enters in a block is added to its solution
    plan = derivative_plan(program, [(slot, k) for k, slot in enumerate(places)])
    written, none = linear_function(program, plan), np.zeros(1)
    assert written is not None
    expected = entries(plan, At(numbers, none, np.zeros((program.n_slots, 1)), none[:, None]))[:, 0]
    found = written(numbers.parameters.tolist(), numbers.listed)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14 * np.abs(expected).max())


def test_what_is_not_linear_is_not_written_as_one_function() -> None:
    """Equations solved by iteration, and derivatives by the parameters of a block's matrix."""
    for model, of_parameters in ((Loop(), False), (Bound(), True)):
        program = gl.compile(model).translation.scene.program
        used = {int(p) for s in program.steps if isinstance(s, Linear) for b in s.matrix for p in b.parameters.ravel()}
        entering = [(program.n_slots + p, k) for k, p in enumerate(sorted(used))] if of_parameters else [(0, 0)]
        assert linear_function(program, derivative_plan(program, entering)) is None


def test_a_seed_that_enters_twice_counts_twice() -> None:
    """At an unknown of a block; no single function is written of that."""
    numbers = gl.compile(Bound()).translation.scene.numbers(gl.compile(Bound()).translation.parameter_values({}))
    program = numbers.program
    (block,) = program.linear_blocks
    place = int(block.unknowns[0])
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((1, 1)))
    once, twice = (derivative_plan(program, [(place, 0)] * count) for count in (1, 2))
    assert dense(twice, entries(twice, at)) == pytest.approx(2 * dense(once, entries(once, at)))
    assert linear_function(program, once) is not None
    assert linear_function(program, twice) is None


def test_what_no_seed_reaches_has_no_entries() -> None:
    system = gl.compile(Bound())
    program = system.translation.scene.program
    for n_seeds, count in ((None, 0), (0, 0), (3, 3)):
        plan = derivative_plan(program, [], None, n_seeds)
        assert plan.steps == ()
        assert len(plan.sources) == 0
        assert (plan.n_seeds, plan.shape, plan.n_entries) == (count, (program.n_slots, count), 1)


def test_a_large_block_is_differentiated_by_its_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """Factorised as a sparse matrix, as blocks of hundreds of unknowns are."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", 1)
    check(gl.compile(Bound()), {}, 4, 30)


@pytest.mark.parametrize("model", [Bound(), Loop()], ids=["linear", "iterated"])
def test_large_matrices_are_sparse(model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same entries, for chosen slots, seeds and perturbations; dense up to a number of entries."""
    translation = gl.compile(model).translation
    scene = translation.scene
    numbers, program = scene.numbers(translation.parameter_values({})), scene.program
    n, m = len(program.states), len(program.inputs)
    x = np.full((n, 1), 0.4)
    slots = evaluate(
        numbers, np.zeros(1), x, np.full((m, 1), 0.2), np.zeros((scene.n_discrete, 1)), np.full(program.n_slots, 0.3)
    )
    last = int(program.output_slots[-1])
    for added in ((), ((last, 0, 2.0), (last, 1, -1.0))):
        given = numbers, 0.0, slots[:, 0], np.zeros(scene.n_discrete), range(n + m), added, program.output_slots
        size = program.n_slots * (n + m + (2 if added else 0))
        found = {}
        for most in (size, size - 1):
            monkeypatch.setattr("gearlib.program.derivatives.MOST_DENSE", most)
            found[most] = derivatives(*given)
        assert isinstance(found[size], np.ndarray)
        assert not isinstance(found[size - 1], np.ndarray)
        assert found[size - 1].toarray().tolist() == found[size].tolist()
        assert found[size].shape == (len(program.output_slots), n + m + (2 if added else 0))
        if added:
            assert found[size][-1, -2:].tolist() == [2.0, -1.0]


class Root(gl.Component):
    """The cubic root of a state: nothing follows from the slope of its cube at zero."""

    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1")
    y = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**3, self.x)]


def test_points_without_a_linear_model_are_refused() -> None:
    translation = gl.compile(Root()).translation
    scene, numbers = translation.scene, translation.scene.numbers(translation.parameter_values({}))
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    text = "1 equation that is solved by iteration cannot be solved"
    with pytest.raises(SolverError, match=rf"^there is no linear model at this point: {text}"):
        derivatives(numbers, 0.0, slots, none, [0])
