"""Models of Modelica text: the standard library's examples against ours, closed forms, and what is refused."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import gearlib as gl
from gearlib.errors import FileError, ModelicaError, NameLookupError
from tests.gearparts import msl_examples, msl_hybrid_examples

EXAMPLES = Path(__file__).with_name("rotational_examples.mo")
END = {
    "FirstGrounded": 1.0, "First": 1.0, "Friction": 3.0, "CoupledClutches": 1.5, "LossyGearDemo1": 0.5, "LossyGearDemo2": 0.5,
    "LossyGearDemo3": 1.0, "ElasticBearing": 10.0, "Backlash": 1.0, "RollingWheel": 5.0, "HeatLosses": 2.0, "SimpleGearShift": 5.0,
    "EddyCurrentBrake": 1.0, "OneWayClutch": 2.0, "OneWayClutchDisengaged": 1.5, "CompareBrakingTorque": 5.0,
}  # fmt: skip
MOTIONS = ("phi", "w", "phi_rel", "w_rel", "s", "v", "T")


def ours(name: str) -> gl.Component:
    if name == "First":
        return msl_examples.first()
    return getattr(msl_examples, name, None)() if name in vars(msl_examples) else getattr(msl_hybrid_examples, name)()


@pytest.mark.parametrize("name", END)
def test_rotational_examples_move_as_the_same_models_in_python(name: str) -> None:
    component = ours(name)
    bodies = [
        f"{part}.{v}" for part, p in parts(component) for v in MOTIONS if isinstance(getattr(type(p), v, None), gl.Variable)
    ]
    assert bodies
    wanted = {"outputs": bodies}
    expected = gl.compile(component, **wanted).simulate(END[name], samples=101, rtol=1e-9)
    result = gl.compile(gl.read_modelica(EXAMPLES, name)(), **wanted).simulate(END[name], samples=101, rtol=1e-9)
    for body in bodies:
        peak = max(np.abs(expected[body]).max(), 1e-3)
        assert np.abs(result[body] - expected[body]).max() < 1e-6 * peak, body


def parts(component: gl.Component) -> list[tuple[str, Any]]:
    from gearlib.language.component import parts_of

    component._assembled()
    return [(name, part) for name, part in parts_of(component).items() if "." not in name]


def test_parts_that_exchange_signals() -> None:
    """GenerationOfFMUs: two inertias as one, and two on a spring and a damper, by the matrix exponential."""
    result = gl.simulate(gl.read_modelica(EXAMPLES, "GenerationOfFMUs")(), 1.0, samples=51, rtol=1e-10)
    t, turn = result.time, 4 * np.pi
    for inertia in ("directInertia", "inverseInertia"):
        assert result[f"{inertia}.inertia.w"] == pytest.approx(10 / (3.3 * turn) * (1 - np.cos(turn * t)), abs=1e-8)
    for name, d in (("2", 100.0), ("3", 0.0)):
        twist = np.array([[-1e4, 1e4, -d, d], [1e4, -1e4, d, -d]]) / np.array([[1.1], [2.2]])
        A = np.zeros((6, 6))  # both angles, both speeds, torque and its rate over the frequency
        A[:2, 2:4], A[2:4, :4], A[2, 4] = np.eye(2), twist, 1 / 1.1
        A[4, 5], A[5, 4] = turn, -turn
        forward, x = expm(A * t[1]), np.array([0, 0, 0, 0, 0, 10.0])
        for k in range(len(t)):
            for i, body in enumerate("ab"):
                assert result[f"inertia{name}{body}.w"][k] == pytest.approx(x[2 + i], abs=1e-8)
            x = forward @ x


# ---------------------------------------------------------------- the language

LANGUAGE = """
package Train "of stages"
  import Modelica.Mechanics.Rotational.{Components, Interfaces, Sources};
  import SI = Modelica.Units.SI;
  constant Real half = 1 / 2;
  type Stiffness = SI.RotationalSpringConstant(min = 0);
  connector Shaft "of one's own"
    SI.Angle phi;
    flow SI.Torque tau;
  end Shaft;
  partial model TwoEnds
    extends Interfaces.PartialTwoFlanges;
    Real w_rel(unit = "rad/s") = der(flange_b.phi) - der(flange_a.phi);
  end TwoEnds;
  model Cubic "spring that stiffens"
    extends TwoEnds;
    parameter Stiffness c = 100;
    parameter Real c3 = 0;
    SI.Angle twist;
    SI.Torque tau = c * twist + c3 * twist ^ 3;
  equation
    twist = flange_b.phi - flange_a.phi;
    flange_b.tau = tau;
    flange_a.tau + tau = 0;
  end Cubic;
  model Stage
    parameter SI.Inertia J = 1;
    replaceable Cubic spring(c = 50) constrainedby TwoEnds;
    Components.Inertia body(J = half * J);
    Interfaces.Flange_a flange_a;
    Interfaces.Flange_b flange_b;
  equation
    connect(flange_a, spring.flange_a);
    connect(spring.flange_b, body.flange_a);
    connect(body.flange_b, flange_b);
  end Stage;
  model Chain
    parameter Integer n = 3;
    parameter SI.Inertia J_all = 6;
    parameter Boolean held = true;
    Stage stage[n](each J = 2 * J_all / n, spring(c = {100 * k for k in 1:n}), body(w(each start = 1, each fixed = true)));
    Components.Fixed fixed if held;
  equation
    connect(fixed.flange, stage[1].flange_a);
    for i in 1:n - 1 loop
      connect(stage[i].flange_b, stage[i + 1].flange_a);
    end for;
  end Chain;
  model Stiff = Chain(n = 2, stage(redeclare Components.SpringDamper spring(c = 1000, d = 5)));
