"""`stability`: stability by eigenvalues and, for a chosen loop, by the Nyquist criterion and margins, in words."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from gearlib.arguments import one_name, real, shown
from gearlib.drawing.page import preformatted, table
from gearlib.drawing.printed import fitted
from gearlib.errors import ArgumentError, GearlibWarning
from gearlib.feedback.feedback_loop import Loop, as_loop
from gearlib.feedback.gain_range import gains_in_words, stable_gains
from gearlib.feedback.margins import Margins, margins
from gearlib.feedback.nyquist import NyquistCount, nyquist_count
from gearlib.feedback.passivity import Passivity, passivity
from gearlib.feedback.stability_sensitivity import StabilitySensitivity, stability_sensitivity
from gearlib.linear.linear_model import check_linear
from gearlib.linear.linearize import linearized, states_of_outputs
from gearlib.linear.operating_point import parameters_at
from gearlib.linear.poles import MEANING, Poles, Verdict, poles, warn_of_rounding
from gearlib.run.subject import is_compiled, translation_of
from gearlib.vibration.modes import MOST_DENSE, Modes, modes

SAID = 1e-10  # of the slowest other pole: a coarser resolution of the poles at 0 is printed


@dataclass(frozen=True, eq=False)
class LoopReport:
    """A loop closed by negative feedback: its margins, its Nyquist count, and the closed-loop poles."""

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
        """Of the closed loop, by the Nyquist criterion; ``closed_poles.verdict`` is that of its eigenvalues."""
        return self.nyquist.verdict

    @cached_property
    def stable_gains(self) -> tuple[tuple[float, float], ...]:
        """Ranges of the gain factor without closed-loop poles in the right half-plane (see `stable_gains`)."""
        return stable_gains(self.loop, self.margins.phase_crossings)

    def __str__(self) -> str:
        lines = [f"Loop {self.loop.input} -> {self.loop.output}, negative feedback: {MEANING[self.verdict]}"]
        first, rest = str(self.nyquist).split(". ", 1)
        lines += [f"  Nyquist          {first}.", f"                   {rest}"]
        same = "the same" if self.closed_poles.verdict == self.verdict else f"the closed loop is {self.closed_poles.verdict}"
        found = motions(self.closed_poles)
        lines.append(f"  eigenvalues      {same}{': ' if found else ''}{'; '.join(found)}")
        return fitted("\n".join([*lines, *self._margins_in_words()]))

    def _margins_in_words(self) -> list[str]:
        m = self.margins
        lines = [f"  gain             {gains_in_words(self.stable_gains)}"]
        if m.turns_at_infinity:
            lines.append("  delay margin     0: |L| does not fall below 1 at infinite frequency")
        if m.real:
            return [*lines, "  other margins    none: the curve lies on the real axis, since nothing is damped"]
        lines += [
            f"  gain margin      {c.gain_margin:.6g} ({c.gain_margin_db:+.3f} dB) at {rad(c.omega)}" for c in m.phase_crossings
        ]
        if not m.phase_crossings:
            lines.append("  gain margin      infinite: the curve does not cross the negative real axis")
        if not m.gain_crossings:
            lines.append("  phase margin     infinite: |L| is nowhere 1")
        lines += [
            f"  phase margin     {g.phase_margin:.4f} deg, delay margin {g.delay_margin:.4g} s, at {rad(g.omega)}"
            for g in m.gain_crossings
        ]
        nearest = f"{m.modulus_margin:.6g}, the smallest distance from -1, at {rad(m.modulus_omega)}"
        return [*lines, f"  modulus margin   {nearest}"]


@dataclass(frozen=True, eq=False)
class StabilityReport:
    """Poles of a model, and of one loop if one was chosen. ``print`` it to read it.

    Anything beyond the poles is computed when it is printed or accessed.

    Attributes
    ----------
    name : str
    poles : Poles
    loop : LoopReport or None
    conditions : tuple of str
        Operating point of a System in words, such as "open: mesh m".
    at_zero : str
        Interpretation of a System's poles at 0, if known.
    passivity : Passivity or None
        For a linear System: whether its energies prove that no motion can grow.
    """

    name: str
    poles: Poles
    loop: LoopReport | None = None
    find_modes: Callable[[], Modes] | None = None
    find_passivity: Callable[[], Passivity] | None = None
    find_sensitivity: Callable[[str], StabilitySensitivity] | None = None

    def sensitivity(self, parameter: str) -> StabilitySensitivity:
        """Derivatives of poles and margins with respect to a parameter, from exact derivatives of the equations.

        Everything bound to the parameter changes with it, and so does the operating point.

        Parameters
        ----------
        parameter : str
            Path.

        Returns
        -------
        StabilitySensitivity

        Raises
        ------
        ArgumentError, NameLookupError, SolverError
            Unknown parameter, no derivative with respect to it, or a report that was not made from a System.
        """
        name = one_name("parameter", parameter, "shaft.d")
        if self.find_sensitivity is None:
            raise ArgumentError("the report is not that of a System; the derivative with respect to a parameter is not known")
        return self.find_sensitivity(name)

    @cached_property
    def passivity(self) -> Passivity | None:
        with warnings.catch_warnings():  # as `_modes`
            warnings.simplefilter("ignore", GearlibWarning)
            return None if self.find_passivity is None else self.find_passivity()

    @cached_property
    def conditions(self) -> tuple[str, ...]:
        return () if self._modes is None else self._modes.conditions

    @cached_property
    def at_zero(self) -> str:
        return "" if self._modes is None else poles_at_zero(self._modes)

    @cached_property
    def _modes(self) -> Modes | None:
        with warnings.catch_warnings():  # `stability` has warned of rounding already
            warnings.simplefilter("ignore", GearlibWarning)
            return None if self.find_modes is None else self.find_modes()

    @property
    def eigenvalues(self) -> Any:
        """Complex array, rad/s, sorted by magnitude."""
        return self.poles.values

    @property
    def damping(self) -> Any:
        """Damping ratio of each eigenvalue."""
        return self.poles.damping

    @property
    def verdict(self) -> Verdict:
        """Of the model without any closed loop: "stable", "marginal", "drifting" or "unstable"."""
        return self.poles.verdict

    def __str__(self) -> str:
        lines = [
            f"{self.name}: {MEANING[self.verdict]}",
            *(f"  {text}" for text in [*motions(self.poles, self.at_zero), *self.conditions]),
            *([f"  {self.passivity}"] if self.passivity and self.passivity.holds else []),
            "",
            *pole_table(self.poles),
        ]
        if self.loop is not None:
            lines += ["", str(self.loop)]
        return fitted("\n".join(lines))

    def _repr_html_(self) -> str:
        """Notebook representation: the text, and a table of the poles."""
        words, _, rest = str(self).partition("\n\n")
        loop = "" if self.loop is None else preformatted(str(self.loop))
        head = ["real part, 1/s", "imaginary part, rad/s", "frequency, Hz", "damping ratio"]
        rows = [[v.real, v.imag, abs(v) / (2 * np.pi), d] for v, d in zip(self.poles.values, self.poles.damping, strict=True)]
        return preformatted(words) + (table(head, rows) if rest else "") + loop


def motions(found: Poles, at_zero: str = "") -> list[str]:
    """Interpretation of the poles in words: free rotation, growth, undamped vibration, and the slowest and least damped others."""
    values, words = found.values, []
    if found.at_zero:
        poles_at = "1 pole" if found.at_zero == 1 else f"{found.at_zero} poles"
        moving = np.abs(values[values != 0])
        if found.resolution > SAID * moving.min(initial=np.inf):
            poles_at += f" (to {found.resolution:.1g} rad/s)"
        chain = ", in chains: with a speed that stays, an angle grows" if len(found.chains) > 1 else ""
        words.append(f"{poles_at} at 0: {at_zero or 'the train turns freely, or a loop of meshes keeps a preload'}{chain}")
    for value in values[(values.real > 0) & (values.imag >= 0)][:4]:
        what = f"a vibration at {abs(value.imag) / (2 * np.pi):.6g} Hz" if value.imag else "a motion without vibration"
        words.append(f"{what} grows e-fold in {1 / value.real:.4g} s")
    rings = found.on_axis[found.on_axis > 0] / (2 * np.pi)
    if len(rings):
        named = ", ".join(f"{f:.6g}" for f in rings[:4]) + (f" and {len(rings) - 4} more" if len(rings) > 4 else "")
        words.append(f"rings undamped at {named} Hz" + (", growing with time" if found.chained else ""))
    dying = values[values.real < 0]
    if len(dying):
        words.append(
            f"the {'rest' if words else 'slowest motion'} falls to 1/e in {-1 / dying.real.max():.4g} s{' or less' if words else ''}"
        )
        vibrating = dying[dying.imag > 0]
        if len(vibrating):
            least = vibrating[np.argmin(-vibrating.real / np.abs(vibrating))]
            ratio = -least.real / abs(least)
            words.append(f"the least damped vibration has {abs(least) / (2 * np.pi):.6g} Hz and the damping ratio {ratio:.4g}")
    return words


def pole_table(found: Poles, most: int = 24) -> list[str]:
    """One line per pole or conjugate pair: a frequency if it oscillates, the time constant of its decay or growth."""
    lines = ["       real, 1/s     imag, rad/s   frequency, Hz    damping   e-fold time, s"]
    shown = [(v, z) for v, z in zip(found.values, found.damping, strict=True) if v.imag >= 0]
    for value, ratio in shown[:most]:
        pair, hertz, damping = "  ", "-", "-"
        if value.imag > 0:
            pair, hertz, damping = "+-", f"{abs(value) / (2 * np.pi):.6g}", f"{ratio:.4f}"
        time = f"{abs(1 / value.real):.4g}{' (grows)' if value.real > 0 else ''}" if value.real else "-"
        lines.append(f"{value.real:16.6g}  {pair}{value.imag:12.6g}  {hertz:>14}  {damping:>9}  {time:>15}")
    if len(shown) > most:
        lines.append(f"  ... and {len(shown) - most} more")
    return lines


def rad(omega: float) -> str:
    return f"{omega:.6g} rad/s ({omega / (2 * np.pi):.6g} Hz)" if np.isfinite(omega) else "infinite frequency"


def stability(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None,
) -> StabilityReport:  # fmt: skip
    """Stability of a model, and of a loop closed around it.

    Parameters
    ----------
    model : System, control.StateSpace, control.TransferFunction or LinearModel
    loop : (input, output), optional
        Signals of a loop that negative unit feedback closes: ``u = r - y``. If omitted, only the poles of the model are reported. The poles
        of the closed loop, too, are those of the whole model, also of parts that the loop does not see.
    gain : float
        Loop gain factor; negative for positive feedback.
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
    if not is_compiled(model):
        check_linear(model)
    if real("gain", gain) != 1 and loop is None:
        raise ArgumentError(f"gain is {shown(gain)}, but no loop is closed; choose one, loop=(input, output)")
    name = getattr(model, "name", None) or type(model).__name__
    chosen = None if loop is None else as_loop(model, loop, gain=gain, at=at, parameters=parameters)
    linear: Any = model
    if is_compiled(model) and chosen is None:
        translation = translation_of(model)
        linear = linearized(translation, [], states_of_outputs(translation), at, parameters)
    elif not hasattr(model, "A") and chosen is None:
        linear = as_loop(model)
    later: tuple[Any, Any] = None, None  # evaluated when the report is printed or accessed
    if is_compiled(model) and len(model.states) <= MOST_DENSE:
        same = {"at": copy(at), "parameters": copy(parameters)}
        later = (partial(modes, model, **same), partial(passivity, model, **same))
    report = None if chosen is None else LoopReport(chosen)
    found = poles(linear.A) if chosen is None else chosen.open_poles
    source: Any = linear if chosen is None else chosen
    if is_compiled(model) and chosen is None:
        warn_of_rounding(name, linear.states, linear.A, found)
    find = None
    if is_compiled(model) and source.changes is not None:
        translation, given = translation_of(model), copy(parameters)

        def find(parameter: str) -> StabilitySensitivity:
            (change,) = source.changes([parameter])
            number = float(parameters_at(translation, at, given)[translation.model.parameters.index[parameter]])
            unit = translation.parameter_units.get(parameter, "")
            parts = None if report is None else (report.loop, report.margins)
            return stability_sensitivity(parameter, unit, number, source.whole, change, found, parts)

    return StabilityReport(name, found, report, *later, find)


def poles_at_zero(found: Modes) -> str:
    """Interpretation of a system's poles at 0."""
    words = []
    if found.free:
        words.append("the train turns freely" + (f" in {found.free} ways" if found.free > 1 else ""))
    words += [f"a free relative motion across {gap}" for gap in dict.fromkeys(found.gaps.values())]
    if found.preloads:
        words.append("loops of meshes keep preloads" if found.preloads > 1 else "a loop of meshes keeps a preload")
    if found.positions:
        words.append(f"nothing here depends on {', '.join(found.positions)}")
    return "; ".join(words)
