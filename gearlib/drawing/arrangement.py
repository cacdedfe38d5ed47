"""Layout of a block diagram: positions of boxes and routes of wires; nested boxes are laid out first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin, Terminal
from gearlib.drawing.channels import Segment, channel, wires
from gearlib.drawing.icons import ICONS, Icon
from gearlib.drawing.layers import layers, ordered, positions
from gearlib.drawing.placement import GRID, Node, heights
from gearlib.drawing.svg import text_width

LEFT, RIGHT = -1, 1
ZONE, LABEL, ROW, TITLE, PADDING = 48.0, 16.0, 16.0, 24.0, 8.0
BOX = Icon((), framed=True)
ASIDE = frozenset({"support", "heat_port"})  # ports below an icon, not at its shafts
DRIVING, DRIVEN = frozenset({"torque", "speed", "angle", "acceleration", "force"}), frozenset({"sensor", "load"})
LEFT_ENDS, RIGHT_ENDS = ("_a", "_in"), ("_b", "_out")


@dataclass(frozen=True)
class Placed:
    """A box of the diagram: a part with its position.

    Parameters
    ----------
    part : Outline
    x, y, width, height : float
        Bounds of the box including its label.
    ends : tuple of (port, side, height)
        Ends of wires: -1 at the left edge, 1 at the right one, with the distance from the upper edge.
    mirrored : bool
        Whether its icon is mirrored, with the first shaft on the right.
    inner : Arrangement, optional
        Layout of its contents, if shown.
    """

    part: Outline
    x: float
    y: float
    width: float
    height: float
    ends: tuple[tuple[Terminal, int, float], ...]
    mirrored: bool = False
    inner: Arrangement | None = None


@dataclass(frozen=True)
class Wire:
    """A net with its line segments (x1, y1, x2, y2), and the points where more than two of them meet."""

    net: Net
    pieces: tuple[Segment, ...]
    joints: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Border:
    """A port of the component itself, at the edge of its diagram: its wire starts at (x, y)."""

    port: Terminal
    side: int
    x: float
    y: float


@dataclass(frozen=True)
class Arrangement:
    """Layout of a diagram: its size, boxes, wires, and border ports."""

    width: float
    height: float
    boxes: tuple[Placed, ...]
    wires: tuple[Wire, ...]
    border: tuple[Border, ...]


def icon_of(part: Outline) -> Icon:
    return ICONS.get(part.icon, BOX) if part.icon != "chain" else BOX


def label_of(part: Outline) -> str:
    return part.name if part.count == 1 else f"{part.name} × {part.count}"


def arranged(outline: Outline, width: float) -> Arrangement:
    """Lay out the parts of an outline; a sequence of layers wider than ``width`` is folded into several rows."""
    inner = {part.name: arranged(part, width) for part in outline.parts if part.parts}
    own = tuple(outline.ports) if outline.parts else ()
    things: list[Outline | Terminal] = [*outline.parts, *own]
    index = {part.name: i for i, part in enumerate(outline.parts)}
    border = {port.name: len(outline.parts) + i for i, port in enumerate(own)}
    ends = [[(border[p.port] if p.part == OWN else index[p.part], p) for p in net.pins] for net in outline.nets]
    liking = [
        [(n, _conventional_side(things[n], pin, net, inner)) for n, pin in found]
        for found, net in zip(ends, outline.nets, strict=True)
    ]
    sides = _border_sides(things, liking)
    layer = layers(len(things), liking, sides)
    side = port_sides(things, ends, layer, sides, inner, outline.nets)
    design = _Design(things, ends, side, layer, inner)
    return _routed(outline, design, width)


def _conventional_side(thing: Outline | Terminal, pin: Pin, net: Net, inner: dict[str, Arrangement]) -> int:
    """Conventional side of a port on its part: -1, 1, or 0 for either."""
    if isinstance(thing, Terminal):
        if net.domain == "signal":
            return RIGHT if net.pins[0] == pin else LEFT
        return RIGHT if thing.name.endswith(LEFT_ENDS) else LEFT if thing.name.endswith(RIGHT_ENDS) else 0
    if thing.name in inner:
        return next(b.side for b in inner[thing.name].border if b.port.name == pin.port)
    if net.domain == "signal":
        return RIGHT if net.pins[0] == pin else LEFT
    if thing.icon in DRIVING and pin.port not in ASIDE:
        return RIGHT
    if thing.icon in DRIVEN:
        return LEFT
    return LEFT if pin.port.endswith(LEFT_ENDS) else RIGHT if pin.port.endswith(RIGHT_ENDS) else 0


def _border_sides(things: Sequence[Outline | Terminal], liking: Sequence[Sequence[tuple[int, int]]]) -> dict[int, int]:
    """The edge of each port of the component."""
    own = [i for i, thing in enumerate(things) if isinstance(thing, Terminal)]
    if not own:
        return {}
    x = positions(len(things), liking)
    middle = sum(x) / len(x)
    likes = {n: like for found in liking for n, like in found}
    found = {}
    for i in own:
        like = likes.get(i, 0)
        thing = things[i]
        if not like and isinstance(thing, Terminal):
            like = RIGHT if thing.name.endswith(LEFT_ENDS) else LEFT if thing.name.endswith(RIGHT_ENDS) else 0
        found[i] = -like if like else (LEFT if x[i] <= middle + 1e-6 else RIGHT)
    if len(own) > 1 and len(set(found.values())) == 1 and not any(likes.get(i, 0) for i in own):
        found[own[-1]] = -found[own[-1]]
    return found


Sides = dict[tuple[int, str], int]


def port_sides(
    things: Sequence[Outline | Terminal], ends: Sequence[Sequence[tuple[int, Pin]]], layer: Sequence[int], border: dict[int, int],
    inner: dict[str, Arrangement], nets: Sequence[Net],
) -> Sides:  # fmt: skip
    """The side at which each wire leaves its box: that of the parts it is connected to."""
    towards: dict[tuple[int, str], float] = {}
    for found, net in zip(ends, nets, strict=True):
        signal = net.domain == "signal"
        for n, pin in found:
            others = [layer[m] for m, _ in found if m != n]
            if signal and pin != found[0][1]:  # arrows start at the source of the signal
                others = [layer[found[0][0]]]
            towards[n, pin.port] = sum(others) / len(others) - layer[n] if others else 0.0
    sides: Sides = {}
    for n, thing in enumerate(things):
        if isinstance(thing, Terminal):
            sides[n, thing.name] = -border[n]
            continue
        if thing.name in inner:
            sides |= {(n, b.port.name): b.side for b in inner[thing.name].border}
            continue
        shafts = _shafts(thing)
        if len(shafts) == 2:
            a, b = (towards.get((n, port.name), like) for port, like in zip(shafts, (-0.1, 0.1), strict=True))
            sides |= {(n, shafts[0].name): LEFT if a <= b else RIGHT, (n, shafts[1].name): RIGHT if a <= b else LEFT}
        elif shafts:
            like = RIGHT if thing.icon in DRIVING else LEFT
            there = towards.get((n, shafts[0].name), 0.0)
            sides[n, shafts[0].name] = like if not there else LEFT if there < 0 else RIGHT
        for port in thing.ports:
            if (n, port.name) not in sides:
                there = towards.get((n, port.name), 0.0)
                like = LEFT if port.name.endswith(LEFT_ENDS) or port.domain == "signal" else RIGHT
                sides[n, port.name] = like if not there else LEFT if there < 0 else RIGHT
    return sides


def _shafts(part: Outline) -> list[Terminal]:
    """The ports at which an icon's own shafts end: two, one, or none for framed parts."""
    icon = icon_of(part)
    if icon.framed:
        return []
    return [port for port in part.ports if port.domain != "signal" and port.name not in ASIDE][:2]


