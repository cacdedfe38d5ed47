"""Reports: everything is in the file, nothing is loaded from elsewhere, and the script has what it draws."""

import json
import re
import shutil
import subprocess
from collections import UserDict
from html.parser import HTMLParser

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.page import MOST_POINTS, thinned
from gearlib.errors import ArgumentError, FileError, NameLookupError

VOID = {"meta", "link", "br", "img"}


class Read(HTMLParser):
    """Elements with their attributes, and whether all are closed in their order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open:
            self.text.setdefault(self.open[-1], []).append(data)


@pytest.fixture(scope="module")
def system():
    return gl.compile(gp.ZhouCui2022())


@pytest.fixture(scope="module")
def runs(system):
    return {
        "": system.simulate(0.2, samples=301, inputs={"tau_in": 100.0}),
        "damped": system.simulate(0.2, samples=101, inputs={"tau_in": 100.0}, parameters={"C_g": 6000.0}),
    }


@pytest.fixture(scope="module")
def report(system, runs, tmp_path_factory):
    return system.report(
        tmp_path_factory.mktemp("report") / "train.html", result=runs, names=["w_in", "q_sun"], units={"m": "µm"},
        campbell=gl.campbell(system, [0.0, 300.0], {"ring < 1": 31}), power_flow=system.power_flow(torques={"tau_in": 100.0}),
    )  # fmt: skip


def specs(path):
    read = Read()
    text = path.read_text(encoding="utf-8")
    read.feed(text)
    assert not read.open
    return read, [json.loads(t) for t in re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)]


def test_a_report_holds_everything(report, system, runs):
    read, charts = specs(report)
    assert [t for t in read.text["h2"]] == [
        "Diagram", "Summary", "Parameters", "States", "Histories", "Modes", "Critical speeds", "Power flow",
    ]  # fmt: skip
    cells = read.text["td"]
    assert set(system.parameters) <= set(cells)
    assert set(system.states) <= set(cells)
    assert "kg·m²" in cells
    assert "929.687" in "".join(read.text["pre"])
    assert [c["y"] for c in charts] == ["angular velocity, rad/s", "displacement, µm", "frequency, Hz"]
    assert [c["name"] for c in charts[1]["curves"]] == ["q_sun", "q_sun (damped)"]
    assert charts[1]["curves"][0]["y"] == pytest.approx(runs[""]["q_sun"] * 1e6, rel=1e-6)
    assert charts[2]["curves"][-1]["name"] == "ring < 1 (order 31)"
    assert len(charts[2]["points"]) == len(gl.campbell(system, [0.0, 300.0], [31]).crossings)


def test_orders_and_critical_speeds_are_drawn_over_the_speed(system, tmp_path):
    """In 1/min; a line of an order is that many events a revolution, in Hz."""
    found = gl.campbell(system, [100.0, 300.0], {"ring": 31, "out": 2})
    _, (chart,) = specs(system.report(tmp_path / "speeds.html", campbell=found))
    rpm = np.array([100.0, 300.0]) * 30 / np.pi
    assert [c["x"] for c in chart["curves"]] == [pytest.approx(rpm)] * len(chart["curves"])
    lines = {c["name"]: c["y"] for c in chart["curves"] if "order" in c["name"]}
    assert lines == {f"{n} (order {k})": pytest.approx(k * rpm / 60, rel=1e-5) for n, k in (("ring", 31), ("out", 2))}
    modes = [c["y"] for c in chart["curves"] if "order" not in c["name"]]
    assert modes == [pytest.approx(column, rel=1e-5) for column in found.frequencies.T]
    assert [c["name"] for c in chart["curves"]].count("natural frequencies") == 1
    points = [(pytest.approx(c.speed * 30 / np.pi, rel=1e-5), pytest.approx(c.frequency, rel=1e-5)) for c in found.crossings]
    assert [(p["x"], p["y"]) for p in chart["points"]] == points
    assert [p["text"] for p in chart["points"]] == [str(c.mode) for c in found.crossings]
    assert len({c["colour"] for c in chart["curves"]}) == 3


def test_a_report_needs_no_network(report):
    read, _ = specs(report)
    for tag, attributes in read.found:
        for name in ("src", "href", "xlink:href", "action"):
            assert attributes.get(name, "#").startswith(("#", "data:")), (tag, attributes)
    text = report.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"https?://|@import|url\((?!#)", text)


def test_the_script_is_given_what_it_reads(report):
    """Curves of equal lengths, numbers only, and every field that the script asks for."""
    _, charts = specs(report)
    text = report.read_text(encoding="utf-8")
    script = text[text.rindex("<script>") :]
    assert set(re.findall(r"spec\.(\w+)", script)) <= {*charts[0], "xlim"}
    for chart in charts:
        assert all(len(c["x"]) == len(c["y"]) > 1 for c in chart["curves"])
        assert set(re.findall(r"curve\.(\w+)", script)) - {"hidden"} == set(chart["curves"][0])


BROWSER = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_a_browser_draws_every_curve_and_reports_no_error(report, tmp_path):
    """A page whose charts are drawn by its script, in a headless browser: what stands in the document afterwards, and on its console."""
    _, charts = specs(report)
    ran = subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}", "--enable-logging=stderr",
            "--virtual-time-budget=2000", "--dump-dom", report.as_uri(),
        ],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert "CONSOLE" not in ran.stderr
    drawn = re.findall(r'<svg[^>]*aria-label="([^"]*)"(.*?)</svg>', ran.stdout, re.DOTALL)
    drawn = [(name, body) for name, body in drawn if name in [c["y"] for c in charts]]
    assert [name for name, _ in drawn] == [c["y"] for c in charts]
    for (_, body), chart in zip(drawn, charts, strict=True):
        assert len(re.findall(r'<(?:path|polyline)[^>]*\b(?:d|points)="[^"]{10,}"', body)) >= len(chart["curves"])
        assert not re.search("NaN|undefined", body)


def test_a_report_of_little(tmp_path):
    """Without runs and parameters; modes that cannot be given say why."""

    class Spin(gl.Component):
        def assemble(self):
            self.body, self.brake = gp.Inertia(J=1.0, start={"w": 1.0}), gp.BearingFriction()
            return [gl.connect(self.body.flange_b, self.brake.flange_a)]

    system = gl.compile(Spin())
    read, charts = specs(system.report(tmp_path / "spin.html"))
    assert "Histories" not in read.text["h2"]
    assert charts == []


class Failing(UserDict):
    """A mapping whose keys cannot be listed."""

    def __iter__(self):
        raise RuntimeError("no keys")


def test_wrong_arguments_are_refused(system, runs, tmp_path):
    with pytest.raises(ArgumentError, match=r"path is .*name it \.\.\.\.html"):
        system.report(tmp_path / "train.pdf")
    with pytest.raises(FileError, match="cannot be written: there is no folder"):
        system.report(tmp_path / "missing" / "train.html")
    with pytest.raises(ArgumentError, match="result is 3"):
        system.report(tmp_path / "a.html", result=3)
    with pytest.raises(ArgumentError, match=r"result is .*; expected the result of simulate"):
        system.report(tmp_path / "a.html", result=Failing())
    with pytest.raises(ArgumentError, match="campbell is 3; expected a Campbell"):
        system.report(tmp_path / "a.html", campbell=3)
    with pytest.raises(NameLookupError):
        system.report(tmp_path / "a.html", result=runs, names=["w_inn"])
    assert not list(tmp_path.iterdir())


def test_thinned_curves_keep_their_peaks():
    rng = np.random.default_rng(3)
    x, y = np.linspace(0, 1, 50_000), rng.normal(size=50_000)
    y[[77, 40_000]] = 50.0, -60.0
    a, b = thinned(x, y)
    assert len(a) <= MOST_POINTS
    assert (b.max(), b.min()) == (50.0, -60.0)
    assert (a[0], a[-1]) == (0.0, 1.0)
    assert np.isin(b, y).all()


def test_states_of_a_run_stand_at_its_start_and_its_end(tmp_path):
    """A body on its own keeps its speed; its angle grows by 3 rad/s."""
    system = gl.compile(gp.Inertia(J=1.0), outputs=["w", "phi"])
    run = system.simulate(2.0, samples=3, start={"w": 3.0, "phi": 1.0})
    text = system.report(tmp_path / "body.html", result=run).read_text(encoding="utf-8")
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", text, re.DOTALL)]
    states = {row[0]: row[1:3] for row in rows if row and row[0] in ("w", "phi")}
    assert states == {"w": ["3", "3"], "phi": ["1", "7"]}
    alone = system.report(tmp_path / "alone.html").read_text(encoding="utf-8")
    assert ("at the end" in text, "at the end" in alone) == (True, False)
