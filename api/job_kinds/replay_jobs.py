"""Replays: the filter run on a stored recording of real robots."""

import json
from dataclasses import replace
from typing import Annotated

from pydantic import Field, Strict

from api.job_kinds.job_kind import (
    EarlierWork,
    JobKind,
    JobReport,
    JobRequest,
    JobSpec,
    JobSubject,
    Progress,
    WholeTask,
)
from api.job_kinds.option_requests import takes_options
from api.limits import RequestLimits, check_replay_work
from syncplan.errors import InputError
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.estimation.replay_tuning import FIT_SHARE, MOST_RUNS, tuned
from syncplan.recordings.log import Overview, chosen_landmarks, unpack_log
from syncplan.reports.replay_report import ReplayDocument, replay_document
from syncplan.runtime.files import as_text
from syncplan.scenario.quantities import Many, Name

Coordinate = Annotated[float, Field(ge=-1e12, le=1e12)]
Pose = Annotated[tuple[Coordinate, Coordinate, Coordinate], Strict(False)]


@takes_options(ReplayOptions, landmarks=Many[int | Name] | None, start_poses=Many[Pose] | None)
class ReplayRequest(JobRequest):
    """Settings of a replay: the filter's assumptions and the sightings it is given."""

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the largest number of sightings that may be filtered.

        Raises InputError if that exceeds a limit.
        """
        assert isinstance(subject, Overview)
        asked = ReplayOptions.of_request(self.model_dump(exclude_none=True))
        chosen_landmarks(subject.landmarks, asked.landmarks)
        asked.check_start(subject.name, has_truth=subject.has_truth)
        sightings = subject.bearings + subject.distances * asked.distances
        check_replay_work(sightings, len(subject.robots), limits)
        return max(sightings, 1) + (_fitted(sightings, MOST_RUNS) if asked.tune else 0)


def _fitted(sightings: int, runs: int) -> int:
    """Number of sightings filtered in runs on the beginning of a recording."""
    return int(runs * FIT_SHARE * sightings)


def _replayed(spec: JobSpec, _earlier: EarlierWork, _workers: int, progress: Progress) -> JobReport:
    from syncplan.estimation.replays import replay_with

    if spec.recording is None or spec.overview is None:
        raise InputError("the recording was deleted; send it again", key="recording_id")
    # it may have been renamed since it was packed
    log = replace(unpack_log(spec.recording), name=json.loads(spec.overview)["name"])
    asked = ReplayOptions.of_request(json.loads(spec.request))
    settings, options = asked.settings, asked.filter_options
    sightings = sum(len(robot.times) for robot in log.robots)
    tuning, before = None, 0
    if asked.tune:
        tuning = tuned(log, settings, options, lambda runs: progress(_fitted(sightings, runs)))
        before = _fitted(sightings, MOST_RUNS)
    replayed = replay_with(log, settings, options, tuning, lambda seen: progress(before + seen))
    return JobReport(as_text(replay_document(replayed).as_json()))


REPLAY = JobKind(
    name="replay",
    unit="sightings",
    request=ReplayRequest,
    operation="replayRecording",
    summary="Replay a recording",
    description="Run the filter on what real robots recorded: a job that reports errors "
    "against the recorded truth, if there is any, and consistency.",
    body="What the filter assumes; defaults if empty",
    about="recording",
    task=WholeTask(compute=_replayed),
    report=ReplayDocument,
    figures="run",
)
