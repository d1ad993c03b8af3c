"""Flights of a plan in closed loop."""

from collections.abc import Sequence
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

    def part(self, run: Any, first_trial: int, trials: int, **how: Any) -> Any:
        """Return some flights of a run."""
        from syncplan.planning.plan_flights import fly_part

        return fly_part(run, first_trial, trials, **how)

    def pack(self, part: Any) -> bytes:
        """Return flights as bytes."""
        from syncplan.guidance.flight_results import pack_flight

        return pack_flight(part)

    def unpack(self, data: bytes) -> Any:
        """Return the flights that `pack` packed."""
        from syncplan.guidance.flight_results import unpack_flight

        return unpack_flight(data)

    def conclude(self, run: Any, parts: Sequence[Any]) -> Any:
        """Return the flights of a run as a whole."""
        from syncplan.planning.plan_flights import conclude_flight

        return conclude_flight(run, parts)

    def effort(self, run: Any) -> float:
        """Return the number of samples of a flight."""
        return float(run.team.steps)
