"""Steps of the layout of block diagrams: each does what it promises, against closed forms and twins."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np
import pytest
from scipy.optimize import isotonic_regression

from gearlib.drawing.arrangement import LEFT, RIGHT, Arrangement, arranged
from gearlib.drawing.block_diagram import OWN, Net, Outline, Pin, Terminal
from gearlib.drawing.channels import GAP, MARGIN, NUDGE, TRACK, channel, wires
from gearlib.drawing.layers import layers, ordered, positions
from gearlib.drawing.placement import GRID, Node, heights, spread

# ---------------------------------------------------------------- layers


@pytest.mark.parametrize("seed", range(5))
def test_positions_minimise_the_weighted_squares(seed: int) -> None:
    """Right end before left end pulls with 1, an end of any side with 0.3, two alike with 0.1, shared among the ends of a net."""
    random = np.random.default_rng(seed)
    n = 6
    nets = [[(int(i), int(random.integers(-1, 2))) for i in random.choice(n, random.integers(2, 5))] for _ in range(7)]

    def price(x: np.ndarray) -> float:
        total = 0.5e-6 * float(x @ x)
        for ends in nets:
            for (a, side_a), (b, side_b) in itertools.combinations(ends, 2):
                weight = {2: 1.0, 1: 0.3, 0: 0.1}[abs(side_a - side_b)] / len(ends)
                total += 0.5 * weight * (x[b] - x[a] - (side_a - side_b) / 2) ** 2 if a != b else 0.0
        return total

    x = np.array(positions(n, nets))
    slope = [(price(x + step) - price(x - step)) / 2e-3 for step in 1e-3 * np.eye(n)]
    assert slope == pytest.approx(np.zeros(n), abs=1e-9)
    assert positions(2, []) == [0.0, 0.0]


@pytest.mark.parametrize("seed", range(10))
def test_right_ends_lie_in_layers_before_left_ends(seed: int) -> None:
    """In random trees of parts with two ports each; border ports stand alone, before all others and after them."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    nets = [[(int(random.integers(0, i)), 1), (i, -1)] for i in range(1, n)]
    found = layers(n, nets, {})
    assert min(found) == 0
    assert set(found) == set(range(max(found) + 1))
    assert all(found[a] < found[b] for (a, _), (b, _) in nets)
    tree = nx.DiGraph((a, b) for (a, _), (b, _) in nets)
    assert max(found) == nx.dag_longest_path_length(tree)
    for node in tree:  # as near to what follows as what precedes allows
        after = [found[s] for s in tree.successors(node)]
        before = [found[p] for p in tree.predecessors(node)]
        assert not before or found[node] > max(before)
        assert len(after) <= len(before) or found[node] == min(after) - 1
    fixed = layers(n + 2, [*nets, [(n, 1), (0, -1)], [(n + 1, -1), (n - 1, 1)]], {n: -1, n + 1: 1})
    assert fixed[n] == 0
    assert fixed[n + 1] == max(fixed) > max(fixed[:n])
    assert fixed[:n] == [layer + 1 for layer in found]
    assert layers(n + 1, nets, {n: 1})[:n] == found


def crossings(rows: list[list[int]], places: dict[int, list[tuple[int, float]]]) -> int:
    """Of straight lines between neighbouring rows, from the mean height of a net in the one to that in the other."""
    count = 0
    for row, following in itertools.pairwise(rows):
        ends = []
        for side in (row, following):
            at: dict[int, list[float]] = {}
            for k, node in enumerate(side):
                for net, offset in places[node]:
                    at.setdefault(net, []).append(k + offset)
            ends.append({net: np.mean(found) for net, found in at.items()})
        both = [(ends[0][net], ends[1][net]) for net in ends[0].keys() & ends[1].keys()]
        count += sum((a - c) * (b - d) < 0 for (a, b), (c, d) in itertools.combinations(both, 2))
    return count


@pytest.mark.parametrize("seed", range(12))
def test_rows_that_can_be_without_crossings_are(seed: int) -> None:
    """Ladders whose rows are shuffled, with several pins for each node, and their offsets in order."""
    random = np.random.default_rng(seed)
    levels, high = int(random.integers(2, 5)), int(random.integers(2, 6))
    rows = [[high * i + k for k in range(high)] for i in range(levels)]
    places: dict[int, list[tuple[int, float]]] = {node: [] for row in rows for node in row}
    net = 0
    for left, right in itertools.pairwise(rows):
        for a, b in zip(left, right, strict=True):
            for offset in (-0.4, 0.3):
                places[a].append((net, offset))
                places[b].append((net, offset))
                net += 1
    assert crossings(rows, places) == 0
    shuffled = [[int(n) for n in random.permutation(row)] for row in rows]
    found = ordered(shuffled, places)
    assert [sorted(row) for row in found] == rows
    assert crossings(found, places) == 0
    assert ordered(shuffled, places) == found


