"""Which derivatives a plan lists: those by the seeds that a slot depends on, each once, along the way of the equations."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.kernel import Kernel
from gearlib.program.build import build
from gearlib.program.derivative_plan import TIME, DerivativePlan, Solved, Sums, derivative_plan, discrete_entry, state_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import prepare
from gearlib.program.program import Batch, Linear, Newton, Program
from tests.program.programs import KINDS, point

kinds = pytest.mark.parametrize("kind", KINDS)
Reached = dict[int, set[int]]


@cache
def mattering(kernel: Kernel) -> tuple[list[int], list[int], list[int], bool]:
    """The arguments, parameters and relations that a kernel's value depends on, by their places, and whether it does on time."""

    def moves(name: str) -> bool:
        return bool(sympy.diff(kernel.expression, sympy.Symbol(name, real=True)) != 0)

    columns, parameters, relations = (
        [place for place, number in enumerate(numbers) if moves(f"{letter}{number}")]
        for letter, numbers in (("x", kernel.columns), ("p", kernel.parameters), ("r", kernel.relations))
    )
    return columns, parameters, relations, moves("t")


def moved(batch: Batch, row: int, n: int) -> set[int]:
    """What changes the value of a row: slots, parameters behind them, entries of the discrete state and time, by their codes."""
    columns, parameters, relations, time = mattering(batch.kernel)
    found = {int(batch.arguments[row, a]) for a in columns if batch.argument_signs[row, a]}
    found |= {n + int(batch.parameters[row, a]) for a in parameters}
    found |= {discrete_entry(int(batch.relations[row, a])) for a in relations}
    return found | ({TIME} if time else set())


def behind(program: Program) -> list[tuple[list[int], set[int]]]:
    """Per step, or row of a batch: the slots that it computes, and all that they depend on directly."""
    n, found = program.n_slots, []
    for step in program.steps:
        if isinstance(step, Batch):
            found += [([int(step.targets[row])], moved(step, row, n)) for row in range(len(step))]
            continue
        unknowns = step.unknowns.tolist()
        batches = step.matrix if isinstance(step, Linear) else step.residuals
        read = {place for batch in batches for row in range(len(batch)) for place in moved(batch, row, n)}
        found.append((unknowns, (read | ({*step.known.tolist()} if isinstance(step, Linear) else set())) - {*unknowns}))
    return found


def reached(program: Program, entering: list[tuple[int, int]]) -> Reached:
    """The seeds of each slot; the unknowns of a block share theirs."""
    seeds: Reached = {}
    for place, seed in entering:
        seeds.setdefault(place, set()).add(seed)
    for slots, read in behind(program):
        own = set().union(*(seeds.get(place, set()) for place in (*read, *slots)))
        seeds |= {slot: own for slot in slots}
    return seeds


def needed(program: Program, wanted: list[int]) -> set[int]:
    alive = {*wanted}
    for slots, read in reversed(behind(program)):
        if alive & {*slots}:
            alive |= {place for place in read if 0 <= place < program.n_slots}
    return alive


def listed(plan: DerivativePlan) -> dict[int, list[int]]:
    found: dict[int, list[int]] = {}
    for row, seed in zip(plan.rows.tolist(), plan.seeds.tolist(), strict=True):
        found.setdefault(int(plan.wanted[row]), []).append(seed)
    return found


@pytest.mark.parametrize("some", [False, True], ids=["all slots", "some slots"])
@kinds
def test_the_derivatives_that_there_are(kind: str, some: bool) -> None:
    """By states and inputs, parameters, entries of the discrete state, time and a slot, in any order, two with one seed."""
    p = point(kind)
    program, rng = p.program, np.random.default_rng(7)
    places: list[int] = [*range(len(program.states) + len(program.inputs)), int(program.output_slots[-1]), TIME]
    places += [program.n_slots + int(q) for q in rng.permutation(len(p.numbers.parameters))[:12]]
    places += [discrete_entry(i) for i in range(len(p.flags))]
    places += [int(step.unknowns[-1]) for step in program.steps if not isinstance(step, Batch)][:1]
    entering = [(places[k], min(i, len(places) - 2)) for i, k in enumerate(rng.permutation(len(places)).tolist())]
    known = set(range(len(program.states) + len(program.inputs)))
    wanted = rng.permutation(program.n_slots)[:5].tolist() if some else [*range(program.n_slots)]
    plan = derivative_plan(program, entering, wanted if some else None)
    seeds, alive = reached(program, entering), needed(program, wanted)
    assert listed(plan) == {slot: sorted(seeds[slot]) for slot in wanted if seeds.get(slot)}
    assert plan.wanted.tolist() == wanted
    assert plan.n_seeds == len(places) - 1
    assert plan.shape == (len(wanted), plan.n_seeds)
    assert sorted(plan.order.tolist()) == [*range(len(entering))]
    assert plan.n_entries == 1 + len(entering) + sum(len(seeds.get(slot, ())) for slot in alive - known)
    given = iter(range(1 + len(entering), plan.n_entries))
    for step in plan.steps:  # entries are numbered as they are computed
        made = step.to if isinstance(step, Sums) else step.first + np.arange(len(step.rows) * step.width)
        assert made.tolist() == [next(given) for _ in made]
    assert next(given, None) is None
    pairs = list(zip(plan.seeds[plan.by_column].tolist(), plan.rows[plan.by_column].tolist(), strict=True))
    assert pairs == sorted(zip(plan.seeds.tolist(), plan.rows.tolist(), strict=True))
    assert (plan.sources > 0).all()
    assert len({*plan.sources.tolist()}) == len(plan.sources)


