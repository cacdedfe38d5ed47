"""Every script in examples/ runs as it is, and the main one prints and draws what its text promises."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
LONG = {"paper_section_4", "paper_gain_margin"}  # many thousand readings


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # figures are written here


@pytest.mark.parametrize(
    "script", [pytest.param(s, id=s.stem, marks=[pytest.mark.slow] if s.stem in LONG else []) for s in EXAMPLES]
)
def test_example_runs(script: Path, elsewhere: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import matplotlib.pyplot as plt

    runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
    printed = capsys.readouterr().out
    assert "nan" not in printed
    if script.stem == "xp_train":
        assert "8 integrated" in printed
        assert "91 unknowns and as many equations, of which 83 are algebraic; index 1" in printed
        ways = re.findall(r"^  (states only|scikit-sundae|exact) +(\S+) ", printed, re.MULTILINE)
        assert [way for way, _ in ways] == ["states only", "scikit-sundae", "exact"]
        assert max(float(difference) for way, difference in ways if way != "scikit-sundae") < 1e-7
        differences = [float(d) for d in re.findall(r"^  \w+ +(\S+e-\d+)$", printed, re.MULTILINE)]
        assert len(differences) == 6
        assert max(differences) < 1e-7
        assert "the train is stable" in printed
        readme = (script.parents[1] / "README.md").read_text(encoding="utf-8")
        told = re.search(r"^\| eigenvalues, relative \| (\S+) ", readme, re.MULTILINE)
        found = re.search(r"explicit form's eigenvalues: (\S+)$", printed, re.MULTILINE)
        assert told is not None
        assert found is not None
        assert float(found[1]) < 10 * float(told[1])  # rounding, which differs from machine to machine
        assert re.search(r"k w_out / tau_in +9\.16 +94\.89 +0\.649", printed)
        figures = {path.name: path.stat().st_size for path in (tmp_path / "figures").iterdir()}
        assert set(figures) == {"time_histories.png", "nyquist.png", "nichols.png"}
        assert min(figures.values()) > 20_000
    if script.stem == "synthesis":
        found, by_hand = (
            [[float(x) for x in row] for row in re.findall(rf"{who} +(\S+) +(\S+) +(\S+) +(\S+) ", printed)]
            for who in ("gearlib", "by hand")
        )
        assert len(found) == 3
        assert found == [pytest.approx(row, rel=2e-6) for row in by_hand]
        rows = re.findall(r"^(?:PX|XP|XX) .* (?:\d\.\d{4}|locks) +\S+ +(\d+), (\d+), (\d+)$", printed, re.MULTILINE)
        assert len(rows) == int(re.search(r"trains in (\d+) arrangements", printed)[1]) == 32
        assert all(0 < float(a) < float(b) < float(c) for a, b, c in rows)
        assert re.search(r" 0\.000 rad/s\n.*efficiency 0\.0000", printed)  # the design that locks, driven backwards
        assert float(re.search(r"largest difference of the map .*: (\S+)", printed)[1]) < 1e-12
    if script.stem == "xp_parametric_resonance":
        rows = re.findall(r"^[XP] unit: .* (\d+) +(\d\.\d\d) +(\S+) +(\S+)$", printed, re.MULTILINE)
        assert len(rows) == 7
        assert sorted(float(predicted) > 0 for *_, predicted, _ in rows) == [False] * 3 + [True] * 4
        for *_, predicted, measured in rows:
            assert float(measured) == pytest.approx(float(predicted), rel=1e-3, abs=0.1)
    if script.stem == "paper_section_4":
        number = r"(-?\d+\.\d+|infinite|inf)"
        page = (script.parents[1] / "docs" / "paper_section_4.md").read_text(encoding="utf-8")
        verdicts = "stable|marginal|unstable"
        shown = re.findall(rf"\| {number} \| {number} \| (\d) \| ({verdicts}) \|", page)
        found = re.findall(rf" {number} +{number} +(\d)  ({verdicts})$", printed, re.MULTILINE)
        assert len(shown) > 35
        assert {tuple(cell.replace("infinite", "inf") for cell in row) for row in shown} <= set(found)
    if script.stem == "xp_weakly_nonlinear":
        folds = dict(re.findall(r"^([\w ,]+?)  +(\d+\.\d, \d+\.\d|none) +\S", printed, re.MULTILINE))
        assert folds["sun, pair"] == "none"
        page = (script.parents[1] / "docs" / "weak_nonlinearity.md").read_text(encoding="utf-8")
        assert all(f"| {found} |" in page for found in folds.values())
        assert [float(w) for w in folds["one planet"].split(", ")] == pytest.approx([6167, 6986], abs=1)
        assert folds["ring"] == folds["ring, sun, pair"] != "none"
        rows = re.findall(r"^ +(\d+) +(\S+) +(\S+)   (.+)$", printed, re.MULTILINE)
        assert len(rows) == 4
        for (
            _,
            below,
            above,
            balance,
        ) in rows:  # runs from either side end in the stable motions of harmonic balance, and in no others
            expected = sorted(float(a) for a in balance.split(","))
            assert sorted({float(below), float(above)}) == pytest.approx(expected, rel=5e-3)
        grown = re.findall(r"^ +(\d{5}) +(\S+) +(\S+)$", printed, re.MULTILINE)
        assert len(grown) == 2
        for _, predicted, measured in grown:
            assert float(measured) == pytest.approx(float(predicted), rel=2e-2)
            assert float(measured) > 0
