"""`StabilitySensitivity`: derivatives of poles and loop margins with respect to a parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.feedback.feedback_loop import Loop
from gearlib.feedback.margins import Margins
from gearlib.linear.eigenvalue_changes import eigenvalue_changes
from gearlib.linear.linear_model import Matrices, full
from gearlib.linear.poles import Poles
from gearlib.linear.resolvent import laurent
from gearlib.linear.response_changes import frequency_direction, response_changes

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StabilitySensitivity:
    """Derivatives of a `StabilityReport` with respect to a parameter, per unit of the parameter.

    Attributes
    ----------
    parameter : str
    unit : str
        Unit of the parameter.
    value : float
        Value of the parameter.
    eigenvalues : complex array
        1/s per unit, in the order of the poles; those at 0 stay at 0.
    closed_eigenvalues : complex array
        For the closed loop; empty without one.
    gain_margin, phase_margin, delay_margin, modulus_margin : float
        For the report's margins, the phase margin in degrees, the delay margin in seconds; NaN where there is none.
    """

    parameter: str
    unit: str
    value: float
    eigenvalues: Complexes
    closed_eigenvalues: Complexes
    gain_margin: float
    phase_margin: float
    delay_margin: float
    modulus_margin: float

    def __str__(self) -> str:
        unit = self.unit if self.unit != "1" else ""
        lines = [f"Change with {self.parameter} = {self.value:g}{f' {unit}' if unit else ''}{f', per {unit}' if unit else ''}"]
        for what, values in (("pole", self.eigenvalues), ("closed", self.closed_eigenvalues)):
            lines += [f"  {what:14s} {v.real:14.6g} {v.imag:+14.6g}j 1/s" for v in values]
        for what, number, own in (
            ("gain margin", self.gain_margin, ""), ("phase margin", self.phase_margin, "deg"),
            ("delay margin", self.delay_margin, "s"), ("modulus margin", self.modulus_margin, ""),
        ):  # fmt: skip
            if not np.isnan(number):
                lines.append(f"  {what:14s} {number:14.6g} {own}".rstrip())
        return "\n".join(lines)


def stability_sensitivity(
    parameter: str, unit: str, value: float, whole: Matrices, change: Matrices, poles: Poles, loop: tuple[Loop, Margins] | None
) -> StabilitySensitivity:
    """From the matrices, their derivatives, and the quantities to differentiate: poles, and the margins of a loop.

    Raises
    ------
    SolverError
        A pole is not differentiable.
    """
    eigenvalues = eigenvalue_changes(whole.A, [change.A], poles.values)[0]
    if loop is None:
        return StabilitySensitivity(parameter, unit, value, eigenvalues, np.empty(0, complex), *[np.nan] * 4)
    closed = closed_loop(whole), closed_loop_change(whole, change)
    ends = eigenvalue_changes(closed[0], [closed[1]], loop[0].closed_poles.values)[0]
    return StabilitySensitivity(parameter, unit, value, eigenvalues, ends, *margin_changes(whole, change, *loop))


def closed_loop(m: Matrices) -> Floats:
    """State matrix of the loop closed by negative feedback."""
    A, B, C, D = (full(x) for x in (m.A, m.B, m.C, m.D))
    return np.asarray(A - B @ C / (1 + D[0, 0]))


def closed_loop_change(m: Matrices, change: Matrices) -> Floats:
    """Its derivative, where the matrices of the open loop change."""
    B, C, D, dA, dB, dC, dD = (full(x) for x in (m.B, m.C, m.D, change.A, change.B, change.C, change.D))
    k = 1 / (1 + D[0, 0])
    return np.asarray(dA - k * (dB @ C + B @ dC) + k**2 * dD[0, 0] * (B @ C))


def margin_changes(whole: Matrices, change: Matrices, loop: Loop, margins: Margins) -> tuple[float, float, float, float]:
    """Derivatives of the four margins, from those of the crossings, whose frequencies move with the parameter."""

    def moved(omega: float) -> tuple[complex, complex, complex]:
        """The response, and its derivatives with respect to the parameter and to the frequency; at infinite frequency it is D."""
        if not np.isfinite(omega):
            return complex(loop.d), complex(full(change.D)[0, 0]), 0.0
        if not omega:
            return complex(loop.at_rest[0]), complex(change_at_rest(whole, change)), 0.0
        s = [1j * omega]
        by_frequency = 1j * response_changes(whole, frequency_direction(whole), s)[0, 0, 0]
        return complex(loop.response(s[0])), complex(response_changes(whole, change, s)[0, 0, 0]), complex(by_frequency)

    gain = phase = delay = np.nan
    nearest = min(margins.phase_crossings, key=lambda c: abs(np.log(c.gain_margin)), default=None)
    if nearest is not None:
        value, by_parameter, by_frequency = moved(nearest.omega)
        shift = -by_parameter.imag / by_frequency.imag if by_frequency and not margins.real else 0.0
        gain = (by_parameter + by_frequency * shift).real / value.real**2
    crossing = min(margins.gain_crossings, key=lambda c: abs(c.phase_margin), default=None)
    if crossing is not None:
        phase = np.degrees(_angle_change(*moved(crossing.omega))[0])
    shortest = min(margins.gain_crossings, key=lambda c: c.delay_margin, default=None)
    if margins.turns_at_infinity:
        delay = 0.0
    elif shortest is not None:
        angle, shift = _angle_change(*moved(shortest.omega))
        delay = (angle - shortest.delay_margin * shift) / shortest.omega
    value, by_parameter, by_frequency = moved(margins.modulus_omega)
    off = 1 + value
    if by_frequency:  # the nearest point is known to half of the digits only: what is left along the curve is no distance
        along = by_frequency / abs(by_frequency)
        across = off - along * (along.conjugate() * off).real
        off = across if abs(across) > 0.5 * abs(off) else off
    modulus = (off.conjugate() * by_parameter).real / abs(off) if off else np.nan
    return float(gain), float(phase), float(delay), float(modulus)


def change_at_rest(whole: Matrices, change: Matrices) -> float:
    """Derivative of the response at frequency 0; poles there that do not appear in it are passed in its Laurent series."""
    A, B, C, dA, dB, dC, dD = (full(x) for x in (whole.A, whole.B, whole.C, change.A, change.B, change.C, change.D))
    poles_there, regular = laurent(A)
    series = [*poles_there[::-1], *regular]
    constant = dC @ regular[0] @ B + C @ regular[0] @ dB + dD
    constant = constant + sum(C @ left @ dA @ right @ B for left, right in zip(series, series[::-1], strict=True))
    return float(constant[0, 0])


def _angle_change(value: complex, by_parameter: complex, by_frequency: complex) -> tuple[float, float]:
    """Derivatives of the response's angle at constant magnitude 1, and of the frequency at which it has that magnitude."""
    own, along = by_parameter / value, by_frequency / value
    shift = -own.real / along.real
    return own.imag + along.imag * shift, shift
