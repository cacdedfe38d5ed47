"""The differential campaign in small, and the references' own tests against closed forms."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.stress.campaign import FAMILIES, SHARES, counted, judge, judged, noted, seeds, tables
from tests.stress.described import Part, Signal, Train, shrunk
from tests.stress.hybrid_reference import HybridTrain
from tests.stress.linear_campaign import right_values
from tests.stress.linear_draw import linear_train
from tests.stress.linear_reference import LinearTrain
from tests.stress.verdicts import HANG, REFUSED, RIGHT, UNCLEAR, WRONG, Verdict

TIMES = np.linspace(0.0, 1.0, 7)


def part(name: str, kind: str, *at: int, **values: object) -> Part:
    return Part(name, kind, at, tuple(values.items()))


# ---------------------------------------------------------------- the references


def test_linear_reference_against_a_vibration_in_closed_form() -> None:
    """Two bodies, a spring, a gear without inertia and a step of torque: phi_rel = (tau / c) (J_b / (J_a + J_b)) (cos(w t) - 1)."""
    train = Train(
        (
            part("a", "Inertia", 0, 0, J=2.0),
            part("s", "Spring", 0, 1, c=50.0),
            part("g", "IdealGear", 1, 2, ratio=2.0),
            part("b", "Inertia", 2, 3, J=12.0),  # 3 at the spring
            part("t", "Torque", 0, tau=Signal(steps=((0.25, 4.0),))),
        ),
        (0.0,), (0.0,),
    )  # fmt: skip
    solved = LinearTrain(train)
    values = right_values(solved, TIMES).values
    w = np.sqrt(50 * (1 / 2 + 1 / 3))
    since = np.maximum(TIMES - 0.25, 0)
    assert values["s.phi_rel"] == pytest.approx(4.0 / 50 * 3 / 5 * (np.cos(w * since) - 1), abs=1e-12)
    assert 2 * values["a.w"] + 3 * 2 * values["b.w"] == pytest.approx(4.0 * since, abs=1e-12)
    assert values["g.flange_b.tau"] == pytest.approx(2 * values["s.tau"], abs=1e-12)


def test_linear_reference_knows_what_is_not_determined() -> None:
    """Two equal gears side by side: the motion is determined, the share of each gear is not."""
    gears = tuple(part(f"g{k}", "IdealGear", 0, 1, ratio=2.0) for k in range(2))
    train = Train((part("a", "Inertia", 0, 0, J=1.0), *gears, part("b", "Inertia", 1, 2, J=4.0)), (0.0,), (1.0,))
    solved = LinearTrain(train)
    assert solved.problems == []
    assert not any(name.startswith("g") for name in right_values(solved, TIMES).values)
    assert LinearTrain(train.without("b")).problems == []
    loose = Train((part("a", "Inertia", 0, 0, J=0.0),), (0.0,), (0.0,))
    assert LinearTrain(loose).problems == ["a motion without inertia, damping or stiffness"]
    twice = Train((part("f", "Fixed", 0, phi0=0.0), part("h", "Fixed", 0, phi0=1.0)), (0.0,), (0.0,))
    assert LinearTrain(twice).problems == ["the prescribed angles contradict each other"]


def test_a_brake_that_slips_just_before_its_force_grows() -> None:
    """Torque 5 t on a brake of 2 N.m, pressed four times as hard from 0.401 s on: slides from 0.4 s, and sticks at once."""
    moment, J = 0.401, 0.5
    press = Signal(bias=1.0, steps=((moment, 3.0),), bound=True)
    train = Train(
        (
            part("a", "Inertia", 0, 0, J=J),
            part("k", "Brake", 0, 0, mu_pos=((0.0, 0.5),), fn_max=4.0, f_normalized=press),
            part("t", "Torque", 0, tau=Signal(slope=5.0, bound=True)),
        ),
        (0.0,), (0.0,),
    )  # fmt: skip
    speed = 2.5 * 1e-3**2 / J  # (5 t - 2) / J since 0.4 s
    rate = 5 * moment - 8.0  # and then it decelerates: speed + (rate s + 2.5 s**2) / J = 0
    stick = moment + (-rate - np.sqrt(rate**2 - 10 * speed * J)) / 5
    assert HybridTrain(train).solve(TIMES).events == pytest.approx([0.4, moment, stick], abs=1e-9)


def test_massless_bodies_jump_and_creep_in_the_linear_reference() -> None:
    """Springs in series with a massless body between; a damper and a spring without a body: exp(-c t / d)."""
    train = Train(
        (
            part("ground", "Fixed", 0, phi0=0.0),
            part("s1", "Spring", 0, 1, c=10.0),
            part("m", "Inertia", 1, 2, J=0.0),
            part("s2", "Spring", 1, 3, c=30.0),
            part("d", "Damper", 3, 0, d=2.5),
        ),
        (0.0, 0.0, 0.0, 1.0), (0.0,),
    )  # fmt: skip
    values = right_values(LinearTrain(train), TIMES).values
    assert values["s1.phi_rel"] == pytest.approx(0.75 * np.exp(-7.5 / 2.5 * TIMES), abs=1e-12)


def test_switching_reference_slides_sticks_and_breaks_away() -> None:
    """A body slides to rest in 0.2 s, sticks, and breaks away when a growing torque exceeds the friction."""
    train = Train(
        (
            part("a", "Inertia", 0, 0, J=0.5),
            part("f", "BearingFriction", 0, 0, tau_pos=((0.0, 2.0),)),
            part("t", "Torque", 0, tau=Signal(slope=4.0)),
        ),
        (0.0,), (1.0,),
    )  # fmt: skip
    found = HybridTrain(train).solve(TIMES)
    # 0.5 w' = 4 t - 2 until w = 0: w = 1 - 4 t + 4 t**2 = (1 - 2 t)**2; then at rest from 0.5 on, where the torque is 2
    expected = np.where(TIMES < 0.5, (1 - 2 * TIMES) ** 2, 4 * (TIMES - 0.5) ** 2)
    assert found.values["a.w"] == pytest.approx(expected, abs=1e-6)


def test_switching_reference_bounces() -> None:
    """A body that meets a stop at 1 rad turns back with half its speed."""
    stop = part("k", "Kicked", 0, J=1.0, phi_stop=1.0, restitution=0.5, moment=5.0, kick=0.0)
    found = HybridTrain(Train((stop,), (0.0,), (2.0,))).solve(TIMES)
    assert found.values["k.phi"] == pytest.approx(np.where(TIMES < 0.5, 2 * TIMES, 1.5 - TIMES), abs=1e-10)
    assert found.events == pytest.approx([0.5])


def test_switching_reference_finds_a_shallow_dip() -> None:
    """A speed sin(w t) is below the threshold for 4.5 ms."""
    parts = (
        part("a", "Inertia", 0, 0, J=1.0),
        part("t", "Torque", 0, tau=Signal(amplitude=2 * np.pi, omega=2 * np.pi, phase=np.pi / 2)),
        part("c", "Switched", 0, tau_on=1.0, w_low=-0.9999, w_high=5.0),
    )
    found = HybridTrain(Train(parts, (0.0,), (0.0,))).solve(TIMES)
    assert found.events == pytest.approx([0.5 + np.arcsin(0.9999) / (2 * np.pi)], abs=1e-8)


def test_a_description_shrinks_to_what_matters() -> None:
    train = linear_train(0)
    name = train.parts[-1].name
    small = shrunk(train, lambda t: any(p.name == name for p in t.parts))
    assert [p.name for p in small.parts] == [name]
    assert eval(repr(small), {"Train": Train, "Part": Part, "Signal": Signal}) == small


# ---------------------------------------------------------------- counts


def test_the_last_verdict_on_a_train_counts(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    assert judged(log) == []
    noted(log, "order", 7, Verdict(WRONG, "auto: a.w"))
    noted(log, "linear", 3, Verdict(REFUSED, "no inertia | StartError: ..."))
    noted(log, "linear", 4, Verdict(HANG, "no end within 60 s"))
    noted(log, "hybrid", 1, Verdict(UNCLEAR, "a disturbance grows | 1e+05"))
    noted(log, "order", 7, Verdict(RIGHT))
    found = counted(judged(log))
    assert found["verdicts"] == {"linear": {REFUSED: 1, HANG: 1}, "hybrid": {UNCLEAR: 1}, "order": {RIGHT: 1}}
    assert found[REFUSED]["linear"] == {"no inertia": 1}
    assert found[UNCLEAR]["hybrid"] == {"a disturbance grows": 1}
    assert found["short"] == {"linear": {"4": HANG}, "hybrid": {}, "order": {}}
    text = tables(found)
    assert "| linear | 2 | 0 | 1 | 0 | 0 | 0 | 0 | 0 | 1 |" in text
    assert "| no inertia | 1 | 0 | 0 |" in text
    assert "| a disturbance grows | 0 | 1 | 0 |" in text


def test_families_take_turns() -> None:
    whole = sum(SHARES.values())
    found = list(seeds("all", 100, 2 * whole))
    assert len(set(found)) == len(found)
    assert Counter(family for family, _ in found) == {family: 2 * share for family, share in SHARES.items()}
    assert {seed for family, seed in found if family == "hybrid"} == {100, 101, 102, 103}
    assert list(seeds("order", 5, 2)) == [("order", 5), ("order", 6)]


def test_an_analysis_that_is_rightly_refused_counts_as_refused() -> None:
    driven = part("t", "ConstantTorque", 0, tau_constant=3.0)
    train = Train((part("a", "Inertia", 0, 0, J=2.0), driven), (0.0,), (0.0,))
    verdict = judge("analyses", 0, train)
    assert verdict.kind == REFUSED
    assert verdict.reason == "what is driven has no load"
    assert "steady state" in verdict.detail
    assert (
        judge(
            "analyses",
            0,
            Train((*train.parts, part("d", "LinearSpeedDependentTorque", 0, tau_nominal=-1.0, w_nominal=2.0)), (0.0,), (0.0,)),
        ).kind
        == RIGHT
    )


# ---------------------------------------------------------------- gearlib against them


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        *(("linear", seed) for seed in (3, 14, 17, 2160, 20084, 20104, 31020)),
        *(("hybrid", seed) for seed in (1, 4)),
        *(("analyses", seed) for seed in (6, 10002, 600245, 1361083)),
        *(("steady", seed) for seed in (3, 5, 6, 8, 14)),
    ],
)
def test_a_few_trains(family: str, seed: int) -> None:
    verdict = judge(family, seed)
    assert not verdict.short, f"{family} {seed}: {verdict.kind}: {verdict.detail}"


@pytest.mark.stress
@pytest.mark.parametrize(
    ("family", "first"), [(family, first) for family in FAMILIES for first in range(0, 100 if family == "steady" else 500, 50)]
)
def test_many_trains(family: str, first: int) -> None:
    short = [f"{family} {seed}: {v.kind}: {v.detail}" for seed in range(first, first + 50) if (v := judge(family, seed)).short]
    assert not short, "\n".join(short)
