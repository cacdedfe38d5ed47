"""The choice of states, and of others where the ones in use no longer determine the motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import LoopError, ModelError, NameLookupError
from gearlib.flatten.flatten import flatten
from gearlib.reduce.reduction import analyse, choose_again, confirm, decisive_nodes, discrete_nodes, integrals
from gearlib.run.translation import Translation


class Pendulum(gl.Component):
    """A point on a rod of length 1."""

    x = gl.Variable("1", start=0.0)
    y = gl.Variable("1")
    u = gl.Variable("1", start=1.0)
    v = gl.Variable("1")
    pull = gl.Variable("1", "force of the rod over mass and length")
    g = gl.Parameter("1", default=9.81)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), -self.pull * self.x),
            gl.Eq(gl.der(self.v), -self.pull * self.y - self.g),
            gl.Eq(self.x**2 + self.y**2, 1.0),
        ]


@pytest.fixture(scope="module")
def pendulum() -> Translation:
    return gl.compile(Pendulum(guess={"y": -1.0})).translation


@pytest.mark.parametrize(("angle", "state"), [(0.1, "x"), (1.4, "y"), (-1.8, "y"), (3.0, "x")])
def test_the_larger_pivot_decides_which_coordinate_is_a_state(pendulum: Translation, angle: float, state: str) -> None:
    structure, model = pendulum.scene.structure, pendulum.scene.model
    x, y, u, v = map(model.variable, "xyuv")
    known = np.zeros((3, model.n_variables))
    known[0, [x, y, u, v]] = np.sin(angle), -np.cos(angle), np.cos(angle), np.sin(angle)
    known[1, [x, y]] = known[0, [u, v]]

    def coordinate(states: tuple[tuple[int, int], ...]) -> str:
        (found,) = [name for name, place in (("x", x), ("y", y)) if (place, 0) in states]
        return found

    assert coordinate(structure.states) == "x"
    again = choose_again(structure, pendulum.parameter_values({}), 0.0, known)
    assert coordinate((structure if again is None else again).states) == state


def test_where_no_choice_of_states_exists_there_is_no_other(pendulum: Translation) -> None:
    structure, model = pendulum.scene.structure, pendulum.scene.model
    assert choose_again(structure, pendulum.parameter_values({}), 0.0, np.zeros((3, model.n_variables))) is None


class Modes(gl.Component):
    """Discrete variables that depend on each other, and equations that hold them or compare."""

    a, b, x, y, z = (gl.Variable("1", start=0.0) for _ in range(5))
    first, second, apart = gl.Discrete(), gl.Discrete(), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, self.second > 0.5), (2, True))),
            gl.Eq(gl.der(self.y), gl.Piecewise((1, self.b > self.y), (self.z, True))),
            gl.Eq(gl.der(self.z), self.x),
            gl.Eq(gl.der(self.a), gl.pre(self.apart)),
            gl.Eq(gl.der(self.b), 1),
            gl.Eq(self.first, gl.Piecewise((1, self.a > 1), (0, True))),
            gl.Eq(self.second, gl.pre(self.first) + gl.pre(self.second)),
            gl.Eq(self.apart, gl.Piecewise((1, gl.time > 1), (0, True))),
        ]


def test_what_decides_relations_and_discrete_variables_through_others() -> None:
    model = flatten(Modes())
    node = {n: (int(model.representative[model.variable(n)]), 0) for n in "abxyz"}
    deciding = {e: nodes for e, nodes in decisive_nodes(model).items()}
    of = {name: next(e for e in range(len(model.places)) if (node[name][0], 1) in model.nodes(e, 0)) for name in "abxyz"}
    assert deciding == {of["x"]: [node["a"]], of["y"]: sorted([node["b"], node["y"]]), of["a"]: []}
    numbers = {name: k for k, name in enumerate(model.discretes)}
    assert discrete_nodes(model, numbers["first"]) == discrete_nodes(model, numbers["second"]) == [node["a"]]
    assert discrete_nodes(model, numbers["apart"]) == []


def test_a_state_that_is_set_anew_decides_no_discrete_variable() -> None:
    """Whichever of the components comes first: updates of a class are listed together."""

    class Bounce(gl.Component):
        x, hits = gl.Variable("1", start=1.0), gl.Discrete()

        def equations(self) -> list[Any]:
            again = gl.When(self.x < 0, gl.reinit(self.x, 1), gl.Eq(self.hits, gl.pre(self.hits) + 1))
            return [gl.Eq(gl.der(self.x), -1), again]

    class Count(gl.Component):
        y, n = gl.Variable("1", start=0.0), gl.Discrete()

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.y), 1), gl.Eq(self.n, gl.Piecewise((1, self.y > 2), (0, True)))]

    class Both(gl.Component):
        swapped = gl.Structural(False)

        def assemble(self) -> list[Any]:
            kinds = [("one", Bounce), ("other", Count)]
            for name, kind in reversed(kinds) if self.swapped else kinds:
                setattr(self, name, kind())
            return []

    for swapped in (False, True):
        model = flatten(Both(swapped=swapped))
        numbers = {name: k for k, name in enumerate(model.discretes)}
        for discrete, variable in (("one.hits", "one.x"), ("other.n", "other.y")):
            assert discrete_nodes(model, numbers[discrete]) == [(int(model.representative[model.variable(variable)]), 0)]


def test_positions_are_what_plain_rates_belong_to() -> None:
    class Rates(gl.Component):
        p = gl.Parameter("1", default=2.0)
        x, y, z, u, v, w = (gl.Variable("1") for _ in range(6))

        def equations(self) -> list[gl.Eq]:
            der = gl.der
            return [
                gl.Eq(der(self.x), self.u), gl.Eq(self.v, -der(self.y)), gl.Eq(der(self.z), self.p * self.w),
                gl.Eq(der(self.u), self.x * self.y),
                gl.Eq(self.v, 3.0 + self.x), gl.Eq(der(der(self.w)), self.u),
            ]  # fmt: skip

    model = flatten(Rates())
    place = {n: int(model.representative[model.variable(n)]) for n in "xyuv"}
    assert integrals(model) == {place["x"]: place["u"], place["y"]: place["v"]}


def test_angles_are_positions_on_which_nothing_depends() -> None:
    """An integral of anything else is none, though nothing may depend on it; nor is the angle of a spring's end."""

    class Bodies(gl.Component):
        x, y = gl.Variable("1", start=1.0), gl.Variable("1", start=0.0)

        def assemble(self) -> list[Any]:
            self.free, self.held, self.spring = gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.Spring(c=3.0)
            self.ground = gp.Fixed()
            return [gl.connect(self.held.flange_b, self.spring.flange_a), gl.connect(self.spring.flange_b, self.ground.flange)]

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), gl.sin(self.x))]

    translation = gl.compile(Bodies(), ["free.phi", "y"]).translation
    structure = translation.structure
    states = {structure.model.name(v) for v, _ in structure.states}
    assert {"x", "y", "free.phi", "free.w"} < states
    assert {structure.model.name(v) for v, _ in structure.angles} == {"free.phi"}


