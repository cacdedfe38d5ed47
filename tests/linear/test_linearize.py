"""Linear models against derivations by hand, and their names."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import NameLookupError, SolverError
from gearparts.trains import zhou_cui_2022 as zc
from tests.linear.random_trains import Train, draw, matrices, sensor_name


def test_matrices_equal_a_derivation_by_hand(chain: Callable[..., gl.System]) -> None:
    """Twists and speeds as states: twist' = w_b - w_a, J w' = torques; every entry, by its names."""
    n, J, c, d, d_load = 4, 0.7, 310.0, 1.7, 2.2
    model = chain(n=n, grounded=True).linearize(
        ["torque.tau"], [f"shaft[{i}].tau" for i in range(n - 1)] + ["body[3].w"],
        parameters={"J": J, "c": c, "d": d, "d_load": d_load},
    )  # fmt: skip
    names = [f"shaft[{i}].phi_rel" for i in range(n - 1)] + [f"body[{i}].w" for i in range(n)]
    A, B = np.zeros((2 * n - 1, 2 * n - 1)), np.zeros((2 * n - 1, 1))
    C = np.zeros((n, 2 * n - 1))
    for i in range(n - 1):
        stretch, left, right = i, n - 1 + i, n + i
        A[stretch, left], A[stretch, right] = -1, 1
        C[i, [stretch, left, right]] = c * (1 + 0.2 * i), -d, d
        A[left] += C[i] / (J * (1 + 0.3 * i))
        A[right] -= C[i] / (J * (1 + 0.3 * (i + 1)))
    A[-1, -1] -= d_load / (J * (1 + 0.3 * (n - 1)))
    B[n - 1] = 1 / J
    C[n - 1, -1] = 1
    place = [list(model.state_labels).index(name) for name in names]
    assert np.array(model.A)[np.ix_(place, place)] == pytest.approx(A, rel=1e-12, abs=1e-10)
    assert np.array(model.B)[place] == pytest.approx(B, rel=1e-12)
    assert np.array(model.C)[:, place] == pytest.approx(C, rel=1e-12, abs=1e-12)
    assert list(model.input_labels) == ["torque_tau"]
    assert list(model.output_labels) == [f"shaft[{i}]_tau" for i in range(n - 1)] + ["body[3]_w"]


def test_paper_equals_its_printed_equations_at_random_parameters() -> None:
    """Transfer functions from all four sources; the states differ (momenta there, speeds here)."""
    rng = np.random.default_rng(5)
    symbols = ("R_s", "R_p", "I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v")
    defaults = gl.compile(gp.ZhouCui2022()).parameters
    values = {name: float(defaults[name] * rng.uniform(0.5, 2.0)) for name in symbols}
    values |= {"R_r": values["R_s"] + 2 * values["R_p"], "R_h": values["R_s"] + values["R_p"]}
    system = gl.compile(gp.ZhouCui2022())
    model = system.linearize(["tau_in", "train.e_rate"], ["w_in", "w_out", "q_ring", "q_sun", "q_pair"], parameters=values)
    params = zc.bond_parameters(**values)
    A, B = zc.explicit_matrices(params)
    C = np.zeros((5, 8))
    C[0, 0], C[1, 7] = 1 / params.I[2], -1 / params.I[78] / params.m[22]
    C[2, 1] = C[3, 4] = C[4, 6] = 1
    B = np.column_stack([B[:, 0], B[:, 1:].sum(axis=1)])
    for w in (3.0, 300.0, 5000.0, 60000.0):
        mine = model.C @ np.linalg.solve(1j * w * np.eye(8) - model.A, model.B) + model.D
        theirs = C @ np.linalg.solve(1j * w * np.eye(8) - A, B)
        assert np.abs(mine - theirs) == pytest.approx(0, abs=1e-10 * np.abs(theirs).max())
        assert mine == pytest.approx(theirs, rel=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_random_trains_have_the_transfer_functions_of_matrices_by_hand(seed: int) -> None:
    drawn = draw(np.random.default_rng(1000 + seed))
    A, b, c = matrices(drawn)
    model = gl.compile(Train(drawn=drawn)).linearize(["torque.tau"], [sensor_name(drawn)])
    assert model.A.shape == A.shape
    for s in (0.3 + 2j, 3j + 20, 100 + 300j, 5000j + 2000):
        mine = model.C @ np.linalg.solve(s * np.eye(len(A)) - model.A, model.B)
        assert complex(mine[0, 0]) == pytest.approx(complex(c @ np.linalg.solve(s * np.eye(len(A)) - A, b)), rel=1e-10)


class Fan(gl.Component):
    """A motor against a load that grows with the square of speed."""

    def assemble(self) -> list[Any]:
        self.torque, self.rotor = gp.Torque(tau=8.0), gp.Inertia(J=0.5, guess={"w": 10.0})
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=10.0)
        return [gl.connect(self.torque.flange, self.rotor.flange_a), gl.connect(self.rotor.flange_b, self.load.flange)]


def test_steady_state_under_load_is_found_and_used() -> None:
    """8 = 2 (w / 10)^2 at w = 20; there d(tau)/dw = -2 * 2 * 20 / 100 = -0.8, so A = -0.8 / 0.5."""
    system = gl.compile(Fan(), outputs=["rotor.w"])
    model = system.linearize(["torque.tau"], at="steady")
    assert np.array(model.A) == pytest.approx(np.array([[-1.6]]), rel=1e-10)
    assert np.array(model.B) == pytest.approx(np.array([[2.0]]), rel=1e-12)


def test_moment_of_a_run_is_used() -> None:
    system = gl.compile(Fan(), outputs=["rotor.w"])
    run = system.simulate(t_end=0.3, samples=31, rtol=1e-10, start={"rotor.w": 2.0})
    model = system.linearize(["torque.tau"], at=(run, 0.2))
    w = float(run["rotor.w"][20])
    assert float(np.array(model.A)[0, 0]) == pytest.approx(-2 * 2 * w / 100 / 0.5, rel=1e-10)


def test_moment_between_samples_is_integrated_not_interpolated() -> None:
    """From 0 the rotor follows w = 20 tanh(0.8 t), and A = -0.08 w."""
    system = gl.compile(Fan(), outputs=["rotor.w"])
    run = system.simulate(t_end=3.0, samples=2, rtol=1e-11, start={"rotor.w": 0.0})
    model = system.linearize(["torque.tau"], at=(run, 1.2))
    assert float(np.array(model.A)[0, 0]) == pytest.approx(-1.6 * np.tanh(0.96), rel=1e-9)


def test_point_without_a_linear_model_is_named() -> None:
    """A torque on a brake that nothing with inertia is connected to: no torque says how fast it slides."""

    class Massless(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.brake = gp.Torque(), gp.Brake(fn_max=3.0)
            return [gl.connect(self.torque.flange, self.brake.flange_a)]

    with pytest.raises(gl.GearlibError, match="no linear model at this point"):
        gl.compile(Massless()).linearize()


def test_rate_that_the_equations_leave_open_is_named() -> None:
    """Brakes that are free on a shaft without inertia: one has no torque, two have none either."""

    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = gp.Brake(fn_max=3.0), gp.Brake(fn_max=2.0)
            return [gl.connect(self.one.flange_b, self.other.flange_a)]

    class Hub(gl.Component):
        """Two bodies, and behind a free clutch a hub without inertia, on a free brake."""

        def assemble(self) -> list[Any]:
            self.one, self.other, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Spring(c=10.0)
            self.clutch, self.brake = gp.Clutch(fn_max=20.0), gp.Brake(fn_max=20.0)
            return [
                gl.connect(self.one.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.clutch.flange_a),
                gl.connect(self.clutch.flange_b, self.brake.flange_a),
            ]

    for model, state in ((gp.Brake(fn_max=3.0), "v"), (Pair(), r"(one|other)\.v"), (Hub(), r"(clutch|brake)\.v")):
        system = gl.compile(model)
        said = rf"no linear model at this point: der\({state}\) is not determined there"
        for ask in (gl.System.linearize, gl.modes, gl.stability):
            with pytest.raises(gl.GearlibError, match=said):
                ask(system)


def test_torque_that_stuck_brakes_share_is_no_matter() -> None:
    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.one, self.other = gp.Inertia(J=2.0), *(gp.Brake(fn_max=3.0, f_normalized=1.0) for _ in range(2))
            self.shaft, self.load = gp.SpringDamper(c=18.0, d=0.0), gp.Inertia(J=2.0)
            return [
                gl.connect(self.body.flange_b, self.one.flange_a),
                gl.connect(self.one.flange_b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.load.flange_a),
            ]

    model = gl.compile(Held()).linearize([], ["load.w"])
    assert np.sort_complex(np.linalg.eigvals(np.array(model.A))) == pytest.approx(np.array([-3j, 3j]), abs=1e-12)


def test_absolute_angles_may_grow_in_the_steady_state() -> None:
    model = gl.compile(Fan()).linearize(["torque.tau"], ["rotor.phi", "rotor.w"], at="steady")
    assert list(model.state_labels) == ["rotor.phi", "rotor.w"]
    assert np.array(model.A) == pytest.approx(np.array([[0.0, 1.0], [0.0, -1.6]]), rel=1e-10)


class GapDrive(gl.Component):
    """A motor, a gear with a gap and a fan: in contact under load."""

    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.gear = gp.Torque(), gp.Inertia(J=0.1), gp.IdealGear(ratio=2.0)
        self.mesh = gp.ElastoBacklash(c=1e4, d=3.0, b=0.01)
        self.rotor = gp.Inertia(J=0.5, guess={"w": 10.0})
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-4.0, w_nominal=10.0)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.load.flange),
        ]


def by_hand(c: float, d: float, slope: float, J: float = 0.5) -> Any:
    """Of GapDrive in contact: states motor.w, mesh.phi_rel, rotor.w; slope is that of the load's torque."""
    return np.array([[-d / 4 / 0.1, c / 2 / 0.1, d / 2 / 0.1], [-0.5, 0, 1], [d / 2 / J, -c / J, (slope - d) / J]])


