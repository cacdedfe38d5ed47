"""Power flows made by hand: sums, texts, tables and circulating powers, by what is at the flanges."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, InputWarning, ModelError, NameLookupError
from gearlib.statics.circulation import PowerEdge, circulations
from gearlib.statics.power_flow import FlangePower, PowerFlow, flows_of


def flange(
    component: str, name: str, speed: float, torque: float, shaft: int, leaf: bool = True, sliding: bool = False
) -> FlangePower:
    return FlangePower(component, name, speed, torque, speed * torque, shaft, leaf, sliding)


FLANGES = (
    flange("motor", "flange", 100.0, -10.0, 0),
    flange("rotor", "flange_a", 100.0, 10.0, 0),  # a body that passes on its torque
    flange("rotor", "flange_b", 100.0, -10.0, 0),
    flange("box.gear", "flange_a", 100.0, 10.0, 0),
    flange("box.gear", "flange_b", 20.0, -45.0, 1),
    flange("box", "flange_a", 100.0, 10.0, 0, leaf=False),
    flange("load", "flange", 20.0, 40.0, 1),
    flange("pump", "flange", 20.0, 5.0, 1),
    flange("idle", "flange", 20.0, 0.0, 1),
)


def test_sums_of_power() -> None:
    flow = PowerFlow(FLANGES, 1, "Train")
    assert flow.absorbed == {"motor": -1000, "rotor": 0, "box.gear": 100, "load": 800, "pump": 100, "idle": 0}
    assert flow.outer == ("motor", "load", "pump")
    assert (flow.input_power, flow.output_power, flow.efficiency) == (1000, 900, 0.9)
    assert flow.losses == {"box.gear": 100}
    assert flow.largest == 1000
    assert flow.imbalance == 0
    assert flow.circulating == ()
    assert flow.circulating_power == 0
    assert PowerFlow((FLANGES[0],), 1).imbalance == 1.0
    nothing = PowerFlow((), 0)
    assert (nothing.input_power, nothing.largest, nothing.imbalance) == (0, 0, 0)
    assert math.isnan(nothing.efficiency)
    assert flow["box.flange_a"].torque == 10
    assert flange("", "shaft", 1.0, 1.0, 0).name == "shaft"
    with pytest.raises(NameLookupError, match=r"the model has no flange 'load\.flang'; did you mean 'load\.flange'"):
        flow["load.flang"]


def test_two_power_flows_are_equal_if_all_flanges_are() -> None:
    """Those of one train that was made twice, but not of another; a text of one shows no parts of the train."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.shaft, self.load = gp.Torque(), gp.Inertia(J=1.0), gp.Torque()
            return [gl.connect(self.motor.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.load.flange)]

    one, same, other = (gl.compile(Train()).power_flow({"shaft.w": w}, {"motor.tau": 5.0}) for w in (3.0, 3.0, 4.0))
    assert one == same
    assert one != other
    assert "component=" in repr(one.flanges[0])
    assert "<Train>" not in repr(one)


def test_the_text_leaves_out_what_says_nothing() -> None:
    title, empty, *table, note, left_out, blank, drive, load, lost, efficiency, around = str(
        PowerFlow(FLANGES, 1, "Train")
    ).splitlines()
    assert title == "Steady power flow of Train: mobility 1 (1 degree of freedom)"
    assert empty == blank == ""
    head, *rows = table
    assert re.split(r"\s{2,}|(?<=s) (?=speed)", head.strip())[0] == "flange"
    values = [(line.split()[0], [float(v) for v in line.split()[1:]]) for line in rows]
    expected = [
        f for f in FLANGES if f.name in ("motor.flange", "box.gear.flange_a", "box.gear.flange_b", "load.flange", "pump.flange")
    ]
    assert [name for name, _ in values] == [f.name for f in expected]
    for (_, numbers), f in zip(values, expected, strict=True):
        assert numbers == pytest.approx([f.speed, f.speed * 30 / math.pi, f.torque, f.power], rel=1e-5)
    assert len({len(line) for line in table}) == 1  # columns end alike
    assert note == "(torque and power are positive into the component: a drive's power is negative, a load's positive)"
    assert left_out == "(3 flanges of bodies that pass on their torque, or of parts without any, are left out)"
    assert drive == "input power        1000 W from motor"
    assert load == "output power       900 W to load, pump"
    assert lost == "losses             100 W: box.gear 100"
    assert efficiency == "efficiency         0.9"
    assert around == "circulating power  none"
    two = str(PowerFlow(FLANGES, 2)).splitlines()
    assert two[0] == "Steady power flow: mobility 2 (2 degrees of freedom)"
    assert "losses             0 W" in str(PowerFlow((), 0))
    assert "efficiency" not in str(PowerFlow((FLANGES[0],), 1))
    idle = str(PowerFlow((flange("a", "flange", 3.0, 0.0, 0), flange("b", "flange", 3.0, 0.0, 0)), 1)).splitlines()
    assert idle[4].startswith("(2 flanges of bodies that pass on their torque, or of parts without any"), (
        "nothing is left to show"
    )


