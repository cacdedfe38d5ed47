"""Ownership checks: cached code is executed only from files and folders that no other user can write.

Compiled code planted in a cache by another user would run with the rights of whoever loads it. So a folder is trusted only if nobody
but its owner and the administrator can write to it or replace it, and a file only if it is a regular one of the same owner. A checksum
is no protection: whoever writes the code can write its checksum. On Windows every user has a folder of their own, and nothing is
checked.
"""

from __future__ import annotations

import os
import stat
import sys
from contextlib import suppress
from pathlib import Path

ADMINISTRATOR = 0
NOT_FOLLOWED = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # nor block on a pipe


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents, accessible to the user only."""
    for path in [*reversed(folder.parents), folder]:
        if not path.exists():
            path.mkdir(mode=0o700, exist_ok=True)


def why_foreign(folder: Path) -> str | None:
    """Reason why another user could write to a folder or replace it; None where nobody can.

    Parameters
    ----------
    folder : Path
        Free of symbolic links.
    """
    if sys.platform == "win32":
        return None
    for path in (folder, *folder.parents):
        found = path.lstat()
        if found.st_uid not in (ADMINISTRATOR, os.geteuid()):
            return f"{path} belongs to {_user(found.st_uid)}"
        # sticky bit, as on /tmp: others can add files, but not replace them
        kept_by_owners = path != folder and found.st_mode & stat.S_ISVTX
        if _others_write(found) and not kept_by_owners:
            return f"others can write in {path}"
    return None


def is_own(path: Path) -> bool:
    """Whether a path is a regular file or folder that no other user can have written."""
    try:
        found = path.lstat()
    except OSError:
        return False
    return (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)) and _written_by_owner(found)


def read_own(path: Path) -> bytes:
    """Content of a file, if it passes `is_own`.

    Raises
    ------
    OSError
        The file does not exist, is not a regular file (reading a pipe would never end), or others can have written it.
    """
    handle = os.open(path, os.O_RDONLY | NOT_FOLLOWED)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not (stat.S_ISREG(found.st_mode) and _written_by_owner(found)):
            raise PermissionError(f"{path} is not a plain file of this user")
        return file.read()


def _written_by_owner(found: os.stat_result) -> bool:
    if sys.platform == "win32":
        return True
    return found.st_uid in (ADMINISTRATOR, os.geteuid()) and not _others_write(found)


def _others_write(found: os.stat_result) -> bool:
    """Whether anyone but the owner has write permission; a group without other members does not count."""
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not of_one_user(found.st_gid)


def of_one_user(group: int) -> bool:
    """Whether a group is a user-private group: named like the user, without other members."""
    if sys.platform != "win32":
        import grp
        import pwd

        with suppress(KeyError):
            name = pwd.getpwuid(os.geteuid()).pw_name
            found = grp.getgrgid(group)
            return found.gr_name == name and set(found.gr_mem) <= {name}
    return False


def _user(number: int) -> str:
    if sys.platform != "win32":
        import pwd

        with suppress(KeyError):
            return f"the user {pwd.getpwuid(number).pw_name}"
    return f"another user ({number})"
