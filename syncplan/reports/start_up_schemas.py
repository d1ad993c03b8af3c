"""The JSON contract of the start: whether the filter reaches the bound from the initial sigmas."""

from collections.abc import Sequence

from pydantic import Field

from syncplan.estimation.filters import FilterName
from syncplan.planning.start_up import StartTrials, StartUp
from syncplan.reports.document_base import DocumentPart, finite_or_none


class PilotRecord(DocumentPart):
    """A few trials of the filter from the initial sigmas, samples thinned out."""

    filter: FilterName | None = Field(
        default=None, description="That ran; null in older files, whose pilots are of ekf"
    )
    trials: int
    seed: int
    duration_s: float = Field(description="Length of each: the run's, or its first five periods")
    rms_over_predicted: dict[str, float | None] = Field(
        description="RMS position error over the second half of `duration_s`, over the bound's in "
        "the same time; null where a filter broke down"
    )


class StartUpRecord(DocumentPart):
    """Whether the filter can be expected to reach the bound from the initial sigmas.

    Supposes errors as drawn from the sigmas of the scenario, and circles that are flown exactly.
    """

    index: float = Field(
        description="Largest second-order term of a bearing over the deviation of its innovation, "
        "with the covariance of the bound; at most 0.45 clears the plan",
        examples=[0.2],
    )
    observer: str = Field(description="Who measures the bearing that has the index")
    target: str
    time_s: float
    pilot: PilotRecord | None = Field(description="null where the index clears the plan")
    untried: str = Field(description="Why there is no pilot although the index does not clear")


def start_up_record(
    start_up: StartUp, names: Sequence[str], landmarks: Sequence[str]
) -> StartUpRecord:
    """Return how a plan starts as documents hold it."""
    index = start_up.index
    return StartUpRecord(
        index=index.value,
        observer=names[index.observer],
        target=[*names, *landmarks][index.target],
        time_s=index.time,
        pilot=None if start_up.trials is None else _pilot(start_up.trials, start_up.filter, names),
        untried=start_up.untried,
    )


def _pilot(trials: StartTrials, filter_: str, names: Sequence[str]) -> PilotRecord:
    ratios = [finite_or_none(float(ratio)) for ratio in trials.ratios]
    return PilotRecord(
        filter=filter_,
        trials=trials.trials,
        seed=trials.seed,
        duration_s=trials.duration,
        rms_over_predicted=dict(zip(names, ratios, strict=True)),
    )
