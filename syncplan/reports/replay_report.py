"""Replays as documents: the filter on a recording of real robots."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.documents import Document, DocumentPart, OrAbsent, finite_or_none
from syncplan.estimation.recorded_observability import SeenOverTime
from syncplan.estimation.recorded_readings import true_poses
from syncplan.estimation.replay_results import KindCounts, Replay
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import Tuning
from syncplan.estimation.trials import series
from syncplan.reports import run_figures
from syncplan.reports.replay_notes import notes_of
from syncplan.results.quantities import plain, quantity
from syncplan.results.stories import Grid, Row, Story, Table, flat
from syncplan.scenario.filters import AUTO

_MOST_MOMENTS = 1000
"""Moments of the paths of a recording, after the first."""


class RobotFigures(Document):
    """Errors of one robot of a recording: a single trial, RMS over the samples after time 0.

    Where the recording has no truth, they are null and the filter's own figures take their place.
    """

    rms_m: float | None = quantity("position", unit="m", form=".3f")
    rms_second_half_m: float | None = quantity("2nd half", unit="m", form=".3f", drop=4)
    rms_x_m: float | None = quantity("x", unit="m", form=".3f", drop=1, order=-1)
    rms_y_m: float | None = quantity("y", unit="m", form=".3f", drop=2, order=-1)
    rms_heading_rad: float | None = quantity("heading", unit="rad", form=".3f")
    final_error_m: float | None = Field(description="At the last sample")
    coverage_3sigma: float | None = quantity(
        "3 sigma", "Share of coordinates within 3 sigma; ideal 0.9973", form=".4f", drop=3
    )
    name: str = quantity("robot", order=-2)
    final_x_m: OrAbsent[float] = quantity(
        "x",
        "Estimate at the last sample; absent where the truth is known",
        "m",
        form=".3f",
        default=None,
    )
    final_y_m: OrAbsent[float] = quantity("y", unit="m", form=".3f", default=None)
    final_heading_rad: OrAbsent[float] = quantity(
        "heading", unit="rad", form=".3f", default=None, drop=3
    )
    final_sigma_m: OrAbsent[float] = quantity(
        "sigma",
        "The filter's own position sigma at the last sample",
        "m",
        form=".3f",
        default=None,
    )
    final_sigma_heading_rad: OrAbsent[float] = quantity(
        "sigma", unit="rad", form=".3f", default=None, drop=1
    )
    rms_sigma_m: OrAbsent[float] = quantity(
        "RMS sigma over the run",
        "RMS of the filter's own position sigma over the run",
        "m",
        form=".3f",
        default=None,
        drop=2,
    )


class ReplayFilter(Document):
    """Assumptions of the filter about a recording; sigmas of motion are per sample.

    Values that are null in older files were not part of the filter then.
    """

    model: str | None = Field(default=None, description="Name of the filter", examples=["ekf"])
    bearing_sigma_rad: float
    range_sigma_m: float | None = Field(
        default=None, description="Null where distances are not recorded, or not asked for"
    )
    speed_sigma_mps: float
    turn_rate_sigma_rad_s: float
    speed_scale_sigma: float | None = Field(
        default=None,
        description="Sigma of the share by which each robot's speed readings are wrong",
    )
    turn_rate_bias_sigma_rad_s: float | None = None
    bearing_bias_sigma_rad: float | None = None
    bearing_walk_sigma_rad: OrAbsent[float] = Field(
        default=None, description="Sigma of the slowly changing bearing error; absent: not a state"
    )
    bearing_walk_time_s: OrAbsent[float] = Field(
        default=None, description="Time over which the correlation of that error falls to 1/e"
    )
    delay_s: float | None = Field(default=None, description="Delay from a sighting to its record")
    start: str | None = Field(
        default=None, description="Where the filter starts; at the truth where null"
    )
    position_sigma_m: float = Field(description="Of the start")
    heading_sigma_rad: float = Field(description="Of the start")
    sample_time_s: float = Field(description="Between the samples at which errors are taken")
    gate_probability: float = Field(description="Of the innovation gate; 1 accepts all")


class ReadingCounts(DocumentPart):
    """Numbers of readings of one kind that were used and, by reason, that were not."""

    used: int
    rejected: int = Field(description="Rejected by the gate")
    unknown: int = Field(description="Readings of unrecognised targets")
    not_asked_for: int = Field(description="Readings of landmarks or robots left out on purpose")
    outside: int = Field(description="Asked for, but from before or after the run")

    @property
    def words(self) -> str:
        """The counts in a line."""
        return (
            f"{self.used} used, {self.rejected} rejected by the gate, {self.unknown} of unknown "
            f"targets, {self.not_asked_for} not asked for, {self.outside} outside the run"
        )


class LastingError(DocumentPart):
    """A lasting error of one robot's odometry or camera, as estimated at the end."""

    name: str = Field(examples=["speed_scale"])
    robot: str
    unit: str
    value: float
    sigma: float


