"""Components that are assembled while the process forks."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

FORKED_WHILE_A_THREAD_ASSEMBLES = """
import os
import threading
import warnings

from gearlib.language.interior import ASSEMBLING

warnings.simplefilter("ignore")  # a fork beside threads, which is what is tried
held, done = threading.Event(), threading.Event()

def assembles():
    with ASSEMBLING:
        held.set()
        done.wait(1.0)

threading.Thread(target=assembles).start()
held.wait()
child = os.fork()
if child == 0:
    os._exit(0 if ASSEMBLING.acquire(timeout=5.0) else 3)
done.set()
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_child_forked_while_a_thread_assembles_can_assemble() -> None:
    """The lock is free in it, though the thread that held it does not go on there."""
    found = subprocess.run(
        [sys.executable, "-c", FORKED_WHILE_A_THREAD_ASSEMBLES], capture_output=True, text=True, timeout=60, check=True
    )
    assert found.stdout.split() == ["0"]