@pytest.mark.parametrize("seed", range(5))
def test_the_order_is_never_worse_than_before_and_mostly_the_best(seed: int) -> None:
    """Two rows of four nodes with random nets: against all orders."""
    random = np.random.default_rng(seed)
    rows = [[0, 1, 2, 3], [4, 5, 6, 7]]
    places: dict[int, list[tuple[int, float]]] = {n: [] for n in range(8)}
    for net in range(6):
        places[int(random.integers(0, 4))].append((net, 0.0))
        places[int(random.integers(4, 8))].append((net, 0.0))
    best = min(
        crossings([list(a), list(b)], places) for a in itertools.permutations(rows[0]) for b in itertools.permutations(rows[1])
    )
    found = crossings(ordered(rows, places), places)
    assert best <= found <= min(crossings(rows, places), best + 2)


# ---------------------------------------------------------------- heights


def apart(a: Node, b: Node) -> float:
    """Least distance of two neighbours, from upper edge to upper edge."""
    return a.height + (GRID if a.height == b.height == 0 else 2 * GRID)


@pytest.mark.parametrize("seed", range(10))
def test_spread_is_isotonic_regression_on_the_grid(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 8))
    nodes = {k: Node(40.0, GRID * float(random.integers(0, 4)), ()) for k in range(n)}
    wanted, weights = random.uniform(-100, 100, n), random.uniform(0.1, 3.0, n)
    offsets = np.cumsum([0.0, *(apart(nodes[k], nodes[k + 1]) for k in range(n - 1))])
    expected = isotonic_regression(wanted - offsets, weights=weights).x
    found = np.array(spread(wanted.tolist(), weights.tolist(), range(n), nodes))
    assert found == pytest.approx(GRID * np.round(expected / GRID) + offsets)


def test_connected_pins_have_equal_heights_where_they_can() -> None:
    """Chains and branches: each wire straight, the lowest node at 0, boxes two steps apart, passing wires one."""

    def node(height: float, *pins: tuple[int, int, float]) -> Node:
        return Node(40.0, height, pins)

    chain = {
        0: node(64, (0, 1, 24)),
        1: node(48, (0, -1, 8), (1, 1, 40)),
        2: node(0, (1, -1, 0), (1, 1, 0)),
        3: node(32, (1, -1, 16)),
    }
    top = heights([[0], [1], [2], [3]], chain)
    assert min(top.values()) == 0
    assert top[0] + 24 == top[1] + 8
    assert top[1] + 40 == top[2] == top[3] + 16
    fork = {0: node(96, (0, 1, 16), (1, 1, 80)), 1: node(32, (0, -1, 16)), 2: node(32, (1, -1, 16))}
    top = heights([[0], [1, 2]], fork)
    assert top == {0: 0, 1: 0, 2: 64}
    close = {0: node(48, (0, 1, 16), (1, 1, 32)), 1: node(32, (0, -1, 16)), 2: node(32, (1, -1, 16))}
    top = heights([[0], [1, 2]], close)
    assert top[2] - top[1] == 32 + 2 * GRID
    assert 0 in (top[0] + 16 - top[1] - 16, top[0] + 32 - top[2] - 16)  # one of the two is straight
    passing = {k: node(0, (k, -1, 0), (k, 1, 0)) for k in range(3)}
    assert sorted(heights([[0, 1, 2]], passing).values()) == [0, GRID, 2 * GRID]
    assert heights([], {}) == {}


@pytest.mark.parametrize("seed", range(8))
def test_a_wire_that_passes_many_layers_is_straight(seed: int) -> None:
    """Beside boxes of any height, which make way for it."""
    random = np.random.default_rng(seed)
    rows, nodes = [], {}
    for i in range(5):
        nodes[2 * i] = Node(40.0, 0.0, ((0, -1, 0.0), (0, 1, 0.0)))
        nodes[2 * i + 1] = Node(40.0, GRID * float(random.integers(3, 9)), ((1, -1, 16.0), (1, 1, 16.0)))
        rows.append([2 * i, 2 * i + 1])
    top = heights(rows, nodes)
    assert len({top[2 * i] for i in range(5)}) == 1
    assert len({top[2 * i + 1] for i in range(5)}) == 1
    assert all(top[2 * i + 1] - top[2 * i] >= 2 * GRID for i in range(5))