@pytest.mark.parametrize("count", [1, 3, 4])
def test_torques_that_equilibrium_leaves_open_are_named_three_at_most(count: int) -> None:
    names = tuple(f"mesh[{k}].flange_a" for k in range(count))
    text = " ".join(str(PowerFlow(FLANGES, 1, "", names)).split())
    said = ", ".join(names[:3]) + (", ..." if count > 3 else "")
    assert f"(equilibrium leaves {count} torques open: {said}; they are those of parallel paths without preload," in text
    assert "equilibrium" not in str(PowerFlow(FLANGES, 1))


@pytest.mark.parametrize("count", [1, 3, 4])
def test_parts_with_other_connectors_are_named_three_at_most(count: int) -> None:
    names = tuple(f"pump[{k}]" for k in range(count))
    text = " ".join(str(PowerFlow(FLANGES, 1, beside=names)).split())
    said = ", ".join(names[:3]) + (", ..." if count > 3 else "")
    assert text.endswith(f"(only power at flanges is counted; other connectors carry power as well: those of {said})")


def test_rounding_is_shown_as_zero_and_slides_have_no_revolutions() -> None:
    slide, small, large = (
        flange("a", "rod", 1e-12, 50.0, 0, sliding=True),
        flange("a", "flange", 2.0, 40e-12, 1),
        flange("b" * 50, "flange", -2.0, -50.0, 1),
    )
    flow = PowerFlow((slide, small, large), 1)
    rod, shaft, long = (line.split() for line in str(flow).splitlines()[3:6])
    assert rod == ["a.rod", "0", "-", "50", "0", "(m/s,", "N)"]
    assert shaft == ["a.flange", "2", f"{60 / math.pi:.6g}", "0", "0"]
    assert long[1:] == ["-2", f"{-60 / math.pi:.6g}", "-50", "100"]
    assert len(long[0]) == 42 - len("  (m/s, N)")
    assert max(map(len, str(flow).splitlines())) <= 100
    html = flow._repr_html_()
    assert html.count("<tr>") == 4
    fast = PowerFlow((flange("a", "flange", 1e13, 0.5, 0), flange("b", "flange", 1e13, -0.5, 0)), 1)
    assert [line.split()[0] for line in str(fast).splitlines()[3:5]] == ["a.flange", "b.flange"]
    assert f'<td class="number">{-60 / math.pi:.6g}</td>' in html
    table = PowerFlow(FLANGES, 1).to_dataframe()
    assert table.loc["pump.flange"].tolist() == [20, 5, 100]
    assert len(table) == len(FLANGES)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_a_set_turns_as_a_block_where_its_speeds_differ_by_rounding(size: float) -> None:
    def ratio(*speeds: float) -> float:
        flanges = [
            flange("s", n, size * w, 1.0, k) for k, (n, w) in enumerate(zip(("sun", "ring", "carrier"), speeds, strict=True))
        ]
        return PowerFlow(tuple(flanges), 2).willis("s.sun", "s.ring", "s.carrier")[0]

    assert math.isnan(ratio(1.0, 1.0 + 1e-13, 1.0))
    assert math.isnan(ratio(-20.0, 1.0 + 1e-11, 1.0))
    assert ratio(-5.0, 4.0, 1.0) == pytest.approx(-2.0)


