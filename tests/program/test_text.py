"""The text of an equation, with names filled in, has the value that the arrays give."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearlib.program.interpret import batch_values
from gearlib.program.text import expression, unsigned
from tests.program.programs import KINDS, point

FUNCTIONS: dict[str, Any] = {name: getattr(math, name) for name in dir(math) if not name.startswith("_")}


@pytest.mark.parametrize("kind", KINDS)
def test_text_is_the_value(kind: str) -> None:
    """Placeholders stand for arguments, parameters and relations by their places in the batch; signs of arguments are written."""
    p, negative = point(kind), 0
    for batch in p.batches:
        expected = np.broadcast_to(batch_values(batch, p.t, p.slots, p.numbers.parameters, p.flags), (len(batch), 2))
        for row in range(len(batch)):
            operands = (
                lambda a, b=batch, i=row: f"x[{b.arguments[i, a]}]", lambda a, b=batch, i=row: f"p[{b.parameters[i, a]}]",
                lambda a, b=batch, i=row: f"r[{b.relations[i, a]}]",
            )  # fmt: skip
            text, plain = (write(batch, row, *operands) for write in (expression, unsigned))
            for k in range(2):
                scope = FUNCTIONS | {"t": p.t[k], "x": p.slots[:, k], "p": p.numbers.parameters, "r": p.flags[:, k]}
                assert float(eval(text, scope)) == pytest.approx(expected[row, k], rel=1e-12, abs=1e-12), text
                assert float(eval(plain, scope)) == pytest.approx(batch.signs[row] * expected[row, k], rel=1e-12, abs=1e-12)
            negative += int(batch.signs[row] < 0)
    assert negative or kind != "bound"


def test_an_argument_without_a_variable_is_zero_and_a_negative_one_in_brackets() -> None:
    from dataclasses import replace

    batch = next(b for b in point("bound").batches if b.arguments.shape[1] == 2 and not b.relations.shape[1])
    table = (lambda a: f"x{a}_", lambda a: f"p{a}_", lambda a: f"r{a}_")
    texts = {}
    for sign in (1, -1, 0):
        signs = batch.argument_signs.copy()
        signs[0] = (sign, 1)
        texts[sign] = unsigned(replace(batch, argument_signs=signs), 0, *table)
    assert "x0_" in texts[1]
    assert texts[-1] == texts[1].replace("x0_", "(-x0_)")
    assert texts[0] == texts[1].replace("x0_", "0.0")
