"""Which filter runs on a plan, and why."""

from dataclasses import dataclass, replace

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filters import AUTO
from syncplan.planning.judged_plan import Plan
from syncplan.planning.start_up import CLEARED_FILTER, CLEARING_INDEX
from syncplan.scenario.specification import Scenario


@dataclass(frozen=True, slots=True)
class FilterChoice:
    """A filter, and why it was chosen.

    Attributes
    ----------
    name : in syncplan.estimation.filters.FILTERS
    reason : in words
    """

    name: str
    reason: str

    def applied(self, options: FilterOptions) -> FilterOptions:
        """Return the options with this filter."""
        return replace(options, filter=self.name)


def asked_filter(scenario: Scenario, options: FilterOptions) -> FilterChoice | None:
    """Return the filter that options or scenario name; None where neither does."""
    if options.filter != AUTO:
        return FilterChoice(options.filter, "asked for")
    kind = None if scenario.filter is None else scenario.filter.kind
    return None if kind in (None, AUTO) else FilterChoice(kind, "the scenario's filter.kind")


def choose_filter(flown: Plan, options: FilterOptions) -> FilterChoice:
    """Return the filter that runs on a plan: the one asked for, or what its start calls for."""
    asked = asked_filter(flown.scenario, options)
    if asked is not None:
        return asked
    found = flown.start_up
    if found is None:
        return FilterChoice(CLEARED_FILTER, "the default; the plan has no start-up index")
    index = f"start-up index {found.index.value:.3g}"
    if found.cleared:
        return FilterChoice(found.filter, f"{index}, at most {CLEARING_INDEX:g} is clear")
    limit = f"over the {CLEARING_INDEX:g} that an {CLEARED_FILTER} is clear of"
    return FilterChoice(found.filter, f"{index}, {limit}")
