"""Search for windy scenarios on which the verdicts of plans and of flights do not agree.

Teams whose plan is observable are drawn with starts known to 0.5 to 30 m, most with airspeeds
limited to 1.1 to 3 times the fastest circle's speed, half of these with turn rates of 1.2 to 5
times the common one. Wind has a sigma of 0 to 1.5 times the airspeed limit, small ones more often
than large ones, and half of the teams have gusts of up to a fifth of the slowest ground speed. Some
ask for a separation, and a third loses 10 to 40 % of its sightings. Each is planned, with its
pilot flight, and flown again. The true wind is drawn as the scenario states it.

Fails where more than one plan in 24 is GO without a warning, and in more than 12 % of its flights
the filter is lost or a vehicle out of contact: where trials are few, MORE times as many decide,
without dropout, which no plan knows of. Fails too where a flight is NO-GO for missed meetings or
phases alone, though the team without the links that it missed most is observable: judged from the
rows of all other links, stacked anew.

Printed beside are the cases by level of plan and flight, and how many GO plans in calm air, of a
sigma below a tenth of the slowest ground speed and gusts below a fiftieth, have warnings.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.errors import InputError, NoSolutionError
from syncplan.flight.flying import fly
from syncplan.observability.rank import assess, assess_team, lone_rows
from syncplan.planning.flight_checks import LEAST_KEPT
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.plan_flights import Flight
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import BAD_SHARE
from syncplan.scenario.loading import scenario_from
from tests.searches import Search, most_of
from tests.tools.scenario_draws import draw_document

OF_LINKS = {"meetings-missed", "phase-not-kept"}
"""Codes of findings that stop a flight for what links do."""

MOST_UNWARNED = 1.0 / 24.0
TRIALS, MORE = 20, 5
CALM_WIND, CALM_GUSTS = 0.1, 0.02


@dataclass(frozen=True, slots=True)
class Outcome:
    """A plan beside its flights.

    Attributes
    ----------
    go : of the plan
    warnings, stops : codes of the plan's findings
    calm : whether there is little wind
    lost : share of flights with a filter lost or a vehicle out of contact
    flight_stops : codes
    """

    go: bool
    warnings: tuple[str, ...]
    stops: tuple[str, ...]
    calm: bool
    lost: float
    flight_stops: tuple[str, ...]

    @property
    def unwarned(self) -> bool:
        """Whether flights fail that nothing warned of."""
        return self.go and not self.warnings and self.lost > BAD_SHARE


def draw_windy(number: int) -> tuple[Plan, float]:
    """Return an observable plan in wind, and the share of sightings lost."""
    generator = np.random.default_rng([0, number, 270_002])
    while True:
        document = _in_wind(generator)
        dropout = float(generator.uniform(0.1, 0.4)) if generator.random() < 1 / 3 else 0.0
        try:
            planned = plan(scenario_from(document))
        except (InputError, NoSolutionError):
            continue
        if planned.observable:
            return planned, dropout


def _in_wind(generator: np.random.Generator) -> dict[str, Any]:
    document = draw_document(generator, float(np.exp(generator.uniform(*np.log([0.5, 30.0])))))
    orbit = document["orbit"]
    rate, radii = orbit["angular_rate_rad_s"], np.array(orbit["radius_m"])
    slow, fast = rate * radii.min(), rate * radii.max()
    most = float(fast * generator.uniform(1.1, 3.0))
    if generator.random() < 0.8:
        least = float(slow * generator.uniform(0.0, 0.9))
        document["limits"] = {"speed_mps": [least, most]}
        if generator.random() < 0.5:
            document["limits"]["turn_rate_rad_s"] = float(rate * generator.uniform(1.2, 5.0))
    wind = {"sigma_mps": float(1.5 * most * generator.random() ** 3)}
    if generator.random() < 0.15:
        wind = {}
    if generator.random() < 0.5:
        wind["gust_sigma_mps"] = float(slow * generator.uniform(0.0, 0.2))
        wind["gust_time_s"] = float(generator.uniform(3.0, 20.0))
    if generator.random() < 0.5:
        document["min_separation_m"] = float(generator.uniform(2.0, 8.0))
    return {**document, "wind": wind, "duration_s": 120.0}


def draw(number: int) -> tuple[list[str], Outcome]:
    """Return how the verdicts of a plan and its flights compare."""
    planned, dropout = draw_windy(number)
    verdict, wind = planned.verdict, planned.scenario.wind
    flight = fly(planned, trials=TRIALS, seed=1, dropout=dropout, threads=1)
    stops = {finding.code for finding in flight.plan.verdict.stops}
    lost = _lost_share(flight)
    if verdict.go and not _codes(verdict, "warning") and lost > BAD_SHARE:
        lost = _lost_share(fly(planned, trials=MORE * TRIALS, seed=2, threads=1))
    slowest = planned.orbits.speeds.min()
    assert wind is not None
    outcome = Outcome(
        go=verdict.go,
        warnings=_codes(verdict, "warning"),
        stops=_codes(verdict, "stop"),
        calm=wind.sigma_mps < CALM_WIND * slowest and wind.gust_sigma_mps < CALM_GUSTS * slowest,
        lost=lost,
        flight_stops=tuple(sorted(stops)),
    )
    spared = verdict.go and bool(stops) and stops <= OF_LINKS and _spared(flight)
    fault = f"NO-GO ({', '.join(outcome.flight_stops)}) for links to spare"
    return [fault] if spared else [], outcome


def _codes(verdict: PlanVerdict, level: str) -> tuple[str, ...]:
    codes = (finding.code for finding in verdict.findings if finding.level == level)
    return tuple(dict.fromkeys(codes))


def _lost_share(flight: Flight) -> float:
    return float(max(flight.filter_lost.mean(), flight.out_of_contact.mean()))


def _spared(flight: Flight) -> bool:
    """Whether the team is observable without all links that it missed, whatever missed them."""
    planned, record = flight.plan, flight.record
    names = [*planned.scenario.vehicle_names, *planned.scenario.landmark_names]
    phases = {vehicle.name: vehicle.phase_rms_s for vehicle in record.vehicles}
    if max(phases.values()) > planned.orbits.period / (4.0 * np.sqrt(3.0)):
        return False
    missed = {kept.between for kept in record.meetings_kept if kept.kept_share < LEAST_KEPT}
    missed |= {
        (names[link.a], names[link.b])
        for link in planned.links
        if max(phases[names[link.a]], phases[names[link.b]]) > link.tolerance / planned.orbits.rate
    }
    assessed = assess_team(planned.team, planned.scenario.window)
    rows = [row for row in assessed.information if (names[row.a], names[row.b]) not in missed]
    return assess(planned.team, rows, lone_rows(planned.team, assessed.sightings)).observable


def judge(cases: Mapping[int, Outcome], chance: float) -> list[str]:
    """Print cases by their levels; return whether too many flights fail unwarned."""
    outcomes = list(cases.values())
    print("plan            draws  flights NO-GO  over 5 % lost  for links alone")
    for name, some in (
        ("GO", [outcome for outcome in outcomes if outcome.go and not outcome.warnings]),
        ("GO with warning", [outcome for outcome in outcomes if outcome.go and outcome.warnings]),
        ("NO-GO", [outcome for outcome in outcomes if not outcome.go]),
    ):
        stops = [set(outcome.flight_stops) for outcome in some if outcome.flight_stops]
        lost = sum(outcome.lost > BAD_SHARE for outcome in some)
        links = sum(codes <= OF_LINKS for codes in stops)
        print(f"{name:15s} {len(some):5d}  {len(stops):13d}  {lost:13d}  {links:15d}")
    print(f"warnings of plans: {_counted([outcome.warnings for outcome in outcomes])}")
    print(f"stops of plans: {_counted([outcome.stops for outcome in outcomes])}")
    calm = [outcome.warnings for outcome in outcomes if outcome.calm and outcome.go]
    print(f"calm GO plans with a warning: {sum(map(bool, calm))} of {len(calm)} ({_counted(calm)})")
    unwarned = {number: case for number, case in cases.items() if case.unwarned}
    for number, case in unwarned.items():
        print(f"  {number}: GO without warning, {100.0 * case.lost:.3g} % of flights lost")
    if len(unwarned) > most_of(len(cases), MOST_UNWARNED, chance):
        return [f"{len(unwarned)} plans without a warning fail in over {BAD_SHARE:.0%} of flights"]
    return []


def _counted(codes: Sequence[Sequence[str]]) -> str:
    counts = Counter(code for some in codes for code in some).most_common()
    return ", ".join(f"{code} {count}" for code, count in counts)


SEARCH = Search(draw, judge, draws=12)
