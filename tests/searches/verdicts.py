"""Search for verdicts that flights of other seeds contradict.

Scenarios of all kinds are drawn, all keys independently, and planned. A plan that is GO without a
warning, or stopped by what flights lose, is flown 200 times with another seed. It is bad where one
of three shares of the flights is over 12 %, and good where all are under 3 %: flights with a filter
lost, with a vehicle out of contact for two periods, and with vehicles nearer than the separation
asked for. Fails where more than 2 % of the plans that are GO are bad, or more than 5 % of those
stopped are good.

    python -m tests.searches.verdicts results.jsonl --go 200 --stopped 60
    python -m tests.searches.verdicts --scenario 17

The first goes on, from the results there are, until so many plans of both kinds have been flown,
and prints the table; the second prints the scenario of a draw.
"""

import argparse
import itertools
import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syncplan.errors import InputError, NoSolutionError
from syncplan.flight.flying import fly
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import share_interval
from tests.searches import Search, most_of
from tests.searches.key_draws import draw_scenario

TRIALS, SEED = 200, 20_260

GOOD, BAD = 0.03, 0.12
"""Shares of flights."""

MOST_BAD, MOST_GOOD = 0.02, 0.05
"""Shares of the plans that are GO, and of those stopped."""

OF_SHARES = {"lost-in-flight", "too-close-in-flight"}
"""Codes of the findings that stop a plan for one of the three shares."""

GO, WARNED, STOPPED, OTHER, UNPLANNED = "GO", "GO with warning", "stopped", "other stop", "no plan"


@dataclass(frozen=True, slots=True)
class Judged:
    """A plan's verdict, and its flights with another seed.

    Attributes
    ----------
    verdict : GO, WARNED, STOPPED by what flights lose, OTHER or UNPLANNED
    codes : of the plan's stops, or of its warnings where it has none
    filter : that flew
    lost, away, close : shares of flights; None where not flown
    """

    verdict: str
    codes: tuple[str, ...] = ()
    filter: str | None = None
    lost: float | None = None
    away: float | None = None
    close: float | None = None

    @property
    def worst(self) -> float:
        """Largest of the shares."""
        return max(share or 0.0 for share in (self.lost, self.away, self.close))

    @property
    def bad(self) -> bool:
        """Whether a share is too large."""
        return self.worst > BAD

    @property
    def good(self) -> bool:
        """Whether all shares are small."""
        return self.worst < GOOD


def scenario_of_draw(number: int) -> dict[str, Any]:
    """Return the scenario of a number."""
    return draw_scenario(np.random.default_rng([0, number, 31_200]))


def draw(number: int) -> tuple[list[str], Judged]:
    """Return a plan's verdict and its flights."""
    try:
        planned = plan(scenario_of_draw(number))
    except (InputError, NoSolutionError):
        return [], Judged(UNPLANNED)
    return [], judged(planned)


def judged(planned: Plan) -> Judged:
    """Return the verdict of a plan, and its flights where they can contradict it."""
    verdict = planned.verdict
    stops = {finding.code for finding in verdict.findings if finding.level == "stop"}
    warnings = {finding.code for finding in verdict.findings if finding.level == "warning"}
    name = STOPPED if stops & OF_SHARES else OTHER
    if verdict.go:
        name = WARNED if warnings else GO
    codes = tuple(sorted(stops or warnings))
    if name not in (GO, STOPPED):
        return Judged(name, codes)
    try:
        record = fly(planned, trials=TRIALS, seed=SEED, threads=1).record
    except NoSolutionError:
        return Judged(name, codes, lost=1.0)
    shares = record.filter_lost_share, record.out_of_contact_share, record.too_close_share
    return Judged(name, codes, record.filter, *shares)


def judge(cases: Mapping[int, Judged], chance: float) -> list[str]:
    """Print the table; return whether flights contradict too many verdicts."""
    print("verdicts:", dict(Counter(case.verdict for case in cases.values())))
    print("verdict  flown  contradicted             share  95 % limits")
    faults = []
    for verdict, flown_as, most in ((GO, "bad", MOST_BAD), (STOPPED, "good", MOST_GOOD)):
        flown = {number: case for number, case in cases.items() if case.verdict == verdict}
        wrong = [number for number, case in flown.items() if getattr(case, flown_as)]
        if not flown:
            continue
        share, (low, high) = len(wrong) / len(flown), share_interval(len(wrong), len(flown))
        print(
            f"{verdict:7s}  {len(flown):5d}  {len(wrong):5d} {flown_as} in flight"
            f"  {share:8.1%}  {low:.1%} to {high:.1%}"
        )
        for number in wrong:
            print(f"  {number}: {flown[number]}")
        if len(wrong) > most_of(len(flown), most, chance):
            faults.append(f"of {len(flown)} {verdict} plans, {len(wrong)} are {flown_as} in flight")
    return faults


SEARCH = Search(draw, judge, draws=6)


# --- until enough have been flown -----------------------------------------------------------------


def results_in(path: Path) -> dict[int, Judged]:
    """Return the results in a file, by number."""
    if not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return {row.pop("number"): Judged(**{**row, "codes": tuple(row["codes"])}) for row in rows}


def main() -> None:
    """Draw until enough plans have been flown, or print a scenario."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="?", type=Path, help="file of results, one a line")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--go", type=int, default=200, help="plans that are GO without a warning")
    parser.add_argument("--stopped", type=int, default=60, help="plans stopped by flights")
    parser.add_argument("--scenario", type=int, metavar="NUMBER", help="print its scenario")
    given = parser.parse_args()
    if given.scenario is not None:
        print(json.dumps(scenario_of_draw(given.scenario), indent=1))
        return
    if given.results is None:
        parser.error("name the file of results")
    cases = results_in(given.results)
    with given.results.open("a") as file:
        for number in itertools.count(given.first):
            counts = Counter(case.verdict for case in cases.values())
            if counts[GO] >= given.go and counts[STOPPED] >= given.stopped:
                break
            if number not in cases:
                cases[number] = draw(number)[1]
                row = {"number": number, **asdict(cases[number])}
                print(json.dumps(row), file=file, flush=True)
    judge(cases, chance=0.0)


if __name__ == "__main__":
    main()
