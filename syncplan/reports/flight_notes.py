"""What the figures of a flight suppose and mean, in words."""

from collections.abc import Iterator

from syncplan.estimation.considered_errors import neglected_errors
from syncplan.flight.flight_options import GUIDANCES
from syncplan.flight.flying import Flight
from syncplan.phrases import listed, percent
from syncplan.reports.flight_schemas import FlightDocument
from syncplan.reports.truth_report import truth_note


def notes_of(flight: Flight, report: FlightDocument) -> list[str]:
    """Return what the reader of a flight's report must know, in plain words."""
    return [
        f"guidance {report.guidance}: {GUIDANCES[report.guidance].sentence} Vehicles start where "
        "initial_sigma puts them, about the plan, and their estimates at the plan",
        *_of_truth(report),
        *_of_conditions(flight),
        *_of_holds(flight),
        *_of_vehicles(report),
        *_of_places(flight),
        *_of_filter(flight, report),
        *_of_guidance(report),
    ]


def _of_truth(report: FlightDocument) -> Iterator[str]:
    """How the simulated world differs from the scenario."""
    own = report.overall
    note = truth_note(
        report.truth, report.expected_rms_m, own.rms_second_half_m, own.predicted_rms_m
    )
    if note is not None:
        yield note


def _of_conditions(flight: Flight) -> Iterator[str]:
    """What sightings suffer, and what is lost."""
    conditions = flight.run.conditions
    if conditions:
        yield f"in every trial {listed(conditions, len(conditions))}"
    if flight.run.options.late:
        yield (
            "where sightings are late, errors of estimates are of the time when sightings were "
            "made, and vehicles steer by estimates carried on from there"
        )
    if flight.run.events.losses:
        yield (
            "a vehicle that is lost takes no further part: nobody sees it, it sees nobody, and "
            "separations leave it out"
        )


def _of_holds(flight: Flight) -> Iterator[str]:
    """What vehicles do that are held, and where nobody can say whether they are back."""
    team, holds = flight.run.team, flight.run.events.holds
    if holds:
        circling = any(team.limits.least_speeds[one.vehicle] > 0.0 for one in holds)
        does = "circles at its least speed and largest turn rate" if circling else "stands still"
        yield f"a vehicle that is held {does} in the air, and drifts with the wind"
    for one in holds:
        if not team.shows_phase_after(one):
            yield (
                f"{one.sentence}: less than a period, {team.team.orbits.period:.3g} s, is left, "
                "too little to say when it has its phase again"
            )


def _of_vehicles(report: FlightDocument) -> Iterator[str]:
    """What vehicles were supposed to be able to do."""
    model = report.vehicle_model
    if model.speed_from == "default":
        low, high = model.speed_mps
        yield (
            f"no limits.speed_mps: airspeeds from {low:g} to {high:.4g} m/s were supposed; give "
            "what the vehicles can do"
        )
    if model.turn_rate_from == "default":
        yield (
            f"no limits.turn_rate_rad_s: turn rates up to {model.turn_rate_rad_s:.4g} rad/s were "
            "supposed; give what the vehicles can do"
        )


def _of_places(flight: Flight) -> Iterator[str]:
    """What of the scenario no flight looks at."""
    scenario = flight.plan.scenario
    given = [key for key in ("area_m", "keep_out_m") if getattr(scenario, key)]
    if given:
        yield (
            f"flights do not look at {' and '.join(given)}: who is off the plan may be where no "
            "circle is; compare the distance from the plan with what there is room for"
        )


def _of_filter(flight: Flight, report: FlightDocument) -> Iterator[str]:
    """From when on the filter is judged, and what it does not know of."""
    if flight.judged_from:
        yield (
            f"the filter looks for its start until {flight.judged_from:.4g} s: ANEES, NIS and "
            "coverage count from there on"
        )
    neglected = neglected_errors(flight.plan.team)
    if neglected:
        what = listed([name.replace("_", " ") for name in neglected], len(neglected))
        yield (
            f"the filter does not estimate {what}: vehicles do not know that they are off, and "
            "the bound does not either; filter.estimate makes them states"
        )
    wind = report.conditions.wind_mps or (0.0, 0.0)
    if any(wind) and report.wind_error_mps is None and "wind" not in neglected:
        yield (
            "the wind is no state of the filter: vehicles do not know that they are off, and the "
            "bound does not either; wind.sigma_mps makes it one"
        )


def _of_guidance(report: FlightDocument) -> Iterator[str]:
    """What guidance did that nobody asked for."""
    sought = max(one.sought_share for one in report.vehicles)
    if sought > 0.0:
        yield (
            "where a vehicle was not sure to meet its anchor, its circle was moved towards it, "
            f"for up to {percent(sought)} of the time"
        )
    refused = max(report.vehicles, key=lambda one: one.refused_share or 0.0)
    if refused.refused_share:
        yield (
            f"the program of {report.guidance} was not solved in up to "
            f"{percent(refused.refused_share)} of a vehicle's decisions ({refused.name}): it "
            "then flies the best of its guesses"
        )
