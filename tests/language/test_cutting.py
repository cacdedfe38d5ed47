"""`gl.cut`: parts alone have the responses that they have in the train, and joined again they are the train."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

OMEGA = np.array([3.0, 400.0, 3500.0, 5900.0, 9000.0])
ENDS = ("train.x_unit_sun", "train.x_unit_carrier")
PLACES = ("train.x_unit.sun", "train.x_unit.carrier")


def responses(system: Any, inputs: list[str], outputs: list[str]) -> Any:
    """Transfer matrices at the test frequencies, (frequencies, outputs, inputs)."""
    linear = system.linearize(inputs, outputs)
    identity = np.eye(len(linear.A))
    return np.array([linear.C @ np.linalg.solve(1j * w * identity - linear.A, linear.B) + linear.D for w in OMEGA])


def joined(planet_meshes: str) -> tuple[Any, Any]:
    """tau_in -> w_out of the train as it is, and of its two pieces joined by equal speeds and opposite torques."""
    whole = responses(gl.compile(gp.ZhouCui2022(planet_meshes=planet_meshes)), ["tau_in"], ["w_out"])[:, 0, 0]
    pieces = gl.cut(gp.ZhouCui2022(planet_meshes=planet_meshes), *PLACES, rest="flow")
    first = gl.compile(pieces, outputs=["w_out", *(f"{end}.rate" for end in ENDS)])
    second = gl.compile(pieces, outputs=[f"{end}_rest.rate" for end in ENDS])
    one = responses(first, ["tau_in", *(f"{end}.flow" for end in ENDS)], ["w_out", *(f"{end}.rate" for end in ENDS)])
    two = responses(second, [f"{end}_rest.flow" for end in ENDS], [f"{end}_rest.rate" for end in ENDS])
    torques = -np.linalg.solve(one[:, 1:, 1:] + two, one[:, 1:, :1])
    return whole, (one[:, :1, :1] + one[:, :1, 1:] @ torques)[:, 0, 0]


@pytest.mark.parametrize("planet_meshes", ["lumped", "separate"])
def test_the_pieces_joined_again_are_the_train(planet_meshes: str) -> None:
    whole, again = joined(planet_meshes)
    assert np.abs(again - whole).max() <= 1e-9 * np.abs(whole).max()
    assert np.allclose(again, whole, rtol=1e-7, atol=0)


def test_a_piece_has_its_own_states_and_no_others() -> None:
    pieces = gl.cut(gp.ZhouCui2022(), *PLACES)
    x_unit = gl.compile(pieces, outputs=["w_out"])
    assert not any(state.startswith(("train.p_unit", "train.shaft")) or state == "q_pair" for state in x_unit.states)
    p_unit = gl.compile(gl.cut(gp.ZhouCui2022(), "train.p_unit"), outputs=["train.p_unit.gear_2.w"])
    assert set(p_unit.states) == {"q_pair", "train.p_unit.gear_1.w", "train.p_unit.gear_2.w"}


def test_the_p_unit_alone_has_the_poles_of_two_rotors_and_a_mesh() -> None:
    system = gl.compile(gl.cut(gp.ZhouCui2022(), "train.p_unit"), outputs=["train.p_unit.gear_2.w"])
    found = np.sort_complex(gl.stability(system).eigenvalues)
    p = system.parameters
    mobility = p["R_1"] ** 2 / p["I_1"] + p["R_2"] ** 2 / p["I_2"]
    expected = np.sort_complex(np.roots([1.0, p["C_g"] * mobility, p["K_g"] * mobility, 0.0]))
    assert np.allclose(found, expected, rtol=1e-10, atol=1e-6)


def test_an_end_that_is_held() -> None:
    """The sun held still: the other reading of the X unit alone."""
    pieces = gl.cut(gp.ZhouCui2022(), *PLACES, given={"train.x_unit.sun": "held"})
    held = gl.compile(pieces, outputs=["w_out"])
    assert "train.x_unit_sun.rate" not in gl.compile(pieces).translation.inputs
    poles = gl.stability(held).eigenvalues
    assert np.sum(np.abs(poles) < 1e-6) == 1  # one shaft held, so one way of turning is left of two


class Line(gl.Component):
    """A torque, two bodies on a shaft."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor, self.shaft, self.load = (
            gp.Torque(tau=3.0), gp.Inertia(J=1.0), gp.SpringDamper(c=8.0, d=0.5), gp.Inertia(J=2.0),
        )  # fmt: skip
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