# ---------------------------------------------------------------- channels


def test_nets_share_a_track_where_their_spans_are_apart() -> None:
    """Width of two margins, and a track for each net that overlaps; straight nets have none."""
    assert channel({0: [8.0]}, {0: [8.0]}, {}).track == {}
    assert channel({0: [8.0]}, {0: [8.0]}, {}).width == 2 * MARGIN
    one = channel({0: [0.0], 1: [40.0]}, {0: [20.0], 1: [60.0]}, {})
    assert one.track == {0: MARGIN, 1: MARGIN}
    for gap, tracks in ((GAP, 1), (GAP - 0.5, 2)):
        found = channel({0: [0.0], 1: [20.0 + gap]}, {0: [20.0], 1: [60.0]}, {})
        assert found.width == 2 * MARGIN + TRACK * (tracks - 1)
        assert len(set(found.track.values())) == tracks
    three = channel({0: [0.0], 1: [8.0], 2: [16.0]}, {0: [48.0], 1: [56.0], 2: [64.0]}, {})
    assert three.width == 2 * MARGIN + 2 * TRACK
    assert sorted(three.track.values()) == [MARGIN, MARGIN + TRACK, MARGIN + 2 * TRACK]
    assert not three.nudged
    assert channel({0: [8.0, 16.0]}, {0: [8.0]}, {}).track == {0: MARGIN}
    assert channel({0: [8.0]}, {}, {0: 80.0}).track == {0: MARGIN}
    assert channel({0: [8.0], 1: [24.0]}, {1: [32.0]}, {0: 80.0}).width == 2 * MARGIN + TRACK


def test_wires_that_cross_heights_do_not_lie_on_each_other() -> None:
    """Net 0 ends on the left where net 1 ends on the right: 0 turns off before 1 comes. Both ways round one end is shifted."""
    one = channel({0: [16.0], 1: [48.0]}, {0: [80.0], 1: [16.0]}, {})
    assert one.track[0] < one.track[1]
    assert not one.nudged
    both = channel({0: [16.0], 1: [48.0]}, {0: [48.0], 1: [16.0]}, {})
    assert len(both.nudged) == 1
    ((net, height),) = both.nudged
    drawn = wires(both, 100.0, {0: [16.0], 1: [48.0]}, {0: [48.0], 1: [16.0]}, {})
    end = 100.0 + both.width
    assert (end, height) in {point for x1, y1, x2, y2 in drawn[net] for point in ((x1, y1), (x2, y2))}
    assert {y1 for _, y1, _, y2 in drawn[net] if y1 == y2} >= {height, height + NUDGE}
    (level,) = ((x1, x2) for x1, y1, x2, y2 in drawn[net] if y1 == y2 == height + NUDGE)
    assert level == (100.0 + both.track[net], end - NUDGE)


@pytest.mark.parametrize("seed", range(8))
def test_random_channels_join_what_belongs_together_and_nothing_else(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 6))
    free = {side: [float(y) for y in random.permutation(np.arange(0, 96, 8.0))] for side in (0, 1)}
    sides: list[dict[int, list[float]]] = [{}, {}]
    for net in range(n):
        for side in (0, 1) if net % 3 else (net % 2,):
            sides[side][net] = [free[side].pop() for _ in range(random.integers(1, 3))]
    beside = {net: 104.0 + 8 * k for k, net in enumerate(net for net in range(n) if net % 3 == 0)}
    found = channel(*sides, beside)
    drawn = wires(found, 0.0, *sides, beside)
    assert set(drawn) == set(sides[0]) | set(sides[1])
    for net, pieces in drawn.items():
        assert all(x1 == x2 or y1 == y2 for x1, y1, x2, y2 in pieces)
        points = {p for x1, y1, x2, y2 in pieces for p in ((x1, y1), (x2, y2))}
        wanted = {(0.0, y) for y in sides[0].get(net, ())} | {(found.width, y) for y in sides[1].get(net, ())}
        assert wanted <= points
        assert net not in beside or (found.track[net], beside[net]) in points
        graph = nx.Graph()
        for x1, y1, x2, y2 in pieces:
            on = sorted(p for p in points if min(x1, x2) <= p[0] <= max(x1, x2) and min(y1, y2) <= p[1] <= max(y1, y2))
            nx.add_path(graph, on)
        assert nx.is_connected(graph)
    for a, b in itertools.combinations(drawn, 2):
        for p, q in itertools.product(drawn[a], drawn[b]):
            for k in (0, 1):  # on one vertical, on one horizontal line
                if p[k] == p[k + 2] == q[k] == q[k + 2]:
                    first, second = (sorted((s[1 - k], s[3 - k])) for s in (p, q))
                    assert min(first[1], second[1]) <= max(first[0], second[0]), (a, b)


