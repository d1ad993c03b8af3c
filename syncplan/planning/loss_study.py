"""What-if study: losses of vehicles, sensors and landmarks, judged afresh on unchanged orbits."""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from syncplan import __version__
from syncplan.documents import Document, OrAbsent, VersionedDocument
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import window_bound
from syncplan.observability.rank import Assessment, assess_remainder, assess_team
from syncplan.orbits.lost_parts import (
    lost_together,
    names_of,
    phrase_of,
    possible_losses,
    scenario_after,
)
from syncplan.orbits.sightings import Loss, Remainder, remainder_of
from syncplan.phrases import listed
from syncplan.planning.judged_team import JudgedTeam, PlanVerdict, Prediction
from syncplan.planning.observability_records import (
    ErrorPrediction,
    ExtendedRank,
    Unobservable,
    error_prediction,
    extended_rank_record,
    unobservable_motions,
)
from syncplan.planning.plan_files import PlanSubject, planned
from syncplan.planning.planner import BoundChoice, judged, why_no_bound
from syncplan.planning.plans import Plan
from syncplan.planning.rule_orbits import listed_pairs
from syncplan.planning.verdict_checks import verdict_of
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.result import Result
from syncplan.results.stories import Report, Row, Story, Table, flat
from syncplan.runtime.machine import single_threaded_blas, threads_for

if TYPE_CHECKING:
    from syncplan.estimation.bounds import LossBounds


def _lost(names: Sequence[str]) -> str:
    return " and ".join(map(phrase_of, names)) or "nothing"


class RemainingTeam(Document):
    """The team that a loss leaves, judged again on the same orbits."""

    lost: list[str] = quantity(
        "lost",
        "Names of what is lost: vehicles, landmarks, and sensors as sensor:v3, whose vehicles fly "
        "on, or as compass:v3 and distance:v3, of one kind of sighting; empty for the whole team",
        examples=[["sensor:v3"]],
        words=each(lambda team: plain(_lost(team.lost))),
    )
    rank: int = quantity("rank", words=each(lambda team: team.rank_words))
    state_dim: int
    observable: bool
    unobservable: list[Unobservable] = quantity(
        "cannot be detected any more",
        words=each(lambda team: plain("; ".join(team.undetected))),
        folds=True,
        order=1,
    )
    extended: OrAbsent[ExtendedRank] = Field(
        default=None,
        description="Rank with errors as states; absent where the filter estimates none that are "
        "constant, or where there are more than 400 states",
    )
    predicted_rms_m: ErrorPrediction = Field(
        description="Of a run without what is lost, from its start"
    )
    worst_predicted_rms_m: float | None = quantity(
        "worst error", "Of the vehicle worst off; null where not computed", "m"
    )
    verdict: PlanVerdict = quantity(
        "verdict",
        "On flying without what is lost",
        words=each(lambda team: team.verdict.word),
        text=True,
    )

    @property
    def harm(self) -> tuple[int, float]:
        """Sort key of losses: dimensions lost, then the worst predicted error in m."""
        return self.state_dim - self.rank, self.worst_predicted_rms_m or 0.0

    @property
    def rank_words(self) -> str:
        """The rank, and the dimension of the state."""
        return f"{self.rank} of {self.state_dim}"

    @property
    def undetected(self) -> list[str]:
        """Undetectable motions of the team and changes of estimated errors, in words."""
        further = self.extended.undetermined if self.extended else []
        modes = [mode.description for mode in self.unobservable]
        return modes + [mode.description for mode in further]


MOST_NAMED = 12
"""Most losses named in a line."""


class WhatIfDocument(VersionedDocument, Report, Result):
    """Effects of losses of vehicles, sensors and landmarks on a plan."""

    drawn_as: ClassVar[str] = "losses"

    name: str = Field(description="Of the scenario")
    baseline: RemainingTeam = Field(description="The plan with nothing lost")
    losses: list[RemainingTeam] = Field(description="Each loss judged, the most harmful first")
    critical: list[list[str]] = Field(
        description="Smallest sets whose loss ends observability; empty where the plan is "
        "not observable itself",
        examples=[[["v3"], ["sensor:v3"], ["L1"]]],
    )

    def __repr__(self) -> str:
        """Return one line: name, losses, how many are critical."""
        name = f"{self.name!r}: " if self.name else ""
        many = "es" if len(self.losses) != 1 else ""
        return f"<WhatIf {name}{len(self.losses)} loss{many} judged, {len(self.critical)} critical>"

    def body(self) -> Story:
        """Yield the losses that end observability, then the effects of all."""
        whole = self.baseline
        state = "[green]observable[/]" if whole.observable else "[red]NOT observable[/]"
        name = plain(self.name or "plan")
        yield f"[bold]{name}[/]: {state}, rank {whole.rank_words}; {self._critical_words}"
        title = "each loss, the most harmful first; orbits unchanged, errors from initial_sigma on"
        yield Table(title, [whole, *self.losses], apart=1)

    def remarks(self) -> list[str]:
        """Return the note on the predicted errors, if there is one."""
        return list(filter(None, [self.baseline.predicted_rms_m.note]))

    @property
    def _critical_words(self) -> str:
        judged = len(self.losses)
        if not self.baseline.observable:
            return f"{judged} losses judged"
        if not self.critical:
            return f"none of {judged} losses ends observability"
        named = listed(list(map(_lost, self.critical)), MOST_NAMED)
        return f"[red]{len(self.critical)} critical[/] of {judged}: {plain(named)}"

    def frame_rows(self) -> Iterator[Row]:
        """Yield the losses as rows of a data frame."""
        for team in self.losses:
            values = flat(team.model_dump(exclude={"predicted_rms_m"}))
            yield {"name": ", ".join(team.lost), **values, "go": team.verdict.go}


