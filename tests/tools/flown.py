"""A short flight with everything that figures show, and the record of one that went well."""

from functools import cache

from syncplan.flight.flying import flight_run
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plan_records import FlownPlan, MeetingsFlown, PhasesFlown
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed

LOST_AT = 30.0

WELL = FlownPlan(
    trials=50,
    seed=0,
    duration_s=200.0,
    guidance="track",
    filter="robust",
    events=[],
    filter_lost_share=0.0,
    out_of_contact_share=0.0,
    least_separation_m=(25.0, 14.0),
    too_close_share=None,
    vehicles=[
        PhasesFlown(
            name=f"v{k}",
            phase_rms_s=0.2,
            phase_worst_s=0.9,
            tracking_rms_m=1.2,
            speed_mps=(3.0, 5.0),
        )
        for k in range(1, 7)
    ],
    meetings_kept=[
        MeetingsFlown(between=between, meetings=5, kept_share=1.0)
        for between in (("v1", "v2"), ("v2", "v3"), ("v3", "L1"), ("v4", "L2"))
    ],
)
"""Record of a flight of the paper's grid in which nothing went wrong."""


@cache
def short_flight() -> Flight:
    """Return 8 trials of 48 s on the paper's grid, with series; v6 is lost, v2 held before."""
    grid = changed(
        "paper-grid-same",
        sensor={"sample_time_s": 0.5},
        duration_s=48.0,
        min_separation_m=22.0,
        keep_out_m=[[(100.0, 30.0), (112.0, 30.0), (106.0, 40.0)]],
    )
    run = flight_run(
        plan(grid),
        trials=8,
        seed=5,
        filter="ekf",
        with_series=True,
        lose=(f"v6@{LOST_AT:g}",),
        hold=("v2@12:6",),
    )
    flight: Flight = run.whole(threads=1)
    return flight
