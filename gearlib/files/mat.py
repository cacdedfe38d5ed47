"""Result files of Dymola and OpenModelica: MATLAB format 4 with the matrices of a trajectory.

``name``, ``description`` and ``dataInfo`` tell for each variable which of two blocks, which column and which sign it has: an alias
costs a name only. ``data_1`` holds the parameters at the start and the end, ``data_2`` the samples. Another matrix, ``gearlib``, holds
what those programs have no place for; they ignore it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.files.contents import Record, damaged, foreign_file, from_header

Floats = NDArray[np.float64]
CLASS = ("Atrajectory", "1.1", "", "binTrans")


def write(record: Record, path: Path) -> None:
    """Write a record."""
    from scipy.io import savemat

    parameters = list(record.parameters)
    names = ["time", *record.names, *parameters]
    units = ["s", *record.units, *[""] * len(parameters)]
    texts = ["time", *record.descriptions, *["parameter"] * len(parameters)]
    info = np.zeros((4, len(names)), np.int32)
    info[:, 0] = 0, 1, 0, -1
    variables, rest = slice(1, 1 + len(record.names)), slice(1 + len(record.names), None)
    info[0, variables], info[0, rest], info[3] = 2, 1, -1
    info[1, variables] = np.array(record.signs, np.int32) * (np.array(record.columns, np.int32) + 2)
    info[1, rest] = np.arange(2, 2 + len(parameters))
    begin, end = (record.time[0], record.time[-1]) if len(record.time) else (0.0, 0.0)
    numbers = list(record.parameters.values())
    content = {
        "Aclass": _characters(CLASS),
        "name": _characters(names).T,
        "description": _characters([f"{text} [{unit}]" if unit else text for text, unit in zip(texts, units, strict=True)]).T,
        "dataInfo": info,
        "data_1": np.array([[begin, *numbers], [end, *numbers]], float).T,
        "data_2": np.column_stack([record.time, record.data]).T,
        "gearlib": _characters([record.header()]),
    }
    with path.open("wb") as file:
        savemat(file, content, format="4")


def _characters(lines: Sequence[str]) -> NDArray[np.bytes_]:
    """A character matrix with one line per row, in UTF-8, one byte per character."""
    coded = [line.encode() for line in lines]
    width = max(1, *map(len, coded))
    return np.array([line.ljust(width) for line in coded], f"S{width}").view("S1").reshape(len(coded), width)


def _lines(characters: Any, transposed: bool = False) -> list[str]:
    """The lines of a character matrix."""
    matrix = np.asarray(characters)
    matrix = matrix.T if transposed else matrix
    return ["".join(row).rstrip(" \0").encode("latin-1").decode(errors="replace") for row in matrix]


def read(path: Path) -> Record:
    """Read a record, or a result of Dymola or OpenModelica; the latter have no provenance, and units are part of the descriptions."""
    from scipy.io import loadmat

    with path.open("rb") as file:
        begins = b"Aclass" in file.read(64)
        file.seek(0)
        try:
            found = loadmat(file, chars_as_strings=False)
        except Exception as problem:  # whatever the library raises for missing bytes
            raise (damaged(path, str(problem)) if begins else foreign_file(path)) from None
    if "Aclass" not in found or _lines(found["Aclass"])[:1] != [CLASS[0]]:
        raise foreign_file(path)
    missing = [name for name in ("name", "description", "dataInfo", "data_1", "data_2") if name not in found]
    if missing:
        raise damaged(path, f"it has no {missing[0]}")
    if _lines(found["Aclass"])[3:] != [CLASS[3]]:
        raise foreign_file(path)
    samples = np.asarray(found["data_2"], float).T
    if "gearlib" in found:
        return from_header(_lines(found["gearlib"])[0], samples[:, 0], samples[:, 1:], path)
    return _foreign(found, samples, path)


def _foreign(found: dict[str, Any], samples: Floats, path: Path) -> Record:
    names, texts = _lines(found["name"], True), _lines(found["description"], True)
    block, column = np.asarray(found["dataInfo"], int)[:2]
    constants = np.asarray(found["data_1"], float)[:, 0]
    if not len(names) == len(texts) == len(block):
        raise damaged(path, f"it has {len(names)} names, {len(texts)} descriptions and {len(block)} columns of dataInfo")
    sizes = {1: len(constants), 2: samples.shape[1]}
    for name, of, at in zip(names, block.tolist(), column.tolist(), strict=True):
        if of in sizes and not 0 < abs(at) <= sizes[of]:
            raise damaged(path, f"{name} is column {at} of the {sizes[of]} of data_{of}")
    moving = [i for i in range(1, len(names)) if block[i] == 2]  # the first is the time
    held = {names[i]: float(np.sign(column[i]) * constants[abs(column[i]) - 1]) for i in range(len(names)) if block[i] == 1}
    parts = [texts[i].rpartition("[") if texts[i].endswith("]") else (texts[i], "", "]") for i in moving]
    used, columns = np.unique(np.abs(column[moving]), return_inverse=True)
    return Record(
        samples[:, 0].copy(), np.ascontiguousarray(samples[:, used - 1]), tuple(names[i] for i in moving), tuple(columns.tolist()),
        tuple(np.sign(column[moving]).tolist()), tuple(unit[:-1].partition("|")[0] for _, _, unit in parts),
        tuple(text.rstrip() for text, _, _ in parts), parameters=held,
    )  # fmt: skip
