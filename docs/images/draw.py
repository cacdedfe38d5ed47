"""Draws the pictures that the pages take from the examples: `python docs/images/draw.py` runs these and reduces the colours.

Names of scripts draw their pictures only: `python docs/images/draw.py xp_train`. The diagram of the README is drawn each time.
"""

from __future__ import annotations

import os
import runpy
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "examples" / "figures"
TAKEN = {  # script: figure it writes -> picture of the pages
    "xp_train": {"time_histories": "xp_train"},
    "bond_graph_xp": {"structure_diagrams": "structure_diagrams"},
    "paper_section_4": {
        name: name for name in ("paper_fig_5", "paper_fig_6_describing_function", "paper_fig_7", "paper_fig_8")
    },
    "paper_gain_margin": {"paper_gain_margin": "paper_gain_margin"},
    "backlash_jump": {"backlash_jump": "backlash_jump"},
}

os.chdir(ROOT)
sys.path[:0] = [str(ROOT), str(ROOT / "library")]
import gearparts as gp  # noqa: E402
from tests.pictures import reduce  # noqa: E402

gp.ZhouCui2022().diagram(depth=2).save(ROOT / "docs" / "images" / "xp_diagram.svg")
for script, figures in ((name, TAKEN[name]) for name in sys.argv[1:] or TAKEN):
    runpy.run_path(f"examples/{script}.py", run_name="__main__")
    for figure, picture in figures.items():
        reduce(Image.open(FIGURES / f"{figure}.png"), ROOT / "docs" / "images" / f"{picture}.png")
