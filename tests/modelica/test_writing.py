"""Components as Modelica text: read back, they move as before; another parser accepts the text."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymoca.parser
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.modelica_printer import modelica_text
from gearlib.errors import ArgumentError, ModelicaError
from gearlib.language.component import equations_of
from gearlib.language.expressions import real_symbol, value_of
from tests.gearparts import msl_examples, msl_hybrid_examples

NO_EVENT = type(gl.no_event(real_symbol("x")))
MODES: dict[str, dict[str, Any]] = {
    "the standard library": {}, "classes of its own": {"standard_library": False}, "flat": {"flat": True},
}  # fmt: skip


class Sampled(gl.Component):
    """A controller that samples, families of parts that are alike and that are not, an input that nothing gives."""

    stiff = gl.Parameter("N.m/rad", "stiffness", default=50.0, min=0)
    kinds = gl.Structural(2, "number of bodies")

    def assemble(self) -> Any:
        self.drive = gp.Torque()
        self.bodies = [gp.Inertia(J=1.0 + k) for k in range(self.kinds)]
        self.links = [gp.SpringDamper(c=self.stiff, d=1.0), gp.ElastoBacklash(c=2 * self.stiff, d=1.0, b=0.01)]
        self.last = gp.Inertia(J=2.0, start={"w": 0.5})
        self.sampler = gp.blocks.Sampler(sample_period=0.1, u=self.last.w)
        self.limited = gp.blocks.Limiter(y_max=0.6)
        self.brake = gp.Torque(tau=-2 * self.limited.y)
        return [
            gl.connect(self.drive.flange, self.bodies[0].flange_a),
            gl.connect(self.bodies[0].flange_b, self.links[0].flange_a),
            gl.connect(self.links[0].flange_b, self.bodies[1].flange_a),
            gl.connect(self.bodies[1].flange_b, self.links[1].flange_a),
            gl.connect(self.links[1].flange_b, self.last.flange_a),
            gl.connect(self.sampler.y, self.limited.u),
            gl.connect(self.brake.flange, self.last.flange_b),
        ]


class Followed(gl.Component):
    """A motion given by signals, some of them without a value; a table over time; truths where Modelica has them."""

    def assemble(self) -> Any:
        B = gp.blocks
        self.move = gp.Move(phi_ref=gl.sin(2 * gl.time), w_ref=2 * gl.cos(2 * gl.time))
        self.load = gp.Inertia(J=2.0)
        self.chosen = B.Switch(u3=-1.0)
        self.plan = B.CombiTimeTable(table=[[0, 1, 4], [1, 0, 3], [3, 0, 5]], columns=(2, 1), offset=0.5, extrapolation="hold")
        self.fast = B.Hysteresis(u=self.load.w, u_low=-1.0, u_high=1.0)
        self.both = B.LogicalSwitch(u1=gl.Piecewise((1, gl.time > 0.5), (0, True)), u2=self.fast.y, u3=0.0)
        self.doubled = B.Gain(k=2.0, u=self.fast.y + self.both.y)
        self.lag = B.FirstOrder(T=0.5, u=self.doubled.y, start={"y": 2.0})
        return [
            gl.connect(self.move.flange, self.load.flange_a),
            gl.connect(self.plan.outputs[0].y, self.chosen.u1),
            gl.connect(self.both.y, self.chosen.u2),
        ]


CASES: dict[str, tuple[Any, float, list[str], dict[str, float]]] = {
    "XP": (gp.ZhouCui2022, 0.1, ["w_in", "w_out", "q_ring"], {"tau_in": 100.0}),
    "backlash": (msl_hybrid_examples.Backlash, 0.3, ["inertia2.w", "inertia3.w"], {}),
    "a shift": (msl_hybrid_examples.SimpleGearShift, 3.0, ["engine.w", "load.w"], {}),
    "efficiency": (msl_hybrid_examples.LossyGearDemo1, 0.5, ["Inertia2.w"], {}),
    "brakes": (msl_examples.CompareBrakingTorque, 1.5, ["inertia1.w", "inertia4.w"], {}),
    "heat": (msl_examples.EddyCurrentBrake, 1.0, ["inertia.w", "heatCapacitor.T"], {}),
    "followed": (Followed, 2.0, ["load.w", "chosen.y", "doubled.y", "lag.y"], {"move.a_ref": 0.0}),
    "sampled": (Sampled, 1.0, ["last.w", "brake.tau"], {"drive.tau": 3.0}),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_written_and_read_moves_alike(case: str) -> None:
    make, end, names, inputs = CASES[case]
    expected = gl.compile(make(), outputs=names).simulate(end, samples=51, rtol=1e-9, inputs=inputs)
    for mode, options in MODES.items():
        if (case, mode) == ("a shift", "classes of its own"):
            continue  # takes longest; friction in classes of its own is that of "efficiency"
        text = gl.to_modelica(make(), **options)
        assert pymoca.parser.parse(text, model_cache_folder=None) is not None, mode
        own = [name.replace(".", "_") if options.get("flat") else name for name in names]
        given = {name.replace(".", "_"): value for name, value in inputs.items()}
        result = gl.compile(gl.read_modelica(text)(), outputs=own).simulate(end, samples=51, rtol=1e-9, inputs=given)
        for ours, theirs in zip(names, own, strict=True):
            assert np.abs(result[theirs] - expected[ours]).max() < 1e-6 * np.abs(expected[ours]).max(), (mode, ours)


def test_parameters_stay_open() -> None:
    Drive = gl.read_modelica(gl.to_modelica(msl_examples.FirstGrounded(Jload=3.0), standard_library=False))
    for values in ({}, {"Jload": 1.0, "ratio": 5.0}):
        expected = gl.simulate(msl_examples.FirstGrounded(**({"Jload": 3.0} | values)), 0.5, samples=11, rtol=1e-9)
        assert gl.simulate(Drive(**values), 0.5, samples=11, rtol=1e-9)["inertia3.w"] == pytest.approx(
            expected["inertia3.w"], abs=1e-9
        )


def test_truths_and_arrays_are_written_as_modelica_has_them() -> None:
    text = gl.to_modelica(Followed())
    for part in (
        "Move move(u = {sin(2*time), 2*cos(2*time), move_a_ref});",
        "CombiTimeTable plan(table = [0.0, 1.0, 4.0; 1.0, 0.0, 3.0; 3.0, 0.0, 5.0], columns = {3, 2}, ",
        "offset = {0.5}",
        "LogicalSwitch both(u1 = time > 0.5, u2 = fast.y, u3 = false);",
        "Switch chosen(u3 = -1.0, u1 = plan.y[1], u2 = both.y);",
        "FirstOrder lag(T = 0.5, u = doubled.y, y_start = 2.0, initType = Modelica.Blocks.Types.Init.InitialOutput);",
        "Gain doubled(k = 2.0, u = (if both.y then 1 else 0) + (if fast.y then 1 else 0));",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (lambda x, y: x - (-2) * y - (y - x), "2*x + y"),
        (lambda x, y: x * (-y) ** 3 / (x + y), "-x*y^3/(x + y)"),
        (lambda x, y: (-2.0) ** 3 * x ** (-2), "-8.0/x^2"),
        (lambda x, y: gl.sqrt(x + 9) * gl.exp(-y) * 1.0e-7, None),
        (lambda x, y: (-x - y) ** 2 / 3, "(-x - y)^2/3"),
        (lambda x, y: gl.Piecewise((-x, y < -1), (2, True)) * 3, "3*(if y < -1 then -x else 2)"),
        (lambda x, y: abs(x) + gl.Max(x, y), None),
        (
            lambda x, y: gl.no_event(gl.sign(x)) * gl.atan2(y, x),
            None,
        ),
        (lambda x, y: gl.Piecewise((x, gl.Or(gl.And(x > 1, y > 0), gl.Not(x > y))), (y, True)), None),
    ],
)
def test_expressions_keep_their_value(expression: Any, text: str | None) -> None:
    x, y = real_symbol("x"), real_symbol("y")
    written = expression(x, y)
    assert text is None or modelica_text(written) == text
    M = gl.read_modelica(f"model M input Real x; input Real y; Real z = {modelica_text(value_of(written))}; end M;")
    (equation,) = equations_of(M())
    for at in ((1.5, -2.0), (-0.5, 0.25), (3.0, 3.0)):
        found, expected = (
            float(e.replace(NO_EVENT, lambda inner: inner).subs({x: at[0], y: at[1]}))
            for e in (equation.right, value_of(written))
        )
        assert found == pytest.approx(expected, rel=1e-12)


class InDeclaredUnits(gl.Component):
    """A pure number as a torque, and a torque from a table."""

    size = gl.Parameter("1", default=2.0)

    def assemble(self) -> list[gl.Connection]:
        self.wave, self.body = gp.Torque(tau=self.size * gl.sin(3 * gl.time)), gp.Inertia(J=self.size)
        self.brake, self.push = gp.Torque(tau=-4 * self.body.w), gp.Torque(tau=gl.Table([0.0, 1.0], [1.0, 3.0]))
        return [gl.connect(self.body.flange_a, *(t.flange for t in (self.wave, self.brake, self.push)))]


def test_a_pure_number_is_in_the_declared_unit_when_it_is_written_as_an_equation() -> None:
    again = gl.read_modelica(gl.to_modelica(InDeclaredUnits(), flat=True))
    found, expected = gl.simulate(again(), 2.0, samples=5)["body_w"], gl.simulate(InDeclaredUnits(), 2.0, samples=5)["body.w"]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


class Overtaken(gl.Component):
    """A freewheel that starts against its sense."""

    def assemble(self) -> list[gl.Connection]:
        self.fast, self.freewheel = gp.Inertia(J=1.0, start={"w": 1.0}), gp.OneWayClutch(fn_max=1.0, f_normalized=0.0)
        self.slow = gp.Inertia(J=1.0, start={"w": 0.0})
        return [
            gl.connect(self.fast.flange_b, self.freewheel.flange_a),
            gl.connect(self.freewheel.flange_b, self.slow.flange_a),
        ]


@pytest.mark.parametrize("options", [{}, {"standard_library": False}, {"flat": True}])
def test_what_may_not_fall_below_a_minimum_may_not_when_read_back(options: dict[str, bool]) -> None:
    again = gl.read_modelica(gl.to_modelica(Overtaken(), **options))
    with pytest.raises(gl.GearlibError, match=r"^freewheel[._]w_rel is -1 rad/s .*, but it cannot be below 0 at t = 0 s"):
        gl.simulate(again(), 0.1)


@pytest.mark.parametrize("option", ["flat", "standard_library"])
def test_options_are_true_or_false(option: str) -> None:
    with pytest.raises(ArgumentError, match=f"to_modelica: {option} is 1; expected True or False"):
        gl.to_modelica(gp.Inertia(J=1.0), **{option: 1})


def test_what_modelica_does_not_have_is_refused() -> None:
    class Governed(gl.Component):
        def assemble(self) -> Any:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
            self.governor = gl.Sampled(lambda t, v: 1.0, 0.1, inputs=[self.load.w], outputs=[self.torque.tau])
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    for options in MODES.values():
        with pytest.raises(ModelicaError, match="governor calls a Python function"):
            gl.to_modelica(Governed(), **options)


class LeftOut(gl.Component):
    """Blocks with values that are left to their defaults, where Modelica has the same."""

    def assemble(self) -> Any:
        self.ramp, self.zone = gp.blocks.Ramp(duration=1.0), gp.blocks.DeadZone(u_max=1.0)
        self.filter = gp.blocks.TransferFunction(b=[3.0])
        return [gl.connect(self.ramp.y, self.zone.u, self.filter.u)]


def test_blocks_have_the_defaults_that_modelica_has() -> None:
    """A transfer function without ``a`` is a gain in both languages."""
    text = gl.to_modelica(LeftOut(), standard_library=True)
    assert "Ramp ramp(duration = 1.0)" in text
    assert "DeadZone zone(uMax = 1.0, u = ramp.y)" in text
    assert "TransferFunction filter(b = {3.0}, u = ramp.y)" in text
    result = gl.simulate(gl.read_modelica(text, name="LeftOutPackage.LeftOut")(), 2.0, times=[0.5, 1.0, 2.0])
    assert result["filter.y"] == pytest.approx([1.5, 3.0, 3.0], abs=1e-12)


class Pin(gl.Connector):
    """Variables named like a keyword and a function of Modelica."""

    end = gl.Potential("1")
    log = gl.Flow("1")


class Source(gl.Component):
    """A connector named like a function."""

    sqrt = Pin()
    c = gl.Parameter("1", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.sqrt.end, self.c + 2 * self.sqrt.log)]


class Größe(gl.Component):
    """Names that Modelica's functions and keywords have, beside these functions; letters that it has not in names, only here: μ."""

    sin = gl.Parameter("1", default=2.0)
    end = gl.Parameter("1", default=1.0)
    μ = gl.Parameter("1/s", "friction, μ", default=0.5)
    mu = gl.Parameter("1/s", default=1.0)
    exp = gl.Variable("1", start=1.0)
    η = gl.Variable("1", start=0.2)
    pre = gl.Discrete("counts", start=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.exp), self.mu * gl.sin(self.sin * self.exp) - self.mu * self.end),
            gl.Eq(gl.der(self.η), -self.μ * gl.exp(-self.η)),
            gl.When(gl.time > 0.5, gl.Eq(self.pre, gl.pre(self.pre) + 1)),
        ]


