"""What `Sampled` takes and refuses, and the signals that it joins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.errors import ArgumentError, BindingError
from gearlib.language.component import equations_of
from gearlib.language.interior import connections_of, parts_of

w, u, v = sympy.symbols("load.w a.u b.u", real=True)


def law(t: float, values: Any) -> Any:
    return values


def test_it_has_a_part_for_each_signal() -> None:
    made = gl.Sampled(law, 1, inputs=(w, v), outputs=[u], offset=2)
    assert (made.function, made.period, made.offset, made.counts) == (law, 1.0, 2.0, (2, 1))
    assert type(made.period) is type(made.offset) is float
    assert connections_of(made) == []
    assert list(parts_of(made)) == ["inputs[0]", "inputs[1]", "outputs[0]"]
    for part in parts_of(made).values():
        assert [(str(e.left), str(e.right)) for e in equations_of(part) if isinstance(e, gl.Eq)] == [("y", "u")]
    assert gl.Sampled(law, 0.1, outputs=[u]).counts == (0, 1)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: gl.Sampled(3, 0.1, outputs=[u]), BindingError, "^Sampled: function is 3; expected a function of the time"),  # type: ignore[arg-type]
        (lambda: gl.Sampled(law, 0.0, outputs=[u]), BindingError, r"^Sampled: period is 0\.0; expected a positive number of seconds"),
        (lambda: gl.Sampled(law, -1.0, outputs=[u]), BindingError, r"^Sampled: period is -1\.0; expected a positive"),
        (lambda: gl.Sampled(law, "1", outputs=[u]), ArgumentError, "^Sampled: period is '1'; expected a positive"),  # type: ignore[arg-type]
        (lambda: gl.Sampled(law, 1.0, outputs=[u], offset=None), ArgumentError, "^Sampled: offset is None"),  # type: ignore[arg-type]
        (lambda: gl.Sampled(law, 0.1, inputs="w", outputs=[u]), BindingError, "^Sampled: inputs is 'w'; expected a list of signals"),
        (lambda: gl.Sampled(law, 0.1, inputs=[w, "w"], outputs=[u]), BindingError, r"^Sampled: inputs is \[load\.w, 'w'\]"),
        (lambda: gl.Sampled(law, 0.1, outputs=u), BindingError, r"^Sampled: outputs is a\.u; expected a list of signals"),
        (lambda: gl.Sampled(law, 0.1, outputs=[2 * u]), BindingError, r"^Sampled: outputs is \[2\*a\.u\]"),
        (lambda: gl.Sampled(law, 0.1, inputs=[w]), BindingError, "^Sampled: outputs is empty; expected the inputs that it drives"),
    ],
)  # fmt: skip
def test_what_it_does_not_take(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()
