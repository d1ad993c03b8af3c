"""What the figures of a flight suppose and mean, in words."""

from syncplan.estimation.considered_errors import neglected_errors
from syncplan.flight.flight_options import GUIDANCES
from syncplan.flight.flying import Flight
from syncplan.phrases import listed
from syncplan.reports.flight_schemas import FlightDocument

__all__ = ["notes_of"]


def notes_of(flight: Flight, report: FlightDocument) -> list[str]:
    """Return what the reader of a flight's report must know, in plain words."""
    notes = [
        f"guidance {report.guidance}: {GUIDANCES[report.guidance].sentence} Vehicles start where "
        "initial_sigma puts them, about the plan, and their estimates at the plan"
    ]
    if report.vehicle_model.limits_from == "default":
        low, high = report.vehicle_model.speed_mps
        notes.append(
            f"no limits.speed_mps: airspeeds from {low:g} to {high:.4g} m/s were supposed; give "
            "what the vehicles can do"
        )
    if flight.judged_from:
        notes.append(
            f"the filter looks for its start until {flight.judged_from:.4g} s: ANEES, NIS and "
            "coverage count from there on"
        )
    neglected = neglected_errors(flight.plan.team)
    if neglected:
        what = listed([name.replace("_", " ") for name in neglected], len(neglected))
        notes.append(
            f"the filter does not estimate {what}: vehicles do not know that they are off, and "
            "the bound does not either; filter.estimate makes them states"
        )
    sought = max(one.sought_share for one in report.vehicles)
    if sought > 0.0:
        notes.append(
            "where a vehicle was not sure to meet its anchor, its circle was moved towards it, "
            f"for up to {100.0 * sought:.2g} % of the time"
        )
    if flight.run.options.late:
        samples = flight.run.options.late
        notes.append(
            f"sightings arrive {samples} samples late: errors of estimates are of the time when "
            "sightings were made, and vehicles steer by estimates carried on from there"
        )
    if flight.run.events.losses:
        notes.append(
            "a vehicle that is lost takes no further part: nobody sees it, it sees nobody, and "
            "separations leave it out"
        )
    return notes
