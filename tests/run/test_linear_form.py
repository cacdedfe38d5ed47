"""Linear forms: A and B against differences of the rates, driving terms as expressions, and why there is none."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.equations.quasipolynomials import TIME
from gearlib.errors import SingularError
from gearlib.program.interpret import evaluate, solutions_of_runs
from gearlib.run import linear_form as module
from gearlib.run.linear_form import affine_seeds, driving_expression, linear_form, linear_forms, mixed_form
from gearlib.solvers.problem import LinearForm
from tests.program.test_derivatives import Bound, Loop


class Train(gl.Component):
    """An open input, a torque of time, one that switches with time, gravity-like constants, and a block of gears."""

    def assemble(self) -> list[Any]:
        self.open, self.drive = gp.Torque(), gp.Torque(tau=2.0 + gl.sin(3 * gl.time))
        self.pulse = gp.Torque(tau=gl.Piecewise((4.0, gl.time < 0.7), (-1.0, True)))
        self.a, self.b, self.c = gp.Inertia(J=0.3), gp.Inertia(J=1.2), gp.Inertia(J=0.7)
        self.gear, self.set = gp.IdealGear(ratio=2.0), gp.IdealPlanetary(ratio=2.5)
        self.spring, self.ground = gp.SpringDamper(c=70.0, d=0.4, phi_rel0=0.1), gp.Fixed()
        return [
            gl.connect(self.open.flange, self.drive.flange, self.pulse.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.set.sun),
            gl.connect(self.set.carrier, self.b.flange_a), gl.connect(self.set.ring, self.c.flange_a),
            gl.connect(self.c.flange_b, self.spring.flange_a), gl.connect(self.spring.flange_b, self.ground.flange),
        ]  # fmt: skip


@cache
def train() -> Any:
    return gl.compile(Train()).translation


def form(values: dict[str, float] | None = None, signals: Any = (1.5,)) -> tuple[Any, LinearForm]:
    numbers = train().scene.numbers(train().parameter_values(values or {}))
    found = linear_form(train().scene, numbers, signals)
    assert isinstance(found, LinearForm), found
    return numbers, found


def rates(numbers: Any, t: float, x: Any, u: float) -> Any:
    at, scene = np.array([t]), train().scene
    column, inputs = np.asarray(x, float)[:, None], np.array([[u]])
    flags = scene.discrete(numbers, at, column, inputs)
    return evaluate(numbers, at, column, inputs, flags)[scene.program.output_slots, 0]


@pytest.mark.parametrize("most", [60, 0], ids=["written", "sparse"])
@pytest.mark.parametrize("values", [{}, {"a.J": 0.9, "spring.c": 11.0, "set.ratio": 1.7, "spring.phi_rel0": -0.3}])
def test_rates_are_linear_in_states_and_inputs(most: int, values: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """x' = A x + B u(t), at times on both sides of the switch."""
    monkeypatch.setattr(module, "MOST_WRITTEN", most)
    train().scene.forms.pop("linear", None)
    numbers, found = form(values)
    A = found.A if most else found.A.toarray()
    assert (most == 0) == (not isinstance(found.A, np.ndarray))
    rng, n = np.random.default_rng(1), len(train().scene.states)
    assert A.shape == (n, n)
    assert found.B.shape == (n, len(found.inputs))
    for t in (0.2, 0.69, 0.71, 3.0):
        x = rng.normal(size=n)
        u = np.array([float(e.subs(TIME, t)) for e in found.inputs])
        assert A @ x + found.B @ u == pytest.approx(rates(numbers, t, x, 1.5), rel=1e-11, abs=1e-10)
    train().scene.forms.pop("linear", None)


def test_inputs_are_numbers_tables_and_terms_of_time() -> None:
    table = gl.Table([0.0, 1.0], [0.0, 3.0])
    _, found = form(signals=(table,))
    assert found.inputs[0] is table
    kinds = [type(e).__name__ for e in found.inputs[1:]]
    assert found.inputs[-1] == 1  # all constants together
    assert sum(e.has(TIME) for e in found.inputs[1:]) == 2
    assert len(kinds) == 3
    _, constant = form(signals=(2.5,))
    assert float(constant.inputs[0]) == 2.5
    assert constant.B[:, 0] == pytest.approx(found.B[:, 0])


def test_forms_are_kept_for_the_same_numbers() -> None:
    numbers = train().scene.numbers(train().parameter_values({}))
    one, mix = mixed_form(train().scene, numbers, (1.5,))  # type: ignore[misc]
    again, other = mixed_form(train().scene, numbers, (1.5,))  # type: ignore[misc]
    assert again is one
    assert other is mix
    changed, _ = mixed_form(train().scene, numbers, (1.75,))  # type: ignore[misc]
    assert float(changed.inputs[0]) == 1.75
    assert pytest.approx(one.A) == changed.A
    fresh = train().scene.numbers(train().parameter_values({"a.J": 2.0}))
    assert (linear_form(train().scene, fresh, (1.75,)).A != one.A).any()  # type: ignore[union-attr]