@pytest.fixture(scope="module")
def gap_drive() -> gl.System:
    return gl.compile(GapDrive(), outputs=["rotor.w"])


@pytest.mark.parametrize("tau", [8.0, 2.0])
def test_run_from_the_steady_state_under_an_unbound_input(gap_drive: gl.System, tau: float) -> None:
    """2 tau = 4 (w / 10)^2; the search starts inside the gap, where no torque has a slope."""
    w = 10 * np.sqrt(tau / 2)
    run = gap_drive.simulate(t_end=0.1, samples=3, start="steady", inputs={"torque.tau": tau}, rtol=1e-9)
    assert run["rotor.w"] == pytest.approx(np.full(3, w), rel=1e-9)
    for t in (0.0, 0.07):
        A = gap_drive.linearize(["torque.tau"], at=(run, t)).A
        assert np.array(A) == pytest.approx(by_hand(1e4, 3.0, -8 * w / 100), rel=1e-8)


def test_moment_of_a_run_has_its_inputs_and_parameters(gap_drive: gl.System) -> None:
    """In the gap the mesh has neither stiffness nor damping; later it has. The rotor is that of the run unless another is given,
    also beside other parameters, as in sweeps."""
    run = gap_drive.simulate(
        t_end=2.0, samples=2001, inputs={"torque.tau": 8.0}, parameters={"rotor.J": 0.8}, start={"rotor.w": 0.0}
    )
    before, after = (np.array(gap_drive.linearize(["torque.tau"], at=(run, t)).A) for t in (0.001, 2.0))
    w = run["rotor.w"]
    assert before == pytest.approx(by_hand(0.0, 0.0, -8 * w[1] / 100, 0.8), abs=1e-9)
    assert after == pytest.approx(by_hand(1e4, 3.0, -8 * w[-1] / 100, 0.8), rel=1e-9)
    for given, right in (
        ({}, by_hand(1e4, 3.0, -8 * w[-1] / 100, 0.8)), ({"rotor.J": 0.5}, by_hand(1e4, 3.0, -8 * w[-1] / 100)),
        ({"mesh.c": 2e4}, by_hand(2e4, 3.0, -8 * w[-1] / 100, 0.8)),
    ):  # fmt: skip
        assert np.array(gap_drive.linearize(["torque.tau"], at=(run, 2.0), parameters=given).A) == pytest.approx(
            right, rel=1e-9
        )
    swept = gl.sweep(gl.modes, gap_drive, {"mesh.c": [2e4]}, at=(run, 2.0))
    right = np.linalg.eigvals(by_hand(2e4, 3.0, -8 * w[-1] / 100, 0.8))
    assert np.abs(swept["eigenvalues"][0].imag) == pytest.approx(right.imag[right.imag > 0], rel=1e-9)
    with pytest.raises(gl.GearlibError, match="a run of another system than Fan"):
        gl.compile(Fan()).linearize(["torque.tau"], at=(run, 0.0))
    for outside in (-0.1, 2.1):
        with pytest.raises(gl.GearlibError, match=rf"^at names the time {outside}; the run goes from 0 to 2 s$"):
            gap_drive.linearize(["torque.tau"], at=(run, outside))


