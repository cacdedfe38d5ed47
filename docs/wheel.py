"""Build the wheel of a release in dist/: that of hatchling in fewer bytes, less than 1 MB.

Comments are left out of the installed sources, and so are the docstrings of private functions and classes, which nothing shows; other
docstrings stay, and so do the lines and their numbers. Files are compressed by Zopfli, whose output is read by every unzip.
"""

from __future__ import annotations

import ast
import base64
import csv
import hashlib
import io
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 1 << 20  # bytes: 1 MB
LOCAL, CENTRAL, END = "<4s5H3L2H", "<4s6H3L5H2L", "<4s4H2LH"  # records of a zip archive


def without_comments(source: str) -> str:
    r"""Python source without its comments, line by line; those that type checkers read stay.

    >>> without_comments('a = "#"  # name\n# why\nb = 1  # type: ignore\n')
    'a = "#"\n\nb = 1  # type: ignore\n'
    """
    lines = source.splitlines(keepends=True)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT and not token.string.startswith("# type:"):
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column].rstrip() + "\n"
    return "".join(lines)


def without_private_docstrings(source: str) -> str:
    r"""Python source without the docstrings of private functions and classes, and of what is defined in them.

    >>> without_private_docstrings("def _f():\n    'What it does.'\n    return 1\n")
    'def _f():\n\n    return 1\n'
    """
    lines = source.splitlines(keepends=True)

    def walk(node: ast.AST, private: bool) -> None:
        for inner in ast.iter_child_nodes(node):
            if not isinstance(inner, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                continue
            hidden = private or (inner.name.startswith("_") and not inner.name.endswith("__"))
            first = inner.body[0]
            if hidden and len(inner.body) > 1 and ast.get_docstring(inner, clean=False) is not None:
                lines[first.lineno - 1 : first.end_lineno] = ["\n"] * ((first.end_lineno or first.lineno) - first.lineno + 1)
            walk(inner, hidden)

    walk(ast.parse(source), False)
    return "".join(lines)


def contents(wheel: Path) -> dict[str, bytes]:
    """What the files of a wheel hold without comments and private docstrings; RECORD has the new hashes and sizes."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for name, data in files.items():
        if name.endswith(".py"):
            files[name] = without_private_docstrings(without_comments(data.decode())).encode()
    record = next(name for name in files if name.endswith(".dist-info/RECORD"))
    rows = io.StringIO()
    writer = csv.writer(rows, lineterminator="\n")
    for name, *_ in csv.reader(io.StringIO(files[record].decode())):
        digest = base64.urlsafe_b64encode(hashlib.sha256(files[name]).digest()).rstrip(b"=").decode()
        writer.writerow([name, "", ""] if name == record else [name, f"sha256={digest}", len(files[name])])
    files[record] = rows.getvalue().encode()
    return files


def compressed(wheel: Path, effort: int = 15) -> bytes:
    """The archive without comments, with the same names, dates and modes, in fewer bytes.

    Parameters
    ----------
    wheel : Path
    effort : int
        Iterations of Zopfli for each file.
    """
    from zopfli.zopfli import compress

    files = contents(wheel)
    body, directory = bytearray(), bytearray()
    with zipfile.ZipFile(wheel) as archive:
        members = archive.infolist()
    for member in members:
        data, name = files[member.filename], member.filename.encode()
        small = compress(data, numiterations=effort)[2:-4]  # the zlib container around the deflated data: 2 and 4 bytes
        year, month, day, hour, minute, second = member.date_time
        date, time = (year - 1980) << 9 | month << 5 | day, hour << 11 | minute << 5 | second // 2
        common = (20, 1 << 11, zipfile.ZIP_DEFLATED, time, date, zlib.crc32(data), len(small), len(data), len(name), 0)
        directory += struct.pack(CENTRAL, b"PK\1\2", 3 << 8 | 20, *common, 0, 0, 0, member.external_attr, len(body)) + name
        body += struct.pack(LOCAL, b"PK\3\4", *common) + name + small
    count = len(members)
    return bytes(body + directory + struct.pack(END, b"PK\5\6", 0, 0, count, count, len(directory), len(body), 0))


def main() -> None:
    from hatchling.builders.wheel import WheelBuilder

    for name in WheelBuilder(str(ROOT)).build(directory=str(ROOT / "dist"), versions=["standard"]):
        wheel = Path(name)
        data = compressed(wheel)
        if len(data) >= LIMIT:
            raise SystemExit(f"{wheel.name} would have {len(data)} bytes; less than {LIMIT} are wanted")
        wheel.write_bytes(data)
        print(f"{wheel}: {len(data)} bytes")


if __name__ == "__main__":
    main()
