"""What scenes and views are, as text: ``python -m tests.golden.record [name ...]`` writes it anew.

One file for each, so that ``git diff`` shows what a change of the engine changed: of a scene the states, ``summary()``, the generated
source and the values at five times; of a view (a picture, a plot, a printed table, a text of Modelica) what a reader sees. The text
depends on how SymPy prints and orders terms, so that the versions it was made with stand beside it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import gearlib as gl
from tests.golden.scenes import SCENES
from tests.golden.views import VIEWS

FOLDER = Path(__file__).parent
VERSIONS = FOLDER / "versions.txt"
SAMPLES = 5
MOST = 20  # variables of a scene whose values are recorded


@dataclass(frozen=True)
class Record:
    """Text and numbers of one scene; ``values`` maps the names of variables to their values at the sampled times."""

    states: list[str]
    summary: list[str]
    source: list[str]
    values: dict[str, NDArray[np.float64]]


def translate_and_run(name: str) -> Record:
    """The scene as it is translated and solved now, to a tolerance of 1e-10."""
    scene = SCENES[name]
    system = gl.compile(scene.make(), outputs=scene.outputs)
    result = system.simulate(scene.t_end, samples=SAMPLES, rtol=1e-10, **scene.options)
    names = list(dict.fromkeys([*(scene.outputs or ()), *system.states]))[:MOST]
    values = {n: result[n] for n in names}
    return Record(list(system.states), system.summary().splitlines(), system.source.splitlines(), values)


def path(name: str) -> Path:
    return FOLDER / f"{name}.txt"


def write(name: str, record: Record) -> None:
    rows = [f"{n} {' '.join(f'{v:.11e}' for v in values)}" for n, values in record.values.items()]
    parts = {"states": record.states, "summary": record.summary, "source": record.source, "values": rows}
    text = "\n".join("\n".join([f"==== {title}", *lines]) for title, lines in parts.items())
    path(name).write_text(text + "\n", encoding="utf-8")


def read(name: str) -> Record:
    parts: dict[str, list[str]] = {}
    for line in path(name).read_text(encoding="utf-8").splitlines():
        if line.startswith("==== "):
            lines = parts[line.removeprefix("==== ")] = []
        else:
            lines.append(line)
    # Names may hold blanks, as in "der(a b)": the numbers are the last words.
    rows = [line.rsplit(" ", SAMPLES) for line in parts["values"]]
    return Record(parts["states"], parts["summary"], parts["source"], {n: np.array(v, float) for n, *v in rows})


def view_path(name: str) -> Path:
    return FOLDER / "views" / f"{name}.txt"


def versions() -> str:
    """What the text depends on besides gearlib."""
    return "".join(f"{package} {version(package)}\n" for package in ("networkx", "sympy"))


if __name__ == "__main__":
    for chosen in sys.argv[1:] or [*SCENES, *VIEWS]:
        if chosen in SCENES:
            write(chosen, translate_and_run(chosen))
        else:
            view_path(chosen).write_text(VIEWS[chosen]().rstrip() + "\n", encoding="utf-8")
        print(chosen)
    VERSIONS.write_text(versions(), encoding="utf-8")
