"""Flights of a plan in closed loop."""

from typing import Any

from syncplan.guidance.flight_options import FlightOptions
from syncplan.studies.study import DocumentKind, TrialStudy


class Flights(TrialStudy):
    """Flights of a plan, by vehicles that steer by their own estimates."""

    name, verb, of = "flight", "fly", "plan"
    sentence = "Fly a plan in closed loop: vehicles steer by their estimates, in wind, with losses."
    example = "plan.json --trials 200 --wind 1.5,0 --lose v3@60 -o flight.json"
    requires = ("observable", "go")
    unit = "flights"
    options = FlightOptions
    left_out = ("model",)
    hidden = ("substeps",)
    body = "How to fly, and what goes wrong; defaults if empty"
    document = DocumentKind("syncplan.reports.flight_report", "FlightDocument", title="Flight")

    def first_run(self, subject: Any, options: Any) -> Any:
        """Return the set-up of the flights."""
        from syncplan.flight.flying import flight_run

        return flight_run(subject, options)