class Relay(gl.Component):
    """x' = u^2 - x, u = 1.5; y' = -(1 or 5) y: five once x has passed 1, and until it falls below 0.1."""

    u = gl.Input("1", "what drives x")
    x = gl.Variable("1", "driven", start=0.0)
    y = gl.Variable("1", "decays", start=1.0)
    on = gl.Discrete("x has passed 1")

    def equations(self) -> list[gl.Eq]:
        passed = gl.And(gl.holds(gl.pre(self.on)), self.x > 0.1)
        return [
            gl.Eq(gl.der(self.x), self.u**2 - self.x),
            gl.Eq(gl.der(self.y), -(1 + 4 * self.on) * self.y),
            gl.Eq(self.on, gl.Or(self.x > 1, passed)),
        ]


def test_moment_of_a_run_remembers_its_inputs_and_what_has_happened() -> None:
    """x passes 1 and falls again: at 0.5 nothing but the run's past tells whether the relay is on."""
    system = gl.compile(Relay(), outputs=["x", "y", "on"])
    run = system.simulate(
        t_end=3.0, samples=3001, inputs={"u": gl.Table([0.0, 1.0, 1.001, 3.0], [1.5, 1.5, 0.25, 0.25])}, rtol=1e-9
    )
    early, late = (int(np.argmin(np.abs(run["x"] - 0.5) + 10 * ((run.time > 1) != after))) for after in (False, True))
    assert (run["on"][[early, late]] == [0, 1]).all()
    for sample, rate, u in ((early, 1.0, 1.5), (late, 5.0, 0.25)):
        model = system.linearize(["u"], ["x", "y"], at=(run, run.time[sample]))
        assert np.array(model.A) == pytest.approx(np.diag([-1.0, -rate]), rel=1e-12)
        assert np.array(model.B) == pytest.approx(np.array([[2 * u], [0.0]]), rel=1e-12)


