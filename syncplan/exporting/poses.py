"""Timed poses of all vehicles as one CSV file."""

import csv
import io

from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.scheduled_plan import (
    ScheduledPlan,
    moment,
    places_of,
    sampled_poses,
    start_of,
)
from syncplan.orbits.circles import wrap


def write_poses(flown: ScheduledPlan) -> Written:
    """Return one row for each vehicle at each sample: time, name, x, y, z in m, heading in rad.

    `utc` follows where the scenario has a start_time, `lat_deg` and `lon_deg` where it has a
    geo_origin. Headings in [-pi, pi). Raises InputError as sampled_poses does.
    """
    poses, start = sampled_poses(flown), start_of(flown.plan)
    places = places_of(flown, poses.positions)
    headings = wrap(poses.headings)
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    located = [] if places is None else ["lat_deg", "lon_deg"]
    dated = [] if start is None else ["utc"]
    rows.writerow(["time_s", "vehicle", "x_m", "y_m", "z_m", "heading_rad", *dated, *located])
    heights = [f"{altitude:.6f}" for altitude in flown.altitudes]
    for k, time in enumerate(poses.times.tolist()):
        when = [] if start is None else [moment(start, time)]
        for i, name in enumerate(flown.names):
            x, y = poses.positions[k, i].tolist()
            row = [f"{time:.6f}", name, f"{x:.6f}", f"{y:.6f}", heights[i], f"{headings[k, i]:.9f}"]
            where = [] if places is None else [f"{value:.9f}" for value in places[k, i].tolist()]
            rows.writerow([*row, *when, *where])
    name = f"{flown.title}.poses.csv"
    return Written(files=(ExportedFile(name, stream.getvalue().encode()),))
