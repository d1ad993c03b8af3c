"""Pilot flight: a plan is flown until a sequential test shows whether it flies well.

A filter that nobody asked for is chosen by flights of one seed, and the plan is judged by flights
of another. Flights end as soon as one of three shares is shown to be bad, or all are shown to be
good: lost, out of contact, nearer than asked; see `share_test`.

The division of flights into batches is fixed, so the same plan has the same record on any number of
threads.
"""

from dataclasses import replace

from syncplan.guidance.flight_options import FlightOptions
from syncplan.guidance.flight_results import FlightResult, first_flights, joined_flights
from syncplan.planning.error_checks import errors_above, flown_errors
from syncplan.planning.expected_work import FLIGHT_WORK_LIMIT, work_of
from syncplan.planning.filter_choice import FLYING_FILTERS, FilterChoice, asked_filter
from syncplan.planning.pilot_options import PilotOptions
from syncplan.planning.plan_flights import Flight, FlightRun, set_up_flight
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import BAD_SHARE, FEWEST_FLIGHTS, MOST_FLIGHTS, deciding_flights
from syncplan.scenario.filters import FILTERS

CHOICE_SEED, PILOT_SEED = 451, 452
"""Seeds of the flights that choose the filter, and of those that judge the plan."""

FIRST_LOOK = 4
"""Flights flown first where a filter that takes long may fail."""

_BATCH = 32


def piloted(plan: Plan, options: PilotOptions) -> Plan:
    """Return a plan with the record of its pilot flight, or with the reason why it has none.

    A plan with stops on paper is not flown, and one that has a record keeps it.
    """
    if plan.flight is not None or not plan.verdict.go:
        return plan
    flight = pilot_flight(plan, options)
    return replace(plan, unflown=flight) if isinstance(flight, str) else flight.plan


def pilot_flight(plan: Plan, options: PilotOptions) -> Flight | str:
    """Return the flights that judge a plan, or the reason why it is not flown."""
    if reason := _why_on_paper(plan, limited=options.limited):
        return reason
    pilot = _Pilot(plan, options)
    choice, doubtful = pilot.choice()
    return pilot.flown(choice, doubtful=doubtful)


def _why_on_paper(plan: Plan, *, limited: bool) -> str:
    """Why a plan is not flown; empty if it can be."""
    asked = asked_filter(plan.scenario, FlightOptions())
    if asked is not None and FILTERS[asked.name].needs_truth:
        return f"filter.kind {asked.name} needs the truth, which no flight has"
    work = work_of(plan.scenario) if limited else None
    if work is not None and work.pass_work > FLIGHT_WORK_LIMIT:
        team = f"{plan.team.count} vehicles over {plan.scenario.duration_s:g} s"
        return (
            f"{FEWEST_FLIGHTS} flights of {team} take about "
            f"{work.flight_seconds(FEWEST_FLIGHTS):.2g} s on two cores (syncplan fly --trials "
            f"{FEWEST_FLIGHTS}); syncplan plan --fly {MOST_FLIGHTS} judges the plan by them"
        )
    return ""


class _Pilot:
    """Pilot flight in progress."""

    def __init__(self, plan: Plan, options: PilotOptions) -> None:
        self.plan, self.options = plan, options
        self.done = 0

    def choice(self) -> tuple[FilterChoice, bool]:
        """Return the filter, and whether its flights may take long and fail."""
        asked = asked_filter(self.plan.scenario, FlightOptions())
        if asked is not None:
            return asked, FILTERS[asked.name].finds_start
        doubtful, times = False, f"{FEWEST_FLIGHTS} times, seed {CHOICE_SEED}"
        *cheaper, searching = FLYING_FILTERS
        for name in cheaper:
            choice = FilterChoice(name, f"the cheapest filter that flew well {times}")
            run = self._run(choice, CHOICE_SEED, FEWEST_FLIGHTS)
            flight = Flight.of(run, self._part(run, 0, FEWEST_FLIGHTS))
            failing = int(flight.failed.any(axis=1).sum())
            if not failing and not errors_above(flown_errors(flight.plan)):
                return choice, False
            doubtful |= failing > BAD_SHARE * FEWEST_FLIGHTS
        reason = f"{' and '.join(cheaper)} did not fly well {times}"
        return FilterChoice(searching, reason), doubtful

    def flown(self, choice: FilterChoice, *, doubtful: bool) -> Flight:
        """Return the flights that judge the plan with this filter."""
        most = self.options.most_flights
        run = self._run(choice, PILOT_SEED, most)
        if doubtful and most > FIRST_LOOK:
            first = self._decided(run, self._part(run, 0, FIRST_LOOK))
            if first is not None:
                return first
        flights: FlightResult | None = None
        for begin in range(0, most, _BATCH):
            # whole chunks, so that a smaller number has the bytes of a larger one
            batch = self._part(run, begin, _BATCH)
            flights = batch if flights is None else joined_flights([flights, batch])
            decided = self._decided(run, first_flights(flights, min(begin + _BATCH, most)))
            if decided is not None:
                return decided
        assert flights is not None
        return Flight.of(run, first_flights(flights, most))

    def _run(self, choice: FilterChoice, seed: int, most: int) -> FlightRun:
        run = set_up_flight(self.plan, FlightOptions(trials=most, seed=seed), choice)
        if self.options.compile_kernels is not None:
            self.options.compile_kernels(run.team)
        return run

    def _part(self, run: FlightRun, first: int, flights: int) -> FlightResult:
        progress, before = self.options.progress, self.done

        def count(done: int) -> None:
            if progress is not None:
                progress(before + done, before + flights)

        part = run.part(first, flights, threads=self.options.threads, progress=count)
        self.done = before + flights
        return part

    @staticmethod
    def _decided(run: FlightRun, flights: FlightResult) -> Flight | None:
        """Flights up to the one that decides; None if none does."""
        count = deciding_flights(Flight.of(run, flights).failed)
        if count is None:
            return None
        decided = replace(run, options=replace(run.options, trials=count))
        return Flight.of(decided, first_flights(flights, count))
