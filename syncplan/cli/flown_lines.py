"""What flying a plan has found, as a terminal shows it with the plan."""

import math

from syncplan.phrases import percent
from syncplan.reports.flown_plan_schemas import FlownPlan


def flown_line(flight: FlownPlan) -> str:
    """Return what flying a plan has found, in one line."""
    flights = "1 flight" if flight.trials == 1 else f"{flight.trials} flights"
    found = [f"guidance {flight.guidance}"]
    if flight.vehicles:
        squares = sum(one.tracking_rms_m**2 for one in flight.vehicles) / len(flight.vehicles)
        worst = max(flight.vehicles, key=lambda one: one.phase_rms_s)
        found.append(f"{math.sqrt(squares):.3g} m off the plan (RMS)")
        found.append(f"phase at most {worst.phase_rms_s:.3g} s off (RMS, {worst.name})")
    if flight.meetings_kept:
        least = min(flight.meetings_kept, key=lambda one: one.kept_share)
        share, pair = percent(least.kept_share), "-".join(least.between)
        found.append(f"each pair keeps at least {share} of its meetings ({pair})")
    if flight.least_separation_m is not None:
        found.append(f"closest two vehicles {flight.least_separation_m[1]:.3g} m")
    found.append(f"filter lost in {percent(flight.filter_lost_share)}")
    return f"flown, {flights} of {flight.duration_s:g} s: {', '.join(found)}"
