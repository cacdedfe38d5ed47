"""Views of gears: frames, forces of a run, files, and what is refused."""

import json
import re
import xml.etree.ElementTree as ET

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.gears.gear_view import EDGE, SIZE, TOP
from gearlib.errors import ArgumentError, FileError, ModelError, NameLookupError


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def train(**values):
    return gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81, **values)


@pytest.fixture(scope="module")
def run():
    system = gl.compile(train(planet_meshes="separate"), outputs=["w_out"])
    return system.simulate(0.02, samples=201, inputs={"tau_in": 100.0})


def test_a_still_view_shows_every_wheel():
    view = train().gear_view(angle=0.3)
    root = ET.fromstring(view.svg)
    wheels = [g for g in root.iter("{http://www.w3.org/2000/svg}g") if g.get("class") == "wheel"]
    assert len(wheels) == 7
    assert "animate" not in view.svg
    assert "3 × planet: 31 teeth" in view.svg
    assert view.html is None
    with pytest.raises(ArgumentError, match=r"angle is 1e.308; expected an angle"):
        train().gear_view(angle=1e308)
    assert repr(view) == "<GearView of ZhouCui2022: 7 gears, 1 frames; save('gears.svg') writes it>"


def test_a_pair_fills_its_panel_from_edge_to_edge():
    view = train().gear_view("train.p_unit")
    groups = [g for g in ET.fromstring(view.svg).iter("{http://www.w3.org/2000/svg}g") if g.get("class") == "wheel"]
    (x_1, y_1), (x_2, y_2) = ([float(v) for v in re.findall(r"[\d.]+", g.get("transform"))][:2] for g in groups)
    wheels = view.motions[0].gears.wheels
    scale = (x_2 - x_1) / wheels[1].orbit
    r_1, r_2 = (scale * np.hypot(*w.outline.T).max() for w in wheels)
    assert (x_1 - r_1, x_2 + r_2) == pytest.approx((EDGE, SIZE - EDGE), abs=0.03 * SIZE)
    assert y_1 == y_2 == pytest.approx(TOP + SIZE / 2, abs=1)


def test_several_angles_move_the_wheels():
    view = train().gear_view("train.p_unit", angle=[0.0, 0.1, 0.2])
    turns = re.findall(r'type="rotate" values="([^"]*)"', view.svg)
    assert turns[0] == "0;-5.73;-11.46"
    second = [float(v) for v in turns[1].split(";")]
    assert second[1] - second[0] == pytest.approx(np.degrees(0.1) * 19 / 31, abs=0.02)


def test_a_held_carrier_keeps_the_planets_in_place():
    still = train().gear_view("train.x_unit", angle=[0.0, 1.0], held="carrier")
    assert 'type="translate"' not in still.svg
    assert 'type="translate"' in train().gear_view("train.x_unit", angle=[0.0, 1.0]).svg


def test_a_run_is_shown_with_the_forces_of_its_meshes(run):
    times = [0.005, 0.02]
    view = run.gear_view(t=times)
    unit, pair = view.motions
    assert (unit.name, pair.name) == ("train.x_unit", "train.p_unit")
    assert unit.first[-1] == pytest.approx(run["train.x_unit.sun.phi"][-1])
    assert unit.carrier[0] == pytest.approx(run["train.x_unit.carrier.phi"][50])
    assert pair.forces[:, 0] == pytest.approx(run["train.p_unit.mesh.f"][[50, 200]])
    assert unit.forces.shape == (2, 6)
    ring = run["train.x_unit.ring_meshes[1].f"][-1]
    assert unit.forces[-1, 4] == pytest.approx(ring)
    *_, fx, fy = unit.arrows(1)[4]
    assert np.hypot(fx, fy) == pytest.approx(0.32 * unit.gears.extent * abs(ring) / unit.largest)


def test_lumped_meshes_share_their_force_among_the_planets():
    found = gl.compile(train()).simulate(0.01, samples=11, inputs={"tau_in": 100.0})
    unit = found.gear_view("train.x_unit", t=0.01).motions[0]
    assert unit.forces[0, :3].sum() == pytest.approx(found["train.x_unit.sun_mesh.f"][-1])
    assert unit.forces[0, 3:].sum() == pytest.approx(found["train.x_unit.ring_mesh.f"][-1])


def test_the_page_holds_every_frame_and_loads_nothing(run, tmp_path):
    target = run.gear_view("train.x_unit", t=np.linspace(0, 0.02, 7)).save(tmp_path / "gears.html")
    page = target.read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', page)
    frames = json.loads(data)
    assert [len(frames), len(frames[0]["wheels"]), len(frames[0]["arrows"])] == [7, 5, 6]
    assert frames[-1]["caption"] == "t = 0.02 s"
    assert not re.search(r"https?://(?!www\.w3\.org)", page)


def test_pictures_of_one_frame_have_no_page(tmp_path):
    with pytest.raises(ArgumentError, match=r"path is .*the picture is SVG: name it \.\.\.\.svg \(a browser"):
        train().gear_view().save(tmp_path / "gears.html")
    with pytest.raises(ArgumentError, match=r"or \.\.\.\.html for a page with a slider"):
        train().gear_view(angle=[0.0, 1.0]).save(tmp_path / "gears.png")
    with pytest.raises(FileError, match="cannot be written: No such file or directory"):
        train().gear_view().save(tmp_path / "missing" / "gears.svg")


def test_an_animation_moves_wheels_and_arrows(run, tmp_path):
    animation = run.gear_view("train.p_unit", t=[0.0, 0.01]).animate()
    animation.save(tmp_path / "gears.gif", writer="pillow", dpi=20)
    assert (tmp_path / "gears.gif").read_bytes()[:6] == b"GIF89a"


def test_true_tooth_data_are_shown_where_they_are_given():
    class Pair(gl.Component):
        def assemble(self):
            self.mesh, self.brake = gp.ExternalMesh(r_a=0.02, r_b=0.04, c=1e8, d=0.0), gp.Fixed()
            return [gl.connect(self.mesh.flange_b, self.brake.flange)]

    data = gp.GearPair(19, 38, 2e-3, 0.02, x_1=0.5)
    view = Pair().gear_view("mesh", gears=data.drawn_gears())
    assert view.motions[0].gears.wheels[1].orbit == pytest.approx(data.centre_distance)
    with pytest.raises(ModelError, match=r"'mesh' has no gears whose teeth are known; expected meshes with z_a"):
        Pair().gear_view("mesh")
    with pytest.raises(ArgumentError, match=r"gears is .*; expected gears, such as GearPair"):
        Pair().gear_view("mesh", gears=data)


def test_what_cannot_be_shown_is_refused(run, tmp_path):
    with pytest.raises(NameLookupError, match=r"ZhouCui2022 has no part 'train\.y_unit'; did you mean"):
        train().gear_view("train.y_unit")
    with pytest.raises(ArgumentError, match="held is 'planet'; expected 'ring', 'carrier', 'sun'"):
        train().gear_view(held="planet")
    with pytest.raises(ArgumentError, match=r"t is 0\.03; the run goes from 0 to 0\.02 s"):
        run.gear_view(t=0.03)
    with pytest.raises(ArgumentError, match=r"angle is .*; expected an angle in rad, or a sequence of them, 1000 at most"):
        train().gear_view(angle=[])
    run.save(tmp_path / "run.csv")
    with pytest.raises(ArgumentError, match="no model whose gears could be drawn"):
        gl.load_result(tmp_path / "run.csv").gear_view()