end Train;
"""


def chain(n: int, c: list[float], J: float, times: np.ndarray, d: float = 0.0) -> np.ndarray:
    """Angles of bodies on springs, the first one on the ground, from the speed 1."""
    K = np.zeros((n, n))
    for k in range(n):
        twist = np.eye(n)[k] - (np.eye(n)[k - 1] if k else 0)
        K += c[k] * np.outer(twist, twist)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / J, -K / J * d]])
    return np.array([expm(A * t) @ np.r_[np.zeros(n), np.ones(n)] for t in times])


def test_packages_extends_arrays_and_modifications_of_what_is_within() -> None:
    Chain = gl.read_modelica(LANGUAGE, "Train.Chain")
    times = np.linspace(0, 1, 21)
    result = gl.simulate(Chain(), 1.0, times=times, rtol=1e-10)
    expected = chain(3, [100, 200, 300], 2.0, times)
    for k in range(3):
        assert result[f"stage[{k}].body.w"] == pytest.approx(expected[:, 3 + k], abs=1e-8)
        assert result[f"stage[{k}].spring.w_rel"] == pytest.approx(
            expected[:, 3 + k] - (expected[:, 2 + k] if k else 0), abs=1e-8
        )
    result = gl.simulate(Chain(n=4, J_all=2.0), 1.0, times=times, rtol=1e-10)
    assert result["stage[3].body.w"] == pytest.approx(chain(4, [100, 200, 300, 400], 0.5, times)[:, 7], abs=1e-8)
    free = gl.simulate(Chain(held=False), 1.0, samples=3)
    assert free["stage[2].body.w"] == pytest.approx(1.0), "nothing holds them"


def test_redeclared_components_and_short_classes() -> None:
    times = np.linspace(0, 1, 21)
    result = gl.simulate(gl.read_modelica(LANGUAGE)(), 1.0, times=times, rtol=1e-10)
    expected = chain(2, [1000, 1000], 3.0, times, d=5 / 1000)
    assert result["stage[1].body.w"] == pytest.approx(expected[:, 3], abs=1e-8)


def test_parameters_are_set_without_compiling_again() -> None:
    system = gl.compile(gl.read_modelica(LANGUAGE, "Chain")())
    slow, fast = (
        system.simulate(0.1, samples=2, rtol=1e-10, parameters={"J_all": J})["stage[2].body.phi"][-1] for J in (6, 0.06)
    )
    assert slow == pytest.approx(chain(3, [100, 200, 300], 2.0, np.array([0.1]))[0, 2], abs=1e-8)
    assert fast == pytest.approx(chain(3, [100, 200, 300], 0.02, np.array([0.1]))[0, 2], abs=1e-8)


def test_conditions_events_and_start_values() -> None:
    Ball = gl.read_modelica("""
        model Ball "that bounces"
          parameter Real e = 0.8 "restitution", h0 = 1;
          Real h(unit = "m"), v(unit = "m/s");
          Real side(start = 5);
          discrete Integer bounces(start = 0);
          Boolean falling = v < 0;
          output Real lowest = if falling then min(h, 1) elseif h > 0.5 then 2 else 3;
        initial equation
          h = 2 * h0;
          v = 0;
        equation
          der(h) = v;
          der(v) = -Modelica.Constants.g_n;
          if h > 1.5 then
            der(side) = 1;
          else
            der(side) = -abs(side);
          end if;
          when h < 0 then
            reinit(v, -e * pre(v));
            bounces = pre(bounces) + 1;
          end when;
        end Ball;""")
    result = gl.simulate(Ball(), 1.0, samples=11, rtol=1e-9)
    g, t = 9.80665, result.time
    hit, above = np.sqrt(4 / g), np.sqrt(1 / g)  # it falls from 2 m
    since = np.maximum(t - hit, 0)
    assert result["h"] == pytest.approx(np.where(t < hit, 2 - g / 2 * t**2, 0.8 * g * hit * since - g / 2 * since**2), abs=1e-7)
    assert result["side"] == pytest.approx(np.where(t < above, 5 + t, (5 + above) * np.exp(above - t)), abs=1e-6)
    assert list(result["bounces"]) == [0] * 7 + [1] * 4
    assert list(result["falling"][1:]) == [1] * 6 + [0] * 4, "not while it rises"
    assert result["lowest"][[3, 7]] == pytest.approx([1.0, 3.0 if result["h"][7] <= 0.5 else 2.0])
    assert gl.simulate(Ball(e=0.5, h0=0.5), 0.6, samples=2, rtol=1e-9)["v"][-1] == pytest.approx(
        0.5 * np.sqrt(2 * g) - g * (0.6 - np.sqrt(2 / g)), abs=1e-6
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model M Real x end M;", "line 1, column 16: found 'end', expected ';'"),
        ("model M\n  Real x;\nequation\n  x = 1 +;\nend M;", "line 4, column 10: found ';', expected an expression"),
        ("model M end N;", "line 1, column 13: found 'N', expected 'M', the name of the model that ends here"),
        ("model M Real x = 'a;\nend M;", "line 1, column 18: a string that does not end"),
        ("model M Real x = 2 § 3; end M;", "column 20: the sign '§' has no meaning here"),
        ("model M /* never ends", "column 9: a comment that does not end"),
        ("", "found end of text, expected a class"),
        ("package P end P;", "there is no model that is not partial"),
        ("model M Fan f; end M;", "column 13: the class Fan is not known"),
        ("model M Modelica.Mechanics.Rotational.Components.Inertie J; end M;", "did you mean 'Modelica.*Inertia'"),
        ("model M Modelica.Mechanics.Rotational.Components.Inertia J(I = 2); end M;", "column 60: Inertia has no 'I' that can be modified"),
        ("model M Real x; equation x = y; end M;", "column 30: nothing is called 'y' here"),
        ("model M Real x; algorithm x := 1; end M;", "column 17: algorithms are not supported"),
        ("model M Real x[3]; end M;", "column 14: arrays of variables, such as 'x', are not supported"),
        ("model M Real x; equation x = sing(time); end M;", r"column 30: the function sing\(\) is not supported; did you mean 'sin'"),
        ("model M Real x; equation x = atan2(time); end M;", r"column 30: atan2\(\) takes 2 arguments, got 1"),
        ("model M inner Real x; end M;", "column 20: 'inner' is not supported"),
        ("model M Real x; equation when {time > 1, true} then x = 1; end when; end M;", "column 26: .*never becomes true"),
        ("model M Modelica.Blocks.Continuous.FirstOrder f(T = 1, initType = Modelica.Blocks.Types.Init.SteadyState); end M;",
         "column 56: initType = SteadyState is not supported; expected InitialOutput or InitialState or NoInit"),
        ("model M Modelica.Blocks.Continuous.PI f(T = 1, initType = Modelica.Blocks.Types.Init.InitialOutput); end M;",
         "initType = InitialOutput is not supported"),
        ("model M Modelica.Blocks.Sources.CombiTimeTable t(tableOnFile = true); end M;", "column 50: tableOnFile = True is not supported"),
        ("model M Modelica.Blocks.Sources.CombiTimeTable t(table = [0, 1, 2], offset = {1, 2}); end M;", "offsets of the columns differ"),
        ("model M Modelica.Blocks.Sources.CombiTimeTable t(extrapolation = Modelica.Blocks.Types.Extrapolation.NoExtrapolation); end M;",
         "extrapolation = NoExtrapolation is not supported"),
        ("model M Real x; equation x = 1 / 0; end M;", "column 30: a division by zero"),
        ("model M Real x; equation if time > 1 then x = 1; end if; end M;", "column 26: an if-equation whose condition may vary needs"),
        ("model M parameter String s = \"a\"; Real x = s; end M;", "'a' is a string; expected a number"),
        ("model M Real equations = 1; end M;", "column 14: the name 'equations' is reserved"),
        ("model M extends M; end M;", "M extends itself"),
        ("model M Modelica.Blocks.Math.Gain a(k = b.k), b(k = a.k); end M;", "column 41: nothing is called 'b.k' here"),
        ("model M Modelica.Blocks.Continuous.Integrator a[2](u = b.y); Modelica.Blocks.Math.Gain b[2](each k = 1, u = a.y); end M;",
         "column 56: an array of signals of parts that follow"),
        ("model M Real x; Real x; equation x = 1; end M;", "'x' is declared twice"),
        ("model M constant Real g = 9; end M; model N M m(g = 3); end N;", "cannot be modified"),
        ("model M Real x = " + "(" * 300 + "1" + ")" * 300 + "; end M;", "nested too deeply"),
        ("function f input Real x; external; end f; model M end M;", "external functions are not supported"),
        ("model M Real x = __import__(\"os\"); end M;", r"column 18: the function __import__\(\) is not supported"),
        ("model M parameter Integer n = 2; Modelica.Mechanics.Rotational.Components.Fixed f[n]; equation connect(f[3].flange, f[1].flange); end M;",  # noqa: E501
         "column 104: the index of f.flange is 3; expected 1 to 2"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises(ModelicaError, match=message):
        gl.compile(gl.read_modelica(text)())


@pytest.mark.parametrize(
    ("part", "path"),
    [("Sources.Ramp r(height = 3)", r"r\.duration"), ("Nonlinear.DeadZone r(uMin = -1, u = time)", r"r\.u_max"),
     ("Math.Gain r(u = time)", r"r\.k"), ("Nonlinear.Limiter r(u = time)", r"r\.y_max")],
)  # fmt: skip
def test_values_without_a_default_in_modelica_must_be_given(part: str, path: str) -> None:
    with pytest.raises(gl.GearlibError, match=f"{path} has no value; give one"):
        gl.compile(gl.read_modelica(f"model M Modelica.Blocks.{part}; end M;")())


WHENS = """
model Counters "of times at which conditions become true: one or several, with precedence"
  Real x(start = 0, fixed = true), s(start = 0, fixed = true);
  discrete Integer n(start = 0, fixed = true);
  discrete Real last(start = 0, fixed = true);
