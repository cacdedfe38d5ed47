"""The differential campaign: `python -m tests.stress.campaign linear 1000` judges a thousand random trains, each within a time limit.

Prints every train that falls short, reduced to as few parts as still do, and counts at the end; ``all`` takes the families in turn, in
the `SHARES` of the campaign. ``--first`` sets the first seed, ``--seconds`` the limit of processor time, ``--keep`` leaves the trains
as they were drawn. ``--into LOG`` adds a line for each verdict to a file of JSON lines; a campaign that was interrupted goes on there,
since what the file holds is not judged again. ``again --into LOG`` judges the trains that fell short once more, after a mend (the last
verdict on a train counts), ``counts --into LOG`` puts the counts of a log into ``tests/measured`` and on docs/stability.md.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tests.measured import Part, table
from tests.stress.analyses_campaign import analysed_train, judge_analyses
from tests.stress.described import Train, shrunk
from tests.stress.hybrid_campaign import judge_hybrid
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.linear_campaign import judge_linear
from tests.stress.linear_draw import linear_train
from tests.stress.order import judge_order, ordered_train
from tests.stress.steady_campaign import judge_steady, steady_train
from tests.stress.verdicts import HANG, REFUSED, RIGHT, SHORT, UNCLEAR, Verdict

SHARES = {"linear": 10, "analyses": 6, "hybrid": 2, "order": 2, "steady": 1}  # of 21 trains of the whole campaign

FAMILIES: dict[str, tuple[Callable[[int], Train], Callable[[Train, int], Verdict]]] = {
    "linear": (linear_train, judge_linear),
    "hybrid": (hybrid_train, judge_hybrid),
    "analyses": (analysed_train, judge_analyses),
    "order": (ordered_train, judge_order),
    "steady": (steady_train, judge_steady),
}


def judge(family: str, seed: int, train: Train | None = None) -> Verdict:
    """The verdict on one train."""
    draw, judged = FAMILIES[family]
    return judged(draw(seed) if train is None else train, seed)


def _work(pipe: Connection, seconds: float) -> None:
    while True:
        family, seed, train = pipe.recv()
        # of processor time; the default action of SIGPROF ends the process, in generated code too
        signal.setitimer(signal.ITIMER_PROF, seconds)
        verdict = judge(family, seed, train)
        signal.setitimer(signal.ITIMER_PROF, 0)
        pipe.send(verdict)


class Worker:
    """A process that judges; one that exceeds its time is ended, and another takes over."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._begin()

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, self.seconds), daemon=True)
        self.process.start()
        theirs.close()

    def __call__(self, family: str, seed: int, train: Train | None = None) -> Verdict:
        self.pipe.send((family, seed, train))
        try:
            if self.pipe.poll(30 * self.seconds):  # what waits takes no processor time
                verdict: Verdict = self.pipe.recv()
                return verdict
        except EOFError:
            pass
        self.process.kill()
        self.process.join()
        ended = self.process.exitcode
        self._begin()
        late = ended in (-signal.SIGPROF, -signal.SIGKILL)
        return Verdict(HANG, f"no end within {self.seconds:g} s" if late else f"the process died ({ended})")


def fails_alike(worker: Worker, family: str, seed: int, first: Verdict, train: Train) -> bool:
    """Whether a train falls short in the same way; of refusals and exceptions, with the same beginning."""
    try:
        verdict = worker(family, seed, train)
    except Exception:
        return False
    return verdict.kind == first.kind and verdict.detail.split(":")[0] == first.detail.split(":")[0]


def seeds(family: str, first: int, count: int) -> Iterator[tuple[str, int]]:
    """Families and seeds of a campaign; of all families, in turn."""
    if family != "all":
        yield from ((family, seed) for seed in range(first, first + count))
        return
    turn = [name for name, share in SHARES.items() for _ in range(share)]
    for k in range(count):
        name = turn[k % len(turn)]
        yield name, first + k // len(turn) * SHARES[name] + turn[: k % len(turn)].count(name)


