"""Result files in the format of Modelica tools: the tables that they read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from gearlib.errors import FileError
from gearlib.files import mat
from gearlib.files.contents import Record

TIME = np.array([0.25, 0.5, 2.0])
DATA = np.array([[1.0, -2.0], [3.0, 7.0], [5.0, 1e300]])
RECORD = Record(
    TIME, DATA, ("a.w", "b", "ω"), (1, 0, 1), (1, 1, -1), ("rad/s", "", "1"), ("speed of a", "", "Дрель"),
    parameters={"a.J": 4.0, "c": -1.5},
)  # fmt: skip


def lines(characters: Any) -> list[str]:
    return ["".join(row).encode("latin-1").decode().rstrip() for row in np.asarray(characters)]


def test_tables_say_where_each_name_is_and_with_which_sign(tmp_path: Path) -> None:
    """The time is the first column of either block; parameters are in the first block, with their value at both ends."""
    mat.write(RECORD, tmp_path / "r.mat")
    found = loadmat(tmp_path / "r.mat", chars_as_strings=False)
    assert lines(found["Aclass"]) == ["Atrajectory", "1.1", "", "binTrans"]
    assert lines(found["name"].T) == ["time", "a.w", "b", "ω", "a.J", "c"]
    assert lines(found["description"].T) == ["time [s]", "speed of a [rad/s]", "", "Дрель [1]", "parameter", "parameter"]
    assert found["dataInfo"].T.tolist() == [
        [0, 1, 0, -1], [2, 3, 0, -1], [2, 2, 0, -1], [2, -3, 0, -1], [1, 2, 0, -1], [1, 3, 0, -1],
    ]  # fmt: skip
    assert found["data_1"].T.tolist() == [[0.25, 4.0, -1.5], [2.0, 4.0, -1.5]]
    assert found["data_2"].T.tolist() == np.column_stack([TIME, DATA]).tolist()


def test_what_is_written_is_read(tmp_path: Path) -> None:
    mat.write(RECORD, tmp_path / "r.mat")
    found = mat.read(tmp_path / "r.mat")
    assert (found.names, found.units, found.descriptions) == (RECORD.names, RECORD.units, RECORD.descriptions)
    assert found.parameters == RECORD.parameters
    assert found.time.tolist() == TIME.tolist()
    for name in found.names:
        assert found.history(name).tolist() == RECORD.history(name).tolist()


def test_a_result_of_another_tool_is_read_by_its_tables(tmp_path: Path) -> None:
    """As if gearlib had not said in a table of its own what there is."""
    path = tmp_path / "r.mat"
    mat.write(RECORD, path)
    content = {k: v for k, v in loadmat(path, chars_as_strings=False).items() if not k.startswith("__") and k != "gearlib"}
    savemat(path, content, format="4")
    found = mat.read(path)
    assert found.time.tolist() == TIME.tolist()
    for name in ("a.w", "b", "ω"):
        assert found.history(name).tolist() == RECORD.history(name).tolist()
    for missing in ("name", "description", "dataInfo", "data_1", "data_2"):
        savemat(path, {k: v for k, v in content.items() if k != missing}, format="4")
        with pytest.raises(FileError, match=f"it has no {missing}"):
            mat.read(path)
