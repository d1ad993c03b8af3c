"""Export of a plan in any format of the table."""

from dataclasses import replace

import numpy as np

from syncplan.errors import InputError, NoGoError
from syncplan.exporting.exported_files import Export, ExportedFile, as_archive, write_files
from syncplan.exporting.format_table import ALL, FORMATS, ExportFormat, ExportOptions
from syncplan.exporting.mission_routes import snapped_radii
from syncplan.exporting.missions import flies_loiter_turns
from syncplan.exporting.scheduled_plan import ScheduledPlan, scheduled, stated_altitude
from syncplan.exporting.sidecar import sidecar_file
from syncplan.orbits.circles import extent
from syncplan.planning.planner import BoundChoice, judge
from syncplan.planning.plans import Plan
from syncplan.scenario.ground import map_departure

__all__ = [
    "ALL",
    "FORMATS",
    "Export",
    "ExportFormat",
    "ExportOptions",
    "ExportedFile",
    "as_archive",
    "export",
    "write_files",
]

MAP_ERROR_M = 0.5
"""Departure of the flat map from which a note reports it."""


def export(plan: Plan, format: str, options: ExportOptions | None = None) -> Export:
    """Return a plan as the files of a format, with a sidecar for what they can't hold.

    `all` returns the files of every format, each in a folder of its name; formats that need a
    geo_origin are left out if there is none. Nothing is written to disk; equal input gives equal
    bytes.

    Raises InputError for an unknown format, a missing geo_origin or library, and a plan that the
    format can't hold; NoGoError for a plan whose verdict has a stop, unless options force it.
    """
    asked = ExportOptions() if options is None else options
    if format == ALL:
        return _all(plan, asked)
    if format not in FORMATS:
        raise InputError(f"{format!r}: must be one of {', '.join(FORMATS)} or {ALL}", key="format")
    chosen = FORMATS[format]
    if chosen.only_for not in (None, asked.autopilot):
        others = ", ".join(n for n, one in FORMATS.items() if one.mission and one.only_for is None)
        raise InputError(
            f"{asked.autopilot}: the format {format} is for {chosen.only_for} alone; "
            f"choose {others}",
            key="autopilot",
        )
    flown = scheduled(plan, asked, chosen.altitude_m)
    notes = _altitude_notes(flown, chosen)
    if chosen.on_earth:
        notes += _map_notes(flown)
    if chosen.mission and asked.snap_radius and flies_loiter_turns(flown):
        flown, snapped = _snapped(flown)
        notes += snapped
    if not asked.force:
        _check_go(flown.plan)
    written = chosen.write(flown)
    written = replace(written, notes=(*notes, *written.notes, *_basis_notes(flown.plan)))
    files = (*written.files, sidecar_file(flown, format, written))
    return Export(format, files, written.notes)


def _basis_notes(plan: Plan) -> list[str]:
    """Note that no flights bear out a GO."""
    verdict = plan.verdict
    if not verdict.go or verdict.flown:
        return []
    return [verdict.headline + (f" ({plan.dropped_flights})" if plan.dropped_flights else "")]


def _check_go(plan: Plan) -> None:
    """Raise NoGoError unless the plan can be flown."""
    verdict = plan.verdict
    if verdict.go:
        return
    first, *others = (f"{one.code}: {one.message}" for one in verdict.stops)
    more = f" (and {len(others)} more)" if others else ""
    raise NoGoError(
        f"{verdict.headline}; {first}{more}; export it all the same with --force (library and "
        "service: force)"
    )


def _all(plan: Plan, options: ExportOptions) -> Export:
    """Export every format that the scenario allows."""
    placed = plan.scenario.geo_origin is not None
    if placed:
        why = f"the autopilot is {options.autopilot}"
        fitting = (None, options.autopilot)
        left_out = [name for name, one in FORMATS.items() if one.only_for not in fitting]
    else:
        why = "the scenario has no geo_origin"
        left_out = [name for name, one in FORMATS.items() if one.on_earth]
    exports, refused = [], []
    for name in FORMATS:
        try:
            if name not in left_out:
                exports.append(export(plan, name, options))
        except InputError as error:
            # radii that a mission can't hold must not prevent the other formats
            if error.key != "orbit.radius_m":
                raise
            refused.append(f"{name} is left out: {error.problem}")
    notes = [f"{one.format}: {note}" for one in exports for note in one.notes]
    if left_out:
        refused.insert(0, f"left out, because {why}: {', '.join(left_out)}")
    notes = [*refused, *notes]
    files = [
        ExportedFile(f"{one.format}/{file.name}", file.content)
        for one in exports
        for file in one.files
    ]
    return Export(ALL, tuple(files), tuple(notes))


def _altitude_notes(flown: ScheduledPlan, chosen: ExportFormat) -> list[str]:
    """Note that vehicles fly at the altitude of a format, as none is stated."""
    if not chosen.altitude_m or stated_altitude(flown.plan, flown.options) is not None:
        return []
    stacked = ", each a step above the last" if flown.options.altitude_step_m else ""
    return [
        f"no altitude is given: vehicles fly at {chosen.altitude_m:g} m, the default of this "
        f"format{stacked}; state "
        "altitude_m in the scenario or for the export"
    ]


def _map_notes(flown: ScheduledPlan) -> list[str]:
    departure = map_departure(flown.origin, extent(flown.plan.orbits, flown.plan.landmarks))
    if departure < MAP_ERROR_M:
        return []
    return [
        f"distances on the flat map and on the ground differ by up to {departure:.2g} m over the "
        "team's extent; put geo_origin in its middle"
    ]


def _snapped(flown: ScheduledPlan) -> tuple[ScheduledPlan, list[str]]:
    """The plan with radii that ArduPilot can store, judged again by the exact code, and notes."""
    plan = flown.plan
    radii = snapped_radii(plan.orbits.radii)
    moved = np.abs(radii - plan.orbits.radii)
    if not moved.any():
        return flown, []
    orbit = plan.scenario.orbit.following(
        radius_m=radii.tolist(), angular_rate_rad_s=plan.orbits.rate, speed_mps=None
    )
    scenario = plan.scenario.following(orbit=orbit)
    predicted = plan.prediction.rms is not None
    bound: BoundChoice = "always" if predicted else "never"
    judged = judge(scenario, replace(plan.orbits, radii=radii), bound=bound)
    if plan.flight is not None:
        judged = replace(judged, dropped_flights="radii were snapped after them")
    worst = int(np.argmax(moved))
    notes = [
        f"radii snapped to what ArduPilot stores, at most by {moved[worst]:.2g} m "
        f"({flown.names[worst]}: {plan.orbits.radii[worst]:g} to {radii[worst]:g} m); "
        "speeds keep the common period"
    ]
    if plan.observable and not judged.observable:
        notes.append("NOT observable with the radii snapped")
    before = {(item.a, item.b) for item in plan.links}
    lost = before - {(item.a, item.b) for item in judged.links}
    for a, b in sorted(lost):
        notes.append(f"{flown.names[a]} and {flown.names[b]} no longer meet with the radii snapped")
    if len(judged.too_close) > len(plan.too_close):
        notes.append("vehicles come nearer than they may with the radii snapped")
    return replace(flown, plan=judged), notes
