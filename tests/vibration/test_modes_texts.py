"""What modes print and refuse: energies, remarks, decays; names and amplitudes of free motions."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.printed import COLUMNS
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.vibration.modes import Modes


class Pair(gl.Component):
    """Two bodies on a shaft, a damper and a slow load."""

    def assemble(self) -> list[Any]:
        self.a, self.b, self.shaft, self.ground = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0), gp.Fixed()
        self.brake, self.slide, self.rod, self.wall = (
            gp.Damper(d=1e-3),
            gp.Mass(m=2.0),
            gp.TranslationalSpring(c=32.0),
            gp.TranslationalFixed(),
        )
        return [
            gl.connect(self.a.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
            gl.connect(self.slide.flange_a, self.rod.flange_a),
            gl.connect(self.rod.flange_b, self.wall.flange),
        ]


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Pair())


@pytest.fixture(scope="module")
def modes(system: gl.System) -> Modes:
    return gl.modes(system)


@pytest.fixture(scope="module")
def free(system: gl.System) -> Modes:
    return gl.modes(system, parameters={"brake.d": 0.0})


def test_each_mode_has_a_line_with_its_largest_shares(free: Modes) -> None:
    head, *rows = str(free).splitlines()
    assert re.split(r"\s{2,}", head) == ["mode", "frequency, Hz", "damping", "kinetic energy", "potential energy"]
    assert [re.split(r"\s{2,}", row.strip()) for row in rows] == [
        ["0", "0", "0.00000", "b 75 %, a 25 %"],
        ["1", f"{1 / np.pi:.6g}", "0.00000", "a 75 %, b 25 %", "shaft 100 %"],
        ["2", f"{2 / np.pi:.6g}", "0.00000", "slide 100 %", "rod 100 %"],
    ]
    at = head.index("kinetic energy")
    assert all(row[at - 1] == " " != row[at] for row in rows)


def test_decays_are_listed_eight_at_most(modes: Modes) -> None:
    (decay,) = modes.decays
    assert decay == pytest.approx(-1e-3 / 4, rel=1e-3)
    assert str(modes).splitlines()[-1] == f"Decays without oscillation, 1/s: {-decay:.6g}"
    many = replace(modes, decays=-np.arange(1.0, 11.0))
    assert str(many).splitlines()[-1] == "Decays without oscillation, 1/s: 1, 2, 3, 4, 5, 6, 7, 8"
    assert "Decays" not in str(replace(modes, decays=np.empty(0)))


@pytest.mark.parametrize(
    ("field", "value", "line"),
    [("preloads", 1, "Besides these, 1 pole at 0 is a constant preload, locked into loops of meshes."),
     ("preloads", 2, "Besides these, 2 poles at 0 are constant preloads, locked into loops of meshes."),
     ("preloads", None, "Constant preloads in loops of meshes are not counted above 500 states."), ("preloads", 0, None),
     ("positions", ("m.turned", "n.q"), "Nothing here depends on m.turned, n.q."), ("positions", (), None),
     ("gaps", {1: "m, n"}, "Mode 1 is a free relative motion across m, n."),
     ("conditions", ("open: m", "sliding: k"), "Operating point: open: m; sliding: k.")],
)  # fmt: skip
def test_remarks_stand_below_and_in_notebooks(modes: Modes, field: str, value: Any, line: str | None) -> None:
    plain = replace(modes, preloads=0, positions=(), gaps={}, conditions=())
    before, after = str(plain).splitlines(), str(replace(plain, **{field: value})).splitlines()
    assert [text for text in after if text not in before] == ([] if line is None else [line])
    html = replace(plain, **{field: value})._repr_html_()
    assert html.count("<p>") == plain._repr_html_().count("<p>") + (line is not None)
    assert html.count("<tr>") == 1 + len(plain)


def test_amplitudes_of_free_and_other_motions(free: Modes) -> None:
    """Of the free one the speeds are real and alike; the angles those of a slow swing; nothing else moves."""
    speeds = free.shape(0, "a.w", "b.w", "slide.v")
    assert speeds[1] == pytest.approx(speeds[0])
    assert speeds[2] == pytest.approx(0, abs=1e-9)
    slow = free.omega[free.omega > 0].min()
    assert free.shape(0, "a.phi") == pytest.approx(speeds[:1] / (1j * slow))
    elastic = 1
    a, b, twist, torque = free.shape(elastic, "a.flange_b.phi", "b.flange_a.phi", "shaft.phi_rel", "shaft.tau")
    assert a / b == pytest.approx(-3.0)
    assert twist == pytest.approx(b - a)
    assert torque == pytest.approx(3.0 * twist)
    assert free.shape(elastic, "der(a.w)", "a.a") == pytest.approx(-(free.omega[elastic] ** 2) * a * np.ones(2))
    assert free.frequencies[elastic] == pytest.approx(1 / np.pi)
    assert free.damped_frequencies[elastic] == pytest.approx(1 / np.pi)


def test_bodies_are_those_with_kinetic_energy(modes: Modes) -> None:
    assert [(name, unit) for name, unit, _ in modes.motions(0)] == [("a", "rad"), ("b", "rad"), ("slide", "m")]
    for k in range(len(modes)):
        values = {name: value for name, _, value in modes.motions(k)}
        assert np.array(list(values.values())) == pytest.approx(
            modes.shape(k, "a.flange_a.phi", "b.flange_a.phi", "slide.flange_a.s")
        )
    assert modes.components == ("a", "b", "shaft", "slide", "rod")
    table = modes.to_dataframe()
    assert list(table["kinetic, %"].columns) == ["a", "b", "slide"]
    assert list(table["potential, %"].columns) == ["shaft", "rod"]
    assert table.index.name == "mode"


@pytest.mark.parametrize("mode", [2, -3, 1.0, True, "1"])
def test_modes_that_do_not_exist_are_refused(modes: Modes, mode: Any) -> None:
    assert len(modes) == 2
    for call in (modes.amplitudes, modes.motions, modes.draw, modes.scheme, modes.shape):
        with pytest.raises(ArgumentError, match=r"there is no mode .*; there are 2, from 0"):
            call(mode)
    assert modes.shape(-1, "a.w") == pytest.approx(modes.shape(1, "a.w"))
    with pytest.raises(NameLookupError, match=r"a\.v"):
        modes.shape(0, "a.v")


def test_damped_frequencies_and_ratios(system: gl.System) -> None:
    found = gl.modes(system, parameters={"brake.d": 0.5})
    assert found.damped_frequencies == pytest.approx(np.abs(found.eigenvalues.imag) / (2 * np.pi))
    assert found.damping == pytest.approx(-found.eigenvalues.real / np.abs(found.eigenvalues), abs=1e-12)
    assert (found.damped_frequencies <= found.frequencies + 1e-12).all()
    assert found.damping.max() > 1e-3


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_number_of_modes_can_be_chosen(system: gl.System, count: int) -> None:
    found = gl.modes(system, count, parameters={"brake.d": 0.0})
    assert len(found) == 1 + min(count, 2)
    assert found.free == 1


class Alone(gl.Component):
    """Two bodies and a spring in one component, which is the whole model."""

    flange_a, flange_b = gp.Flange("one side"), gp.Flange("other side")
    J, c = gl.Parameter("kg.m2", default=1.0), gl.Parameter("N.m/rad", default=3.0)
    w_a, w_b = gl.Variable("rad/s"), gl.Variable("rad/s")
    twist = gl.Variable("rad", state="prefer")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w_a, gl.der(self.flange_a.phi)),
            gl.Eq(self.w_b, gl.der(self.flange_b.phi)),
            gl.Eq(self.twist, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.J * gl.der(self.w_a), self.flange_a.tau + self.c * self.twist),
            gl.Eq(2 * self.J * gl.der(self.w_b), self.flange_b.tau - self.c * self.twist),
        ]


def test_a_model_of_one_component_is_named_by_its_class() -> None:
    system = gl.compile(Alone())
    found = gl.modes(system)
    assert found.components == ("Alone",)
    assert [name for name, _, _ in found.motions(1)] == ["Alone"]
    assert re.split(r"\s{2,}", str(found).splitlines()[2].strip())[-2:] == ["Alone 100 %", "Alone 100 %"]
    negative = gl.modes(system, parameters={"J": -1.0, "c": -3.0})
    assert negative.not_given == dict.fromkeys(range(2), "the kinetic energy of Alone is negative")


class Lift(gl.Component):
    """Pushes as its flange accelerates: a negative inertia."""

    flange, J, w = gp.Flange("outside"), gl.Parameter("kg.m2", default=0.5), gl.Variable("rad/s")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, -self.J * gl.der(self.w))]


def test_the_component_whose_kinetic_energy_is_negative_is_named() -> None:
    """Bodies of 1 and 2 - 0.5 kg.m2 on a spring: omega**2 = 100 (1 + 1 / 1.5)."""

    class Lifted(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.shaft, self.lift = gp.Inertia(J=1.0), gp.Inertia(J=2.0), gp.Spring(c=100.0), Lift()
            return [
                gl.connect(self.a.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a, self.lift.flange),
            ]

    found = gl.modes(gl.compile(Lifted()))
    assert found.omega == pytest.approx([0.0, np.sqrt(500 / 3)], rel=1e-12)
    assert found.not_given == dict.fromkeys(range(2), "the kinetic energy of lift is negative")


def test_modes_at_a_moment_of_a_run_are_those_of_its_parameters(system: gl.System) -> None:
    """Without inertia at one end the train has fewer states; nothing has to be given twice."""
    given = {"b.J": 0.0, "shaft.c": 300.0, "brake.d": 0.5}
    run = system.simulate(0.1, parameters=given)
    expected = gl.modes(system, parameters=given)
    assert len(expected.eigenvalues) + len(expected.decays) < len(gl.modes(system).states)
    for more in ({}, {"parameters": given}):
        found = gl.modes(system, at=(run, 0.05), **more)
        for sensitivity in (found.sensitivity("brake.d"), gl.stability(system, at=(run, 0.05), **more).sensitivity("brake.d")):
            assert sensitivity.value == 0.5
            assert str(sensitivity).startswith("Change with brake.d = 0.5 N.m.s/rad")
        assert str(gl.stability(system, at=(run, 0.05), **more).passivity) == str(gl.passivity(system, parameters=given))
        assert found.eigenvalues == pytest.approx(expected.eigenvalues)
        assert found.decays == pytest.approx(expected.decays)


class Pushing(gl.Component):
    """A spring that pushes away."""

    flange_a, flange_b = gp.Flange("one side"), gp.Flange("other side")
    k = gl.Parameter("N.m/rad", default=1.0)

    def equations(self) -> list[gl.Eq]:
        push = self.k * (self.flange_a.phi - self.flange_b.phi)
        return [gl.Eq(self.flange_b.tau, push), gl.Eq(self.flange_a.tau, -push)]


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_mode_with_a_negative_energy_has_no_shares(size: float) -> None:
    """The free motion has; together with 3 N.m/rad there are 2 left. The same of small and large trains."""

    class Weakened(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0 * size), gp.Inertia(J=3.0 * size)
            self.spring, self.push = gp.Spring(c=3.0 * size), Pushing(k=1.0 * size)
            return [
                gl.connect(self.a.flange_b, self.spring.flange_a, self.push.flange_a),
                gl.connect(self.spring.flange_b, self.b.flange_a, self.push.flange_b),
            ]

    found = gl.modes(gl.compile(Weakened()))
    assert found.omega == pytest.approx([0.0, np.sqrt(2.0 * 4 / 3)])
    assert found.not_given == {1: "the potential energy of push is negative: its stiffness pushes away"}
    assert found.kinetic[0, :2] == pytest.approx([25.0, 75.0])
    assert np.isnan(found.kinetic[1]).all()
    assert np.isnan(found.potential[1]).all()
    stiff = gl.modes(gl.compile(Weakened()), parameters={"push.k": -1.0 * size})  # another spring beside
    assert stiff.not_given == {}
    assert stiff.potential[1, 2:] == pytest.approx([75.0, 25.0])
    slightly = gl.modes(gl.compile(Weakened()), parameters={"push.k": 1e-8 * size})
    assert slightly.not_given == {}, "less than rounding may be"


@pytest.mark.parametrize("grounded", [False, True])
def test_large_trains_whose_states_are_angles_have_their_free_motions(grounded: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal bodies on springs of 1 N.m/rad that have no deflection of their own: 2 sin(k pi / 2 n), and a free motion, or none."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.spring = (
                [gp.Inertia(J=1.0) for _ in range(90)],
                [Pushing(k=-1.0) for _ in range(90 - (not grounded))],
            )
            self.ground = gp.Fixed()
            ends = [*(body.flange_b for body in self.body), self.ground.flange]
            links = zip(self.spring, ends, [*(body.flange_a for body in self.body[1:]), self.ground.flange], strict=False)
            return [link for s, a, b in links for link in (gl.connect(a, s.flange_a), gl.connect(s.flange_b, b))]

    monkeypatch.setattr("gearlib.vibration.modes.MOST_DENSE", 50)
    monkeypatch.setattr("gearlib.vibration.spectrum.MOST_FULL", 50)
    found = gl.modes(gl.compile(Row()), 3)
    assert found.free == (not grounded)
    turns = (np.arange(1, 4) - 0.5) / 90.5 if grounded else np.arange(1, 4) / 90
    assert found.omega[found.free :] == pytest.approx(2 * np.sin(np.pi * turns / 2), rel=1e-9)


class Meter(gl.Component):
    """Revolutions per minute, an algebraic variable that follows from a speed."""

    flange = gp.Flange("of the shaft")
    rpm = gl.Variable("1", "revolutions per minute")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0), gl.Eq(self.rpm, gl.der(self.flange.phi) * 30 / np.pi)]


class Encoder(gl.Component):
    """What it says follows from an absolute angle, on which no motion depends."""

    flange, x = gp.Flange("of the shaft"), gl.Variable("1", "sine of the angle")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, 0), gl.Eq(self.x, gl.sin(self.flange.phi))]


def test_what_follows_from_an_absolute_angle_alone_has_no_amplitude() -> None:
    class Encoded(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.spring, self.encoder = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0), Encoder()
            return [
                gl.connect(self.a.flange_b, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.b.flange_a, self.encoder.flange),
            ]

    found = gl.modes(gl.compile(Encoded()))
    assert found.kinetic[1] == pytest.approx([75.0, 25.0, 0.0])
    for name in ("encoder.x", "der(encoder.x)"):
        with pytest.raises(NameLookupError, match=rf"^{re.escape(name)} has no amplitude in the mode; "):
            found.shape(1, name)


def test_what_follows_from_the_speeds_has_an_amplitude_in_a_free_motion_too() -> None:
    class Metered(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.spring, self.meter = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0), Meter()
            return [
                gl.connect(self.a.flange_b, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.b.flange_a, self.meter.flange),
            ]

    found = gl.modes(gl.compile(Metered()))
    for mode in range(2):
        rpm, w, torque = found.shape(mode, "meter.rpm", "b.w", "spring.tau")
        assert rpm == pytest.approx(w * 30 / np.pi)
        assert (abs(torque) > 1e-6) == (mode == 1)


class LongNames(gl.Component):
    """Two bodies and a shaft inside of a part with a long name."""

    def assemble(self) -> list[Any]:
        self.transmission_of_the_second_turbine_from_the_left = Stage()
        return []


class Stage(gl.Component):
    def assemble(self) -> list[Any]:
        self.generator, self.rotor, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
        return [
            gl.connect(self.generator.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.rotor.flange_a),
        ]


def test_energies_with_long_names_stand_below_each_other() -> None:
    """A line for each mode, and one more for what is strained in it; the names are shortened in front, and begin in one column."""
    found = gl.modes(gl.compile(LongNames()))
    part = "transmission_of_the_second_turbine_from_the_left"
    assert found.components == tuple(f"{part}.{name}" for name in ("generator", "rotor", "shaft"))
    head, free, elastic, strained = str(found).splitlines()
    at = head.index("kinetic energy, and potential energy below it")
    assert head[:at].split() == ["mode", "frequency,", "Hz", "damping"]
    assert free[:at].split() == ["0", "0", "0.00000"]
    assert elastic[:at].split() == ["1", f"{1 / np.pi:.6g}", "0.00000"]
    assert strained[:at].strip() == ""
    for line, shares in (
        (free, [("rotor", 75), ("generator", 25)]),
        (elastic, [("generator", 75), ("rotor", 25)]),
        (strained, [("shaft", 100)]),
    ):
        assert line[at - 1] == " " != line[at]
        said = line[at:].split(", ")
        assert len(said) == len(shares)
        for text, (name, share) in zip(said, shares, strict=True):
            assert re.fullmatch(rf"\S*\.{name} {share} %", text)
            assert len(text) <= 26 + len(f" {share} %")
            assert line == line.rstrip()


@pytest.mark.parametrize("more", [0, 1])
def test_energies_stand_beside_each_other_as_long_as_the_lines_have_room(more: int) -> None:
    """33 letters of numbers, 34 of kinetic energy and two spaces; then the name of the spring, and its share."""
    name = "s" * (COLUMNS - 33 - 34 - 2 - len(" 100 %") + more)

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, spring = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
            setattr(self, name, spring)
            return [gl.connect(self.a.flange_b, spring.flange_a), gl.connect(spring.flange_b, self.b.flange_a)]

    lines = str(gl.modes(gl.compile(Row()))).splitlines()
    assert len(lines) == 3 + more
    assert max(map(len, lines)) == COLUMNS if not more else max(map(len, lines)) < COLUMNS
    assert lines[0].endswith("below it" if more else "potential energy")


def test_a_preload_in_a_free_motion_is_no_amplitude(free: Modes) -> None:
    """A twist that stays, in phase with the speeds, is left out where preloads are mixed in; what a slow swing strains is kept."""
    twist = free.states.index("shaft.phi_rel")
    shapes = free.shapes.copy()
    shapes[twist, 0] = 0.5 + 0.2j
    shapes[twist, 1] += 0.5
    mixed, plain = (replace(free, shapes=shapes, _preloaded=preloaded) for preloaded in (True, False))
    assert plain.shape(0, "shaft.tau") == pytest.approx([3.0 * (0.5 + 0.2j)])
    assert mixed.shape(0, "shaft.tau") == pytest.approx([3.0 * 0.2j])
    for name in ("a.w", "b.w", "b.phi"):
        assert mixed.shape(0, name) == pytest.approx(plain.shape(0, name))
    assert mixed.shape(1, "shaft.tau") == pytest.approx(plain.shape(1, "shaft.tau"))


class Humming(gl.Component):
    """A signal that swings by itself."""

    x, v = gl.Variable("1"), gl.Variable("1/s")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.v, gl.der(self.x)), gl.Eq(gl.der(self.v), -49.0 * self.x)]


def test_a_mode_without_any_energy_has_no_shares_and_no_reason() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.hum, self.a, self.b, self.shaft = Humming(), gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
            return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]

    found = gl.modes(gl.compile(Both()))
    assert found.omega == pytest.approx([0.0, 2.0, 7.0])
    assert found.not_given == {}
    assert found.components == ("a", "b", "shaft")
    assert (found.kinetic[2].tolist(), found.potential[2].tolist()) == ([0.0] * 3, [0.0] * 3)
    assert str(found).splitlines()[3].split() == ["2", f"{7 / (2 * np.pi):.6g}", "0.00000"]


@pytest.mark.parametrize(
    ("inertias", "said"),
    [
        ((1.0, 99.0), "a 99 %, b 1 %"),
        ((1.0, 249.0), "a 100 %"),
        ((149.0, 1.0), "b 99 %, a 1 %"),
        ((2.0, 2.0), "a 50 %, b 50 %"),
    ],
)
def test_shares_are_named_from_one_percent_on(inertias: tuple[float, float], said: str) -> None:
    """In the elastic mode each body's share is that of the other's inertia; two alike are named in their order."""
    found = gl.modes(gl.compile(TwoBodies()), parameters=dict(zip(("a.J", "b.J"), inertias, strict=True)))
    total = sum(inertias)
    assert found.kinetic[1] == pytest.approx([100 * inertias[1] / total, 100 * inertias[0] / total, 0.0])
    assert re.split(r"\s{2,}", str(found).splitlines()[2].strip())[-2:] == [said, "shaft 100 %"]


class TwoBodies(gl.Component):
    def assemble(self) -> list[Any]:
        self.a, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=3.0), gp.Spring(c=3.0)
        return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]


def test_the_two_largest_of_three_shares_are_named() -> None:
    """Three bodies alike, and two springs: the middle one stands still first, then swings twice as far as the others."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.c = (gp.Inertia(J=1.0) for _ in range(3))
            self.left, self.right = gp.Spring(c=1.0), gp.Spring(c=1.0)
            row = (self.a.flange_b, self.left.flange_a), (self.left.flange_b, self.b.flange_a)
            return [
                gl.connect(*pair)
                for pair in (*row, (self.b.flange_b, self.right.flange_a), (self.right.flange_b, self.c.flange_a))
            ]

    found = gl.modes(gl.compile(Row()))
    assert found.omega == pytest.approx([0.0, 1.0, np.sqrt(3.0)])
    assert found.kinetic[2] == pytest.approx([100 / 6, 400 / 6, 100 / 6, 0.0, 0.0])
    kinetic = re.split(r"\s{2,}", str(found).splitlines()[3].strip())[3]
    assert kinetic in {"b 67 %, a 17 %", "b 67 %, c 17 %"}
    assert str(found).splitlines()[1].count("33 %") == 2


