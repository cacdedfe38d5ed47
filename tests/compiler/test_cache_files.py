"""Files of the cache one by one: what is made, kept, told, and removed, with bytes of a test instead of machine code."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gearlib.compiler import cache
from gearlib.compiler.cache import FORMAT, VERSION, cached_bytes, folder
from gearlib.compiler.ownership import make_private


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of this version, in a cache of the test's own; each file is looked at for the size of all."""
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_temporary", None)
    monkeypatch.setattr(cache, "_noticed", set())
    monkeypatch.setattr(cache, "ONE_IN", 1)
    yield folder()
    if cache._temporary is not None:
        cache._temporary[1]()


def maker(content: bytes, made: list[bytes]) -> Callable[[], bytes]:
    def make() -> bytes:
        made.append(content)
        return content

    return make


def test_the_folder_is_that_of_a_version_on_an_interpreter(own: Path, tmp_path: Path) -> None:
    assert own == tmp_path / "cache" / f"{VERSION}-{FORMAT}-py{sys.version_info.major}.{sys.version_info.minor}"
    assert own.is_dir()
    assert sys.platform == "win32" or stat.S_IMODE(own.stat().st_mode) == 0o700


@pytest.mark.parametrize("content", [b"", b"\n", b"one\ntwo\nthree", bytes(range(256)) * 9])
def test_what_is_made_once_is_read_from_then_on(own: Path, content: bytes) -> None:
    made: list[bytes] = []
    assert [cached_bytes("gearlib_model_a.o", maker(content, made)) for _ in range(3)] == [content] * 3
    assert made == [content]
    whole = (own / "gearlib_model_a.o").read_bytes()
    assert whole == hashlib.sha256(b"gearlib_model_a.o\0" + content).digest() + content
    assert [file.name for file in own.iterdir()] == ["gearlib_model_a.o"]


def test_a_file_is_bound_to_its_name_and_its_content(own: Path) -> None:
    made: list[bytes] = []
    cached_bytes("gearlib_model_a.o", maker(b"first", made))
    good = (own / "gearlib_model_a.o").read_bytes()
    for bad in (good[:-1], good + b"x", good[:31], b"", bytes([good[0] ^ 1]) + good[1:], good[:32] + b"other"):
        (own / "gearlib_model_a.o").write_bytes(bad)
        assert cached_bytes("gearlib_model_a.o", maker(b"again", made)) == b"again", bad
    assert made == [b"first", *[b"again"] * 6]
    (own / "gearlib_model_b.o").write_bytes((own / "gearlib_model_a.o").read_bytes())
    assert cached_bytes("gearlib_model_b.o", maker(b"its own", made)) == b"its own"
    assert len({cache.seal_of(name, content) for name in ("a", "b") for content in (b"a", b"b")}) == 4


def test_a_file_that_is_read_counts_as_used(own: Path) -> None:
    made: list[bytes] = []
    cached_bytes("gearlib_model_a.o", maker(b"first", made))
    os.utime(own / "gearlib_model_a.o", (5, 5))
    cached_bytes("gearlib_model_a.o", maker(b"first", made))
    assert (own / "gearlib_model_a.o").stat().st_mtime > 1e9


