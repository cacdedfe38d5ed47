"""Delays of signals that change continuously; `UnitDelay` delays a sampled one."""

from __future__ import annotations

from gearlib.language.delayed import Delayed


class FixedDelay(Delayed):
    """Pure delay: ``y(t) = u(t - delay_time)``; in the first ``delay_time`` of a run ``y`` is what ``u`` is at the start.

    The run keeps the history of ``u`` between its jumps and bends to the tolerance, in every method but ``"exact"``, and so do runs that
    go on and `System.stepper`. Analyses that need equations (linear models, FMUs, ...) refuse it by name: a `TransferFunction` with the
    coefficients of ``control.pade`` takes its place there.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Late(gl.Component):
    ...     def assemble(self):
    ...         self.ramp, self.delay = gp.blocks.Ramp(height=2.0), gp.blocks.FixedDelay(delay_time=0.25)
    ...         return [gl.connect(self.ramp.y, self.delay.u)]
    >>> gl.simulate(Late(), t_end=1.0, samples=5)["delay.y"].round(9)
    array([0. , 0. , 0.5, 1. , 1.5])
    """