@dataclass
class _Design:
    """Input of the layout: parts and border ports, the pins of every net, their sides, the layers."""

    things: Sequence[Outline | Terminal]
    ends: Sequence[Sequence[tuple[int, Pin]]]
    side: Sides
    layer: Sequence[int]
    inner: dict[str, Arrangement]

    def places(self, n: int, rows: dict[tuple[int, int], list[str]]) -> dict[str, float]:
        """Height of every port of an item below its upper edge."""
        thing = self.things[n]
        if isinstance(thing, Terminal):
            return {thing.name: LABEL}
        if thing.name in self.inner:
            return {b.port.name: TITLE + b.y for b in self.inner[thing.name].border}
        icon, shafts = icon_of(thing), _shafts(thing)
        found: dict[str, float] = {}
        if shafts:
            found = {port.name: ZONE / 2 + y for port, y in zip(shafts, (icon.left, icon.right)[-len(shafts) :], strict=True)}
        first = ZONE + ROW / 2 if shafts else ROW
        for at in (LEFT, RIGHT):
            names = [name for name in rows.get((n, at), ()) if name not in found]
            found |= {name: first + ROW * i for i, name in enumerate(names)}
        return found

    def mirrored(self, n: int) -> bool:
        thing = self.things[n]
        shafts = _shafts(thing) if isinstance(thing, Outline) else []
        if len(shafts) == 1:
            return self.side[n, shafts[0].name] == LEFT
        return bool(shafts) and self.side[n, shafts[0].name] == RIGHT

    def size(self, n: int, found: dict[str, float]) -> tuple[float, float]:
        """Width (even) and height of an item with its label."""
        width, height = self._size(n, found)
        return 4.0 * ceil(width / 4), height

    def _size(self, n: int, found: dict[str, float]) -> tuple[float, float]:
        thing = self.things[n]
        if isinstance(thing, Terminal):
            return text_width(thing.name, 10) + 16, ROW + GRID
        label = text_width(label_of(thing)) + 8
        if thing.name in self.inner:
            contained = self.inner[thing.name]
            return max(contained.width + 2 * PADDING, label + 16), TITLE + contained.height + PADDING
        icon, shafts = icon_of(thing), _shafts(thing)
        aside = [found[port.name] for port in thing.ports if port not in shafts]
        if not icon.framed:
            return max(64.0, label), max([ZONE, *(y + GRID for y in aside)]) + LABEL
        names = {
            at: max((text_width(p.name, 9) for p in thing.ports if self.side[n, p.name] == at), default=0.0) for at in (-1, 1)
        }
        middle = 56.0 if icon.drawing else text_width(thing.kind, 10)
        body = max([ZONE, *(y + ROW for y in aside)])
        return max(64.0, label, names[LEFT] + names[RIGHT] + middle + 24), body + LABEL