def test_willis_ratio_of_speeds_and_torques() -> None:
    """Ring over sun of 2.5, in any motion; NaN for a set that turns as a block, or without torque."""

    def ratios(speeds: tuple[float, float, float], torque: float) -> tuple[float, float]:
        torques = (torque, 2.5 * torque, -3.5 * torque)
        names = ("sun", "ring", "carrier")
        flanges = (flange("s", name, w, tau, k) for k, (name, w, tau) in enumerate(zip(names, speeds, torques, strict=True)))
        return PowerFlow(tuple(flanges), 2).willis("s.sun", "s.ring", "s.carrier")

    for ring, carrier in ((0.0, 1.0), (-3.0, 0.5), (2.0, 2.0 + 1e-9)):
        assert ratios((carrier - 2.5 * (ring - carrier), ring, carrier), 4.0) == pytest.approx((-2.5, -2.5), rel=1e-6)
    assert all(map(math.isnan, ratios((3.0, 3.0, 3.0), 0.0)))
    assert math.isnan(ratios((3.0, 3.0 + 4e-16, 3.0), 1.0)[0]), "a block but for rounding"


def test_circulating_power_is_said_with_its_share_and_its_way() -> None:
    """Drive 100 W into a shaft, from which 130 W pass a gear and 30 W come back through another."""
    flanges = (
        flange("drive", "flange", 10.0, -10.0, 0), flange("one", "a", 10.0, 13.0, 0), flange("one", "b", 5.0, -26.0, 1),
        flange("two", "a", 5.0, 6.0, 1), flange("two", "b", 10.0, -3.0, 0), flange("load", "flange", 5.0, 20.0, 1),
    )  # fmt: skip
    flow = PowerFlow(flanges, 1)
    assert [(c.power, c.components) for c in flow.circulating] == [(30.0, ("one", "two"))]
    lines = str(flow).splitlines()
    assert lines[-2:] == ["circulating power  30 W, 30 % of the input", "                   30 W through one, two"]
    assert flow.efficiency == 1.0


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_what_is_left_out_is_relative_to_the_largest_torque(size: float) -> None:
    """Parts with up to 1e-12 of it, and bodies whose torques differ by up to 1e-11 of it."""
    parts = [
        ("idle", 2, [0.9e-12]),
        ("drag", 3, [1.1e-12]),
        ("rotor", 0, [1.0, -1.0 + 0.9e-11]),
        ("brake", 0, [1.0, -1.0 + 1.1e-11]),
    ]
    own = [flange(name, f"flange_{k}", 10.0, x * size, shaft) for name, shaft, torques in parts for k, x in enumerate(torques)]
    flow = PowerFlow((flange("motor", "flange", 10.0, -size, 0), *own), 1)
    shown = [line.split()[0] for line in str(flow).splitlines()[3:] if ".flange" in line.split(" ")[0]]
    assert shown == ["motor.flange", "drag.flange_0", "brake.flange_0", "brake.flange_1"]
    assert "(3 flanges of bodies" in str(flow)
    driven = PowerFlow((flange("motor", "flange", 1.0, -size, 0), flange("load", "flange", 1.0, size, 0)), 1)
    assert f"input power        {size:.6g} W from motor\noutput power       {size:.6g} W to load\n" in str(driven)


def test_power_that_goes_round_without_a_drive_has_no_share() -> None:
    flanges = (
        flange("one", "a", 10.0, 13.0, 0), flange("one", "b", 5.0, -26.0, 1),
        flange("two", "a", 5.0, 26.0, 1), flange("two", "b", 10.0, -13.0, 0),
    )  # fmt: skip
    lines = str(PowerFlow(flanges, 1)).splitlines()
    assert lines[-2:] == ["circulating power  130 W", "                   130 W through one, two"]
    assert lines[-5:-2] == ["input power        0 W", "output power       0 W", "losses             0 W"]


