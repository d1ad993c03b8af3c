"""A short flight with everything that figures of flights show: six vehicles, a loss, a hold."""

from functools import cache

from syncplan.flight.flying import Flight, conclude_flight, flight_run, fly_part
from syncplan.planning.planner import plan
from tests.tools.scenarios import changed

__all__ = ["LOST_AT", "short_flight"]

LOST_AT = 30.0


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
    return conclude_flight(run, [fly_part(run, 0, run.trials, threads=1)])
