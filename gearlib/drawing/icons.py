"""Icons of drive-train components, in the conventions of machine drawings: 48 by 40, with the shafts at the sides.

Each is centred at (0, 0), with its first shaft at x = -24 and its second at x = 24; a part with one shaft has it at x = 24. Rotating
parts are seen from the side, with a horizontal axis.
"""

from __future__ import annotations

from dataclasses import dataclass

from gearlib.drawing.svg import circle, line, path, polygon, rectangle, text

INK, BODY, LIGHT, TEETH = "#1b2a41", "#cfdbe8", "#eef3f8", "#b9c9da"
THICK = {"stroke": INK, "stroke_width": "1.6", "fill": "none"}
THIN = {"stroke": INK, "stroke_width": "1", "fill": "none"}
FILLED = {"stroke": INK, "stroke_width": "1.3", "fill": BODY}


@dataclass(frozen=True)
class Icon:
    """A drawing with the heights of its shafts.

    Parameters
    ----------
    drawing : tuple of str
        SVG elements.
    left, right : float
        Height (y, downwards) of the first and second shafts, multiples of 8.
    framed : bool
        Whether it is drawn as a box with named ports: parts with three or more shafts.
    letters : tuple of str
        SVG elements that are not mirrored with the drawing.
    """

    drawing: tuple[str, ...]
    left: float = 0.0
    right: float = 0.0
    framed: bool = False
    letters: tuple[str, ...] = ()


def _shaft(x1: float, x2: float, y: float = 0.0) -> str:
    return line(x1, y, x2, y, **THICK)


def _hatch(x1: float, x2: float, y: float, down: float = 6.0) -> tuple[str, ...]:
    """The housing: a line with hatching on the side away from the part."""
    strokes = [line(x, y, x - 4, y + down, **THIN) for x in _steps(x1 + 4, x2, 5)]
    return (line(x1, y, x2, y, **THICK), *strokes)


def _steps(first: float, last: float, step: float) -> list[float]:
    return [first + step * i for i in range(int((last - first) / step + 1e-9) + 1)]


def _zigzag(x1: float, x2: float, y: float = 0.0, height: float = 6.0, turns: int = 3) -> str:
    step = (x2 - x1) / (4 * turns)
    points = [(x1 + step * (2 * i + 1), y + (-height if i % 2 == 0 else height)) for i in range(2 * turns)]
    return path([(x1, y), *points, (x2, y)], stroke_linejoin="round", **THICK)


def _dashpot(x1: float, x2: float, y: float = 0.0, height: float = 6.0) -> tuple[str, ...]:
    middle = (x1 + x2) / 2
    return (
        _shaft(x1, middle - 1, y),
        line(middle - 1, y - height + 2, middle - 1, y + height - 2, **THICK),
        path([(middle - 6, y - height), (middle + 6, y - height), (middle + 6, y + height), (middle - 6, y + height)], **THICK),
        _shaft(middle + 6, x2, y),
    )


def _pair(gear_a: str, gear_b: str, *more: str) -> Icon:
    return Icon((_shaft(-24, 0, -8), _shaft(0, 24, 8), gear_a, gear_b, *more), left=-8, right=8)


def _plates(x: float, *heights: tuple[float, float]) -> tuple[str, ...]:
    return tuple(line(x, y1, x, y2, stroke=INK, stroke_width="2.4") for y1, y2 in heights)


def _arc(letter: str, *, both: bool = False) -> Icon:
    """A source: a circle with the prescribed quantity; ``both``: between two shafts."""
    shafts = (_shaft(14, 24), *((_shaft(-24, -14),) if both else ()))
    return Icon(
        (*shafts, circle(0, 0, 14, stroke=INK, stroke_width="1.4", fill=LIGHT),
         polygon([(8, -15), (13, -11), (14, -17.5)], fill=INK)),
        letters=(text(0, 5, letter, text_anchor="middle", font_size="15", font_style="italic", fill=INK),),
    )  # fmt: skip


def _arrow(letter: str) -> Icon:
    return Icon(
        (_shaft(-18, 16), polygon([(16, -5), (24, 0), (16, 5)], fill=INK)),
        letters=(text(-2, -7, letter, text_anchor="middle", font_size="14", font_style="italic", fill=INK),),
    )


