"""Code that others may have put into the cache is never run, and nothing there can make a process wait for ever."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from gearlib.compiler import cache, ownership
from tests.compiler import test_cache
from tests.compiler.test_cache import files, forget, triple

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="every user has a folder of their own there")
ROOT = Path(__file__).resolve().parents[2]
own_folder = test_cache.own_folder
STRANGER = 54321


@pytest.fixture(autouse=True)
def told_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "_refused", set())


@pytest.fixture
def give_away(monkeypatch: pytest.MonkeyPatch) -> object:
    """A function after which a path belongs to somebody else, as far as can be seen."""
    strangers: set[str] = set()
    lstat, fstat = Path.lstat, os.fstat

    def foreign(found: os.stat_result) -> os.stat_result:
        return os.stat_result([STRANGER if i == 4 else value for i, value in enumerate(found)])

    def give(path: Path) -> None:
        if os.geteuid() == 0:
            os.chown(path, STRANGER, -1)
        else:
            strangers.add(str(path))

    monkeypatch.setattr(Path, "lstat", lambda p: foreign(lstat(p)) if str(p) in strangers else lstat(p))
    monkeypatch.setattr(
        ownership.os,
        "fstat",
        lambda h: foreign(fstat(h)) if os.path.realpath(f"/proc/self/fd/{h}") in strangers else fstat(h),
    )
    return give


@pytest.mark.parametrize("how", ["world", "group", "above", "owner", "owner above"])
def test_a_folder_that_others_can_write_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, give_away: object
) -> None:
    shared = tmp_path / "shared" / "cache"
    monkeypatch.setenv("GEARLIB_CACHE", str(shared))
    monkeypatch.setattr(ownership, "of_one_user", lambda group: False)
    assert triple(3) == (6.0, 0)
    before = sorted(p.name for p in shared.rglob("*"))
    assert before
    made = cache.folder()
    victim = {"world": made, "group": made, "above": shared.parent, "owner": made, "owner above": shared}[how]
    if "owner" in how:
        assert callable(give_away)
        give_away(victim)
    else:
        victim.chmod(0o777 if how == "world" else 0o770)
    forget(monkeypatch)
    with pytest.warns(RuntimeWarning, match=r"is not used, since .*: (others can write in|.* belongs to another user)"):
        assert triple(3) == (6.0, 0)
    assert triple(4) == (8.0, 0)  # told once
    assert sorted(p.name for p in shared.rglob("*")) == before


@pytest.mark.parametrize(
    ("group", "members", "own"),
    [("anna", [], True), ("anna", ["anna"], True), ("anna", ["anna", "bert"], False), ("anna", ["bert"], False),
     ("staff", [], False), ("staff", ["anna"], False), (None, [], False)],
)  # fmt: skip
def test_a_group_of_one_user_is_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, group: str | None, members: list[str], own: bool
) -> None:
    """Many systems give each user a group of the same name, and make files and folders that it may write."""
    import grp
    import pwd

    def group_of(number: int) -> SimpleNamespace:
        if group is None:
            raise KeyError(number)
        return SimpleNamespace(gr_name=group, gr_mem=members)

    monkeypatch.setattr(grp, "getgrgid", group_of)
    monkeypatch.setattr(pwd, "getpwuid", lambda number: SimpleNamespace(pw_name="anna"))
    file = tmp_path / "file"
    file.write_bytes(b"code")
    file.chmod(0o660)
    assert ownership.is_own(file) == own
    file.chmod(0o640)
    assert ownership.is_own(file)
    file.chmod(0o602)
    assert not ownership.is_own(file)
    tmp_path.chmod(0o770)
    assert ownership.why_foreign(tmp_path) == (None if own else f"others can write in {tmp_path}")
    tmp_path.chmod(0o700)


def test_what_is_no_file_or_folder_is_nobody_s_own(tmp_path: Path) -> None:
    assert ownership.is_own(tmp_path)
    assert not ownership.is_own(tmp_path / "missing")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path)
    assert not ownership.is_own(tmp_path / "pipe")
    assert not ownership.is_own(tmp_path / "link")


def test_whose_a_folder_is_is_said_by_name(
    tmp_path: Path, give_away: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    import pwd

    give_away(tmp_path)
    assert ownership.why_foreign(tmp_path) == f"{tmp_path} belongs to another user ({STRANGER})"
    monkeypatch.setattr(pwd, "getpwuid", lambda number: SimpleNamespace(pw_name=f"bert{number}"))
    assert ownership.why_foreign(tmp_path) == f"{tmp_path} belongs to the user bert{STRANGER}"


def test_a_sticky_folder_above_is_no_danger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scratch").mkdir()
    (tmp_path / "scratch").chmod(0o1777)
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path / "scratch" / "mine"))
    assert triple(3) == (6.0, 0)
    forget(monkeypatch)
    assert triple(3) == (6.0, 1)
    assert (tmp_path / "scratch" / "mine").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("how", ["owner", "writable", "pipe", "link", "folder"])
def test_a_file_of_others_is_made_anew(own_folder: Path, monkeypatch: pytest.MonkeyPatch, how: str, give_away: object) -> None:
    """The file is valid in itself, checksum included, and would be run."""
    triple(3)
    (file,) = files(own_folder, ".o")
    content = file.read_bytes()
    if how == "owner":
        assert callable(give_away)
        give_away(file)
    elif how == "writable":
        file.chmod(0o666)
    else:
        file.unlink()
        if how == "pipe":
            os.mkfifo(file)
        elif how == "link":
            (own_folder / "elsewhere").write_bytes(content)
            file.symlink_to(own_folder / "elsewhere")
        else:
            file.mkdir()
    forget(monkeypatch)
    value, hit = triple(3)
    assert value == 6.0
    assert not hit
    if how != "folder":
        found = files(own_folder, ".o")
        assert len(found) == 1
        assert not found[0].is_symlink()
        assert found[0].is_file()


def test_a_link_to_a_private_folder_is_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "large disc").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "large disc")
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path / "link"))
    assert triple(3) == (6.0, 0)
    assert cache.folder().is_relative_to(tmp_path.resolve() / "large disc")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path / "circle"))
    assert triple(4) == (8.0, 0)


FORK = """
import os, sys, threading, time, warnings
warnings.simplefilter("ignore", DeprecationWarning)
from gearlib.compiler import cache
from gearlib.compiler import object_code
source = "def f(t: float, x: floats) -> int32:\\n    x[0] = {number} * t\\n    return 0\\n"
begun = threading.Event()
make = object_code.object_code

def slowly(text, fused=False):
    begun.set()
    time.sleep(0.5)
    return make(text, fused)

object_code.object_code = slowly
thread = threading.Thread(target=lambda: object_code.compiled(source.replace("{number}", "3"), "f"), daemon=True)
cache.private()
thread.start()
assert begun.wait(60), "nothing was compiled"
child = os.fork()
if not child:
    object_code.compiled(source.replace("{number}", "4"), "f")
    sys.exit(0)
deadline = time.monotonic() + 60
while time.monotonic() < deadline:
    done, status = os.waitpid(child, os.WNOHANG)
    if done:
        break
    time.sleep(0.05)
else:
    os.kill(child, 9)
    sys.exit("the child hangs")
thread.join()
assert status == 0, status
assert cache.private().exists(), "the child removed its parent's folder"
"""


def test_a_process_that_forks_while_a_thread_compiles(tmp_path: Path) -> None:
    path = os.pathsep.join([str(ROOT), str(ROOT / "library")])
    environment = {**os.environ, "PYTHONPATH": path, "GEARLIB_CACHE": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", FORK], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
