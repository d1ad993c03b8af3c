"""What-if study: losses of vehicles, sensors and landmarks, judged afresh on unchanged orbits."""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from syncplan.arrays import Array
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import window_bound
from syncplan.observability.error_modes import ErrorVerdict
from syncplan.observability.rank import Assessment, assess_remainder, assess_team
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.lost_parts import (
    lost_together,
    names_of,
    possible_losses,
    scenario_after,
)
from syncplan.orbits.sightings import Loss, Remainder, remainder_of
from syncplan.planning.judged_team import JudgedTeam, PlanVerdict, Prediction
from syncplan.planning.plan_files import PlanSubject, planned
from syncplan.planning.planner import BoundChoice, judged, why_no_bound
from syncplan.planning.plans import Plan
from syncplan.planning.rule_orbits import listed_pairs
from syncplan.planning.verdict_checks import verdict_of
from syncplan.results import Result
from syncplan.runtime.machine import single_threaded_blas, threads_for

if TYPE_CHECKING:
    from syncplan.estimation.bounds import LossBounds


@dataclass(frozen=True, slots=True)
class LossOutcome:
    """A team after a loss, judged afresh.

    Attributes
    ----------
    lost : names of the lost parts, as lost_together reads them; empty for the whole team
    vehicles : names of the remaining vehicles
    rank, state_dim : rank and column count of the windowed matrix
    unobservable : a named mode for each dimension that the rank lacks
    error_verdict : observability of the errors that the filter estimates; None if it estimates
        none
    predicted_rms : (k,) m, RMS position error of each remaining vehicle; None if not computed
    note : why there are no predicted errors
    verdict : verdict on flying on after the loss
    """

    lost: tuple[str, ...]
    vehicles: tuple[str, ...]
    rank: int
    state_dim: int
    unobservable: tuple[UnobservableMode, ...]
    error_verdict: ErrorVerdict | None
    predicted_rms: Array | None
    note: str
    verdict: PlanVerdict

    @property
    def observable(self) -> bool:
        """Whether every position and heading is determined over the window."""
        return self.rank == self.state_dim

    @property
    def worst_predicted_rms(self) -> float | None:
        """Largest predicted RMS position error of a remaining vehicle, in m."""
        return None if self.predicted_rms is None else float(self.predicted_rms.max())

    @property
    def harm(self) -> tuple[int, float]:
        """Sort key of losses: dimensions lost, then the worst predicted error in m."""
        return self.state_dim - self.rank, self.worst_predicted_rms or 0.0


@dataclass(frozen=True, slots=True, repr=False)
class WhatIf(Result):
    """A plan and the effects of losses on it.

    Attributes
    ----------
    baseline : the plan itself, with nothing lost
    losses : every loss that was judged, the most harmful first
    critical : smallest sets of names whose loss ends observability; empty if the plan itself is not
        observable
    """

    plan: Plan
    baseline: LossOutcome
    losses: tuple[LossOutcome, ...]
    critical: tuple[tuple[str, ...], ...]

    def __repr__(self) -> str:
        """Return one line: name, losses, how many are critical."""
        name = f"{self.plan.scenario.name!r}: " if self.plan.scenario.name else ""
        many = "es" if len(self.losses) != 1 else ""
        return (
            f"<{type(self).__name__} {name}{len(self.losses)} loss{many} judged, "
            f"{len(self.critical)} critical>"
        )


def what_if(
    subject: PlanSubject,
    lose: Sequence[str] = (),
    *,
    losses: Literal[1, 2] = 1,
    bound: BoundChoice = "auto",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> WhatIf:
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
) -> WhatIf:
    study = _Study(plan, assess_team(plan.team, plan.scenario.window), bound)
    found = []
    with closing(_in_order(study, chosen, threads)) as outcomes:
        for outcome in outcomes:
            found.append(outcome)
            if progress is not None:
                progress(len(found))
    return WhatIf(
        plan,
        _judged_as(plan, ()),
        tuple(sorted(found, key=lambda one: one.harm, reverse=True)),
        _critical(found) if plan.observable else (),
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

    def outcome(self, loss: Loss) -> LossOutcome:
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


def _in_order(study: _Study, losses: Sequence[Loss], threads: int) -> Generator[LossOutcome]:
    """Yield outcomes in the order of the losses, a few computed ahead."""
    if not why_no_bound(study.plan.team, study.plan.scenario.duration_s, study.bound):
        study.bounds  # noqa: B018 - prepared once, before threads ask for it
    with ThreadPoolExecutor(threads) as pool:
        pending: list[Future[LossOutcome]] = []
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


def _judged_as(found: JudgedTeam, lost: tuple[str, ...]) -> LossOutcome:
    return LossOutcome(
        lost=lost,
        vehicles=tuple(found.scenario.vehicle_names),
        rank=found.observability.rank,
        state_dim=found.observability.state_dim,
        unobservable=found.unobservable,
        error_verdict=found.error_verdict,
        predicted_rms=found.prediction.rms,
        note=found.prediction.note,
        verdict=verdict_of(found),
    )


def _critical(outcomes: Sequence[LossOutcome]) -> tuple[tuple[str, ...], ...]:
    """Smallest sets whose loss ends observability, by size, then in the order judged."""
    smallest: list[tuple[str, ...]] = []
    for one in sorted(
        (one for one in outcomes if not one.observable), key=lambda one: len(one.lost)
    ):
        if not any(set(names) <= set(one.lost) for names in smallest):
            smallest.append(one.lost)
    return tuple(smallest)
