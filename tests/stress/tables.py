"""Tables of docs/stability.md from what `tests.stress.draw` measured."""

from __future__ import annotations

from typing import Any

from tests.measured import Part, table

STEPPED = ("rk5", "rk8", "ida")
Rows = list[dict[str, Any]]


def span(least_and_largest: list[float], digits: int = 2) -> str:
    return " to ".join(f"{value:.{digits}g}" for value in least_and_largest)


def error(rows: Rows) -> str:
    head = ["scene", *(f"`{m}`: error / rtol" for m in STEPPED), "`exact`: largest error at any rtol"]
    exact = ["not linear" if r["exact"] is None else f"{r['exact']:.0e}" for r in rows]
    return table(head, [[r["scene"], *(span(r[m]) for m in STEPPED), e] for r, e in zip(rows, exact, strict=True)])


def stiffness(rows: Rows) -> str:
    head = ["mesh stiffness, N/m", "distance, rad/s", "order", "steps of `ida`", "steps of `auto`, method at the end"]
    cells = [
        [
            f"{r['k']:.0e}",
            "" if r["distance"] is None else f"{r['distance']:.1e}",
            "" if r["order"] is None else f"{r['order']:.2f}",
            str(r["ida"]),
            f"{r['auto']}, {r['method']}",
        ]
        for r in rows
    ]
    explicit, implicit = (
        max(r["k"] for r in rows if r["method"] != "ida"),
        min(r["k"] for r in rows if r["method"] == "ida"),
    )
    said = f"`auto` ends with an explicit method up to {explicit:.0e} N/m, and with IDA from {implicit:.0e} N/m on."
    return f"{table(head, cells)}\n\n{said}"


def revolutions(rows: Rows) -> str:
    cells = [
        [
            f"`{r['method']}`",
            f"{r['revolutions']:g}",
            "" if r["method"] == "exact" else f"{r['rtol']:.0e}",
            f"{r['change']:.1e}",
        ]
        for r in rows
    ]
    return table(["method", "revolutions", "rtol", "largest relative change"], cells)


def memory(rows: Rows) -> str:
    cells = [[f"`{r['method']}`", f"{r['periods']:.0e}", f"{r['megabytes']:.2f} MB"] for r in rows]
    return table(["method", "periods", "held by Python at most, three outputs kept"], cells)


def energy(rows: Rows) -> str:
    cells = [
        [f"`{r['method']}`", f"{r['short']:.1e} in all", f"{r['long']:.1e} in all"]
        if r["method"] == "exact"
        else [f"`{r['method']}`", span(r["short"], 1), f"{r['long']:.1g} (rtol {r['rtol']:.0e})"]
        for r in rows
    ]
    return table(["method", "drift per period / rtol, 1000 periods", "100 000 periods"], cells)


ERROR, STIFFNESS = Part("error", "stability", error), Part("stiffness", "stability", stiffness)
REVOLUTIONS, MEMORY = Part("revolutions", "stability", revolutions), Part("memory", "stability", memory)
ENERGY = Part("energy", "stability", energy)
PARTS = [ERROR, STIFFNESS, REVOLUTIONS, MEMORY, ENERGY]