def test_only_the_states_that_the_outputs_need(chain: Callable[..., gl.System]) -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.left, self.right = Fan(), Fan()
            return []

    system = gl.compile(Two())
    assert system.linearize([], ["left.rotor.w"], sparse=True).states == ("left.rotor.w",)
    model = system.linearize(["left.torque.tau", "right.torque.tau"], ["left.rotor.w"])
    assert np.array(model.B).tolist() == [[2.0, 0.0]]  # the other train's torque does nothing
    assert len(chain(n=4).linearize(["torque.tau"], ["shaft[0].tau"]).state_labels) == 7  # no angles


def test_names_that_python_control_cannot_tell_apart() -> None:
    class Clash(gl.Component):
        a_w = gl.Variable("rad/s")

        def assemble(self) -> list[Any]:
            self.a = gp.Inertia(J=1.0)
            return []

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.a_w, 2 * self.a.w)]

    system = gl.compile(Clash())
    with pytest.raises(
        gl.GearlibError, match=r"outputs a\.w and a_w both become 'a_w' in python-control; sparse=True keeps paths"
    ):
        system.linearize([], ["a.w", "a_w"])
    assert system.linearize([], ["a.w", "a_w"], sparse=True).outputs == ("a.w", "a_w")
    with pytest.raises(gl.GearlibError, match=r"the output a\.w is named twice"):
        system.linearize([], ["a.w", "a.w"])
    alone = system.linearize([], ["a.w"])
    assert (alone.ninputs, alone.noutputs, alone.B.shape) == (0, 1, (alone.nstates, 0))


