"""The judgement of a formation by the exact code: refined, predicted, flown and validated."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from syncplan.designs.candidates import Space
from syncplan.designs.cell_search import BestCandidate
from syncplan.planning.loss_study import what_if
from syncplan.planning.pilot_flight import pilot_flight
from syncplan.planning.pilot_options import PilotOptions
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.planning.validation import Validation, validate
from syncplan.refinement.refiner import refine
from syncplan.scenario.brief import Brief, Need

BOX_M = 5.0
"""How far a refinement may move each centre."""

REFINEMENT_S = 600.0
"""Time limit of a refinement, which takes some seconds."""

TRIALS = 40
"""Trials of the validation of a winner."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """A formation judged by the exact code.

    Attributes
    ----------
    start : the formation that the search found
    plan : refined, and with its pilot flight where it was flown
    flight, validation : None where an earlier judgement failed; no flight where filters broke down
    binding : the requirement that it misses; empty if it meets the brief
    """

    start: BestCandidate
    plan: Plan
    flight: Flight | None = None
    validation: Validation | None = None
    binding: str = ""

    @property
    def worst(self) -> float:
        """Largest predicted RMS error of a vehicle in m; infinite where none is predicted."""
        rms = self.plan.prediction.rms
        return float("inf") if rms is None else float(rms.max())


def judged(
    brief: Brief, team: BestCandidate, stopped: Callable[[], bool], report: Callable[[str], None]
) -> Judgement:
    """Return the judgement of a formation, in the order of what each part of it costs.

    It is judged as refined and, where that does not meet the brief, as it was found. Where neither
    does, the judgement of the refined one is returned.

    Once `stopped` returns True, the formation is neither refined nor tried any further. `report`
    receives what is done, in words.
    """
    space = Space(brief, team.cell)
    made = space.plan(team.point)
    better = made
    if not stopped():
        report(f"refining {team.cell}")
        better = refined(space, made)
    first = _judged(brief, Judgement(team, better), stopped, report)
    if not first.binding or better is made or stopped():
        return first
    # a refinement knows nothing of flights
    second = _judged(brief, Judgement(team, made), stopped, report)
    return first if second.binding else second


def _judged(
    brief: Brief, judgement: Judgement, stopped: Callable[[], bool], report: Callable[[str], None]
) -> Judgement:
    """The judgement of a plan, with the requirement that it misses."""
    need, made, cell = brief.need, judgement.plan, judgement.start.cell
    binding = _fault(judgement, need)
    if binding:
        return replace(judgement, binding=binding)
    if stopped():
        return replace(judgement, binding="time")
    if not survives(made, need):
        return replace(judgement, binding="losses")
    report(f"flying {cell}")
    flight = pilot_flight(made, PilotOptions(limited=False))
    if isinstance(flight, str):
        return replace(judgement, plan=replace(made, unflown=flight), binding="flight")
    made = flight.plan
    judgement = replace(judgement, plan=made, flight=flight if flight.whole.all() else None)
    if not float(flight.accuracy.late_position.max()) <= need.worst_rms_m:
        return replace(judgement, binding="flight")
    if made.verdict.stops:
        return replace(judgement, binding=made.verdict.stops[0].code)
    if stopped():
        return replace(judgement, binding="time")
    report(f"validating {cell}")
    validation = validate(made, trials=TRIALS, seed=brief.seed)
    judgement = replace(judgement, validation=validation)
    if float(validation.accuracy.late_position.max()) > need.worst_rms_m:
        return replace(judgement, binding="filter")
    stops = validation.verdict.stops
    return replace(judgement, binding=stops[0].code) if stops else judgement


def _fault(judgement: Judgement, need: Need) -> str:
    """The requirement that a plan misses as it was judged; empty if there is none."""
    made = judgement.plan
    if not made.observable:
        return "rank"
    if not made.verdict.go:
        return made.verdict.stops[0].code
    return "error" if judgement.worst > wanted(need) else ""


def wanted(need: Need) -> float:
    """Return the predicted error in m that meets a need with its margin."""
    return need.worst_rms_m * (1.0 - need.margin)


def survives(made: Plan, need: Need) -> bool:
    """Return whether a plan holds its need after any one loss, if it has to."""
    return not need.losses or all(
        item.observable and (item.worst_predicted_rms_m or float("inf")) <= need.worst_rms_m
        for item in what_if(made).losses
    )


def refined(space: Space, made: Plan) -> Plan:
    """Return a plan of a space with better phases and centres; it serves the purpose still.

    A plan that is not GO is returned as it is, and one that has to survive losses, which a
    refinement leaves out.
    """
    if not made.verdict.go or space.brief.need.losses:
        return made
    return refine(
        made,
        objective="worst_predicted_rms",
        center_box_m=BOX_M,
        starts=1,
        time_limit_s=REFINEMENT_S,
        seed=space.brief.seed,
        workers=1,
        pilot=False,
    )
