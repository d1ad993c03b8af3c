"""Search for starts and settings from which a recording of real robots is not recovered.

Needs the recording beside the checkout: data set 6 of MRCLAM, see docs/how-to/replay-a-log.md. The
robust filter runs on it with the sigmas by default, with bearings alone and with distances, with
two of the 15 landmarks and with all: a case is one of these four in turn, and a start drawn about
the truth by 5 m and 0.5 rad. The table has position errors, RMS over all robots, in m: over the
whole run from the truth, and over its last two thirds with sigmas fitted to the first; after the
first minute from the truth, and from the drawn starts, the median and the largest. Fails where an
error over the whole run is over its limit, one with fitted sigmas over 1.1 times that limit, or one
from a drawn start over 1.1 times that from the truth.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from syncplan.estimation.replay_results import Replay
from syncplan.estimation.replays import replay
from syncplan.estimation.trials import series
from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.searches import Search
from tests.tools.kept_values import once_a_run
from tests.tools.recordings import REAL

CASES: list[tuple[str, list[int] | None, bool, float]] = [
    ("bearings, landmarks 7 and 15", [7, 15], False, 0.195),
    ("bearings, all landmarks", None, False, 0.115),
    ("and distances, 7 and 15", [7, 15], True, 0.165),
    ("and distances, all", None, True, 0.112),
]
"""Name, landmarks, whether distances count, and the largest error allowed, m."""

LACKING = f"needs the recording {REAL.name} beside the checkout: nothing was run"

WORSE = 1.1
"""How many times as large errors may be with fitted sigmas, or from another start."""


def after_a_minute(replayed: Replay) -> float:
    """Return the RMS position error, m, of a replay with series from the 60th second on.

    Samples whose truth is not known are left out.
    """
    errors = series(replayed.result).position_rms[round(60.0 / replayed.sample_time) :]
    return float(np.sqrt(np.nanmean(errors**2)))


@lru_cache(maxsize=1)
def recorded() -> Log:
    """Return the recording."""
    return load_log(REAL)


def _replay(row: int, **options: Any) -> Replay:
    _, landmarks, distances, _ = CASES[row]
    return replay(recorded(), landmarks=landmarks, distances=distances, with_series=True, **options)


@once_a_run
def _from_truth(row: int) -> tuple[float, float, float]:
    """Errors from the truth over the whole run, with a fit, and after a minute."""
    # a fit takes the first third and runs on the rest
    known, fitted = _replay(row), _replay(row, tune=True)
    whole, rest = (float(run.accuracy.overall().position) for run in (known, fitted))
    return whole, rest, after_a_minute(known)


def draw(number: int) -> tuple[list[str], tuple[float, ...]]:
    """Return errors from the truth, and after a minute from a drawn start."""
    if not REAL.exists():
        return [], ()
    row, seed = number % len(CASES), number // len(CASES)
    name, _, _, limit = CASES[row]
    whole, fitted, minute = _from_truth(row)
    drawn = after_a_minute(_replay(row, start="prior", seed=seed))
    limits = {"whole": limit, "fitted": WORSE * limit, "from a drawn start": WORSE * minute}
    faults = [
        f"{name}: {what} {error:.3f} m, at most {most:.3f}"
        for (what, most), error in zip(limits.items(), (whole, fitted, drawn), strict=True)
        if not error <= most
    ]
    return faults, (whole, fitted, minute, drawn)


def judge(cases: Mapping[int, tuple[float, ...]], chance: float) -> list[str]:
    """Print the table."""
    print("                               from the truth    after a minute")
    print("                               whole    fitted   truth   drawn   worst   starts")
    for row, (name, *_) in enumerate(CASES):
        errors = [case for number, case in cases.items() if case and number % len(CASES) == row]
        if errors:
            whole, fitted, minute, drawn = np.median(errors, axis=0)
            print(
                f"{name:<30}{whole:6.3f}{fitted:10.3f}{minute:8.3f}{drawn:8.3f}"
                f"{max(case[-1] for case in errors):8.3f}{len(errors):9d}"
            )
    if not REAL.exists():
        print(LACKING)
    return []


SEARCH = Search(draw, judge, draws=len(CASES))