@given(st.lists(st.lists(st.integers(0, 7), min_size=2, max_size=5, unique=True), min_size=1, max_size=3), st.data())
def test_circulations_are_what_flows_in_circles(cycles: list[list[int]], data: st.DataObject) -> None:
    """Circles of shafts on top of a flow from shaft to shaft without any: taken out, nothing flows in circles, and balances stay."""
    edges = [
        PowerEdge("drive", 0, -5.0),
        *(e for k in range(7) for e in (PowerEdge(f"g{k}", k, 5.0), PowerEdge(f"g{k}", k + 1, -5.0))),
    ]
    edges.append(PowerEdge("load", 7, 5.0))
    assert circulations(edges) == ()
    total = 0.0
    for n, cycle in enumerate(cycles):
        power = data.draw(st.sampled_from([1.0, 2.0, 3.5]))
        total += power
        for i, (a, b) in enumerate(zip(cycle, [*cycle[1:], cycle[0]], strict=True)):
            edges += [PowerEdge(f"c{n}.{i}", a, power), PowerEdge(f"c{n}.{i}", b, -power)]
    found = circulations(edges)
    assert found
    assert [c.power for c in found] == sorted((c.power for c in found), reverse=True)
    left: dict[tuple[str, int], float] = {(e.component, e.shaft): e.power for e in edges}
    for c in found:
        assert c.components[0] == min(c.components)
        for name in c.components:
            for key in [key for key in left if key[0] == name]:
                left[key] -= math.copysign(c.power, left[key]) if len([k for k in left if k[0] == name]) == 2 else 0.0
    assert circulations([PowerEdge(*key, power) for key, power in left.items() if abs(power) > 1e-9]) == ()
    assert all(power * before.power >= -1e-9 for power, before in zip(left.values(), edges, strict=True))


def test_shafts_that_several_share_are_joints_of_the_diagram(monkeypatch: pytest.MonkeyPatch) -> None:
    """A motor on two gears, these on a shaft with two loads, one of which drives a third by a shaft of its own."""
    drawn: list[Any] = []
    monkeypatch.setattr("gearlib.statics.power_flow.sankey", lambda *arguments: drawn.append(arguments))
    ends = [
        ("motor", 0, -90.0), ("a", 0, 60.0), ("b", 0, 30.0), ("a", 1, -55.0), ("b", 1, -25.0), ("pump", 1, 30.0), ("box", 1, 50.0),
        ("box", 2, -45.0), ("fan", 2, 45.0), ("idle", 2, 0.0),
    ]  # fmt: skip
    flow = PowerFlow(tuple(flange(name, f"at_{shaft}", 1.0, power, shaft) for name, shaft, power in ends), 1, "Row")
    flow.sankey()
    ((bands, losses, title, joints),) = drawn
    assert sorted(tuple(vars(band).values()) for band in bands) == [
        ("a", "shaft 1", 55.0), ("b", "shaft 1", 25.0), ("box", "fan", 45.0), ("motor", "shaft 0", 90.0), ("shaft 0", "a", 60.0),
        ("shaft 0", "b", 30.0), ("shaft 1", "box", 50.0), ("shaft 1", "pump", 30.0),
    ]  # fmt: skip
    assert (losses, joints) == ({"a": 5.0, "b": 5.0, "box": 5.0}, ["shaft 0", "shaft 1"])
    assert title.startswith("Steady power flow of Row")


def test_wrong_arguments_of_drawings() -> None:
    flow = PowerFlow(FLANGES, 1)
    with pytest.raises(ArgumentError, match=r"other\['2nd'\] is 3; expected a PowerFlow, as power_flow\(\.\.\.\) gives it"):
        flow.speed_ladder("1st", {"2nd": 3})  # type: ignore[dict-item]
    with pytest.raises(ModelError, match="this PowerFlow was made by hand, without a model whose gears could be drawn"):
        flow.scheme()
    assert isinstance(flow, gl.PowerFlow)
    assert np.isfinite(flow.efficiency)


