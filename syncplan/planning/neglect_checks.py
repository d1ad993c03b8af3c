"""What the filter does not estimate: the findings on what that costs."""

from collections.abc import Iterator

import numpy as np

from syncplan.phrases import listed
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.judged_team import JudgedTeam

WORTH_A_WARNING = 1.1
"""Expected over predicted RMS error, of any vehicle, from which on neglect counts."""

WORSE = 1.01
"""Expected RMS error of all vehicles, over that of the input, from which on it has grown."""

_LEAST = 1e-300
"""m: a prediction of nothing but 0 still has a ratio."""


def not_estimated(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that the filter leaves out errors which the scenario states."""
    neglect, predicted = judged.prediction.neglect, judged.prediction.rms
    if neglect is None or predicted is None:
        return
    what = listed([name.replace("_", " ") for name in neglect.names], len(neglect.names))
    cure = Cure("estimate them as states", {"filter.estimate": "auto"})
    if neglect.expected is None:
        message = f"the filter does not estimate {what}; what that costs could not be computed"
        yield Finding("not-estimated", "warning", message, cure=cure)
        return
    ratios = neglect.expected / np.maximum(predicted, _LEAST)
    worse = np.argsort(-ratios, kind="stable")[: int(np.sum(ratios > WORTH_A_WARNING))].tolist()
    names = judged.scenario.vehicle_names
    if not worse:
        more = f"{WORTH_A_WARNING - 1.0:.0%}"
        message = f"the filter does not estimate {what}; no vehicle's error grows by over {more}"
        yield Finding("not-estimated", "note", message)
        return
    each = [f"{names[k]} by {neglect.expected[k]:.3g} m, not {predicted[k]:.3g} m" for k in worse]
    yield Finding(
        "not-estimated",
        "warning",
        f"the filter does not estimate {what} and is off by more than it predicts: "
        f"{listed(each, MOST_NAMED)}",
        tuple(names[k] for k in sorted(worse)),
        cure,
    )


def expected_worse(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the finding that refinement made worse what is to be expected of the filter."""
    record, neglect = judged.refinement, judged.prediction.neglect
    before = None if record is None or not record.improved else record.expected_before
    after = None if neglect is None else neglect.expected_of_all
    if before is None or after is None or after <= WORSE * before:
        return
    yield Finding(
        "expected-worse",
        "warning",
        "refinement counted only what the filter estimates; with the errors that it leaves out, "
        f"the RMS error to be expected of all vehicles rose from {before:.3g} m to {after:.3g} m",
        cure=Cure(
            "estimate them as states, which refinement then counts, or keep the plan as it was",
            {"filter.estimate": "auto"},
        ),
    )
