"""Search for flights that are not what plans and theory promise.

Three kinds of case in turn, each of 100 trials.

Noise alone: a certified scenario is drawn, with noise of readings and bearings and no other error,
from a start known to 0.025 radii. It is flown and validated, by the same filter and with the same
draws but those of bearings. Fails where RMS position errors are on average over 2 % apart, or in
more than 5 % of the cases, beyond their 95 % interval from paired bootstrap as well.

Wind: one of five teams after the other, without and with gusts of 0.2 m/s, flies for 400 s from an
initial sigma of 5 m in a wind of 1 m/s (sigma, unknown, common). Fails where, of the trials of a
team, the filter is lost in more than 0.2 % (1 % with gusts) or a vehicle out of contact in more
than 0.5 % (1 %), and where the RMS over all vehicles is more than 1.3 (1.5) times the bound along
the paths.

Losses: one vehicle after the other of these teams is lost at half time, without gusts. Fails where
the RMS error of the others in the second half is over 25 % off what syncplan.what_if predicts. That
is of a run without the vehicle from the start: where the others are not observable by themselves it
only may not be more. They know where they were when they lost it, so the bound along the path is to
be met.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.trials import MonteCarloResult
from syncplan.flight.flying import fly
from syncplan.planning.loss_study import what_if
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.scenario.loading import scenario_from
from tests.searches import Search, most_of, outside
from tests.tools.on_paper import plan, refine
from tests.tools.scenario_draws import certified_plans, draw_document
from tests.tools.scenarios import changed

TRIALS = 100

KNOWN_SHARE = 0.025
"""Of the radii, 20 m on average: the initial sigma of flights with noise alone."""

ALIKE, MOST_UNLIKE, RESAMPLES = 0.02, 0.05, 2000

GUSTS = {"gust_sigma_mps": 0.2, "gust_time_s": 10.0}
DURATION_S = 400.0

LIMITS = {"wind": (0.002, 0.005, 1.3), "gusts": (0.01, 0.01, 1.5)}
"""Shares of trials with the filter lost and out of contact, and RMS error over the bound."""

LOSS_OFF = 0.25


def _tree() -> dict[str, Any]:
    """Unequal circles on a tree, of alternating senses."""
    return {
        "orbit": {
            "radius_m": [20, 14, 26, 16, 22, 12, 18],
            "angular_rate_rad_s": 0.2,
            "direction": "alternate",
        },
        "formation": {
            "centers_m": [[0, 0], [55, 5], [-68, 10], [38, -45], [-5, 64], [92, 35], [-62, -55]],
            "links": [
                *(["v1", "v2"], ["v1", "v3"], ["v1", "v4"]),
                *(["v1", "v5"], ["v2", "v6"], ["v3", "v7"]),
            ],
        },
        "landmarks_m": [[30, 30], [-30, -30], [0, -40]],
        "sensor": {"range_m": 50, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
        "initial_sigma": {"position_m": 5, "heading_rad": 0.1},
    }


def _example(name: str, **keys: Any) -> dict[str, Any]:
    document: dict[str, Any] = changed(name, **keys).model_dump(mode="json", exclude_none=True)
    return document


TEAMS: Mapping[str, Callable[[], dict[str, Any]]] = {
    "same": lambda: _example("paper-grid-same"),
    "lattice": lambda: _example("triangle-lattice"),
    "side camera": lambda: _example(
        "paper-grid-same",
        sensor={"fov_deg": 120, "boresight_deg": -90},
        landmarks_m=[[190, 0], [190, 70], [-50, 35]],
    ),
    "tree": _tree,
    "refined": lambda: _example("paper-grid-alternate"),
}
"""Scenarios by name, as yet without wind; that of `refined` is refined."""


class Quiet(NamedTuple):
    """A flight with noise alone: its RMS error over that of the validation."""

    line: str
    ratio: float
    alike: bool


class Windy(NamedTuple):
    """A flight of a team in air with or without gusts: trials with the filter lost, or contact."""

    line: str
    flown: tuple[str, str]
    lost: int
    alone: int


class Loss(NamedTuple):
    """A flight on which a vehicle is lost."""

    line: str


Case = Quiet | Windy | Loss

TITLES: Mapping[type[Case], str] = {
    Quiet: "noise alone: vehicles     RMS   ratio  95 %",
    Windy: "in           air    lost  alone    RMS   bound  ratio  kept %  closest m",
    Loss: "at half time lost        RMS  predicted  ratio   bound  observable",
}


def team_plan(index: int, air: str) -> Plan:
    """Return the plan of a team in wind: of each in turn."""
    name = list(TEAMS)[index % len(TEAMS)]
    wind = {"sigma_mps": 1.0, **(GUSTS if air == "gusts" else {})}
    document = {**TEAMS[name](), "name": name, "wind": wind, "duration_s": DURATION_S}
    planned = plan(scenario_from(document), pilot=False)
    return refine(planned, seed=0, time_limit_s=3600.0) if name == "refined" else planned


def draw_quiet(index: int) -> Plan:
    """Return a certified plan with noise alone and a start known well."""
    generator = np.random.default_rng([0, index, 170_001])
    plans = certified_plans(lambda: draw_document(generator, KNOWN_SHARE * 20.0), pilot=False)
    return next(plans)


def noise_alone(index: int) -> tuple[list[str], Quiet]:
    """Return how errors of a flight differ from those of a validation."""
    planned = draw_quiet(index)
    options: Any = {"trials": TRIALS, "seed": 1, "filter": "ekf", "threads": 1}
    flown = _squares(fly(planned, **options).result.estimates)
    validated = _squares(validate(planned, **options).result)
    ratio, low, high = _paired(flown, validated, np.random.default_rng([0, index]))
    line = (
        f"{planned.team.count:21d}  {np.sqrt(flown.mean()):6.3f}  {ratio:6.3f}  "
        f"{low:.3f} to {high:.3f}"
    )
    return [], Quiet(line, ratio, abs(ratio - 1.0) <= ALIKE or low <= 1.0 <= high)


def _squares(result: MonteCarloResult) -> Array:
    """(trials,) m^2, mean over time and vehicles."""
    return np.asarray(result.mean_squares[..., :2].sum(axis=2).mean(axis=1))


def _paired(a: Array, b: Array, generator: np.random.Generator) -> tuple[float, float, float]:
    """The ratio of two RMS values, and its 95 % interval over resampled pairs."""
    chosen = generator.integers(len(a), size=(RESAMPLES, len(a)))
    ratios = np.sqrt(a[chosen].mean(axis=1) / b[chosen].mean(axis=1))
    low, high = np.percentile(ratios, (2.5, 97.5))
    return float(np.sqrt(a.mean() / b.mean())), float(low), float(high)


def in_wind(index: int) -> tuple[list[str], Windy]:
    """Return how a team flies in wind; every second one in gusts."""
    air = list(LIMITS)[index % len(LIMITS)]
    planned = team_plan(index, air)
    flight = fly(planned, trials=TRIALS, seed=index, threads=1)
    rms, bound = _late(flight)
    lost, alone = int(flight.filter_lost.sum()), int(flight.out_of_contact.sum())
    figures, flown = flight.result.figures, (planned.scenario.name, air)
    kept = figures.kept_meetings.sum() / max(figures.planned_meetings.sum() * TRIALS, 1)
    limit = LIMITS[air][2]
    line = (
        f"{flown[0]:11s}  {air:5s}  {lost:4d}  {alone:5d}  {rms:5.2f}  {bound:6.2f}  "
        f"{rms / bound:5.3f}  {100.0 * kept:6.2f}  {figures.separations.min():9.2f}"
    )
    faults = [] if rms <= limit * bound else [f"{flown}: over {limit:g} times the bound"]
    return faults, Windy(line, flown, lost, alone)


def _late(flight: Flight) -> tuple[float, float]:
    """RMS error of the second half, m, and its bound, over all vehicles that are there."""
    there = flight.there
    return _rms(flight.accuracy.late_position[there]), _rms(flight.bound[there])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def after_a_loss(index: int) -> tuple[list[str], Loss]:
    """Return how a team flies on without one of its vehicles, each in turn."""
    planned = team_plan(index, "wind")
    name, vehicles = planned.scenario.name, planned.scenario.vehicle_names
    # the number of teams and those of their vehicles have no common divisor
    vehicle = vehicles[index % len(vehicles)]
    outcome = what_if(planned, [vehicle]).losses[0]
    lose = (f"{vehicle}@{0.5 * DURATION_S:g}",)
    rms, bound = _late(fly(planned, trials=TRIALS, seed=index, lose=lose, threads=1))
    predicted = outcome.predicted_rms_m.overall or np.nan
    faults = []
    if not (1.0 - LOSS_OFF) * outcome.observable <= rms / predicted <= 1.0 + LOSS_OFF:
        faults.append(f"{name} without {vehicle}: not as what-if predicts")
    if not abs(rms / bound - 1.0) <= LOSS_OFF:
        faults.append(f"{name} without {vehicle}: not as the bound along the path")
    return faults, Loss(
        f"{name:11s}  {vehicle:7s}  {rms:6.2f}  {predicted:9.2f}  {rms / predicted:5.2f}  "
        f"{bound:6.2f}  {'yes' if outcome.observable else 'no'}"
    )


KINDS = (noise_alone, in_wind, after_a_loss)


def draw(number: int) -> tuple[list[str], Case]:
    """Return how a team flies: with noise alone, in wind, and without a vehicle in turn."""
    return KINDS[number % len(KINDS)](number // len(KINDS))


def judge(cases: Mapping[int, Case], chance: float) -> list[str]:
    """Print the tables; return where errors differ, and filters or contact are lost too often."""
    for kind, title in TITLES.items():
        rows = [f"{n:>6}  {case.line}" for n, case in cases.items() if isinstance(case, kind)]
        if rows:
            print(f"        {title}", *rows, sep="\n")
    faults = []
    quiet = [case for case in cases.values() if isinstance(case, Quiet)]
    unlike = sum(not case.alike for case in quiet)
    if unlike > most_of(len(quiet), MOST_UNLIKE, chance):
        faults.append(f"flown and validated errors differ in {unlike} of {len(quiet)}")
    ratios = [case.ratio for case in quiet]
    if quiet and outside(ratios, 1.0 - ALIKE, 1.0 + ALIKE, chance):
        faults.append(f"flown over validated errors are {np.mean(ratios):.3f} on average")
    windy = [case for case in cases.values() if isinstance(case, Windy)]
    for flown in sorted({case.flown for case in windy}):
        flights = [case for case in windy if case.flown == flown]
        trials, (may_lose, may_leave, _) = TRIALS * len(flights), LIMITS[flown[1]]
        lost, alone = sum(case.lost for case in flights), sum(case.alone for case in flights)
        if lost > most_of(trials, may_lose, chance):
            faults.append(f"{flown}: filter lost in {lost} of {trials} trials")
        if alone > most_of(trials, may_leave, chance):
            faults.append(f"{flown}: out of contact in {alone} of {trials} trials")
    return faults


SEARCH = Search(draw, judge, draws=9)
WINDY = Search(in_wind, judge, draws=10)
