"""Search for windy scenarios on which the verdicts of plans and of flights do not agree.

    python -m tests.searches.search_windy [DRAWS [SEED]] [--trials N] [--most N] [--processes N]

Part of `make check-all`. Teams whose plan is observable are drawn with starts known to 0.5 to 30 m,
most with airspeeds limited to 1.1 to 3 times the fastest circle's speed, half of these with turn
rates of 1.2 to 5 times the common one. Wind has a sigma of 0 to 1.5 times the airspeed limit, small
ones more often than large ones, and half of the teams have gusts of up to a fifth of the slowest
ground speed. Some ask for a separation, and a third loses 10 to 40 % of its sightings. Each is
planned, with its pilot, and flown. The true wind is drawn as the scenario states it.

Fails where a plan is GO without a warning, and in more than 5 % of its flights the filter is lost
or a vehicle out of contact: where trials are few, MORE times as many decide, without dropout, which
no plan knows of. Fails too where a flight is NO-GO for missed meetings or phases alone, though the
team without the links that it missed most is observable: judged from the rows of all other links,
stacked anew. A search of many draws finds a few of the first kind for lack of trials or of warning
(`--most`).

Printed beside are the draws by level of plan and flight, and how many GO plans in calm air, of a
sigma below a tenth of the slowest ground speed and gusts below a fiftieth, have warnings.
"""

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from syncplan.errors import InputError, NoSolutionError
from syncplan.flight.flying import Flight, fly
from syncplan.observability.rank import assess, assess_team, lone_rows
from syncplan.planning.flight_checks import LEAST_KEPT, MOST_SHARE
from syncplan.planning.judged_team import PlanVerdict
from syncplan.planning.planner import Plan, plan
from syncplan.scenario.loading import scenario_from
from tests.tools.scenario_draws import draw_document
from tests.tools.search_arguments import search_arguments

OF_LINKS = {"meetings-missed", "phase-not-kept"}
"""Codes of findings that stop a flight for what links do."""