def test_users_are_told_once_what_takes_long_and_where_it_is_kept(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(cache, "notice", said.append)
    made: list[bytes] = []
    cached_bytes("gearlib_model_a.o", maker(b"a", made))
    assert said == []
    for name in ("b", "b", "c"):
        cached_bytes(f"gearlib_model_{name}.o", maker(b"b", made), "a large model")
    assert said == [f"gearlib compiles a large model; the result is kept in {own}"]
    cached_bytes("gearlib_model_b.o", maker(b"b", made), "its solvers")  # is there already
    assert len(said) == 1
    monkeypatch.setattr(cache, "folder", cache.private)
    cached_bytes("gearlib_model_d.o", maker(b"d", made), "its solvers")
    assert said[1:] == ["gearlib compiles its solvers; the result is kept until the process ends"]


def test_a_folder_of_the_process_is_one_for_all_and_ends_with_it(own: Path) -> None:
    one = cache.private()
    assert one == cache.private()
    assert one.is_dir()
    assert one.name.startswith("gearlib-")
    assert cache._temporary is not None
    cache._temporary[1]()
    assert not one.exists()


@pytest.mark.parametrize("where", [None, "a file", "nowhere"])
def test_without_a_folder_that_can_be_made_that_of_the_process_is_taken(
    own: Path, where: str | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if where is None:
        assert folder() == own
        return
    (tmp_path / "a file").write_text("")
    path = tmp_path / where / "deeper"
    if where == "nowhere":
        monkeypatch.setattr(cache.os, "access", lambda path, mode: mode != os.W_OK)
    monkeypatch.setenv("GEARLIB_CACHE", str(path))
    assert folder() == cache.private() != own


def test_a_file_is_whole_or_not_there(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.write(own / "gearlib_model_a.o", b"whole")
    assert (own / "gearlib_model_a.o").read_bytes() == b"whole"
    seen: list[tuple[str, Path]] = []

    def replace(source: str, target: Path) -> None:
        seen.append((Path(source).name, Path(target)))
        assert Path(source).read_bytes() == b"other"
        raise KeyboardInterrupt

    monkeypatch.setattr(cache.os, "replace", replace)
    with pytest.raises(KeyboardInterrupt):
        cache.write(own / "gearlib_model_a.o", b"other")
    assert (own / "gearlib_model_a.o").read_bytes() == b"whole"
    assert [file.name for file in own.iterdir()] == ["gearlib_model_a.o"]
    ((name, target),) = seen
    assert name.startswith("gearlib_model_a.")
    assert name.endswith(".tmp")
    assert target == own / "gearlib_model_a.o"


@pytest.mark.parametrize(("largest", "left"), [(40, "abcd"), (39, "bcd"), (30, "bcd"), (29, "cd"), (20, "cd"), (0, "d")])
def test_the_least_recently_used_files_go_first_and_never_the_one_in_use(
    own: Path, monkeypatch: pytest.MonkeyPatch, largest: int, left: str
) -> None:
    """Until the rest fits; of all versions, and whatever has another name stays."""
    older = own.parent / "0.1-3-py3.9"
    make_private(older / "deep")
    files = {
        "a": older / "deep" / "gearlib_model_a.o", "b": own / "gearlib_code_b.o", "c": older / "gearlib_model_c.o",
        "d": own / "gearlib_model_d.o",
    }  # fmt: skip
    for time, name in enumerate("dabc"):
        files[name].write_bytes(b"0123456789")
        os.utime(files[name], (time, time))
    strange = [own / "mine.o", own.parent / "gearlib_model_x.o", own.parent / "other" / "gearlib_model_y.o"]
    make_private(strange[2].parent)
    for path in strange:
        path.write_bytes(b"0" * 50)
    monkeypatch.setattr(cache, "LARGEST", largest)
    cache.shrink(files["d"])
    assert "".join(name for name, path in files.items() if path.exists()) == left
    assert all(path.exists() for path in strange)


@pytest.mark.skipif(sys.platform == "win32", reason="every user has a folder of their own there")
def test_folders_of_others_in_the_cache_are_left_alone(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    foreign = own.parent / "0.1-3-py3.9"
    make_private(foreign)
    (foreign / "gearlib_model_a.o").write_bytes(b"0123456789")
    foreign.chmod(0o777)
    monkeypatch.setattr(cache, "LARGEST", 0)
    cache.shrink(own / "gearlib_model_d.o")
    assert (foreign / "gearlib_model_a.o").exists()
    foreign.chmod(0o700)
    cache.shrink(own / "gearlib_model_d.o")
    assert not (foreign / "gearlib_model_a.o").exists()


def test_only_one_in_some_files_is_a_reason_to_look_at_the_size_of_all(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[Path] = []
    monkeypatch.setattr(cache, "shrink", looked.append)
    monkeypatch.setattr(cache, "ONE_IN", 4)
    made: list[bytes] = []
    names = [f"gearlib_model_{k}.o" for k in range(40)]
    for name in names:
        cached_bytes(name, maker(b"x", made))
    assert looked == [own / name for name in names if cache.seal_of(name, b"x")[0] % 4 == 0]
    assert looked


def test_folders_are_made_with_all_that_is_above_them_for_the_user_alone(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b" / "c"
    make_private(deep)
    make_private(deep)
    assert deep.is_dir()
    if sys.platform != "win32":
        assert [stat.S_IMODE(path.stat().st_mode) for path in (deep, deep.parent, deep.parent.parent)] == [0o700] * 3


def test_a_forked_process_leaves_the_folder_of_its_parent(own: Path) -> None:
    """It has none of its own yet, and what it held before the fork is free again."""
    one = cache.private()
    assert cache._temporary is not None
    end = cache._temporary[1]
    cache.COMPILING.acquire()
    cache.after_fork()
    assert cache._temporary is None
    assert not end.alive
    assert one.is_dir()
    with pytest.raises(RuntimeError):
        cache.COMPILING.release()
    assert cache.private() != one
    cache.COMPILING.acquire()
    cache._temporary, kept = None, cache._temporary
    cache.after_fork()
    assert cache._temporary is None
    cache._temporary = kept
    one.rmdir()
