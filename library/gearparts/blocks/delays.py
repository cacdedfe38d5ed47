"""Delays of signals that change continuously; `UnitDelay` delays a sampled one."""

from __future__ import annotations

from collections.abc import Sequence

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearlib.language.delayed import SHORTEST, Delayed
from gearlib.language.expressions import real_symbol
from gearparts.blocks.continuous import Integrator
from gearparts.blocks.interfaces import SISO


class FixedDelay(Delayed):
    """Pure delay: ``y(t) = u(t - delay_time)``; in the first ``delay_time`` of a run ``y`` is what ``u`` is at the start.

    The run keeps the history of ``u`` between its jumps and bends to the tolerance, in every method but ``"exact"``, and so do runs that
    go on and `System.stepper`. Analyses that need equations (linear models, FMUs, ...) refuse it by name: a `PadeDelay` takes its place
    there.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Late(gl.Component):
    ...     def assemble(self):
    ...         self.ramp, self.delay = gp.blocks.Ramp(height=2.0, duration=1.0), gp.blocks.FixedDelay(delay_time=0.25)
    ...         return [gl.connect(self.ramp.y, self.delay.u)]
    >>> gl.simulate(Late(), t_end=1.0, samples=5)["delay.y"].round(9) + 0.0
    array([0. , 0. , 0.5, 1. , 1.5])
    """


class PadeDelay(SISO):
    """A delay as a rational function: the Padé approximation of ``exp(-s delay_time)``, the same as ``control.pade(delay_time, n, m)``.

    It suits every analysis: linear models, stability, FMUs. At the start it is settled, with the output equal to the input, as that of
    `FixedDelay`. Its phase is right up to about ``n / delay_time`` (rad/s); a step is followed with ripples.

    With its denominator ``a[0] + a[1] p + ... + a[n] p**n`` in ``p = s delay_time``, the states are ``x[i].y = a[i] p**i`` of the filtered
    input. Their equations ``delay_time der(x[i].y) = a[i] / a[i+1] x[i+1].y`` hold ratios of neighbouring coefficients only, and keep their
    digits where the coefficients differ by many orders of magnitude.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Late(gl.Component):
    ...     def assemble(self):
    ...         self.wave, self.delay = gp.blocks.Sine(f=0.5), gp.blocks.PadeDelay(delay_time=0.25, n=4)
    ...         return [gl.connect(self.wave.y, self.delay.u)]
    >>> float(abs(gl.simulate(Late(), t_end=10.25, samples=2)["delay.y"][-1]).round(5))  # sin(10 pi)
    0.0
    """

    delay_time = gl.Parameter("s", "delay", min=SHORTEST)
    n = gl.Structural(1, "order of the denominator", min=1, max=20)
    m = gl.Structural(None, "order of the numerator; nothing: n")
    settled = gl.Variable("any", "what the start is held to: the input has long been what it is", start=0.0)

    def assemble(self) -> Sequence[gl.Connection]:
        n, m = self._orders()
        x = [real_symbol(f"x[{i}].y") for i in range(n)]
        following = [*x[1:], self.u - sum(x)]  # the last one is a[n] p**n
        ratios = [(n + m - i) * (i + 1) / (n - i) for i in range(n)]  # a[i] = (n + m - i)! n! / ((n + m)! i! (n - i)!)
        self.x = [Integrator(u=k * after / self.delay_time) for k, after in zip(ratios, following, strict=True)]
        return []

    def equations(self) -> list[gl.Eq]:
        n, m = self._orders()
        x = [part.y for part in self.x]
        shares = [1.0]  # b[i] / a[i], with the numerator's b[i] = (-1)**i (n + m - i)! m! / ((n + m)! i! (m - i)!)
        for i in range(n):
            shares.append(-shares[-1] * (m - i) / (n - i))
        y = sum(share * each for share, each in zip(shares, [*x, self.u - sum(x)], strict=True) if share)
        return [gl.Eq(self.y, y), gl.Eq(self.settled, x[0] - self.u)]

    def _orders(self) -> tuple[int, int]:
        n, m = self.n, self.n if self.m is None else self.m
        if isinstance(m, bool) or not isinstance(m, int) or not 0 <= m <= n:
            raise BindingError(f"PadeDelay: m is {shown(m)}; expected a whole number from 0 to n = {n}")
        return n, m