def test_what_followed_from_others_has_to_go_on_doing_so() -> None:
    """Two planetary sets on the same three shafts: with other ratios they turn as a block only."""

    class Twice(gl.Component):
        k = gl.Parameter("1", default=2.0)

        def assemble(self) -> list[Any]:
            self.one, self.two = gp.IdealPlanetary(ratio=2.0), gp.IdealPlanetary(ratio=self.k)
            self.body = [gp.Inertia(J=1.0) for _ in range(3)]
            shafts = ("sun", "ring", "carrier")
            return [
                gl.connect(b.flange_a, getattr(self.one, s), getattr(self.two, s))
                for b, s in zip(self.body, shafts, strict=True)
            ]

    model = flatten(Twice())
    table = model.parameters
    structure = analyse(model, table.defaults)
    assert len(structure.redundant) == 1
    confirm(structure, table.defaults)
    said = f"^the model was compiled with equations of {structure.redundant[0]} that followed from the others, and with these parameters"
    with pytest.raises(LoopError, match=said):
        confirm(structure, table.evaluate({table.index["k"]: 3.0}))
    alone = flatten(gp.Inertia(J=1.0))
    confirm(analyse(alone, alone.parameters.defaults), alone.parameters.defaults)


def test_names_of_nodes_and_what_cannot_be_computed() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body, self.spare = gp.Torque(), gp.Inertia(J=2.0), gp.Torque(tau=1.0, use_support=True)
            return [gl.connect(self.torque.flange, self.body.flange_a, self.spare.flange, self.spare.support)]

    model = flatten(Driven())
    structure = analyse(model, model.parameters.defaults)
    refusal = ("cannot be an output", "can")
    w, _ = structure.named("body.w", "output", refusal)
    assert structure.named("der(body.w)", "output", refusal)[0] == structure.named("body.a", "output", refusal)[0] == (w[0], 1)
    tau, sign = structure.named("torque.flange.tau", "output", refusal)
    assert (tau, sign) == ((int(model.inputs[0]), 0), -1)
    assert structure.named("body.flange_b.tau", "output", refusal)[1] == 0, "nothing is connected there"
    with pytest.raises(
        NameLookupError,
        match=r"^der\(torque\.tau\) needs the derivative of an input, so it cannot be an output; torque\.tau can$",
    ):
        structure.named("der(torque.tau)", "output", refusal)


