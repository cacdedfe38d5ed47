"""Time and error of the three forms that IDA takes, by both backends; writes the table of `docs/solvers.md`.

    python -m tests.benchmarks.forms              # writes the page
    python -m tests.benchmarks.forms M1-100 M2    # prints the rows of these scenes only

Each run is repeated, the cases in turn, and the least processor time counts: other programs on the machine only add to it. The
largest chain runs once.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.run.request import BACKENDS, FORMS
from gearlib.solvers.problem import Floats
from tests.benchmarks.references import SCENES
from tests.measured import Part
from tests.run.test_forms import FourBar, four_bar

RTOL, REPEATED = 1e-10, 5
ONCE = "M1-1000"
Case = tuple[str, Callable[[], gl.System], Floats, Callable[[dict[str, Floats]], float], tuple[str, ...], int]


def cases(wanted: Sequence[str] = ()) -> list[Case]:
    """Title, system, output times, error of some histories, which, and how often a run is repeated."""
    found: list[Case] = []
    for name in wanted or ("M1-10", "M1-100", "M1-1000", "M2", "XP"):
        scene = SCENES[name]

        def error(histories: dict[str, Floats], scene: object = scene) -> float:
            return scene.error(np.column_stack([histories[n] for n in scene.outputs]))  # type: ignore[attr-defined]

        found.append(
            (
                scene.title, lambda s=scene: gl.compile(s.component(), outputs=s.outputs), scene.times, error, scene.outputs,
                1 if name == ONCE else REPEATED,
            )
        )  # fmt: skip
    if wanted:
        return found
    times = np.linspace(0.0, 2.0, 81)

    def four_bar_error(histories: dict[str, Floats]) -> float:
        pairs = zip(("a", "wa", "c"), four_bar(times), strict=True)
        return max(float(np.abs(histories[n] - e).max() / np.abs(e).max()) for n, e in pairs)

    start = {"a": 0.3, "wa": 0.0}
    found.append(
        (
            "four-bar linkage, 2 states",
            lambda: gl.compile(FourBar(start=start)),
            times,
            four_bar_error,
            ("a", "wa", "c"),
            REPEATED,
        )
    )
    return found


def measured(wanted: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Least times (ms) and errors of each scene and form."""
    rows = []
    for title, make, times, error, names, repeated in cases(wanted):
        system, least = make(), {}
        for repeat in range(repeated + 1):
            for form in FORMS:
                for backend in BACKENDS if repeat == 1 else BACKENDS[:1]:
                    begin = time.process_time()
                    result = system.simulate(times[-1], times=times, method="ida", rtol=RTOL, form=form, backend=backend)
                    taken = time.process_time() - begin
                    if repeat:
                        before = least.get((form, backend), (np.inf, None))
                        least[form, backend] = min(before, (taken, result), key=lambda pair: pair[0])
        for form in FORMS:
            (fast, result), (slow, _) = least[form, "native"], least[form, "sksundae"]
            counts = {key: int(result.stats[key]) for key in ("unknowns", "steps")}
            found = error({n: result[n] for n in names})
            rows.append({"scene": title, "form": form, **counts, "error": found, "native": 1e3 * fast, "sksundae": 1e3 * slow})
    return rows


def text(rows: list[dict[str, Any]]) -> str:
    """The table, and the factors below it."""
    lines = [
        "",
        "| scene | form | unknowns | steps | error | native, ms | scikit-sundae, ms |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['scene'] if r['form'] == 'ode' else ''} | {r['form']} | {r['unknowns']} | {r['steps']} | {r['error']:.1e} | "
        f"{r['native']:.0f} | {r['sksundae']:.0f} |"
        for r in rows
    ]
    by_form = {form: [r for r in rows if r["form"] == form] for form in FORMS}
    elimination = [dae["native"] / ode["native"] for dae, ode in zip(by_form["dae"], by_form["ode"], strict=True)]
    native = [r["sksundae"] / r["native"] for r in by_form["ode"]]
    lines += [
        "",
        f"Elimination is worth a factor of {min(elimination):.1f} to {max(elimination):.1f} (`dae` over `ode`, both native), and the "
        f"native backend one of {min(native):.0f} to {max(native):.0f} (`ode`, scikit-sundae over native). Processor times, native the "
        f"least of {REPEATED} (of the largest chain one), scikit-sundae of one; rtol = {RTOL:g}; the error is the largest over the "
        "signal's peak, against solutions that share no code with gearlib.",
        "",
    ]
    return "\n".join(lines)


TABLE = Part("forms", "solvers", text)
PARTS = [TABLE]


def main() -> None:
    """Write the table into the page, or print some rows of it."""
    if sys.argv[1:]:
        print(text(measured(sys.argv[1:])))
    else:
        TABLE.store(measured())
        print(TABLE.shown())


if __name__ == "__main__":
    main()
