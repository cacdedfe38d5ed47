"""What holds for every block: documented, with units, balanced."""

from __future__ import annotations

import re
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.language.component import equations_of
from gearlib.language.declarations import declared_by
from tests.gearparts.bench import needed_values
from tests.gearparts.declared_numbers import misfits

BLOCKS = [getattr(gp.blocks, name) for name in gp.blocks.__all__]
MADE_OF_PARTS = {"TransferFunction", "StateSpace", "MultiStateSpace", "CombiTimeTable"}


def test_every_block_is_listed_once_and_found() -> None:
    assert len(BLOCKS) >= 30
    assert set(gp.blocks.__all__) <= set(dir(gp.blocks))
    with pytest.raises(AttributeError, match="no attribute 'Intgrator'"):
        gp.blocks.Intgrator  # noqa: B018


@pytest.mark.parametrize("kind", BLOCKS)
def test_blocks_are_documented_and_fit_their_units(kind: Any) -> None:
    assert re.search(r"``[^`]*[= ][^`]*``", kind.__doc__, re.DOTALL)
    for name, declared in kind._declarations.items():
        assert declared.description.strip(), name
    if kind.__name__ not in MADE_OF_PARTS:
        part = kind(**needed_values(kind, 1.0))
        assert gl.check_units(part) == []
        assert list(misfits(kind.__name__, declared_by(part))) == []
        known = declared_by(part)
        unknowns = [v for v in known.variables.values() if not isinstance(v, gl.Input)]
        actions = [e.actions if isinstance(e, gl.When) else (e,) for e in equations_of(part)]
        assert sum(map(len, actions)) == len(unknowns) + len(known.discretes)
