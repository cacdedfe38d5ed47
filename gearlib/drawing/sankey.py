"""Sankey diagram of a power flow: band widths proportional to power, from drives to loads, with circulating power flowing back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

from gearlib.drawing.layers import ordered
from gearlib.drawing.placement import Node, heights
from gearlib.drawing.svg import Picture, document, element, group, number, polygon, rectangle, text, text_width

BAND, BACK, LOSS, INK = "#5b8db8", "#d08a3c", "#c0392b", "#1b2a41"
WIDEST, BAR, BETWEEN, EDGE = 56.0, 10.0, 96.0, 24.0  # band, component, distance of columns, margin


@dataclass(frozen=True)
class Band:
    """Power (W) from one component to another."""

    source: str
    target: str
    power: float


def watts(power: float) -> str:
    """Format a power with its unit.

    >>> watts(1234.5), watts(0.5), watts(2.5e6)
    ('1.23 kW', '0.5 W', '2.5 MW')
    """
    for size, unit in ((1e6, "MW"), (1e3, "kW")):
        if abs(power) >= 0.9995 * size:
            return f"{power / size:.3g} {unit}"
    return f"{power:.3g} W"


def sankey(flows: Sequence[Band], losses: Mapping[str, float], title: str, joints: Sequence[str] = ()) -> Picture:
    """Draw a power flow.

    Parameters
    ----------
    flows : sequence of Band
        Positive powers, W.
    losses : mapping of str to float
        Power that components dissipate, W.
    title : str
    joints : sequence of str
        Those components that are shafts, where power is split or merged.
    """
    names = list(dict.fromkeys(n for f in flows for n in (f.source, f.target)))
    index = {name: i for i, name in enumerate(names)}
    top = max((f.power for f in flows), default=1.0)
    scale = WIDEST / top
    back = returning(flows)
    graph = nx.DiGraph((index[f.source], index[f.target]) for k, f in enumerate(flows) if k not in back)
    graph.add_nodes_from(range(len(names)))
    layer = [0] * len(names)
    for n in nx.topological_sort(graph):
        layer[n] = max((layer[p] + 1 for p in graph.predecessors(n)), default=0)
    forward = [k not in back for k in range(len(flows))]
    room = {
        n: [sum(f.power for f in flows if (f.source, f.target)[k] == name) * scale for k in (0, 1)]
        for n, name in enumerate(names)
    }
    size = {n: max(2.0, *both) for n, both in room.items()}
    rows: list[list[int]] = [[] for _ in range(max(layer, default=-1) + 1)]
    for n, at in enumerate(layer):
        rows[at].append(n)
    nodes = {}
    through: dict[int, list[int]] = {}  # the bands that pass intermediate layers, as nodes
    for k, f in enumerate(flows):
        if forward[k]:
            for at in range(layer[index[f.source]] + 1, layer[index[f.target]]):
                node = len(names) + sum(map(len, through.values()))
                through.setdefault(k, []).append(node)
                rows[at].append(node)
                nodes[node] = Node(BAR, f.power * scale, ((k, -1, 0.0), (k, 1, 0.0)))
    for n, name in enumerate(names):
        pins = [(k, 1, 0.0) for k, f in enumerate(flows) if f.source == name and forward[k]]
        pins += [(k, -1, 0.0) for k, f in enumerate(flows) if f.target == name and forward[k]]
        nodes[n] = Node(BAR, size[n] + 30.0 + (24.0 if losses.get(name) else 0.0), tuple(pins))
    rows = ordered(rows, {n: [(net, 0.0) for net, *_ in node.pins] for n, node in nodes.items()})
    tops = heights(rows, nodes)
    step = BETWEEN + max((text_width(name) for name in names if name not in joints), default=0.0) * 0.5
    spare = EDGE + max((text_width(name) / 2 for name in names), default=0.0)
    x = {n: spare + step * at for at, row in enumerate(rows) for n in row}
    y = {n: tops[n] + EDGE + 40.0 for n in tops}
    depth = max((y[n] + nodes[n].height for n in nodes), default=0.0) + 12.0
    drawn: list[str] = []
    used = {(n, side): 0.0 for n in range(len(names)) for side in (0, 1)}
    rank = {n: (k, y[n]) for n, k in enumerate(layer)}
    by_height = sorted(
        range(len(flows)), key=lambda k: (not forward[k], rank[index[flows[k].target]][1], rank[index[flows[k].source]][1])
    )
    for k in by_height:
        f = flows[k]
        a, b, width = index[f.source], index[f.target], f.power * scale
        begin = (x[a] + BAR, y[a] + used[a, 0] + width / 2)
        end = (x[b], y[b] + used[b, 1] + width / 2)
        used[a, 0] += width
        used[b, 1] += width
        label = f"{f.source} → {f.target}: {watts(f.power)}"
        if forward[k]:
            stops = [(x[n], y[n] + width / 2) for n in through.get(k, [])]
            drawn.append(group(_band([begin, *stops, end], width, watts(f.power)), title=label))
        else:
            depth += max(width, 8.0) + 8.0
            drawn.append(group(_return(begin, end, depth - width / 2, width, watts(f.power)), title=label))
    for n, name in enumerate(names):
        drawn += _node(x[n], y[n], size[n], "" if name in joints else name, losses.get(name, 0.0), scale)
    width = max(x.values(), default=0.0) + BAR + spare
    drawn.append(text(EDGE, EDGE, title, font_size="13", font_weight="bold", fill=INK))
    return Picture(document(max(width, text_width(title, 13) * 1.1 + 2 * EDGE), depth + EDGE, drawn, title))


def returning(flows: Sequence[Band]) -> set[int]:
    """Flows whose removal leaves no cycle: from each cycle, the one that leads back nearest to a drive.

    >>> returning([Band("drive", "a", 1.0), Band("a", "b", 3.0), Band("b", "load", 1.0), Band("b", "c", 2.0), Band("c", "a", 2.0)])
    {4}
    """
    graph = nx.DiGraph()
    for k, f in enumerate(flows):
        graph.add_edge(f.source, f.target, number=k)
    drives = [n for n in graph if not graph.in_degree(n)] or list(graph)[:1]
    distance = nx.multi_source_dijkstra_path_length(graph, drives, weight=None) if drives else {}
    found: list[tuple[str, str, int]] = []
    while not nx.is_directed_acyclic_graph(graph):
        circle = nx.find_cycle(graph)
        a, b = min(circle, key=lambda e: (distance.get(e[1], len(graph)), graph.edges[e]["number"]))
        found.append((a, b, graph.edges[a, b]["number"]))
        graph.remove_edge(a, b)
    back: set[int] = set()
    for a, b, k in found:  # removals for one cycle may be made redundant by those for a later one
        if nx.has_path(graph, b, a):
            back.add(k)
        else:
            graph.add_edge(a, b)
    return back


def _band(stops: Sequence[tuple[float, float]], width: float, label: str) -> Iterator[str]:
    d = f"M{number(stops[0][0])} {number(stops[0][1])}"
    for (x1, y1), (x2, y2) in zip(stops, stops[1:], strict=False):
        middle = (x1 + x2) / 2
        d += f" C{number(middle)} {number(y1)} {number(middle)} {number(y2)} {number(x2)} {number(y2)}"
    yield element("path", d=d, fill="none", stroke=BAND, stroke_width=max(width, 0.8), stroke_opacity="0.55")
    (x1, y1), (x2, y2) = stops[0], stops[1]
    yield text(
        (x1 + x2) / 2,
        (y1 + y2) / 2 + (4 if width > 14 else -width / 2 - 4),
        label,
        text_anchor="middle",
        font_size="10",
        fill=INK,
    )


def _return(begin: tuple[float, float], end: tuple[float, float], y: float, width: float, label: str) -> Iterator[str]:
    """A band for returning power, routed below everything else."""
    out = 12.0 + width / 2
    corners = [begin, (begin[0] + out, begin[1]), (begin[0] + out, y), (end[0] - out, y), (end[0] - out, end[1]), end]
    d = "M" + " L".join(f"{number(px)} {number(py)}" for px, py in corners)
    yield element(
        "path", d=d, fill="none", stroke=BACK, stroke_width=max(width, 0.8), stroke_opacity="0.6", stroke_linejoin="round"
    )
    yield text((begin[0] + end[0]) / 2, y + 4, f"{label} flows back", text_anchor="middle", font_size="10", fill=INK)


def _node(x: float, y: float, height: float, name: str, loss: float, scale: float) -> Iterator[str]:
    yield rectangle(x, y, BAR, height, fill=INK)
    if loss:
        wide = max(abs(loss) * scale, 1.0)
        yield polygon(
            [
                (x + BAR / 2 - wide / 2, y + height),
                (x + BAR / 2 + wide / 2, y + height),
                (x + BAR / 2, y + height + 10 + wide / 2),
            ],
            fill=LOSS,
        )
        yield text(x + BAR + 4, y + height + 12, f"loss {watts(loss)}", font_size="9", fill=LOSS)
    if name:
        yield text(x + BAR / 2, y - 5, name, text_anchor="middle", fill=INK)
