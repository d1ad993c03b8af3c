"""What tasks begin with: scenarios as they were sent, and plans as they are stored."""

from typing import TYPE_CHECKING, Literal

from api.limits import Limits, check_size
from syncplan.loading import decoded, parse_document, scenario_from
from syncplan.scenario import Scenario

if TYPE_CHECKING:
    from syncplan.planfile import Loaded

__all__ = ["Syntax", "loaded_plan", "scenario_of"]

Syntax = Literal["json", "yaml"]


def scenario_of(body: bytes, syntax: Syntax, limits: Limits) -> Scenario:
    """Return the scenario that a body holds; raises InputError, also for one beyond the limits."""
    document = parse_document(decoded(body, ""), "", syntax)
    scenario = scenario_from(document, max_vehicles=limits.vehicles)
    check_size(scenario, limits)
    return scenario


def loaded_plan(text: str) -> "Loaded":
    """Return the scenario and the orbits of a stored plan."""
    from syncplan.planfile import loaded_from

    return loaded_from(parse_document(text, "", "json"))