def _gauge(letter: str, series: bool) -> Icon:
    shafts = (_shaft(-24, -13), _shaft(13, 24)) if series else (_shaft(13, 24),)
    return Icon(
        (*shafts, circle(0, 0, 13, stroke=INK, stroke_width="1.3", fill="white"),
         path([(0, 0), (6, -8)], **THICK), circle(0, 0, 1.8, fill=INK),
         *(line(9.5 * x, 9.5 * y, 12.5 * x, 12.5 * y, **THIN)
           for x, y in ((-0.87, -0.5), (-0.5, -0.87), (0, -1), (0.5, -0.87), (0.87, -0.5)))),
        letters=(text(0, 10, letter, text_anchor="middle", font_size="8", font_style="italic", fill=INK),),
    )  # fmt: skip


def _letter_box(letter: str) -> Icon:
    return Icon(
        (_shaft(15, 24), rectangle(-15, -13, 30, 26, rx=3, stroke=INK, stroke_width="1.3", fill=LIGHT)),
        letters=(text(0, 5, letter, text_anchor="middle", font_size="13", font_style="italic", fill=INK),),
    )


ROTOR = rectangle(-9, -17, 18, 34, rx=1.5, **FILLED)
GEARS = rectangle(-6, -13, 12, 10, **FILLED), rectangle(-6, -3, 12, 22, **FILLED)  # about their shafts
PLANETARY = (
    rectangle(-4, -20, 8, 4, **FILLED), rectangle(-4, 16, 8, 4, **FILLED),  # ring
    rectangle(-4, -14.5, 8, 9, **FILLED), rectangle(-4, 5.5, 8, 9, **FILLED),  # planets
    rectangle(-4, -4, 8, 8, **FILLED),  # sun
    path([(-4, -10), (-12, -10), (-12, 10), (-4, 10)], **THICK), _shaft(-20, -12), _shaft(4, 14),
    path([(4, -18), (14, -18), (14, -8)], **THICK), line(14, 18, 4, 18, **THICK),
)  # fmt: skip

