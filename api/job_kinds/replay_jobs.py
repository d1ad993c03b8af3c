"""Replays: the filter run on a stored recording of real robots."""

import json
from typing import Annotated, Literal

from pydantic import Field, Strict

from api.job_kinds.job_kind import (
    EarlierWork,
    JobKind,
    JobOperation,
    JobReport,
    JobRequest,
    JobSpec,
    JobSubject,
    Progress,
    WholeTask,
)
from api.limits import RequestLimits, check_replay_work
from syncplan.errors import InputError
from syncplan.estimation.filter_options import LARGEST_SEED
from syncplan.estimation.filters import RecordingFilterName
from syncplan.estimation.recorded_starts import check_start
from syncplan.estimation.replay_requests import options_of_request, settings_of_request
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import FIT_SHARE, MOST_RUNS
from syncplan.estimation.replays import OPTIONS
from syncplan.recordings.log import Overview, chosen_landmarks
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.scenario.quantities import Many, Name

_USUAL = ReplaySettings()

Positive = Annotated[float, Field(ge=1e-6, le=1e6)]
Amount = Annotated[float, Field(ge=0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e12, le=1e12)]
Pose = Annotated[tuple[Coordinate, Coordinate, Coordinate], Strict(False)]


class ReplayRequest(JobRequest):
    """What the filter assumes of a recording, and which of its sightings it is given."""

    landmarks: Many[int | Name] | None = Field(
        default=None,
        description="Names, or numbers, of those whose sightings count; all if not given",
        examples=[[7, 15]],
    )
    meetings: bool = Field(default=True, description="Whether sightings between robots count")
    distances: bool = Field(default=True, description="Whether distances count, where recorded")
    bearing_sigma_rad: Positive = Field(default=_USUAL.bearing_sigma, description="Of a bearing")
    range_sigma_m: Positive = Field(default=_USUAL.range_sigma, description="Of a distance")
    speed_sigma_mps: Amount = Field(
        default=_USUAL.noise.speed_sigma, description="Of the speed, per sample"
    )
    turn_rate_sigma_rad_s: Amount = Field(
        default=_USUAL.noise.turn_rate_sigma, description="Of the turn rate, per sample"
    )
    speed_scale_sigma: Amount = Field(
        default=_USUAL.speed_scale_sigma,
        description="Of the share by which a robot's speeds are wrong; 0: not a state",
    )
    turn_rate_bias_sigma_rad_s: Amount = Field(
        default=_USUAL.turn_rate_bias_sigma,
        description="Of a robot's turn-rate bias; 0: not a state",
    )
    bearing_bias_sigma_rad: Amount = Field(
        default=_USUAL.bearing_bias_sigma,
        description="Of a robot's bearing bias (mounting); 0: not a state",
    )
    bearing_walk_sigma_rad: Amount = Field(
        default=_USUAL.bearing_walk_sigma,
        description="Of a robot's bearing error that changes slowly; 0: not a state",
    )
    bearing_walk_time_s: Positive = Field(
        default=_USUAL.bearing_walk_time,
        description="Over which the correlation of that error falls to 1/e",
    )
    delay_s: Annotated[float, Field(ge=-60, le=60)] = Field(
        default=_USUAL.delay, description="By how much sightings are recorded late"
    )
    window_s: Amount = Field(
        default=_USUAL.window,
        description="Length of windows of sightings whose rank is judged together; 0 judges none",
    )
    start: Literal["truth", "prior", "given"] = Field(
        default="truth",
        description="Start at the truth, drawn about it by the start's sigmas, or where given, "
        "which a recording without truth needs",
    )
    start_poses: Many[Pose] | None = Field(
        default=None, description="x, y and heading of each robot, where the start is given"
    )
    start_sigma_m: Amount | None = Field(
        default=None, description="Of each start coordinate; 0.01, 5 or 1 by the start"
    )
    start_sigma_rad: Amount | None = Field(
        default=None, description="Of each start heading; 0.01, 0.5 or 0.2 by the start"
    )
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = Field(
        default=OPTIONS.seed, description="Of a start that is drawn"
    )
    tune: bool = Field(
        default=False, description="Fit sigmas and delay to the first third, and run on the rest"
    )
    filter: RecordingFilterName = Field(default=OPTIONS.filter, description="Which filter runs")
    sample_time_s: Positive = Field(
        default=_USUAL.sample_time,
        description="Between samples; sigmas of motion are of so long a reading",
    )
    gate_probability: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.999, description="Of the innovation gate; 1 accepts every sighting"
    )
    series: bool = Field(default=False, description="Add errors and sigmas over time")

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of sightings that are filtered, at most.

        Raises InputError if that exceeds a limit.
        """
        assert isinstance(subject, Overview)
        chosen_landmarks(subject.landmarks, self.landmarks)
        asked = self.model_dump(exclude_none=True)
        settings = settings_of_request(asked)
        check_start(settings, subject.name, has_truth=subject.has_truth)
        options_of_request(asked)
        sightings = subject.bearings + subject.distances * self.distances
        check_replay_work(sightings, len(subject.robots), limits)
        return max(sightings, 1) + (_fitted(sightings, MOST_RUNS) if self.tune else 0)


def _fitted(sightings: int, runs: int) -> int:
    """Sightings that are filtered in runs on the beginning of a recording."""
    return int(runs * FIT_SHARE * sightings)


def _replayed(spec: JobSpec, _earlier: EarlierWork, _workers: int, progress: Progress) -> JobReport:
    from syncplan.estimation.replay_tuning import tuned
    from syncplan.estimation.replays import replay_with
    from syncplan.recordings.log import unpack_log
    from syncplan.reports.replay_report import replay_document
    from syncplan.runtime.files import as_text

    if spec.recording is None:
        raise InputError("the recording was deleted; send it again", key="recording_id")
    log, asked = unpack_log(spec.recording), json.loads(spec.request)
    settings, options = settings_of_request(asked), options_of_request(asked)
    sightings = sum(len(robot.times) for robot in log.robots)
    tuning, before = None, 0
    if asked["tune"]:
        tuning = tuned(log, settings, options, lambda runs: progress(_fitted(sightings, runs)))
        before = _fitted(sightings, MOST_RUNS)
    replayed = replay_with(log, settings, options, tuning, lambda seen: progress(before + seen))
    return JobReport(as_text(replay_document(replayed).as_json()))


REPLAY = JobKind(
    name="replay",
    title="replay",
    plural="replays",
    unit="sightings",
    request=ReplayRequest,
    operation=JobOperation(
        id="replayRecording",
        path="/recordings/{recording_id}/replays",
        summary="Replay a recording",
        description="Run the filter on what real robots recorded: a job that reports errors "
        "against the recorded truth, if there is any, and consistency.",
        body="What the filter assumes; defaults if empty",
        body_required=False,
    ),
    task=WholeTask(compute=_replayed),
    report=ReplayDocument,
    figures="run",
)
