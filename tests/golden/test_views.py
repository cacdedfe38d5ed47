"""Pictures, plots, tables and texts show what is recorded in ``views``: a change of what a reader sees has to be meant.

Numbers may differ by one in their last place. That a view is right is shown elsewhere (folders ``drawing``, ``feedback``, ...), by what
lies where and by closed forms; ``python -m tests.golden.record [name]`` writes it anew, to be looked at before it is kept.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.golden import told
from tests.golden.record import FOLDER, VERSIONS, versions, view_path
from tests.golden.views import VIEWS


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.mark.parametrize("name", VIEWS)
def test_a_view_shows_what_is_recorded(name: str) -> None:
    if name.startswith("modelica") and VERSIONS.read_text(encoding="utf-8") != versions():
        pytest.skip("another SymPy may order the terms of a sum otherwise")
    apart = told.differences(VIEWS[name]().rstrip(), view_path(name).read_text(encoding="utf-8"))
    assert not apart, "\n".join([f"differs; where that is meant: python -m tests.golden.record {name}", *apart[:10]])


def test_every_file_belongs_to_a_view_and_together_they_are_small() -> None:
    files = list((FOLDER / "views").glob("*.txt"))
    assert {file.stem for file in files} == set(VIEWS)
    assert sum(file.stat().st_size for file in files) < 240_000


@pytest.mark.parametrize(
    ("found", "recorded", "same"),
    [
        ("at 1.25, -3", "at 1.25, -3", True), ("at 1.25", "at 1.26", True), ("at 1.25", "at 1.27", False), ("n 3", "n 4", False),
        ("1.5e-07", "1.6e-07", True), ("1.5e-07", "1.5e-06", False), ("-0.01", "0.00", True),
        ("a 1.0", "b 1.0", False), ("x1.5", "x1.6", False), ("one\ntwo", "one", False), ("one", "one\ntwo", False),
    ],
)  # fmt: skip
def test_views_differ_where_a_reader_sees_it(found: str, recorded: str, same: bool) -> None:
    """By more than one in a number's last place, by a word, by a line; a whole number differs at once."""
    assert (not told.differences(found, recorded)) == same
