"""Generated source: readable, and of a size that does not grow with the model."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.native.identifiers import identifiers
from gearlib.native.source import MOST_LOOPS, Body, function, is_small, sign_groups
from gearlib.program.program import Batch

c = gl.connect


class Chain(gl.Component):
    n = gl.Structural(3)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=gl.sin(3 * gl.time))
        self.body = [gp.Inertia(J=1.0 + i) for i in range(self.n)]
        self.shaft = [gp.SpringDamper(c=50.0, d=0.5) for _ in range(self.n - 1)]
        links = [c(self.torque.flange, self.body[0].flange_a)]
        for a, s, b in zip(self.body, self.shaft, self.body[1:]):
            links += [c(a.flange_b, s.flange_a), c(s.flange_b, b.flange_a)]
        return links


def test_a_small_model_is_written_out_in_its_own_names() -> None:
    source = gl.compile(Chain(n=3)).source
    for name in ("body_0_w", "shaft_1_phi_rel", "shaft_1_c", "body_2_J", "der_body_2_w"):
        assert name in source


def test_the_source_of_a_large_model_does_not_grow() -> None:
    small, large = gl.compile(Chain(n=300)), gl.compile(Chain(n=600))
    assert not is_small(small.translation.scene.program)
    assert small.source == large.source


@pytest.mark.parametrize("n", [3, 120])
def test_written_out_and_looped_code_compute_the_same(n: int) -> None:
    """Against the matrices of the chain."""
    system = gl.compile(Chain(n=n), outputs=["body[0].w"])
    found = system.simulate(0.3, samples=4, method="rk", rtol=1e-11)
    exact = system.simulate(0.3, samples=4, method="exact")
    ida = system.simulate(0.3, samples=4, method="ida", rtol=1e-10)
    assert found["body[0].w"] == pytest.approx(exact["body[0].w"], rel=1e-9, abs=1e-12)
    assert ida["body[0].w"] == pytest.approx(exact["body[0].w"], rel=1e-7, abs=1e-10)
    assert np.abs(exact["body[0].w"]).max() > 0.01


def test_identifiers_are_distinct_and_valid() -> None:
    names = identifiers(["a.b", "a_b", "a[0].b", "lambda", "3x", "der(der(x))", "x", "dx"])
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)
    assert "lambda" not in names
    assert "x" not in names
    raised = identifiers(["J².w", "J2.w", "\ufb01.w", "fi.w", "lüfter.w"])  # Python reads the ligature as its letters
    assert len(set(raised)) == 5
    assert all(name.isidentifier() and compile(name, "", "eval").co_names == (name,) for name in raised)
    assert raised[-1] == "lüfter_w"


class Cubic(gl.Component):
    """``y^3 + p y = x``: with a small p the slope by y almost vanishes at x = 0."""

    p = gl.Parameter("1", default=1e-6)
    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1")
    y = gl.Variable("1", guess=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.rate * self.y), gl.Eq(self.y**3 + self.p * self.y, self.x)]


@pytest.mark.parametrize(("share", "fails"), [(0.1, 0), (1.1e-4, 0), (0.9e-4, 1)])
def test_an_evaluation_fails_where_a_determinant_falls_to_a_ten_thousandth(share: float, fails: int) -> None:
    """Of that of the first evaluation, at y = 1; other solutions are near there."""
    translation = gl.compile(Cubic()).translation
    scene, rates = translation.scene, np.zeros(1)
    data = scene.data(scene.native, scene.prepared(translation.parameter_values({})), *(np.zeros(0),) * 2, np.ones(5))
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)(scene.native.rhs.address)
    for y, result in ((1.0, 0), (0.3, 0), (np.sqrt(share), fails)):
        x = np.array([y**3 + 1e-6 * y])
        assert call(0.0, *(a.ctypes.data for a in (x, rates, data, scene.native.index))) == result
        assert result or rates[0] == pytest.approx(-y, rel=1e-9)


def pieces(count: int, kinds: int, literal: bool = False) -> tuple[Body, list[int]]:
    """A body of fragments that each append a number of their own, multiplied by the number of their kind, to ``seen``."""
    body, expected = Body(literal=literal), []
    body.array([7])  # something else comes first
    made = []
    for number in range(count):
        piece, kind = body.piece(), number % kinds
        place, other = piece.array([100 + number]), piece.array([number, 3])
        piece.lines += [f"o, h = {place}, {other}", f"seen.append({kind + 1} * index[o] + index[h + 1])"]
        expected.append((kind + 1) * (100 + number) + 3)
        made.append(piece)
    body.include_all(made)
    return body, expected


@pytest.mark.parametrize(
    ("count", "looped"), [(0, False), (1, False), (MOST_LOOPS, False), (MOST_LOOPS + 1, True), (100, True)]
)
@pytest.mark.parametrize("base", [0, 5])
def test_fragments_are_carried_out_in_order(count: int, looped: bool, base: int) -> None:
    """Written one after the other or, where they are many, as a loop over their kinds: with the arrays of each."""
    body, expected = pieces(count, 3)
    assert any("for step in range" in line for line in body.lines) == looped
    seen: list[int] = []
    index = np.concatenate([np.full(base, -1), body.packed(base)])
    exec("\n".join(body.lines), {"index": index, "b": base, "seen": seen})
    assert seen == expected
    assert index[index[base]] == 7
    if looped:
        assert sum("seen.append" in line for line in body.lines) == 3


def test_a_small_program_has_no_loop_over_fragments() -> None:
    body, expected = pieces(MOST_LOOPS + 5, 2, literal=True)
    assert len([line for line in body.lines if "seen.append" in line]) == len(expected)
    assert body.piece().literal


def test_rows_of_equal_signs_are_one_loop() -> None:
    """Each row once, in order; one group where all signs are the same, or are read from an index array."""
    program = gl.compile(Chain(n=12)).translation.scene.program
    for batch in (step for step in program.steps if isinstance(step, Batch)):
        rng = np.random.default_rng(len(batch))
        own = replace(
            batch, signs=rng.choice([-1, 1], len(batch)), argument_signs=rng.integers(-1, 2, batch.argument_signs.shape)
        )
        table = np.column_stack([own.signs, own.argument_signs])
        groups = list(sign_groups(own))
        assert sorted(np.concatenate(groups).tolist()) == list(range(len(own)))
        patterns = [np.unique(table[rows], axis=0) for rows in groups]
        assert all(len(pattern) == 1 for pattern in patterns)
        assert len({pattern.tobytes() for pattern in patterns}) == len(groups)
        assert all((np.diff(rows) > 0).all() for rows in groups)
        for other in (
            sign_groups(own, frozenset([own.kernel])),
            sign_groups(replace(own, signs=0 * own.signs + 1, argument_signs=0 * own.argument_signs)),
        ):
            assert [rows.tolist() for rows in other] == [list(range(len(own)))]
    assert list(sign_groups(batch.take(np.empty(0, np.int64)))) == []


@pytest.mark.parametrize("n", [2, 20])
def test_a_program_is_written_out_up_to_a_limit(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many assignments as it has; equations solved by iteration never are."""
    program = gl.compile(Chain(n=n)).translation.scene.program
    size = sum(len(s) if isinstance(s, Batch) else len(s.unknowns) for s in program.steps)
    for longest in (size, size - 1):
        monkeypatch.setattr("gearlib.native.source.LONGEST", longest)
        assert is_small(program) == (longest == size)
    monkeypatch.setattr("gearlib.native.source.LONGEST", 1000)
    assert not is_small(gl.compile(Cubic()).translation.scene.program)


def test_a_function_reads_where_its_integers_begin() -> None:
    body = Body()
    assert function("f", ["x", "data"], body, 3) == "def f(t: float, x: floats, data: floats) -> int32:\n    return 0\n"
    body.lines.append(f"y = {body.array([4])}")
    text = function("f", ["x", "fired", "index"], body, 3)
    assert text == (
        "def f(t: float, x: floats, fired: int32s, index: ints) -> int32:\n    b = index[3]\n    y = index[b + 0]\n    return 0\n"
    )
