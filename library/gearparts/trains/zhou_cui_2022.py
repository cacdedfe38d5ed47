"""Zhou and Cui's XP single-loop gear train: Table 4 and the explicit state equations (2)-(9), in plain NumPy.

The equations are transcribed term by term, with the paper's letters and bond numbers. This file shares nothing with the engine, so that
it can serve as a reference for :class:`gearparts.ZhouCui2022`.

The states are x = (p2, q6, p11, p26, q30, p35, q74, p78), the sources u = (Se1, Sf8, Sf32, Sf72). The other ten momenta have derivative
causality: they are linear combinations of the five independent momenta, and their derivatives occur on the right of equations (4), (5)
and (9). With these collected on the left the system is E dx/dt = A x + B u with a constant E.

References
----------
X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

__all__ = [
    "COMPLIANCES", "DEPENDENT", "INDEPENDENT", "INERTIAS", "RESISTANCES", "SOURCES", "STATES", "TABLE_4", "BondParameters",
    "Quantity", "Repairs", "bond_parameters", "energy_rhs", "explicit_matrices", "explicit_rhs", "flow_rows", "flows",
    "implicit_matrices", "moduli_from_geometry", "momentum_map", "printed_rhs", "transmission_error_rate",
]  # fmt: skip

Array: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"

INDEPENDENT = (2, 11, 26, 35, 78)
"""Bonds of the inertias with integral causality; their flows determine all others."""
DEPENDENT = (17, 22, 41, 46, 51, 56, 62, 66, 69, 81)
"""Bonds of the inertias with derivative causality."""
INERTIAS = tuple(sorted(INDEPENDENT + DEPENDENT))
RESISTANCES = (7, 31, 75, 82, 83, 84, 85)
COMPLIANCES = (6, 30, 74)
STATES = ("p2", "q6", "p11", "p26", "q30", "p35", "q74", "p78")
SOURCES = ("Se1", "Sf8", "Sf32", "Sf72")
NO_SOURCES = (0.0, 0.0, 0.0, 0.0)


class Quantity(NamedTuple):
    """A number of Table 4 with its unit and meaning."""

    value: float
    unit: str
    description: str


TABLE_4: Mapping[str, Quantity] = MappingProxyType({
    "Z_s": Quantity(19, "1", "teeth of the sun"),
    "Z_p": Quantity(31, "1", "teeth of a planet"),
    "Z_r": Quantity(81, "1", "teeth of the ring"),
    "R_s": Quantity(0.0285, "m", "pitch radius of the sun"),
    "R_p": Quantity(0.0465, "m", "pitch radius of a planet"),
    "R_r": Quantity(0.1215, "m", "pitch radius of the ring"),
    "R_h": Quantity(0.075, "m", "radius of the carrier"),
    "I_s": Quantity(0.0015, "kg.m2", "moment of inertia of the sun"),
    "I_p": Quantity(0.0094, "kg.m2", "moment of inertia of a planet"),
    "I_r": Quantity(0.1510, "kg.m2", "moment of inertia of the ring"),
    "I_h": Quantity(0.0491, "kg.m2", "moment of inertia of the carrier"),
    "I_f": Quantity(0.0036, "kg.m2", "moment of inertia of a shaft"),
    "K_g": Quantity(1.8e8, "N/m", "mesh stiffness"),
    "K_s": Quantity(2.0e8, "N/m", "torsional stiffness of a shaft; in none of the equations (2)-(9)"),
    "C_g": Quantity(2000.0, "N.s/m", "mesh damping"),
    "C_v": Quantity(1800.0, "N.s/m", "support damping"),
    "e_amplitude": Quantity(0.0027, "m/s", "amplitude of the transmission error's rate"),
    "e_omega": Quantity(28.0, "rad/s", "angular frequency of the transmission error"),
    "e_phase": Quantity(21 * math.pi, "rad", "phase of the transmission error's rate"),
})  # fmt: skip
"""Table 4 of the paper, by symbol."""


@dataclass(frozen=True)
class Repairs:
    """Corrections of the printed equations; each can be switched off.

    Two more characters of equation (9) are damaged in the text at hand and leave no choice: the first denominator is read as m22 I35.
    The paper denotes dp17/dt by ``e17`` there, which is the same quantity.

    Parameters
    ----------
    shaft_inertia : bool
        Equation (5) lacks ``- m18 dp62/dt``, the inertia of the shaft I62. Without the term the equations hold only for I62 = 0:
        otherwise they do not conserve energy.
    sun_mesh_source : bool
        Equation (5) has ``- R31/m3 Sf8`` where the sun's mesh is driven by Sf32, as in equations (6) and (7). With the excitation of
        Table 4 both sources are equal, and nothing changes.
    p69_term : bool
        The p69 term of equation (9) is damaged in the text at hand; it is read as ``- m20 m21 R75 / I69 p69``. If switched off, the
        term is omitted.
    """

    shaft_inertia: bool = True
    sun_mesh_source: bool = True
    p69_term: bool = True


ALL_REPAIRS = Repairs()


@dataclass(frozen=True, eq=False)
class BondParameters:
    """Moduli, inertias, resistances and compliances of the bond graph in Fig. 3, by the paper's numbers.

    Parameters
    ----------
    m : array of 23
        Moduli m1 to m22 of the transformers; entry 0 is unused, and m7 occurs in no equation.
    I, R, C : mapping
        Inertias (kg.m2), resistances (N.s/m at the meshes, N.m.s/rad at R82-R85) and compliances (m/N), by bond.
    """

    m: Array
    I: Mapping[int, float]
    R: Mapping[int, float]
    C: Mapping[int, float]

    def __post_init__(self) -> None:
        m = np.array(self.m, dtype=float)
        if m.shape != (23,):
            raise ValueError(f"m must hold 23 numbers, entry 0 unused, but its shape is {m.shape}")
        m.flags.writeable = False
        object.__setattr__(self, "m", m)
        for name, bonds in (("I", INERTIAS), ("R", RESISTANCES), ("C", COMPLIANCES)):
            given = getattr(self, name)
            if set(given) != set(bonds):
                raise ValueError(f"{name} must have exactly the bonds {sorted(bonds)}, but it has {sorted(given)}")
            object.__setattr__(self, name, MappingProxyType({bond: float(given[bond]) for bond in bonds}))

    @cached_property
    def matrices(self) -> tuple[Array, Array]:
        """The result of :func:`explicit_matrices`, cached."""
        return explicit_matrices(self)


def moduli_from_geometry(
    R_s: float, R_p: float, R_r: float, R_h: float, *,
    R_1: float, R_2: float, m_18: float = 1.0, m_19: float = 1.0, m_22: float = 1.0,
) -> Array:  # fmt: skip
    """Moduli for which the kinematics are exact with every rotation counted as an angular velocity.

    The paper prints no values. Without mesh deflections and without slip in the support dampers (f83 = f84 = f85 = 0) they yield
    Willis' equation R_r w_r + R_s w_s = 2 R_h w_h.

    Parameters
    ----------
    R_s, R_p, R_r, R_h : float
        Pitch radii of sun, planet and ring, and the carrier's radius (m).
    R_1, R_2 : float
        Pitch radii of the P unit's gear 1 and gear 2 (m).
    m_22 : float
        Ratio of the coupling that leads gear 2 back to the carrier's axis: f81 = -f78 / m22.
    m_18, m_19 : float
        Ratios between the sun, the shaft and gear 1.

    Returns
    -------
    array of 23
        m1 to m22 at their own indices.

    >>> float(round(moduli_from_geometry(0.0285, 0.0465, 0.1215, 0.075, R_1=0.0285, R_2=0.0465)[8], 6))
    1.612903
    """
    m = np.ones(23)
    m[1], m[3] = 1 / R_r, 1 / R_s
    m[[2, 4]] = R_p
    m[[8, 9, 12, 13, 16, 17]] = R_h / R_p
    m[[18, 19, 20, 21, 22]] = m_18, m_19, R_1, R_2, m_22
    m[0] = np.nan
    return m


def bond_parameters(
    *,
    R_s: float = 0.0285, R_p: float = 0.0465, R_r: float = 0.1215, R_h: float = 0.075,
    I_s: float = 0.0015, I_p: float = 0.0094, I_r: float = 0.1510, I_h: float = 0.0491, I_f: float = 0.0036,
    K_g: float = 1.8e8, C_g: float = 2000.0, C_v: float = 1800.0,
    R_1: float | None = None, R_2: float | None = None, I_1: float | None = None, I_2: float | None = None,
    I_62: float | None = None, I_66: float | None = None, m_18: float = 1.0, m_19: float = 1.0, m_22: float = 1.0,
) -> BondParameters:  # fmt: skip
    """Parameters of the bond graph from the symbols of Table 4.

    Parameters
    ----------
    R_s, R_p, R_r, R_h, I_s, I_p, I_r, I_h, I_f, K_g, C_g, C_v : float
        Symbols of Table 4, with its units and values.
    R_1, R_2, I_1, I_2 : float, optional
        Pitch radius (m) and moment of inertia (kg.m2) of the P unit's gears. Table 4 does not give them; by default gear 1 equals the
        sun and gear 2 a planet.
    I_62, I_66 : float, optional
        Moments of inertia of the shaft between the sun and the P unit, by default I_f each (kg.m2).
    m_18, m_19, m_22 : float
        Ratios of the shaft and of the coupling between gear 2 and the carrier.

    Returns
    -------
    BondParameters
        Support damping acts along the line of action: R83 = R84 = R85 = C_v R_p**2 and R82 = C_v R_h**2.

    >>> bond_parameters(I_r=0.2).I[2]
    0.2
    """
    R_1, R_2 = R_s if R_1 is None else R_1, R_p if R_2 is None else R_2
    I_1, I_2 = I_s if I_1 is None else I_1, I_p if I_2 is None else I_2
    I = dict.fromkeys((11, 35, 17, 41, 51, 22, 46, 56), I_p) | {2: I_r, 26: I_s, 69: I_1, 78: I_2, 81: I_h}
    I |= {62: I_f if I_62 is None else I_62, 66: I_f if I_66 is None else I_66}
    support = C_v * R_p**2
    R = dict.fromkeys((7, 31, 75), C_g) | {82: C_v * R_h**2, 83: support, 84: support, 85: support}
    m = moduli_from_geometry(R_s, R_p, R_r, R_h, R_1=R_1, R_2=R_2, m_18=m_18, m_19=m_19, m_22=m_22)
    return BondParameters(m, I, R, dict.fromkeys(COMPLIANCES, 1 / K_g))


def transmission_error_rate(t: Any, amplitude: float = 0.0027, omega: float = 28.0, phase: float = 21 * math.pi) -> Any:
    """Rate of the static transmission error, de/dt = amplitude cos(omega t + phase) in m/s, at times t (s).

    >>> round(float(transmission_error_rate(0.0)), 12)
    -0.0027
    """
    return amplitude * np.cos(omega * np.asarray(t) + phase)


def printed_rhs(x: Any, p: Any, dp: Any, u: Any, params: BondParameters, repairs: Repairs = ALL_REPAIRS) -> Array:
    """Right-hand sides of equations (2)-(9), term by term as printed.

    Parameters
    ----------
    x, u : arrays of 8 and 4
        :data:`STATES` (momenta in kg.m2/s, deflections in m) and :data:`SOURCES` (N.m, then m/s), in this order.
    p, dp : array of 10
        Momenta of the bonds :data:`DEPENDENT` and their derivatives, which the equations take as given.
    params, repairs : BondParameters, Repairs
        Moduli, inertias, resistances and compliances; departures from the printed text.

    Returns
    -------
    array of 8
        dx/dt.
    """
    _, m1, m2, m3, m4, m5, m6, _, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17, m18, m19, m20, m21, m22 = params.m
    I, R, C = params.I, params.R, params.C
    p2, q6, p11, p26, q30, p35, q74, p78 = x
    p17, p22, p41, p46, p51, p56, _, _, p69, p81 = p
    dp17, dp22, dp41, dp46, dp51, dp56, dp62, dp66, dp69, dp81 = dp
    Se1, Sf8, Sf32, Sf72 = u
    source_5 = Sf32 if repairs.sun_mesh_source else Sf8
    dp2 = Se1 - R[7] / (m1**2 * I[2]) * p2 - q6 / (m1 * C[6]) + m2 * R[7] / (m1 * I[11]) * p11 - R[7] / m1 * Sf8  # (2)
    dq6 = p2 / (m1 * I[2]) - m2 / I[11] * p11 + Sf8  # (3)
    dp11 = (
        m2 * R[7] / (m1 * I[2]) * p2 + m2 / C[6] * q6 - m2**2 * R[7] / I[11] * p11 + m5 * m6**2 * R[85] / I[17] * p17
        + m5 * m6 * m8 * R[85] / I[22] * p22 - (m5 * m6 * R[85] + m10 * m11 * R[84] + m14 * m15 * R[83]) / I[35] * p35
        + m10 * m11**2 * R[84] / I[41] * p41 + m10 * m11 * m12 * R[84] / I[46] * p46 + m14 * m15**2 * R[83] / I[51] * p51
        + m14 * m15 * m16 * R[83] / I[56] * p56 + m2 * R[7] * Sf8 + m5 * dp17 + m10 * dp41 + m14 * dp51
    )  # (4)  # fmt: skip
    dp26 = (
        -R[31] / (m3**2 * I[26]) * p26 - q30 / (m3 * C[30]) + m4 * R[31] / (m3 * I[35]) * p35
        - m18 * m19 * m20**2 * R[75] / I[69] * p69 + m18 * m19 * m20 / C[74] * q74
        - m18 * m19 * m20 * m21 * R[75] / I[78] * p78 - R[31] / m3 * source_5 + m18 * m19 * m20 * R[75] * Sf72
        - m18 * m19 * dp66 - m18 * m19 * dp69 - int(repairs.shaft_inertia) * m18 * dp62
    )  # (5)  # fmt: skip
    dq30 = p26 / (m3 * I[26]) - m4 / I[35] * p35 + Sf32  # (6)
    dp35 = (
        m6 * R[85] / I[17] * p17 + m4 / C[30] * q30 + m8 * R[85] / I[22] * p22 + m4 * R[31] / (m3 * I[26]) * p26
        - (m4**2 * R[31] + R[85] + R[84] + R[83]) / I[35] * p35 + m11 * R[84] / I[41] * p41 + m12 * R[84] / I[46] * p46
        + m15 * R[83] / I[51] * p51 + m16 * R[83] / I[56] * p56 + m4 * R[31] * Sf32
    )  # (7)  # fmt: skip
    dq74 = Sf72 - m20 / I[69] * p69 - m21 / I[78] * p78  # (8)
    dp78 = (
        m21 / C[74] * q74
        - (m8 * R[85] + m5 * m6 * m9 * R[85] + m12 * R[84] + m10 * m11 * m13 * R[84] + m16 * R[83] + m14 * m15 * m17 * R[83])
        / (m22 * I[35]) * p35
        - int(repairs.p69_term) * m20 * m21 * R[75] / I[69] * p69 - m21**2 * R[75] / I[78] * p78
        + (m15 * m16 * R[83] + m14 * m15**2 * m17 * R[83]) / (m22 * I[51]) * p51
        + (m16**2 * R[83] + m14 * m15 * m16 * m17 * R[83]) / (m22 * I[56]) * p56 + m14 * m17 / m22 * dp51
        + (m6 * m8 * R[85] + m5 * m6**2 * m9 * R[85]) / (m22 * I[17]) * p17
        + (m8**2 * R[85] + m5 * m6 * m8 * m9 * R[85]) / (m22 * I[22]) * p22
        + (m11 * m12 * R[84] + m10 * m11**2 * m13 * R[84]) / (m22 * I[41]) * p41
        + (m12**2 * R[84] + m10 * m11 * m12 * m13 * R[84]) / (m22 * I[46]) * p46
        + m5 * m9 / m22 * dp17 + 1 / m22 * dp22 + m10 * m13 / m22 * dp41 + 1 / m22 * dp46 + 1 / m22 * dp56 + 1 / m22 * dp81
        + R[82] / (m22 * I[81]) * p81 + m21 * R[75] * Sf72
    )  # (9)  # fmt: skip
    return np.array([dp2, dq6, dp11, dp26, dq30, dp35, dq74, dp78])


def flow_rows(params: BondParameters) -> dict[int, Array]:
    """Flow of every numbered bond as a row over (f2, f11, f26, f35, f78, Sf8, Sf32, Sf72).

    Rotations are in rad/s, mesh flows in m/s.
    """
    _, m1, m2, m3, m4, m5, m6, _, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17, m18, m19, m20, m21, m22 = params.m
    f2, f11, f26, f35, f78, Sf8, Sf32, Sf72 = np.eye(8)
    f81 = -f78 / m22
    f17, f41, f51 = m5 * (m9 * f81 - f11), m10 * (m13 * f81 - f11), m14 * (m17 * f81 - f11)
    f69 = m18 * m19 * f26
    f6, f30, f74 = f2 / m1 - m2 * f11 + Sf8, f26 / m3 - m4 * f35 + Sf32, Sf72 - m20 * f69 - m21 * f78
    return {
        1: f2, 2: f2, 6: f6, 7: f6, 8: Sf8, 11: f11, 17: f17, 22: f81, 26: f26, 30: f30, 31: f30, 32: Sf32, 35: f35,
        41: f41, 46: f81, 51: f51, 56: f81, 62: m18 * f26, 66: f69, 69: f69, 72: Sf72, 74: f74, 75: f74, 78: f78,
        81: f81, 82: f81, 83: m15 * f51 + m16 * f81 - f35, 84: m11 * f41 + m12 * f81 - f35, 85: m6 * f17 + m8 * f81 - f35,
    }  # fmt: skip


def flows(x: Any, params: BondParameters, u: Any = NO_SOURCES) -> dict[int, float]:
    """Flows of the numbered bonds in state x with sources u, by bond number.

    >>> params = bond_parameters()
    >>> f = flows([0, 0, 0, 0, 0, 0, 0, params.I[78]], params)
    >>> f[78], f[81]
    (1.0, -1.0)
    """
    x = np.asarray(x, dtype=float)
    v = x[[0, 2, 3, 5, 7]] / [params.I[bond] for bond in INDEPENDENT]
    known = np.concatenate([v, np.asarray(u, dtype=float)[1:]])
    return {bond: float(row @ known) for bond, row in flow_rows(params).items()}


def momentum_map(params: BondParameters) -> Array:
    """Matrix (10, 8) that maps the states to the momenta of :data:`DEPENDENT`."""
    rows, result = flow_rows(params), np.zeros((10, 8))
    for k, bond in enumerate(DEPENDENT):
        result[k, [0, 2, 3, 5, 7]] = params.I[bond] * rows[bond][:5] / [params.I[b] for b in INDEPENDENT]
    return result


def implicit_matrices(params: BondParameters, repairs: Repairs = ALL_REPAIRS) -> tuple[Array, Array, Array]:
    """E, A and B of E dx/dt = A x + B u: the printed equations, with all derivatives on the left; (8, 8), (8, 8), (8, 4)."""
    one_x, one_p, one_u = (np.eye(len(names)) for names in (STATES, DEPENDENT, SOURCES))
    x0, p0, u0 = (0 * one.diagonal() for one in (one_x, one_p, one_u))
    by_x = np.column_stack([printed_rhs(e, p0, p0, u0, params, repairs) for e in one_x])
    by_p = np.column_stack([printed_rhs(x0, e, p0, u0, params, repairs) for e in one_p])
    by_dp = np.column_stack([printed_rhs(x0, p0, e, u0, params, repairs) for e in one_p])
    by_u = np.column_stack([printed_rhs(x0, p0, p0, e, params, repairs) for e in one_u])
    dependent = momentum_map(params)
    return one_x - by_dp @ dependent, by_x + by_p @ dependent, by_u


def explicit_matrices(params: BondParameters, repairs: Repairs = ALL_REPAIRS) -> tuple[Array, Array]:
    """A (8, 8) and B (8, 4) of dx/dt = A x + B u, from the printed equations.

    >>> A, B = explicit_matrices(bond_parameters())
    >>> float(round(np.linalg.eigvals(A).real.max(), 2))
    -32.13
    """
    E, A, B = implicit_matrices(params, repairs)
    return np.asarray(np.linalg.solve(E, A), dtype=np.float64), np.asarray(np.linalg.solve(E, B), dtype=np.float64)


def explicit_rhs(t: float, x: Any, params: BondParameters, sources: Callable[[float], Any] | Any = NO_SOURCES) -> Array:
    """dx/dt at time t in state x, with all corrections.

    Parameters
    ----------
    t : float
        Time (s).
    x : array of 8
        States, in the order of :data:`STATES`.
    params : BondParameters
        Parameters, which cache the matrices.
    sources : callable or array of 4
        (Se1, Sf8, Sf32, Sf72), or a function of time that returns them.

    >>> explicit_rhs(0.0, np.zeros(8), bond_parameters(), (1.0, 0.0, 0.0, 0.0))[:2].tolist()
    [1.0, 0.0]
    """
    A, B = params.matrices
    u = np.asarray(sources(t) if callable(sources) else sources, dtype=float)
    result: Array = A @ np.asarray(x, dtype=float) + B @ u
    return result


def energy_rhs(x: Any, u: Any, params: BondParameters) -> Array:
    """dx/dt from energies and constraint forces, without the printed equations or :func:`flow_rows`.

    Each of the fifteen bodies has its own velocity v, with the kinetic energy sum(I v**2)/2. The teeth, shafts and pins that join them
    are constraints G v = 0, the elastic energy is sum(q**2/C)/2 and the dissipation sum(R f**2)/2 with f = S v + Sf. Lagrange's
    equations of the first kind, I dv/dt = Se - S' (q/C + R f) - G' z with G dv/dt = 0, are solved directly.

    The arguments and the result are those of :func:`printed_rhs`.
    """
    x, (Se1, *sources) = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    v = dict(zip(INERTIAS, np.eye(len(INERTIAS)), strict=True))  # of each body, as a row over all of them
    m = params.m
    G = np.array([
        v[62] - m[18] * v[26], v[66] - m[19] * v[62], v[69] - v[66],  # shaft from the sun to the P unit
        m[22] * v[81] + v[78],  # coupling of the P unit and the carrier
        v[22] - v[81], v[46] - v[81], v[56] - v[81],  # the carrier's pins
        v[17] / m[5] - m[9] * v[22] + v[11], v[41] / m[10] - m[13] * v[46] + v[11], v[51] / m[14] - m[17] * v[56] + v[11],
    ])  # fmt: skip
    meshes = np.array([v[2] / m[1] - m[2] * v[11], v[26] / m[3] - m[4] * v[35], -m[20] * v[69] - m[21] * v[78]])
    slips = np.array([
        v[81], m[15] * v[51] + m[16] * v[56] - v[35], m[11] * v[41] + m[12] * v[46] - v[35], m[6] * v[17] + m[8] * v[22] - v[35],
    ])  # fmt: skip
    I = np.array([params.I[bond] for bond in INERTIAS])
    free = [INERTIAS.index(bond) for bond in INDEPENDENT]
    speeds = np.zeros(len(I))
    speeds[free] = x[[0, 2, 3, 5, 7]] / I[free]
    bound = [k for k in range(len(I)) if k not in free]
    speeds[bound] = np.linalg.solve(G[:, bound], -G[:, free] @ speeds[free])
    rates = meshes @ speeds + sources
    efforts = x[[1, 4, 6]] / [params.C[bond] for bond in COMPLIANCES] + rates * [params.R[bond] for bond in (7, 31, 75)]
    losses = slips @ speeds * [params.R[bond] for bond in (82, 83, 84, 85)]
    forces = Se1 * v[2] - meshes.T @ efforts - slips.T @ losses
    still = np.zeros(len(G))
    lagrange = np.block([[np.diag(I), G.T], [G, np.diag(still)]])
    dp = dict(zip(INERTIAS, I * np.linalg.solve(lagrange, np.concatenate([forces, still]))[: len(I)], strict=True))
    return np.array([dp[2], rates[0], dp[11], dp[26], rates[1], dp[35], rates[2], dp[78]])
