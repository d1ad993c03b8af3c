"""Search for starts and settings from which a recording of real robots is not found.

    python -m tests.searches.search_recording [SEEDS]

Part of `make check-all`, where the recording lies beside the checkout: data set 6 of MRCLAM, see
docs/how-to/replay-a-log.md. The robust filter runs on it with the sigmas by default, with bearings
alone and with distances, with two of the 15 landmarks and with all. The table has position errors,
RMS over all robots, in m: over the whole run from the truth, and over its last two thirds with
sigmas fitted to the first; after the first minute from the truth, and from starts drawn about it by
5 m and 0.5 rad, the median and the largest of some seeds. Fails where an error over the whole run
is over its limit, one with fitted sigmas over 1.1 times that limit, or one from a drawn start over
1.1 times that from the truth.
"""

import sys
import time
from typing import Any

import numpy as np

from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replays import replay
from syncplan.estimation.trials import series
from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.tools.recordings import REAL

CASES: list[tuple[str, list[int] | None, bool, float]] = [
    ("bearings, landmarks 7 and 15", [7, 15], False, 0.195),
    ("bearings, all landmarks", None, False, 0.115),
    ("and distances, 7 and 15", [7, 15], True, 0.165),
    ("and distances, all", None, True, 0.112),
]
"""Name, landmarks, whether distances count, and the largest error allowed, m."""

WORSE = 1.1
"""How many times as large errors may be with fitted sigmas, or from another start."""


def after_a_minute(found: Replay) -> float:
    """Return the RMS position error of a replay with series from the 60th second on, m."""
    errors = series(found.result).position_rms[round(60.0 / found.sample_time) :]
    return float(np.sqrt(np.mean(errors**2)))


def main(seeds: int = 8) -> bool:
    """Print the table; return whether no error is too large."""
    if not REAL.exists():
        print(f"needs the recording {REAL.name} beside the checkout: nothing was run")
        return True
    log = load_log(REAL)
    print("                               from the truth    after a minute")
    print("                               whole    fitted   truth   drawn   worst    s a run")
    rows = [_row(log, *case, seeds) for case in CASES]
    print(f"{seeds} seeds; {sum(rows)} of {len(rows)} as good as they are to be")
    return all(rows)


def _row(
    log: Log, name: str, landmarks: list[int] | None, distances: bool, limit: float, seeds: int
) -> bool:
    given: dict[str, Any] = {"landmarks": landmarks, "distances": distances, "with_series": True}
    began = time.perf_counter()
    known = replay(log, **given)
    taken = time.perf_counter() - began
    whole = _overall(known)
    # a fit takes the first third and runs on the rest
    fitted = _overall(replay(log, tune=True, **given))
    minute = after_a_minute(known)
    drawn = [after_a_minute(replay(log, start="prior", seed=k, **given)) for k in range(seeds)]
    print(
        f"{name:<30}{whole:6.3f}{fitted:10.3f}{minute:8.3f}{np.median(drawn):8.3f}"
        f"{max(drawn):8.3f}{taken:10.2f}"
    )
    return whole <= limit and fitted <= WORSE * limit and max(drawn) <= WORSE * minute


def _overall(found: Replay) -> float:
    return float(found.accuracy.overall().position)


if __name__ == "__main__":
    sys.exit(not main(*(int(argument) for argument in sys.argv[1:])))
