"""Stages, error estimates and dense output of the two Runge-Kutta methods; generated code, inlined into ``loop``.

Row j of ``s.k`` is the right-hand side at stage j, where ``s`` is the record of ``record``.

Sums over the stages are generated from the tableaux, on blocks of states. The last term of a sum is added last: all others are
accumulated while the right-hand side is still being evaluated. Values that a stage has just stored are loaded one by one, since store
forwarding serves such loads at once, while a wide load would stall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gearlib.compiler.small_language import generated, native
from gearlib.native.layout import MODEL
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.tableaux import DOP853_A, DOP853_C, DOP853_D, DOP853_E, TSIT5_A, TSIT5_C, TSIT5_E, TSIT5_R

__all__ = ["GENERATED", "MODEL", "dense_output", "interpolate", "last_stage", "step_error", "take_step"]

# The error estimate of order 8 is the square of one of order 5 over one of order 3. The former passes through zero now and then: below
# DIP times the value expected from the recent ratio of the two, which scales with h^4, it is not trusted. Where the latter has grown
# beyond its h^4 scaling by more than KINK, the right-hand side has a kink, and the former may be anything.
DIP, KINK = 0.1, 50.0

Row = Sequence[float]

_B8 = (*DOP853_A[12], 0.0, 0.0, 0.0, 0.0)
_START8 = [1.0] + [0.0] * 15
_BOTH8 = [1.0] + [0.0] * 11 + [1.0] + [0.0] * 3
# Hairer's nested form: theta (F0 + u (F1 + theta (F2 + u (F3 + theta (F4 + u (F5 + theta F6)))))), u = 1 - theta, in units of h
_F8 = (
    _B8,
    [k - b for k, b in zip(_START8, _B8, strict=True)],
    [2.0 * b - k for k, b in zip(_BOTH8, _B8, strict=True)],
    *DOP853_D,
)
_F5 = tuple(zip(*TSIT5_R, strict=True))


def _split(row: Row) -> tuple[str, float, int]:
    """Source of a sum over the stages without its last term, that term's coefficient, and its stage."""
    terms = [(a, j) for j, a in enumerate(row) if a != 0.0]
    parts = ["", ""]  # two independent accumulators
    for number, (a, j) in enumerate(terms[:-1]):
        product, part = f"{a!r} * k[i + {j} * size]", parts[number % 2]
        parts[number % 2] = f"{part} + {product}" if part else product
    return (f"({parts[0]}) + ({parts[1]})" if parts[1] else parts[0]), *terms[-1]


def _sum(row: Row) -> str:
    first, a, j = _split(row)
    last = f"{a!r} * k[i + {j} * size]"
    return f"({first}) + {last}" if first else last


def _stage(row: Row) -> str:
    first, a, j = _split(row)
    last = f"h * {a!r} * one_by_one(k, i + {j} * size)"
    return f"x[i] + h * ({first}) + {last}" if first else f"x[i] + {last}"


def _stepper(name: str, a: Sequence[Row], c: Row, first: int, last: int, final: int) -> str:
    """Generate a function that evaluates stages ``first`` to ``last``; the argument of stage ``final`` is ``x_new``."""
    lines = [
        f"def {name}(s: LoopRecord, t: float, h: float) -> int:",
        "    x, y, x_new, k, size = floats_at(s.x), floats_at(s.y), floats_at(s.x_new), floats_at(s.k), s.size",
    ]
    for stage in range(first, last + 1):
        target = "x_new" if stage == final else "y"
        lines += [
            "    for i in blocks(size):",
            f"        {target}[i] = {_stage(a[stage])}",
            f"    code = MODEL(s.rhs, s.origin + (t + {c[stage]!r} * h), s.{target}, s.k + {8 * stage} * size, s.data, s.index)",
            "    if code != 0:",
            "        return code",
        ]
    return "\n".join([*lines, "    return 0", ""])


def _coefficients(name: str, table: Sequence[Row]) -> str:
    """Generate a function that computes the rows of ``c`` from those of ``k``."""
    return "\n".join([
        f"def {name}(s: LoopRecord) -> None:",
        "    k, c, size = floats_at(s.k), floats_at(s.c), s.size",
        "    for i in blocks(size):",
        *(f"        c{p} = {_sum(row)}" for p, row in enumerate(table)),
        *(f"        c[i + {p} * size] = c{p}" for p in range(len(table))),
        "",
    ])  # fmt: skip


def _polynomial(name: str, rows: int) -> str:
    """Generate a function for ``y = x + h (c[0] + q (c[1] + p (c[2] + q (c[3] + ...))))``, p and q alternating."""
    value = f"c[i + {rows - 1} * size]"
    for j in range(rows - 2, -1, -1):
        value = f"c[i + {j} * size] + {'pq'[(j + 1) % 2]} * ({value})"
    return "\n".join([
        f"def {name}(s: LoopRecord, h: float, p: float, q: float, out: int) -> None:",
        "    x, c, y, size = floats_at(s.x), floats_at(s.c), floats_at(out), s.size",
        "    for i in blocks(size):",
        f"        y[i] = x[i] + h * ({value})",
        "",
    ])  # fmt: skip


