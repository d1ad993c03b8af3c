"""Replays: the filter run on recordings of real robots."""

from typing import Any

from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.studies.study import ALONE, DocumentKind, Execution, Study


class Replays(Study):
    """The filter run on what real robots recorded."""

    name, verb, of = "replay", "replay", "recording"
    sentence = (
        "Run the filter on recorded odometry and sightings, and compare it with the truth if "
        "recorded."
    )
    unit = "sightings"
    options = ReplayOptions
    body = "What the filter assumes; defaults if empty"
    document = DocumentKind("syncplan.reports.replay_report", "ReplayDocument", title="Replay")

    def work(self, subject: Any, options: ReplayOptions) -> int:
        """Return the largest number of sightings that may be filtered; `subject` is an Overview."""
        sightings = subject.bearings + subject.distances * options.distances
        return int(max(sightings, 1)) + (_fitted(sightings) if options.tune else 0)

    def run(self, subject: Any, options: ReplayOptions, how: Execution = ALONE) -> Any:
        """Return the replay of a log, whose settings are fitted first if the options say so."""
        from syncplan.estimation.replay_tuning import MOST_RUNS, tuned
        from syncplan.estimation.replays import replay_with

        settings, filtering = options.settings, options.filter_options
        sightings = sum(len(robot.times) for robot in subject.robots)
        tuning, before = None, 0
        if options.tune:
            before = _fitted(sightings)
            tuning = tuned(
                subject, settings, filtering, lambda runs: how.progress(before * runs // MOST_RUNS)
            )
        return replay_with(
            subject, settings, filtering, tuning, lambda seen: how.progress(before + seen)
        )


def _fitted(sightings: int) -> int:
    """Number of sightings filtered while settings are fitted to the beginning of a recording."""
    from syncplan.estimation.replay_tuning import FIT_SHARE, MOST_RUNS

    return int(MOST_RUNS * FIT_SHARE * sightings)
