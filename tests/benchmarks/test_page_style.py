"""Pictures of the benchmarks: every solver has one colour and one marker, and none is grey."""

import re
from pathlib import Path

from tests.benchmarks.page import LINES

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
