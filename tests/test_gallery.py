"""The gallery's order, the home page's tasks, pages kept by version, and the wheel of a release."""

import base64
import hashlib
import importlib.util
import io
import zipfile
from pathlib import Path

import pytest

import gearlib as gl
import gearparts as gp

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


def test_clicks_are_counted_along_the_shortest_way():
    clicks = module("clicks")
    pages = {
        "index.html": '<nav><a href="c.html">aside</a></nav><article><a href="a.html">A</a><a href="b.html#x">B</a></article>',
        "a.html": '<article><a href="d/e.html">E</a></article>',
        "b.html": '<article><a href="https://example.org/e.html">out</a></article>',
        "d/e.html": '<article>done(1)<a href="../c.html">C</a></article>',
        "c.html": "<article>here</article>",
    }

    def read(name):
        return clicks.Article(pages[name])

    assert clicks.clicks(read, ("d/e.html", "done(")) == [("A", "a.html"), ("E", "d/e.html")]
    assert clicks.clicks(read, ("c.html", "here")) == [("A", "a.html"), ("E", "d/e.html"), ("C", "c.html")]
    assert clicks.clicks(read, ("c.html", "here"), most=2) is None
    assert clicks.clicks(read, ("b.html", "nothing of this")) is None


def test_the_home_page_leads_to_every_task():
    clicks = module("clicks")
    home = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page, text in clicks.TASKS.values():
        source = ROOT / "docs" / page.replace(".html", ".md")
        if page.startswith("gallery/"):
            source = ROOT / "examples" / f"{Path(page).stem}.py"
        assert page.removesuffix(".html") in home
        assert text in source.read_text(encoding="utf-8"), page


def hatchling_like_wheel(path, files):
    """A wheel as hatchling writes it: files, then RECORD."""
    record = "p-1.dist-info/RECORD"
    rows = [f"{name},sha256=old,0" for name in files] + [f"{record},,"]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in [*files.items(), (record, "\n".join(rows) + "\n")]:
            member = zipfile.ZipInfo(name, (2020, 2, 3, 4, 5, 6))
            member.external_attr, member.compress_type = 0o100644 << 16, zipfile.ZIP_DEFLATED
            archive.writestr(member, text)
    return path


def test_the_release_wheel_has_the_same_code_and_its_own_hashes(tmp_path):
    text = 'x = \'# no comment\'  # one\n# another\ndef f() -> int:\n    """# Doc."""\n    return 1 # type: ignore\n'
    path = hatchling_like_wheel(tmp_path / "p.whl", {"gearlib/ä.py": text, "gearlib/empty.py": "", "gearlib/a.css": "/* # */"})
    wheel = module("wheel")
    files = wheel.contents(path)
    assert wheel.same(files["gearlib/ä.py"].decode(), text)
    assert files["gearlib/ä.py"].decode().split("\n")[:2] == ["x = '# no comment'", ""]
    assert files["gearlib/a.css"] == b""
    for row in files["p-1.dist-info/RECORD"].decode().splitlines()[:-1]:
        name, digest, size = row.split(",")
        assert base64.urlsafe_b64decode(digest.removeprefix("sha256=") + "=") == hashlib.sha256(files[name]).digest()
        assert int(size) == len(files[name])


SOURCE = '''"""A module.

    With a margin.
"""
if (a and
        b):  # why

    class A:
        """A class.

        >>> for x in y:
        ...     pass

            Indented.
        """

        @f(
            1,  # one
        )
        def g(self, x: int = """two
    lines"""):
            """
            Doc.
            """
            return x + \\
                f"""{x:>{3}} {{
                {x!r} # no comment
            """
c = "//"
'''


def test_a_source_in_fewer_bytes_is_the_same_program():
    wheel = module("wheel")
    found = wheel.compact(SOURCE)
    assert wheel.same(SOURCE, found)
    assert len(found.splitlines()) == len(SOURCE.splitlines())
    assert "\n  def g(self, x: int = " in found
    assert "\n      Indented.\n" in found
    assert "# no comment" in found
    assert "why" not in found
    assert "# one" not in found
    assert not wheel.same(SOURCE, found.replace("(a and", "(a or"))
    assert not wheel.same(SOURCE, found.replace("Indented", "indented"))
    for path in ("gearlib/compiler/translate.py", "gearlib/progress.py", "library/gearparts/__init__.py"):
        source = (ROOT / path).read_text(encoding="utf-8")
        assert wheel.same(source, wheel.compact(source)), path


def test_c_in_fewer_bytes_has_the_same_lines():
    wheel = module("wheel")
    source = 'int a; /* one\n two */ char *b = "/* \\" // */"; // three\n\tchar c = \'"\';\n'
    assert wheel.bare(source) == 'int a;\nchar *b = "/* \\" // */";\nchar c = \'"\';\n'


def test_the_release_wheel_has_the_docstrings_that_are_shown(tmp_path):
    text = (
        "class A:\n    'A.'\n    def _f(self):\n        '''Hidden,\n        twice.'''\n        return 1\n"
        "    def __len__(self): 'Shown.'\nclass _B:\n    'Only.'\n"
    )
    found = module("wheel").contents(hatchling_like_wheel(tmp_path / "p.whl", {"a.py": text}))["a.py"].decode()
    assert len(found.splitlines()) == len(text.splitlines())
    space = {}
    exec(compile(found, "a.py", "exec"), space)
    own = space["A"]
    assert (own.__doc__, own._f.__doc__, own.__len__.__doc__) == ("A.", None, "Shown.")
    assert own()._f() == 1
    assert own._f.__code__.co_firstlineno == 3


def test_public_names_keep_their_docstrings_in_the_release_wheel():
    engine, public = module("wheel").ENGINE, {name: getattr(owner, name) for owner in (gl, gp) for name in dir(owner)}
    owners = {
        name: getattr(value, "__module__", "").replace(".", "/") + ".py" for name, value in public.items() if name[0] != "_"
    }
    assert "gearlib/system.py" in owners.values()
    assert [name for name, owner in owners.items() if owner.startswith(engine)] == []


def test_the_release_wheel_is_an_archive_that_others_read(tmp_path):
    pytest.importorskip("zopfli")
    path = hatchling_like_wheel(tmp_path / "p.whl", {"gearlib/ä.py": (ROOT / "docs" / "conf.py").read_text(), "b.py": ""})
    wheel = module("wheel")
    data, files = wheel.compressed(path, effort=1), wheel.contents(path)
    assert len(data) < path.stat().st_size
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(io.BytesIO(data)) as new:
        assert new.testzip() is None
        assert [(m.filename, m.date_time, m.external_attr) for m in new.infolist()] == [
            (m.filename, m.date_time, m.external_attr) for m in old.infolist()
        ]
        assert {name: new.read(name) for name in new.namelist()} == files