def _routed(outline: Outline, design: _Design, limit: float) -> Arrangement:
    things, layer = design.things, design.layer
    count = max(layer, default=-1) + 1
    rows: list[list[int]] = [[] for _ in range(count)]
    for n in range(len(things)):
        rows[layer[n]].append(n)
    passing: dict[int, int] = {}  # node -> net
    through: list[tuple[int, int]] = []
    for net, found in enumerate(design.ends):
        channels = [layer[n] - (design.side[n, pin.port] == LEFT) for n, pin in found]
        through += [(net, at) for at in range(min(channels) + 1, max(channels) + 1)]
    for net, at in through:
        node = len(things) + len(passing)
        passing[node] = net
        rows[at].append(node)
    net_of = {(n, pin.port): net for net, found in enumerate(design.ends) for n, pin in found}
    ports = {n: [name for m, name in design.side if m == n] for n in range(len(things))}
    sided = {(n, at): [name for name in ports[n] if design.side[n, name] == at] for n in ports for at in (LEFT, RIGHT)}

    def connected(n: int) -> list[tuple[int, float]]:
        at = design.places(n, sided)
        return [(net_of[n, name], 0.9 * (y / max(at.values()) - 0.5)) for name, y in at.items() if (n, name) in net_of]

    around = {n: connected(n) for n in range(len(things))} | {node: [(net, 0.0)] for node, net in passing.items()}
    rows = ordered(rows, around)
    rank = {node: k for row in rows for k, node in enumerate(row)}
    sided = {key: _by_neighbours(key, names, net_of, design, rank) for key, names in sided.items()}
    nodes: dict[int, Node] = {node: Node(0.0, 0.0, ((net, LEFT, 0.0), (net, RIGHT, 0.0))) for node, net in passing.items()}
    places = {n: design.places(n, sided) for n in range(len(things))}
    for n in range(len(things)):
        width, height = design.size(n, places[n])
        pins = tuple((net_of[n, name], design.side[n, name], y) for name, y in places[n].items() if (n, name) in net_of)
        nodes[n] = Node(width, GRID * -(-height // GRID), pins)
    return _drawn(outline, design, rows, nodes, places, limit)


def _by_neighbours(
    key: tuple[int, int], names: list[str], net_of: dict[tuple[int, str], int], design: _Design, rank: dict[int, int]
) -> list[str]:
    """Ports at one side of a box, in the order of the parts that they are connected to."""
    n, _ = key

    def height(name: str) -> float:
        others = [rank[m] for m, _ in design.ends[net_of[n, name]] if m != n] if (n, name) in net_of else []
        return sum(others) / len(others) if others else 1e9

    return sorted(names, key=height)


def _drawn(
    outline: Outline, design: _Design, rows: list[list[int]], nodes: dict[int, Node], places: dict[int, dict[str, float]],
    limit: float,
) -> Arrangement:  # fmt: skip
    """Boxes and wires, row by row: a row is a sequence of layers that fits into the width."""
    widths = [max((nodes[n].width for n in row), default=0.0) for row in rows]
    if max(widths, default=0.0) > limit / 3:  # folding does not make diagrams with large nested boxes clearer
        limit = float("inf")
    boxes: list[Placed] = []
    border: list[Border] = []
    pieces: dict[int, list[Segment]] = {}
    bands = _bands(widths, limit)
    upper = total = 0.0
    arriving: dict[int, float] = {}  # nets from the row above, with their height in the gutter
    ends_above: dict[int, float] = {}
    for first, last in bands:
        here = rows[first:last]
        top = {n: y + upper for n, y in heights(here, nodes).items()}
        bottom = max([top[n] + nodes[n].height for row in here for n in row], default=upper)
        left: list[dict[int, list[float]]] = [{} for _ in range(len(here) + 1)]
        right: list[dict[int, list[float]]] = [{} for _ in range(len(here) + 1)]
        for i, row in enumerate(here):
            for n in row:
                for net, side, offset in nodes[n].pins:
                    (left[i + 1] if side == RIGHT else right[i]).setdefault(net, []).append(top[n] + offset)
        later = {net for row in rows[last:] for n in row for net, side, _ in nodes[n].pins if side == LEFT and n in rows[last]}
        going = [net for net in left[-1] if last < len(rows) and net in later]
        leaving = {net: bottom + ROW + GRID * i for i, net in enumerate(going)}
        beside = [arriving if i == 0 else leaving if i == len(here) else {} for i in range(len(here) + 1)]
        x = 0.0
        for i in range(len(here) + 1):
            found = channel(left[i], right[i], beside[i])
            used = found.width if left[i] or right[i] or beside[i] else 0.0
            for net, some in wires(found, x, left[i], right[i], beside[i]).items():
                pieces.setdefault(net, []).extend(some)
            if i == 0:
                for net, y in arriving.items():
                    pieces[net].append((x + found.track[net], y, ends_above[net], y))
            if i == len(here):
                ends_above = {net: x + found.track[net] for net in leaving}
            x += used
            if i < len(here):
                for n in here[i]:
                    if n < len(design.things):
                        _place(design, n, x, top[n], widths[first + i], nodes[n].height, places[n], boxes, border)
                        _to_edges(design, n, x, top[n], widths[first + i], nodes[n], pieces)
                    else:
                        net = nodes[n].pins[0][0]
                        pieces.setdefault(net, []).append((x, top[n], x + widths[first + i], top[n]))
                x += widths[first + i]
        total = max(total, x)
        upper = max([bottom, *leaving.values()]) + ROW
        arriving = leaving
    height = upper - ROW if bands else 0.0
    made = tuple(Wire(net, tuple(pieces[i]), joints(pieces[i])) for i, net in enumerate(outline.nets) if pieces.get(i))
    return Arrangement(total, GRID * -(-height // GRID), tuple(boxes), made, tuple(border))


def _to_edges(design: _Design, n: int, x: float, y: float, width: float, node: Node, pieces: dict[int, list[Segment]]) -> None:
    """Segments from a box, which is centred in its layer, to the layer's edges."""
    free = 0.0 if isinstance(design.things[n], Terminal) else (width - node.width) / 2
    for net, side, offset in node.pins:
        if free > 0:
            ends = (x, x + free) if side == LEFT else (x + width - free, x + width)
            pieces.setdefault(net, []).append((ends[0], y + offset, ends[1], y + offset))


def _place(
    design: _Design, n: int, x: float, y: float, width: float, height: float, found: dict[str, float], boxes: list[Placed],
    border: list[Border],
) -> None:  # fmt: skip
    thing = design.things[n]
    if isinstance(thing, Terminal):
        side = -design.side[n, thing.name]
        border.append(Border(thing, side, x + width if side == LEFT else x, y + found[thing.name]))
        return
    own = design.size(n, found)[0]
    used = {pin.port for ends in design.ends for m, pin in ends if m == n} if not icon_of(thing).framed else found
    ends = tuple((port, design.side[n, port.name], found[port.name]) for port in thing.ports if port.name in used)
    contained = design.inner.get(thing.name)
    boxes.append(Placed(thing, x + (width - own) / 2, y, own, height, ends, design.mirrored(n), contained))


def _bands(widths: Sequence[float], limit: float) -> list[tuple[int, int]]:
    """Sequences of layers, each about as wide as the limit allows."""
    room = 48.0  # approximate width of a channel
    bands, first, used = [], 0, 0.0
    for i, width in enumerate(widths):
        if i > first and used + width + room > limit:
            bands.append((first, i))
            first, used = i, 0.0
        used += width + room
    return [*bands, (first, len(widths))] if widths else []


def joints(pieces: Sequence[Segment]) -> tuple[tuple[float, float], ...]:
    """Points where three segments or more meet.

    >>> joints([(0, 0, 8, 0), (8, 0, 8, 8), (8, 0, 16, 0)])
    ((8, 0),)
    """
    found = []
    for x, y in sorted({end for x1, y1, x2, y2 in pieces for end in ((x1, y1), (x2, y2))}):
        ways = set()
        for x1, y1, x2, y2 in pieces:
            if y1 == y2 == y and min(x1, x2) <= x <= max(x1, x2) and x1 != x2:
                ways |= {"left"} if x > min(x1, x2) else set()
                ways |= {"right"} if x < max(x1, x2) else set()
            if x1 == x2 == x and min(y1, y2) <= y <= max(y1, y2) and y1 != y2:
                ways |= {"up"} if y > min(y1, y2) else set()
                ways |= {"down"} if y < max(y1, y2) else set()
        if len(ways) > 2:
            found.append((x, y))
    return tuple(found)
