"""Settings of every test run: caches inside the checkout, figures without a screen, repeatable random models."""

from __future__ import annotations

import os
from pathlib import Path

_CACHE = Path(__file__).resolve().parents[1] / ".cache"
os.environ["GEARLIB_CACHE"] = str(_CACHE / "gearlib")
os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(_CACHE / "hypothesis")
os.environ["MPLBACKEND"] = "Agg"

from hypothesis import HealthCheck, settings  # noqa: E402  (reads the variables above)

# The first example of a test may compile; no deadline can be right for it and for the others.
settings.register_profile(
    "gearlib", derandomize=True, deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("gearlib")
