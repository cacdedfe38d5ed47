"""Pictures of the benchmarks: every solver has one colour and one marker, and none is grey."""

import re
from pathlib import Path

import pytest

from tests.benchmarks.page import LINES, tabled_curves
from tests.benchmarks.references import SCENES

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
    curves = tabled_curves(name, PAGE.read_text(encoding="utf-8"))
    shown = {curve.solver for curve in curves if curve.points} & set(LINES)
    assert len(shown) > 8
    with image.open(PAGE.parent / "images" / f"work_precision_{name}.png") as picture:
        pixels = {"#{:02x}{:02x}{:02x}".format(*colour) for _, colour in picture.convert("RGB").getcolors(1 << 16)}
    wanted = {LINES[solver]["color"].replace("black", "#000000") for solver in shown}
    assert wanted <= pixels


def test_the_tables_are_read_as_they_were_written():
    curves = {curve.solver: curve for curve in tabled_curves("M3", PAGE.read_text(encoding="utf-8"))}
    assert curves["gearlib exact"].points == []
    assert {curve.kind for curve in curves.values()} == {"floor", "gearlib", "other"}
    assert curves["SciPy DOP853"].time_to(1e-4) == 1.45
    assert len(curves["SciPy DOP853"].points) == 1