def test_sparse_and_full_matrices_agree(chain: Callable[..., gl.System]) -> None:
    names, system = (["torque.tau"], ["body[600].w"]), chain(n=700)
    small = system.linearize(*names, sparse=True)
    assert small.A.nnz < 5600
    full = system.linearize(*names)
    assert np.array_equal(small.A.toarray(), np.array(full.A))


@pytest.mark.parametrize("inputs", [[], ["torque.tau"], ["torque.tau", "torque.tau"]])
@pytest.mark.parametrize("outputs", [[], ["body[2].w"], ["body[1].w", "torque.tau", "body[2].w"]])
def test_large_models_have_the_shapes_of_small_ones(
    chain: Callable[..., gl.System], inputs: list[str], outputs: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    system = chain(n=3)
    full = system.linearize(inputs, outputs, sparse=True)
    monkeypatch.setattr("gearlib.program.derivatives.MOST_DENSE", 0)
    monkeypatch.setattr("gearlib.linear.linearized_program.MOST_DENSE", 0)
    large = system.linearize(inputs, outputs, sparse=True)
    assert (large.inputs, large.outputs, large.states) == (full.inputs, full.outputs, full.states)
    assert all(hasattr(getattr(large, name), "tocsr") for name in "ABCD") or not large.states
    for name in "ABCD":
        found, expected = getattr(large, name), np.asarray(getattr(full, name))
        assert found.shape == expected.shape, name
        assert (found.toarray() if hasattr(found, "toarray") else found) == pytest.approx(expected, rel=1e-12)


class Inside(gl.Component):
    """A body under a torque that is an input."""

    half = gl.Input("N.m", "half of what moves it outside")

    def assemble(self) -> list[Any]:
        self.half_torque = gp.Torque(tau=self.half)
        self.body = gp.Inertia(J=2.0)
        return [gl.connect(self.half_torque.flange, self.body.flange_a)]


class Outside(gl.Component):
    """Its own torque goes nowhere, or into the one below it."""

    e = gl.Input("N.m", "torque")
    way = gl.Structural("none", choices=("none", "through"))

    def assemble(self) -> list[Any]:
        self.inside = Inside(half=0.5 * self.e if self.way == "through" else 1.0)
        return []


def test_an_input_that_no_equation_contains_is_named() -> None:
    system = gl.compile(Outside())
    actions: list[Callable[[list[str]], Any]] = [
        lambda inputs: system.linearize(inputs, ["inside.body.w"]),
        lambda inputs: system.linearize(inputs, ["inside.body.w"], sparse=True),
        lambda inputs: gl.frequency_response(system, [1.0], inputs, ["inside.body.w"]),
    ]
    for action in actions:
        with pytest.warns(gl.InputWarning, match=r"Outside: no equation contains the input e, and nothing responds to it$"):
            action(["inside.half", "e"])
        action(["inside.half"])
        with pytest.raises(NameLookupError, match=r"^the model has no input 'inside\.body\.w'; "):
            action(["inside.body.w"])


def test_an_input_that_reaches_equations_through_others_is_not() -> None:
    through = gl.compile(Outside(way="through"))
    gain = through.linearize(["e"], ["inside.body.w"]).B
    assert gain == pytest.approx(np.array([[0.25]]))


class Left(gl.Component):
    half = gl.Input("N.m", "bound to nothing below")

    def assemble(self) -> list[Any]:
        self.inside = Inside(half=1.0)
        return []


@pytest.mark.parametrize(
    ("name", "instead"), [("left.half", r"left\.inside\.half"), ("half", r"left\.inside\.half, beside\.half")]
)
def test_what_the_equations_contain_instead_is_named(name: str, instead: str) -> None:
    """Inputs of the same name inside the component, which equations contain."""

    class Outer(Left):
        def assemble(self) -> list[Any]:
            self.left, self.beside = Left(), Inside(half=2.0)
            return []

    system = gl.compile(Outer())
    said = (
        rf"the input {name.replace('.', chr(92) + '.')}, .*; the equations contain {instead}, whose values do not come from it$"
    )
    with pytest.warns(gl.InputWarning, match=said):
        model = system.linearize([name], ["left.inside.body.w"])
    assert not np.any(model.B)


class Static(gl.Component):
    """y = k u, without any state."""

    u, y, k = gl.Input("1"), gl.Variable("1"), gl.Parameter("1", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k * self.u)]


