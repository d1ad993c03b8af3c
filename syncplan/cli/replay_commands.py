"""The command that runs the filter on a recording: replay."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from syncplan.cli.arguments import Output, Series, Shown
from syncplan.cli.console import (
    Format,
    announce_compilation,
    deliver_document,
    refuse_overwriting,
)

__all__ = ["replays"]

replays = typer.Typer()

Recording = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="Recording: folder of CSV files, of those of MRCLAM, or a ROS 2 bag; or its archive",
    ),
]
Landmarks = Annotated[
    str,
    typer.Option(help="Landmarks whose bearings count: names such as 7,15, or all, or none"),
]
Meetings = Annotated[bool, typer.Option(help="Whether bearings between robots count")]
BearingSigma = Annotated[float, typer.Option(help="Sigma of a bearing that the filter assumes")]
SpeedSigma = Annotated[float, typer.Option(help="Assumed sigma of the speed, per sample")]
TurnRateSigma = Annotated[float, typer.Option(help="Assumed sigma of the turn rate, per sample")]
SampleTime = Annotated[float, typer.Option(help="Time between the filter's samples")]
Gate = Annotated[
    float, typer.Option(help="Probability of the innovation gate; 1 accepts every bearing")
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
    bearing_sigma_rad: BearingSigma = 0.08,
    speed_sigma_mps: SpeedSigma = 0.15,
    turn_rate_sigma_rad_s: TurnRateSigma = 0.5,
    sample_time_s: SampleTime = 0.05,
    gate: Gate = 0.999,
    series: Series = False,
) -> int:
    """Run the filter on recorded odometry and bearings, and compare it with the recorded truth.

    The filter starts at the truth and uses bearings, not ranges.
    """
    from dataclasses import replace

    from syncplan.estimation.replays import GROUND_ROBOTS, OPTIONS, replay
    from syncplan.recordings.recording_formats import load_log, recorded_files_in
    from syncplan.reports.replay_report import replay_document

    recording = load_log(log)
    chosen = _named(landmarks, recording.landmark_names)
    for recorded in recorded_files_in(log):
        refuse_overwriting(str(recorded), output)
    announce_compilation(OPTIONS, [(len(recording.robots), False)])
    noise = replace(
        GROUND_ROBOTS, speed_sigma=speed_sigma_mps, turn_rate_sigma=turn_rate_sigma_rad_s
    )
    replayed = replay(
        recording,
        landmarks=chosen,
        meetings=meetings,
        bearing_sigma=bearing_sigma_rad,
        noise=noise,
        sample_time=sample_time_s,
        gate_probability=gate,
        with_series=series,
    )
    deliver_document("replay", replay_document(replayed), output, format_)
    return 0


def _named(text: str, known: Sequence[int | str]) -> list[int | str] | None:
    """The landmarks of an option, None for all."""
    if text == "all":
        return None
    if text == "none":
        return []
    names = {str(name): name for name in known}
    return [names.get(word, word) for word in map(str.strip, text.split(","))]
