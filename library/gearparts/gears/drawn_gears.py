"""Gears for views of them: pairs and planetary sets from their tooth forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from gearlib.drawing.gears.gear_set import Contact, GearSet, Wheel, meshing_turn
from gearlib.errors import ModelError
from gearlib.language.interior import number_of, path_of, radii_of
from gearparts.gears.involute import involute
from gearparts.gears.tooth_form import ToothForm

STANDARD = math.pi / 9  # pressure angle, rad
FREE = (0.0, 1.0, 0.0)  # turn of a set's first gear
CLEARANCE = 0.25  # of tips from roots, over the module


def pair_of(
    a: ToothForm, b: ToothForm, distance: float, alpha: float, *, force: str = "f", names: tuple[str, str] = ("a", "b"),
    carrier: str = "",
) -> GearSet:  # fmt: skip
    """Two gears at a centre distance (m) with their working pressure angle (rad); a ring, if any, is ``a``.

    ``force`` is the variable of the mesh, ``carrier`` that of the angle of what carries both axes.
    """
    z_a, z_b = a.z, b.z
    radii = [distance * z / (z_a - z_b if a.ring else z_a + z_b) for z in (z_a, z_b)]
    wheels = (
        Wheel(f"{names[0]}: {z_a}", a.outline(), radii[0], a.ring, FREE),
        Wheel(f"{names[1]}: {z_b}", b.outline(), radii[1], False, meshing_turn(z_a, z_b, a.ring, 0.0, FREE), distance),
    )
    return GearSet(wheels, (Contact(0, 1, alpha, force),), "flange_a.phi", carrier, {"support": (1.0, 0.0)})


def pitched_pair(component: Any, z_a: int, force: str) -> GearSet | None:
    """The external pair of a component whose ``radii`` are pitch radii, for ``z_a`` teeth of the first gear; None without radii."""
    r_a, r_b = radii_of(component)
    if not (r_a > 0 and r_b > 0):
        return None
    z_b = _whole(component, z_a * r_b / r_a)
    m = 2 * r_a / z_a
    return pair_of(ToothForm(z_a, m), ToothForm(z_b, m), r_a + r_b, STANDARD, force=force, names=("gear 1", "gear 2"))


def meshing_pair(mesh: Any, carrier: str) -> GearSet | None:
    """The pair of a detailed mesh; None where its teeth are not known.

    The working pitch circles are the reference circles, so that teeth and spaces are as wide as each other there. The tip circles lie
    where the path of contact ends.
    """
    (r_a, r_b), z_a, alpha = radii_of(mesh), number_of(mesh, "z_a"), number_of(mesh, "alpha")
    if z_a is None or z_a < 3 or not (r_a > 0 and r_b > 0) or alpha is None or not 0 < alpha < 1.2:
        return None
    ring = mesh.turns_against < 0
    teeth = (_whole(mesh, z_a), _whole(mesh, z_a * r_b / r_a))
    m = 2 * r_a / (math.cos(alpha) * z_a)
    path, before = mesh.contact_ratio, number_of(mesh, "approach")
    approach = path / 2 if before is None else before
    pitch, signs = 2 * math.pi * r_a / z_a, (-1 if ring else 1, 1)
    tips = [
        math.hypot(r, max(r * math.tan(alpha) + sign * beyond * pitch, 0.0))
        for r, sign, beyond in zip((r_a, r_b), signs, (path - approach, approach), strict=True)
    ]
    roots = [abs((tips[1 - k] / (m * teeth[1 - k] / 2) - 1) * teeth[1 - k] / 2) + CLEARANCE for k in (0, 1)]
    forms = [
        ToothForm(z, m, alpha, ring=is_ring, tip=tip, h_fP=root)
        for z, is_ring, tip, root in zip(teeth, (ring, False), tips, roots, strict=True)
    ]
    distance = (r_a - r_b if ring else r_a + r_b) / math.cos(alpha)
    return pair_of(forms[0], forms[1], distance, alpha, names=("ring" if ring else "gear a", "gear b"), carrier=carrier)


def _whole(component: Any, teeth: float) -> int:
    if abs(teeth - round(teeth)) > 1e-3 * teeth or round(teeth) < 3:
        raise ModelError(
            f"{path_of(component) or type(component).__name__}: radii and teeth of the first gear give the other one {teeth:.6g} teeth; "
            "expected a whole number"
        )
    return round(teeth)


def planetary_set(
    teeth: tuple[int, int, int], distance: float, angles: Sequence[float], at_sun: Sequence[str], at_ring: Sequence[str],
    alpha: float = STANDARD,
) -> GearSet:  # fmt: skip
    """Sun, planets and ring with the numbers of teeth of sun, planet and ring.

    Parameters
    ----------
    teeth : tuple of int
    distance : float
        Of the planets' axes from the sun's, m.
    angles : sequence of float
        Of the planets on the carrier, rad.
    at_sun, at_ring : sequence of str
        Variables of the meshes' forces, one for each planet, or one that all share.
    alpha : float
        Pressure angle of the teeth, rad; sun and planets have no profile shift, the ring the one that it needs.

    Raises
    ------
    ModelError
        No profile shift lets the ring mesh with the planets.
    """
    z_s, z_p, z_r = teeth
    m = 2 * distance / (z_s + z_p)
    cosine = m * (z_r - z_p) * math.cos(alpha) / (2 * distance)
    if not 0.5 < cosine <= 1:
        raise ModelError(
            f"{z_s}, {z_p} and {z_r} teeth of sun, planet and ring: no profile shift lets the ring mesh with planets that mesh with "
            f"the sun; expected a ring of about {z_s + 2 * z_p} teeth"
        )
    working = math.acos(cosine)
    shift = (involute(alpha) - involute(working)) * (z_r - z_p) / (2 * math.tan(alpha))
    sun, planet = ToothForm(z_s, m, alpha), ToothForm(z_p, m, alpha)
    # the ring's tips stay as far from the planets' roots as a pair without profile shifts would
    ring = ToothForm(z_r, m, alpha, shift, ring=True, tip=distance + planet.root_radius + CLEARANCE * m)
    wheels = [Wheel(f"sun: {z_s}", sun.outline(), distance * z_s / (z_s + z_p), False, FREE)]
    for n, psi in enumerate(angles):
        turn = meshing_turn(z_s, z_p, False, psi, FREE)
        wheels.append(
            Wheel(f"planet {n + 1}: {z_p}", planet.outline(), distance * z_p / (z_s + z_p), False, turn, distance, psi)
        )
    ratio = z_p / z_r
    by_planet = wheels[1].turn
    turn = (angles[0] + ratio * (by_planet[0] - angles[0]), ratio * by_planet[1], 1 - ratio + ratio * by_planet[2])
    wheels.append(Wheel(f"ring: {z_r}", ring.outline(), distance * z_r / (z_r - z_p), True, turn))
    count = len(angles)
    contacts = [
        Contact(wheel, n + 1, angle, names[n if len(names) > 1 else 0], 1.0 if len(names) > 1 else 1 / count)
        for wheel, angle, names in ((0, alpha, at_sun), (count + 1, working, at_ring))
        for n in range(count)
        if names
    ]
    with_ring = z_s / (z_s + z_r)
    holding = {"ring": (1.0, with_ring), "carrier": (1.0, 0.0), "sun": (0.0, 1.0)}
    return GearSet(tuple(wheels), tuple(contacts), "sun.phi", "carrier.phi", holding)
