"""Search for scenarios in which the robust filter does worse than the filter that it guards.

Certified teams of 2 to 8 vehicles are drawn with errors of all kinds as states, each key by itself
with a probability of a half: turn-rate biases up to 0.03 rad/s, gusts up to 0.5 m/s over 3 to 20 s,
wind up to 1.5 m/s, speed scales up to 3 %, bearing biases up to 0.03 rad; and starts known to 0.5
to 15 m. Each is filtered by `ekf`, `second-order` and `robust` with the same draws. A trial is lost
where some vehicle's RMS error of the second half is over 5 times its bound.

Fails where `second-order` loses no trial of a scenario, and the RMS error of `robust` over the
second half is over 1.15 times its own; and where ANEES over the trials of `robust` that are not
lost, of all scenarios together, is outside 0.9 to 1.1. Where `robust` is behind, MORE times as many
trials decide: among few, the largest errors of vehicles that are hardly observed differ by chance.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.orbits.sightings import steps_within
from syncplan.planning.plans import Plan
from tests.searches import Search, outside
from tests.tools.scenario_draws import HEADING_RAD_A_METRE, certified_plans, draw_document

FILTERS = ("ekf", "second-order", "robust")

LASTING = (
    ("motion", "turn_rate_bias_sigma_rad_s", 0.03),
    ("motion", "speed_scale_sigma", 0.03),
    ("wind", "sigma_mps", 1.5),
    ("wind", "gust_sigma_mps", 0.5),
    ("sensor", "bearing_bias_sigma_rad", 0.03),
)
"""Errors that last: section, key and the largest sigma."""

LOST, WORSE = 5.0, 1.15
LEAST_ANEES, LARGEST_ANEES = 0.9, 1.1
TRIALS, MORE = 20, 10


@dataclass(frozen=True, slots=True)
class Filtered:
    """What a filter made of a scenario.

    Attributes
    ----------
    rms : m, over the second half, all vehicles and trials
    lost : number of trials lost
    anees : of the trials that are not; None where all are
    """

    rms: float
    lost: int
    anees: float | None


def draw_disturbed(number: int) -> Plan:
    """Return the plan of a certified scenario."""
    generator = np.random.default_rng([0, number, 27])
    return next(certified_plans(lambda: _document(generator), bound="always"))


def _document(generator: np.random.Generator) -> dict[str, Any]:
    sigma = float(generator.uniform(0.5, 15.0))
    document = draw_document(generator, sigma)
    document["initial_sigma"] = {"position_m": sigma, "heading_rad": HEADING_RAD_A_METRE * sigma}
    for section, key, most in LASTING:
        if generator.random() < 0.5:
            size = float(generator.uniform(0.0, most))
            document[section] = {**document.get(section, {}), key: size}
    if "gust_sigma_mps" in document.get("wind", {}):
        document["wind"]["gust_time_s"] = float(generator.uniform(3.0, 20.0))
    return document


def _filtered(drawn: Plan, trials: int) -> dict[str, Filtered]:
    """What each filter made of a scenario."""
    bound = drawn.prediction.rms
    assert bound is not None
    steps = steps_within(drawn.scenario.duration_s, drawn.sensors.sample_time)
    seen = possible_sightings(drawn.team, drawn.windows, steps)
    filtered = {}
    for name in FILTERS:
        options = FilterOptions(trials=trials, seed=1, filter=name)
        result = run_trials(drawn.team, seen, steps, options, threads=1)
        squares = result.late_mean_squares[..., :2].sum(axis=-1)
        squares[~np.isfinite(squares)] = np.inf
        lost = np.any(np.sqrt(squares) > LOST * bound, axis=1)
        nees = (result.nees / (3 * drawn.team.count))[~lost]
        anees = float(nees.mean()) if len(nees) else None
        filtered[name] = Filtered(float(np.sqrt(squares.mean())), int(lost.sum()), anees)
    return filtered


def draw(number: int) -> tuple[list[str], dict[str, Filtered]]:
    """Return what the filters made of a scenario, a fault where `robust` is behind."""
    drawn, faults = draw_disturbed(number), []
    filtered = _filtered(drawn, TRIALS)
    if _behind(filtered) and _behind(more := _filtered(drawn, MORE * TRIALS)):
        robust, second = more["robust"].rms, more["second-order"].rms
        faults.append(f"{robust:.3g} m, second-order {second:.3g} m in {MORE * TRIALS} trials")
    return faults, filtered


def _behind(filtered: Mapping[str, Filtered]) -> bool:
    """Whether `robust` is worse than `second-order`, which loses no trial."""
    second = filtered["second-order"]
    return not second.lost and filtered["robust"].rms > WORSE * second.rms


def judge(cases: Mapping[int, Mapping[str, Filtered]], chance: float) -> list[str]:
    """Print how `robust` compares with the others; return whether its ANEES is off."""
    faults = []
    for name in FILTERS:
        lost = np.array([case[name].lost for case in cases.values()])
        each = [case[name].anees for case in cases.values()]
        anees = np.array([value for value in each if value is not None])
        far = np.sum((anees < LEAST_ANEES) | (anees > LARGEST_ANEES))
        print(
            f"{name:<13} lost {lost.sum():>4} in {np.sum(lost > 0)} scenarios; ANEES of the others "
            f"{np.mean(anees):.3f}, by scenario {np.min(anees, initial=np.inf):.2f} to "
            f"{np.max(anees, initial=-np.inf):.2f}, {far} outside"
        )
        if name == "robust" and outside(anees, LEAST_ANEES, LARGEST_ANEES, chance):
            faults.append(f"ANEES of robust {np.mean(anees):.3f}")
    kept = [case for case in cases.values() if not case["second-order"].lost]
    if kept:
        ratios = [case["robust"].rms / case["second-order"].rms for case in kept]
        print(
            f"second-order loses no trial in {len(kept)}: RMS of robust over its "
            f"{min(ratios):.3f} to {max(ratios):.3f}, median {np.median(ratios):.3f}"
        )
    return faults


SEARCH = Search(draw, judge, draws=12)
