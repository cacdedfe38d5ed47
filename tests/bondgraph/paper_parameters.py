"""Parameters of the paper's bond graph: by the names of its numerical form, and at random."""

from __future__ import annotations

import numpy as np

from gearlib.bondgraph import RunTime
from gearparts.trains import zhou_cui_2022 as zc


def by_name(run: RunTime, params: zc.BondParameters) -> dict[str, float]:
    """The parameters by their names in ``run``, such as ``m_5`` and ``I_26``."""
    every = {f"m_{k}": float(params.m[k]) for k in range(1, 23)}
    for kind in "IRC":
        every |= {f"{kind}_{bond}": value for bond, value in getattr(params, kind).items()}
    return {name: every[name] for name in run.parameters}


def random_parameters(rng: np.random.Generator) -> zc.BondParameters:
    """22 moduli of either sign, 15 inertias, 7 resistances and 3 compliances between 0.3 and 3."""

    def draw(bonds: tuple[int, ...]) -> dict[int, float]:
        return {bond: float(rng.uniform(0.3, 3.0)) for bond in bonds}

    m = rng.uniform(0.3, 3.0, 23) * rng.choice([-1.0, 1.0], 23)
    return zc.BondParameters(m, draw(zc.INERTIAS), draw(zc.RESISTANCES), draw(zc.COMPLIANCES))