@pytest.mark.parametrize("stiffness", [3.0, 3e12])
def test_a_diagram_shows_the_amplitudes_of_shafts_over_the_largest_and_zero_at_rest(stiffness: float) -> None:
    """However small the angles are beside the speeds; of the two flanges of a shaft one is enough."""

    class Beside(gl.Component):
        def assemble(self) -> list[Any]:
            self.pair, self.ground = TwoBodies(), gp.Fixed()
            self.soft, self.disc = gp.Spring(c=stiffness / 100), gp.Inertia(J=1.0)
            return [gl.connect(self.ground.flange, self.soft.flange_a), gl.connect(self.soft.flange_b, self.disc.flange_a)]

    found = gl.modes(gl.compile(Beside()), parameters={"pair.shaft.c": stiffness})
    assert found.omega == pytest.approx([0.0, np.sqrt(stiffness / 100), np.sqrt(stiffness * 4 / 3)])
    for mode, turns in enumerate(([1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, -1 / 3, 0.0, 0.0])):
        scheme: Any = found.scheme(mode)
        shown = scheme.results.turns
        assert sorted(shown) == list(range(scheme.train.shafts))
        values = sorted(shown.values(), key=lambda z: z.real)
        assert values == pytest.approx(sorted(turns), abs=1e-12)
        assert [value for value in values if abs(value) < 1e-6] == [0.0] * turns.count(0.0)
