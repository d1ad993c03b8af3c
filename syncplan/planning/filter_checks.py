"""Findings on the filter: whether it starts well, and the cost of errors that it neglects."""

from collections.abc import Iterator

import numpy as np

from syncplan.phrases import in_words, listed
from syncplan.planning.judged_team import MOST_NAMED, FindingCure, JudgedTeam, Remark
from syncplan.planning.start_up import (
    CLEARING_INDEX,
    SAFE_RATIO,
    UNCLEARED_FILTER,
    InputStart,
    StartTrials,
    StartUp,
)
from syncplan.scenario.filters import FILTERS

# --- the start ------------------------------------------------------------------------------------


MOST_LATE = 3

WORSE_START = 1.1
"""Factor over the input's ratio beyond which a refined plan's start counts as worse."""


def start_up(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that trials miss the predicted error, or could not test it."""
    found = judged.start_up
    if found is None or found.cleared:
        return
    why = f"start-up index {found.index.value:.3g}, at most {CLEARING_INDEX:g} is clear"
    if found.trials is None:
        if found.untried:
            yield Remark(
                "note",
                f"whether the filter ({found.filter}) reaches the bound was not tried: "
                f"{found.untried}; {why}",
                cure="validate the plan",
            )
        return
    ratios = found.trials.ratios
    late = np.flatnonzero(ratios > SAFE_RATIO)
    if not len(late):
        if found.trials.pilot and judged.prediction.states:
            yield Remark(
                "note",
                f"whether the filter ({found.filter}) reaches the bound with errors as states was "
                "not tried: "
                f"{_trials(found.trials)} left these errors out, and found no harm; {why}",
                cure="validate the plan",
            )
        return
    names, noise = judged.scenario.vehicle_names, judged.noise
    worst = late[np.argsort(-ratios[late], kind="stable")]
    each = listed([_beside(found.trials, names, int(k)) for k in worst], MOST_LATE)
    yield Remark(
        "warning",
        f"from initial_sigma {noise.position_sigma:g} m and {noise.heading_sigma:g} rad the filter "
        f"({found.filter}) may not settle: {_trials(found.trials)} found {each}; {why}",
        tuple(names[k] for k in late),
        cure=_cure(found),
    )


def start_up_worse(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that a refined plan starts worse than the plan it was made from."""
    record, after = judged.refinement, judged.start_up
    before = None if record is None or not record.improved else record.start_before
    if before is None or after is None or after.trials is None:
        return
    if after.worst_ratio > WORSE_START * before.worst_ratio:
        yield Remark(
            "warning" if after.worst_ratio > SAFE_RATIO else "note",
            "refinement improved the bound, not the start: the worst vehicle's error in "
            f"{_trials(after.trials)} is {after.worst_ratio:.3g} times its prediction; "
            f"{_said(before)} before",
            cure="a smaller initial_sigma, or the plan as it was",
        )


def _trials(trials: StartTrials) -> str:
    number = f"a pilot of {trials.trials} trials" if trials.pilot else f"{trials.trials} trials"
    return f"{number} over {trials.duration:.4g} s"


def _said(before: InputStart) -> str:
    if before.cleared:
        return f"the index cleared it, at {before.index:.3g},"
    return f"it was {before.worst_ratio:.3g}"


def _beside(trials: StartTrials, names: list[str], k: int) -> str:
    predicted = f"{trials.predicted[k]:.3g} m predicted"
    if not np.isfinite(trials.found[k]):
        return f"{names[k]} lost ({predicted})"
    return f"{names[k]} off by {trials.found[k]:.3g} m ({predicted})"


def _cure(found: StartUp) -> FindingCure | str:
    better = found.clearing
    finder = "" if FILTERS[found.filter].finds_start else f"the {UNCLEARED_FILTER} filter, or "
    if better is None:
        return f"{finder}a better known start, landmarks in sight of it, or more distance to them"
    return FindingCure(
        text=f"{finder}a start known to {better.position:g} m and {better.heading:g} rad, "
        "which the index clears",
        change={
            "initial_sigma.position_m": better.position,
            "initial_sigma.heading_rad": better.heading,
        },
    )


# --- neglected errors -----------------------------------------------------------------------------


WORTH_A_WARNING = 1.1
"""Ratio of expected to predicted RMS error, of any vehicle, beyond which neglect matters."""

WORSE_EXPECTED = 1.01
"""Ratio of all vehicles' expected RMS error to the input's beyond which it counts as grown."""

_LEAST = 1e-300
"""Smallest prediction in m, which gives a prediction of 0 a ratio."""


def not_estimated(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the filter leaves out errors that the scenario states."""
    neglect, predicted = judged.prediction.neglect, judged.prediction.rms
    if neglect is None or predicted is None:
        return
    what = in_words(neglect.names)
    cure = FindingCure(text="estimate them as states", change={"filter.estimate": "auto"})
    if neglect.expected is None:
        message = f"the filter does not estimate {what}; what that costs could not be computed"
        yield Remark("warning", message, cure=cure)
        return
    ratios = neglect.expected / np.maximum(predicted, _LEAST)
    worse = np.argsort(-ratios, kind="stable")[: int(np.sum(ratios > WORTH_A_WARNING))].tolist()
    names = judged.scenario.vehicle_names
    if not worse:
        more = f"{WORTH_A_WARNING - 1.0:.0%}"
        message = f"the filter does not estimate {what}; no vehicle's error grows by over {more}"
        yield Remark("note", message)
        return
    each = [f"{names[k]} by {neglect.expected[k]:.3g} m, not {predicted[k]:.3g} m" for k in worse]
    yield Remark(
        "warning",
        f"the filter does not estimate {what} and is off by more than it predicts: "
        f"{listed(each, MOST_NAMED)}",
        tuple(names[k] for k in sorted(worse)),
        cure=cure,
    )


def expected_worse(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that refinement increased the filter's expected error."""
    record, neglect = judged.refinement, judged.prediction.neglect
    before = None if record is None or not record.improved else record.expected_before
    after = None if neglect is None else neglect.expected_of_all
    if before is None or after is None or after <= WORSE_EXPECTED * before:
        return
    yield Remark(
        "warning",
        "refinement counted only what the filter estimates; with the errors that it leaves out, "
        f"the RMS error to be expected of all vehicles rose from {before:.3g} m to {after:.3g} m",
        cure=FindingCure(
            text="estimate them as states, which refinement then counts, or keep the plan as it "
            "was",
            change={"filter.estimate": "auto"},
        ),
    )