def campaign(family: str, first: int, count: int, seconds: float, keep: bool, log: Path | None) -> Counter[str]:
    """Judge trains and print those that fall short."""
    found: list[dict[str, Any]] = []
    known = {(line["family"], line["seed"]) for line in judged(log)} if log is not None else set()
    worker, begin = Worker(seconds), time.perf_counter()
    for name, seed in seeds(family, first, count):
        if (name, seed) in known:
            continue
        verdict = worker(name, seed)
        found.append(noted(log, name, seed, verdict))
        if verdict.short:
            print(f"\n{name} {seed}: {verdict.kind}: {verdict.detail}", flush=True)
            if not keep:
                train = FAMILIES[name][0](seed)
                small = shrunk(train, partial(fails_alike, worker, name, seed, verdict))
                print(f"{len(small.parts)} of {len(train.parts)} parts: {worker(name, seed, small).detail}")
                print("\n".join(f"    {part}" for part in small.parts), flush=True)
                print(f"    angles {small.angles}, speeds {small.speeds}", flush=True)
        elif len(found) % 500 == 499:
            print(f"{name} {seed}: {counted(found)['verdicts']}", file=sys.stderr, flush=True)
    worker.process.kill()
    for name, kinds in counted(found)["verdicts"].items():
        print(f"{name}: {kinds}")
    print(f"{len(found)} trains in {time.perf_counter() - begin:.0f} s")
    return Counter(line["kind"] for line in found)


def noted(log: Path | None, family: str, seed: int, verdict: Verdict) -> dict[str, Any]:
    """The line of a log that holds a verdict; written to the log, if there is one."""
    line: dict[str, Any] = {"family": family, "seed": seed, "kind": verdict.kind}
    if verdict.kind in (REFUSED, UNCLEAR):
        line["reason"] = verdict.reason
    if verdict.kind != RIGHT:
        line["detail"] = verdict.detail[:1000]
    if log is not None:
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    return line


def judged(log: Path) -> list[dict[str, Any]]:
    """The last verdict on each train of a log."""
    lines = map(json.loads, log.read_text(encoding="utf-8").splitlines()) if log.exists() else ()
    return list({(line["family"], line["seed"]): line for line in lines}.values())


def counted(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts of verdicts, and of the reasons for refusals and for leaving a train unjudged, by family; the trains that fall short."""
    whole: dict[str, Any] = {"verdicts": {}, REFUSED: {}, UNCLEAR: {}, "short": {}}
    for family in SHARES:
        own = [line for line in lines if line["family"] == family]
        if own:
            whole["verdicts"][family] = dict(Counter(line["kind"] for line in own).most_common())
            for kind in (REFUSED, UNCLEAR):
                reasons = Counter(line["reason"] for line in own if line["kind"] == kind)
                whole[kind][family] = dict(sorted(reasons.items()))
            whole["short"][family] = {str(line["seed"]): line["kind"] for line in own if line["kind"] in SHORT}
    return whole


def again(log: Path, seconds: float) -> int:
    """Judge once more the trains that fell short; how many still do."""
    worker, left = Worker(seconds), 0
    for line in judged(log):
        if line["kind"] in SHORT:
            family, seed = line["family"], line["seed"]
            verdict = worker(family, seed)
            noted(log, family, seed, verdict)
            left += verdict.short
            print(f"\n{family} {seed}: {verdict.kind}: {verdict.detail}", flush=True)
    worker.process.kill()
    return left


def tables(whole: dict[str, Any]) -> str:
    """The tables of docs/stability.md from the counts of a campaign."""
    columns, families = (RIGHT, REFUSED, UNCLEAR, *SHORT), whole["verdicts"]
    rows = [
        [name, str(sum(counts.values())), *(str(counts.get(kind, 0)) for kind in columns)] for name, counts in families.items()
    ]
    parts = [table(["family", "trains", *(kind.lower() for kind in columns)], rows)]
    for kind, title in ((REFUSED, "rightly refused because of"), (UNCLEAR, "not judged because of")):
        reasons = sorted({reason for counts in whole[kind].values() for reason in counts})
        if not reasons:
            continue
        parts.append(
            table([title, *families], [[r, *(str(whole[kind].get(name, {}).get(r, 0)) for name in families)] for r in reasons])
        )
    return "\n\n".join(parts)


COUNTS = Part("campaign", "stability", tables)
PARTS = [COUNTS]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=[*sorted(FAMILIES), "all", "again", "counts"])
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--into", type=Path)
    given = parser.parse_args()
    if given.family == "counts":
        COUNTS.store(counted(judged(given.into)))
        print(COUNTS.shown())
        return 0
    if given.family == "again":
        return min(again(given.into, given.seconds), 1)
    counts = campaign(given.family, given.first, given.count, given.seconds, given.keep, given.into)
    return int(any(kind in SHORT for kind in counts))


if __name__ == "__main__":
    sys.exit(main())