class GapRecord(DocumentPart):
    """An interval over which the team was not observable."""

    from_s: float = Field(description="Since the beginning of the run")
    to_s: float
    least_rank: int = Field(description="Of the windows that end in it")
    robots: list[str] = Field(description="Those of which some coordinate was not determined")


class SeenRecord(DocumentPart):
    """Observability over sliding windows of sightings, each judged for the step that ends it."""

    window_s: float
    step_s: float = Field(description="Between the ends of two windows")
    judged_s: float = Field(description="All in all, from when the first window ends")
    observable_s: float = Field(description="Part of it with full rank")
    certified_s: float = Field(description="Part of it with the certificate")
    longest_gap_s: float = Field(description="Longest time over which the team was not observable")
    state_dim: int
    gaps: list[GapRecord]
    median_position_sigma_m: float | None = Field(
        description="Sigma of the worst robot from one window alone, median over windows; null "
        "where more than half of them determine less than all"
    )


class Sigmas(Document):
    """Sigmas and delay that a replay fits; sigmas of motion are per sample."""

    bearing_sigma_rad: float
    range_sigma_m: float
    speed_sigma_mps: float
    turn_rate_sigma_rad_s: float
    bearing_walk_sigma_rad: OrAbsent[float] = Field(
        default=None, description="Sigma of the slowly changing bearing error; absent: not a state"
    )
    bearing_walk_time_s: OrAbsent[float] = Field(
        default=None, description="Time over which the correlation of that error falls to 1/e"
    )
    delay_s: float


class TuningRecord(Document):
    """Fit of sigmas and delay to the beginning of a recording, without its truth.

    Gains are mean gains in the log-likelihood of a sighting that the filter is not given.
    """

    fitted_s: float = Field(description="Length of what was fitted to; figures are of the rest")
    runs: int = Field(description="Of the filter")
    accepted: bool | None = Field(
        default=None,
        description="Whether the rest ran with what was fitted; with what was given if false. Null "
        "in older files, where it always did",
    )
    before: Sigmas
    after: Sigmas
    gain: float | None = Field(
        description="Over those fitted to; null where the filter diverges with what was given"
    )
    gain_on_rest: float | None = Field(
        description="Over the rest, which the fit has not seen; null where the filter diverges"
    )
    gain_on_rest_sigma: float | None = Field(
        default=None, description="Standard error of that; null in older files"
    )
    error_ratio: float | None = Field(
        default=None,
        description="RMS by which withheld sightings of the rest differ from predictions on "
        "average over 10 s, fitted over given; null where the filter diverges, and in older files",
    )
    error_ratio_sigma: float | None = Field(
        default=None, description="Standard error of that; null in older files"
    )
    white: bool | None = Field(
        default=None,
        description="Whether innovations of the rest are white, by NIS and sums over 10 s; if not, "
        "only a smaller error makes a fit acceptable. Null in older files",
    )
    bearing_growth: float = Field(
        description="Factor by which lasting errors enlarge the sigma of a bearing; at least 1"
    )
    range_growth: float = Field(description="The same of a distance")

    @property
    def grid(self) -> Grid:
        """What was assumed before and after, as a table."""
        before, after = self.before.as_json(), self.after.as_json()
        rows = [
            (key, *(f"{sigmas[key]:.4g}" if key in sigmas else "" for sigmas in (before, after)))
            for key in after | before
        ]
        refused = "" if self.accepted is not False else ", and refused"
        title = f"fitted to the first {self.fitted_s:.1f} s{refused}"
        return Grid(title, ("assumed", "before", "after"), rows)


class EstimatedPath(DocumentPart):
    """Estimates of one robot's pose over time, with the filter's own sigmas."""

    name: str
    x_m: list[float]
    y_m: list[float]
    heading_rad: list[float]
    sigma_m: list[float] = Field(description="Of the position")
    sigma_x_m: list[float]
    sigma_y_m: list[float]
    sigma_heading_rad: list[float]