class Counted(gl.Component):
    """A decay, and a flag for where it is below one half."""

    x, low = gl.Variable("1", start=1.0), gl.Discrete("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.rate * self.x), gl.When(self.x <= 0.5, gl.Eq(self.low, 1.0))]


@pytest.mark.parametrize(
    ("model", "signals", "reason"),
    [
        (Loop(), (0.0,), "the equations are not linear with constant coefficients"),
        (Counted(), (), "relations between variables make events"),
        (Train(), (lambda t: t,), "an input is a Python function"),
        (Train(), (gl.Table([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], "cubic"),), "an input is a table of cubics"),
    ],
)  # fmt: skip
def test_why_there_is_none(model: gl.Component, signals: Any, reason: str) -> None:
    translation = gl.compile(model).translation
    numbers = translation.scene.numbers(translation.parameter_values({}))
    assert linear_form(translation.scene, numbers, signals) == reason
    assert linear_forms(translation.scene, numbers, signals) == reason


def test_driving_terms_as_expressions_of_time() -> None:
    """Each is the value of its equation where all variables are zero, on both sides of the switch."""
    numbers = train().scene.numbers(train().parameter_values({}))
    found = [
        driving_expression(train().scene, batch, i, numbers.parameters) for batch, i in affine_seeds(train().scene.program)
    ]
    moving = [e for e in found if e.has(TIME)]
    for t, pulse in ((0.2, 4.0), (0.9, -1.0)):
        values = sorted(abs(float(e.subs(TIME, t))) for e in moving)
        assert values == pytest.approx(sorted([abs(2.0 + np.sin(3 * t)), abs(pulse)]))
    assert all(not e.free_symbols - {TIME} for e in found)


@pytest.mark.parametrize("table", [False, True])
def test_forms_of_many_runs_are_those_of_each(table: bool) -> None:
    """With masses, stiffnesses and inputs of their own; what moves with time is the same for all."""
    numbers, _ = form()
    signal: Any = gl.Table([0.0, 1.0], [0.0, 3.0]) if table else 0.0
    found = linear_forms(train().scene, numbers, (signal,))
    assert not isinstance(found, str)
    given = [{}, {"a.J": 0.9, "spring.c": 11.0}, {"set.ratio": 1.7, "spring.phi_rel0": -0.3}]
    parameters = np.stack([train().parameter_values(values) for values in given], axis=1)
    assert found.alike(parameters).all()
    solutions, solved = solutions_of_runs(train().scene.program, parameters)
    assert solved.all()
    u = np.array([[0.0, 0.0, 0.0]]) if table else np.array([[1.0, -2.0, 3.0]])
    A, B = found.of_runs(parameters, solutions, u)
    for run, values in enumerate(given):
        _, own = form(values, (signal if table else float(u[0, run]),))
        assert A[run] == pytest.approx(own.A, rel=1e-12, abs=1e-12)
        for t in (0.2, 0.9):
            mine, theirs = (
                np.array([float(e(t)) if isinstance(e, gl.Table) else float(e.subs(TIME, t)) for e in inputs])
                for inputs in (found.inputs, own.inputs)
            )
            assert B[run] @ mine == pytest.approx(own.B @ theirs, rel=1e-12, abs=1e-12)
    assert (found.tables, found.inputs[-1]) == ((0,) if table else (), 1)
    assert len(found.moving) == 2
    other = parameters.copy()
    other[found.slots[0], 1] += 1.0
    assert found.alike(other).tolist() == [True, False, True]


def test_what_cannot_be_evaluated_is_named() -> None:
    """A coefficient of an equation, with the values of its parameters."""

    class Root(gl.Component):
        p = gl.Parameter("1", default=4.0)
        x, y = gl.Variable("1"), gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y, gl.sqrt(self.p) * self.x + 1.0)]

    translation = gl.compile(Root()).translation
    for most in (60, 0):
        translation.scene.forms.pop("linear", None)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "MOST_WRITTEN", most)
            numbers = translation.scene.numbers(translation.parameter_values({"p": -1.0}))
            with pytest.raises(SingularError, match=r"^Root: .*sqrt\(p\).* cannot be evaluated with p = -1$"):
                linear_form(translation.scene, numbers, ())