@pytest.mark.parametrize("inputs", [[], ["u"]])
@pytest.mark.parametrize("outputs", [[], ["y"]])
def test_models_without_states_are_linear_too(inputs: list[str], outputs: list[str]) -> None:
    """Their matrices, and the derivatives of these, have a row for each output and a column for each input."""
    model = gl.compile(Static()).linearize(inputs, outputs, sparse=True)
    n, m = len(outputs), len(inputs)
    (change,) = model.changes(["k"])
    for found, slope in ((model, 3.0), (change, 1.0)):
        assert [getattr(found, name).shape for name in "ABCD"] == [(0, 0), (0, m), (n, 0), (n, m)]
        assert found.D.tolist() == [[slope] * m] * n
    assert str(gl.passivity(gl.compile(Static()))).endswith("(0 states, rank of Q 0, of W 0)")


def test_a_model_of_nothing_has_empty_matrices() -> None:
    class Still(gl.Component):
        k, y = gl.Parameter("1", default=3.0), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.y, self.k)]

    model = gl.compile(Still()).linearize([], [], sparse=True)
    for found in (model, *model.changes(["k"])):
        assert [getattr(found, name).shape for name in "ABCD"] == [(0, 0)] * 4
    constant = gl.compile(Still()).linearize([], ["y"], sparse=True)
    assert (constant.C.shape, constant.D.shape) == ((1, 0), (1, 0))


def test_an_output_that_needs_the_derivative_of_an_input_is_refused() -> None:
    class Prescribed(gl.Component):
        """Two inputs; the speed of what one of them positions is its derivative."""

        other, u = gl.Input("1"), gl.Input("1")
        x, v, y = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.x, 2 * self.u),
                gl.Eq(self.v, gl.der(self.x)),
                gl.Eq(gl.der(self.y), self.other - self.y),
            ]

    class Moved(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = Prescribed(other=2.0, u=gl.sin(3 * gl.time))
            return []

    system, inputs = gl.compile(Moved(), outputs=["part.y", "part.v"]), ["part.other", "part.u"]
    model = system.linearize(inputs, ["part.y", "part.x"], sparse=True)
    assert np.asarray(model.D) == pytest.approx(np.array([[0, 0], [0, 2]]))
    said = r"^the outputs part\.y, part\.v need the derivative of the input part\.u, for which dx/dt"
    with pytest.raises(gl.GearlibError, match=said):
        system.linearize(inputs, ["part.y", "part.v"])
    many = ["part.y", "part.x", "part.v", "part.other", "part.u", "der(part.y)", "der(part.x)"]
    with pytest.raises(gl.GearlibError, match=rf"^the outputs {re.escape(', '.join(many[:6]))} need the derivative of"):
        system.linearize(inputs, many)
    assert np.asarray(system.linearize(["part.other"], ["part.y", "part.v"]).B) == pytest.approx(1.0)


def test_a_pickled_model_keeps_its_numbers_and_names() -> None:
    model = gl.compile(Inside()).linearize(["half"], ["body.w", "body.phi"], sparse=True)
    copy = pickle.loads(pickle.dumps(model))
    assert all(np.array_equal(getattr(copy, name), getattr(model, name)) for name in "ABCD")
    assert (copy.states, copy.inputs, copy.outputs, copy.conditions) == (model.states, ("half",), ("body.w", "body.phi"), ())
    assert (copy.whole, copy.changes) == (None, None)


class Folded(gl.Component):
    """``x = y - 4 tanh y``: one y at the start, three of them where the run ends."""

    x, y, z = gl.Variable("1", start=-8.0), gl.Variable("1", guess=3.0), gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(self.x, self.y - 4 * gl.tanh(self.y)), gl.Eq(gl.der(self.z), self.y)]


