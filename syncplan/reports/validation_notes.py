"""What the figures of a validation mean, in words."""

from collections.abc import Sequence

import numpy as np

from syncplan.estimation.considered_errors import neglected_errors
from syncplan.phrases import listed
from syncplan.planning.validation import Validation
from syncplan.reports.consistency_words import interval_words
from syncplan.reports.run_schemas import ErrorFigures, Spread

FEW_SHAPE_THE_RMS = 1.5
"""RMS over the median trial's error, above which a few trials make up the RMS."""

_STILL_AIR = (
    "the bound of the wind is that of circles flown in still air; in wind an error of a heading "
    "looks like more of it, so the wind is known less well"
)


def notes_on(validation: Validation, report: ErrorFigures, figure: Spread) -> list[str]:
    """Return what the figures mean for the reader, in plain words; `figure` is the ANEES."""
    notes = []
    if validation.judged_from:
        notes.append(
            f"the filter looks for its start until {validation.judged_from:.4g} s: ANEES, NIS and "
            "coverage count from there on"
        )
    neglected = neglected_errors(validation.plan.team)
    if neglected:
        notes.append(_neglect_note(validation, neglected, report, figure))
    if not validation.plan.observable:
        notes.append(_unobservable_note(validation, figure))
    elif figure.verdict == "optimistic" and not neglected:
        notes.append(
            f"the filter is optimistic (ANEES {interval_words(figure)}): it makes larger errors "
            "than its sigmas say, because it linearises about its own estimate; smaller initial "
            "sigmas or more sightings help"
        )
    if any(one.label.startswith("wind") for one in validation.predicted_errors):
        notes.append(_STILL_AIR)
    outliers = _outliers_note(report)
    if outliers:
        notes.append(outliers)
    lost = int(np.isnan(validation.result.nees).sum())
    if lost:
        notes.append(f"{lost} trials ended with a covariance that is not positive definite")
    return notes


def _neglect_note(
    validation: Validation, neglected: Sequence[str], report: ErrorFigures, figure: Spread
) -> str:
    what = listed([name.replace("_", " ") for name in neglected], len(neglected))
    text = f"the filter does not estimate {what}: ANEES {interval_words(figure)}"
    if figure.verdict == "optimistic":
        text += ", so its sigmas are too small by what these errors cost"
    elif figure.verdict == "consistent":
        text += ", so what these errors cost is within its sigmas"
    if validation.expected is not None:
        expected = float(np.sqrt(np.mean(validation.expected**2)))
        text += f". Second-half RMS: {report.rms_second_half_m:.3g} m, {expected:.3g} m expected"
        if report.predicted_rms_m is not None:
            text += f"; the bound of what it does estimate is {report.predicted_rms_m:.3g} m"
    return f"{text}. filter.estimate makes them states"


def _unobservable_note(validation: Validation, figure: Spread) -> str:
    plan = validation.plan
    verdict = plan.observability
    motions = "; ".join(item.description for item in plan.unobservable[:3])
    text = (
        f"the plan is NOT observable (rank {verdict.rank} of {verdict.state_dim}): no sighting "
        f"can detect {motions}. Along them the filter's sigmas are those of the start, grown by "
        "the noise of the motion: they hold where initial_sigma is true, small against the "
        "distances of sight, and the run is short"
    )
    if figure.verdict == "optimistic":
        text += (
            f". Here they do not hold: the filter is optimistic (ANEES {interval_words(figure)})"
        )
    return text


def _outliers_note(overall: ErrorFigures) -> str | None:
    """Where some trials are so far off that the RMS is theirs."""
    far, lost = overall.share_over_3_predicted, overall.share_over_10_predicted
    median = overall.median_rms_second_half_m
    if not far or lost is None or median is None:
        return None
    if overall.rms_second_half_m <= FEW_SHAPE_THE_RMS * median and not lost:
        return None
    return (
        f"in {100.0 * far:.3g} % of the trials some vehicle is off by more than 3 times the "
        f"bound, in {100.0 * lost:.3g} % by more than 10 times: they shape the RMS of "
        f"{overall.rms_second_half_m:.3g} m, the median trial has {median:.3g} m"
    )
