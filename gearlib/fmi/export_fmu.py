"""`export_fmu`: exports a compiled model as an FMU, which other tools simulate without gearlib and without Python."""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Sequence
from importlib import metadata
from io import BytesIO
from pathlib import Path
from typing import Any

from gearlib.arguments import as_path, name_list, one_of, real, shown
from gearlib.errors import ArgumentError
from gearlib.files.replacing import replacing
from gearlib.fmi.binaries import chosen_platforms, shared_library
from gearlib.fmi.exported_model import exported_model
from gearlib.fmi.fmu_variables import fmu_variables
from gearlib.fmi.model_description import Description, description_2, description_3
from gearlib.fmi.model_source import model_source
from gearlib.fmi.model_tables import model_tables, record_header
from gearlib.fmi.terminals import terminals, terminals_text
from gearlib.run.translation import Translation

VERSIONS = ("3.0", "2.0")
KINDS = ("me", "cs")
DESCRIPTIONS = {"3.0": description_3, "2.0": description_2}
FACES = {"3.0": ("fmi3.c",), "2.0": ("fmi2.c",)}
DATE = (1980, 1, 1, 0, 0, 0)  # of the files in the archive, fixed so that equal models give equal bytes


def export_fmu(
    translation: Translation, path: Any, *, version: str = "3.0", kind: Any = KINDS, platforms: Any = ("native",),
    parameters: Any = None, inputs: Any = None, outputs: Any = None, stop_time: float = 1.0, rtol: float = 1e-6,
) -> Path:  # fmt: skip
    """Write an FMU; arguments as for `System.export_fmu`."""
    target = as_path("export_fmu", path, "train.fmu")
    if target.suffix.lower() != ".fmu":
        raise ArgumentError(f"export_fmu(): path is {shown(str(path))}; name the file ....fmu")
    one_of("the version of FMI", version, VERSIONS)
    kinds = tuple(dict.fromkeys([kind] if isinstance(kind, str) else name_list("kind", kind, "cs")))
    for name in kinds:
        one_of("the kind of an FMU", name, KINDS)
    if not kinds:
        raise ArgumentError("kind is empty; expected 'me' (model exchange), 'cs' (co-simulation), or both")
    chosen = chosen_platforms([platforms] if isinstance(platforms, str) else name_list("platforms", platforms, "native"))
    stop_time, rtol = real("stop_time", stop_time, "a positive number of seconds"), real("rtol", rtol)
    if not stop_time > 0.0:
        raise ArgumentError(f"stop_time is {stop_time:g}; expected a positive number of seconds")
    if not 1e-13 <= rtol <= 0.1:
        raise ArgumentError(f"rtol is {rtol:g}; expected a number from 1e-13 to 0.1")
    exported = exported_model(translation, parameters, inputs, outputs, stop_time)
    source = model_source(exported)
    identifier = re.sub(r"\W", "_", target.stem, flags=re.ASCII) or "model"
    identifier = f"_{identifier}" if identifier[0].isdigit() else identifier
    whole = "\0".join((source.text, repr(source.index.tobytes()), repr(source.data.tobytes()), *kinds, version))
    token = f"{{{hashlib.sha256(whole.encode()).hexdigest()[:32]}}}"
    description = Description(
        translation.name, identifier, token, _summary(translation), f"gearlib {_version()}", kinds, rtol, stop_time,
        fmu_variables(exported, source.n_roots), source.pattern,
    )  # fmt: skip
    tables = {"model.c": model_tables(exported, source, token, rtol, stop_time), "record.h": record_header()}
    entries = {"modelDescription.xml": DESCRIPTIONS[version](description)}
    for platform in chosen:
        folder = platform.name if version == "3.0" else platform.fmi2
        entries[f"binaries/{folder}/{identifier}{platform.suffix}"] = shared_library(
            platform, source.text, tables, FACES[version]
        )
    if version == "3.0" and (flanges := terminals(exported, description.variables)):
        entries["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_text(flanges)
    with replacing(target) as beside:
        Path(beside).write_bytes(_archive(entries))
    return target


def _archive(entries: dict[str, bytes]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _summary(translation: Translation) -> str:
    """First line of the component's description."""
    lines: Sequence[str] = (type(translation.component).__doc__ or "").strip().splitlines()
    return lines[0] if lines else translation.name


def _version() -> str:
    try:
        return metadata.version("gearlib")
    except metadata.PackageNotFoundError:  # run from a source tree
        return "from source"
