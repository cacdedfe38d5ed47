"""Draws the picture of README.md: `python docs/images/draw.py` runs the example and takes its time histories."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

runpy.run_path(str(ROOT / "examples" / "xp_train.py"), run_name="__main__")
shutil.copy(ROOT / "examples" / "figures" / "time_histories.png", ROOT / "docs" / "images" / "xp_train.png")