# ---------------------------------------------------------------- the whole

TWO = (Terminal("flange_a"), Terminal("flange_b"))


def row(*parts: Outline, own: tuple[Terminal, ...] = (), more: tuple[Net, ...] = (), width: float = 2000.0) -> Arrangement:
    """Parts one behind the other, each with its last port at the next one's first."""
    nets = [Net((Pin(a.name, a.ports[-1].name), Pin(b.name, b.ports[0].name))) for a, b in itertools.pairwise(parts)]
    return arranged(Outline("all", "All", ports=own, parts=parts, nets=(*nets, *more)), width)


def body(name: str, icon: str = "inertia") -> Outline:
    return Outline(name, "Inertia", icon, TWO)


def test_a_train_is_drawn_from_its_drive_to_its_load() -> None:
    """In a straight line, each first shaft to the left; whatever the order in which the parts are given."""
    drive, load = Outline("m", "Torque", "torque", TWO[:1]), Outline("z", "Load", "load", TWO[:1])
    parts = (drive, body("a"), body("b", "spring"), load)
    nets = tuple(Net((Pin(a.name, a.ports[-1].name), Pin(b.name, b.ports[0].name))) for a, b in itertools.pairwise(parts))
    for given in itertools.permutations(parts):
        found = arranged(Outline("all", "All", parts=given, nets=nets), 2000.0)
        boxes = sorted(found.boxes, key=lambda box: box.x)
        assert [box.part.name for box in boxes] == ["m", "a", "b", "z"]
        assert len({box.y for box in boxes}) == 1
        assert [box.mirrored for box in boxes] == [False, False, False, True]  # the load has its shaft on the left
        assert [[side for _, side, _ in box.ends] for box in boxes] == [[RIGHT], [LEFT, RIGHT], [LEFT, RIGHT], [LEFT]]
        for wire in found.wires:
            assert len({y for _, y1, _, y2 in wire.pieces for y in (y1, y2)}) == 1
            assert not wire.joints


@pytest.mark.parametrize("seed", range(10))
def test_shafts_face_what_they_are_connected_to(seed: int) -> None:
    """Of two shafts that which leads to the left is on the left, whichever it is; the icon is mirrored where it is the second."""
    random = np.random.default_rng(seed)
    parts = tuple(body(f"b{k}") for k in range(6))
    turned = random.random(6) < 0.4
    ends = [("flange_b", "flange_a") if t else ("flange_a", "flange_b") for t in turned]
    nets = tuple(Net((Pin(f"b{k}", ends[k][1]), Pin(f"b{k + 1}", ends[k + 1][0]))) for k in range(5))
    boxes = {box.part.name: box for box in arranged(Outline("all", "All", parts=parts, nets=nets), 2000.0).boxes}
    for k in range(1, 5):
        box = boxes[f"b{k}"]
        sides = {port.name: side for port, side, _ in box.ends}
        before, after = boxes[f"b{k - 1}"].x, boxes[f"b{k + 1}"].x
        if before != after:
            assert sides[ends[k][0]] == (LEFT if before < after else RIGHT)
        assert sorted(sides.values()) == [LEFT, RIGHT]
        assert box.mirrored == (sides["flange_a"] == RIGHT)


@pytest.mark.parametrize(
    ("port", "domain", "side"),
    [("x_a", "rotation", LEFT), ("x_in", "rotation", LEFT), ("x_b", "rotation", RIGHT), ("x_out", "rotation", RIGHT)],
)
def test_ports_of_the_component_stand_where_their_names_say(port: str, domain: str, side: int) -> None:
    found = row(body("a"), own=(Terminal(port, domain), Terminal("other", domain)))
    (border,) = (b for b in found.border if b.port.name == port)
    assert border.side == side
    assert (border.x < found.width / 2) == (side == LEFT)


def test_signals_run_from_their_source_to_the_right() -> None:
    law = Outline("law", "Law", "", (Terminal("u", "signal"), Terminal("y", "signal")))
    after = Outline("after", "Law", "", (Terminal("u", "signal"), Terminal("y", "signal")))
    nets = (
        Net((Pin(OWN, "command"), Pin("law", "u")), "signal"),
        Net((Pin("law", "y"), Pin("after", "u")), "signal"),
        Net((Pin("after", "y"), Pin(OWN, "result")), "signal"),
    )
    own = (Terminal("command", "signal"), Terminal("result", "signal"))
    found = arranged(Outline("all", "All", ports=own, parts=(after, law), nets=nets), 2000.0)
    assert {b.port.name: b.side for b in found.border} == {"command": LEFT, "result": RIGHT}
    assert sorted((box.x, box.part.name) for box in found.boxes)[0][1] == "law"
    for box in found.boxes:
        assert {port.name: side for port, side, _ in box.ends} == {"u": LEFT, "y": RIGHT}