def test_inputs_whose_derivatives_a_state_needs_are_refused() -> None:
    class Moved(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Speed(exact=True), gp.Inertia(J=1.0)
            return [gl.connect(self.drive.flange, self.body.flange_a)]

    class Filtered(Moved):
        x, T = gl.Variable("rad/s2", start=0.0), gl.Parameter("s", default=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(self.T * gl.der(self.x), self.body.a - self.x)]

    assert gl.compile(Moved()).states == ()
    with pytest.raises(
        ModelError, match=r"the input drive\.w_ref would have to be differentiated; bind it to an expression of gl\.time"
    ):
        gl.compile(Filtered())


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        (
            lambda s: [gl.Eq(s.y, 2 * s.x), gl.When(s.x > 1, gl.reinit(s.z, 0)), gl.Eq(s.z, s.x * s.y)],
            r"reinit\(z\): z is not a state, .* the states are x\. A variable is one where its .* gl\.der\(z\)$",
        ),
        (lambda s: [gl.Eq(s.y, 1), gl.Eq(s.z, gl.time), gl.When(gl.time > 1, gl.reinit(s.y, 0))], r"reinit\(y\): y is not a state"),
    ],
)  # fmt: skip
def test_what_is_no_state_is_given_no_value(equations: Any, message: str) -> None:
    declared = {n: gl.Variable("1") for n in "xyz"}
    made = type("Leaf", (gl.Component,), {**declared, "equations": lambda s: [gl.Eq(gl.der(s.x), 1), *equations(s)]})()
    with pytest.raises(ModelError, match=message):
        gl.compile(made)


def test_one_state_is_given_values_in_one_component() -> None:
    class Jumping(gp.Inertia):
        def equations(self) -> list[Any]:
            return [gl.When(gl.time > 1, gl.reinit(self.phi, 0))]

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = Jumping(J=1.0), Jumping(J=1.0)
            return [gl.connect(self.one.flange_b, self.other.flange_a)]

    with pytest.raises(
        ModelError, match=r"^reinit\(one\.phi\) and reinit\(other\.phi\) set one state, since one\.phi equals other\.phi up to"
    ):
        gl.compile(Two())


class Bumped(gl.Component):
    """A cam whose follower is hit: an event gives its speed, from which that of the cam follows."""

    phi = gl.Variable("1", start=0.5)
    s = gl.Variable("1")
    w = gl.Variable("1")
    v = gl.Variable("1")
    f = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.s), self.v), gl.Eq(self.s, 1 - gl.cos(self.phi)),
            gl.Eq(gl.der(self.w), -self.f * gl.sin(self.phi)), gl.Eq(gl.der(self.v), self.f - 1),
            gl.When(gl.time >= 0.1, gl.reinit(self.v, 1.0)),
        ]  # fmt: skip


def test_what_an_event_sets_is_a_state_before_the_angle_of_a_cam() -> None:
    system = gl.compile(Bumped())
    assert system.states == ("phi", "v")
    run = system.simulate(0.2, times=[0.0, 0.1, 0.2], rtol=1e-9)
    assert run["v"][1] == 1.0
    assert run["w"][1:] == pytest.approx(run["v"][1:] / np.sin(run["phi"][1:]))
    energy = 0.5 * (run["w"] ** 2 + run["v"] ** 2) + run["s"]
    assert energy[2] == pytest.approx(energy[1], rel=1e-7)
