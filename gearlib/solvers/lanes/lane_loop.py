"""Tsitouras' method for `LANES` runs side by side: each lane has its own time, step and error, and takes the next run when it is done.

Only the beginning and the end of runs and the storing of samples branch on single lanes. Everything else is vectorised: a lane whose step
was rejected repeats it while the others continue, and the results of a lane without a run are ignored.
"""

from __future__ import annotations

import math

from gearlib.compiler.instructions import LANES
from gearlib.compiler.small_language import (
    any_of,
    both,
    either,
    floats_at,
    generated,
    in_lanes,
    int32,
    ints_at,
    lanes_at,
    native,
    where,
)
from gearlib.solvers.drive.drive_loop import ROUNDING
from gearlib.solvers.lanes.lane_record import LANE_MODEL, LaneRecord
from gearlib.solvers.rungekutta.first_step import DAMPED, NEAR5
from gearlib.solvers.rungekutta.tableaux import TSIT5_A, TSIT5_C, TSIT5_E, TSIT5_R
from gearlib.solvers.rungekutta.vectors import TINY

__all__ = ["GENERATED"]

DONE, FAILED = 1, -1
SQUARE_NEAR, SQUARE_DAMPED = NEAR5**2, DAMPED**2
LEAST, LEAST_BEFORE = 1e-20, 10**-0.25  # lower bounds of the squared error, and of the sixteenth root of the previous one


def _weighted(row: tuple[float, ...]) -> str:
    """Text of a sum over the stages."""
    return " + ".join(f"{a!r} * k[i + {j} * n]" for j, a in enumerate(row) if a != 0.0)


def _stage(stage: int) -> list[str]:
    """Lines that evaluate a stage."""
    target = "x_new" if stage == 6 else "y"
    return [
        "    for i in range(n):",
        f"        {target}[i] = x[i] + h * ({_weighted(TSIT5_A[stage])})",
        f"    now[0] = s.origin + (t + {TSIT5_C[stage]!r} * h)",
        f"    LANE_MODEL(s.rhs, s.now, s.{target}, s.k + {8 * LANES * stage} * n, s.data)",
    ]


def _dense_weight(row: tuple[float, ...]) -> str:
    text = repr(row[-1])
    for r in row[-2::-1]:
        text = f"({r!r} + theta * {text})"
    return f"theta * {text}"


GENERATED = "\n".join([
    "def _stages(s: LaneRecord, t: lane, h: lane) -> None:",
    "    x, y, x_new, k, now, n = lanes_at(s.x), lanes_at(s.y), lanes_at(s.x_new), lanes_at(s.k), lanes_at(s.now), s.n",
    *(line for stage in range(1, 7) for line in _stage(stage)),
    "",
    "def _measured(s: LaneRecord) -> tuple[lane, lane, lane, lane]:",
    "    x, y, x_new, k, n = lanes_at(s.x), lanes_at(s.y), lanes_at(s.x_new), lanes_at(s.k), s.n",
    "    atol, rtol = floats_at(s.atol), in_lanes(s.rtol)",
    "    total = slopes = moves = product = in_lanes(0.0)",
    "    for i in range(n):",
    "        weight = 1.0 / (in_lanes(atol[i]) + rtol * max(abs(x_new[i]), abs(x[i])))",
    f"        e = weight * ({_weighted(TSIT5_E)})",
    "        slope = weight * (k[i + 6 * n] - k[i + 5 * n])",
    "        move = weight * (x_new[i] - y[i])",
    "        total += e * e",
    "        slopes += slope * slope",
    "        moves += move * move",
    "        product += slope * move",
    "    return total, slopes, moves, product",
    "",
    "def _interpolate(s: LaneRecord, theta: lane, h: lane) -> None:",
    "    x, k, kept, columns, n = lanes_at(s.x), lanes_at(s.k), lanes_at(s.kept), ints_at(s.columns), s.n",
    *(f"    b{j} = h * ({_dense_weight(row)})" for j, row in enumerate(TSIT5_R)),
    "    for c in range(s.n_columns):",
    "        i = columns[c]",
    f"        kept[c] = x[i] + ({' + '.join(f'b{j} * k[i + {j} * n]' for j in range(7))})",
    "",
])  # fmt: skip
_stages = _measured = _interpolate = generated


@native
def _turn(s: LaneRecord, lane: int) -> None:
    """Load the input values that hold from a corner on, and determine the next stop."""
    run, corner, here = ints_at(s.run)[lane], ints_at(s.corner)[lane], 8 * lane
    row = run * s.cornered
    data, pieces = floats_at(s.data), floats_at(s.pieces)
    first = (row * (s.n_corners + 1) + corner) * s.n_pieces
    for i in range(s.n_pieces):
        data[i * LANES + lane] = pieces[first + i]
    floats_at(s.stop + here)[0] = s.end
    if corner < s.n_corners:
        floats_at(s.stop + here)[0] = min(s.end, floats_at(s.corners)[row * s.n_corners + corner])


