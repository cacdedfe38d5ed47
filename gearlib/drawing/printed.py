"""Formatting of text for terminals: wrapping of long lines, shortening of long names."""

from __future__ import annotations

import re
import textwrap

COLUMNS = 100  # of a terminal
LABEL = re.compile(r"\s*\S+(?: \S+)*?\s{2,}(?=\S)")  # a label before the text of its line


def fitted(text: str, columns: int = COLUMNS) -> str:
    """Wrap text to a number of columns; continuation lines are aligned with the text of their line.

    A word that is too long for a line is shortened in the middle.

    >>> print(fitted("  inputs      0 unless a run is given them: motor.tau, load.tau", 40))
      inputs      0 unless a run is given
                  them: motor.tau,
                  load.tau
    """
    return "\n".join(_wrapped(line, columns) for line in text.split("\n"))


def _wrapped(line: str, columns: int) -> str:
    if len(line) <= columns:
        return line
    label = LABEL.match(line)
    hanging = label.end() if label and label.end() <= columns // 2 else 0
    start = len(line) - len(line.lstrip())
    indent = hanging or min(start + 2, columns // 2)
    cut = max(line.rfind(" ", 0, columns + 1), 0)
    if not line[:cut].strip() or cut <= indent:  # a single overlong word: the columns before it are kept
        cut = hanging or start
    first, words = line[:cut].rstrip(), [shortened(word, columns - indent) for word in line[cut:].split()]
    margin = " " * indent
    rest = textwrap.wrap(
        " ".join(words),
        columns,
        initial_indent=margin,
        subsequent_indent=margin,
        break_long_words=False,
        break_on_hyphens=False,
    )
    if len(first) <= indent and rest:
        return "\n".join([first.ljust(indent) + rest[0][indent:], *rest[1:]])
    return "\n".join([first, *rest])


def shortened(name: str, columns: int) -> str:
    """Shorten a name to a number of columns by omitting the middle of the path.

    >>> shortened("train.x_unit.planet[0].kinematics.ring_side", 30)
    'train.x_unit....tics.ring_side'
    """
    if len(name) <= columns:
        return name
    end = (columns - 3 + 1) // 2
    return f"{name[: columns - 3 - end]}...{name[-end:]}"