@pytest.mark.parametrize("outputs", [["y"], ["z"], None])
def test_a_moment_of_a_run_is_on_its_branch(outputs: list[str] | None) -> None:
    """Whether the run solved for y or y was computed after it; elsewhere the guess decides."""
    system = gl.compile(Folded(), outputs)
    result = system.simulate(7.0, samples=8, method="rk", rtol=1e-9)
    y = float(result["y"][-1])
    assert y == pytest.approx(-5.0, abs=1e-3)
    for at, there in (((result, 7.0), y), ({"x": -1.0}, 2.98)):
        slope = 1 / (1 - 4 / np.cosh(there) ** 2)
        assert np.asarray(system.linearize([], ["y"], at=at).C).ravel()[0] == pytest.approx(slope, rel=1e-3)


class Toothed(gl.Component):
    """A spring that is stiffer in one half of a turn; nothing but its condition depends on the angle."""

    turning = gl.Parameter("1", default=1.0)
    force = gl.Parameter("1", default=0.0)
    angle, x, v = gl.Variable("1", start=0.5), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        stiffness = gl.Piecewise((9.0, gl.sin(self.angle) > 0), (4.0, True))
        return [
            gl.Eq(gl.der(self.angle), self.turning),
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.force - 2 * self.v - stiffness * self.x),
        ]


@pytest.mark.parametrize(("angle", "omega"), [(0.5, 3.0), (4.0, 2.0)])
def test_states_that_only_conditions_depend_on(angle: float, omega: float) -> None:
    system = gl.compile(Toothed(), ["x"])
    assert sorted(abs(system.linearize(at={"angle": angle}).poles())) == pytest.approx([0.0, omega, omega], abs=1e-9)
    assert gl.modes(system, at={"angle": angle}).omega.max() == pytest.approx(omega)
    steady = gl.steady_state(system, parameters={"turning": 0.0, "force": 1.0}).sensitivity("x", "force")
    assert steady == pytest.approx(1 / 9)


class Sided(gl.Component):
    """A linear oscillator, and an output whose slope depends on its side; the output has a least value."""

    x, v = gl.Variable("1", start=1.0), gl.Variable("1", start=0.0)
    y = gl.Variable("1", min=-1.0)

    def equations(self) -> list[gl.Eq]:
        y = gl.Piecewise((4 * self.x - 3, self.x > 0.5), (-2 * self.x, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -self.x - 0.1 * self.v), gl.Eq(self.y, y)]


@pytest.mark.parametrize(("x", "slope"), [(1.0, 4.0), (0.4, -2.0)])
def test_outputs_switch_where_the_motion_does_not(x: float, slope: float) -> None:
    """As in a run, which begins with the same values; what its least value allows is not refused."""
    system = gl.compile(Sided())
    assert np.asarray(system.linearize([], ["y"], at={"x": x}).C).ravel().tolist() == [slope, 0.0]
    assert system.simulate(0.1, samples=2, start={"x": x})["y"][0] == pytest.approx(1.0 if x > 0.5 else -0.8)


