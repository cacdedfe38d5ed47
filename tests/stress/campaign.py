"""The differential campaign: `python -m tests.stress.campaign linear 1000` judges a thousand random trains, each within a time limit.

Prints every train that falls short, reduced to as few parts as still do, and counts at the end. ``--first`` sets the first seed,
``--seconds`` the limit of processor time, ``--keep`` leaves the trains as they were drawn, ``--into`` adds the counts, and the seeds
that fell short, to a JSON file. ``again --into FILE`` judges these seeds once more, after a mend, and ``page --into FILE`` puts the
counts of such a file on docs/stability.md.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tests.stress.analyses_campaign import analysed_train, judge_analyses
from tests.stress.described import Train, shrunk
from tests.stress.hybrid_campaign import judge_hybrid
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.linear_campaign import judge_linear
from tests.stress.linear_draw import linear_train
from tests.stress.order import judge_order, ordered_train
from tests.stress.verdicts import HANG, REFUSED, RIGHT, SHORT, UNCLEAR, Verdict

FAMILIES: dict[str, tuple[Callable[[int], Train], Callable[[Train, int], Verdict]]] = {
    "linear": (linear_train, judge_linear),
    "hybrid": (hybrid_train, judge_hybrid),
    "analyses": (analysed_train, judge_analyses),
    "order": (ordered_train, judge_order),
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


def campaign(family: str, first: int, count: int, seconds: float, keep: bool, into: Path | None) -> Counter[str]:
    """Judge trains and print those that fall short."""
    counts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    fallen: dict[str, str] = {}
    worker, begin = Worker(seconds), time.perf_counter()
    for seed in range(first, first + count):
        verdict = worker(family, seed)
        counts[verdict.kind] += 1
        if verdict.kind == REFUSED:
            reasons[verdict.reason] += 1
        if verdict.short:
            fallen[str(seed)] = verdict.kind
            print(f"\n{family} {seed}: {verdict.kind}: {verdict.detail}", flush=True)
            if not keep:
                train = FAMILIES[family][0](seed)
                small = shrunk(train, partial(fails_alike, worker, family, seed, verdict))
                print(f"{len(small.parts)} of {len(train.parts)} parts: {worker(family, seed, small).detail}")
                print("\n".join(f"    {part}" for part in small.parts), flush=True)
                print(f"    angles {small.angles}, speeds {small.speeds}", flush=True)
        elif (seed - first) % 500 == 499:
            print(f"{family} {seed}: {dict(counts)}", file=sys.stderr, flush=True)
    worker.process.kill()
    print(f"\n{family}: {dict(counts)} in {time.perf_counter() - begin:.0f} s")
    if into is not None:
        whole = kept(into)
        for title, found in (("verdicts", counts), ("refusals", reasons)):
            whole[title][family] = dict(Counter(whole[title].get(family, {})) + found)
        whole["short"].setdefault(family, {}).update(fallen)
        into.write_text(json.dumps(whole, indent=1))
    return counts


def kept(counted: Path) -> dict[str, Any]:
    """Counts of verdicts and of reasons for refusals, and the seeds that fell short, by family."""
    empty: dict[str, Any] = {"verdicts": {}, "refusals": {}, "short": {}}
    return {**empty, **(json.loads(counted.read_text()) if counted.exists() else {})}


def again(counted: Path, seconds: float) -> int:
    """Judge once more the seeds that fell short, and count them as they are judged now; how many still fall short."""
    whole, worker = kept(counted), Worker(seconds)
    for family, fallen in whole["short"].items():
        verdicts, reasons = Counter(whole["verdicts"][family]), Counter(whole["refusals"].get(family, {}))
        for seed, before in list(fallen.items()):
            verdict = worker(family, int(seed))
            verdicts[before] -= 1
            verdicts[verdict.kind] += 1
            reasons[verdict.reason] += verdict.kind == REFUSED
            del fallen[seed]
            if verdict.short:
                fallen[seed] = verdict.kind
                print(f"\n{family} {seed}: {verdict.kind}: {verdict.detail}", flush=True)
        whole["verdicts"][family], whole["refusals"][family] = dict(+verdicts), dict(+reasons)
    worker.process.kill()
    counted.write_text(json.dumps(whole, indent=1))
    return sum(map(len, whole["short"].values()))


def page(counted: Path) -> None:
    """The tables of docs/stability.md from a file of counts."""
    from tests.stress.draw import fill, table

    columns = (RIGHT, REFUSED, UNCLEAR, *SHORT)
    whole = json.loads(counted.read_text())
    families = whole["verdicts"]
    rows = [
        [name, str(sum(counts.values())), *(str(counts.get(kind, 0)) for kind in columns)] for name, counts in families.items()
    ]
    reasons = sorted({reason for counts in whole["refusals"].values() for reason in counts})
    why = [[r, *(str(whole["refusals"][name].get(r, 0)) for name in families)] for r in reasons]
    fill(
        "campaign",
        table(["family", "trains", *(kind.lower() for kind in columns)], rows)
        + "\n\n"
        + table(["rightly refused because of", *families], why),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=[*sorted(FAMILIES), "again", "page"])
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--into", type=Path)
    given = parser.parse_args()
    if given.family == "page":
        page(given.into)
        return 0
    if given.family == "again":
        return min(again(given.into, given.seconds), 1)
    counts = campaign(given.family, given.first, given.count, given.seconds, given.keep, given.into)
    return int(any(Verdict(kind).short for kind in counts)) if counts[RIGHT] else 1


if __name__ == "__main__":
    sys.exit(main())
