"""Whether the filter reaches the bound from the initial sigmas: findings on the start."""

from collections.abc import Iterator

import numpy as np

from syncplan.estimation.filters import FILTERS
from syncplan.phrases import listed
from syncplan.planning.findings import Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.planning.start_up import (
    CLEARING_INDEX,
    SAFE_RATIO,
    UNCLEARED_FILTER,
    StartBefore,
    StartTrials,
    StartUp,
)

MOST_NAMED = 3

WORSE = 1.1
"""Times the input's ratio from which on a refined plan's counts as worse."""


def start_up(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that trials miss the predicted error, or do not show whether they do."""
    found = judged.start_up
    if found is None or found.cleared:
        return
    why = f"start-up index {found.index.value:.3g}, at most {CLEARING_INDEX:g} is clear"
    if found.trials is None:
        if found.untried:
            yield Finding(
                "start-up",
                "note",
                f"whether the filter ({found.filter}) reaches the bound was not tried: "
                f"{found.untried}; {why}",
                cure=Cure("validate the plan"),
            )
        return
    ratios = found.trials.ratios
    late = np.flatnonzero(ratios > SAFE_RATIO)
    if not len(late):
        if found.trials.pilot and judged.prediction.states:
            yield Finding(
                "start-up",
                "note",
                f"whether the filter ({found.filter}) reaches the bound with errors as states was "
                "not tried: "
                f"{_trials(found.trials)} left these errors out, and found no harm; {why}",
                cure=Cure("validate the plan"),
            )
        return
    names, noise = judged.scenario.vehicle_names, judged.noise
    worst = late[np.argsort(-ratios[late], kind="stable")]
    each = listed([_beside(found.trials, names, int(k)) for k in worst], MOST_NAMED)
    yield Finding(
        "start-up",
        "warning",
        f"from initial_sigma {noise.position_sigma:g} m and {noise.heading_sigma:g} rad the filter "
        f"({found.filter}) may not settle: {_trials(found.trials)} found {each}; {why}",
        tuple(names[k] for k in late),
        _cure(found),
    )


def start_up_worse(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that a refined plan starts worse than the plan it was made from."""
    record, after = judged.refinement, judged.start_up
    before = None if record is None or not record.improved else record.start_before
    if before is None or after is None or after.trials is None:
        return
    if after.worst_ratio > WORSE * before.worst_ratio:
        yield Finding(
            "start-up-worse",
            "warning" if after.worst_ratio > SAFE_RATIO else "note",
            "refinement improved the bound, not the start: the worst vehicle's error in "
            f"{_trials(after.trials)} is {after.worst_ratio:.3g} times its prediction; "
            f"{_said(before)} before",
            cure=Cure("a smaller initial_sigma, or the plan as it was"),
        )


def _trials(trials: StartTrials) -> str:
    number = f"a pilot of {trials.trials} trials" if trials.pilot else f"{trials.trials} trials"
    return f"{number} over {trials.duration:.4g} s"


def _said(before: StartBefore) -> str:
    if before.cleared:
        return f"the index cleared it, at {before.index:.3g},"
    return f"it was {before.worst_ratio:.3g}"


def _beside(trials: StartTrials, names: list[str], k: int) -> str:
    predicted = f"{trials.predicted[k]:.3g} m predicted"
    if not np.isfinite(trials.found[k]):
        return f"{names[k]} lost ({predicted})"
    return f"{names[k]} off by {trials.found[k]:.3g} m ({predicted})"


def _cure(found: StartUp) -> Cure:
    better = found.clearing
    finder = "" if FILTERS[found.filter].finds_start else f"the {UNCLEARED_FILTER} filter, or "
    if better is None:
        return Cure(
            f"{finder}a better known start, landmarks in sight of it, or more distance to them"
        )
    return Cure(
        f"{finder}a start known to {better.position:g} m and {better.heading:g} rad, "
        "which the index clears",
        {
            "initial_sigma.position_m": better.position,
            "initial_sigma.heading_rad": better.heading,
        },
    )
