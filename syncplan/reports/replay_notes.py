"""Notes on the meaning of a replay's figures, and on faults of its recording."""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.consistency import Consistency
from syncplan.estimation.recorded_readings import longest_gap
from syncplan.estimation.recorded_run import BLOCK_S
from syncplan.estimation.replay_results import KindCounts, Replay
from syncplan.estimation.replay_tuning import Tuning
from syncplan.phrases import listed
from syncplan.reports.run_figures import Spread, interval_words, spread_of

LONG_PAUSE_S = 2.0
"""Length above which a time without odometry is worth a note."""

SHARE_WORTH_TELLING = 0.01
"""Share of a recording above which an unused part is worth a note."""

MOST_BEARING_RAD = 6.5
"""Largest plausible bearing: a turn, with a little to spare."""

MOST_NAMED = 8

LEAST_FLOOR = 0.9
"""Share of a sigma: a floor that lasting errors set above it leaves no room for a smaller one."""

OTHER_CAUSES = "clocks, units or places do not fit"


def notes_of(replayed: Replay) -> list[str]:
    """Return notes on the meaning of the figures, and on faults of the recording."""
    return [
        *replayed.log.notes,
        *_truth_notes(replayed),
        *_tuning_notes(replayed.tuning),
        *_readings_notes(replayed),
        *_observability_notes(replayed),
        *_consistency_notes(replayed),
        *_span_notes(replayed),
        *_odometry_notes(replayed),
        *_gap_notes(replayed),
    ]


def _truth_notes(replayed: Replay) -> list[str]:
    if replayed.from_truth is not None:
        return []
    return [
        "the recording has no truth: errors, ANEES and coverage are not known; sigmas are the "
        "filter's own"
    ]


def _tuning_notes(tuning: Tuning | None) -> list[str]:
    if tuning is None:
        return []
    verdict, kept = tuning.verdict, "the rest runs with those that were given"
    notes = [
        f"sigmas and delay are fitted to the first {tuning.duration:.1f} s, without truth; figures "
        "are of the rest"
    ]
    if tuning.used.start == "given":
        notes.append(
            "the rest starts where the filter was at the end of what sigmas were fitted to, as "
            "well known as its least known robot"
        )
    if not np.isfinite(verdict.gain):
        if not tuning.accepted:
            notes.append(f"the fit is refused, {kept}: the filter diverges with it")
        return notes
    if verdict.is_better and not tuning.accepted:
        notes.append(
            f"the fit is refused, {kept}: a delay of {tuning.after.delay:.3g} s does as much by "
            "itself; state it if sightings are that late"
        )
        return notes
    worth = (
        f"sightings of the rest that the filter is not given are likelier by {verdict.gain:.3f} ± "
        f"{verdict.gain_sigma:.3f} in the logarithm, and over {BLOCK_S:g} s they differ from "
        f"predictions {verdict.error_ratio:.3f} ± {verdict.error_ratio_sigma:.3f} times as much"
    )
    if not verdict.white:
        worth += "; innovations are not white, so likelier alone is not enough"
    notes.append(worth if tuning.accepted else f"the fit is refused, {kept}: with it, {worth}")
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


def _observability_notes(replayed: Replay) -> list[str]:
    seen = replayed.seen
    if seen is None or not seen.gaps:
        return []
    begin = f"the sightings of the last {seen.window:g} s"
    if seen.observable == 0.0:
        return [f"{begin} never determined where all robots were: the filter lives on its start"]
    longest = max(seen.gaps, key=lambda gap: gap.end - gap.begin)
    robots = listed([replayed.log.robots[k].name for k in longest.robots], MOST_NAMED)
    missing = seen.judged - seen.observable
    return [
        f"{begin} did not determine where all robots were during {missing:.1f} of "
        f"{seen.judged:.1f} s; longest from {longest.begin:.1f} to {longest.end:.1f} s ({robots})"
    ]


