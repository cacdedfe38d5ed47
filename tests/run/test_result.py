"""Access to everything in a run: derivatives, aliases, what was not integrated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.run.result import SimulatedResult

c = gl.connect


class Drive(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.load = gp.Torque(tau=6.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.gear = gp.IdealGear(ratio=-2.0)
        return [
            c(self.torque.flange, self.motor.flange_a),
            c(self.motor.flange_b, self.gear.flange_a),
            c(self.gear.flange_b, self.load.flange_a),
        ]


class Pulled(Drive):
    """With an unbound torque on the load."""

    def assemble(self) -> list[Any]:
        links = super().assemble()
        self.pull = gp.Torque()
        return [*links, c(self.pull.flange, self.load.flange_b)]


RESULT = gl.compile(Drive()).simulate(2.0, samples=5)
T = np.linspace(0, 2, 5)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("motor.w", 4 * T),  # 6 = (1 + 2 / 4) der(w)
        ("der(motor.w)", 4 + 0 * T),
        ("load.w", -2 * T),
        ("der(load.phi)", -2 * T),
        ("der(der(load.phi))", -2 + 0 * T),
        ("load.phi", -(T**2)),  # an absolute angle that nothing depends on: integrated when it is asked for
        ("motor.flange_b.phi", 2 * T**2),
        ("torque.flange.tau", -6 + 0 * T),
        ("motor.flange_b.tau", -2 + 0 * T),
        ("gear.flange_a.tau", 2 + 0 * T),
        ("gear.flange_b.tau", 4 + 0 * T),
        ("load.flange_b.tau", 0 * T),  # not connected
        ("torque.tau", 6 + 0 * T),
    ],
)
def test_any_variable_by_any_of_its_names(name: str, expected: Any) -> None:
    assert RESULT[name] == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert name in RESULT


def test_only_what_is_needed_was_integrated() -> None:
    assert RESULT.states.shape == (5, 1)
    assert len(RESULT) == 1
    assert list(RESULT) == list(gl.compile(Drive()).states)


def test_a_run_with_outputs_knows_the_others_too() -> None:
    result = gl.compile(Drive(), outputs=["load.w"]).simulate(2.0, samples=5)
    assert list(result) == ["load.w"]
    assert result["motor.phi"] == pytest.approx(2 * T**2)


def test_histories_are_not_shared_with_the_caller() -> None:
    result = gl.compile(Drive()).simulate(2.0, samples=5)
    result["load.w"][:] = 99.0
    for array in (result.time, result.states):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 99.0
    assert result["motor.w"] == pytest.approx(4 * T)


def test_a_result_does_not_follow_what_was_given_for_it() -> None:
    """Angles and gradients are computed when they are read, by another run: (J + 2 / 4) der(motor.w) = 6 - 24 / 2."""

    times, t, tau, atol = T.copy(), np.array([0.0, 2.0]), np.array([24.0, 24.0]), np.array([1e-9])
    start, parameters, inputs = {"load.w": 3.0, "load.phi": 0.5}, {"motor.J": 2.5}, {"pull.tau": gl.Table(t, tau)}
    found = gl.compile(Pulled(), outputs=["motor.w"]).simulate(
        2.0, times=times, start=start, parameters=parameters, inputs=inputs, atol=atol, method="rk"
    )
    times *= 3.0
    tau *= 7.0
    atol *= 1e9
    start.update({"load.w": 8.0, "load.phi": -4.0})
    parameters["motor.J"], inputs["pull.tau"] = 9.0, gl.Table(t, -tau)
    assert found["load.phi"] == pytest.approx(0.5 + 3 * T + T**2 / 2, rel=1e-9)
    assert found["load.w"] == pytest.approx(3 + T, rel=1e-9)
    # d/dJ of 3 t / (J + 1 / 2) at t = 2
    assert found.gradient({"load.w": [0, 0, 0, 0, 1.0]}, ["motor.J"])["motor.J"] == pytest.approx(-2 / 3, rel=1e-6)


def test_a_function_that_is_no_longer_what_it_was_in_the_run_is_refused() -> None:
    """Each lambda reads the variable of the loop, which has its last value when the variables of the first run are computed."""

    system = gl.compile(Pulled(), outputs=["load.w"])
    late, bound = [], []
    for k in (2.0, 4.0):
        late.append(system.simulate(2.0, samples=5, inputs={"pull.tau": lambda t: k}))  # noqa: B023  (that is the case)
        bound.append(system.simulate(2.0, samples=5, inputs={"pull.tau": lambda t, k=k: k}))
    for run, same, k in zip(late, bound, (2.0, 4.0), strict=True):
        right = (k - 12) / 6 * T  # (2 + 4) der(w) = k - 2 * 6
        assert run["load.w"] == pytest.approx(right, rel=1e-9)
        assert same["load.phi"] == pytest.approx(right * T / 2, rel=1e-9)
        assert run["motor.w"] == pytest.approx(-2 * right, rel=1e-9)  # for which no input is read
    first = late[0]
    reads: list[Any] = [
        lambda: first["load.phi"], lambda: first["pull.tau"], lambda: first["der(load.w)"], first.energy_balance,
        lambda: first.gradient({"load.w": [0, 0, 0, 0, 1.0]}, ["load.J"]), lambda: first.at(0.3),
        lambda: system.linearize(["pull.tau"], ["load.w"], at=(first, 0.3)),
    ]  # fmt: skip
    for read in reads:
        with pytest.raises(
            ArgumentError, match=r"pull\.tau, called with t = \d\S* s, returned 4, but 2 in the run: .*: lambda t, k=k"
        ):
            read()
    more = system.simulate(3.0, samples=2, start=first)  # goes on with the function as it is now
    assert more["load.w"] == pytest.approx([-20 / 6, -28 / 6], rel=1e-6)


@pytest.mark.parametrize("since", [0.0, 0.3, 1.0, 1.9])
def test_a_function_that_has_changed_from_some_time_on_is_refused(since: float) -> None:
    k, changed = 2.0, 4.0
    system = gl.compile(Pulled(), outputs=["load.w"])
    run = system.simulate(2.0, samples=201, inputs={"pull.tau": lambda t: k if t < since else changed})
    assert run["load.phi"][-1] < 0.0
    run = system.simulate(2.0, samples=201, inputs={"pull.tau": lambda t: k if t < since else changed})
    changed = 5.0
    with pytest.raises(
        ArgumentError, match=r"^the function <lambda> of the input pull\.tau, called with t = \d\S* s, returned 5, but 4"
    ):
        run["load.phi"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("load.ww", r"the model has no variable 'load\.ww'; did you mean 'load\.w'"),
        ("typo", "the model has no variable 'typo'; "),
        ("load", "'load' is a component, no variable; name one of its variables: load.flange_a.phi"),
        ("load.J", r"the model has no variable 'load\.J'"),
        ("der(der(load.ww))", r"the model has no variable 'load\.ww'; did you mean 'load\.w'"),
    ],
)
def test_unknown_names(name: Any, message: str) -> None:
    with pytest.raises(NameLookupError, match=message):
        RESULT[name]
    assert "typo" not in RESULT
    assert 3 not in RESULT


def test_a_number_is_no_name() -> None:
    with pytest.raises(ArgumentError, match=r"result\[0\]: expected one name, such as result\['load\.w'\]"):
        RESULT[0]  # type: ignore[index]


def test_the_outputs_as_a_mapping() -> None:
    assert RESULT.keys() == list(RESULT) == list(dict(RESULT.items()))
    assert len(RESULT) == 1
    assert [name for name, history in RESULT.items() if np.array_equal(history, RESULT[name])] == RESULT.keys()


def test_values_at_a_time() -> None:
    result = gl.compile(Drive(), outputs=["load.w", "load.phi"]).simulate(2.0, samples=5)
    assert result.final == pytest.approx({"load.w": -4.0, "load.phi": -4.0})
    assert result.at(0.5) == pytest.approx({"load.w": -1.0, "load.phi": -0.25})
    assert result.at(0.7) == pytest.approx({"load.w": -1.4, "load.phi": -0.49})  # between samples, where lines would give -0.55
    for t in (-0.1, 2.1):
        with pytest.raises(ArgumentError, match=f"t is {t:g} s; the run goes from 0 to 2 s"):
            result.at(t)
    with pytest.raises(ArgumentError, match="t is None; expected a finite number of seconds"):
        result.at(None)  # type: ignore[arg-type]


def test_units() -> None:
    assert [RESULT.unit(name) for name in ("load.w", "der(load.w)", "torque.tau")] == ["rad/s", "rad/s/s", "N.m"]
    with pytest.raises(NameLookupError, match="no variable 'typo'"):
        RESULT.unit("typo")


def test_xarray() -> None:
    found = RESULT.to_xarray(["load.w", "motor.w"])
    assert found["load.w"].to_numpy() == pytest.approx(-2 * T)
    assert found["load.w"].attrs == {"units": "rad/s", "long_name": "angular velocity"}
    assert found["time"].to_numpy() == pytest.approx(T)
    assert found.attrs["model"] == "Drive"
    assert list(RESULT.to_xarray().data_vars) == RESULT.keys()
    with pytest.raises(NameLookupError, match="no variable 'typo'"):
        RESULT.to_xarray(["typo"])


def test_what_a_notebook_shows() -> None:
    text = gl.compile(Drive(), outputs=["load.w"]).simulate(2.0, samples=5)._repr_html_()
    assert "&lt;Result: 5 samples" in text
    assert "<tr><td>load.w</td><td>rad/s</td><td>0</td><td>-4</td><td>0</td><td>-4</td></tr>" in text.replace("-0<", "0<")
    many = [f"{part}.{name}" for part in ("motor", "load") for name in ("w", "phi")] * 10
    assert "and 10 more" in gl.compile(Drive(), outputs=many).simulate(1.0, samples=2)._repr_html_()


def test_all_variables_are_computed_by_one_program(monkeypatch: pytest.MonkeyPatch) -> None:
    from gearlib.run import scene

    result, built = gl.compile(Drive()).simulate(2.0, samples=5), []
    usual = scene.build
    monkeypatch.setattr(scene, "build", lambda *given, **options: built.append(1) or usual(*given, **options))
    record = result.record()
    assert len(built) <= 3  # of the run with the angle: its derivatives and the variables; of this run: the variables
    for name, place, sign in zip(record.names, record.columns, record.signs, strict=True):
        assert np.array_equal(sign * record.data[:, place], result[name]), name
    assert record.data.shape[1] < len(record.names) / 1.5


def test_data_frame() -> None:
    frame = RESULT.to_dataframe(["load.w", "der(motor.w)"])
    assert list(frame.columns) == ["load.w", "der(motor.w)"]
    assert frame.index.name == "time"
    assert frame["load.w"].to_numpy() == pytest.approx(-2 * T)
    assert list(RESULT.to_dataframe().columns) == list(RESULT)
    with pytest.raises(NameLookupError, match="no variable 'typo'"):
        RESULT.to_dataframe(["typo"])


def test_plot() -> None:
    import matplotlib.pyplot as plt

    speed, acceleration = RESULT.plot("load.w", "der(load.w)")  # an axis for each unit
    assert speed.lines[0].get_ydata() == pytest.approx(-2 * T)
    assert acceleration.get_xlabel() == "time, s"
    assert "rad/s" in speed.get_ylabel()
    assert RESULT.plot("motor.w", axes=speed) is speed
    plt.close("all")
    with pytest.raises(NameLookupError, match="no variable 'typo'"):
        RESULT.plot("typo")
    plt.close("all")


def test_statistics_and_text() -> None:
    assert RESULT.stats["method"] == "exact"
    assert RESULT.stats["why"] == "the scene is linear and time-invariant"
    assert repr(RESULT) == "<Result: 5 samples, 0 .. 2 s, 1 states, exact>"


def test_long_turning_keeps_its_digits() -> None:
    """After 1e6 rad the deflection of the shaft still has all its digits."""

    class Shaft(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"w": 1e4}), gp.Inertia(J=1.0, start={"w": 1e4})
            self.shaft = gp.Spring(c=1e6, start={"phi_rel": 1e-6})
            return [c(self.a.flange_b, self.shaft.flange_a), c(self.shaft.flange_b, self.b.flange_a)]

    system = gl.compile(Shaft())
    result = system.simulate(100.0, samples=11)
    assert result["a.phi"][-1] == pytest.approx(1e6, rel=1e-9)
    assert result["shaft.phi_rel"] == pytest.approx(1e-6 * np.cos(np.sqrt(2e6) * result.time), abs=1e-6 * 1e-6)


class Contradiction(gl.Component):
    """y = 1 makes the relation hold, and then y is -1."""

    x = gl.Variable("1", "grows")
    y = gl.Variable("1", "has no value")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), 1.0), gl.Eq(self.y, gl.Piecewise((-1.0, self.x + self.y > 0.5), (1.0, True)))]


def test_an_output_that_contradicts_itself_is_named() -> None:
    result = gl.simulate(Contradiction(), t_end=2.0, samples=5, outputs=["x", "y"])
    with pytest.raises(gl.GearlibError, match=r"relation of Contradiction holds if and only if it does not at t = 0 s"):
        result["y"]


class Shafts(gl.Component):
    """Shafts that have nothing to do with each other; the last one breaks down if it is integrated."""

    breaks = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torques = [gp.Torque(tau=float(k + 1)) for k in range(6)]
        self.shafts = [gp.Inertia(J=1.0) for _ in range(6)]
        found = [c(t.flange, s.flange_a) for t, s in zip(self.torques, self.shafts, strict=True)]
        if self.breaks:
            self.last = gp.Inertia(J=1.0, start={"w": 1.0})
            self.runaway = gp.QuadraticSpeedDependentTorque(tau_nominal=1.0, w_nominal=1.0)  # der(w) = w |w|: infinite at 1 s
            found.append(c(self.last.flange_b, self.runaway.flange))
        return found


@pytest.mark.parametrize("breaks", [False, True])
def test_many_variables_one_by_one_do_not_integrate_as_often(breaks: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    result = gl.compile(Shafts(breaks=breaks), outputs=["shafts[0].w"]).simulate(2.0, samples=5)
    count = []
    again = SimulatedResult._again
    monkeypatch.setattr(SimulatedResult, "_again", lambda self, *more: (count.append(1), again(self, *more))[1])
    for k in range(6):
        assert result[f"shafts[{k}].w"] == pytest.approx((k + 1) * T, rel=1e-12)
    assert result["shafts[3].phi"] == pytest.approx(2 * T**2, rel=1e-9)
    assert len(count) == (7 if breaks else 2)  # of the former, one ends where the last shaft breaks down


class Counter(gl.Component):
    """Two discrete variables, one of which moves the state; a variable that is always zero."""

    k = gl.Parameter("any", default=2.0)
    x, y = gl.Variable("any", start=0.0), gl.Variable("any")
    n, m = gl.Discrete(start=1.0), gl.Discrete(start=3.0)

    def assemble(self) -> list[Any]:
        self.fixed = gp.Fixed()
        return []

    def equations(self) -> list[Any]:
        late = gl.time > 0.6
        return [
            gl.Eq(gl.der(self.x), self.k * self.n),
            gl.Eq(self.y, self.m * self.x),
            gl.When(late, gl.Eq(self.n, 2.0)),
            gl.When(late, gl.Eq(self.m, 4.0)),
        ]


def test_what_a_run_did_not_need_of_discrete_variables_is_refused_by_name() -> None:
    """They change at events, at which a run that does not need them does not look."""
    few = gl.compile(Counter(), outputs=["x"]).simulate(1.0, samples=3)
    assert few["n"].tolist() == [1.0, 1.0, 2.0]
    with pytest.raises(
        NameLookupError, match=r"^the discrete variable m was not needed in this run; name it in outputs=\[\.\.\.\]$"
    ):
        few["m"]
    with pytest.raises(
        NameLookupError, match=r"^the discrete variables m\b.* were not needed in this run; name them in outputs=\[\.\.\.\]$"
    ):
        few["y"]
    every = gl.compile(Counter()).simulate(1.0, samples=3)
    assert every["m"].tolist() == [3.0, 3.0, 4.0]
    assert every["y"] == pytest.approx([0.0, 3.0, 4.0 * 2.8])


def test_derivatives_of_what_has_none() -> None:
    run = gl.compile(Counter(), outputs=["x"]).simulate(1.0, samples=3, sensitivities=["k"])
    assert run.sensitivity("x", "k") == pytest.approx([0.0, 0.5, 1.4])
    assert run.sensitivity("fixed.flange.tau", "k").tolist() == [0.0, 0.0, 0.0]
    with pytest.raises(ArgumentError, match=r"^n is a discrete variable, which changes in steps: it has no sensitivity$"):
        run.sensitivity("n", "k")
    with pytest.raises(
        ArgumentError, match=r"^weights names n, a discrete variable, which changes in steps: it has no derivative$"
    ):
        run.gradient({"n": np.ones(3)}, ["k"])
    for weights, names, empty in (({}, ["k"], "weights"), ({"x": np.ones(3)}, [], "names")):
        with pytest.raises(ArgumentError, match=f"^{empty} is empty: there is nothing to differentiate$"):
            run.gradient(weights, names)
    with pytest.raises(ArgumentError, match=r"^weights\['x'\] has the shape \(2,\); expected 3 numbers, one per sample$"):
        run.gradient({"x": np.ones(2)}, ["k"])


def test_a_plot_of_nothing_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"^plot\(\) needs the names of variables$"):
        gl.compile(Drive(), outputs=[]).simulate(1.0, samples=3).plot()


class Swings(gl.Component):
    """Two oscillators that have nothing to do with each other."""

    a, b = gl.Variable("1", start=1.0), gl.Variable("1", start=1.0)
    da, db = gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), self.da), gl.Eq(gl.der(self.da), -gl.sin(3 * self.a)),
            gl.Eq(gl.der(self.b), self.db), gl.Eq(gl.der(self.db), -4 * gl.sin(self.b)),
        ]  # fmt: skip


@pytest.mark.parametrize("atol", [None, 1e-2, 1e-9])
def test_a_run_is_repeated_to_the_same_tolerance(atol: float | None) -> None:
    """For what it did not compute: the same steps as of a run that was asked for it."""
    options: Any = {"samples": 5, "method": "rk5", "rtol": 1e-3} | ({} if atol is None else {"atol": atol})
    later = gl.compile(Swings(), outputs=["a"]).simulate(6.0, **options)["b"]
    at_once = gl.compile(Swings(), outputs=["a", "b"]).simulate(6.0, **options)["b"]
    assert later.tolist() == at_once.tolist()
