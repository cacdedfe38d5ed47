"""Columns of numbers in files of other programs: separators, decimal signs, comments, and mistakes by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearlib.errors import FileError, NameLookupError
from gearlib.files.columns import read_columns


@pytest.mark.parametrize(
    "text",
    [
        "t,w x,n\n0,1.5,7\n1,-2e3,8\n",
        "t;w x;n\n0;1,5;7\n1;-2e3;8\n",
        "t;w x;n\n0;1.5;7\n1;-2000.0;8",
        "t\tw x\tn\n0\t1.5\t7\n1\t-2e3\t8\n",
        't "w x" n\n0 1.5 7\n1 -2e3 8\n',
        "\ufefft, w x, n\n0,  1.5, 7\n\n1, -2e3, 8\n",
        "# made by a test, with signs; \t\n t,w x,n\n0,1.5,7\n  # between\n1,-2e3,8\n",
        "t,other,w x,n\n0,what,1.5,7\n1,ever,-2e3,8\n",
        "t,w x,n,other\n0,1.5,7\n1,-2e3,8\n",
        "t,w x,\n0,1.5,,,\n1,-2e3,,\n",
        't,w x,n,other\n0,1.5,7,"of two\nlines"\n1,-2e3,8,"of\nthree\nlines"\n',
    ],
)
def test_text_of_any_form_holds_the_same_numbers(text: str, tmp_path: Path) -> None:
    path = tmp_path / "measured.txt"
    path.write_text(text, encoding="utf-8")
    w, t = read_columns(path, ("w x", "t"))
    assert (list(w), list(t)) == ([1.5, -2000.0], [0.0, 1.0])
    assert w.dtype == np.float64


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", " is empty; expected a line of names and lines of numbers"),
        ("# only\n\n", " is empty; expected a line of names and lines of numbers"),
        ("t,w\n0,1\n# why\n\n1,x\n", ", line 5: 'x' in the column w; expected a number: 1,x"),
        ("t,w\n0,1\n1\n", ", line 3: nothing in the column w; expected a number: 1"),
        ("t,w\n0,\n", ", line 2: nothing in the column w; expected a number: 0,"),
        ("t,w\n0,1 5\n", ", line 2: '1 5' in the column w; expected a number: 0,1 5"),
        ("t\tw\n0\t1,5\n", ", line 2: '1,5' in the column w; expected a number: 0\t1,5"),
        ('t,why,w\n0,"first\nday",1\n1,"second\nday",x\n', ", line 5: 'x' in the column w; expected a number: day\",x"),
        (
            "t,w\n0,5,1,5\n",
            ", line 2: 4 fields in 2 columns; expected a point as the decimal sign, or semicolons between the columns: 0,5,1,5",
        ),
        (
            "t w\n0 1\n0.5 2 3 \n",
            ", line 3: 4 fields in 2 columns; expected a point as the decimal sign, or semicolons between the columns: 0.5 2 3",
        ),
        ("t,w,n,w\n0,1,2,3\n", " has 2 columns 'w'; expected one"),
        ("t,w\n0,x" + 100 * "y", ", line 2: 'x" + 100 * "y" + "' in the column w; expected a number: 0,x" + 77 * "y"),
    ],
)
def test_mistakes_are_named_by_their_lines(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "measured.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as problem:
        read_columns(path, ("w",))
    assert str(problem.value) == f"{path}{said}"


def test_columns_and_files_that_are_not_there(tmp_path: Path) -> None:
    path = tmp_path / "measured.csv"
    with pytest.raises(FileError, match=r"measured\.csv cannot be read: No such file or directory"):
        read_columns(path, ("w",))
    path.write_text("time,w\n0,1\n", encoding="utf-8")
    with pytest.raises(NameLookupError, match=r"measured\.csv has no column 'ww'; did you mean 'w'\? Valid names: time, w"):
        read_columns(path, ("time", "ww"))
    path.write_text('time,w\n0,"' + 200_000 * "x", encoding="utf-8")
    with pytest.raises(FileError, match=r"measured\.csv cannot be read: field larger than field limit \(131072\)"):
        read_columns(path, ("w",))
    path.write_bytes(b"t,\xff\n")
    with pytest.raises(FileError, match=r"measured\.csv is not UTF-8 text"):
        read_columns(path, ("t",))


def test_columns_of_parquet_files(tmp_path: Path) -> None:
    pandas, path = pytest.importorskip("pandas"), tmp_path / "measured.PARQUET"
    pandas.DataFrame({"t": [0, 1], "w": [1.5, 2.5], "text": ["a", "b"]}).to_parquet(path)
    w, t = read_columns(path, ("w", "t"))
    assert (list(w), list(t)) == ([1.5, 2.5], [0.0, 1.0])
    with pytest.raises(NameLookupError, match="has no column 'x'"):
        read_columns(path, ("x",))
    with pytest.raises(FileError, match="contains something other than numbers in one of the columns t, text"):
        read_columns(path, ("t", "text"))
    pandas.DataFrame([[0.0, 1.0, 2.0]], columns=["t", "w", "w "]).to_parquet(path)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"w ", b"\xff "))
    with pytest.raises(FileError, match=r"measured\.PARQUET cannot be read: "):
        read_columns(path, ("t",))
    path.write_text("t,w\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"measured\.PARQUET cannot be read: .*Parquet"):
        read_columns(path, ("t",))
