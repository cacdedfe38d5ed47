"""``modelDescription.xml`` of FMI 3.0 and 2.0."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite, pi
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gearlib.fmi.fmu_variables import FmuVariable, FmuVariables
from gearlib.language.units import BASE, dimension
from gearlib.native.jacobian import Pattern

_NAME = r"[A-Za-z_]\w*(?:\[\d+(?:,\d+)*\])?"
_STRUCTURED = re.compile(rf"{_NAME}(?:\.{_NAME})*|der\({_NAME}(?:\.{_NAME})*(?:,\d+)?\)", re.ASCII)
DISPLAYED = {  # display unit, its factor on a value in the unit, and its offset
    "rad": ("deg", 180.0 / pi, 0.0),
    "rad/s": ("rev/min", 30.0 / pi, 0.0),
    "K": ("degC", 1.0, -273.15),
    "m": ("mm", 1e3, 0.0),
    "W": ("kW", 1e-3, 0.0),
}
_ANGLE = re.compile(r"^rad(-?\d+)?$")
CATEGORIES = {"logStatusError": "what went wrong", "logEvents": "events in co-simulation, with time and equation"}


@dataclass(frozen=True)
class Description:
    """Contents of a model description besides its variables.

    Attributes
    ----------
    name, identifier, token : str
        Names of the model and of its binaries, and the token that both share.
    text : str
        Description of the model.
    tool : str
    kinds : tuple of str
        ``"me"``, ``"cs"``.
    tolerance, stop_time : float
        Defaults; stop time in s.
    variables : FmuVariables
    pattern : Pattern
        Sparsity pattern: dependence of derivatives and outputs on states and inputs.
    """

    name: str
    identifier: str
    token: str
    text: str
    tool: str
    kinds: tuple[str, ...]
    tolerance: float
    stop_time: float
    variables: FmuVariables
    pattern: Pattern

    def dependencies(self) -> dict[int, list[int]]:
        """Value references that each derivative and output depends on."""
        known, pattern = self.variables, self.pattern
        rows: dict[int, list[int]] = {row: [] for row in known.observed.values()}
        for column, reference in enumerate(known.columns):
            for row in pattern.indices[pattern.indptr[column] : pattern.indptr[column + 1]].tolist():
                if row in rows:
                    rows[row].append(reference)
        return {reference: rows[row] for reference, row in known.observed.items()}

    @property
    def naming(self) -> str:
        """Naming convention satisfied by all names."""
        named = all(_STRUCTURED.fullmatch(v.name) for v in self.variables.listed)
        return "structured" if named else "flat"

    @property
    def initial_unknowns(self) -> list[int]:
        """Value references that depend on start values, except event indicators."""
        known = self.variables
        unknown = {v.reference for v in known.listed if v.initial == "calculated"} - set(known.indicators)
        wanted = {*known.outputs, *known.states, *known.derivatives}
        parameters = {v.reference for v in known.listed if v.causality == "calculatedParameter"}
        return sorted(unknown & (wanted | parameters))


def description_3(d: Description) -> bytes:
    """The model description for FMI 3.0."""
    known = d.variables
    root = Element(
        "fmiModelDescription", fmiVersion="3.0", modelName=d.name, description=d.text, instantiationToken=d.token,
        generationTool=d.tool, variableNamingConvention=d.naming,
    )  # fmt: skip
    common = {
        "modelIdentifier": d.identifier, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true", "providesAdjointDerivatives": "true",
    }  # fmt: skip
    if "me" in d.kinds:
        SubElement(root, "ModelExchange", {**common, "needsCompletedIntegratorStep": "true"})
    if "cs" in d.kinds:
        more = {"canHandleVariableCommunicationStepSize": "true", "providesIntermediateUpdate": "true"}
        SubElement(root, "CoSimulation", common | more)
    _heads(root, d)
    variables = SubElement(root, "ModelVariables")
    for v in known.listed:
        element = SubElement(
            variables, "Float64", {
                "name": v.name, "valueReference": str(v.reference), "causality": v.causality, "variability": v.variability,
                **({"initial": v.initial} if v.initial else {}), **_attributes(v, v.derivative),
                **({"intermediateUpdate": "true"} if v.causality == "input" and "cs" in d.kinds else {}),
            },
        )  # fmt: skip
        assert element is not None
    structure, depends = SubElement(root, "ModelStructure"), d.dependencies()

    def add(kind: str, references: Sequence[int]) -> None:
        for reference in references:
            on = {"dependencies": " ".join(map(str, depends[reference]))} if reference in depends else {}
            SubElement(structure, kind, {"valueReference": str(reference), **on})

    add("Output", known.outputs)
    add("ContinuousStateDerivative", known.derivatives)
    for reference in d.initial_unknowns:
        SubElement(structure, "InitialUnknown", valueReference=str(reference))
    for reference in known.indicators:
        SubElement(structure, "EventIndicator", valueReference=str(reference))
    return _printed(root)


def description_2(d: Description) -> bytes:
    """The model description for FMI 2.0, in which neither event indicators nor time need variables."""
    known = d.variables
    listed = [v for v in known.listed if v.reference not in set(known.indicators)]
    place = {v.reference: i for i, v in enumerate(listed, 1)}
    root = Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=d.name, description=d.text, guid=d.token, generationTool=d.tool,
        variableNamingConvention=d.naming, numberOfEventIndicators=str(len(known.indicators)),
    )  # fmt: skip
    common = {
        "modelIdentifier": d.identifier, "canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }  # fmt: skip
    if "me" in d.kinds:
        SubElement(root, "ModelExchange", common)
    if "cs" in d.kinds:
        more = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
        SubElement(root, "CoSimulation", common | more)
    _heads(root, d)
    variables = SubElement(root, "ModelVariables")
    for v in listed:
        element = SubElement(
            variables, "ScalarVariable", {
                "name": v.name, "valueReference": str(v.reference), "causality": v.causality, "variability": v.variability,
                **({"description": v.description} if v.description else {}), **({"initial": v.initial} if v.initial else {}),
            },
        )  # fmt: skip
        attributes = _attributes(v, None if v.derivative is None else place[v.derivative])
        attributes.pop("description", None)
        SubElement(element, "Real", attributes)
    structure, depends = SubElement(root, "ModelStructure"), d.dependencies()

    def add(kind: str, references: Sequence[int], with_dependencies: bool = True) -> None:
        if not references:
            return
        group = SubElement(structure, kind)
        for reference in references:
            has = with_dependencies and reference in depends
            on = {"dependencies": " ".join(str(place[r]) for r in sorted(depends[reference]))} if has else {}
            SubElement(group, "Unknown", {"index": str(place[reference]), **on})

    add("Outputs", sorted(known.outputs, key=lambda r: place[r]))
    add("Derivatives", known.derivatives)
    add("InitialUnknowns", d.initial_unknowns, False)
    return _printed(root)


def _heads(root: Element, d: Description) -> None:
    """Units, log categories, and the default experiment."""
    units = SubElement(root, "UnitDefinitions")
    unit_definitions(units, (v.unit for v in d.variables.listed))
    categories = SubElement(root, "LogCategories")
    for name, text in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime=repr(d.stop_time), tolerance=repr(d.tolerance))


def _attributes(v: FmuVariable, derivative: int | None) -> dict[str, str]:
    found = {"description": v.description} if v.description else {}
    if has_unit(v.unit):
        found["unit"] = v.unit
        name, _, offset = DISPLAYED.get(v.unit, ("", 1.0, 0.0))
        if name and not offset:  # temperatures and their differences are both in K
            found["displayUnit"] = name
    if isfinite(v.lower):
        found["min"] = repr(v.lower)
    if isfinite(v.upper):
        found["max"] = repr(v.upper)
    if v.nominal != 1.0:
        found["nominal"] = repr(v.nominal)
    if v.start is not None:
        found["start"] = repr(v.start)
    if derivative is not None:
        found["derivative"] = str(derivative)
    return found


def _printed(root: Element) -> bytes:
    indent(root)
    return bytes(tostring(root, encoding="UTF-8", xml_declaration=True))


# ---------------------------------------------------------------- units


def has_unit(unit: str) -> bool:
    """Whether a variable has a unit: neither a plain number, nor "any"."""
    return unit not in ("1", "any", "")


def unit_definitions(root: Element, units: Iterable[str]) -> None:
    """Add the definitions of some units to a model description.

    Examples
    --------
    >>> from xml.etree.ElementTree import tostring
    >>> root = Element("UnitDefinitions")
    >>> unit_definitions(root, ["N.m/rad"])
    >>> tostring(root[0])
    b'<Unit name="N.m/rad"><BaseUnit kg="1" m="2" s="-2" rad="-1" /></Unit>'
    """
    for unit in sorted(set(filter(has_unit, units))):
        exponents = {base: int(e) for base, e in zip(BASE, dimension(unit) or (), strict=True) if e}
        exponents["rad"] = _angles(unit)
        element = SubElement(root, "Unit", name=unit)
        SubElement(element, "BaseUnit", {base: str(e) for base, e in exponents.items() if e})
        if unit in DISPLAYED:
            name, factor, offset = DISPLAYED[unit]
            more = {"offset": repr(offset)} if offset else {}
            SubElement(element, "DisplayUnit", {"name": name, "factor": repr(factor), **more})


def _angles(unit: str) -> int:
    """Exponent of the radian in a unit."""
    above, _, below = unit.partition("/")
    total = 0
    for sense, side in ((1, above), (-1, below.strip("()"))):
        for factor in side.split("."):
            if found := _ANGLE.match(factor):
                total += sense * int(found[1] or 1)
    return total