def test_energy_balances_with_what_the_ends_put_in() -> None:
    system = gl.compile(gl.cut(Line(), "load"))
    run = system.simulate(2.0, inputs={"load_flange_a.flow": 5.0}, rtol=1e-9, audit=True)
    assert np.isclose(run["load.w"][-1], 5.0)
    assert run.stats["energy_residual"] < 1e-8


def test_what_only_gives_a_torque_is_held() -> None:
    """A torque source has no answer to a torque: its end is held, and it is there nevertheless."""
    for place in ("motor.flange_a", "torque.flange"):
        system = gl.compile(gl.cut(Line(), place))
        given = {"motor_flange_a.flow": 6.0} if place == "motor.flange_a" else {"torque_flange.rate": 0.0}
        run = system.simulate(1.0, samples=2, inputs=given)
        assert np.isclose(run["motor.w"][-1] + 2 * run["load.w"][-1], 6.0 if place == "motor.flange_a" else 0.0)
        assert "torque.tau" in system.variables


def test_a_spring_between_two_cuts_takes_speeds() -> None:
    system = gl.compile(gl.cut(Line(), "shaft", given="rate"), outputs=["shaft_flange_b.flow"])
    speeds = {"shaft_flange_a.rate": lambda t: 0.0, "shaft_flange_b.rate": 0.25}
    torque = system.simulate(2.0, inputs=speeds)["shaft_flange_b.flow"]
    assert torque[-1] == pytest.approx(8.0 * 0.5 + 0.5 * 0.25)


def test_two_connectors_of_one_connection() -> None:
    """Both are ends then, and no rest is left between them."""
    system = gl.compile(gl.cut(Line(), "shaft.flange_b", "load.flange_a"))
    assert system.translation.inputs == ("shaft_flange_b.flow", "load_flange_a.flow")