def _consistency_notes(replayed: Replay) -> list[str]:
    settings = replayed.settings
    notes = []
    if replayed.from_truth is not None:
        lasts = any(one.lasting.lasts for one in replayed.counts.values())
        notes = _error_notes(spread_of(replayed.anees), replayed.nis, lasts=lasts)
    assumed = {
        "bearing": f"{settings.bearing_sigma:g} rad",
        "distance": f"{settings.range_sigma:g} m",
    }
    for name, count in replayed.counts.items():
        nis = spread_of(count.nis)
        found, few = f"(NIS {interval_words(nis)})", f"their sigma may be less than {assumed[name]}"
        if nis.verdict == "optimistic":
            notes.append(
                f"{name}s scatter more than the filter expects {found}: their sigma may be more "
                f"than {assumed[name]}"
            )
        elif nis.verdict == "conservative" and count.lasting.lasts:
            notes.append(
                f"{name}s scatter less than the filter expects {found}, but their errors last: "
                f"sums over {BLOCK_S:g} s are {np.sqrt(count.lasting.ratio):.1f} times those of "
                f"errors that do not; {_floor_words(count, few)}"
            )
        elif nis.verdict == "conservative":
            notes.append(f"{name}s scatter less than the filter expects {found}: {few}")
    return notes


def _floor_words(count: KindCounts, few: str) -> str:
    """Words on how far lasting errors let a sigma fall."""
    floor = np.sqrt(count.nis.value * count.lasting.ratio)
    if floor < LEAST_FLOOR:
        return f"{few}, but no less than {floor:.1g} times that"
    return "a smaller sigma would make the filter surer than it is"


def _error_notes(anees: Spread, nis: Consistency, *, lasts: bool) -> list[str]:
    """Notes on the ANEES."""
    if anees.verdict == "optimistic" and nis.verdict != "optimistic" and lasts:
        return [
            f"the filter makes larger errors than its sigmas say (ANEES {interval_words(anees)}) "
            f"though its innovations fit (NIS {nis.value:.2f}): the mark of sightings whose errors "
            "last; larger sigmas of sightings make up for that, smaller ones do not"
        ]
    if anees.verdict == "optimistic":
        return [
            f"the filter makes larger errors than its sigmas say (ANEES {interval_words(anees)}): "
            f"they are too small for these robots, or {OTHER_CAUSES}"
        ]
    if anees.verdict == "conservative":
        return [
            f"the filter makes smaller errors than its sigmas say (ANEES {interval_words(anees)}): "
            "they may be smaller"
        ]
    return []


def _span_notes(replayed: Replay) -> list[str]:
    """Notes on parts of a recording that are unused because one robot lacks truth or odometry."""
    log = replayed.log
    what = "truth" if log.has_truth else "odometry"
    times = {one.name: (one.truth if log.has_truth else one.odometry)[:, 0] for one in log.robots}
    begins = {name: float(one[0]) for name, one in times.items()}
    ends = {name: float(one[-1]) for name, one in times.items()}
    late, early = max(begins, key=lambda name: begins[name]), min(ends, key=lambda name: ends[name])
    lost = {
        f"the {what} of {late} begins": begins[late] - min(begins.values()),
        f"the {what} of {early} ends": max(ends.values()) - ends[early],
    }
    whole = max(ends.values()) - min(begins.values())
    return [
        f"{lost_by} {time:.1f} s {way}: that part of the recording is not used"
        for (lost_by, time), way in zip(lost.items(), ("late", "early"), strict=True)
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


def _gap_notes(replayed: Replay) -> list[str]:
    missing = replayed.unknown_truth_s
    if not missing:
        return []
    gaps = _gaps(replayed, [robot.truth for robot in replayed.log.robots])
    name, gap = max(gaps, key=lambda gap: gap[1])
    return [
        f"the truth has gaps, {missing:.1f} s in all, the longest of {gap:.2f} s ({name}): errors "
        "there are not known, and figures leave them out"
    ]


def _gaps(replayed: Replay, tables: list[Array]) -> list[tuple[str, float]]:
    """Name of each robot, and longest gap in s between rows of its table."""
    return [
        (robot.name, longest_gap(table[:, 0], replayed.begin, replayed.duration))
        for robot, table in zip(replayed.log.robots, tables, strict=True)
    ]
