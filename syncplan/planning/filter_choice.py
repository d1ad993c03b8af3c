"""Choice of the filter: asked for, shown by flights to fly well, or by the start-up index.

The start-up index comes with the bound. Up to CLEARING_INDEX, an extended filter can be expected to
reach the bound from the initial sigmas; above it, the filter has to look for its start.
"""

from dataclasses import dataclass, replace

from syncplan.estimation.filter_options import FilterOptions
from syncplan.planning.judged_team import JudgedTeam
from syncplan.scenario.filters import AUTO
from syncplan.scenario.specification import Scenario

CLEARING_INDEX = 0.45
"""Largest start-up index from which an extended filter can be expected to reach the bound."""

FLYING_FILTERS = ("ekf", "second-order", "robust")
"""Filters that `auto` chooses from, the cheapest first; the last looks for its start."""


@dataclass(frozen=True, slots=True)
class FilterChoice:
    """Filter, with the reason for its choice.

    Attributes
    ----------
    name : in syncplan.scenario.filters.FILTERS
    reason : in words
    """

    name: str
    reason: str

    def applied(self, options: FilterOptions) -> FilterOptions:
        """Return the options with this filter."""
        return replace(options, filter=self.name)


def asked_filter(scenario: Scenario, options: FilterOptions) -> FilterChoice | None:
    """Return the filter named by the options or the scenario; None if neither names one."""
    if options.filter != AUTO:
        return FilterChoice(options.filter, "asked for")
    kind = None if scenario.filter is None else scenario.filter.kind
    return None if kind in (None, AUTO) else FilterChoice(kind, "the scenario's filter.kind")


def flown_filter(judged: JudgedTeam) -> FilterChoice | None:
    """Return the filter that a plan was flown with; None for a plan on paper."""
    flight = judged.flight
    return None if flight is None else FilterChoice(flight.filter, "the plan was flown with it")


def choose_filter(judged: JudgedTeam, options: FilterOptions) -> FilterChoice:
    """Return the filter to run on a plan: as asked for, as flown, or by the start-up index."""
    choice = asked_filter(judged.scenario, options) or flown_filter(judged)
    if choice is not None:
        return choice
    cheapest, *_, searching = FLYING_FILTERS
    start = judged.start_up
    if start is None:
        return FilterChoice(cheapest, "the default; the plan has no start-up index")
    index = f"start-up index {start.value:.3g}"
    if start.value <= CLEARING_INDEX:
        return FilterChoice(cheapest, f"{index}, at most {CLEARING_INDEX:g} is clear")
    limit = f"over the {CLEARING_INDEX:g} that an {cheapest} is clear of"
    return FilterChoice(searching, f"{index}, {limit}")
