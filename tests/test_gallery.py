"""The gallery's order, the home page's tasks, and pages kept by version."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def module(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_the_gallery_has_every_example_in_a_place_of_its_own():
    order = module("gallery_order")
    stems = {path.stem for path in (ROOT / "examples").glob("*.py")}
    assert stems <= set(order.ORDER)
    assert len(order.ORDER) == len(set(order.ORDER))
    key = order.ReaderOrder("examples")
    shown = sorted((f"{stem}.py" for stem in stems), key=key)
    assert shown[0] == "xp_train.py"
    assert key("a_new_one.py") > key("modelica_text.py")


def test_pages_are_kept_by_version(tmp_path):
    keep = module("versions").keep
    built = tmp_path / "html"
    built.mkdir()
    (built / "index.html").write_text("first")
    for version in ("0.9", "0.10", "1.0rc1", "1.0"):
        found = keep(built, tmp_path / "versions", version)
    assert found == ["1.0", "1.0rc1", "0.10", "0.9"]
    (built / "index.html").write_text("second")
    keep(built, tmp_path / "versions", "0.9")
    assert (tmp_path / "versions" / "0.9" / "index.html").read_text() == "second"
    assert (tmp_path / "versions" / "1.0" / "index.html").read_text() == "first"
    assert "url=1.0/index.html" in (tmp_path / "versions" / "index.html").read_text()