class EstimateSeries(DocumentPart):
    """Estimates over time."""

    time_s: list[float]
    robots: list[EstimatedPath]


class RecordedPaths(DocumentPart):
    """Paths of the robots at up to 1,001 moments of the run, to 1 mm, and the landmarks used."""

    track_time_s: list[float]
    vehicles: list[run_figures.PathOverTime]
    landmarks: list[run_figures.GroundMark]


class ReplayDocument(run_figures.RunReport):
    """The filter on a recording of real robots, compared with the truth if it is known.

    Where the recording has no truth, all figures that compare with it are null.
    """

    drawn_as: ClassVar[str] = "run"

    begin_s: float = Field(description="When the run begins by the recording's clock")
    duration_s: float
    landmarks: list[int | str] = Field(
        description="Names, or numbers, of those whose sightings were asked for"
    )
    meetings: bool = Field(description="Whether sightings between robots were")
    filter: ReplayFilter
    position_rmse_m: float | None = Field(
        description="Over all robots and samples after the first; null without truth"
    )
    heading_rmse_rad: float | None
    robots: list[RobotFigures]
    coverage_3sigma: float | None
    anees: run_figures.Spread | None
    nis: run_figures.Spread = Field(description="Of all kinds of sighting")
    readings: ReadingCounts = Field(description="Of bearings")
    distances: ReadingCounts | None = Field(
        default=None, description="Null where distances are not recorded, or not asked for"
    )
    unknown_truth_s: float | None = Field(
        default=None,
        description="Time of the run in gaps of the truth, which errors leave out; null without "
        "truth, and in older files",
    )
    observability: SeenRecord | None = Field(
        default=None, description="Null where no windows were judged, and in older files"
    )
    tuning: TuningRecord | None = Field(
        default=None, description="Null where sigmas and delay were stated"
    )
    lasting_errors: list[LastingError] | None = Field(
        default=None, description="Those that are states of the filter; null in older files"
    )
    series: OrAbsent[run_figures.Series] = None
    estimates: OrAbsent[EstimateSeries] = Field(
        default=None, description="In place of `series` where the recording has no truth"
    )
    paths: OrAbsent[RecordedPaths] = Field(
        default=None, description="With `series` or `estimates`; absent in older files"
    )
    notes: list[str]

    @property
    def has_errors(self) -> bool:
        """Whether errors are known."""
        return self.position_rmse_m is not None

    @property
    def run(self) -> str:
        """Length of the run, in words."""
        return f"a recording of {self.duration_s:g} s"

    @property
    def vehicles(self) -> list[RobotFigures]:
        """The robots, under the name that all runs share."""
        return self.robots

    @property
    def trials(self) -> int:
        """Number of trials; a recording is a single one."""
        return 1

    def body(self) -> Story:
        """Yield errors or estimates, counts of readings, observability, what was fitted."""
        errors = "no truth, so errors are not known"
        title = "estimate at the end in m, and the filter's own sigmas"
        if self.has_errors:
            errors = (
                f"position {self.position_rmse_m:.3f} m, heading {self.heading_rmse_rad:.3f} rad "
                "RMS over all robots"
            )
            title = "RMS error in m over the run, and over its second half"
        yield f"[bold]{plain(self.name)}[/]: {self.run}; {errors}"
        yield f"bearings: {self.readings.words}"
        if self.distances is not None:
            yield f"distances: {self.distances.words}"
        yield Table(title, self.robots, stated="m")
        if (seen := self.observability) is not None:
            yield (
                f"observable over the last {seen.window_s:g} s during {seen.observable_s:.1f} of "
                f"{seen.judged_s:.1f} s, certified during {seen.certified_s:.1f} s; longest gap "
                f"{seen.longest_gap_s:.1f} s"
            )
        if self.tuning is not None:
            yield self.tuning.grid
        if self.lasting_errors:
            yield self._lasting
        if self.anees is not None:
            yield f"ANEES {self.anees.words()}"
        yield f"NIS   {self.nis.words()}"

    @property
    def _lasting(self) -> Grid:
        heads, robots = {}, {robot.name: [plain(robot.name)] for robot in self.robots}
        for error in self.lasting_errors or []:
            unit = "" if error.unit == "1" else error.unit
            heads[error.name] = f"{error.name.replace('_', ' ')} {unit}".rstrip()
            robots[error.robot].append(f"{error.value:.4f} ± {error.sigma:.4f}")
        title = "lasting errors at the end, with their sigmas"
        return Grid(title, ("robot", *heads.values()), list(robots.values()))

    def frame_rows(self) -> Iterator[Row]:
        """Yield the robots as rows of a data frame: only what is known with, or without, truth."""
        for robot in self.robots:
            known = {key: value for key, value in robot.as_json().items() if value is not None}
            yield flat(known)


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
        robots=[
            RobotFigures(
                name=name, **run_figures.errors_of(found.accuracy, k, float(found.coverage[k]))
            )
            for k, name in enumerate(names)
        ]
        if found
        else _estimates_of(replayed, names),
        coverage_3sigma=finite_or_none(float(found.coverage.mean())) if found else None,
        anees=run_figures.spread_of(found.anees) if found else None,
        nis=run_figures.spread_of(replayed.nis),
        readings=_counts(replayed.bearings),
        distances=_counts(distances) if (distances := _distances(replayed)) else None,
        unknown_truth_s=replayed.unknown_truth_s if found else None,
        observability=_seen(replayed.seen, names) if replayed.seen else None,
        tuning=_tuning(replayed.tuning) if replayed.tuning else None,
        lasting_errors=[
            LastingError(
                name=one.name, robot=one.robot, unit=one.unit, value=one.value, sigma=one.sigma
            )
            for one in replayed.lasting_errors
        ],
        series=run_figures.series_of(result, names, replayed.sample_time)
        if found and wanted
        else None,
        estimates=_series_of(replayed, names) if wanted and not found else None,
        paths=_paths_of(replayed, names) if wanted else None,
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
        median_position_sigma_m=finite_or_none(median),
    )