@pytest.mark.parametrize("every", [1, 2, 5])
@kinds
def test_products_of_sums(kind: str, every: int) -> None:
    """Each factor is used; its products are found by their rows; each product belongs to one sum, and the sums are in order."""
    p = point(kind)
    program = p.program
    used = sorted({int(q) for b in p.batches for q in b.parameters.ravel()})
    places = [*range(len(program.states) + len(program.inputs)), *(program.n_slots + q for q in used[::every])]
    plan = derivative_plan(program, [(place, k) for k, place in enumerate(places)])
    multiplied: list[int] = []
    for step in plan.steps:
        sums = step if isinstance(step, Sums) else step.sums
        assert len(sums) == len(sums.to) == len(sums.starts)
        assert len({*sums.to.tolist()}) == len(sums)
        ends = [*sums.starts.tolist()[1:], len(sums.which)]
        assert sums.starts[:1].tolist() == [0] * bool(len(sums))
        assert all(start < end for start, end in zip(sums.starts.tolist(), ends, strict=True))
        targets = [
            to for to, start, end in zip(sums.to.tolist(), sums.starts.tolist(), ends, strict=True) for _ in range(start, end)
        ]
        assert sums.targets.tolist() == targets
        assert len(sums.multiplied) == len(sums.factors)
        before = 0
        for position, (factor, slots) in enumerate(zip(sums.factors, sums.multiplied, strict=True)):
            assert not factor.kernel.is_zero
            products, starts = sums.of_factor(position)
            assert len(starts) == len(factor) + 1
            assert sorted(products.tolist()) == [
                k for k, w in enumerate(sums.which.tolist()) if before <= w < before + len(factor)
            ]
            for row in range(len(factor)):
                own = products[starts[row] : starts[row + 1]]
                assert (sums.which[own] == before + row).all()
                assert own.tolist() == sorted(own.tolist())
                assert len(own)
            before += len(factor)
            assert slots is None or len(slots) == len(factor)
            multiplied += [] if slots is None else slots.tolist()
        assert sums.which.max(initial=-1) < before
        assert sums.which.min(initial=-1) >= -1
        if isinstance(step, Solved):
            assert isinstance(step.step, Newton | Linear)
            assert (step.block == -1) == isinstance(step.step, Newton)
            entered = {*used[::every]}
            implicit = isinstance(step.step, Newton) or any(
                entered & {*b.parameters.ravel().tolist()} for b in step.step.matrix
            )
            assert step.implicit == implicit
            height = len(step.step.unknowns) if implicit or isinstance(step.step, Newton) else len(step.step.known)
            assert sums.to.max(initial=-1) < height * step.width
    assert plan.multiplied.tolist() == multiplied
    assert multiplied or kind != "bound" or every > 1


@kinds
def test_the_plan_of_the_jacobian(kind: str) -> None:
    program = point(kind).program
    plan, n = state_plan(program), len(program.states)
    assert plan.wanted.tolist() == program.output_slots.tolist()
    assert (plan.n_seeds, plan.shape) == (n, (len(program.outputs), n))
    seeds = reached(program, [(i, i) for i in range(n)])
    assert listed(plan) == {int(slot): sorted(seeds[int(slot)]) for slot in program.output_slots if seeds.get(int(slot))}
    assert plan.multiplied.tolist() == []
    assert not any(step.implicit for step in plan.steps if isinstance(step, Solved) and isinstance(step.step, Linear))


class Few(gl.Component):
    """A sum of two states, and multiples of one of them."""

    x, y, r = (gl.Variable("1") for _ in range(3))
    s0, s1, s2, s3, s4 = (gl.Variable("1") for _ in range(5))
    rate, p = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=2.5)

    def equations(self) -> list[gl.Eq]:
        multiples = [gl.Eq(getattr(self, f"s{i}"), self.p * (2.0 + i) * self.x) for i in range(5)]
        return [
            gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(gl.der(self.y), self.rate * self.x),
            gl.Eq(self.r, 3.0 * self.x - self.p * self.y), *multiples,
        ]  # fmt: skip