class Varying(gl.Component):
    """A torque over time on a shaft with drag."""

    tau = gl.Structural(None)
    mean = gl.Parameter("N.m", default=0.0)

    def assemble(self) -> list[Any]:
        self.torque, self.shaft = gp.Torque(tau=self.tau(self.mean)), gp.Inertia(J=1.0)
        self.drag, self.ground = gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize(
    ("tau", "first"),
    [
        (lambda m: 10 + 5 * gl.time, 10.0),
        (lambda m: m + 10 * gl.exp(-gl.time), 10.0),
        (lambda m: gl.Table([0, 1], [10, 20])(gl.time), 10.0),
        (lambda m: gl.Piecewise((10, gl.time < 1), (20, True)), 10.0),
        (lambda m: 10 + abs(gl.sin(gl.time)), 10.0),
    ],
)
def test_a_torque_over_time_without_a_mean_counts_as_at_first_and_is_told(tau: Any, first: float) -> None:
    system = gl.compile(Varying(tau=tau))
    told = r"Varying: torque\.tau changes with time, and counts with its value at t = 0 in the power flow; pass power_flow\(torques="
    with pytest.warns(InputWarning, match=told):
        assert gl.power_flow(system)["shaft.flange_a"].speed == pytest.approx(2 * first)
    with pytest.warns(InputWarning, match=r"Varying: torque\.tau changes .* in the steady state"):
        assert gl.steady_state(system, ["shaft.w"])["shaft.w"] == pytest.approx(2 * first)
    assert gl.power_flow(system, torques={"torque.tau": 3.0})["shaft.flange_a"].speed == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("tau", "mean"),
    [
        (lambda m: m + 10 * gl.sin(5 * gl.time + 0.3) * gl.cos(2 * gl.time), 4.0),
        (lambda m: m + 10 * gl.cos(gl.time) ** 2, 9.0),
        (lambda m: gl.Piecewise((m, gl.time >= -1), (20, True)), 4.0),
    ],
)
def test_a_torque_that_swings_counts_as_its_mean(tau: Any, mean: float) -> None:
    system = gl.compile(Varying(tau=tau))
    assert gl.power_flow(system, parameters={"mean": 4.0})["shaft.flange_a"].speed == pytest.approx(2 * mean)


def test_the_steady_state_is_that_of_the_mean_or_says_so() -> None:
    """Of a run over whole periods, begun in the steady state of a torque that swings around its first value, the mean speed is that."""
    swinging, off = (gl.compile(Varying(tau=lambda m, f=f: 10 + f(2 * np.pi * gl.time))) for f in (gl.sin, gl.cos))
    assert gl.steady_state(swinging, ["shaft.w"])["shaft.w"] == pytest.approx(20.0)
    with pytest.warns(InputWarning, match=r"torque\.tau changes with time"):
        assert gl.steady_state(off, ["shaft.w"])["shaft.w"] == pytest.approx(22.0)
    for system in (swinging, off):
        speeds = system.simulate(30.0, samples=3001)["shaft.w"]
        assert speeds[-1000:].mean() == pytest.approx(gl.power_flow(system)["shaft.flange_a"].speed, rel=1e-5)


def test_a_step_of_torque_that_comes_later_is_told_and_one_that_was_there_is_not() -> None:
    class Stepped(gl.Component):
        begin = gl.Parameter("s", default=0.0)

        def assemble(self) -> Any:
            self.torque, self.shaft = (
                gp.TorqueStep(step_torque=3.0, offset_torque=1.0, start_time=self.begin),
                gp.Inertia(J=1.0),
            )
            self.drag, self.ground = gp.Damper(d=0.5), gp.Fixed()
            return [
                gl.connect(self.torque.flange, self.shaft.flange_a, self.drag.flange_a),
                gl.connect(self.drag.flange_b, self.ground.flange),
            ]

    system = gl.compile(Stepped())
    assert (
        gl.power_flow(system)["shaft.flange_a"].speed == gl.steady_state(system, ["shaft.w"])["shaft.w"] == pytest.approx(8.0)
    )
    for analysis in (gl.power_flow, gl.steady_state):
        with pytest.warns(InputWarning, match="Stepped: torque changes with time, and counts with its value at t = 0"):
            analysis(system, parameters={"begin": 0.5})


class BetweenShafts(gl.Component):
    """A motor whose rotor and housing both turn, beside a small motor."""

    def assemble(self) -> Any:
        self.motor, self.helper, self.ground = gp.Torque2(tau=10.0), gp.Torque(tau=0.1), gp.Fixed()
        self.first, self.second = gp.Damper(d=1.0), gp.Damper(d=2.0)
        return [
            gl.connect(self.motor.flange_a, self.first.flange_a),
            gl.connect(self.motor.flange_b, self.second.flange_a, self.helper.flange),
            gl.connect(self.first.flange_b, self.second.flange_b, self.ground.flange),
        ]


