"""The order of the gallery: the first train, drivetrains, vibration, control, parts and methods of one's own, measurements and design."""

from __future__ import annotations

ORDER = (
    "xp_train", "xp_weakly_nonlinear", "paper_section_4", "paper_gain_margin", "bond_graph_xp", "bond_graph_classics",
    "ev_driveline", "power_split_hybrid", "eight_speeds", "dual_clutch", "clutch_sizing", "engine_map", "wind_turbine",
    "marine_shafting", "rolling_mill",
    "crank_damper", "gear_whine", "rattle", "planet_load_sharing", "backlash_jump", "xp_parametric_resonance",
    "servo_axis", "sampled_control",
    "own_stiffness_law", "own_event", "own_method",
    "fit_shaft", "uncertainty", "synthesis", "fmu_round_trip", "modelica_text",
)  # fmt: skip
"""Names of the scripts; others come last, by name."""


class ReaderOrder:
    """Key by which sphinx-gallery sorts the scripts of a folder."""

    def __init__(self, source: str) -> None:
        self.source = source

    def __call__(self, name: str) -> tuple[int, str]:
        stem = name.removesuffix(".py")
        return ORDER.index(stem) if stem in ORDER else len(ORDER), stem
