"""Draws the picture of README.md: `python docs/images/draw.py` runs the example and takes its time histories."""

from __future__ import annotations

import os
import runpy
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

os.chdir(ROOT)
runpy.run_path("examples/xp_train.py", run_name="__main__")
shutil.copy("examples/figures/time_histories.png", "docs/images/xp_train.png")
