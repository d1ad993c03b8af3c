"""Search for flights that are not what plans and theory promise.

    python -m tests.searches.search_flights [TRIALS [SEED]] [--draws N] [--losses N]
        [--teams NAME,NAME] [--spare N] [--alike SHARE] [--threads N]

Part of `make check-all`, which flies few trials of two teams. Three tables:

Noise alone. Certified scenarios are drawn, with noise of readings and bearings and no other error,
from a start known to 0.025 radii. Each is flown and validated, by the same filter and with the same
draws but those of bearings. Fails where the RMS position errors differ: the ratio is over 2 % off 1
(few trials want another share for `--alike`) and its 95 % interval, from paired bootstrap, is too.

Wind. Five teams, 400 s from an initial sigma of 5 m in a wind of 1 m/s (sigma, unknown, common) are
flown, then with gusts of 0.2 m/s as well. Fails where the filter is lost in more than 0.2 % of the
trials (1 % with gusts), a vehicle out of contact in more than 0.5 % (1 %), or the RMS over all
vehicles more than 1.3 (1.5) times the bound along the paths. Few trials want some to `--spare`.

Losses. Each vehicle of these teams is lost at half time, without gusts. Fails where the RMS error
of the others in the second half is over 25 % off what syncplan.what_if predicts. That is of a run
without the vehicle from the start: where the others are not observable by themselves it only may
not be more. They know where they were when they lost it, so the bound along the path is to be met.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.trials import MonteCarloResult
from syncplan.flight.flying import Flight, fly
from syncplan.planning.loss_study import what_if
from syncplan.planning.planner import Plan, plan
from syncplan.planning.validation import validate
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import scenario_from
from tests.tools.scenario_draws import certified_plans, draw_document
from tests.tools.scenarios import changed

KNOWN_SHARE = 0.025
"""Of the radii, 20 m on average: the initial sigma of flights with noise alone."""

ALIKE, RESAMPLES = 0.02, 2000

WIND = {"sigma_mps": 1.0}
GUSTS = {"gust_sigma_mps": 0.2, "gust_time_s": 10.0}
DURATION_S = 400.0

MOST_LOST = {False: 0.002, True: 0.01}
MOST_OUT_OF_CONTACT = {False: 0.005, True: 0.01}
MOST_OVER_BOUND = {False: 1.3, True: 1.5}
"""Without and with gusts."""

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
    made: dict[str, Any] = changed(name, **keys).model_dump(mode="json", exclude_none=True)
    return made


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


def team_plan(name: str, *, gusts: bool) -> Plan:
    """Return the plan of a team in wind."""
    wind = {**WIND, **(GUSTS if gusts else {})}
    document = {**TEAMS[name](), "name": name, "wind": wind, "duration_s": DURATION_S}
    made = plan(scenario_from(document), pilot=False)
    return refine(made, seed=0) if name == "refined" else made


@dataclass(frozen=True, slots=True)
class Wanted:
    """How much is searched.

    Attributes
    ----------
    trials : of each flight
    draws : scenarios with noise alone
    losses : trials of each loss
    teams : names in TEAMS
    spare : trials that may be lost, or out of contact, beyond the limits
    alike : how far from 1 the ratio of two RMS errors may be, whatever its interval
    """

    trials: int = 1000
    seed: int = 0
    draws: int = 10
    losses: int = 100
    teams: tuple[str, ...] = tuple(TEAMS)
    spare: int = 0
    alike: float = ALIKE
    threads: int | None = None


@dataclass(slots=True)
class Findings:
    """Lines of the tables, and what is wrong."""

    wrong: list[str] = field(default_factory=list)

    def line(self, text: str, faults: Sequence[str]) -> None:
        """Print a line; each fault counts."""
        print(text + "".join(f"  <- {one}" for one in faults), flush=True)
        self.wrong += [f"{text.split('  ')[0]}: {one}" for one in faults]


def draw_quiet(number: int, seed: int) -> Plan:
    """Return the `number`-th certified plan of a seed with noise alone and a start known well."""
    generator = np.random.default_rng([seed, number, 170_001])
    drawn = certified_plans(lambda: draw_document(generator, KNOWN_SHARE * 20.0), pilot=False)
    return next(drawn)


def _quiet(number: int, wanted: Wanted, found: Findings) -> None:
    made = draw_quiet(number, wanted.seed)
    options: Any = {"trials": wanted.trials, "seed": wanted.seed + 1, "filter": "ekf"}
    in_flight = fly(made, threads=wanted.threads, **options)
    on_plan = validate(made, threads=wanted.threads, **options)
    mine, theirs = (_squares(one) for one in (in_flight.result.estimates, on_plan.result))
    ratio, low, high = _paired(mine, theirs, np.random.default_rng([wanted.seed, number]))
    off = abs(ratio - 1.0) > wanted.alike and not low <= 1.0 <= high
    rms = np.sqrt(mine.mean())
    text = f"{number:11d}  {made.team.count:8d}  {rms:6.3f}  {ratio:6.3f}  {low:.3f} to {high:.3f}"
    found.line(text, ["flown and validated errors differ"] if off else [])


def _squares(result: MonteCarloResult) -> Array:
    """(trials,) m^2, mean over time and vehicles."""
    return np.asarray(result.mean_squares[..., :2].sum(axis=2).mean(axis=1))


def _paired(a: Array, b: Array, generator: np.random.Generator) -> tuple[float, float, float]:
    """The ratio of two RMS values, and its 95 % interval over resampled pairs."""
    chosen = generator.integers(len(a), size=(RESAMPLES, len(a)))
    ratios = np.sqrt(a[chosen].mean(axis=1) / b[chosen].mean(axis=1))
    low, high = np.percentile(ratios, (2.5, 97.5))
    return float(np.sqrt(a.mean() / b.mean())), float(low), float(high)


def _windy(name: str, gusts: bool, wanted: Wanted, found: Findings) -> None:
    made = team_plan(name, gusts=gusts)
    flight = fly(made, trials=wanted.trials, seed=wanted.seed + 2, threads=wanted.threads)
    over, worst = _over_bound(flight)
    lost, alone = int(flight.filter_lost.sum()), int(flight.out_of_contact.sum())
    figures = flight.result.figures
    kept = figures.kept_meetings.sum() / max(figures.planned_meetings.sum() * wanted.trials, 1)
    faults = []
    if lost > MOST_LOST[gusts] * wanted.trials + wanted.spare:
        faults.append(f"filter lost in {lost}")
    if alone > MOST_OUT_OF_CONTACT[gusts] * wanted.trials + wanted.spare:
        faults.append(f"out of contact in {alone}")
    if not over <= MOST_OVER_BOUND[gusts]:
        faults.append(f"RMS {over:.2f} times the bound")
    tracking = np.sqrt(np.nanmean(figures.tracking_squares))
    text = (
        f"{name:11s}  {'gusts' if gusts else 'wind':5s}  {lost:4d}  {alone:4d}  {over:5.3f}  "
        f"{worst:5.3f}  {_rms(flight.bound):5.2f}  {tracking:8.2f}  {100.0 * kept:6.2f}  "
        f"{np.median(figures.separations):6.2f}  {figures.separations.min():6.2f}"
    )
    found.line(text, faults)


def _over_bound(flight: Flight) -> tuple[float, float]:
    """RMS of the second half over the bound: of all vehicles, and of the worst."""
    late, there = flight.accuracy.late_position, flight.there
    ratios = late[there] / flight.bound[there]
    return _rms(late[there]) / _rms(flight.bound[there]), float(ratios.max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _losses(name: str, wanted: Wanted, found: Findings) -> None:
    made = team_plan(name, gusts=False)
    for vehicle in made.scenario.vehicle_names:
        outcome = what_if(made, [vehicle]).losses[0]
        half = 0.5 * made.scenario.duration_s
        flight = fly(
            made,
            trials=wanted.losses,
            seed=wanted.seed + 3,
            lose=(f"{vehicle}@{half:g}",),
            threads=wanted.threads,
        )
        there = flight.there
        rms, bound = _rms(flight.accuracy.late_position[there]), _rms(flight.bound[there])
        predicted = np.nan if outcome.predicted_rms is None else _rms(outcome.predicted_rms)
        faults = []
        if not (1.0 - LOSS_OFF) * outcome.observable <= rms / predicted <= 1.0 + LOSS_OFF:
            faults.append("not as what-if predicts")
        if not abs(rms / bound - 1.0) <= LOSS_OFF:
            faults.append("not as the bound along the path")
        text = (
            f"{name:11s}  {vehicle:7s}  {rms:6.2f}  {predicted:9.2f}  {rms / predicted:5.2f}  "
            f"{bound:6.2f}  {'yes' if outcome.observable else 'no'}"
        )
        found.line(text, faults)


def main(wanted: Wanted) -> list[str]:
    """Print the tables; return what is wrong."""
    found = Findings()
    if wanted.draws:
        print(f"Noise alone, {wanted.trials} trials each, seed {wanted.seed}")
        print("       draw  vehicles     RMS   ratio  95 %")
        for number in range(wanted.draws):
            _quiet(number, wanted, found)
    if wanted.teams:
        print(f"Wind, {wanted.trials} trials each of {DURATION_S:g} s")
        columns = ("team       ", "air  ", "lost", "alone", "ratio", "worst", "bound", "off plan")
        print("  ".join((*columns, "kept %", "closest in the median and the worst trial")))
    for name in wanted.teams:
        for gusts in (False, True):
            _windy(name, gusts, wanted, found)
    if wanted.losses:
        print(f"A vehicle is lost at half time, {wanted.losses} trials each")
        print("team         lost        RMS  predicted  ratio   bound  observable")
        for name in wanted.teams:
            _losses(name, wanted, found)
    for one in found.wrong:
        print(f"wrong: {one}")
    return found.wrong


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trials", type=int, nargs="?", default=1000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--losses", type=int, default=100)
    parser.add_argument("--teams", default=",".join(TEAMS))
    parser.add_argument("--spare", type=int, default=0)
    parser.add_argument("--alike", type=float, default=ALIKE)
    parser.add_argument("--threads", type=int)
    given = vars(parser.parse_args())
    given["teams"] = tuple(filter(None, given["teams"].split(",")))
    sys.exit(bool(main(Wanted(**given))))
