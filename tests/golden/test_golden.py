"""What thirty scenes are translated into and what they give is what is recorded beside this file.

A difference is not a fault in itself, but has to be meant: ``python -m tests.golden.record`` writes the files anew, and ``git diff``
shows what changed. Numbers are compared with a tolerance. That they are right is shown elsewhere, against references.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.golden.record import FOLDER, VERSIONS, read, translate_and_run, versions
from tests.golden.scenes import SCENES

HINT = "differs; where that is meant: python -m tests.golden.record"


@pytest.mark.parametrize("name", SCENES)
def test_scene_is_translated_and_solved_as_recorded(name: str) -> None:
    found, recorded = translate_and_run(name), read(name)
    assert found.states == recorded.states, f"states: {HINT}"
    if VERSIONS.read_text(encoding="utf-8") == versions():  # another SymPy may order the terms of a sum otherwise
        assert found.summary == recorded.summary, f"summary: {HINT}"
        assert found.source == recorded.source, f"source: {HINT}"
    assert found.values.keys() == recorded.values.keys()
    for variable, values in recorded.values.items():
        scale = max(np.abs(values).max(), 1e-9)
        assert found.values[variable] == pytest.approx(values, rel=0, abs=1e-7 * scale), f"{variable}: {HINT}"


def test_every_file_belongs_to_a_scene_and_together_they_are_small() -> None:
    files = set(FOLDER.glob("*.txt")) - {VERSIONS}
    assert {file.stem for file in files} == set(SCENES)
    assert sum(file.stat().st_size for file in files) < 300_000
