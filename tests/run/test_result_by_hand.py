"""What a result says of itself: samples, records, notebooks, pictures over time, statistics of segments, and warnings of rare samples."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, GearlibWarning
from gearlib.files.contents import Record
from gearlib.run.result import Statistics
from gearlib.stored_result import StoredResult
from tests.run.test_constrained import released


class Two(gl.Component):
    """x falls from 3 by 2 per second, y is its opposite, z its integral; one number at 1 s, and what is always zero."""

    rate = gl.Parameter("any", default=2.0)
    twice = gl.Parameter("any", default=lambda s: 2 * s.rate)
    x, y, z = (
        gl.Variable("m", "a length", start=3.0),
        gl.Variable("m", "its opposite"),
        gl.Variable("any", "integral", start=0.0),
    )
    nothing, late = gl.Variable("any"), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -self.rate),
            gl.Eq(self.y, -self.x),
            gl.Eq(gl.der(self.z), self.x),
            gl.Eq(self.nothing, 0.0),
            gl.When(gl.time >= 1.0, gl.Eq(self.late, self.twice)),
        ]


@cache
def system() -> gl.System:
    return gl.compile(Two(), outputs=["x", "late"])


@cache
def run() -> gl.Result:
    return system().simulate(2.0, samples=5, method="rk")


X = np.array([3.0, 2.0, 1.0, 0.0, -1.0])


def test_samples_and_ends() -> None:
    assert run().final == pytest.approx({"x": -1.0, "late": 4.0}, abs=1e-12)
    assert run().at(0.5) == pytest.approx({"x": 2.0, "late": 0.0})
    assert run().at(1.25) == pytest.approx({"x": 0.5, "late": 4.0})
    assert run().at(0) == pytest.approx({"x": 3.0, "late": 0.0})
    for t in (-1e-9, 2.0 + 1e-9):
        with pytest.raises(ArgumentError, match=rf"^t is {t:g} s; the run goes from 0 to 2 s$"):
            run().at(t)
    assert (len(run()), run().keys(), list(run().items())[1][0]) == (2, ["x", "late"], "late")
    assert ["z" in run(), "late" in run(), "der(x)" in run(), "rate" in run(), 1 in run()] == [True, True, True, False, False]


def test_units_and_descriptions() -> None:
    assert [run().unit(name) for name in ("x", "der(x)", "late", "y")] == ["m", "m/s", "", "m"]
    record = run().record(["x", "der(x)", "late", "nothing", "x"])
    assert record.names == ("x", "der(x)", "late", "nothing")
    assert record.units == ("m", "m/s", "", "any")
    assert record.descriptions == ("a length", "derivative of: a length", "", "")


def test_a_record_holds_each_history_once() -> None:
    """Of opposites one, with its sign; and all parameters, those for start values among them."""
    assert run().record(["y"]).history("y") == pytest.approx(-X, abs=1e-12)
    assert run().record(["y", "x"]).history("x") == pytest.approx(X, abs=1e-12)
    record = run().record(["y", "x", "nothing", "late", "z"])
    assert record.data.shape == (5, 4)
    x, y = (record.names.index(name) for name in "xy")
    assert record.columns[x] == record.columns[y]
    assert record.signs[x] == -record.signs[y]
    assert set(record.signs) == {1, -1}
    assert record.history("x") == pytest.approx(X, abs=1e-12)
    assert record.history("y") == pytest.approx(-X, abs=1e-12)
    assert record.history("nothing").tolist() == [0.0] * 5
    assert record.history("late").tolist() == [0.0, 0.0, 4.0, 4.0, 4.0]
    t = run().time
    assert record.history("z") == pytest.approx(3 * t - t**2, abs=1e-9)
    assert record.parameters == {"rate": 2.0, "twice": 4.0, "start(x)": 3.0, "start(z)": 0.0}
    assert record.model == "Two"
    assert {k: record.options[k] for k in ("method", "rtol", "t_start")} == {"method": "rk", "rtol": 1e-6, "t_start": 0.0}
    assert [t for t, _ in record.events] == [1.0]
    assert run().record().names == ("x", "late")
    everything = gl.compile(Two()).simulate(2.0, samples=5, method="rk").record().names
    assert {"x", "y", "z", "nothing", "late"} <= set(everything)
    assert len(everything) == len(set(everything))


def test_a_line_of_a_notebook() -> None:
    """First, least, greatest and last value of each output."""
    time, data = np.array([0.0, 1.0, 2.0]), np.array([[2.0, 1.0], [-5.0, 1.0], [4.0, 1.0]])
    names, ones = ("a<b", "c"), (1, 1)
    stored = StoredResult(Record(time, data, names, (0, 1), ones, ("N.m", ""), ("", ""), "Pair", {}, {"method": "ida"}, []))
    assert stored._repr_html_() == (
        "<p>&lt;Result: 3 samples, 0 .. 2 s, 2 variables of Pair, ida&gt;</p><table><thead><tr><th>variable</th><th>unit</th>"
        "<th>first</th><th>least</th><th>greatest</th><th>last</th></tr></thead><tbody>"
        "<tr><td>a&lt;b</td><td>N.m</td><td>2</td><td>-5</td><td>4</td><td>4</td></tr>"
        "<tr><td>c</td><td></td><td>1</td><td>1</td><td>1</td><td>1</td></tr></tbody></table>"
    )


@pytest.mark.parametrize(("count", "more"), [(30, ""), (31, "<p>and 1 more</p>"), (35, "<p>and 5 more</p>")])
def test_thirty_lines_of_a_notebook_at_most(count: int, more: str) -> None:
    names, none = tuple(f"v{k}" for k in range(count)), ("",) * count
    stored = StoredResult(Record(np.zeros(2), np.zeros((2, count)), names, tuple(range(count)), (1,) * count, none, none))
    html = stored._repr_html_()
    assert html.count("<tr><td>") == 30
    assert html.endswith(f"</table>{more}")


def test_histories_for_plots() -> None:
    found = run().history("x", "stiffer")
    assert (found.name, found.unit, found.run) == ("x", "m", "stiffer")
    assert found.values == pytest.approx(X, abs=1e-12)
    assert run().history("late").run == ""
    with pytest.raises(ArgumentError, match=r"^run is 3; expected"):
        run().history("x", 3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"before": 3.0}, r"^other is 3\.0 for 'before'; expected a result, or results by name$"),
        (3.0, r"^other is 3\.0; expected"),
    ],
)
def test_what_is_compared_must_be_a_run(other: Any, said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        run().plot("x", other=other)


def test_runs_that_are_compared() -> None:
    import matplotlib.pyplot as plt

    slow = system().simulate(2.0, samples=3, method="rk", parameters={"rate": 1.0})
    drawn = {label: run().plot("x", other=other) for label, other in (("other", slow), ("slower", {"slower": slow}))}
    for label, axes in drawn.items():
        first, second = axes.lines[:2]
        assert first.get_ydata() == pytest.approx(X, abs=1e-12)
        assert second.get_ydata() == pytest.approx([3.0, 2.0, 1.0])
        assert label in second.get_label()
    silent = run().plot("x", other=slow, events=False)
    assert len(silent.lines) < len(drawn["other"].lines)
    plt.close("all")


class Pair(gl.Component):
    """Two wheels in mesh."""

    def assemble(self) -> list[Any]:
        self.drive, self.a, self.b = gp.Torque(tau=1.0), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.mesh = gp.ExternalMesh(r_a=0.02, r_b=0.04, c=1e6, d=1e2)
        return [
            gl.connect(self.drive.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.b.flange_a),
        ]


def test_times_of_a_picture_lie_in_the_run() -> None:
    found = gl.compile(Pair()).simulate(0.1, samples=3, t_start=0.05)
    for t in (0.04, 0.11, [0.06, 0.11], [0.04, 0.06]):
        with pytest.raises(ArgumentError, match=r"^t is .*; the run goes from 0\.05 to 0\.1 s$"):
            found.gear_view("mesh", t=t)


def test_a_picture_moves_in_a_hundred_steps_over_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or at the times that are asked for, with values on lines between the samples."""
    asked: list[Any] = []

    def in_motion(component: Any, part: Any, times: Any, values: Any, gears: Any) -> Any:
        asked.append((part, np.asarray(times), values("a.w")))
        return "picture"

    monkeypatch.setattr("gearlib.language.gears_of.in_motion", in_motion)
    found = gl.compile(Pair()).simulate(0.1, samples=3, t_start=0.05)
    assert found.gear_view("mesh") == "picture"
    part, times, speeds = asked.pop()
    assert part == "mesh"
    assert times.tolist() == np.linspace(0.05, 0.1, 100).tolist()
    assert speeds == pytest.approx(np.interp(times, found.time, found["a.w"]))
    found.gear_view(t=[0.05, 0.1])
    found.gear_view(t=0.075)
    assert [np.ravel(times).tolist() for _, times, _ in asked] == [[0.05, 0.1], [0.075]]