equation
  der(x) = 1;
  der(s) = 0;
  when {x > 1, x > 3} then
    n = pre(n) + 1;
    last = 1;
    reinit(s, s + 1);
  elsewhen x > 2 then
    n = pre(n) + 10;
    last = pre(last);
  elsewhen {x > 3, x > 4} then
    n = pre(n) + 100;
    last = x;
    reinit(s, s + 100);
  end when;
end Counters;
"""


def test_branches_of_when_take_precedence() -> None:
    """At x = 3 the first branch and the last one become true together, and the first one acts alone."""
    result = gl.simulate(gl.read_modelica(WHENS)(), 5.0, times=[0.0, 0.5, 1.5, 2.5, 3.5, 4.5])
    assert list(result["n"]) == [0, 0, 1, 11, 12, 112]
    assert result["s"] == pytest.approx([0, 0, 1, 1, 2, 102], abs=1e-12)
    assert result["last"] == pytest.approx([0, 0, 1, 1, 1, 4], abs=1e-9)


SIGNALS = """
model Signals "blocks that refer to later ones, to each other and to themselves"
  import Modelica.Blocks.Sources.*;
  Modelica.Mechanics.Rotational.Sources.Torque torque(tau = add.y);
  Modelica.Blocks.Math.Add add(u1 = plan.y[1], u2 = drag.y);
  RealExpression drag(y = -0.5 * load.w);
  BooleanExpression fast(y = load.w > 0.4);
  CombiTimeTable plan(table = [0, 1, 4, 1; 1, 0, 3, 2; 3, 0, 5, 1], columns = {3, 2}, offset = {0.5}, startTime = 0.25,
    extrapolation = Modelica.Blocks.Types.Extrapolation.HoldLastPoint, tableOnFile = false);
  Modelica.Blocks.Logical.Switch chosen(u1 = plan.y[2], u3 = -1);
  Modelica.Mechanics.Rotational.Components.Inertia load(J = 2, w(start = 0, fixed = true));
  Modelica.Blocks.Continuous.Integrator decay(u = -decay.y, y_start = 3);
  Modelica.Blocks.Continuous.Integrator pair[2](u = {pair[2].y, -pair[1].y}, y_start = {1, 0});
