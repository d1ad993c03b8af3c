"""Design: the cheapest team that meets a brief, or what stands in its way and what would help.

    proof that it is impossible, or
    the ladder over teams                                      -> front
    the cheapest that meet the need, refined or as found       -> plan, losses, flight, validation
    where none does, or on request                             -> purchases, each searched

A search is on a coarse sample grid; whatever is returned is judged by the exact code.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from syncplan.designs.candidates import Space, check_samples
from syncplan.designs.cell_search import BestCandidate
from syncplan.designs.impossibility import Proof, proof_against
from syncplan.designs.judgement import Judgement, judged, refined, survives, wanted
from syncplan.designs.ladder import EVALUATIONS, DesignProgress, Ladder, SearchOrder
from syncplan.designs.purchases import Purchase, offers_for
from syncplan.errors import InputError
from syncplan.results.result import Result
from syncplan.runtime.machine import usable_cores
from syncplan.runtime.task_crew import EarlierSearch, interruption
from syncplan.scenario.brief import Brief, brief_of

Status = Literal["met", "not_found", "impossible"]

NEARLY = 1.3
"""Multiple of the need up to which a cell is worth refining."""

MOST_TRIED = 6
"""Number of cells that are refined, flown and validated at most."""


@dataclass(frozen=True, slots=True, repr=False)
class Design(Result):
    """Result of a design.

    Attributes
    ----------
    brief : the brief
    status : met, not_found, or impossible
    proof : why it is impossible; None otherwise
    best : the winner, or the best formation found; None if there is none
    binding : the requirement that decides; empty if the brief is met
    front : the best candidate for each number of vehicles and landmarks
    purchases : what changes of the brief would bring, where it is not met or asks for them
    evaluations : number of candidates looked at
    cut_short : whether its time limit or Ctrl-C ended the search
    """

    brief: Brief
    status: Status
    binding: str
    proof: Proof | None = None
    best: Judgement | None = None
    front: tuple[BestCandidate, ...] = ()
    purchases: tuple[Purchase, ...] = ()
    evaluations: int = 0
    cut_short: bool = False

    def __repr__(self) -> str:
        """Return one line: the brief and the status."""
        return f"<{type(self).__name__} of {self.brief!r}: {self.status}>"


def design(
    brief: Brief | str | Path | Mapping[str, Any],
    *,
    workers: int | None = None,
    progress: DesignProgress | None = None,
    earlier: EarlierSearch | None = None,
) -> Design:
    """Return the cheapest formation found that meets a brief, or what stands in its way.

    `brief` may be the path of its file or a mapping of its keys. `workers` is the number of
    processes, by default one per core; it changes no result. `earlier` holds the searches of an
    interrupted design, which are not repeated. The winner is predicted, flown and validated over
    ten periods; its worst vehicle stays within `need.worst_rms_m` in all three. Ctrl-C ends the
    design with the best so far.

    Raises InputError for a brief that cannot be used.
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} given, at least 1 is needed", key="workers")
    given = brief_of(brief)
    proof = proof_against(given)
    if proof is not None:
        return Design(given, "impossible", proof.kind, proof)
    heard = progress or (lambda _state: None)
    check_samples(given)
    ladder = Ladder(given, workers or usable_cores(), heard, earlier or EarlierSearch())
    with interruption() as interrupted:
        front = ladder.search_all()
        best, binding = _best(ladder, front, interrupted.is_set)
        offered: tuple[Purchase, ...] = ()
        asked = binding or given.purchases
        if best is not None and asked and not (ladder.cut_short or interrupted.is_set()):
            offered = _purchases(ladder, best, interrupted.is_set)
        return Design(
            given,
            "not_found" if binding else "met",
            binding,
            best=best,
            front=tuple(front),
            purchases=offered,
            evaluations=sum(team.evaluations for team in ladder.made.values()),
            cut_short=ladder.cut_short or interrupted.is_set(),
        )


def _best(
    ladder: Ladder, front: list[BestCandidate], stopped: Callable[[], bool]
) -> tuple[Judgement | None, str]:
    """The cheapest formation that meets the brief, or the best of all and what it misses."""
    fitting = [team for team in front if team.fits]
    if not fitting:
        return None, _least_fault(ladder.brief, front)
    nearly = [team for team in fitting if team.value <= NEARLY * wanted(ladder.brief.need)]
    nearly.sort(key=lambda team: (team.cell.cost(ladder.brief.prefer), team.value))
    tried = nearly[:MOST_TRIED] or [min(fitting, key=lambda team: team.value)]
    made: list[Judgement] = []
    for team in tried:
        made.append(judged(ladder.brief, team, stopped, ladder.report))
        if not made[-1].binding:
            return made[-1], ""
        if stopped():
            break
    best = min(made, key=lambda judgement: judgement.worst)
    return best, best.binding


def _least_fault(brief: Brief, front: list[BestCandidate]) -> str:
    """The largest fault of the formation that comes nearest to having none."""
    if not front:
        return "time"
    best = min(front, key=lambda team: team.value)
    space = Space(brief, best.cell)
    faults = space.faults(space.candidate(best.point))
    # of circles alone there may be none: vehicles then come too near as they stray
    return max(faults, key=lambda name: faults[name]) if any(faults.values()) else "separation"


def _purchases(
    ladder: Ladder, best: Judgement, stopped: Callable[[], bool]
) -> tuple[Purchase, ...]:
    """What each offer that helps brings to the best formation, best first.

    Each is searched on from that formation, and refined.
    """
    need, start = ladder.brief.need, best.start
    half = EVALUATIONS[ladder.brief.effort] // 2
    offers = dict(enumerate(offers_for(ladder.brief, start.cell), ladder.searches))
    ladder.total += len(offers)
    orders = [
        SearchOrder(number, offer.brief, offer.cell, half, starts=(start,))
        for number, offer in offers.items()
    ]
    ladder.carry_out(orders, "searching what would help")
    made = []
    for number, offer in offers.items():
        bought = ladder.made.get(number)
        if bought is not None and bought.fits and not stopped():
            space = Space(offer.brief, bought.cell)
            plan = refined(space, space.plan(bought.point))
            worst = replace(best, plan=plan).worst
            helps = bought.value < start.value if need.losses else worst < best.worst
            if helps and worst < float("inf"):
                met = worst <= wanted(need) and survives(plan, need)
                made.append(Purchase(offer.words, offer.cost, plan, worst, met))
    return tuple(sorted(made, key=lambda purchase: purchase.worst))
