"""The functions of a scene, each with the numbers of its program."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gearlib.native.scene_functions import NativeScene


@pytest.mark.parametrize("jac", ["jac", None])
@pytest.mark.parametrize("roots", ["roots", None])
@pytest.mark.parametrize("update", ["update", None])
@pytest.mark.parametrize("relations", ["relations", None])
def test_functions_come_with_their_numbers(jac: Any, roots: Any, update: Any, relations: Any) -> None:
    """Those of events with the numbers of the relations, where there are some."""
    scene: Any = SimpleNamespace(rhs="rhs", jac=jac, roots=roots, update=update)
    expected = [("rhs", "numbers")] + [("jac", "numbers")] * (jac is not None)
    if relations is not None:
        expected += [(part, "relations") for part in (roots, update) if part is not None]
    numbers: Any = "numbers"
    assert [*NativeScene.parts(scene, numbers, relations)] == expected