equation
  connect(fast.y, chosen.u2);
  connect(torque.flange, load.flange_a);
end Signals;
"""


def test_signals_in_any_order_expressions_and_tables_over_time() -> None:
    result = gl.simulate(gl.read_modelica(SIGNALS)(), 5.0, samples=101, rtol=1e-10)
    t = result.time
    assert result["decay.y"] == pytest.approx(3 * np.exp(-t), abs=1e-8)
    assert result["pair[0].y"] == pytest.approx(np.cos(t), abs=1e-8)
    rows = np.array([[0, 1, 4, 1], [1, 0, 3, 2], [3, 0, 5, 1]], float)
    late = t > 0.25 + 1e-9
    second, first = (0.5 + late * np.interp(t - 0.25, rows[:, 0], rows[:, c]) for c in (2, 1))
    away = np.abs(t - 0.25) > 1e-9  # a jump
    assert result["plan.outputs[0].y"][away] == pytest.approx(second[away], abs=1e-12)
    assert result["drag.y"] == pytest.approx(-0.5 * result["load.w"], abs=1e-12)
    fast = result["load.w"] > 0.4
    assert list(result["fast.y"]) == list(fast.astype(float))
    assert result["chosen.y"][away] == pytest.approx(np.where(fast, first, -1.0)[away], abs=1e-12)
    assert 2 * result["load.a"] == pytest.approx(result["plan.outputs[0].y"] - 0.5 * result["load.w"], abs=1e-12)


def test_signals_are_given_to_parts_within_parts() -> None:
    Whole = gl.read_modelica("""
        package P
          model Doubled
            Modelica.Blocks.Math.Gain gain(k = 2);
            output Real y = gain.y;
          end Doubled;
          model Whole
            Doubled doubled(gain(u = -decay.y)), shifted(gain(u = doubled.y + 1));
            Modelica.Blocks.Continuous.Integrator decay(u = doubled.y, y_start = 1);
          end Whole;
        end P;""")
    result = gl.simulate(Whole(), 1.0, samples=11, rtol=1e-10)
    assert result["decay.y"] == pytest.approx(np.exp(-2 * result.time), abs=1e-9)
    assert result["shifted.gain.y"] == pytest.approx(2 - 4 * np.exp(-2 * result.time), abs=1e-8)


ARRAYS = """
model Arrays "of signals: those of a motion, and of a linear system"
  import Modelica.Blocks.Sources.RealExpression;
  Modelica.Mechanics.Rotational.Sources.Move move;
  RealExpression phi(y = sin(2 * time)), w(y = 2 * cos(2 * time)), a(y = -4 * sin(2 * time));
  Modelica.Blocks.Continuous.StateSpace system(A = [-1, 2; 0, -3], B = [1, 0; 0, 1], C = [1, 1], D = [0, 0.5]);
  Modelica.Mechanics.Rotational.Components.Inertia load(J = 2);
  Real shown = system.y[1] - system.x[2];