def _measurer(name: str, errors: Sequence[Row], last: int) -> str:
    """Generate a function for sums over the states of squares relative to the tolerance.

    First those of each error estimate ``sum_j e[j] k[j]``, then of ``k[last] - k[last - 1]``, of ``x_new - y``, and their product.
    """
    sums = [f"error{p}" for p in range(len(errors))] + ["slopes", "moves", "product"]
    return "\n".join([
        f"def {name}(s: LoopRecord) -> tuple[{', '.join(['float'] * len(sums))}]:",
        "    x, x_new, y, k, atol = floats_at(s.x), floats_at(s.x_new), floats_at(s.y), floats_at(s.k), floats_at(s.atol)",
        "    rtol, size = s.rtol, s.size",
        *(f"    {name} = block(0.0)" for name in sums),
        "    for i in blocks(size):",
        "        weight = 1.0 / (atol[i] + rtol * max(abs(x_new[i]), abs(x[i])))",
        *(f"        e = weight * ({_sum(row)})\n        error{p} += e * e" for p, row in enumerate(errors)),
        f"        slope = weight * (k[i + {last} * size] - k[i + {last - 1} * size])",
        "        move = weight * (x_new[i] - y[i])",
        "        slopes += slope * slope",
        "        moves += move * move",
        "        product += slope * move",
        f"    return {', '.join(f'total({name})' for name in sums)}",
        "",
    ])  # fmt: skip


GENERATED = "\n".join([
    _stepper("_step5", TSIT5_A, TSIT5_C, 1, 6, 6),
    _stepper("_step8", DOP853_A, DOP853_C, 1, 12, 12),
    _stepper("_more8", DOP853_A, DOP853_C, 13, 15, 12),
    _measurer("_errors5", (TSIT5_E,), 6),
    _measurer("_errors8", DOP853_E, 12),
    _coefficients("_coefficients5", _F5),
    _coefficients("_coefficients8", _F8),
    _polynomial("_polynomial5", 4),
    _polynomial("_polynomial8", 7),
])  # fmt: skip
_step5 = _step8 = _more8 = _errors5 = _errors8 = _coefficients5 = _coefficients8 = _polynomial5 = _polynomial8 = generated


@native
def last_stage(s: LoopRecord) -> int:
    """Address of the right-hand side at the end of the step."""
    return s.k + 8 * s.size * (6 if s.order == 5 else 12)


@native
def take_step(s: LoopRecord, t: float, h: float) -> int:
    """Compute ``x_new`` and the stages of a step from ``x``, whose right-hand side is ``k[0]``; returns the code of a failing stage."""
    s.dense = 0
    if s.order == 5:
        code: int = _step5(s, t, h)
        s.evaluations += 6
    else:
        code = _step8(s, t, h)
        s.evaluations += 12
    return code


@native
def _doubted(s: LoopRecord, h4: float, error: float, coarse: float) -> float:
    """The error estimate, increased where the estimate of order 3 makes it implausible."""
    if not error < math.inf:
        return error
    s.ratio, s.rough = error / (coarse * h4) if coarse > 0.0 else 0.0, coarse / h4
    error = max(error, DIP * s.ratios * coarse * h4)
    if s.roughest > 0.0 and coarse > 1.0 and s.rough > KINK * s.roughest:
        error = max(error, s.rough / s.roughest)
    return error


@native
def step_error(s: LoopRecord, h: float) -> float:
    """Root mean square of the error estimate over its tolerance; for order 8 Hairer's blend of orders 3 and 5.

    The argument of the last stage but one, in ``y``, belongs to the same time as the last one. Their difference relative to the
    tolerance is recorded: the squares of h times the right-hand side and of the argument, and their scalar product.
    """
    if s.order == 5:
        total, slopes, moves, product = _errors5(s)
        error: float = h * math.sqrt(total / s.n)
    else:
        total3, total, slopes, moves, product = _errors8(s)
        error = h * total / math.sqrt((total + 0.01 * total3) * s.n) if total != 0.0 else 0.0
        error = _doubted(s, h**4, error, h * math.sqrt(total3 / s.n))
    s.slope, s.move, s.product = h * h * slopes, moves, h * product
    return error


@native
def dense_output(s: LoopRecord, t: float, h: float) -> None:
    """Compute the dense-output polynomials, of order 4 or 7, unless done for this step; the latter takes three more stages."""
    if s.dense == 1:
        return
    s.dense = 1
    if s.order == 5:
        _coefficients5(s)
    else:
        _more8(s, t, h)
        s.evaluations += 3
        _coefficients8(s)


@native
def interpolate(s: LoopRecord, theta: float, h: float, y: int) -> None:
    """``y`` = dense output at the fraction ``theta`` of the step."""
    if s.order == 5:
        _polynomial5(s, h * theta, theta, theta, y)
    else:
        _polynomial8(s, h * theta, theta, 1.0 - theta, y)
