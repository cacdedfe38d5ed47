"""The gears in a component whose teeth are known, and views of them at angles or over a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import one_name, one_of, reals, shown
from gearlib.drawing.gears.gear_set import GearSet
from gearlib.drawing.gears.gear_view import GearMotion, GearView
from gearlib.errors import ArgumentError, ModelError, NameLookupError, nearest
from gearlib.language import interior
from gearlib.language.declarations import Owner

Floats = NDArray[np.float64]
SHAFTS = ("ring", "carrier", "sun")
FARTHEST = 1e12  # rad or s: beyond it, the digits of an angle say little of where a gear stands
MOST_FRAMES = 1000  # of one picture, which holds the positions at all of them


def turned(
    component: Owner, part: str | None, angle: float | Sequence[float], held: str | None, gears: GearSet | None
) -> GearView:
    """The view of a component's gears at angles, as `Component.gear_view` describes it."""
    angles = frames("angle", angle, "an angle in rad, or a sequence of them")
    shaft = "ring" if held is None else one_of("held", held, SHAFTS)
    motions = []
    for path, found in gears_in(component, part, gears):
        first, carrier = found.holding.get(shaft, (1.0, 0.0))
        motions.append(GearMotion(path, found, first * angles, carrier * angles, np.zeros((len(angles), 0))))
    return GearView(type(component).__name__, motions, [f"angle {np.degrees(a):.4g}°" for a in angles])


def in_motion(
    component: Owner, part: str | None, times: Floats, history: Callable[[str], Floats], gears: GearSet | None
) -> GearView:  # fmt: skip
    """The view of a component's gears at times, with ``history`` of a variable at them, as `Result.gear_view` describes it."""
    motions = []
    for path, found in gears_in(component, part, gears):
        prefix = f"{path}." if path else ""
        first = history(prefix + found.first)
        carrier = history(prefix + found.carrier) if found.carrier else np.zeros(len(times))
        try:
            forces = [c.share * history(prefix + c.force) for c in found.contacts if c.force]
        except NameLookupError:
            if gears is None:
                raise
            forces = []  # the gears are those of another part, which calls its forces differently
        motions.append(GearMotion(path, found, first, carrier, np.array(forces).T if forces else np.zeros((len(times), 0))))
    return GearView(type(component).__name__, motions, [f"t = {t:.6g} s" for t in times])


def frames(name: str, values: Any, expected: str) -> Floats:
    """One number or several, as an array of what each frame shows.

    Raises
    ------
    ArgumentError
        They are none, or more than a picture can move through.
    """
    found = np.atleast_1d(reals(name, values, expected))
    if found.ndim != 1 or not 0 < len(found) <= MOST_FRAMES or np.abs(found).max() > FARTHEST:
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}, {MOST_FRAMES} at most")
    return found


@interior.reads_parts
def gears_in(component: Owner, part: str | None, gears: GearSet | None) -> list[tuple[str, GearSet]]:
    """Pairs and sets by path, in the order of the parts.

    Raises
    ------
    NameLookupError
        There is no such part.
    ModelError
        It has no gears whose teeth are known.
    """
    interior.forget(component)
    owner, prefix = _part(component, part), part or ""
    if gears is not None:
        if not isinstance(gears, GearSet):
            raise ArgumentError(f"gears is {shown(gears)}; expected gears, such as GearPair(...).drawn_gears()")
        return [(prefix, gears)]
    found = list(_found(owner, prefix))
    if not found:
        where = f"'{part}'" if part else type(component).__name__
        raise ModelError(
            f"{where} has no gears whose teeth are known; expected meshes with z_a, or units with Z_s, Z_p and Z_r; or give the "
            "gears: gear_view('mesh', gears=GearPair(...).drawn_gears())"
        )
    return found


def _part(component: Owner, part: str | None) -> Any:
    owner: Any = component
    if part is None:
        return owner
    for name in one_name("part", part, "train.x_unit").split("."):
        interior.connections_of(owner)
        parts = interior.parts_of(owner)
        if name not in parts:
            raise NameLookupError(f"{type(component).__name__} has no part '{part}'; {nearest(name, parts)}")
        owner = parts[name]
    return owner


def _found(owner: Any, path: str) -> Iterator[tuple[str, GearSet]]:
    interior.connections_of(owner)
    own = owner.drawn_gears()
    if own is not None:
        if not isinstance(own, GearSet):
            raise ModelError(
                f"{type(owner).__name__}.drawn_gears() must return gears, such as GearPair(...).drawn_gears(); got {shown(own)}"
            )
        yield path, own
        return
    for name, part in interior.parts_of(owner).items():
        yield from _found(part, f"{path}.{name}".lstrip("."))