equation
  connect(phi.y, move.u[1]);
  connect(w.y, move.u[2]);
  connect(a.y, move.u[3]);
  connect(phi.y, system.u[1]);
  connect(a.y, system.u[2]);
  connect(move.flange, load.flange_a);
end Arrays;
"""


def test_arrays_of_signals() -> None:
    result = gl.simulate(gl.read_modelica(ARRAYS)(), 2.0, samples=21, rtol=1e-11)
    assert result["load.phi"] == pytest.approx(np.sin(2 * result.time), abs=1e-9)
    A, B = np.array([[-1.0, 2.0], [0.0, -3.0]]), np.eye(2)
    drive = np.array([[0.0, 2.0], [-2.0, 0.0]])  # sine and cosine
    whole = np.block([[A, B @ np.array([[1.0, 0.0], [-4.0, 0.0]])], [np.zeros((2, 2)), drive]])
    x = np.array([expm(whole * t) @ [0.0, 0.0, 0.0, 1.0] for t in result.time])
    assert result["shown"] == pytest.approx(x[:, 0] - 2.0 * x[:, 2], abs=1e-9)


def test_files_that_are_not_there_and_models_that_are_not_in_them(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        gl.read_modelica("nowhere.mo")
    with pytest.raises(NameLookupError, match="has no model 'Secnd'"):
        gl.read_modelica(EXAMPLES, "Secnd")
    (tmp_path / "latin.mo").write_bytes(b"model M \xff end M;")
    with pytest.raises(FileError, match=r"latin\.mo cannot be read"):
        gl.read_modelica(tmp_path / "latin.mo")


def test_classes_are_pickled_as_their_text() -> None:
    Chain = gl.read_modelica(LANGUAGE, "Chain")
    again, known = (gl.simulate(model, 0.1, samples=2) for model in (pickle.loads(pickle.dumps(Chain(n=2))), Chain(n=2)))
    assert again["stage[1].body.w"] == pytest.approx(known["stage[1].body.w"])


def test_sums_over_an_index() -> None:
    """A comprehension as the only argument of a function: 1 + 4 + 9, and the largest of 3 - k."""
    text = "model Sums Real x = sum(k * k for k in 1:3); Real y = max(3 - k for k in 1:3); end Sums;"
    result = gl.simulate(gl.read_modelica(text)(), 1.0, samples=2)
    assert (result["x"][0], result["y"][0]) == (14.0, 2.0)


@pytest.mark.parametrize(
    ("declared", "used", "expected"),
    [
        ("block Sine parameter Real freqHz = 2; parameter Real f = 3; end Sine;", "a.freqHz", 2.0),
        ("block Limiter parameter Real uMax = 5; Real y_max; equation y_max = 7; end Limiter;", "a.uMax", 5.0),
        ("block Move Real u; Real phi_ref; equation u = 4; phi_ref = 7; end Move;", "a.u", 4.0),
        ("block AngleToTorqueAdaptor Real phi; equation phi = 6; end AngleToTorqueAdaptor;", "a.phi", 6.0),
        ("block MultiStateSpace Real y; equation y = 8; end MultiStateSpace;", "a.y", 8.0),
    ],
)
def test_classes_of_the_text_that_are_named_as_those_of_the_library_have_names_of_their_own(
    declared: str, used: str, expected: float
) -> None:
    kind = declared.split()[1]
    model = gl.read_modelica(f"package P {declared} model M {kind} a; Real z; equation z = {used}; end M; end P;")
    assert gl.simulate(model(), t_end=1.0, samples=2)["z"][-1] == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("model M Real max_speed; Real y; equation max_speed = time; y = maxSpeed; end M;", "nothing is called 'maxSpeed' here"),
        ("model A Real max_w = time; end A; model M A a; Real y = a.maxW; end M;", "A has no 'maxW'"),
        (
            "model M Modelica.Mechanics.Rotational.Components.Inertia maxJ(J = 1) if false; "
            "Modelica.Mechanics.Rotational.Components.Inertia max_j(J = 1); Real y = maxJ.w; end M;",
            "maxJ.w is absent",
        ),
    ],
)  # fmt: skip
def test_only_the_library_has_names_in_two_spellings(text: str, said: str) -> None:
    with pytest.raises(ModelicaError, match=said):
        gl.compile(gl.read_modelica(text)())


def test_a_class_of_the_text_has_the_names_of_its_base_in_the_library() -> None:
    model = gl.read_modelica("""
        model M
          extends Modelica.Mechanics.Rotational.Interfaces.PartialTwoFlangesAndSupport(useSupport = true);
          Real y = if useSupport then time else 0;
        equation
          flange_a.phi = time; flange_a.phi = flange_b.phi; support.phi = 0;
        end M;
    """)
    assert gl.simulate(model(), t_end=2.0, samples=2)["y"][-1] == 2.0


def test_events_of_parameters_are_none() -> None:
    model = gl.read_modelica(
        "model M parameter Real x = 2; parameter Real p = noEvent(if x > 1 then 3 else 4); Real y = p; end M;"
    )
    system = gl.compile(model())
    assert [system.simulate(1.0, samples=2, parameters={"x": x})["y"][-1] for x in (2.0, 0.5)] == [3.0, 4.0]


def test_a_motion_from_point_to_point_has_arrays_of_one_axis() -> None:
    text = "model M Modelica.Blocks.Sources.KinematicPTP p(deltaq = {4}, qd_max = {2}, qdd_max = {4}); Real y = p.y[1]; end M;"
    y = gl.simulate(gl.read_modelica(text)(), t_end=3.0, times=[0.25, 1.0, 2.25, 3.0])["y"]
    assert y.tolist() == [4.0, 0.0, -4.0, 0.0]
    with pytest.raises(ModelicaError, match=r"line 1, column \d+: .*one element, as in \{1\}, for one axis"):
        gl.compile(gl.read_modelica(text.replace("{4}", "{4, 1}", 1))())
