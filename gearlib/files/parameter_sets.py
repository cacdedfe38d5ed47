"""Parameter sets: values by path, in TOML, CSV and SSV (System Structure Parameter Values of the SSP standard)."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from gearlib.arguments import as_path, by_name, is_real, one_name, shown
from gearlib.errors import ArgumentError, DeclarationError, FileError, GearlibError
from gearlib.files.contents import by_suffix
from gearlib.files.replacing import replacing
from gearlib.language.units import BASE, dimension

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
EXPECTED = "a mapping of paths to numbers"


def save_parameters(
    path: str | os.PathLike[str], parameters: Mapping[str, float], units: Mapping[str, str] | None = None
) -> None:
    """Write parameter values to a file.

    Parameters
    ----------
    path : path
        With the suffix ``.toml``, ``.csv`` or ``.ssv``.
    parameters : mapping
        Values by path, SI.
    units : mapping, optional
        Their units, such as ``system.parameter_units``, written beside the values.

    Raises
    ------
    ArgumentError
        No format has that suffix, a value is not a number, or a name has characters that the format cannot hold.
    FileError
        The file cannot be written.

    Examples
    --------
    >>> path = getfixture("tmp_path") / "drive.toml"
    >>> save_parameters(path, {"load.J": 3.0, "shaft.c": 4000.0}, {"load.J": "kg.m2"})
    >>> print(path.read_text(encoding="utf-8"))
    "load.J" = 3.0  # kg.m2
    "shaft.c" = 4000.0
    <BLANKLINE>
    >>> load_parameters(path)
    {'load.J': 3.0, 'shaft.c': 4000.0}
    """
    target, values = as_path("path", path), by_name("parameters", parameters, EXPECTED)
    for name, value in values.items():
        if not (is_real(value) or isinstance(value, (float, np.floating))):  # infinity and NaN are written, too
            raise ArgumentError(f"parameter {name} is {shown(value)}; expected a number")
        values[name] = float(value)
    known = by_name("units", units, "a mapping of paths to units")
    spelled = {name: one_name(f"the unit of {name}", known.get(name, ""), "kg.m2") for name in values}
    text = _text(target, values, spelled)
    if text is None:
        name = next((n for n in values if _text(target, {n: values[n]}, spelled) is None), "")
        raise ArgumentError(
            f"{target} cannot hold the parameter {name!r} of the unit {spelled[name]!r}; rename it, or use .toml"
        )
    with replacing(target) as beside:
        beside.write_text(text, encoding="utf-8", newline="")


def load_parameters(path: str | os.PathLike[str]) -> dict[str, float]:
    """Read parameter values, for ``simulate(parameters=...)``.

    Parameters
    ----------
    path : path
        ``.toml``: ``"load.J" = 3.0``, or tables: ``[load]``, ``J = 3.0``. ``.csv``: columns ``name`` and ``value``, and optionally
        ``unit``. ``.ssv``: Real and Integer parameters.

    Returns
    -------
    dict
        Values by path, SI. Other units are refused, except those defined in an SSV file, which are converted.

    Raises
    ------
    FileError
        The file cannot be read, or contains something other than names and numbers.
    """
    source = as_path("path", path)
    read = by_suffix(source, FORMATS)[1]
    try:
        text = source.read_bytes().decode("utf-8-sig")  # line ends as they are: a name may contain one
    except OSError as problem:
        raise FileError(f"{source} cannot be read: {problem.strerror or problem}") from None
    except UnicodeDecodeError:
        raise FileError(f"{source} is not UTF-8 text") from None
    try:
        triples = list(read(text, source))
    except GearlibError:
        raise
    except (ArithmeticError, ValueError, RecursionError, csv.Error) as problem:
        raise FileError(f"{source} cannot be read: {problem}") from None
    found: dict[str, float] = {}
    for name, value, unit in triples:
        if name in found:
            raise FileError(f"{source} names the parameter {name} twice")
        if unit:
            try:
                dimension(unit)
            except DeclarationError as problem:
                raise FileError(f"{source}: parameter {name}: {problem}") from None
        found[name] = value
    return found


def _text(target: Path, values: Mapping[str, float], units: Mapping[str, str]) -> str | None:
    """The text of a file; None where its names would not be read as they are, such as control characters in XML."""
    write, read = by_suffix(target, FORMATS)
    text = write(values, {name: units[name] for name in values})
    try:
        text.encode()
        return text if [name for name, _, _ in read(text, target)] == list(values) else None
    except (FileError, ValueError, csv.Error):
        return None


Triples = Iterator[tuple[str, float, str]]  # name, value, unit


def _to_toml(values: Mapping[str, float], units: Mapping[str, str]) -> str:
    lines = []
    for name, value in values.items():
        quoted = json.dumps(name, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML has no surrogate pairs
        lines.append(f"{quoted} = {value!r}{f'  # {units[name]}' if units[name] else ''}\n")
    return "".join(lines)


def _from_toml(text: str, path: Path) -> Triples:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise FileError(f"{path} is not TOML: {problem}") from None

    def leaves(table: Mapping[str, Any], prefix: str) -> Triples:
        for name, value in table.items():
            if isinstance(value, dict):
                yield from leaves(value, f"{prefix}{name}.")
            elif isinstance(value, (int, float)) and not isinstance(value, bool):
                yield f"{prefix}{name}", float(value), ""
            else:
                raise FileError(f"{path}: parameter {prefix}{name} is {shown(value)}; expected a number")

    yield from leaves(content, "")


def _to_csv(values: Mapping[str, float], units: Mapping[str, str]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(
        [("name", "value", "unit"), *((n, repr(v), units[n]) for n, v in values.items())]
    )
    return text.getvalue()


def _from_csv(text: str, path: Path) -> Triples:
    rows = csv.reader(io.StringIO(text, newline=""))
    head = next(rows, [])
    if head[:2] != ["name", "value"]:
        raise FileError(f"{path} begins with {shown(','.join(head))}; expected the columns name,value,unit")
    for row in rows:
        if row:
            try:
                name, value, *unit = row
                yield name, float(value), unit[0].strip() if unit else ""
            except ValueError:
                raise FileError(f"{path}, line {rows.line_num}: {shown(','.join(row))}; expected a name and a number") from None


def _to_ssv(values: Mapping[str, float], units: Mapping[str, str]) -> str:
    ElementTree.register_namespace("ssv", SSV)
    ElementTree.register_namespace("ssc", SSC)
    root = ElementTree.Element(f"{{{SSV}}}ParameterSet", version="1.0", name="parameters")
    entries = ElementTree.SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in values.items():
        entry = ElementTree.SubElement(entries, f"{{{SSV}}}Parameter", name=name)
        text = repr(value) if math.isfinite(value) else str(value).upper().replace("NAN", "NaN")  # as XML Schema spells them
        ElementTree.SubElement(entry, f"{{{SSV}}}Real", {"value": text} | ({"unit": units[name]} if units[name] else {}))
    if used := sorted({unit for unit in units.values() if unit}):
        listed = ElementTree.SubElement(root, f"{{{SSV}}}Units")
        for unit in used:
            one = ElementTree.SubElement(listed, f"{{{SSC}}}Unit", name=unit)
            ElementTree.SubElement(one, f"{{{SSC}}}BaseUnit", _exponents(unit))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=False) + "\n"


def _exponents(unit: str) -> dict[str, str]:
    try:
        exponents = dimension(unit) or ()
    except DeclarationError as problem:
        raise ArgumentError(str(problem)) from None
    found = {name: str(e) for name, e in zip(BASE, exponents, strict=False) if e}
    return found | ({"rad": "1"} if unit == "rad" else {})


def _from_ssv(text: str, path: Path) -> Triples:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as problem:
        raise FileError(f"{path} is not XML: {problem}") from None
    if root.tag != f"{{{SSV}}}ParameterSet":
        raise FileError(f"{path} is not a parameter set of the SSP standard: its root is {root.tag}")
    scales: dict[str, tuple[float, float]] = {}
    for unit in root.iter(f"{{{SSC}}}Unit"):
        for base in unit.iter(f"{{{SSC}}}BaseUnit"):
            if unit.get("name", "") in scales:
                raise FileError(f"{path} defines the unit {unit.get('name')} twice")
            scales[unit.get("name", "")] = float(base.get("factor", 1.0)), float(base.get("offset", 0.0))
    for entry in root.iter(f"{{{SSV}}}Parameter"):
        name = entry.get("name", "")
        kinds = [child for child in entry if child.tag.startswith(f"{{{SSV}}}")]
        kind = kinds[0].tag.rpartition("}")[2] if kinds else "nothing"
        if kind not in ("Real", "Integer"):
            raise FileError(f"{path}: parameter {name} is a {kind}; expected a Real or an Integer")
        try:
            value = float(kinds[0].get("value", ""))
        except ValueError:
            raise FileError(f"{path}: parameter {name} is {kinds[0].get('value')!r}; expected a number") from None
        unit_name = kinds[0].get("unit", "")
        factor, offset = scales.get(unit_name, (1.0, 0.0))
        yield name, factor * value + offset, "" if unit_name in scales else unit_name


Writer = Callable[[Mapping[str, float], Mapping[str, str]], str]
Reader = Callable[[str, Path], Triples]
FORMATS: dict[str, tuple[Writer, Reader]] = {
    ".toml": (_to_toml, _from_toml),
    ".csv": (_to_csv, _from_csv),
    ".ssv": (_to_ssv, _from_ssv),
}