def test_two_ports_without_preference_stand_on_opposite_sides() -> None:
    parts = (body("a"),)
    nets = (Net((Pin(OWN, "one"), Pin("a", "flange_a"))), Net((Pin(OWN, "two"), Pin("a", "flange_b"))))
    found = arranged(Outline("all", "All", ports=(Terminal("one"), Terminal("two")), parts=parts, nets=nets), 2000.0)
    assert {b.port.name: b.side for b in found.border} == {"one": LEFT, "two": RIGHT}
    loose = arranged(Outline("all", "All", ports=(Terminal("one"), Terminal("two")), parts=parts), 2000.0)
    assert {b.side for b in loose.border} == {LEFT, RIGHT}
    three = arranged(Outline("all", "All", ports=tuple(map(Terminal, ("one", "two", "last"))), parts=parts), 2000.0)
    assert {b.port.name: b.side for b in three.border} == {"one": LEFT, "two": LEFT, "last": RIGHT}


def test_a_branch_has_a_joint_and_a_through_wire_has_none() -> None:
    net = Net((Pin("a", "flange_b"), Pin("b", "flange_a"), Pin("c", "flange_a")))
    found = arranged(Outline("all", "All", parts=(body("a"), body("b"), body("c")), nets=(net,)), 2000.0)
    (wire,) = found.wires
    assert len(wire.joints) == 1
    boxes = {box.part.name: box for box in found.boxes}
    assert boxes["b"].x == boxes["c"].x > boxes["a"].x
    (x, _) = wire.joints[0]
    assert boxes["a"].x + boxes["a"].width < x < boxes["b"].x


@pytest.mark.parametrize("count", [5, 9])
def test_a_long_train_is_folded_into_rows_that_fit(count: int) -> None:
    """Each row begins at the left and takes as many parts as it can; without need there is one row."""
    parts = tuple(body(f"b{k}") for k in range(count))
    one = row(*parts)
    assert len({box.y for box in one.boxes}) == 1
    limit = 450.0
    found = row(*parts, width=limit)
    rows: dict[float, list[str]] = {}
    for box in sorted(found.boxes, key=lambda b: (b.y, b.x)):
        rows.setdefault(box.y, []).append(box.part.name)
    assert [name for names in rows.values() for name in names] == [part.name for part in parts]
    assert found.width <= limit
    most = max(map(len, rows.values()))
    assert all(len(names) == most for names in list(rows.values())[:-1])
    assert (most + 1) * (64 + 48) > limit >= most * (64 + 48)
    lower = sorted(rows)
    assert all(b - a >= 64 + 16 for a, b in itertools.pairwise(lower))
    assert len(found.wires) == count - 1
    assert row(*parts, width=150.0).width == pytest.approx(one.width)  # a box of more than a third of the width: no folding


def test_boxes_are_as_wide_as_their_names_and_ports_need() -> None:
    wide = Outline("n", "Kind", "", tuple(Terminal(f"{'long' * 5}_{k}") for k in "ab"))
    (box,) = arranged(Outline("all", "All", parts=(wide,)), 2000.0).boxes
    words = 0.62 * 9 * 2 * len("longlonglonglonglong_a") + 0.62 * 10 * len("Kind")
    assert words + 24 <= box.width <= words + 24 + 4
    (box,) = arranged(Outline("all", "All", parts=(Outline("x" * 30, "K", "inertia", TWO),)), 2000.0).boxes
    assert 0.62 * 11 * 30 + 8 <= box.width <= 0.62 * 11 * 30 + 12
    (small,) = arranged(Outline("all", "All", parts=(body("a"),)), 2000.0).boxes
    assert (small.width, small.height) == (64, 64)
    many = Outline("m", "Kind", "", tuple(Terminal(f"p{k}_a") for k in range(6)))
    (tall,) = arranged(Outline("all", "All", parts=(many,)), 2000.0).boxes
    levels = [height for _, _, height in tall.ends]
    assert np.diff(levels) == pytest.approx(np.full(5, 16))
    assert levels[0] == 16
    assert tall.height == pytest.approx(levels[-1] + 16 + 16, abs=GRID)