def test_statistics_that_cost_a_run() -> None:
    """The residual is computed when it is read, once; nothing else is made up, and a copy is a plain dictionary."""
    found = Statistics(steps=3)
    counted: list[int] = []

    def check() -> None:
        counted.append(1)
        found["energy_residual"] = 0.25

    for key in ("energy_residual", "attempts"):
        with pytest.raises(KeyError, match=key):
            found[key]
    found.check_energy = check
    with pytest.raises(KeyError, match="attempts"):
        found["attempts"]
    assert counted == []
    assert [found["energy_residual"], found["energy_residual"], found["steps"]] == [0.25, 0.25, 3]
    assert counted == [1]
    import pickle

    assert type(pickle.loads(pickle.dumps(Statistics(steps=3)))) is dict


class Waves(gl.Component):
    """A fast wave that nothing drives, and a mean that follows it."""

    omega = gl.Parameter("any", default=40 * np.pi)
    u, v, mean = gl.Variable("any", start=1.0), gl.Variable("any", start=0.0), gl.Variable("any", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.u), self.omega * self.v), gl.Eq(gl.der(self.v), -self.omega * self.u),
            gl.Eq(gl.der(self.mean), self.u - self.mean),
        ]  # fmt: skip


@cache
def waves() -> gl.System:
    return gl.compile(Waves(), outputs=["u", "mean"])


