"""A replay as a document, with what its figures mean in words."""

import numpy as np

from syncplan import __version__
from syncplan.estimation.filters import AUTO
from syncplan.estimation.recorded_observability import SeenOverTime
from syncplan.estimation.replay_results import ErrorsFromTruth, KindCounts, Replay
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import Tuning
from syncplan.estimation.trials import series
from syncplan.reports.replay_notes import notes_of
from syncplan.reports.replay_schemas import (
    EstimatedPath,
    EstimateSeries,
    GapRecord,
    LastingError,
    ReadingCounts,
    ReplayDocument,
    ReplayFilter,
    RobotFigures,
    SeenRecord,
    Sigmas,
    TuningRecord,
)
from syncplan.reports.validation_report import series_of, spread_of

_ERRORS = (
    *("rms_m", "rms_second_half_m", "rms_x_m", "rms_y_m", "rms_heading_rad"),
    *("final_error_m", "coverage_3sigma"),
)
"""Figures of a robot that take truth."""


def replay_document(replayed: Replay) -> ReplayDocument:
    """Return the report of the filter on a recording."""
    names = [robot.name for robot in replayed.log.robots]
    result, found = replayed.result, replayed.from_truth
    overall = found.accuracy.overall() if found else None
    wanted = replayed.options.with_series
    return ReplayDocument(
        version=__version__,
        name=replayed.log.name,
        begin_s=replayed.begin,
        duration_s=replayed.duration,
        landmarks=list(replayed.landmarks),
        meetings=replayed.meetings,
        filter=_filter(replayed),
        position_rmse_m=float(overall.position) if overall else None,
        heading_rmse_rad=float(overall.heading) if overall else None,
        robots=_errors_of(found, names) if found else _estimates_of(replayed, names),
        coverage_3sigma=float(found.coverage.mean()) if found else None,
        anees=spread_of(found.anees) if found else None,
        nis=spread_of(replayed.nis),
        readings=_counts(replayed.bearings),
        distances=_counts(distances) if (distances := _distances(replayed)) else None,
        observability=_seen(replayed.seen, names) if replayed.seen else None,
        tuning=_tuning(replayed.tuning) if replayed.tuning else None,
        lasting_errors=[
            LastingError(
                name=one.name, robot=one.robot, unit=one.unit, value=one.value, sigma=one.sigma
            )
            for one in replayed.lasting_errors
        ],
        series=series_of(result, names, replayed.sample_time) if found and wanted else None,
        estimates=_series_of(replayed, names) if wanted and not found else None,
        notes=notes_of(replayed),
    )


def _filter(replayed: Replay) -> ReplayFilter:
    settings, noise = replayed.settings, replayed.noise
    return ReplayFilter(
        model="ekf" if replayed.options.filter == AUTO else replayed.options.filter,
        bearing_sigma_rad=settings.bearing_sigma,
        range_sigma_m=settings.range_sigma if _distances(replayed) else None,
        speed_sigma_mps=noise.speed_sigma,
        turn_rate_sigma_rad_s=noise.turn_rate_sigma,
        speed_scale_sigma=settings.speed_scale_sigma,
        turn_rate_bias_sigma_rad_s=settings.turn_rate_bias_sigma,
        bearing_bias_sigma_rad=settings.bearing_bias_sigma,
        bearing_walk_sigma_rad=settings.bearing_walk_sigma or None,
        bearing_walk_time_s=settings.bearing_walk_time if settings.bearing_walk_sigma else None,
        delay_s=settings.delay,
        start=settings.start,
        position_sigma_m=noise.position_sigma,
        heading_sigma_rad=noise.heading_sigma,
        sample_time_s=replayed.sample_time,
        gate_probability=replayed.gate_probability,
    )