def test_families_other_connectors_and_cuts_of_cuts() -> None:
    planets = gl.cut(gp.ZhouCui2022(planet_meshes="separate"), "train.x_unit.planet[1]")
    assert any(name.startswith("train.x_unit.planet_1_") for name in gl.compile(planets).translation.inputs)
    twice = gl.cut(gl.cut(gp.ZhouCui2022(), "train.x_unit.sun"), "train.x_unit.carrier")
    assert (
        gl.compile(twice, outputs=["w_out"]).states == gl.compile(gl.cut(gp.ZhouCui2022(), *PLACES), outputs=["w_out"]).states
    )

    class Slide(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.mass, self.spring, self.wall = gp.Mass(m=2.0), gp.TranslationalSpring(c=50.0), gp.TranslationalFixed()
            return [gl.connect(self.mass.flange_b, self.spring.flange_a), gl.connect(self.spring.flange_b, self.wall.flange)]

    pushed = gl.compile(gl.cut(Slide(), "mass")).simulate(1.0, samples=2, inputs={"mass_flange_b.flow": 4.0})
    assert pushed["mass.v"][-1] == pytest.approx(2.0)

    class Warm(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.body, self.way, self.room = gp.HeatCapacitor(C=5.0), gp.ThermalConductor(G=2.0), gp.FixedTemperature(T=300.0)
            return [gl.connect(self.body.port, self.way.port_a), gl.connect(self.way.port_b, self.room.port)]

    heated = gl.compile(gl.cut(Warm(), "body.port")).simulate(1.0, samples=2, inputs={"body_port.flow": 10.0})
    assert heated["body.T"][-1] - heated["body.T"][0] == pytest.approx(2.0)


def test_the_component_is_not_changed_and_a_cut_one_can_be_kept() -> None:
    whole = gp.ZhouCui2022()
    before = gl.compile(whole).states
    pieces = gl.compile(gl.cut(whole, *PLACES), outputs=["w_out"])
    assert gl.compile(whole).states == before
    assert pickle.loads(pickle.dumps(pieces)).states == pieces.states


def test_parts_that_were_assigned_by_hand() -> None:
    class Empty(gl.Component):
        pass

    model = Empty()
    model.line = Line()
    pieces = gl.cut(model, "line.load")
    for _ in range(2):  # each compilation makes the parts anew
        assert gl.compile(pieces).translation.inputs == ("line.load_flange_a.flow",)


@pytest.mark.parametrize(
    ("places", "options", "text"),
    [
        ((), {}, "no place is given"),
        ((3,), {}, "got 3; expected paths"),
        (("train.x_unti.sun",), {}, "train has no part 'x_unti'; did you mean 'x_unit'"),
        (("trian",), {}, "cut: ZhouCui2022 has no part or connector 'trian'; did you mean 'train'"),
        (("train.x_unit.son",), {}, "cut: train.x_unit has no part or connector 'son'; did you mean 'sun'?"),
        (("train.x_unit.sun.tau",), {}, "train.x_unit.sun.tau is a variable; name the connector: train.x_unit.sun"),
        (("train.x_unit.sun",), {"given": "torque"}, "given is 'torque' at train.x_unit.sun; expected flow, rate"),
        (("train.x_unit.sun",), {"rest": {"train.x_unit.son": "flow"}}, "rest names 'train.x_unit.son', which is not cut"),
        (("train.shaft_at_sun.heat",), {}, "no part or connector 'heat'"),
    ],
)  # fmt: skip
def test_slips_are_named(places: tuple[Any, ...], options: dict[str, Any], text: str) -> None:
    with pytest.raises(gl.GearlibError, match="cut: ") as caught:
        gl.cut(gp.ZhouCui2022(), *places, **options)
    assert text in str(caught.value)


def test_what_is_not_connected_cannot_be_cut() -> None:
    with pytest.raises(gl.GearlibError, match=r"load.flange_b is connected to nothing, so that there is nothing to cut"):
        gl.cut(Line(), "load.flange_b")
    with pytest.raises(gl.GearlibError, match="expected a component"):
        gl.cut(gl.compile(Line()), "load")


def test_an_end_does_not_take_a_name_that_the_model_has() -> None:
    """Of a part, such as the end of a cut before; of an attribute, of a declaration, of which it would take the place."""
    with pytest.raises(gl.GearlibError, match=r"cut: Line has 'load_flange_a' already, .* at load\.flange_a .* cut before\?$"):
        gl.cut(gl.cut(Line(), "load"), "load.flange_a")

    class Noted(Line):
        shaft_flange_a = gl.Parameter("1", default=1.0)

        def assemble(self) -> list[gl.Connection]:
            self.load_flange_a_rest = "mine"
            return super().assemble()

    for place, end in (("load", "load_flange_a_rest"), ("shaft.flange_a", "shaft_flange_a")):
        with pytest.raises(gl.GearlibError, match=f"cut: Noted has '{end}' already"):
            gl.cut(Noted(), place)


@pytest.mark.parametrize(("potentials", "flows"), [(2, 1), (1, 2), (2, 2)])
def test_a_connector_is_cut_where_one_flow_answers_one_potential(potentials: int, flows: int) -> None:
    members: dict[str, Any] = {f"p{k}": gl.Potential("rad") for k in range(potentials)}
    members |= {f"f{k}": gl.Flow("N.m") for k in range(flows)}
    port = type("Pair", (gl.Connector,), members)

    class Side(gl.Component):
        end = port("side")

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = Side(), Side()
            return [gl.connect(self.one.end, self.other.end)]

    with pytest.raises(gl.GearlibError, match=rf"cut: a Pair has {potentials} potentials and {flows} flows; expected one of"):
        gl.compile(gl.cut(Two(), "one.end"))