WhatIf = WhatIfDocument
"""Result of `what_if`, which is its document."""


def what_if(
    subject: PlanSubject,
    lose: Sequence[str] = (),
    *,
    losses: Literal[1, 2] = 1,
    bound: BoundChoice = "auto",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> WhatIfDocument:
    """Return the effects of losses on a plan, each remainder judged afresh on its present orbits.

    `subject` is the plan, or a scenario, file or mapping to make one from. `lose` names parts that
    are lost together: vehicles, landmarks, and sensors as sensor:v3. A vehicle that loses its
    sensor flies on, is seen by others and keeps its compass; compass:v3 and distance:v3 are sensors
    of one kind of sighting. Without `lose`, every loss of one vehicle, sensor or landmark is
    judged; losses=2 adds every loss of two. Parts are lost from time 0 on: predicted errors are
    those of a run without them. Verdicts leave out the start and further losses. `bound` selects
    whether errors are predicted, as in syncplan.plan. `progress` is called with the number of
    losses judged.

    Raises InputError for names that the plan does not have and for options out of range.
    """
    _check(lose, losses, bound)
    side_by_side = threads_for(threads)
    plan = planned(subject, bound=bound)
    chosen = [lost_together(lose, plan.scenario)] if lose else possible_losses(plan.team, losses)
    return _studied(plan, chosen, bound, side_by_side, progress)


@single_threaded_blas
def _studied(
    plan: Plan,
    chosen: Sequence[Loss],
    bound: BoundChoice,
    threads: int,
    progress: Callable[[int], None] | None,
) -> WhatIfDocument:
    study = _Study(plan, assess_team(plan.team, plan.scenario.window), bound)
    found = []
    with closing(_in_order(study, chosen, threads)) as outcomes:
        for outcome in outcomes:
            found.append(outcome)
            if progress is not None:
                progress(len(found))
    return WhatIfDocument(
        version=__version__,
        name=plan.scenario.name,
        baseline=_judged_as(plan, ()),
        losses=sorted(found, key=lambda team: team.harm, reverse=True),
        critical=_critical(found) if plan.observable else [],
    )


def _check(lose: Sequence[str], losses: int, bound: str) -> None:
    if isinstance(lose, str):
        raise InputError(f"{lose!r}: must be a list of names, such as ['v3', 'L1']", key="lose")
    if losses not in (1, 2):
        raise InputError(f"{losses}: must be 1 or 2", key="losses")
    if bound not in ("auto", "always", "never"):
        raise InputError(f"{bound!r}: must be auto, always or never", key="bound")


@dataclass(frozen=True)
class _Study:
    """A plan, with the data that the judgements of its losses share."""

    plan: Plan
    assessed: Assessment
    bound: BoundChoice

    @cached_property
    def bounds(self) -> "LossBounds":
        """Bounds along the run, from which predicted errors are computed."""
        from syncplan.estimation.bounds import LossBounds

        plan = self.plan
        return LossBounds.along(plan.team, self.assessed.windows, plan.scenario.duration_s)

    def outcome(self, loss: Loss) -> RemainingTeam:
        """Return the outcome of a loss: the remainder, judged afresh."""
        left = remainder_of(self.plan.team, loss)
        assessed = assess_remainder(self.assessed, left)
        scenario = scenario_after(self.plan.scenario, loss)
        pairs = listed_pairs(scenario, left.team)
        prediction = self._predicted(left, assessed)
        found = judged(assessed, scenario, pairs, prediction, remainder=True, connectivity=False)
        return _judged_as(found, names_of(loss, self.plan.scenario))

    def _predicted(self, left: Remainder, assessed: Assessment) -> Prediction:
        rms, note = None, why_no_bound(left.team, self.plan.scenario.duration_s, self.bound)
        if not note:
            try:
                rms = self.bounds.after(left).rms_second_half()
            except NoSolutionError as error:
                note = str(error)
        window = window_bound(assessed.observability)
        return Prediction(rms=rms, steady=None, window=window, note=note)


def _in_order(study: _Study, losses: Sequence[Loss], threads: int) -> Generator[RemainingTeam]:
    """Yield outcomes in the order of the losses, a few computed ahead."""
    if not why_no_bound(study.plan.team, study.plan.scenario.duration_s, study.bound):
        study.bounds  # noqa: B018 - prepared once, before threads ask for it
    with ThreadPoolExecutor(threads) as pool:
        pending: list[Future[RemainingTeam]] = []
        try:
            for loss in losses:
                pending.append(pool.submit(study.outcome, loss))
                if len(pending) > 2 * threads:
                    yield pending.pop(0).result()
            while pending:
                yield pending.pop(0).result()
        finally:
            for one in pending:
                one.cancel()


def _judged_as(team: JudgedTeam, lost: Sequence[str]) -> RemainingTeam:
    names, prediction = team.scenario.vehicle_names, team.prediction
    return RemainingTeam(
        lost=list(lost),
        rank=team.observability.rank,
        state_dim=team.observability.state_dim,
        observable=team.observability.observable,
        unobservable=unobservable_motions(team.unobservable, names),
        extended=extended_rank_record(team.error_verdict, names),
        predicted_rms_m=error_prediction(prediction.rms, names, prediction.note),
        worst_predicted_rms_m=None if prediction.rms is None else float(prediction.rms.max()),
        verdict=verdict_of(team),
    )


def _critical(teams: Sequence[RemainingTeam]) -> list[list[str]]:
    """Smallest sets whose loss ends observability, by size, then in the order judged."""
    smallest: list[list[str]] = []
    lost = [team.lost for team in teams if not team.observable]
    for names in sorted(lost, key=len):
        if not any(set(smaller) <= set(names) for smaller in smallest):
            smallest.append(names)
    return smallest
