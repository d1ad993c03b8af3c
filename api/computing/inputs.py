"""What tasks begin with: scenarios and plans as they were sent, and plans as they are stored."""

from typing import TYPE_CHECKING, Literal

from api.limits import Limits, check_size
from syncplan.errors import InputError
from syncplan.scenario.loading import decoded, parse_document

if TYPE_CHECKING:
    from syncplan.planning.plan_files import Loaded

__all__ = ["Syntax", "loaded_body", "loaded_plan"]

Syntax = Literal["json", "yaml"]


def loaded_body(body: bytes, syntax: Syntax, limits: Limits) -> "Loaded":
    """Return the scenario that a body holds, or the plan: a scenario with its orbits.

    Raises InputError, also for what is beyond the limits.
    """
    from syncplan.planning.plan_files import loaded_from

    document = parse_document(decoded(body, ""), "", syntax)
    loaded = loaded_from(document, max_vehicles=limits.vehicles)
    try:
        check_size(loaded.scenario, limits)
    except InputError as error:
        raise (error if loaded.orbits is None else error.within("scenario")) from None
    return loaded


def loaded_plan(text: str) -> "Loaded":
    """Return the scenario and the orbits of a stored plan."""
    from syncplan.planning.plan_files import loaded_from

    return loaded_from(parse_document(text, "", "json"))