@native
def _load(s: LaneRecord, lane: int) -> None:
    """Load the next run into a lane; if there is none, the lane idles: it goes on computing, and its results are ignored."""
    here = 8 * lane
    if s.next == s.n_runs:
        floats_at(s.active + here)[0] = floats_at(s.h + here)[0] = 0.0
        floats_at(s.sample_t + here)[0] = math.inf
        s.running -= 1
        return
    run = s.next
    s.next = run + 1
    ints_at(s.run)[lane], ints_at(s.fresh)[lane], ints_at(s.corner)[lane] = run, 1, 0
    start, numbers = floats_at(s.starts + 8 * run * s.n), floats_at(s.numbers + 8 * run * s.n_numbers)
    x, data, out, columns = floats_at(s.x), floats_at(s.data), floats_at(s.out), ints_at(s.columns)
    for i in range(s.n):
        x[i * LANES + lane] = start[i]
    for i in range(s.n_numbers):
        data[i * LANES + lane] = numbers[i]
    _turn(s, lane)
    at = run * s.n_times * s.n_columns
    for c in range(s.n_columns):
        out[at + c] = start[columns[c]]
    times = floats_at(s.times)
    ints_at(s.sample)[lane] = 1
    floats_at(s.sample_t + here)[0] = times[1] if s.n_times > 1 else math.inf
    floats_at(s.t + here)[0] = times[0]
    floats_at(s.h_max + here)[0] = floats_at(s.longest)[run]
    floats_at(s.before + here)[0] = floats_at(s.active + here)[0] = 1.0
    floats_at(s.retry + here)[0] = floats_at(s.steps + here)[0] = floats_at(s.failures + here)[0] = 0.0


@native
def _begin(s: LaneRecord) -> None:
    """The first stage and the first step (Hairer's guess, as in ``rungekutta.first_step``) of the lanes that have just been loaded."""
    n, t, now, fresh = s.n, floats_at(s.t), floats_at(s.now), ints_at(s.fresh)
    x, y, k, h, atol = floats_at(s.x), floats_at(s.y), floats_at(s.k), floats_at(s.h), floats_at(s.atol)
    h_max = floats_at(s.h_max)
    first, later, size = LANES * n, 2 * LANES * n, LANES * n
    for i in range(LANES):
        now[i] = s.origin + t[i]
    LANE_MODEL(s.rhs, s.now, s.x, s.k + 8 * first, s.data)
    for i in range(size):
        y[i] = x[i]
    for lane in range(LANES):
        if fresh[lane] != 0:
            d0 = d1 = 0.0
            for i in range(n):
                at = i * LANES + lane
                k[at] = k[first + at]
                weight = 1.0 / (atol[i] + s.rtol * abs(x[at]))
                d0 += (x[at] * weight) ** 2
                d1 += (k[at] * weight) ** 2
            h0 = 0.01 * math.sqrt(d0 / d1) if d0 > 1e-10 * n and d1 > 1e-10 * n else 1e-6 * h_max[lane]
            h[lane] = min(h0, h_max[lane])
            now[lane] = s.origin + (t[lane] + h[lane])
            for i in range(n):
                at = i * LANES + lane
                y[at] = x[at] + h[lane] * k[at]
    LANE_MODEL(s.rhs, s.now, s.y, s.k + 8 * later, s.data)
    s.evaluations += 2
    for lane in range(LANES):
        if fresh[lane] != 0:
            fresh[lane] = 0
            d1 = d2 = 0.0
            for i in range(n):
                at = i * LANES + lane
                weight = 1.0 / (atol[i] + s.rtol * abs(x[at]))
                d1 += (k[at] * weight) ** 2
                d2 += ((k[later + at] - k[at]) * weight) ** 2
            h0 = h[lane]
            largest = max(math.sqrt(d1 / n), math.sqrt(d2 / n) / h0)
            h1 = 1e-3 * h0
            if largest < math.inf:
                h1 = max(1e-6 * h_max[lane], 1e-3 * h0) if largest <= 1e-15 else (0.01 / largest) ** 0.2
            h[lane] = min(100.0 * h0, h1, h_max[lane])


@native
def _end(s: LaneRecord) -> None:
    """Record the runs that are complete or failed, and load others into their lanes."""
    ended, active = floats_at(s.ended), floats_at(s.active)
    for lane in range(LANES):
        if ended[lane] != 0.0 and active[lane] != 0.0:
            run = ints_at(s.run)[lane]
            ints_at(s.status)[run] = int(ended[lane])
            ints_at(s.tried)[run] = int(floats_at(s.steps)[lane])
            ints_at(s.rejected)[run] = int(floats_at(s.failures)[lane])
            s.done += 1
            _load(s, lane)
    _begin(s)


