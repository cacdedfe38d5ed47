"""Contents of a stick diagram as plain data: shafts, with their gears, sets, couplings, brakes, drives and loads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan

from networkx.utils import UnionFind

from gearlib.drawing.block_diagram import OWN, Outline
from gearlib.errors import ModelError

PAIRS = frozenset({"gear", "lossy_gear", "mesh", "internal_mesh"})
INLINE = frozenset({
    "clutch", "one_way_clutch", "spring", "damper", "spring_damper", "shaft", "backlash", "torque_between", "joint",
})  # fmt: skip
RIGID = frozenset({"inertia", "disc", "bearing", "brake", "sensor_between", "link"})
"""Their flanges are one shaft."""
ENDS = frozenset({"torque", "speed", "angle", "acceleration", "load", "eddy_brake", "rack"})
HELD = frozenset({"brake", "fixed"})
UNSEEN = frozenset({"sensor"})
ASIDE = frozenset({"support", "support_r", "heat_port"})

TYPICAL = (2.5,)  # default ratio of a planetary set whose ratio is unknown

Port = tuple[str, str]


@dataclass(frozen=True)
class Symbol:
    """An element on the shafts of a train.

    Parameters
    ----------
    name : str
        Path of the part; for a port of the train itself, the port's name.
    kind : str
        "external", "internal", "planetary", "double_planetary", "inline", "held" (brakes and fixed supports), "end".
    icon : str
        Name of the icon.
    shafts : tuple of int
        Shaft numbers, in the order of `ports`: both gears (ring first); sun, carrier and ring; both sides; or one.
    ports : tuple of str
        Names of its flanges.
    radii : tuple of float
        Radii of both gears, or of sun and ring; in m, or relative to the smaller one.
    in_metres : bool
    label : str
    """

    name: str
    kind: str
    icon: str
    shafts: tuple[int, ...]
    ports: tuple[str, ...]
    radii: tuple[float, ...] = ()
    in_metres: bool = False
    label: str = ""

    def named(self, port: str) -> str:
        """Name of one of its flanges: with the port where it has several."""
        return self.name if len(self.ports) == 1 else f"{self.name}.{port}"


@dataclass(frozen=True)
class Train:
    """Numbered shafts, and the symbols on them."""

    name: str
    kind: str
    symbols: tuple[Symbol, ...]
    shafts: int

    @property
    def sets(self) -> list[Symbol]:
        """The planetary sets."""
        return [s for s in self.symbols if s.kind in ("planetary", "double_planetary")]


def train_of(outline: Outline) -> Train:
    """The shafts and symbols of a component, from its outline with all nested parts.

    Flanges that are connected directly or by a body belong to one shaft.

    Raises
    ------
    ModelError
        Nothing rotates, or the axes of a mesh are carried around by a shaft.
    """
    joined: UnionFind[Port] = UnionFind()
    found: list[tuple[str, Outline]] = []
    alone = _is_symbol(outline)
    _collect(outline, "", joined, found, alone)
    if alone:
        found = [("", outline)]
    drawn = [(path, part) for path, part in found if part.icon not in UNSEEN | RIGID - HELD]
    number: dict[Port, int] = {}

    def shaft(path: str, port: str) -> int:
        return number.setdefault(joined[path, port], len(number))

    symbols = [
        symbol for path, part in drawn if (symbol := _symbol(part, path, [(n, shaft(path, n)) for n in _turning(part)])) is not None
    ]  # fmt: skip
    used = {joined[path, port] for path, part in drawn for port in _turning(part)}
    if not alone:
        own = [port for port in _turning(outline) if joined["", port] in used]
        symbols += [Symbol(port, "end", "port", (shaft("", port),), (port,), label=port) for port in own]
    if not symbols:
        raise ModelError(f"{outline.name}: nothing in it turns that a stick diagram shows; diagram() shows its parts")
    _refuse_carried(drawn, joined, symbols, number)
    return Train(outline.name, outline.kind, tuple(symbols), len(number))


def _turning(part: Outline) -> list[str]:
    return [port.name for port in part.ports if port.domain == "rotation" and port.name not in ASIDE and "." not in port.name]


def _collect(part: Outline, path: str, joined: UnionFind[Port], found: list[tuple[str, Outline]], inside: bool = False) -> None:
    """Merge flanges of the same shaft, and list drawn parts; the parts of drawn parts merge flanges only."""
    for net in part.nets:
        if net.domain == "rotation":
            pins = [(path if pin.part == OWN else f"{path}.{pin.part}".lstrip("."), pin.port) for pin in net.pins]
            joined.union(*pins)
    for inner in part.parts:
        name = f"{path}.{inner.name}".lstrip(".")
        is_symbol = _is_symbol(inner)
        own = _turning(inner)
        if (inner.icon in RIGID or _is_one_to_one(inner)) and len(own) > 1:
            joined.union(*((name, port) for port in own))
        if is_symbol and not inside and own and not _is_one_to_one(inner):
            found.append((name, inner))
        _collect(inner, name, joined, found, inside or is_symbol)


def _is_symbol(part: Outline) -> bool:
    """Whether a part is drawn as a single symbol, whatever it consists of."""
    return not part.parts or bool(part.radii) or part.icon in INLINE | ENDS | RIGID


def _is_one_to_one(part: Outline) -> bool:
    return part.icon in ("gear", "lossy_gear") and part.radii == (1.0,)


def _symbol(part: Outline, path: str, on: list[tuple[str, int]]) -> Symbol | None:
    """Symbol of a part whose flanges are on these shafts."""
    names, shafts = tuple(n for n, _ in on), tuple(s for _, s in on)
    label, icon, radii = path or part.name, part.icon, part.radii
    if icon in HELD:
        return Symbol(label, "held", icon, shafts[:1], names[:1], label=label if icon == "brake" else "")
    if any(map(isnan, radii)):
        radii = TYPICAL if icon == "planetary" else (1.0, 1.0) if len(radii) == 2 else (-1.0,)
    if icon == "planetary" and {"sun", "carrier", "ring"} <= set(names):
        by_name = dict(on)
        ratio = (radii or TYPICAL)[-1]  # or the ring's radius, which is positive
        sizes = radii if len(radii) == 2 else (1.0, abs(ratio))
        three = ("sun", "carrier", "ring")
        kind = "planetary" if ratio > 0 else "double_planetary"
        return Symbol(label, kind, icon, tuple(by_name[n] for n in three), three, sizes, len(radii) == 2, label)
    if icon in PAIRS and len(set(shafts)) == 2 and shafts[0] != shafts[1] and radii:
        if len(radii) == 2:
            return Symbol(
                label, "internal" if icon == "internal_mesh" else "external", icon, shafts[:2], names[:2], radii, True, label
            )
        ratio = radii[0]
        if ratio < 0:
            return Symbol(label, "external", icon, shafts[:2], names[:2], (1.0, -ratio), False, label)
        return Symbol(label, "inline", "ratio", shafts[:2], names[:2], label=f"{label}: {ratio:.4g}")
    if len(shafts) == 1:
        return Symbol(label, "end", icon if icon in ENDS else "box", shafts, names, label=label)
    if len(shafts) >= 2:
        return Symbol(label, "inline", icon if icon in INLINE else "box", shafts, names, label=label)
    return None


def _refuse_carried(
    drawn: list[tuple[str, Outline]], joined: UnionFind[Port], symbols: list[Symbol], number: dict[Port, int]
) -> None:
    """Refuse a mesh on a rotating carrier outside a planetary set: it cannot be drawn as a gear pair with fixed axes."""
    turning = {shaft for s in symbols if s.kind != "held" for shaft in s.shafts}
    for path, part in drawn:
        for port in part.ports:
            if part.icon in PAIRS and port.name == "support" and number.get(joined[path, port.name]) in turning:
                raise ModelError(
                    f"{path}: its support turns with a shaft of the train; a stick diagram shows gears on axes at rest, and planetary "
                    "sets as one part (PlanetaryUnit, IdealPlanetary, LossyPlanetary)"
                )


def members(train: Train) -> Iterator[tuple[int, Symbol, str]]:
    """Each shaft with each flange on it."""
    for symbol in train.symbols:
        for port, shaft in zip(symbol.ports, symbol.shafts, strict=True):
            yield shaft, symbol, port
