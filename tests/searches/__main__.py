"""Run searches: draw their cases on all cores, print figures, and how to repeat what failed."""

import argparse
import itertools
import os
import secrets
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

from threadpoolctl import threadpool_limits

from tests.searches import SEARCHES, Search, search_of
from tests.tools.kept_values import FOLDER

CHANCE = 1e-3
"""Of refusing sound code, for each limit of a search with fresh draws."""

FRESH = 2**40
"""Fresh numbers are below it."""


@dataclass(slots=True)
class Cases:
    """What is drawn of a search, and what has been."""

    numbers: Iterator[int]
    running: int = 0
    processor_s: float = 0.0
    figures: dict[int, Any] = field(default_factory=dict)
    faults: list[tuple[int, str]] = field(default_factory=list)
    ended: bool = False


def drawn(name: str, number: int) -> tuple[Sequence[str], Any, float]:
    """Return faults and figures of a case, None where it failed, and the processor time it took."""
    before = sum(os.times()[:4])
    try:
        faults, figures = search_of(name).draw(number)
    except Exception:
        faults, figures = [traceback.format_exc()], None
    return faults, figures, sum(os.times()[:4]) - before


def run(all_cases: Mapping[str, Cases], processes: int | None, until: float) -> Iterator[str]:
    """Draw cases, of the search first that has had the least time; yield the searches that ended.

    No case begins after `until`, of `time.monotonic`.
    """
    running: dict[Future[Any], tuple[str, int]] = {}
    with ProcessPoolExecutor(processes, initializer=threadpool_limits, initargs=(1,)) as pool:
        try:
            while True:
                while len(running) < (processes or os.cpu_count() or 1):
                    left = [name for name, cases in all_cases.items() if not cases.ended]
                    if not left:
                        break
                    name = min(left, key=lambda name: _had(all_cases[name]))
                    cases = all_cases[name]
                    number = next(cases.numbers, None) if time.monotonic() < until else None
                    if number is None:
                        cases.ended = True
                        if not cases.running:
                            yield name
                        continue
                    running[pool.submit(drawn, name, number)] = name, number
                    cases.running += 1
                if not running:
                    return
                for done in wait(running, return_when=FIRST_COMPLETED).done:
                    name, number = running.pop(done)
                    faults, figures, processor_s = done.result()
                    cases = all_cases[name]
                    cases.running -= 1
                    cases.processor_s += processor_s
                    cases.faults += [(number, fault) for fault in faults]
                    if figures is not None:
                        cases.figures[number] = figures
                    if sys.stderr.isatty():
                        drawn_s = sum(cases.processor_s for cases in all_cases.values())
                        print(f"\r{name} {number}; {drawn_s:.0f} s", end="\r", file=sys.stderr)
                    if cases.ended and not cases.running:
                        yield name
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _had(cases: Cases) -> tuple[float, int]:
    return cases.processor_s, cases.running + len(cases.figures)


def judged(name: str, search: Search[Any], cases: Cases, first: int, chance: float) -> bool:
    """Print what came of a search; return whether all is well."""
    figures = dict(sorted(cases.figures.items()))
    count = len(figures)
    print(f"--- {name}: {count} cases from {first} on, {cases.processor_s:.0f} s of processor time")
    together = search.judge(figures, chance) if figures else []
    for number, fault in sorted(cases.faults):
        print(f"FAULT {name} {number}: {fault}")
        print(f"again: python -m tests.searches {name} --first {number} --draws 1")
    for fault in together:
        print(f"FAULT {name}: {fault}")
        print(f"again: python -m tests.searches {name} --first {first} --draws {count}")
    sys.stdout.flush()
    return not cases.faults and not together


def main() -> bool:
    """Run the searches that are named; return whether all is well."""
    parser = argparse.ArgumentParser(prog="python -m tests.searches", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", default=SEARCHES)
    parser.add_argument("--draws", type=int, help="cases of each (default: as in CI)")
    parser.add_argument("--first", type=int, help="number of the first case (default: 0)")
    parser.add_argument("--minutes", type=float, help="draw fresh cases for so long")
    parser.add_argument("--processes", type=int, help="cases at a time (default: one a core)")
    given = parser.parse_args()
    fresh = given.minutes is not None
    first = given.first if given.first is not None else secrets.randbelow(FRESH) if fresh else 0
    until = time.monotonic() + 60.0 * given.minutes if fresh else float("inf")
    try:
        searches = {name: search_of(name) for name in given.names}
    except ValueError as error:
        parser.error(str(error))
    all_cases = {}
    for name, search in searches.items():
        draws = given.draws or search.draws
        endless = fresh and not given.draws
        numbers = itertools.count(first) if endless else iter(range(first, first + draws))
        all_cases[name] = Cases(numbers)
    chance = CHANCE if fresh else 0.0
    with tempfile.TemporaryDirectory() as folder:
        os.environ[FOLDER] = folder
        sound = [
            judged(name, searches[name], all_cases[name], first, chance)
            for name in run(all_cases, given.processes, until)
        ]
    print(f"{len(sound)} searches, {sound.count(False)} with faults")
    return all(sound)


if __name__ == "__main__":
    sys.exit(not main())