@native
def _pass(s: LaneRecord, flags: int) -> None:
    """Load new input values in lanes at a corner, and evaluate the first stage again, since inputs may jump there."""
    turned, t, now, k = floats_at(flags), floats_at(s.t), floats_at(s.now), floats_at(s.k)
    for lane in range(LANES):
        if turned[lane] != 0.0:
            ints_at(s.corner)[lane] += 1
            _turn(s, lane)
        now[lane] = s.origin + t[lane]
    first = LANES * s.n
    LANE_MODEL(s.rhs, s.now, s.x, s.k + 8 * first, s.data)
    s.evaluations += 1
    for lane in range(LANES):
        if turned[lane] != 0.0:
            for i in range(s.n):
                k[i * LANES + lane] = k[first + i * LANES + lane]


@native
def _store(s: LaneRecord, due: int) -> None:
    """Store the samples that lie within the step."""
    flags, kept, sample_t = floats_at(due), floats_at(s.kept), floats_at(s.sample_t)
    sample, run, times, out, width = ints_at(s.sample), ints_at(s.run), floats_at(s.times), floats_at(s.out), s.n_columns
    for lane in range(LANES):
        if flags[lane] != 0.0:
            number = sample[lane]
            at = (run[lane] * s.n_times + number) * width
            for c in range(width):
                out[at + c] = kept[c * LANES + lane]
            sample[lane] = number + 1
            sample_t[lane] = times[number + 1] if number + 1 < s.n_times else math.inf


@native
def _step(s: LaneRecord) -> None:
    """One step of all lanes."""
    n, x, x_new, k = s.n, lanes_at(s.x), lanes_at(s.x_new), lanes_at(s.k)
    times, steps, sample_t = lanes_at(s.t), lanes_at(s.h), lanes_at(s.sample_t)
    before, retry, active, ended = lanes_at(s.before), lanes_at(s.retry), lanes_at(s.active), lanes_at(s.ended)
    t, end, whole, longest = times[0], lanes_at(s.stop)[0], steps[0], lanes_at(s.h_max)[0]
    h = min(steps[0], longest)
    failed = either(h < 10.0 * ROUNDING * abs(t) + 1e-25 * s.end, lanes_at(s.steps)[0] >= s.most_steps)
    last = t + 1.0001 * h >= end
    h = where(last, end - t, h)
    t_new = where(last, end, t + h)
    _stages(s, t, h)
    s.evaluations += 6
    total, slopes, moves, product = _measured(s)
    error = h * h * total / n  # its square
    accepted = error <= 1.0
    # caution near the limit of stability: see ``rungekutta.first_step``
    share = h * h * slopes / (SQUARE_NEAR * moves)
    damped = both(product < 0.0, product * product > SQUARE_DAMPED * slopes * moves)
    factor = where(either(damped, not share > 1.0), 1.0, min(share * share, in_lanes(12.0)))
    quarter = math.sqrt(math.sqrt(math.sqrt(max(error * factor * factor, in_lanes(LEAST)))))
    eighth = math.sqrt(quarter)
    growth = min(max(0.9 * before[0] / eighth, in_lanes(0.2)), where(retry[0] != 0.0, in_lanes(1.0), 10.0))
    lanes_at(s.steps)[0] += 1.0
    retry[0] = where(accepted, in_lanes(0.0), 1.0)
    before[0] = where(accepted, max(math.sqrt(eighth), in_lanes(LEAST_BEFORE)), before[0])
    if any_of(not accepted):
        lanes_at(s.failures)[0] += where(accepted, in_lanes(0.0), 1.0)
        shrink = where(error < math.inf, max(0.9 / math.sqrt(math.sqrt(math.sqrt(error))), in_lanes(0.2)), 0.25)
        growth = where(accepted, growth, shrink)
    steps[0] = h * growth
    due = both(accepted, sample_t[0] <= t_new)
    while any_of(due):
        _interpolate(s, (sample_t[0] - t) / h, h)
        ended[0] = where(due, in_lanes(1.0), 0.0)
        _store(s, s.ended)
        due = both(accepted, sample_t[0] <= t_new)
    for i in range(n):
        x[i] = where(accepted, where(abs(x_new[i]) <= TINY, 0.0, x_new[i]), x[i])
        k[i] = where(accepted, k[i + 6 * n], k[i])
    times[0] = where(accepted, t_new, t)
    reached = both(accepted, last)
    if s.n_corners > 0:
        turned = both(both(reached, end < s.end), active[0] != 0.0)
        if any_of(turned):
            steps[0] = where(turned, max(steps[0], min(whole, longest)), steps[0])  # the corner had shortened the step
            ended[0] = where(turned, in_lanes(1.0), 0.0)
            _pass(s, s.ended)
    over = both(reached, not end < s.end)
    if any_of(both(either(over, failed), active[0] != 0.0)):
        ended[0] = where(over, in_lanes(DONE), where(failed, in_lanes(FAILED), 0.0))
        _end(s)


@native
def advance_lanes(address: int) -> int32:
    """Advance the runs by at most ``budget`` steps; returns 0 once all are done, otherwise 1."""
    s = LaneRecord(address)
    if s.running == 0:
        s.running = LANES
        for lane in range(LANES):
            _load(s, lane)
        _begin(s)
    for _ in range(s.budget):
        if s.running == 0:
            return 0
        _step(s)
    return 0 if s.running == 0 else 1
