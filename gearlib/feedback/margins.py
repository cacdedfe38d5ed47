"""Stability margins of a loop: gain, phase, delay and modulus margins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gearlib.feedback.feedback_loop import Loop

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
LEVEL = 1e-12  # relative: of a magnitude that is this close to 1 rounding decides whether it is above
BEYOND = 10.0 ** np.arange(0.1, 6.0, 0.1)
BESIDE = 1e-7  # relative to its frequency: a sign that changes this near a pole on the imaginary axis is the pole's


@dataclass(frozen=True)
class GainCrossing:
    """|L| = 1 at ``omega`` (rad/s), with the additional phase lag (degrees) or delay (s) that leads to instability."""

    omega: float
    phase_margin: float
    delay_margin: float


@dataclass(frozen=True)
class PhaseCrossing:
    """L is real and negative at ``omega`` (rad/s), with the gain factor at which the curve meets -1."""

    omega: float
    gain_margin: float

    @property
    def gain_margin_db(self) -> float:
        return float(20 * np.log10(self.gain_margin))


@dataclass(frozen=True)
class Margins:
    """All margins of a loop.

    Attributes
    ----------
    phase_crossings : tuple of PhaseCrossing
        Sorted by frequency, including 0 and infinity if L is real, negative and finite there. Of a `real` curve those alone at which
        closed-loop poles leave the imaginary axis: besides these ends, the extrema of L.
    gain_crossings : tuple of GainCrossing
    modulus_margin : float
        Smallest distance of the curve from -1, at ``modulus_omega`` (rad/s).
    real : bool
        Whether the whole curve lies on the real axis (a train without damping), so that it is on that axis everywhere.
    at_infinity : float
        L at infinite frequency.
    """

    phase_crossings: tuple[PhaseCrossing, ...]
    gain_crossings: tuple[GainCrossing, ...]
    modulus_margin: float
    modulus_omega: float
    real: bool
    at_infinity: float = 0.0

    @property
    def gain_margin(self) -> float:
        """The factor nearest to 1 (in decibels) at which the curve meets -1; infinite if there is none."""
        nearest = min(self.phase_crossings, key=lambda c: abs(np.log(c.gain_margin)), default=None)
        return nearest.gain_margin if nearest else float("inf")

    @property
    def gain_margin_db(self) -> float:
        return float(20 * np.log10(self.gain_margin))

    @property
    def phase_margin(self) -> float:
        """The phase margin of smallest magnitude, degrees; infinite if |L| never equals 1."""
        nearest = min(self.gain_crossings, key=lambda c: abs(c.phase_margin), default=None)
        return nearest.phase_margin if nearest else float("inf")

    @property
    def delay_margin(self) -> float:
        """The shortest delay (s) at which the curve meets -1; 0 if |L| does not fall below 1, since any delay turns its end without end."""
        if self.turns_at_infinity:
            return 0.0
        return min((c.delay_margin for c in self.gain_crossings), default=float("inf"))

    @property
    def turns_at_infinity(self) -> bool:
        """Whether any delay, however short, turns the end of the curve round -1."""
        return abs(self.at_infinity) > 1 - LEVEL

    def as_dict(self) -> dict[str, float | list[tuple[float, float]]]:
        """Plain numbers by name, crossings as (rad/s, margin)."""
        return {
            "gain_margin": self.gain_margin,
            "gain_margin_db": self.gain_margin_db,
            "phase_margin_deg": self.phase_margin,
            "delay_margin_s": self.delay_margin,
            "modulus_margin": self.modulus_margin,
            "modulus_omega": self.modulus_omega,
            "phase_crossings": [(c.omega, c.gain_margin) for c in self.phase_crossings],
            "gain_crossings": [(c.omega, c.phase_margin) for c in self.gain_crossings],
        }


def margins(loop: Loop) -> Margins:
    """All margins of a loop, accurate to rounding.

    Parameters
    ----------
    loop : Loop

    Returns
    -------
    Margins

    Examples
    --------
    >>> import control
    >>> from gearlib.feedback.feedback_loop import as_loop
    >>> found = margins(as_loop(control.tf([4], [1, 2, 1, 0])))     # k / (s (s + 1)^2) meets -1 at k = 2, 1 rad/s
    >>> round(found.gain_margin, 12), round(found.phase_crossings[0].omega, 12)
    (0.5, 1.0)
    """
    omega = loop.frequencies()
    # a curve that ends near the circle or the axis meets it far from all poles; there it is smooth, and a few points will do
    omega = np.concatenate([omega[0] / BEYOND[::-1], omega, omega[-1] * BEYOND])
    curve = loop.response(1j * omega)
    keep = np.isfinite(curve)
    dense = np.pad(np.ones(len(omega) - 2 * len(BEYOND), bool), len(BEYOND))[keep]
    omega, curve = omega[keep], curve[keep]
    size = np.abs(curve)
    noise = loop.rounding(1j * omega) / np.maximum(size, 1e-300)
    on_axis = np.median((np.abs(curve.imag) / np.maximum(size, 1e-300))[dense]) < 1e-11
    real = bool(on_axis and (noise < 1.0).any())  # a curve that is zero has no direction
    phase = _phase_crossings(loop, omega, curve, real)
    gain = [_gain_crossing(loop, w) for w in _unit_gain(loop, omega, size, noise)]
    modulus, at = _nearest(loop, omega[dense], curve[dense])
    return Margins(tuple(phase), tuple(gain), modulus, at, real, loop.d)


def _gain_crossing(loop: Loop, omega: float) -> GainCrossing:
    angle = float(np.angle(-loop.response(1j * omega), deg=True))
    if abs(np.deg2rad(angle)) <= loop.rounding(1j * omega):  # at -1: a lag, not almost a turn ahead of it
        angle = 0.0
    return GainCrossing(omega, angle, float(np.deg2rad(angle % 360.0)) / omega)


def _unit_gain(loop: Loop, omega: Floats, size: Floats, noise: Floats) -> list[float]:
    """Frequencies at which |L| crosses 1; if it is 1 everywhere (an all-pass), the one at which the curve is nearest to -1.

    ``noise`` is the rounding of |L| relative to it: where that is all that there is of the curve, it has no magnitude.
    """
    level = np.log(np.maximum(size, 1e-300))
    clear = np.abs(level) > np.maximum(LEVEL, noise)  # elsewhere rounding decides the sign
    if not clear.any():
        omega = omega[noise < 1.0]
        return [float(omega[np.argmin(np.abs(np.angle(-loop.response(1j * omega))))])] if len(omega) else []
    return roots(omega[clear], level[clear], lambda x: float(np.log(abs(loop.response(1j * x)))))


def _phase_crossings(loop: Loop, omega: Floats, curve: Complexes, real: bool) -> list[PhaseCrossing]:
    """Crossings of the negative real axis, including those at 0 and infinity; the extrema of a curve that lies on it."""
    found = []
    start, error = loop.at_rest
    if np.isfinite(start) and start < -10 * error:
        found.append(PhaseCrossing(0.0, -1 / start))
    found += _extrema(loop, omega, curve.real) if real else _crossings_between(loop, omega, curve)
    if loop.d < 0:
        found.append(PhaseCrossing(float("inf"), -1 / loop.d))
    return found


def _crossings_between(loop: Loop, omega: Floats, curve: Complexes) -> list[PhaseCrossing]:
    """Crossings of the negative real axis between 0 and infinity."""
    found = []
    # elsewhere rounding decides the sign
    clear = np.abs(curve.imag) > np.maximum(1e-12 * np.abs(curve), loop.rounding(1j * omega))
    omega, curve = omega[clear], curve[clear]
    ratio = curve.imag / np.abs(curve)  # the tangent of the phase is well scaled even where L changes by orders of magnitude
    on_axis = loop.open_poles.values.real == 0
    jumps, reach = loop.open_poles.values.imag[on_axis], loop.open_poles.tolerances[on_axis]
    for w in roots(omega, ratio, lambda x: float((lambda z: z.imag / abs(z))(loop.response(1j * x)))):
        if (np.abs(w - jumps) <= np.maximum(reach, BESIDE * w)).any():
            continue  # a pole on the axis, which rounding puts on one side of it
        value = loop.response(1j * w)
        if value.real < 0 and abs(value.imag) < 1e-6 * abs(value) and abs(value) > 10 * loop.rounding(1j * w):
            found.append(PhaseCrossing(w, float(-1 / value.real)))
    return found


def _extrema(loop: Loop, omega: Floats, values: Floats) -> list[PhaseCrossing]:
    """Negative extrema of a real curve, between its poles: there two closed-loop poles meet on the imaginary axis."""
    rise = np.diff(values)
    rise[np.abs(rise) <= loop.rounding(1j * omega[1:])] = 0.0  # where the curve has come to rest, rounding decides the sign
    found = []
    for i in np.flatnonzero((rise[1:] * rise[:-1] < 0) & (values[1:-1] < 0)).tolist():
        ends, sign = (float(omega[i]), float(omega[i + 2])), float(np.sign(rise[i + 1]))
        if not ((loop.open_poles.on_axis > ends[0]) & (loop.open_poles.on_axis < ends[1])).any():
            least, at = least_between(partial(_signed, lambda x: float(loop.response(1j * x).real), sign), ends)
            found.append(PhaseCrossing(at, -sign / least))
    return found


def roots(omega: Floats, values: Floats, f: Callable[[float], float]) -> list[float]:
    """Sign changes of a sampled function, to rounding; a jump across a pole on the imaginary axis is not a root."""
    from scipy.optimize import brentq

    def finite(x: float) -> float:
        with np.errstate(divide="ignore", invalid="ignore"):
            value = f(x)
        return value if np.isfinite(value) else 0.0  # ends the search at the pole

    same = values[:-2] * values[2:] > 0
    dips = _may_reach(np.abs(values), 0.0) & same & (values[1:-1] * values[2:] > 0)
    between = []  # where the function may reach 0 and return between two samples
    for k in (np.flatnonzero(dips) + 1).tolist():
        sign = float(np.sign(values[k]))
        least, at = least_between(partial(_signed, finite, sign), (float(omega[k - 1]), float(omega[k + 1])))
        between += [(at, sign * least)] if least < 0 else []
    omega, values = np.hstack([(omega, values), np.reshape(between, (-1, 2)).T])
    order = np.argsort(omega, kind="stable")
    omega, values = omega[order], values[order]
    places = np.flatnonzero(values[1:] * values[:-1] < 0)
    found = []
    for a, b in zip(omega[places], omega[places + 1], strict=True):
        low, high = finite(a), finite(b)
        if low * high < 0:
            found.append(float(brentq(finite, a, b, xtol=1e-300, rtol=8.9e-16)))
        else:  # a single point may round differently than in an array: it is a root to rounding
            found.append(float(a if abs(low) < abs(high) else b))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = [w for w in found if np.isfinite(f(w))]
    return sorted(found + [float(w) for w in omega[values == 0.0]])


def _may_reach(values: Floats, level: float) -> NDArray[np.bool_]:
    """Inner samples beside which a function has a minimum that may be as low as a level.

    A parabola falls below the least of three samples by a quarter of their differences at most; the curve is no parabola, and the steps
    are not all equal.
    """
    inner, rise = values[1:-1], np.maximum(values[:-2], values[2:]) - values[1:-1]
    found: NDArray[np.bool_] = (inner <= np.minimum(values[:-2], values[2:])) & (inner - rise <= level) & (rise > 1e-9 * inner)
    return found


def _signed(f: Callable[[float], float], sign: float, x: float) -> float:
    return sign * f(x)


def _nearest(loop: Loop, omega: Floats, curve: Complexes) -> tuple[float, float]:
    """Smallest distance from -1, and its frequency."""
    distance = np.abs(1 + curve)
    ends = [(abs(1 + loop.d), float("inf")), (abs(1 + loop.at_rest[0]), 0.0)]
    i = int(np.argmin(distance))
    for k in (np.flatnonzero(_may_reach(distance, float(distance[i]))) + 1).tolist():
        between = float(omega[k - 1]), float(omega[k + 1])
        ends += [least_between(lambda x: float(abs(1 + loop.response(1j * x))), between)]
    ends.append((float(distance[i]), float(omega[i])))
    return min(ends)


def least_between(f: Callable[[float], float], between: tuple[float, float]) -> tuple[float, float]:
    """The smallest value of a function between two frequencies, and where it is."""
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(f, bounds=between, method="bounded", options={"xatol": 1e-9 * between[0]})
    return float(best.fun), float(best.x)
