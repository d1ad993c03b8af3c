"""A replay as a document, with what its figures mean in words."""

from typing import Any

import numpy as np

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import Tuning
from syncplan.estimation.replays import KindCounts, Replay, longest_gap
from syncplan.estimation.trials import Accuracy
from syncplan.reports.consistency_words import interval_words
from syncplan.reports.replay_schemas import (
    LastingError,
    ReadingCounts,
    ReplayDocument,
    ReplayFilter,
    RobotFigures,
    Sigmas,
    TuningRecord,
)
from syncplan.reports.validation_report import series_of, spread_of

__all__ = ["replay_document"]


LONG_GAP_S = 0.5
"""A gap of the truth worth a note."""

LONG_PAUSE_S = 2.0
"""A time without odometry worth a note."""

SHARE_WORTH_TELLING = 0.01
"""Of a recording, where it can't be used."""

MOST_BEARING_RAD = 6.5
"""Beyond a turn, with a little to spare."""

OTHER_CAUSES = "clocks, units or places do not fit"


def replay_document(replayed: Replay) -> ReplayDocument:
    """Return the report of the filter on a recording."""
    names = [robot.name for robot in replayed.log.robots]
    result, overall = replayed.result, replayed.accuracy.overall()
    return ReplayDocument(
        version=__version__,
        name=replayed.log.name,
        begin_s=replayed.begin,
        duration_s=replayed.duration,
        landmarks=list(replayed.landmarks),
        meetings=replayed.meetings,
        filter=_filter(replayed),
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
        readings=_counts(replayed.bearings),
        distances=_counts(distances) if (distances := _distances(replayed)) else None,
        tuning=_tuning(replayed.tuning) if replayed.tuning else None,
        lasting_errors=[
            LastingError(
                name=one.name, robot=one.robot, unit=one.unit, value=one.value, sigma=one.sigma
            )
            for one in replayed.lasting_errors
        ],
        series=series_of(result, names, replayed.sample_time) if result.branches else None,
        notes=_notes(replayed),
    )


def _filter(replayed: Replay) -> ReplayFilter:
    settings, noise = replayed.settings, replayed.noise
    return ReplayFilter(
        model=replayed.options.model,
        bearing_sigma_rad=settings.bearing_sigma,
        range_sigma_m=settings.range_sigma if _distances(replayed) else None,
        speed_sigma_mps=noise.speed_sigma,
        turn_rate_sigma_rad_s=noise.turn_rate_sigma,
        speed_scale_sigma=settings.speed_scale_sigma,
        turn_rate_bias_sigma_rad_s=settings.turn_rate_bias_sigma,
        bearing_bias_sigma_rad=settings.bearing_bias_sigma,
        delay_s=settings.delay,
        start=settings.start,
        position_sigma_m=noise.position_sigma,
        heading_sigma_rad=noise.heading_sigma,
        sample_time_s=replayed.sample_time,
        gate_probability=replayed.gate_probability,
    )


def _tuning(tuning: Tuning) -> TuningRecord:
    return TuningRecord(
        fitted_s=tuning.duration,
        runs=tuning.runs,
        before=_sigmas(tuning.before),
        after=_sigmas(tuning.after),
        gain=tuning.gain,
        gain_on_rest=tuning.gain_on_rest,
        bearing_growth=tuning.bearing_growth,
        range_growth=tuning.range_growth,
    )


def _sigmas(settings: ReplaySettings) -> Sigmas:
    return Sigmas(
        bearing_sigma_rad=settings.bearing_sigma,
        range_sigma_m=settings.range_sigma,
        speed_sigma_mps=settings.noise.speed_sigma,
        turn_rate_sigma_rad_s=settings.noise.turn_rate_sigma,
        delay_s=settings.delay,
    )


def _distances(replayed: Replay) -> KindCounts | None:
    """What became of distances; None where none is recorded, or they were not asked for."""
    recorded = any(np.isfinite(robot.ranges).any() for robot in replayed.log.robots)
    return replayed.counts.get("distance") if recorded else None