@pytest.mark.parametrize("states", [("x", "y"), ("y", "x")])
@pytest.mark.parametrize(
    "wanted", [("r",), ("x", "r"), ("r", "s2", "x"), ("s4", "r", "y", "r", "s0"), ("y", "x"), ("s1", "s3")], ids=" ".join
)
def test_the_derivatives_of_a_few_slots_by_hand(wanted: tuple[str, ...], states: tuple[str, str]) -> None:
    """In the order in which they are asked for, once for each seed, whatever else the program computes."""
    translation = gl.compile(Few()).translation
    names = ("x", "y", "r", *(f"s{i}" for i in range(5)))
    nodes = {name: (translation.model.variable(name), 0) for name in names}
    program = build(translation.structure, [nodes[n] for n in names[2:]], [nodes[n] for n in states], dynamic=False)
    slopes = {"x": {"x": 1.0}, "y": {"y": 1.0}, "r": {"x": 3.0, "y": -2.5}} | {
        f"s{i}": {"x": 2.5 * (2.0 + i)} for i in range(5)
    }
    numbers = prepare(program, translation.structure, translation.model.parameters.values)
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((0, 1)))
    slots = [program.slots[nodes[name]] for name in wanted]
    expected = [
        (row, seed, slopes[name][x]) for row, name in enumerate(wanted) for seed, x in enumerate(states) if x in slopes[name]
    ]
    for given in (slots, None):
        plan = derivative_plan(program, [(program.slots[nodes[x]], seed) for seed, x in enumerate(states)], given)
        found = zip(plan.rows.tolist(), plan.seeds.tolist(), entries(plan, at)[:, 0].tolist(), strict=True)
        if given is None:
            found = (
                (row, seed, value) for slot_row, seed, value in found for row, slot in enumerate(slots) if slot == slot_row
            )
        assert sorted(found) == [pytest.approx(one) for one in expected]


class Cancelled(gl.Component):
    """``y = (x + 1)^2 - x^2 - 2 x + 3 z``, in which x counts for nothing: it is 1 + 3 z."""

    x, y, z = (gl.Variable("1") for _ in range(3))
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.z), gl.Eq(gl.der(self.z), self.rate * self.y),
            gl.Eq(self.y, (self.x + 1) ** 2 - self.x**2 - 2 * self.x + 3 * self.z),
        ]  # fmt: skip


def test_what_cancels_in_an_equation_is_no_derivative_of_it() -> None:
    translation = gl.compile(Cancelled()).translation
    program = translation.scene.program
    slots = {name: program.slots[translation.model.variable(name), 0] for name in "xyz"}
    (batch,) = (b for b in program.steps if isinstance(b, Batch) and slots["y"] in b.targets)
    assert {slots["x"], slots["z"]} == {*batch.arguments[0].tolist()}  # as it is written
    assert [batch.arguments[0, a] for a in batch.active] == [slots["z"]]
    plan = derivative_plan(program, [(slots["x"], 0), (slots["z"], 1)], [slots["y"]])
    numbers = translation.scene.numbers(translation.parameter_values({}))
    at = At(numbers, np.zeros(1), np.full((program.n_slots, 1), 0.7), np.zeros((0, 1)))
    assert list(zip(plan.rows.tolist(), plan.seeds.tolist(), entries(plan, at)[:, 0].tolist(), strict=True)) == [(0, 1, 3.0)]
    assert len(derivative_plan(program, [(slots["x"], 0)], [slots["y"]]).sources) == 0


class Counted(gl.Component):
    """``x' = r (m p x + q r t)`` with a number ``m`` that events change."""

    x, m = gl.Variable("1"), gl.Discrete("1")
    rate, p, q = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=2.0), gl.Parameter("1", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.m * self.p * self.x + self.q * self.rate * gl.time)),
            gl.When(self.x > 5, gl.Eq(self.m, gl.pre(self.m) + 1)),
        ]  # type: ignore[list-item]


@pytest.mark.parametrize("name", ["rate", "p", "q"])
def test_constants_at_which_seeds_enter_are_told_apart(name: str) -> None:
    """One of three parameters, a number that is used, one behind it that is not, and time."""
    translation = gl.compile(Counted()).translation
    model, scene = translation.model, translation.scene
    r, p, q, m, x, t = 1.5, 2.0, -0.7, 4.0, 0.3, 0.9
    values = model.parameters.values.copy()
    values[[model.parameters.index[one] for one in ("rate", "p", "q")]] = r, p, q
    flags = np.zeros((scene.n_discrete, 1))
    place = model.n_relations + model.discretes.index("m")
    flags[place] = m
    program = build(translation.structure, scene.rates, scene.states, dynamic=True)
    slots = np.full((program.n_slots, 1), x)
    codes = [program.n_slots + model.parameters.index[name], discrete_entry(place), TIME, discrete_entry(place + 1)]
    plan = derivative_plan(program, [(code, seed) for seed, code in enumerate(codes)], program.output_slots)
    numbers = prepare(program, translation.structure, values)
    found = dense(plan, entries(plan, At(numbers, np.array([t]), slots, flags)))[0]
    slopes = {"rate": m * p * x + 2 * q * r * t, "p": r * m * x, "q": r**2 * t}
    assert found == pytest.approx(np.array([[slopes[name], r * p * x, r**2 * q, 0.0]]), rel=1e-14)
