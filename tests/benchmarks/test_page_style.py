"""Pictures of the benchmarks: every solver has one colour and one marker, and none is grey."""

import math
import re
from pathlib import Path

import pytest

from tests.benchmarks.page import CURVES, LINES, Row, goals, loaded, row
from tests.benchmarks.references import SCENES
from tests.benchmarks.work_precision import Curve, Point

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md"


def test_every_solver_of_the_page_has_a_colour_of_its_own_and_none_is_grey():
    solvers = set(
        re.findall(r"^\| ((?:gearlib|SciPy|CasADi|heyoka|rumoca)[^|]*) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert solvers
    assert solvers <= set(LINES)
    looks = [(style["color"], style["marker"]) for style in LINES.values()]
    assert len(set(looks)) == len(looks)
    for solver, style in LINES.items():
        if solver != "gearlib auto":  # a black ring around another curve
            red, green, blue = (int(style["color"][k : k + 2], 16) for k in (1, 3, 5))
            assert max(red, green, blue) - min(red, green, blue) > 60, solver


@pytest.mark.parametrize("name", SCENES)
def test_the_curves_of_the_tables_are_in_the_pictures_in_their_colours(name):
    image = pytest.importorskip("PIL.Image")
    shown = {curve.solver for curve in loaded(CURVES.load())[name] if not all(map(math.isnan, curve.ms))} & set(LINES)
    assert len(shown) > 8
    with image.open(PAGE.parent / "images" / f"work_precision_{name}.png") as picture:
        pixels = {"#{:02x}{:02x}{:02x}".format(*colour) for _, colour in picture.convert("RGB").getcolors(1 << 16)}
    wanted = {LINES[solver]["color"].replace("black", "#000000") for solver in shown}
    assert wanted <= pixels


def test_a_row_has_the_times_of_its_curve():
    points = [Point(1e-3, 2e-4, [3.0], [1.0]), Point(1e-5, 5e-5, [4.0], [3.5]), Point(1e-6, 1e-6, [8.0], [7.0])]
    found = row(Curve("gearlib rk5", "gearlib", points, "x"))
    assert found.ms == pytest.approx([3e3 * (4 / 3) ** 0.5, 8e3, math.nan], nan_ok=True)
    assert found.inner_ms[1:] == pytest.approx([7e3, math.nan], nan_ok=True)
    assert (found.quotients, found.beside_ms, found.remark) == (pytest.approx([0.2, 5.0]), pytest.approx(500.0), "x")
    assert found.time_to(1e-6) == pytest.approx(8.0)
    assert row(Curve("gearlib ida", "gearlib", points)).level_ms == pytest.approx([math.nan, 7e3, math.nan], nan_ok=True)
    assert row(Curve("heyoka", "other")).quotients == []


def test_goals_are_told_from_the_rows():
    def solver(name, kind, *ms):
        return Row(name, kind, ms, [math.nan] * 3, [0.005, 1.0], [math.nan] * 3, 0.4, "")

    rows = [solver("gearlib auto", "gearlib", 1.0, 2.0, 4.0), solver("gearlib rk5", "gearlib", 1.0, 2.0, 4.0)]
    rows += [solver("heyoka", "other", 0.5, 2.0, 8.0), solver("SciPy LSODA", "other", 4.0, 20.0, math.nan)]
    acausal, others, taylor, beside, careful, _ = goals({"M2": [*rows, solver("rumoca bdf", "acausal", 40.0, 80.0, 80.0)]})
    assert acausal.endswith("held on M2 (20 to 40); missed on none.")
    assert others.endswith("held on none; missed on M2 (4).")
    assert taylor.endswith("faster on M2 (1 to 2); heyoka's is faster on M2 (2).")
    assert beside.endswith("missed on M2 (0.4).")
    assert careful.endswith("less with rk5 on M2 (from 0.005).")