def _counts(counts: KindCounts) -> ReadingCounts:
    return ReadingCounts(
        used=counts.used,
        rejected=counts.rejected,
        unknown=counts.left_out.unknown,
        not_asked_for=counts.left_out.not_asked_for,
        outside=counts.left_out.outside,
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


def _notes(replayed: Replay) -> list[str]:
    """What the figures mean for the reader, and what of the recording is amiss, in plain words."""
    return [
        *_tuning_notes(replayed.tuning),
        *_readings_notes(replayed),
        *_consistency_notes(replayed),
        *_span_notes(replayed),
        *_odometry_notes(replayed),
        *(
            f"the truth of {name} has a gap of {gap:.2f} s: its errors there are from a straight "
            "line"
            for name, gap in _gaps(replayed, [robot.truth for robot in replayed.log.robots])
            if gap > LONG_GAP_S
        ),
    ]


def _tuning_notes(tuning: Tuning | None) -> list[str]:
    if tuning is None:
        return []
    notes = [
        f"sigmas and delay are fitted to the first {tuning.duration:.1f} s, without truth; figures "
        "are of the rest"
    ]
    if tuning.gain_on_rest < 0.0:
        notes.append(
            "those that were given explain the rest better: the recording changes on its way, or "
            "its first third shows too little"
        )
    return notes


def _readings_notes(replayed: Replay) -> list[str]:
    kinds = replayed.counts.items()
    used, rejected, outside = (
        sum(count)
        for count in zip(*((k.used, k.rejected, k.left_out.outside) for _, k in kinds), strict=True)
    )
    notes = []
    if used + rejected + outside == 0:
        notes.append("no sighting was used: this is odometry alone")
    elif used + rejected == 0:
        notes.append(
            f"all {outside} bearings and distances that were asked for are from before or after "
            "the run: by another clock? This is odometry alone"
        )
    for name, count in kinds:
        if count.rejected > count.used:
            notes.append(
                f"the gate rejected {count.rejected} of {count.used + count.rejected} {name}s: the "
                f"filter has lost its way, its sigmas are too small, or {OTHER_CAUSES}"
            )
    largest = max(
        np.abs(robot.bearings[np.isfinite(robot.bearings)]).max(initial=0.0)
        for robot in replayed.log.robots
    )
    if largest > MOST_BEARING_RAD:
        notes.append(f"bearings of up to {largest:.4g} rad: are they in degrees?")
    return notes


def _consistency_notes(replayed: Replay) -> list[str]:
    notes = []
    anees, settings = spread_of(replayed.anees), replayed.settings
    if anees.verdict == "optimistic":
        notes.append(
            f"the filter makes larger errors than its sigmas say (ANEES {interval_words(anees)}): "
            f"they are too small for these robots, or {OTHER_CAUSES}"
        )
    elif anees.verdict == "conservative":
        notes.append(
            f"the filter makes smaller errors than its sigmas say (ANEES {interval_words(anees)}): "
            "they may be smaller"
        )
    assumed = {
        "bearing": f"{settings.bearing_sigma:g} rad",
        "distance": f"{settings.range_sigma:g} m",
    }
    for name, count in replayed.counts.items():
        nis = spread_of(count.nis)
        if nis.verdict == "optimistic":
            notes.append(
                f"{name}s scatter more than the filter expects (NIS {interval_words(nis)}): their "
                f"sigma may be more than {assumed[name]}"
            )
        elif nis.verdict == "conservative":
            notes.append(
                f"{name}s scatter less than the filter expects (NIS {interval_words(nis)}): their "
                f"sigma may be less than {assumed[name]}"
            )
    return notes


def _span_notes(replayed: Replay) -> list[str]:
    """Where the truth of some robots is known for much longer than that of all."""
    robots = replayed.log.robots
    begins = {robot.name: float(robot.truth[0, 0]) for robot in robots}
    ends = {robot.name: float(robot.truth[-1, 0]) for robot in robots}
    late, early = max(begins, key=lambda name: begins[name]), min(ends, key=lambda name: ends[name])
    lost = {
        f"the truth of {late} begins": begins[late] - min(begins.values()),
        f"the truth of {early} ends": max(ends.values()) - ends[early],
    }
    whole = max(ends.values()) - min(begins.values())
    return [
        f"{what} {time:.1f} s {way}: that part of the recording is not used"
        for (what, time), way in zip(lost.items(), ("late", "early"), strict=True)
        if time > max(LONG_PAUSE_S, SHARE_WORTH_TELLING * whole)
    ]


def _odometry_notes(replayed: Replay) -> list[str]:
    begin, end = replayed.begin, replayed.begin + replayed.duration
    read = {robot.name: robot.odometry[:, 0] for robot in replayed.log.robots}
    late = {name: float(times[0]) - begin for name, times in read.items()}
    early = {name: end - float(times[-1]) for name, times in read.items()}
    missing = (("begins late; till then they", late), ("ends early; from then on they", early))
    notes = []
    for what, times in missing:
        long = [f"{name} {time:.1f} s" for name, time in times.items() if time > LONG_PAUSE_S]
        if long:
            notes.append(f"odometry {what} count as standing still: {', '.join(long)}")
    return notes + [
        f"the odometry of {name} has a gap of {gap:.2f} s: its last reading counts meanwhile"
        for name, gap in _gaps(replayed, [robot.odometry for robot in replayed.log.robots])
        if gap > LONG_PAUSE_S
    ]


def _gaps(replayed: Replay, tables: list[Array]) -> list[tuple[str, float]]:
    """The longest gap in s of each robot's table of times."""
    return [
        (robot.name, longest_gap(table[:, 0], replayed.begin, replayed.duration))
        for robot, table in zip(replayed.log.robots, tables, strict=True)
    ]
