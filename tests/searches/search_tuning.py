"""Search for recordings of real robots on which `replay --tune` does harm.

    python -m tests.searches.search_tuning [PORTION ...]

Part of `make check-all`, where the recording lies beside the checkout: data set 6 of MRCLAM, see
docs/how-to/replay-a-log.md. 12 splits: bearings alone and with distances, of two of the 15
landmarks and of all, in the whole recording and in each half of it, or in the portions named
(whole, first-half, second-half). Sigmas and delay are fitted to the first third of each; errors are
of its other two thirds, RMS over all robots in m, with what was given by default and with what
`--tune` took. `fitted` has errors with the fit whether it was taken or refused, beside how much
larger errors of predictions of withheld sightings were with it: what `--tune` judges by. Fails
where the error is more than 2 % larger than by default.
"""

import sys
from dataclasses import dataclass, replace

from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import FIT_SHARE, tuned
from syncplan.estimation.replays import OPTIONS, replay_with
from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.searches.search_recording import CASES
from tests.tools.recordings import REAL, part_of

PORTIONS = {"whole": (0.0, 1.0), "first-half": (0.0, 0.5), "second-half": (0.5, 1.0)}
"""Shares of the recording at which a split begins and ends."""

WORSE = 1.02
"""How many times as large an error may be."""


@dataclass(frozen=True, slots=True)
class Split:
    """Replays of what was not fitted to.

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
    """Return what tuning is worth on a recording."""
    chosen = None if landmarks is None else tuple(landmarks)
    settings = ReplaySettings(landmarks=chosen, distances=distances, window=0.0)
    tuning = tuned(log, settings, OPTIONS)
    rest = [replace(one, portion=(FIT_SHARE, 1.0)) for one in (settings, tuning.after)]
    given, fitted = (replay_with(log, one, OPTIONS) for one in rest)
    taken = replay_with(log, settings, OPTIONS, tuning)
    return Split(given, fitted, taken, tuning.verdict.error_ratio)


def main(*portions: str) -> bool:
    """Print the table; return whether tuning did no harm."""
    if not REAL.exists():
        print(f"needs the recording {REAL.name} beside the checkout: nothing was run")
        return True
    whole = load_log(REAL)
    print(f"{'':<43}error in m            ANEES        NIS        errors of")
    print(f"{'':<43}given  tuned fitted   given tuned  given tuned predictions")
    sound = []
    for portion in portions or PORTIONS:
        log = part_of(whole, *PORTIONS[portion])
        for name, landmarks, distances, _ in CASES:
            split = compared(log, landmarks, distances=distances)
            print(f"{portion:<12} {name:<29}{_row(split)}", flush=True)
            sound.append(split.does_no_harm)
    print(f"{sum(sound)} of {len(sound)} no more than {WORSE - 1.0:.0%} worse")
    return all(sound)


def _row(split: Split) -> str:
    errors = [_error(one) for one in (split.given, split.taken, split.fitted)]
    both = (split.given, split.taken)
    return (
        "".join(f"{one:7.3f}" for one in errors)
        + " "
        + "".join(f"{one.anees.value:6.2f}" for one in both)
        + " "
        + "".join(f"{one.nis.value:6.2f}" for one in both)
        + f"{split.error_ratio:8.3f} "
        + ("taken" if split.taken.settings != split.given.settings else "refused")
    )


def _error(found: Replay) -> float:
    return float(found.accuracy.overall().position)


if __name__ == "__main__":
    sys.exit(not main(*sys.argv[1:]))