def test_what_delivers_power_between_two_shafts_is_a_drive() -> None:
    flow = gl.power_flow(gl.compile(BetweenShafts()))
    expected = 10.0 * (10.0 + 10.1 / 2) + 0.1 * 10.1 / 2  # torque times relative speed, torque times speed
    assert flow.input_power == pytest.approx(expected)
    assert flow.output_power == pytest.approx(expected)
    assert (flow.efficiency, flow.losses) == (pytest.approx(1.0), {})


class Idling(gl.Component):
    """A lossy gear, driven on one side; the torque on its other side is given."""

    def assemble(self) -> Any:
        self.motor, self.load, self.gear = (
            gp.Torque(),
            gp.Torque(),
            gp.LossyGear(ratio=2.0, loss_table=((0.0, 0.9, 0.8, 0.5, 0.5),)),
        )
        return [gl.connect(self.motor.flange, self.gear.flange_a), gl.connect(self.gear.flange_b, self.load.flange)]


@pytest.mark.parametrize("tau", [0.0, -1e-9, -0.5])
def test_a_gear_is_no_load_where_its_output_idles(tau: float) -> None:
    """All that goes into it is lost, as it is beside a tiny load; at 5 rad/s the load takes 5 W for each N.m."""
    flow = gl.power_flow(gl.compile(Idling()), {"gear.flange_a": 10.0}, {"load.tau": tau})
    drawn = -10.0 * flow["motor.flange"].torque
    assert drawn > 5.0
    assert (flow.input_power, flow.output_power) == (pytest.approx(drawn), pytest.approx(-5.0 * tau))
    assert flow.efficiency == pytest.approx(-5.0 * tau / drawn)
    assert flow.losses == {"gear": pytest.approx(drawn + 5.0 * tau)}


def test_a_shaft_that_turns_by_rounding_stands_still() -> None:
    """A brake whose other side moves by 5e-12 rad/s beside 100 rad/s takes the power, and is no gear that loses it."""
    rows = [("motor", "flange", 100.0, -1.0, 0), ("brake", "a", 100.0, 1.0, 0), ("brake", "b", 5e-12, -1.0, 1)]
    flow = PowerFlow(tuple(flange(*row) for row in rows), 1)
    assert flow.outer == ("motor", "brake")
    assert flow.losses == {}
    assert flow.efficiency == pytest.approx(1.0)


def test_what_stands_still_loses_nothing_and_has_no_ratio() -> None:
    torques = {"a": 1.0, "b": 2.0, "c": -3.0}
    flow = PowerFlow(tuple(flange("set", name, 0.0, tau, k) for k, (name, tau) in enumerate(torques.items())), 2)
    assert (flow.losses, flow.outer, flow.circulating_power) == ({}, (), 0.0)
    by_speed, by_torque = flow.willis("set.a", "set.b", "set.c")
    assert math.isnan(by_speed)
    assert by_torque == -2.0


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_power_goes_from_givers_to_takers_however_little_it_is(size: float) -> None:
    edges = [("motor", 0, -5.0), ("gear", 0, 5.0), ("gear", 1, -4.5), ("a", 1, 2.0), ("b", 1, 2.5)]
    flows, joints = flows_of([PowerEdge(name, shaft, size * power) for name, shaft, power in edges])
    pairs = {("motor", "gear"): 5.0, ("gear", "shaft 1"): 4.5, ("shaft 1", "a"): 2.0, ("shaft 1", "b"): 2.5}
    assert {(a, b): power for a, b, power in flows} == pytest.approx({pair: size * power for pair, power in pairs.items()})
    assert joints == ["shaft 1"]


