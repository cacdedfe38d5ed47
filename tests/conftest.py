"""Settings of every test run: caches inside the checkout, figures without a screen, repeatable random models; processes that a test
starts import this checkout, whatever is installed.

Where the checkout belongs to another user, the caches are in a temporary folder, which the workers of a run share.
"""

from __future__ import annotations

import gc
import os
import signal
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path

from gearlib.compiler.ownership import why_foreign

_ROOT = Path(__file__).resolve().parents[1]
if "GEARLIB_TESTS" in os.environ:
    _CACHE = Path(os.environ["GEARLIB_TESTS"])
elif why_foreign(_ROOT) is None and os.access(_ROOT, os.W_OK):
    _CACHE = _ROOT / ".cache"
else:
    _TEMPORARY = tempfile.TemporaryDirectory(prefix="gearlib-tests-", ignore_cleanup_errors=True)
    _CACHE = Path(_TEMPORARY.name)
os.environ["GEARLIB_TESTS"] = str(_CACHE)
os.environ["GEARLIB_CACHE"] = str(_CACHE / "gearlib")
os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(_CACHE / "hypothesis")
os.environ["MPLBACKEND"] = "Agg"
_PATHS = [str(_ROOT), str(_ROOT / "library"), *filter(None, [os.environ.get("PYTHONPATH")])]
os.environ["PYTHONPATH"] = os.pathsep.join(_PATHS)

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402  (reads the variables above)

# The first example of a test may compile; no deadline can be right for it and for the others.
settings.register_profile(
    "gearlib", derandomize=True, deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("gearlib")

from tests.trains import chain, paper  # noqa: E402, F401  (fixtures of several folders)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected lasts as long as the run: a million objects, in which no garbage is looked for again and again.

    Nor is it looked for in what tests make after every 700 objects: that would take a fortieth of the run.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 10)
        gc.enable()


@pytest.fixture
def interruptible() -> Iterator[None]:
    """SIGINT as on a terminal; what is started in the background ignores it, and a callback of the garbage collector swallows it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    gc.disable()
    yield
    gc.enable()
    signal.signal(signal.SIGINT, before)