class Draining(gl.Component):
    """A tank whose outflow grows with the root of its level, or with the level itself."""

    h, q = gl.Variable("1", "level"), gl.Variable("1", "root of the level")
    root, inflow = gl.Structural(True), gl.Input("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.q, gl.sqrt(self.h)), gl.Eq(gl.der(self.h), self.inflow - 2 * (self.q if self.root else self.h))]


ANALYSES: dict[str, Callable[..., Any]] = {
    "modes": gl.modes,
    "stability": gl.stability,
    "response": lambda tank, at: gl.frequency_response(tank, [1.0], ["inflow"], ["h"], at=at),
}


@pytest.mark.parametrize("analysis", ANALYSES)
def test_an_infinite_slope_is_refused_by_name(analysis: str) -> None:
    """The root of 0 has none; at 0.25 it rises by 1 / (2 sqrt(0.25)), and the level returns with -2 times that."""
    tank, linear = gl.compile(Draining()), gl.compile(Draining(root=False))
    assert tank.linearize(["inflow"], ["h"], at={"h": 0.25}).A.tolist() == [[-2.0]]
    with pytest.raises(
        SolverError, match=r"^there is no linear model at this point: the slope of der\(h\) is not finite there"
    ):
        ANALYSES[analysis](tank, at={"h": 0.0})
    ANALYSES[analysis](linear, at={"h": 0.0})
    with pytest.raises(SolverError, match=r"the slope of q is not finite there"):
        linear.linearize(["inflow"], ["q"], at={"h": 0.0})


class HeldByThree(gl.Component):
    """A body that a bearing and a brake hold, and one behind a gear that a bearing holds, with a shaft on a spring."""

    backwards = gl.Structural(False)
    slope = gl.Parameter("N.m/s", default=1.5)
    ratio = gl.Parameter("1", default=3.0)

    def assemble(self) -> list[gl.Connection]:
        parts = {
            "drive": gp.Torque(tau=self.slope * gl.time), "body": gp.Inertia(J=0.3), "bearing": gp.BearingFriction(tau_pos=[[0, 1.0]]),
            "brake": gp.Brake(fn_max=4.0, f_normalized=1.0), "gear": gp.IdealGear(ratio=self.ratio), "wheel": gp.Inertia(J=40.0),
            "other": gp.BearingFriction(tau_pos=[[0, 5.0]]), "shaft": gp.SpringDamper(c=100.0, d=1.0), "end": gp.Inertia(J=1.0),
            "push": gp.Torque(),
        }  # fmt: skip
        for name in reversed(parts) if self.backwards else parts:
            setattr(self, name, parts[name])
        return [
            gl.connect(self.drive.flange, self.push.flange, self.body.flange_a, self.bearing.flange_a),
            gl.connect(self.body.flange_b, self.brake.flange_a, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.wheel.flange_a, self.other.flange_a, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.end.flange_a),
        ]


@pytest.mark.parametrize("backwards", [False, True])
def test_shares_of_what_holds_together_follow_the_run(backwards: bool) -> None:
    """Sums of squares are smallest: 9/19 twice, and 3/19 behind the gear. Linear models had 0.659, 0.318 and 0.068 instead."""
    system, torques = gl.compile(HeldByThree(backwards=backwards)), ["bearing.tau", "brake.tau", "other.tau"]
    shares = np.array([9.0, 9.0, 3.0]) / 19.0
    model = system.linearize(["push.tau"], torques)
    np.testing.assert_allclose(np.ravel(model.D), shares, rtol=1e-9)
    deflection = list(model.state_labels).index("shaft.phi_rel")
    np.testing.assert_allclose(np.asarray(model.C)[:, deflection], 100.0 / 3.0 * shares, rtol=1e-9)
    times = np.array([0.0, 0.4, 0.8])
    result = system.simulate(0.8, times=times, inputs={"push.tau": 0.0}, sensitivities=["slope"])
    for name, share in zip(torques, shares, strict=True):
        np.testing.assert_allclose(result[name], 1.5 * share * times, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(result.sensitivity(name, "slope"), share * times, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ratio", [3.0, -0.4])
@pytest.mark.parametrize("backwards", [False, True])
def test_shares_follow_a_ratio_between_what_holds_together(backwards: bool, ratio: float) -> None:
    """Shares i**2, i**2 and i of 1 + 2 i**2. Their slopes by i lacked that of the sum of squares: 0.00499 N.m in place of 0.00997."""
    system, names = gl.compile(HeldByThree(backwards=backwards)), ["bearing.tau", "brake.tau", "other.tau"]
    times, whole = np.array([0.0, 0.4, 0.8]), 1.0 + 2.0 * ratio**2
    given = {"times": times, "inputs": {"push.tau": 0.0}, "parameters": {"ratio": ratio}}
    result = system.simulate(0.8, sensitivities=["ratio"], **given)
    for name, share, slope in zip(
        names,
        [ratio**2 / whole] * 2 + [ratio / whole],
        [2.0 * ratio / whole**2] * 2 + [(1.0 - 2.0 * ratio**2) / whole**2],
        strict=True,
    ):
        np.testing.assert_allclose(result[name], 1.5 * share * times, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(result.sensitivity(name, "ratio"), 1.5 * slope * times, rtol=1e-9, atol=1e-12)