MORE = 5
CALM_WIND, CALM_GUSTS = 0.1, 0.02


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was found of one draw.

    Attributes
    ----------
    go : of the plan
    warnings, stops : codes of the plan's findings
    calm : whether there is little wind
    lost : share of flights with a filter lost or a vehicle out of contact
    flight_stops : codes
    spared : whether the links missed are needed by nobody, though they alone stop the flight
    """

    number: int
    go: bool
    warnings: tuple[str, ...]
    stops: tuple[str, ...]
    calm: bool
    lost: float
    flight_stops: tuple[str, ...]
    spared: bool

    @property
    def unwarned(self) -> bool:
        """Whether flights fail that nothing warned of."""
        return self.go and not self.warnings and self.lost > MOST_SHARE


def draw_windy(number: int, seed: int) -> tuple[Plan, float]:
    """Return the `number`-th observable plan of a seed in wind, and the share of sightings lost."""
    generator = np.random.default_rng([seed, number, 270_002])
    while True:
        document = _in_wind(generator)
        dropout = float(generator.uniform(0.1, 0.4)) if generator.random() < 1 / 3 else 0.0
        try:
            made = plan(scenario_from(document))
        except (InputError, NoSolutionError):
            continue
        if made.observable:
            return made, dropout


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


def _outcome(number: int, *, seed: int, trials: int) -> Outcome:
    made, dropout = draw_windy(number, seed)
    verdict, wind = made.verdict, made.scenario.wind
    flight = fly(made, trials=trials, seed=seed + 1, dropout=dropout, threads=1)
    stops = {one.code for one in flight.plan.verdict.stops}
    lost = _lost_share(flight)
    if verdict.go and not _codes(verdict, "warning") and lost > MOST_SHARE:
        lost = _lost_share(fly(made, trials=MORE * trials, seed=seed + 2, threads=1))
    slowest = made.orbits.speeds.min()
    assert wind is not None
    return Outcome(
        number=number,
        go=verdict.go,
        warnings=_codes(verdict, "warning"),
        stops=_codes(verdict, "stop"),
        calm=wind.sigma_mps < CALM_WIND * slowest and wind.gust_sigma_mps < CALM_GUSTS * slowest,
        lost=lost,
        flight_stops=tuple(sorted(stops)),
        spared=verdict.go and bool(stops) and stops <= OF_LINKS and _spared(flight),
    )


def _codes(verdict: PlanVerdict, level: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(one.code for one in verdict.findings if one.level == level))


def _lost_share(flight: Flight) -> float:
    return float(max(flight.filter_lost.mean(), flight.out_of_contact.mean()))


def _spared(flight: Flight) -> bool:
    """Whether the team is observable without all links that it missed, whatever missed them."""
    made, record = flight.plan, flight.record
    names = [*made.scenario.vehicle_names, *made.scenario.landmark_names]
    phases = {one.name: one.phase_rms_s for one in record.vehicles}
    if max(phases.values()) > made.orbits.period / (4.0 * np.sqrt(3.0)):
        return False
    missed = {one.between for one in record.meetings_kept if one.kept_share < LEAST_KEPT}
    missed |= {
        (names[one.a], names[one.b])
        for one in made.links
        if max(phases[names[one.a]], phases[names[one.b]]) > one.tolerance / made.orbits.rate
    }
    assessed = assess_team(made.team, made.scenario.window)
    rows = [one for one in assessed.information if (names[one.a], names[one.b]) not in missed]
    return assess(made.team, rows, lone_rows(made.team, assessed.sightings)).observable


def main(
    draws: int = 200,
    seed: int = 0,
    *,
    trials: int = 20,
    processes: int | None = None,
    most: int = 0,
) -> bool:
    """Print what was found; return whether verdicts agree."""
    with ProcessPoolExecutor(processes) as pool:
        work = partial(_outcome, seed=seed, trials=trials)
        found = list(pool.map(work, range(draws)))
    print(f"{draws} windy teams, {trials} flights each, seed {seed}")
    print("plan            draws  flights NO-GO  over 5 % lost  for links alone")
    for name, chosen in (
        ("GO", [one for one in found if one.go and not one.warnings]),
        ("GO with warning", [one for one in found if one.go and one.warnings]),
        ("NO-GO", [one for one in found if not one.go]),
    ):
        stopped = sum(bool(one.flight_stops) for one in chosen)
        lost = sum(one.lost > MOST_SHARE for one in chosen)
        links = sum(bool(one.flight_stops) and set(one.flight_stops) <= OF_LINKS for one in chosen)
        print(f"{name:15s} {len(chosen):5d}  {stopped:13d}  {lost:13d}  {links:15d}")
    for level in ("warnings", "stops"):
        counts = Counter(code for one in found for code in getattr(one, level)).most_common()
        print(f"{level} of plans: " + ", ".join(f"{code} {number}" for code, number in counts))
    calm = [one for one in found if one.calm and one.go]
    warned = [one for one in calm if one.warnings]
    codes = Counter(code for one in warned for code in one.warnings).most_common()
    each = ", ".join(f"{code} {number}" for code, number in codes)
    print(f"calm GO plans with a warning: {len(warned)} of {len(calm)} ({each})")
    unwarned = [one for one in found if one.unwarned]
    for one in unwarned:
        print(f"  draw {one.number}: GO without warning, {100.0 * one.lost:.3g} % of flights lost")
    spared = [one for one in found if one.spared]
    for one in spared:
        print(f"  draw {one.number}: NO-GO ({', '.join(one.flight_stops)}) for links to spare")
    return len(unwarned) <= most and not spared


if __name__ == "__main__":
    arguments = search_arguments(__doc__, 200)
    arguments.add_argument("--most", type=int)
    sys.exit(not main(**vars(arguments.parse_args())))