ICONS = {
    "inertia": Icon((_shaft(-24, -9), ROTOR, _shaft(9, 24))),
    "disc": Icon((_shaft(-24, -5), rectangle(-5, -19, 10, 38, rx=1, **FILLED), _shaft(5, 24))),
    "mass": Icon((_shaft(-24, -14), rectangle(-14, -11, 28, 22, **FILLED), _shaft(14, 24))),
    "spring": Icon((_shaft(-24, -15), _zigzag(-15, 15), _shaft(15, 24))),
    "damper": Icon(_dashpot(-24, 24, height=8)),
    "spring_damper": Icon(
        (_shaft(-24, -17), line(-17, -9, -17, 9, **THICK), line(17, -9, 17, 9, **THICK), _shaft(17, 24),
         _zigzag(-17, 17, -9, 4.5), *_dashpot(-17, 17, 9, 5.5))
    ),
    "shaft": Icon(
        (_shaft(-24, -20), rectangle(-20, -6, 40, 12, rx=6, **FILLED),
         path([(-10, 6), (-4, -6)], **THIN), path([(-1, 6), (5, -6)], **THIN), path([(8, 6), (14, -6)], **THIN), _shaft(20, 24))
    ),
    "backlash": Icon(
        (_shaft(-24, -8), path([(0, -12), (-8, -12), (-8, 12), (0, 12)], **THICK),
         line(4, -5, 4, 5, **THICK), _shaft(4, 10), _zigzag(10, 20, height=4, turns=1), _shaft(20, 24))
    ),
    "gear": _pair(*GEARS),
    "lossy_gear": _pair(
        *GEARS,
        path([(-15, 16), (-12, 12), (-15, 8), (-12, 4)], stroke="#c0392b", stroke_width="1.3", fill="none"),
        path([(-11, 16), (-8, 12), (-11, 8), (-8, 4)], stroke="#c0392b", stroke_width="1.3", fill="none"),
    ),
    "mesh": _pair(
        rectangle(-6, -12, 12, 8, **FILLED), rectangle(-6, 4, 12, 8, **FILLED),
        path([(0, -4), (-4, -2), (4, -1), (-4, 1), (4, 2), (0, 4)], stroke_linejoin="round", **THICK),
    ),
    "internal_mesh": Icon(
        (_shaft(-24, -18, -8), path([(-18, -8), (-18, 18), (6, 18)], **THICK), rectangle(-6, 14, 14, 5, **FILLED),
         rectangle(-6, -4, 12, 12, **FILLED), path([(6, 2), (14, 2), (14, 8), (24, 8)], **THICK),
         path([(0, 8), (-4, 9.5), (4, 11), (-4, 12.5), (0, 14)], stroke_linejoin="round", **THIN)),
        left=-8, right=8,
    ),
    "rack": Icon(
        (_shaft(-24, 0, -8), circle(0, -8, 12, **FILLED), circle(0, -8, 1.8, fill=INK),
         polygon([(-24, 12), (-24, 8), *((x, 5 if i % 2 == 0 else 9) for i, x in enumerate(_steps(-18, 18, 3))), (24, 8), (24, 12)],
                 **FILLED)),
        left=-8, right=8,
    ),
    "planetary": Icon(PLANETARY, framed=True),
    "clutch": Icon((_shaft(-24, -4), *_plates(-4, (-16, 16)), *_plates(4, (-16, 16)), _shaft(4, 24),
                    polygon([(-15, -15), (-7, -12), (-15, -9)], fill=INK),
                    polygon([(15, -15), (7, -12), (15, -9)], fill=INK))),
    "brake": Icon((_shaft(-24, 24), *_plates(0, (-12, 12)), path([(-5, 10), (-5, 15), (5, 15), (5, 10)], **THICK),
                   *_hatch(-12, 12, 15, 5))),
    "one_way_clutch": Icon((_shaft(-24, -10), polygon([(-10, -12), (8, 0), (-10, 12)], **FILLED),
                            *_plates(9, (-13, 13)), _shaft(9, 24))),
    "bearing": Icon((_shaft(-24, 24), rectangle(-9, -9, 18, 5, **FILLED), rectangle(-9, 4, 18, 5, **FILLED),
                     *_hatch(-12, 12, 12, 5))),
    "joint": Icon((_shaft(-24, -10), path([(-2, -9), (-10, -9), (-10, 9), (-2, 9)], **THICK), circle(0, 0, 4, **FILLED),
                   path([(2, -9), (10, -9), (10, 9), (2, 9)], **THICK), _shaft(10, 24))),
    "link": Icon((_shaft(-24, 24), path([(-8, -8), (0, 0), (-8, 8)], **THIN), path([(8, -8), (0, 0), (8, 8)], **THIN))),
    "fixed": Icon((line(4, -14, 4, 14, **THICK), _shaft(4, 24),
                   *(line(4, y, -4, y + 6, **THIN) for y in _steps(-14, 10, 5.5)))),
    "torque": _arc("τ"),
    "torque_between": _arc("τ", both=True),
    "speed": _arc("ω"),
    "angle": _arc("φ"),
    "acceleration": _arc("α"),
    "force": _arrow("f"),
    "load": Icon(
        (_shaft(10, 24), rectangle(-18, -14, 28, 28, rx=2, stroke=INK, stroke_width="1.3", fill=LIGHT),
         path([(-14, 10), (-14, -10)], **THIN), path([(-14, 10), (6, 10)], **THIN),
         path([(-14, 8), (-9, 7), (-4, 4), (0, 0), (5, -9)], stroke_linejoin="round", **THICK))
    ),
    "eddy_brake": Icon((_shaft(0, 24), *_plates(0, (-14, 14)), path([(-14, -12), (-5, -12), (-5, -5), (-14, -5)], **FILLED),
                        path([(-14, 5), (-5, 5), (-5, 12), (-14, 12)], **FILLED), line(-14, -12, -14, 12, **THICK))),
    "sensor": _gauge("", series=False),
    "sensor_between": _gauge("", series=True),
    "heat_capacity": _letter_box("C"),
    "temperature": _letter_box("T"),
    "heat_resistance": Icon((_shaft(-24, -14), rectangle(-14, -9, 28, 18, **FILLED), _shaft(14, 24),
                             *(line(x, -9, x, 9, **THIN) for x in (-7, 0, 7)))),
    "convection": Icon((_shaft(-24, -14), rectangle(-14, -14, 8, 28, **FILLED), line(16, 0, 24, 0, **THICK),
                        *(path([(-4, y), (2, y - 3), (8, y + 3), (16, y)], **THIN) for y in (-9, 0, 9)))),
    "body": Icon((circle(0, 0, 16, **FILLED), path([(-20, 0), (20, 0)], stroke_dasharray="6 2 1 2", **THIN),
                  path([(0, -20), (0, 20)], stroke_dasharray="6 2 1 2", **THIN), _shaft(16, 24))),
    "block": Icon((), framed=True),
}  # fmt: skip
"""Icons by the name that a component class gives as ``icon``."""