def _seen(seen: SeenOverTime, names: list[str]) -> SeenRecord:
    median = float(np.median(seen.position_sigmas))
    return SeenRecord(
        window_s=round(seen.window, 9),
        step_s=round(seen.step, 9),
        judged_s=round(seen.judged, 9),
        observable_s=round(seen.observable, 9),
        certified_s=round(seen.certified, 9),
        longest_gap_s=round(seen.longest_gap, 9),
        state_dim=seen.state_dim,
        gaps=[
            GapRecord(
                from_s=round(gap.begin, 9),
                to_s=round(gap.end, 9),
                least_rank=gap.least_rank,
                robots=[names[k] for k in gap.robots],
            )
            for gap in seen.gaps
        ],
        median_position_sigma_m=median if np.isfinite(median) else None,
    )


def _tuning(tuning: Tuning) -> TuningRecord:
    return TuningRecord(
        fitted_s=tuning.duration,
        runs=tuning.runs,
        before=_sigmas(tuning.before),
        after=_sigmas(tuning.after),
        accepted=tuning.accepted,
        gain=_finite(tuning.gain),
        gain_on_rest=_finite(tuning.verdict.gain),
        gain_on_rest_sigma=tuning.verdict.gain_sigma,
        error_ratio=_finite(tuning.verdict.error_ratio),
        error_ratio_sigma=tuning.verdict.error_ratio_sigma,
        white=tuning.verdict.white,
        bearing_growth=tuning.bearing_growth,
        range_growth=tuning.range_growth,
    )


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _sigmas(settings: ReplaySettings) -> Sigmas:
    return Sigmas(
        bearing_sigma_rad=settings.bearing_sigma,
        range_sigma_m=settings.range_sigma,
        speed_sigma_mps=settings.noise.speed_sigma,
        turn_rate_sigma_rad_s=settings.noise.turn_rate_sigma,
        bearing_walk_sigma_rad=settings.bearing_walk_sigma or None,
        bearing_walk_time_s=settings.bearing_walk_time if settings.bearing_walk_sigma else None,
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


def _errors_of(found: ErrorsFromTruth, names: list[str]) -> list[RobotFigures]:
    accuracy = found.accuracy
    return [
        RobotFigures(
            name=name,
            rms_m=float(accuracy.position[k]),
            rms_second_half_m=float(accuracy.late_position[k]),
            rms_x_m=float(accuracy.x[k]),
            rms_y_m=float(accuracy.y[k]),
            rms_heading_rad=float(accuracy.heading[k]),
            final_error_m=float(accuracy.final_position[k]),
            coverage_3sigma=float(found.coverage[k]),
        )
        for k, name in enumerate(names)
    ]


def _estimates_of(replayed: Replay, names: list[str]) -> list[RobotFigures]:
    """Figures of robots of whom it is not known where they truly were."""
    kept = series(replayed.result)
    last, sigmas = replayed.estimates[-1], kept.position_sigma
    whole = np.sqrt(np.mean(sigmas[1:] ** 2, axis=0))
    return [
        RobotFigures(
            name=name,
            **dict.fromkeys(_ERRORS),
            final_x_m=float(last[k, 0]),
            final_y_m=float(last[k, 1]),
            final_heading_rad=float(last[k, 2]),
            final_sigma_m=float(sigmas[-1, k]),
            final_sigma_heading_rad=float(kept.heading_sigma[-1, k]),
            rms_sigma_m=float(whole[k]),
        )
        for k, name in enumerate(names)
    ]


def _series_of(replayed: Replay, names: list[str]) -> EstimateSeries:
    kept, poses = series(replayed.result), replayed.estimates
    return EstimateSeries(
        time_s=replayed.clock.times.tolist(),
        robots=[
            EstimatedPath(
                name=name,
                x_m=poses[:, k, 0].tolist(),
                y_m=poses[:, k, 1].tolist(),
                heading_rad=poses[:, k, 2].tolist(),
                sigma_m=kept.position_sigma[:, k].tolist(),
                sigma_x_m=kept.axis_sigma[:, k, 0].tolist(),
                sigma_y_m=kept.axis_sigma[:, k, 1].tolist(),
                sigma_heading_rad=kept.heading_sigma[:, k].tolist(),
            )
            for k, name in enumerate(names)
        ],
    )
