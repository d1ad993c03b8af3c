"""Findings on errors that the filter leaves out."""

from collections.abc import Iterator

import numpy as np

from syncplan.phrases import in_words, listed
from syncplan.planning.judged_team import MOST_NAMED, FindingCure, JudgedTeam, Level, Remark

WORTH_A_WARNING = 1.1
"""Ratio of expected to predicted RMS error, of any vehicle, beyond which neglect matters."""

WORSE_EXPECTED = 1.01
"""Ratio of all vehicles' expected RMS error to the input's beyond which it counts as grown."""

_LEAST = 1e-300
"""Smallest prediction in m, which gives a prediction of 0 a ratio."""


def not_estimated(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the filter leaves out errors that the scenario states.

    It is a note for a plan that was flown: flights show what that costs.
    """
    neglect, predicted = judged.prediction.neglect, judged.prediction.rms
    if neglect is None or predicted is None:
        return
    what = in_words(neglect.names)
    level: Level = "warning" if judged.flight is None else "note"
    cure = FindingCure(text="estimate them as states", change={"filter.estimate": "auto"})
    if neglect.expected is None:
        message = f"the filter does not estimate {what}; what that costs could not be computed"
        yield Remark(level, message, cure=cure)
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
        level,
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