def test_rare_samples_are_told(recwarn: pytest.WarningsRecorder) -> None:
    """20 Hz at 23 samples per second; not where all steps are samples, which is so with a method of several steps over a wave."""
    rare = waves().simulate(1.0, samples=24, method="exact")
    with pytest.warns(GearlibWarning, match=r"^u is sampled too rarely: .*more samples than 24$"):
        rare.check_sampling("u")
    with pytest.warns(GearlibWarning, match="u is sampled too rarely"):
        rare.check_sampling("u", 0.2, 0.8)
    often = waves().simulate(1.0, samples=700, method="rk")
    assert often.stats["steps"] > 100
    assert often.stats["steps"] < 700
    often.check_sampling("u")
    often.check_sampling("u", 0.5, 0.501)  # however few they are
    with pytest.raises(ArgumentError, match=r"^the interval holds 1 samples"):
        waves().simulate(1.0, samples=40, method="rk").check_sampling("u", 0.5, 0.52)
    assert not [one for one in recwarn if issubclass(one.category, GearlibWarning)]


def test_intervals_for_waves_hold_eight_samples() -> None:
    found = waves().simulate(1.0, samples=201, method="exact")
    found.check_sampling("mean", 0.965, 1.0)
    found.check_sampling("mean", 0.0, 0.035)
    for interval, count in (((0.9651, None), 7), ((0.966, None), 7), ((None, 0.0349), 7), ((0.5, 0.5), 1), ((0.6, 0.5), 0)):
        with pytest.raises(ArgumentError, match=rf"^the interval holds {count} samples; it takes 8 to see waves$"):
            found.check_sampling("mean", *interval)
    with pytest.raises(ArgumentError, match=r"^t_start is 'soon'; expected a finite number of seconds"):
        found.check_sampling("mean", "soon")  # type: ignore[arg-type]