def test_the_first_of_several_that_cannot_be_evaluated_is_named() -> None:
    class Rooted(gl.Component):
        p = gl.Parameter("1", default=4.0)
        x, y = gl.Variable("1"), gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y, gl.sqrt(self.p) * self.x + 1.0)]

    class Three(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.c = Rooted(), Rooted(), Rooted()
            return []

    translation = gl.compile(Three()).translation
    for bad, named in ((("a", "b"), "a"), (("b", "c"), "b"), (("c",), "c")):
        numbers = translation.scene.numbers(translation.parameter_values({f"{part}.p": -1.0 for part in bad}))
        with pytest.raises(SingularError, match=rf"^{named}: .* cannot be evaluated with {named}\.p = -1$"):
            linear_form(translation.scene, numbers, ())


def test_blocks_that_parameters_change_keep_their_form() -> None:
    """Whatever is bound to parameters: the loop of gears of a train whose sizes follow from one."""
    translation = gl.compile(Bound()).translation
    scene = translation.scene
    for values in ({}, {"size": 0.31}):
        numbers = scene.numbers(translation.parameter_values(values))
        found = linear_form(scene, numbers, ())
        assert isinstance(found, LinearForm)
        x = np.arange(1.0, 1.0 + len(scene.states))
        slots = evaluate(numbers, np.array([0.4]), x[:, None], np.zeros((0, 1)), np.zeros((scene.n_discrete, 1)))[:, 0]
        u = np.array([float(sympy.sympify(e).subs(TIME, 0.4)) for e in found.inputs])
        assert found.A @ x + found.B @ u == pytest.approx(slots[scene.program.output_slots], rel=1e-11, abs=1e-9)


def test_several_constants_together() -> None:
    """x' = 2 - x + y, y' = 5 - 3 y, z' = 14 - z: all constants act through one input."""

    class Pulled(gl.Component):
        x, y, z = gl.Variable("any"), gl.Variable("any"), gl.Variable("any")
        k = gl.Parameter("any", default=2.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.k - self.x + self.y),
                gl.Eq(gl.der(self.y), 2.5 * self.k - 3 * self.y),
                gl.Eq(gl.der(self.z), 7 * self.k - self.z),
            ]

    translation = gl.compile(Pulled()).translation
    scene = translation.with_states(translation.structure.states)
    found = linear_form(scene, scene.numbers(translation.parameter_values({})), ())
    assert isinstance(found, LinearForm)
    assert found.inputs == (1,)
    order = [scene.state_names.index(name) for name in "xyz"]
    assert found.B[order, 0].tolist() == [2.0, 5.0, 14.0]
    assert found.A[np.ix_(order, order)].tolist() == [[-1.0, 1.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -1.0]]
    table = np.stack([translation.parameter_values({"k": k}) for k in (2.0, -4.0)], axis=1)
    forms = linear_forms(scene, scene.numbers(table[:, 0]), ())
    assert not isinstance(forms, str)
    A, B = forms.of_runs(table, solutions_of_runs(scene.program, table)[0], np.zeros((0, 2)))
    assert B[:, order, 0].tolist() == [[2.0, 5.0, 14.0], [-4.0, -10.0, -28.0]]
    assert [own.tolist() for own in A] == [found.A.tolist()] * 2


@pytest.mark.parametrize("most", [60, 0], ids=["written", "sparse"])
@pytest.mark.parametrize("n_moving", [0, 1, 3])
@pytest.mark.parametrize("n_inputs", [0, 1, 2, 3])
def test_inputs_terms_of_time_and_constants_beside_each_other(
    n_inputs: int, n_moving: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """x_i' = -i x_i + (i + 1) u_i + sin((i + 1) t) + 2.5^i, as far as there are inputs and terms of time."""
    monkeypatch.setattr(module, "MOST_WRITTEN", most)

    class Part(gl.Component):
        i = gl.Structural(0)
        x, driven, u = gl.Variable("any"), gl.Variable("any"), gl.Input("any") if n_inputs else gl.Variable("any")

        def equations(self) -> list[gl.Eq]:
            i = self.i
            moving = gl.sin((i + 1) * gl.time) if i < n_moving else 0
            own = [] if n_inputs else [gl.Eq(self.u, 0)]
            return [
                gl.Eq(gl.der(self.x), self.driven + 2.5**i),
                gl.Eq(self.driven, (i + 1) * self.u - i * self.x + moving),
                *own,
            ]

    class Parts(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Part(i=i, **({} if i < n_inputs or not n_inputs else {"u": 0.0})) for i in range(4)]
            return []

    translation = gl.compile(Parts()).translation
    scene = translation.with_states(translation.structure.states)
    u = {name: 0.3 + k for k, name in enumerate(translation.model.name(v) for v in translation.model.inputs)}
    found = linear_form(scene, scene.numbers(translation.parameter_values({})), tuple(u.values()))
    assert isinstance(found, LinearForm)
    x, t = np.array([1.5, -0.4, 2.0, 0.7]), 0.6
    order = [scene.state_names.index(f"part[{i}].x") for i in range(4)]
    drives = np.array([float(sympy.sympify(e).subs(TIME, t)) for e in found.inputs])
    expected = [
        -i * x[i] + (i + 1) * u.get(f"part[{i}].u", 0.0) + (np.sin((i + 1) * t) if i < n_moving else 0.0) + 2.5**i
        for i in range(4)
    ]
    assert found.A[np.ix_(order, order)] @ x + found.B[order] @ drives == pytest.approx(expected, rel=1e-13)
