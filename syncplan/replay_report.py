"""A replay as a document, with what its figures mean in words."""

from typing import Any

from syncplan.document import ReadingCounts, ReplayDocument, ReplayFilter, RobotFigures
from syncplan.replays import Replay
from syncplan.trials import Accuracy
from syncplan.validation_report import series_of, spread_of

__all__ = ["replay_document"]

LONG_GAP_S = 0.5
"""A gap of the truth worth telling."""


def replay_document(replayed: Replay) -> ReplayDocument:
    """Return the report of the filter on a recording."""
    from syncplan import __version__

    names = [robot.name for robot in replayed.log.robots]
    result, overall = replayed.result, replayed.accuracy.overall()
    return ReplayDocument(
        version=__version__,
        name=replayed.log.name,
        duration_s=replayed.duration,
        landmarks=list(replayed.landmarks),
        meetings=replayed.meetings,
        filter=ReplayFilter(
            bearing_sigma_rad=replayed.bearing_sigma,
            speed_sigma_mps=replayed.noise.speed_sigma,
            turn_rate_sigma_rad_s=replayed.noise.turn_rate_sigma,
            sample_time_s=replayed.sample_time,
            gate_probability=replayed.gate_probability,
        ),
        position_rmse_m=float(overall.position),
        heading_rmse_rad=float(overall.heading),
        robots=[
            RobotFigures(
                name=name,
                coverage_3sigma=float(replayed.coverage[k]),
                **_figures(replayed.accuracy, k),
            )
            for k, name in enumerate(names)
        ],
        coverage_3sigma=float(replayed.coverage.mean()),
        anees=spread_of(replayed.anees),
        nis=spread_of(replayed.nis),
        readings=ReadingCounts(
            used=int(result.accepted.sum()),
            rejected=int(result.gated.sum()),
            unknown=replayed.unknown,
            left_out=replayed.left_out,
        ),
        series=series_of(result, names, replayed.sample_time) if result.branches else None,
        notes=_notes(replayed, names),
    )


def _figures(accuracy: Accuracy, robot: int) -> dict[str, Any]:
    return {
        "rms_m": float(accuracy.position[robot]),
        "rms_second_half_m": float(accuracy.late_position[robot]),
        "rms_x_m": float(accuracy.x[robot]),
        "rms_y_m": float(accuracy.y[robot]),
        "rms_heading_rad": float(accuracy.heading[robot]),
        "final_error_m": float(accuracy.final_position[robot]),
    }


def _notes(replayed: Replay, names: list[str]) -> list[str]:
    notes = []
    used, rejected = int(replayed.result.accepted.sum()), int(replayed.result.gated.sum())
    if not used + rejected:
        notes.append("no bearing was used: this is odometry alone")
    elif rejected > used:
        notes.append(
            f"the gate rejected {rejected} of {used + rejected} bearings: the filter has lost its "
            "way, or its sigmas are too small"
        )
    figure = replayed.anees
    if figure.verdict == "optimistic":
        notes.append(
            f"the filter makes larger errors than its sigmas say (ANEES {figure.value:.2f} above "
            f"{figure.band[1]:.2f}): give it larger ones"
        )
    elif figure.verdict == "conservative":
        notes.append(
            f"the filter makes smaller errors than its sigmas say (ANEES {figure.value:.2f} below "
            f"{figure.band[0]:.2f}): they may be smaller"
        )
    for name, gap in zip(names, replayed.longest_gap.tolist(), strict=True):
        if gap > LONG_GAP_S:
            notes.append(
                f"the truth of {name} has a gap of {gap:.2f} s: its errors there are from a "
                "straight line"
            )
    return notes
