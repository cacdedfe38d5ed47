"""`EnergyBalance`: where the energy of a run came from, where it went, and what is left unexplained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.drawing.printed import fitted, shortened

Floats = NDArray[np.float64]
ROUNDING = 1e-12  # of the stored energies: smaller differences between them are rounding
ROWS = 12  # of each kind in the table


@dataclass(frozen=True, eq=False)
class EnergyBalance:
    """Energies of a run over time (J), by component path. All but `stored` count from the start of the run.

    ``stored - stored[0] = work + jumps - heat + returned - unaccounted + residual``, each summed over all components.

    Attributes
    ----------
    time : array
        Start of the run and its samples, all of them unless they are very many, s.
    work : mapping of str to array
        Put in by sources and supports, and by prescribed excitations such as a transmission error.
    stored : mapping of str to array
        In bodies, springs, meshes and heat capacities; kinetic energy counts from rest, heat from 0 K.
    heat : mapping of str to array
        Dissipated by each component.
    returned : array
        Heat returned to the model through heat ports.
    jumps : mapping of str to array
        Stored energy that appears at events: impacts, re-initialised states, stiffness that jumps.
    unaccounted : mapping of str to array
        Energy that flowed into components without an energy declaration.
    unknown : tuple of str
        Components with connectors whose power is not known; if there are any, the residual is meaningless.
    residuals : mapping of str to array
        Per component: energy stored less energy received and not dissipated. A nonzero residual means that the component's equations
        and its declared energies contradict each other, or that the run is inaccurate.
    residual : array
        Of the whole model.
    throughput : float
        Energy exchanged between components during the run; with `unresolved`, the scale of the residual.
    quadrature : float
        Estimated quadrature error.
    rtol : float
        Relative tolerance of the run.
    unresolved : float
        Energy that torques and forces exchange at speeds of the size of the run's absolute tolerance: where nothing moves faster, what
        is exchanged is rounding, J.
    """

    time: Floats
    work: Mapping[str, Floats]
    stored: Mapping[str, Floats]
    heat: Mapping[str, Floats]
    returned: Floats
    jumps: Mapping[str, Floats]
    unaccounted: Mapping[str, Floats]
    unknown: tuple[str, ...]
    residuals: Mapping[str, Floats]
    residual: Floats
    throughput: float
    quadrature: float
    rtol: float
    unresolved: float = 0.0

    @property
    def largest_residual(self) -> float:
        """The largest residual, of the whole or of any component, beyond the rounding of what is stored, J."""
        worst = max((float(np.abs(r).max()) for r in (self.residual, *self.residuals.values())), default=0.0)
        return max(worst - ROUNDING * sum(float(np.abs(e).max()) for e in self.stored.values()), 0.0)

    @property
    def scale(self) -> float:
        """The energy with which a residual is compared, J."""
        return self.throughput + self.unresolved

    @property
    def relative_residual(self) -> float:
        """The largest residual, of the whole or of any component, relative to the energy exchanged."""
        return self.largest_residual / self.scale if self.scale else 0.0

    @property
    def worst(self) -> str:
        """The component with the largest residual."""
        return max(self.residuals, key=lambda path: float(np.abs(self.residuals[path]).max()), default="")

    def __str__(self) -> str:
        change = {path: e - e[0] for path, e in self.stored.items()}
        kinds = (
            ("work put in", self.work), ("heat", self.heat), ("stored, change", change), ("jumps at events", self.jumps),
            ("unaccounted for", self.unaccounted),
        )  # fmt: skip
        lines = [f"energy balance, {self.time[0]:g} .. {self.time[-1]:g} s, J"]
        for title, values in kinds:
            if not values and title in ("jumps at events", "unaccounted for"):
                continue
            lines.append(f"{title:<40}{_total(values):>14.6g}")
            ends = sorted(((float(v[-1]), path) for path, v in values.items()), key=lambda item: -abs(item[0]))
            lines += [f"  {shortened(path, 80):<38}{value:>14.6g}" for value, path in ends[:ROWS]]
            lines += [f"  ... and {len(ends) - ROWS} more"] if len(ends) > ROWS else []
        if np.any(self.returned):
            lines.append(f"{'heat that stays, through heat ports':<40}{self.returned[-1]:>14.6g}")
        lines.append(f"{'residual':<40}{self.residual[-1]:>14.2g}")
        if self.unknown:
            lines.append(f"not known how much power flows into {', '.join(self.unknown)}")
        return fitted("\n".join(lines))


def _total(values: Mapping[str, Floats]) -> float:
    return float(sum(v[-1] for v in values.values()))