def test_a_result_of_a_file_is_not_judged() -> None:
    names = ("a",)
    stored = StoredResult(Record(np.zeros(2), np.zeros((2, 1)), names, (0,), (1,), ("",), ("",)))
    stored.check_sampling("a", 0.0, 1.0)
    with pytest.raises(ArgumentError, match=r"^name is 3; expected"):
        stored.check_sampling(3)  # type: ignore[arg-type]


def test_sensitivities_that_were_not_asked_for() -> None:
    """What there is instead is named."""
    with pytest.raises(ArgumentError) as refused:
        run().sensitivity("x", "rate")
    assert str(refused.value) == (
        "the run was not asked for sensitivities with respect to 'rate' (it has none): simulate(..., sensitivities=['rate'])"
    )
    found = system().simulate(2.0, samples=3, method="rk", sensitivities=["rate", "start(x)"])
    assert found.sensitivity("x", "rate") == pytest.approx([0.0, -1.0, -2.0])
    assert found.sensitivity("y", "start(x)") == pytest.approx([-1.0] * 3)
    assert found.sensitivity("nothing", "rate").tolist() == [0.0] * 3
    with pytest.raises(ArgumentError) as refused:
        found.sensitivity("x", "twice")
    assert str(refused.value) == (
        "the run was not asked for sensitivities with respect to 'twice' (it has rate, start(x)): simulate(..., "
        "sensitivities=['twice'])"
    )


def test_states_that_were_not_integrated_are_found_beside_the_run() -> None:
    """z, the integral of 3 - 2 t, without another run; which is of a single segment."""
    own: Any = system().simulate(2.0, samples=5, method="rk")
    again, repeated = own._run, []
    own._run = lambda *given: repeated.append(given) or again(*given)
    assert own["z"] == pytest.approx(3.0 * own.time - own.time**2, abs=1e-12)
    assert repeated == []
    assert "segments" not in own.stats


@pytest.mark.parametrize(("atol", "kept"), [(1e-4, 1e-4), (None, None), ([1e-4], None)])
def test_tolerances_of_a_run_that_is_repeated_with_more_states(atol: Any, kept: float | None) -> None:
    """One number holds for all of them; numbers for each state do not fit others."""

    class Late(gl.Component):
        """y follows from x, and from itself; no integral."""

        x, y = gl.Variable("any", start=1.0), gl.Variable("any", start=0.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), self.x - self.y)]

    own: Any = gl.compile(Late(), outputs=["x"]).simulate(1.0, samples=3, method="rk", rtol=1e-8, atol=atol)
    assert own["y"] == pytest.approx(own.time * np.exp(-own.time), abs=1e-3)
    assert own._extended.request.atol == kept
    assert own.sampled_at(np.array([0.5]))["x"] == pytest.approx([np.exp(-0.5)], abs=1e-3)


def test_segments_are_joined_where_one_ends_and_the_next_begins() -> None:
    """The pendulum of unit length turns through several sets of states: one number for each sample."""
    turned: Any = released(0.3, 9.0).simulate(2.0, samples=41, rtol=1e-9)
    assert len(turned._segments) > 2
    assert [len(turned[name]) for name in ("x", "y", "der(x)")] == [41] * 3
    assert turned["x"] ** 2 + turned["y"] ** 2 == pytest.approx(np.ones(41), abs=1e-9)
    assert turned.stats["segments"] == len(turned._segments)
