"""The command that runs the filter on a recording: replay."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import Output, Seed, Series, Shown
from syncplan.cli.console import (
    Format,
    announce_compilation,
    check_output,
    deliver_document,
    progress_bar,
)
from syncplan.estimation.filters import FOR_RECORDINGS

if TYPE_CHECKING:
    from syncplan.estimation.filter_options import FilterChanges
    from syncplan.estimation.replay_settings import ReplaySettings
    from syncplan.recordings.log import Log
    from syncplan.reports.replay_schemas import ReplayDocument

replays = typer.Typer()


Filter = StrEnum("Filter", {name: name for name in FOR_RECORDINGS})  # type: ignore[misc]
DEFAULT_FILTER = Filter("robust")


class StartKind(StrEnum):
    """Where the filter starts."""

    truth = "truth"
    prior = "prior"
    given = "given"


Recording = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="Recording: folder of CSV files, of those of MRCLAM, or a ROS 2 bag; or its archive",
    ),
]
FilterOption = Annotated[Filter, typer.Option("--filter", help="Which filter runs")]
Landmarks = Annotated[
    str,
    typer.Option(help="Landmarks whose sightings count: names such as 7,15, or all, or none"),
]
Meetings = Annotated[bool, typer.Option(help="Whether sightings between robots count")]
Distances = Annotated[bool, typer.Option(help="Whether distances count, where recorded")]
BearingSigma = Annotated[float, typer.Option(help="Sigma of a bearing that the filter assumes")]
RangeSigma = Annotated[float, typer.Option(help="Sigma of a distance that the filter assumes")]
SpeedSigma = Annotated[float, typer.Option(help="Assumed sigma of the speed, per sample")]
TurnRateSigma = Annotated[float, typer.Option(help="Assumed sigma of the turn rate, per sample")]
SpeedScaleSigma = Annotated[
    float,
    typer.Option(help="Sigma of the share by which a robot's speeds are wrong; 0: not a state"),
]
TurnRateBiasSigma = Annotated[
    float, typer.Option(help="Sigma of a robot's turn-rate bias; 0: not a state")
]
BearingBiasSigma = Annotated[
    float, typer.Option(help="Sigma of a robot's bearing bias (mounting); 0: not a state")
]
BearingWalkSigma = Annotated[
    float,
    typer.Option(help="Sigma of a robot's bearing error that changes slowly; 0: not a state"),
]
BearingWalkTime = Annotated[
    float, typer.Option(help="Time over which the correlation of that error falls to 1/e")
]
Delay = Annotated[
    float, typer.Option(help="By how much sightings are recorded later than they were made")
]
Start = Annotated[
    StartKind,
    typer.Option(
        help="Start at the truth, drawn about it by the start's sigmas, or where given, which a "
        "recording without truth needs"
    ),
]
Poses = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|X,Y,RAD;...", help="Start poses of --start given", show_default=False
    ),
]
StartSigma = Annotated[
    float | None,
    typer.Option(
        help="Sigma of each start coordinate; 0.01, 5 or 1 by --start", show_default=False
    ),
]
StartHeadingSigma = Annotated[
    float | None,
    typer.Option(
        help="Sigma of each start heading; 0.01, 0.5 or 0.2 by --start", show_default=False
    ),
]
Window = Annotated[
    float, typer.Option(help="Sightings whose rank is judged together; 0 judges none")
]
Tune = Annotated[
    bool,
    typer.Option("--tune", help="Fit sigmas and delay to the first third, and run on the rest"),
]
SampleTime = Annotated[
    float, typer.Option(help="Time between samples; sigmas of motion are of so long a reading")
]
Gate = Annotated[
    float, typer.Option(help="Probability of the innovation gate; 1 accepts every sighting")
]


@replays.command(
    name="replay",
    epilog="Example: syncplan replay mrclam6 --landmarks 7,15 --series -o report.json",
)
def _replay(
    log: Recording,
    output: Output = None,
    format_: Shown = Format.auto,
    landmarks: Landmarks = "all",
    meetings: Meetings = True,
    distances: Distances = True,
    bearing_sigma_rad: BearingSigma = 0.01,
    range_sigma_m: RangeSigma = 0.4,
    speed_sigma_mps: SpeedSigma = 0.09,
    turn_rate_sigma_rad_s: TurnRateSigma = 0.22,
    speed_scale_sigma: SpeedScaleSigma = 0.05,
    turn_rate_bias_sigma_rad_s: TurnRateBiasSigma = 0.01,
    bearing_bias_sigma_rad: BearingBiasSigma = 0.0,
    bearing_walk_sigma_rad: BearingWalkSigma = 0.0,
    bearing_walk_time_s: BearingWalkTime = 10.0,
    delay_s: Delay = 0.0,
    start: Start = StartKind.truth,
    start_poses: Poses = None,
    start_sigma_m: StartSigma = None,
    start_sigma_rad: StartHeadingSigma = None,
    seed: Seed = 0,
    window_s: Window = 30.0,
    tune: Tune = False,
    filter_: FilterOption = DEFAULT_FILTER,
    sample_time_s: SampleTime = 0.05,
    gate: Gate = 0.999,
    series: Series = False,
) -> int:
    """Run the filter on recorded odometry and sightings, and compare it with the truth if recorded.

    Without truth, the report has estimates and the filter's own sigmas in place of errors.
    """
    from syncplan.cli.start_option import poses_of
    from syncplan.estimation.replay_settings import START_SIGMAS, ReplaySettings
    from syncplan.orbits.sensors import Noise

    recording, known_to = _opened(log, output), START_SIGMAS[start.value]
    settings = ReplaySettings(
        landmarks=_named(landmarks, recording.landmark_names),
        meetings=meetings,
        distances=distances,
        bearing_sigma=bearing_sigma_rad,
        range_sigma=range_sigma_m,
        noise=Noise(
            speed_sigma=speed_sigma_mps,
            turn_rate_sigma=turn_rate_sigma_rad_s,
            position_sigma=known_to[0] if start_sigma_m is None else start_sigma_m,
            heading_sigma=known_to[1] if start_sigma_rad is None else start_sigma_rad,
        ),
        speed_scale_sigma=speed_scale_sigma,
        turn_rate_bias_sigma=turn_rate_bias_sigma_rad_s,
        bearing_bias_sigma=bearing_bias_sigma_rad,
        bearing_walk_sigma=bearing_walk_sigma_rad,
        bearing_walk_time=bearing_walk_time_s,
        sample_time=sample_time_s,
        delay=delay_s,
        start=start.value,
        window=window_s,
        start_poses=None if start_poses is None else poses_of(start_poses),
    )
    changes: FilterChanges = {
        "gate_probability": gate,
        "seed": seed,
        "filter": filter_.value,
        "with_series": series,
    }
    document = _document(recording, settings, changes, tune=tune)
    deliver_document("replay", document, output, format_)
    return 0


def _document(
    recording: "Log", settings: "ReplaySettings", changes: "FilterChanges", *, tune: bool
) -> "ReplayDocument":
    """The report of a replay, with its progress on the way."""
    from syncplan.estimation.recorded_starts import check_start
    from syncplan.estimation.replay_tuning import MOST_RUNS, tuned
    from syncplan.estimation.replays import replay_options, replay_with
    from syncplan.reports.replay_report import replay_document

    check_start(settings, recording.name, has_truth=recording.has_truth)
    options = replay_options(None, changes)
    announce_compilation(options, [(len(recording.robots), settings.has_lasting_errors)])
    tuning = None
    if tune:
        with progress_bar("filter runs", MOST_RUNS) as progress:
            tuning = tuned(recording, settings, options, progress)
    readings = sum(len(robot.times) for robot in recording.robots) * (1 + settings.distances)
    with progress_bar("sightings", readings) as progress:
        replayed = replay_with(recording, settings, options, tuning, progress)
    return replay_document(replayed)


def _opened(folder: Path, output: Path | None) -> "Log":
    """The recording, none of whose files is the output, which can be written."""
    from syncplan.recordings.recording_formats import load_log, recorded_files_in

    check_output(output)
    recording = load_log(folder)
    check_output(output, *map(str, recorded_files_in(folder)))
    return recording


def _named(text: str, known: Sequence[int | str]) -> tuple[int | str, ...] | None:
    """The landmarks of an option, None for all."""
    if text == "all":
        return None
    if text == "none":
        return ()
    names = {str(name): name for name in known}
    return tuple(names.get(word, word) for word in map(str.strip, text.split(",")))