class OddNames(gl.Component):
    """Parts named like functions."""

    pre = gl.Parameter("1", default=3.0)

    def assemble(self) -> list[Any]:
        self.exp = Größe(sin=self.pre, end=0.5, start={"exp": 0.3, "η": 0.7})
        self.initial, self.log = Source(c=2.0), Source()
        return [gl.connect(self.initial.sqrt, self.log.sqrt)]


@pytest.mark.parametrize("mode", MODES)
def test_names_that_modelica_does_not_have_get_others(mode: str) -> None:
    """Two letters for one Greek letter where these are another name; an underscore behind what a function or a keyword has."""
    text = gl.to_modelica(OddNames(), **MODES[mode])
    assert pymoca.parser.parse(text, model_cache_folder=None) is not None
    assert '"friction, μ"' in text
    names = {
        "exp.exp": "exp_.exp_", "exp.η": "exp_.eta", "exp.pre": "exp_.pre_", "exp.μ": "exp_.mu_2", "exp.mu": "exp_.mu",
        "initial.sqrt.log": "initial_.sqrt_.log_", "log.sqrt.end": "log_.sqrt_.end_",
    }  # fmt: skip
    if mode == "flat":
        names = {name: name.replace(".", "_").replace("η", "eta").replace("μ", "mu_2") for name in names}
    own, back = (gl.simulate(c, 1.0, samples=5) for c in (OddNames(), gl.read_modelica(text)()))
    for name, other in names.items():
        if not name.endswith(("μ", "mu")):
            assert back[other] == pytest.approx(own[name], rel=1e-12), name
    given = {name: gl.compile(gl.read_modelica(text)()).parameters[name] for name in (names["exp.μ"], names["exp.mu"])}
    assert list(given.values()) == [0.5, 1.0]
