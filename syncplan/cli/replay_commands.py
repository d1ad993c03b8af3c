"""The command that runs the filter on a recording: replay."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import Output, Shown, takes_options
from syncplan.cli.console import (
    Format,
    announce_compilation,
    check_output,
    deliver_document,
    progress_bar,
)
from syncplan.estimation.replay_settings import ReplayOptions

if TYPE_CHECKING:
    from syncplan.recordings.log import Log
    from syncplan.reports.replay_report import ReplayDocument

replays = typer.Typer()


Recording = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="Recording: folder of CSV files, of those of MRCLAM, or a ROS 2 bag; or its archive",
    ),
]


@replays.command(
    name="replay",
    epilog="Example: syncplan replay mrclam6 --landmarks 7,15 --series -o report.json",
)
@takes_options(ReplayOptions)
def _replay(
    log: Recording,
    output: Output = None,
    format_: Shown = Format.auto,
    *,
    options: ReplayOptions,
) -> int:
    """Run the filter on recorded odometry and sightings, and compare it with the truth if recorded.

    Without truth, the report has estimates and the filter's own sigmas in place of errors.
    """
    recording = _opened(log, output)
    known = {str(name): name for name in recording.landmark_names}
    if options.landmarks is not None:
        numbered = tuple(known.get(str(name), name) for name in options.landmarks)
        options = replace(options, landmarks=numbered)
    document = _document(recording, options)
    deliver_document("replay", document, output, format_)
    return 0


def _document(recording: "Log", asked: ReplayOptions) -> "ReplayDocument":
    """The report of a replay, with its progress on the way."""
    from syncplan.estimation.recorded_starts import check_start
    from syncplan.estimation.replay_tuning import MOST_RUNS, tuned
    from syncplan.estimation.replays import replay_with
    from syncplan.reports.replay_report import replay_document

    settings, options = asked.settings, asked.filter_options
    check_start(settings, recording.name, has_truth=recording.has_truth)
    announce_compilation(options, [(len(recording.robots), settings.has_lasting_errors)])
    tuning = None
    if asked.tune:
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
