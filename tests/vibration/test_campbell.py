"""Campbell diagrams: modes that change places as speed grows, crossings by hand, texts, and their progress."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.vibration.campbell import Campbell, Crossing


class Rotor(gl.Component):
    """A disc on a shaft that is fixed at its other end, driven by a torque."""

    def assemble(self) -> list[Any]:
        self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=400.0, d=2.0), gp.Inertia(J=1.0)
        self.torque = gp.Torque()
        return [
            gl.connect(self.ground.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.disc.flange_a, self.torque.flange),
        ]


@pytest.mark.parametrize("varies", [False, True])
def test_progress_is_told_by_speeds(varies: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.progress.APART", 0.0)
    told: list[float] = []
    more: Any = {"parameters": lambda w: {"disc.J": 1.0 + 0.01 * w}} if varies else {}
    gl.campbell(gl.compile(Rotor()), [0.0, 10.0, 40.0], [2.0], progress=lambda f, _: told.append(f), **more)
    assert told == [0.0, 0.25, 1.0, 1.0]


def test_progress_of_a_harmonic_balance_is_told_by_frequencies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.progress.APART", 0.0)
    told: list[float] = []
    drive: Any = {"torque.tau": lambda phase, w: np.cos(phase)}
    gl.harmonic_balance(
        gl.compile(Rotor()), 15.0, 25.0, inputs=drive, outputs=["disc.w"], harmonics=1, progress=lambda f, _: told.append(f)
    )
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    assert len(told) > 5


class TwoRotors(gl.Component):
    """Two discs on shafts of their own; the first one grows heavier, and a third body turns freely."""

    J = gl.Parameter("kg.m2", default=1.0)

    def assemble(self) -> list[Any]:
        self.ground, self.free = gp.Fixed(), gp.Inertia(J=1.0)
        self.shaft = [gp.SpringDamper(c=400.0, d=0.4), gp.SpringDamper(c=250.0, d=0.0)]
        self.disc = [gp.Inertia(J=self.J), gp.Inertia(J=1.0)]
        pairs = list(zip(self.shaft, self.disc, strict=True))
        ends = [gl.connect(shaft.flange_b, disc.flange_a) for shaft, disc in pairs]
        return [gl.connect(self.ground.flange, *(shaft.flange_a for shaft, _ in pairs)), *ends]


def heavy(w: float) -> dict[str, float]:
    return {"J": 1.0 + 0.01 * w}


def natural(w: float) -> float:
    return float(np.sqrt(400.0 / (1 + 0.01 * w)))


@pytest.fixture(scope="module")
def rotors() -> gl.System:
    return gl.compile(TwoRotors())


def test_modes_are_followed_through_each_other_and_crossings_are_exact(rotors: gl.System) -> None:
    """From 60 rad/s on the first disc is the slower one of the two."""
    grid = np.array([0.0, 5.0, 15.0, 50.0, 70.0, 110.0])
    found = gl.campbell(rotors, grid, {"once": 1.0, "rarely": 0.2, "often": 20.0}, parameters=heavy)
    first = [natural(w) for w in grid]
    hertz = np.column_stack([np.full(len(grid), np.sqrt(250.0)), first]) / (2 * np.pi)
    assert found.frequencies == pytest.approx(hertz, rel=1e-9)
    expected = 0.4 / (2 * np.sqrt(400.0 * (1 + 0.01 * grid)))
    assert found.damping == pytest.approx(np.column_stack([np.zeros(len(grid)), expected]), abs=1e-9)
    assert found.modes.tolist() == [[1, 2]] * 4 + [[2, 1]] * 2  # mode 0 turns freely
    by_hand = [
        ("often", 1, np.sqrt(250.0) / 20, 0.0), ("often", 2, float(brentq(lambda w: natural(w) - 20 * w, 0, 5)), 0.4),
        ("once", 1, np.sqrt(250.0), 0.0), ("once", 2, float(brentq(lambda w: natural(w) - w, 5, 50)), 0.4),
        ("rarely", 1, float(brentq(lambda w: natural(w) - 0.2 * w, 5, 110)), 0.4), ("rarely", 2, np.sqrt(250.0) / 0.2, 0.0),
    ]  # fmt: skip
    assert [(c.order, c.mode) for c in found.crossings] == [(name, mode) for name, mode, w, _ in by_hand if w < 110]
    for c, (name, _, w, d) in zip(found.crossings, [x for x in by_hand if x[2] < 110], strict=True):
        order = {"once": 1.0, "rarely": 0.2, "often": 20.0}[name]
        assert c.speed == pytest.approx(w, rel=1e-8)
        assert c.frequency == pytest.approx(order * w / (2 * np.pi), rel=1e-8)
        assert c.damping == pytest.approx(d / (2 * np.sqrt(400.0 * (1 + 0.01 * w))), rel=1e-6, abs=1e-9)


def test_crossings_of_a_mode_that_jumps_over_another_between_two_speeds_are_its_own(rotors: gl.System) -> None:
    """A shaft that softens near 80 rad/s, from 100 to 10 rad/s, past the 50 rad/s of the other; or is overdamped there for a while."""

    def first(w: float) -> float:
        return float(100 - 45 * (1 + np.tanh((w - 80) / 2)))

    def softer(w: float) -> dict[str, float]:
        return {"shaft[0].c": first(w) ** 2, "shaft[0].d": 0.0, "shaft[1].c": 2500.0}

    found = gl.campbell(rotors, [1.0, 100.0], [1.0], parameters=softer)
    by_hand = float(brentq(lambda w: first(w) - w, 1, 100))
    assert [c.speed for c in found.crossings] == pytest.approx([50.0, by_hand], rel=1e-9)
    assert [c.frequency for c in found.crossings] == pytest.approx([50 / (2 * np.pi), by_hand / (2 * np.pi)], rel=1e-8)
    with pytest.raises(
        ArgumentError, match=r"^mode 2 at 1 rad/s does not oscillate at 52\.8571 rad/s; take speeds in between$"
    ):
        gl.campbell(rotors, [1.0, 100.0], [1.0], parameters=lambda w: {**softer(w), "shaft[0].d": 500.0 * (2 < w < 99)})


def test_a_mode_that_is_overdamped_at_some_speeds_keeps_its_column(rotors: gl.System) -> None:
    """The first disc, with 10 rad/s, from 30 to 70 rad/s; the other, with 50 rad/s, does not take its place."""

    def damped(w: float) -> dict[str, float]:
        return {"shaft[0].c": 100.0, "shaft[0].d": 100.0 if 30 < w < 70 else 0.0, "shaft[1].c": 2500.0}

    nan = np.nan
    found = gl.campbell(rotors, [1.0, 14.0, 40.0, 60.0, 80.0], {"once": 1.0, "rarely": 0.1}, parameters=damped)
    expected = np.array([[10.0, 50.0], [10.0, 50.0], [nan, 50.0], [nan, 50.0], [10.0, 50.0]]) / (2 * np.pi)
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-9)
    np.testing.assert_allclose(found.damping, 0 * expected, atol=1e-9)
    assert found.modes.tolist() == [[1, 2], [1, 2], [-1, 1], [-1, 1], [1, 2]]
    assert [(c.order, c.mode) for c in found.crossings] == [("once", 1), ("once", 1)]
    assert [c.speed for c in found.crossings] == pytest.approx([10.0, 50.0], rel=1e-9)
    assert found.highest == pytest.approx(1.1 * 50 / (2 * np.pi))
    later = gl.campbell(rotors, [40.0, 60.0, 80.0], [0.1], parameters=damped)
    np.testing.assert_allclose(later.frequencies, expected[2:, ::-1], rtol=1e-9)
    assert later.highest == pytest.approx(1.1 * 10 / (2 * np.pi))
    axes = later.plot()
    labels = {text.get_text(): text.xy for text in axes.texts}
    assert labels["1"] == pytest.approx((80 * 30 / np.pi, 10 / (2 * np.pi)))  # each mode where its curve begins
    plt.close(axes.figure)


class Clutched(gl.Component):
    """A disc on a shaft to the ground, and two on a shaft of their own, which a clutch can hold to the first."""

    f = gl.Parameter("1", default=1.0)

    def assemble(self) -> list[Any]:
        self.ground, self.clutch = gp.Fixed(), gp.Clutch(fn_max=50.0, f_normalized=self.f)
        self.shaft, self.disc = [gp.Spring(c=100.0), gp.Spring(c=400.0)], [gp.Inertia(J=1.0) for _ in range(3)]
        return [
            gl.connect(self.ground.flange, self.shaft[0].flange_a),
            gl.connect(self.shaft[0].flange_b, self.disc[0].flange_a),
            gl.connect(self.disc[0].flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.disc[1].flange_a),
            gl.connect(self.disc[1].flange_b, self.shaft[1].flange_a),
            gl.connect(self.shaft[1].flange_b, self.disc[2].flange_a),
        ]


def test_modes_are_followed_where_a_clutch_sticks_at_some_speeds() -> None:
    """Above 20 rad/s: one speed less, and the free motion of the two discs is another vibration."""
    found = gl.campbell(gl.compile(Clutched()), [1.0, 14.0, 40.0], [1.0], parameters=lambda w: {"f": float(w > 20)})
    stuck = np.sqrt(np.linalg.eigvals(np.array([[250.0, -200.0], [-400.0, 400.0]])))
    hertz = np.array([[10.0, np.sqrt(800.0)]] * 2 + [sorted(stuck)]) / (2 * np.pi)
    np.testing.assert_allclose(found.frequencies, hertz, rtol=1e-9)
    assert found.modes.tolist() == [[1, 2], [1, 2], [0, 1]]
    assert [c.speed for c in found.crossings] == pytest.approx([10.0, max(stuck)], rel=1e-8)
    assert found.conditions == ("open: clutch clutch", "stuck: clutch clutch")


def test_constant_frequencies_are_met_on_a_straight_line(rotors: gl.System) -> None:
    """Also where a point of the grid is a crossing, which is told once."""
    found = gl.campbell(rotors, [0.0, 10.0, 20.0, 45.0], [1.0, 0.5])
    assert [(c.order, c.mode) for c in found.crossings] == [("1", 1), ("1", 2), ("0.5", 1), ("0.5", 2)]
    assert [c.speed for c in found.crossings] == pytest.approx([np.sqrt(250.0), 20.0, 2 * np.sqrt(250.0), 40.0], rel=1e-9)
    assert found.modes.tolist() == [[1, 2]] * 4
    few = gl.campbell(rotors, [0.0, 30.0], [1.0], count=1)
    assert [c.mode for c in few.crossings] == [1]


def test_orders_of_almost_one_value_are_all_met(rotors: gl.System) -> None:
    """Two meshes with 2.00000025 and 2.000000375 events per revolution keep their names apart; an order given twice is one."""
    orders = [2.00000025, 2.000000375, 4.0, 4.0]
    found = gl.campbell(rotors, [0.0, 30.0], orders, count=1)
    assert found.orders == {"2.00000025": 2.00000025, "2.000000375": 2.000000375, "4.0": 4.0}
    assert [c.speed for c in found.crossings] == pytest.approx(
        [np.sqrt(250.0) / k for k in (4.0, 2.000000375, 2.00000025)], rel=1e-10
    )


def test_a_diagram_is_listed() -> None:
    speeds, hertz = np.array([0.0, 10 * np.pi]), np.array([[4.0, 30.0], [4.0, 30.0]])
    crossing = Crossing(8 * np.pi, "mesh", 3, 4.0, 0.0125)
    made = Campbell(speeds, hertz, 0 * hertz, np.array([[3, 4]] * 2), {"mesh": 1.0}, (crossing,), ("open: mesh m", "stuck: c"))
    head, line, point = str(made).splitlines()
    assert head.split() == ["speed,", "1/min", "order", "mode", "frequency,", "Hz", "damping"]
    assert line.split() == ["240", "mesh", "3", "4", "0.01250"]
    assert point == "Operating point: open: mesh m; stuck: c."
    assert made.to_dataframe().iloc[0].tolist() == pytest.approx([8 * np.pi, 240.0, "mesh", 3, 4.0, 0.0125])
    assert made.highest == pytest.approx(1.1 * 5.0)
    nothing = Campbell(speeds, hertz, 0 * hertz, np.array([[3, 4]] * 2), {}, ())
    assert str(nothing) == "no order meets a natural frequency in this range of speed"
    assert nothing.highest == pytest.approx(1.1 * 30.0)
    slow = Campbell(speeds, hertz, 0 * hertz, np.array([[3, 4]] * 2), {"a": 0.1}, ())
    assert slow.highest == pytest.approx(1.1 * 4.0)
    fast = Campbell(speeds, hertz, 0 * hertz, np.array([[3, 4]] * 2), {"a": 0.1, "b": 100.0}, ())
    assert fast.highest == pytest.approx(1.1 * 30.0)


@pytest.mark.parametrize(
    ("orders", "more", "said"),
    [
        ([[1.0]], {}, r"^orders is \[\[1\.0\]\]; expected events for each revolution"),
        ({"mesh": "21"}, {}, "^order mesh is '21'"),
        ([1.0], {"parameters": lambda w: {}[w]}, "^parameters, a function, raised KeyError at 0 rad/s: .*; expected a function of the"),
        ([1.0], {"at": lambda w: 1 / w}, "^at, a function, raised ZeroDivisionError at 0 rad/s: .*; expected a function of the speed$"),
    ],
)  # fmt: skip
def test_what_is_no_order_or_no_function_of_speed_is_refused(rotors: gl.System, orders: Any, more: Any, said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        gl.campbell(rotors, [0.0, 10.0], orders, **more)


def test_the_sense_of_rotation_does_not_matter(rotors: gl.System) -> None:
    """The speed ratio of an external gear is negative, and a reference shaft may turn backwards."""
    forward = gl.campbell(rotors, [0.0, 10.0, 45.0], {"mesh": 1.0})
    speeds = [c.speed for c in forward.crossings]
    assert len(speeds) == 2
    assert gl.campbell(rotors, [0.0, 10.0, 45.0], {"mesh": -1.0}).crossings == forward.crossings
    for parameters in (None, lambda w: {}):
        back = gl.campbell(rotors, [-45.0, 0.0], {"mesh": 1.0}, parameters=parameters)
        assert [c.speed for c in back.crossings] == pytest.approx([-w for w in reversed(speeds)])
        assert back.highest == pytest.approx(forward.highest)
    both = gl.campbell(rotors, [-45.0, 0.0, 45.0], {"mesh": 1.0})
    assert [c.speed for c in both.crossings] == pytest.approx([-speeds[1], -speeds[0], *speeds])
    with pytest.raises(ArgumentError, match=r"^speeds go from -45 to 45 rad/s without 0"):
        gl.campbell(rotors, [-45.0, 45.0], {"mesh": 1.0})


@pytest.mark.parametrize(
    "speeds",
    [[-45.0, -20.0, 45.0], [-45.0, 20.0, 45.0], [-0.5, 0.5], [-45.0, 1.0, 45.0], [-45.0, -1.0, 45.0], [-2.0, 0.1, 0.6]],
)
def test_speeds_of_both_senses_need_standstill_between_them(rotors: gl.System, speeds: list[float]) -> None:
    with pytest.raises(ArgumentError, match=rf"^speeds go from {speeds[0]:g} to {speeds[-1]:g} rad/s without 0, where"):
        gl.campbell(rotors, speeds, [1.0])
    with_rest = gl.campbell(rotors, sorted([*speeds, 0.0]), [1.0])
    assert with_rest.speeds.tolist() == sorted([*speeds, 0.0])


@pytest.mark.parametrize("speeds", [[0.5, 2.0], [-2.0, -0.5], [0.0, 0.5], [-0.5, 0.0]])
def test_speeds_of_one_sense_need_no_standstill(rotors: gl.System, speeds: list[float]) -> None:
    assert gl.campbell(rotors, speeds, [1.0]).speeds.tolist() == speeds


def test_a_curve_is_labelled_where_its_mode_begins_to_oscillate() -> None:
    """Also the first mode of all, with the number 0."""
    speeds, nan = np.array([10.0, 20.0, 30.0]), np.nan
    hertz = np.array([[nan, 5.0], [2.0, 5.0], [2.0, nan]])
    made = Campbell(speeds, hertz, 0 * hertz, np.array([[-1, 0], [0, 1], [0, -1]]), {"once": 1.0}, ())
    axes = made.plot()
    assert [(text.get_text(), text.xy) for text in axes.texts] == [
        ("0", (pytest.approx(20 * 30 / np.pi), 2.0)), ("0", (pytest.approx(10 * 30 / np.pi), 5.0)),
    ]  # fmt: skip
    plt.close(axes.figure)


class Veering(gl.Component):
    """Two oscillators, the first of which becomes stiffer with the speed, joined by a weak spring."""

    k, c = gl.Parameter("1/s2", default=100.0), gl.Parameter("1/s2", default=0.5)
    x, y = gl.Variable("m"), gl.Variable("m")
    u, v = gl.Variable("m/s"), gl.Variable("m/s")

    def equations(self) -> list[gl.Eq]:
        pull = self.c * (self.y - self.x)
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), -self.k * self.x + pull),
            gl.Eq(gl.der(self.v), -100.0 * self.y - pull),
        ]


@pytest.mark.parametrize("order", [0.95, 1.0, 1.02, 1.1])
@pytest.mark.parametrize("c", [0.01, 0.5, 5.0])
@pytest.mark.parametrize("count", [2, 5, 6])
def test_crossings_are_met_where_curves_veer(order: float, c: float, count: int) -> None:
    """Shapes change places within a step of speed; ``(k + c - r)(100 + c - r) = c**2`` at the order's ``r = (order w)**2``."""
    values = {"c": c}
    found = gl.campbell(
        gl.compile(Veering()), np.linspace(0, 20, count), [order], parameters=lambda w: {**values, "k": (8 + 0.2 * w) ** 2}
    )
    p, r = np.polynomial.Polynomial([8, 0.2]) ** 2 + c, np.polynomial.Polynomial([0, order]) ** 2
    roots = ((p - r) * (100 + c - r) - c**2).roots()
    right = np.sort(roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 20)].real)
    assert [crossing.speed for crossing in found.crossings] == pytest.approx(right, rel=1e-6)
    assert [2 * np.pi * crossing.frequency for crossing in found.crossings] == pytest.approx(order * right, rel=1e-6)


def test_each_mode_has_a_curve_however_few_the_speeds() -> None:
    speeds, hertz = np.array([10.0, 20.0]), np.array([[2.0, 5.0, 9.0], [3.0, 4.0, 9.5]])
    axes = Campbell(speeds, hertz, 0 * hertz, np.array([[1, 2, 3]] * 2), {"once": 1.0}, ()).plot()
    curves = [line.get_ydata() for line in axes.lines if line.get_linestyle() == "-"]
    assert np.array(curves).tolist() == hertz.T.tolist()
    plt.close(axes.figure)
