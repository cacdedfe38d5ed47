"""Build the wheel of a release in dist/: that of hatchling in fewer bytes, less than 1 MB.

A level of indentation is one space in the installed sources. Comments are left out, and so are the docstrings of private functions and
classes and of those of the engine, which nothing shows; other docstrings stay, and so do the lines and their numbers. Files are
compressed by Zopfli, whose output is read by every unzip.
"""

from __future__ import annotations

import ast
import base64
import csv
import hashlib
import inspect
import io
import re
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 1 << 20  # bytes: 1 MB
METHODS = tuple(f"solvers/{name}" for name in ("exponential", "ida", "lanes", "rungekutta", "taylor"))
RUNS = tuple(f"run/{name}" for name in ("afterwards", "refusals", "sampling", "tangents"))
PACKAGES = ("compiler", "drawing/scheme", "equations", "flatten", "native", "program", "reduce", "structure", *RUNS, *METHODS)
MODULES = (
    *(f"statics/{name}" for name in ("closed_gaps", "load_sharing", "mesh_turn", "steady_motion")),
    *(
        f"run/{name}"
        for name in ("linear_form", "methods/native_problem", "methods/run", "scene", "scene_form", "start_values")
    ),
    *("run/steady", "run/time_switches", "run/translation", "vibration/mode_matching"),
    *("drawing/arrangement", "drawing/layers", "many_runs/side_by_side", "many_runs/work"),
    *(
        f"fmi/{name}"
        for name in ("exported_model", "fmu_variables", "model_description", "model_source", "preparation", "terminals")
    ),
    *(f"linear/{name}" for name in ("linearized_program", "one_sided_slopes", "poles", "resolvent", "response_changes")),
    *(f"periodic/{name}" for name in ("continuation", "first_motion", "floquet", "fourier_balance", "periods")),
    *(f"solvers/{name}" for name in ("alternation", "drive/driver", "drive/trace")),
    *(f"vibration/{name}" for name in ("eigenvalue_count", "lowest_eigenvalues", "mode_energies")),
    *(f"modelica/class_{name}" for name in ("building", "content", "writing")),
    *(
        f"modelica/{name}"
        for name in ("counterparts", "element_types", "equation_reading", "evaluation", "flat_writing", "lexer")
    ),
    *(f"modelica/{name}" for name in ("part_building", "scopes", "syntax_tree", "text_parser")),
)
ENGINE = (*(f"gearlib/{name}/" for name in PACKAGES), *(f"gearlib/{name}.py" for name in MODULES))
LOCAL, CENTRAL, END = "<4s5H3L2H", "<4s6H3L5H2L", "<4s4H2LH"  # records of a zip archive


def without_private_docstrings(source: str, all_private: bool = False) -> str:
    r"""Python source without the docstrings of private functions and classes, and of what is defined in them.

    Parameters
    ----------
    source : str
    all_private : bool
        Whether all functions and classes are private.

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

    walk(ast.parse(source), all_private)
    return "".join(lines)


def compact(source: str) -> str:
    r"""Python source without its comments (those that type checkers read stay), indented by single spaces, line by line as before.

    >>> compact('def f():\n    # why\n    return g(  # name\n        "#")  # type: ignore\n')
    'def f():\n\n return g(\n "#")  # type: ignore\n'
    """
    lines = source.splitlines(keepends=True)
    tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    out: list[str] = []
    level, row, column, fresh, statement = 0, 1, 0, True, True
    for token, following in zip(tokens, [*tokens[1:], tokens[-1]], strict=True):
        if token.type in (tokenize.INDENT, tokenize.DEDENT):
            level += 1 if token.type == tokenize.INDENT else -1
            continue
        if token.type == tokenize.ENDMARKER or (token.type == tokenize.COMMENT and not token.string.startswith("# type:")):
            continue
        if token.type in (tokenize.NEWLINE, tokenize.NL):
            out.append("\n")
            row, fresh, statement = row + 1, True, statement or token.type == tokenize.NEWLINE
            continue
        (begin, left), (end, right) = token.start, token.end
        while row < begin:
            out.append("\\\n")
            row, fresh = row + 1, True
        out.append(" " * level if fresh else lines[row - 1][column:left])
        text = "".join(lines[begin - 1 : end])[left : right - len(lines[end - 1]) or None]
        if token.type == tokenize.STRING and statement and end > begin and following.type == tokenize.NEWLINE:
            text = documented(text, level)
        out.append(text)
        row, column, fresh, statement = end, right, False, False
    return "".join(out)


def documented(text: str, level: int) -> str:
    """A docstring with another margin, which `inspect.getdoc` (and Python itself from 3.13 on) takes off."""
    first, *rest = text.split("\n")
    margin = min(len(line) - len(line.lstrip()) for line in rest if line.strip())
    return "\n".join([first, *(" " * level + line[margin:] if line.strip() else "" for line in rest)])


def same(a: str, b: str) -> bool:
    """Whether two sources are one program, line by line, with the same docstrings."""

    def told(source: str) -> str:
        tree = ast.parse(source)
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
                node.value.value = inspect.cleandoc(node.value.value)
            if hasattr(node, "col_offset"):
                node.col_offset = node.end_col_offset = 0
        return ast.dump(tree, include_attributes=True)

    return told(a) == told(b)


def bare(source: str) -> str:
    """C or CSS without comments and indentation, line by line as before."""

    def kept(found: re.Match[str]) -> str:
        return found[1] or " " + "\n" * found[0].count("\n")

    text = re.sub(r"(\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*')|/\*.*?\*/|//[^\n]*", kept, source, flags=re.DOTALL)
    return re.sub(r"^[ \t]+|[ \t]+$", "", text, flags=re.MULTILINE)


def contents(wheel: Path) -> dict[str, bytes]:
    """What the files of a wheel hold without comments and private docstrings; RECORD has the new hashes and sizes."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for name, data in files.items():
        if name.endswith((".py", ".pyi")):
            source = without_private_docstrings(data.decode(), name.startswith(ENGINE))
            files[name] = compact(source).encode()
            if not same(source, files[name].decode()):
                raise SystemExit(f"{name} would be another program")
        elif name.endswith((".c", ".h", ".css")):
            files[name] = bare(data.decode()).encode()
    record = next(name for name in files if name.endswith(".dist-info/RECORD"))
    rows = io.StringIO()
    writer = csv.writer(rows, lineterminator="\n")
    for name, *_ in csv.reader(io.StringIO(files[record].decode())):
        digest = base64.urlsafe_b64encode(hashlib.sha256(files[name]).digest()).rstrip(b"=").decode()
        writer.writerow([name, "", ""] if name == record else [name, f"sha256={digest}", len(files[name])])
    files[record] = rows.getvalue().encode()
    return files


def compressed(wheel: Path, effort: int = 60) -> bytes:
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
