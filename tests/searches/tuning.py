"""Search for recordings of real robots on which `replay --tune` does harm.

Needs the recording beside the checkout: data set 6 of MRCLAM, see docs/how-to/replay-a-log.md. 12
splits in turn: in the first half of the recording, in the whole and in the second half; bearings
alone and with distances, of two of the 15 landmarks and of all. Sigmas and delay are fitted to the
first third of each; errors are of its other two thirds, RMS over all robots in m, with the settings
given by default and with those that `--tune` took. `fitted` has errors with the fit whether it was
taken or refused, beside how much larger errors of predictions of withheld sightings were with it:
what `--tune` judges by. Fails where the error is more than 2 % larger than by default.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import FIT_SHARE, tuned
from syncplan.estimation.replays import OPTIONS, replay_with
from syncplan.recordings.log import Log
from tests.searches import Search
from tests.searches.recording import CASES, LACKING, recorded
from tests.tools.recordings import REAL, part_of

PORTIONS = {"first-half": (0.0, 0.5), "whole": (0.0, 1.0), "second-half": (0.5, 1.0)}
"""Shares of the recording at which a split begins and ends."""

ROWS = tuple(product(PORTIONS, CASES))

WORSE = 1.02
"""How many times as large an error may be."""


@dataclass(frozen=True, slots=True)
class Split:
    """Replays of the part that nothing was fitted to.

    Attributes
    ----------
    given, fitted, taken : with settings by default, as fitted, and as `--tune` took them
    error_ratio : of predictions of withheld sightings, fitted over given
    """

    given: Replay
    fitted: Replay
    taken: Replay
    error_ratio: float

    @property
    def does_no_harm(self) -> bool:
        """Whether the error is no larger than is allowed."""
        return _error(self.taken) <= WORSE * _error(self.given)


def compared(log: Log, landmarks: list[int] | None, *, distances: bool) -> Split:
    """Return how a recording replays with tuning and without."""
    chosen = None if landmarks is None else tuple(landmarks)
    settings = ReplaySettings(landmarks=chosen, distances=distances, window=0.0)
    tuning = tuned(log, settings, OPTIONS)
    rest = [replace(each, portion=(FIT_SHARE, 1.0)) for each in (settings, tuning.after)]
    given, fitted = (replay_with(log, each, OPTIONS) for each in rest)
    taken = replay_with(log, settings, OPTIONS, tuning)
    return Split(given, fitted, taken, tuning.verdict.error_ratio)


def draw(number: int) -> tuple[list[str], str]:
    """Return the row of a split."""
    if not REAL.exists():
        return [], ""
    portion, (name, landmarks, distances, _) = ROWS[number % len(ROWS)]
    log = part_of(recorded(), *PORTIONS[portion])
    split = compared(log, landmarks, distances=distances)
    harm = f"{portion}, {name}: {_error(split.taken):.3f} m, {_error(split.given):.3f} as given"
    return [] if split.does_no_harm else [harm], f"{portion:<12} {name:<29}{_row(split)}"


def _row(split: Split) -> str:
    errors = (_error(replay) for replay in (split.given, split.taken, split.fitted))
    both = (split.given, split.taken)
    taken = "taken" if split.taken.settings != split.given.settings else "refused"
    return " ".join(
        [
            "".join(f"{error:7.3f}" for error in errors),
            "".join(f"{replay.anees.value:6.2f}" for replay in both),
            "".join(f"{replay.nis.value:6.2f}" for replay in both),
            f"{split.error_ratio:7.3f} {taken}",
        ]
    )


def _error(replay: Replay) -> float:
    return float(replay.accuracy.overall().position)


def judge(cases: Mapping[int, str], chance: float) -> list[str]:
    """Print the table."""
    print(f"{'':<43}error in m            ANEES        NIS        errors of")
    print(f"{'':<43}given  tuned fitted   given tuned  given tuned predictions")
    print(*(cases.values() if REAL.exists() else [LACKING]), sep="\n")
    return []


SEARCH = Search(draw, judge, draws=len(CASES))
