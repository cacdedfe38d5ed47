"""`stability`: what the eigenvalues say, and for a chosen loop what Nyquist's criterion and the margins say, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gearlib.analysis.loops import Loop, as_loop, is_system
from gearlib.analysis.margins import Margins, margins
from gearlib.analysis.nyquist import NyquistCount, nyquist_count
from gearlib.analysis.poles import MEANING, Poles, Verdict, poles


@dataclass(frozen=True, eq=False)
class LoopReport:
    """A loop closed by negative feedback: its margins, its Nyquist count, and the poles of the closed loop."""

    loop: Loop

    @cached_property
    def margins(self) -> Margins:
        return margins(self.loop)

    @cached_property
    def nyquist(self) -> NyquistCount:
        return nyquist_count(self.loop)

    @property
    def closed_poles(self) -> Poles:
        return self.loop.closed_poles

    @property
    def verdict(self) -> Verdict:
        """Of the closed loop, by Nyquist's criterion; ``closed_poles.verdict`` is that of its eigenvalues."""
        return self.nyquist.verdict

    def __str__(self) -> str:
        m = self.margins
        lines = [f"Loop {self.loop.input} -> {self.loop.output}, negative feedback", f"  {self.nyquist}"]
        lines.append(f"  By its eigenvalues the closed loop is {self.closed_poles.verdict}.")
        if m.real:
            lines.append("  The curve lies on the real axis (nothing is damped): it has no isolated phase crossings.")
        elif not m.phase_crossings:
            lines.append("  gain margin      infinite: the curve does not cross the negative real axis")
        lines += [
            f"  gain margin      {c.gain_margin:.6g} ({c.gain_margin_db:+.3f} dB) at {_rad(c.omega)}" for c in m.phase_crossings
        ]
        if not m.gain_crossings:
            lines.append("  phase margin     infinite: |L| is nowhere 1")
        lines += [
            f"  phase margin     {g.phase_margin:.4f} deg, delay margin {g.delay_margin:.4g} s, at {_rad(g.omega)}"
            for g in m.gain_crossings
        ]
        lines.append(f"  modulus margin   {m.modulus_margin:.6g}, the smallest distance from -1, at {_rad(m.modulus_omega)}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class StabilityReport:
    """Poles of a model, and of one loop if one was chosen. ``print`` it to read it.

    Attributes
    ----------
    name : str
    poles : Poles
    loop : LoopReport or None
    """

    name: str
    poles: Poles
    loop: LoopReport | None = None

    @property
    def eigenvalues(self) -> Any:
        """Complex array, rad/s, by magnitude."""
        return self.poles.values

    @property
    def damping(self) -> Any:
        """Damping ratio of each eigenvalue."""
        return self.poles.damping

    @property
    def verdict(self) -> Verdict:
        """Of the model as it is, with no loop closed: "stable", "marginal", "drifting" or "unstable"."""
        return self.poles.verdict

    def __str__(self) -> str:
        lines = [f"{self.name}: {MEANING[self.verdict]}", *pole_table(self.poles)]
        zeros = self.poles.at_zero
        if zeros:
            chain = ", in chains, so that angles grow with time" if len(self.poles.chains) > 1 else ""
            lines.append(f"  {zeros} {'pole' if zeros == 1 else 'poles'} at 0 (free turning, or a constant preload){chain}")
        if self.loop is not None:
            lines += ["", str(self.loop)]
        return "\n".join(lines)


def pole_table(found: Poles, most: int = 40) -> list[str]:
    """One line for each pole or pair of poles."""
    lines = ["       real, 1/s     imag, rad/s   frequency, Hz    damping   time constant, s"]
    shown = [(v, z) for v, z in zip(found.values, found.damping, strict=True) if v.imag >= 0]
    for value, ratio in shown[:most]:
        pair = "+-" if value.imag > 0 else "  "
        lines.append(
            f"{value.real:16.6g}  {pair}{value.imag:12.6g}  {abs(value) / (2 * np.pi):14.6g}  {ratio:9.4f}  "
            f"{-1 / value.real if value.real else np.inf:17.4g}"
        )
    if len(shown) > most:
        lines.append(f"  ... and {len(shown) - most} more")
    return lines


def _rad(omega: float) -> str:
    return f"{omega:.6g} rad/s ({omega / (2 * np.pi):.6g} Hz)"


def stability(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None,
) -> StabilityReport:  # fmt: skip
    """Stability of a model, and of a loop closed around it.

    Parameters
    ----------
    model : System, control.StateSpace, control.TransferFunction or LinearModel
    loop : (input, output), optional
        Names of the signals of a loop that negative unit feedback closes: ``u = r - y``. Without one, only the poles of the
        model are reported.
    gain : float
        Factor in the loop; a negative one stands for positive feedback.
    at : None, "steady", mapping, or (Result, time)
        Operating point of a System, as for `System.linearize`.
    parameters : mapping, optional
        Values by path, of a System.

    Returns
    -------
    StabilityReport
        ``.eigenvalues``, ``.damping``, ``.verdict``; for a loop ``.loop.margins``, ``.loop.nyquist``, ``.loop.verdict``.

    Raises
    ------
    ArgumentError, NameLookupError
        No such signal, or a loop that cannot be closed.

    Examples
    --------
    >>> import control, gearlib as gl
    >>> report = gl.stability(control.tf([1], [1, 2, 1, 0]), loop=(0, 0))
    >>> report.verdict, report.loop.verdict, round(report.loop.margins.gain_margin, 9)
    ('marginal', 'stable', 2.0)
    """
    name = getattr(model, "name", None) or type(model).__name__
    if loop is not None:
        chosen = as_loop(model, loop, gain=gain, at=at, parameters=parameters)
        return StabilityReport(name, chosen.open_poles, LoopReport(chosen))
    if is_system(model):
        model = model.linearize(inputs=[], at=at, parameters=parameters, sparse=True)
    if not hasattr(model, "A"):
        model = as_loop(model)
    return StabilityReport(name, poles(model.A))