def _tuning(tuning: Tuning) -> TuningRecord:
    return TuningRecord(
        fitted_s=tuning.duration,
        runs=tuning.runs,
        before=_sigmas(tuning.before),
        after=_sigmas(tuning.after),
        accepted=tuning.accepted,
        gain=finite_or_none(tuning.gain),
        gain_on_rest=finite_or_none(tuning.verdict.gain),
        gain_on_rest_sigma=tuning.verdict.gain_sigma,
        error_ratio=finite_or_none(tuning.verdict.error_ratio),
        error_ratio_sigma=tuning.verdict.error_ratio_sigma,
        white=tuning.verdict.white,
        bearing_growth=tuning.bearing_growth,
        range_growth=tuning.range_growth,
    )


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
    """Counts of distances; None if none are recorded, or they were not asked for."""
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


def _estimates_of(replayed: Replay, names: list[str]) -> list[RobotFigures]:
    """Figures of robots without ground truth."""
    kept = series(replayed.result)
    last, sigmas = replayed.estimates[-1], kept.position_sigma
    whole = np.sqrt(np.mean(sigmas[1:] ** 2, axis=0))
    return [
        RobotFigures(
            name=name,
            **dict.fromkeys(
                run_figures.Errors.model_fields.keys() & RobotFigures.model_fields.keys()
            ),
            final_x_m=float(last[k, 0]),
            final_y_m=float(last[k, 1]),
            final_heading_rad=float(last[k, 2]),
            final_sigma_m=float(sigmas[-1, k]),
            final_sigma_heading_rad=float(kept.heading_sigma[-1, k]),
            rms_sigma_m=float(whole[k]),
        )
        for k, name in enumerate(names)
    ]


def _paths_of(replayed: Replay, names: list[str]) -> RecordedPaths:
    log, clock = replayed.log, replayed.clock
    moments = np.unique(
        np.linspace(0, clock.samples, min(clock.samples, _MOST_MOMENTS) + 1, dtype=int)
    )
    true = true_poses(log, clock)
    true[~(replayed.known & log.has_truth)] = np.nan
    true, estimated = true[moments], replayed.estimates[moments]
    return RecordedPaths(
        track_time_s=np.round(clock.times[moments], 6).tolist(),
        vehicles=[
            run_figures.PathOverTime.of(name, true[:, k], estimated[:, k])
            for k, name in enumerate(names)
        ],
        landmarks=[
            run_figures.GroundMark(name=str(name), position_m=tuple(place))
            for name, place in zip(log.landmark_names, log.landmarks.tolist(), strict=True)
            if name in replayed.landmarks
        ],
    )


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