class HeldTwice(gl.Component):
    """A torque without a mean on a train with two bearings, gears and a loaded body behind a clutch."""

    backwards = gl.Structural(False)

    def assemble(self) -> list[Any]:
        line: list[Any] = [
            gp.Inertia(J=0.1485376321434908), gp.Spring(c=797.5693175317606), gp.Inertia(J=0.18602286841464583),
            gp.BearingFriction(tau_pos=[[0, 4.9962925177928215], [50, 6.0]]), gp.IdealGear(ratio=0.5),
            gp.Inertia(J=0.9264003492277698), gp.IdealGear(ratio=-1.5),
            gp.BearingFriction(tau_pos=[[0, 2.7186035842928415], [50, 6.0]]),
            gp.Clutch(mu_pos=[[0, 0.5], [10, 0.4]], fn_max=10.776257731015326, f_normalized=1.0),
            gp.Inertia(J=0.6157580486071929),
        ]  # fmt: skip
        first = gp.Torque(tau=33.2779276407773 * gl.sin(5.71541794114584 * gl.time))
        last = gp.LinearSpeedDependentTorque(tau_nominal=-10.0, w_nominal=20.0)
        parts = list(enumerate([first, *line, last]))
        for k, part in reversed(parts) if self.backwards else parts:
            setattr(self, f"part_{k:02d}", part)
        return [
            gl.connect(first.flange, line[0].flange_a),
            *(gl.connect(a.flange_b, b.flange_a) for a, b in itertools.pairwise(line)),
            gl.connect(line[-1].flange_b, last.flange),
        ]


@pytest.mark.parametrize("backwards", [False, True])
def test_what_friction_holds_at_rest_rests_in_any_order_of_declaration(backwards: bool) -> None:
    """Nothing drives it. Where friction slid before the first look at it, it was refused after a long search."""
    flanges = gl.compile(HeldTwice(backwards=backwards)).power_flow().flanges
    assert max(abs(value) for f in flanges for value in (f.speed, f.torque)) < 1e-12


class LockedOnFallingFriction(gl.Component):
    """A drive on a load by a spring, a gear and a clutch whose friction falls to zero with the slip."""

    places = gl.Structural(())

    def assemble(self) -> list[Any]:
        line: list[Any] = [
            gp.Inertia(J=1.0), gp.SpringDamper(c=1700.0, d=4.0), gp.Inertia(J=1.2), gp.BearingFriction(tau_pos=[[0, 3.4], [50, 6.0]]),
            gp.IdealGear(ratio=2.0), gp.BearingFriction(tau_pos=[[0, 5.0], [50, 6.0]]),
            gp.Clutch(mu_pos=[[0, 0.5], [10, 0.4]], fn_max=90.0, f_normalized=1.0), gp.Inertia(J=0.15),
            gp.BearingFriction(tau_pos=[[0, 2.4], [50, 6.0]]),
        ]  # fmt: skip
        drive, load = gp.Torque(tau=24.0), gp.LinearSpeedDependentTorque(tau_nominal=-10.0, w_nominal=20.0)
        parts = [drive, *line, load]
        for place in self.places:
            setattr(self, f"part_{place:02d}", parts[place])
        return [
            gl.connect(drive.flange, line[0].flange_a),
            *(gl.connect(a.flange_b, b.flange_a) for a, b in itertools.pairwise(line)),
            gl.connect(line[-1].flange_b, load.flange),
        ]


@pytest.mark.parametrize(
    "places", [range(11), range(10, -1, -1), (9, 7, 0, 2, 1, 4, 6, 10, 5, 3, 8), (7, 3, 8, 0, 1, 9, 6, 10, 5, 2, 4)]
)
def test_a_clutch_that_a_run_locks_is_locked(places: Sequence[int]) -> None:
    """The result was another motion, with the clutch slipping at 164 rad/s without a torque, or none."""
    flow = gl.compile(LockedOnFallingFriction(places=tuple(places))).power_flow()
    # referred to the load's shaft: 48 = 2 (3.4 + 0.052 * 2 w) + (5 + 0.02 w) + (2.4 + 0.072 w) + 0.5 w
    w = (48 - 6.8 - 5 - 2.4) / (0.208 + 0.02 + 0.072 + 0.5)
    assert flow["part_10.flange"].speed == pytest.approx(w, rel=1e-12)
    assert (flow["part_07.flange_a"].speed, flow["part_07.flange_b"].speed) == pytest.approx((w, w), rel=1e-12)
    assert flow["part_00.flange"].speed == pytest.approx(2 * w, rel=1e-12)
    assert flow["part_07.flange_a"].torque == pytest.approx(2.4 + 0.572 * w, rel=1e-9)
