"""Search for scenarios in which the robust filter does worse than the filter that it guards.

    python -m tests.searches.search_robust [DRAWS [SEED]] [--trials N] [--processes N]

Part of `make check-all`. Certified teams of 2 to 8 vehicles are drawn with errors of all kinds as
states, each key by itself with a probability of a half: turn-rate biases up to 0.03 rad/s, gusts up
to 0.5 m/s over 3 to 20 s, wind up to 1.5 m/s, speed scales up to 3 %, bearing biases up to 0.03
rad; and starts known to 0.5 to 15 m. Each is filtered by `ekf`, `second-order` and `robust` with
the same draws. A trial is lost where some vehicle's RMS error of the second half is over 5 times
its bound.

Fails where `second-order` loses no trial of a scenario, and the RMS error of `robust` over the
second half is over 1.15 times its own; where ANEES over the trials of `robust` that are not lost,
of all scenarios together, is outside 0.9 to 1.1; and where `robust` takes over 3.5 times the
processor time of `ekf` over all scenarios in which neither `ekf` nor `second-order` loses a trial.
Where `robust` is behind, MORE times as many trials decide: among few, the largest errors of
vehicles that are hardly observed differ by chance.
"""

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.orbits.sightings import steps_within
from syncplan.planning.planner import Plan
from tests.tools.scenario_draws import HEADING_RAD_A_METRE, certified_plans, draw_document
from tests.tools.search_arguments import search_arguments

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
MOST_TIMES = 3.5
MORE = 10


@dataclass(frozen=True, slots=True)
class Filtered:
    """What a filter made of one drawn scenario.

    Attributes
    ----------
    number, name : of the draw; of the filter
    rms : m, over the second half, all vehicles and trials
    lost : number of trials lost
    nees : mean NEES over the number of states of each trial that is not
    seconds : of processor time
    """

    number: int
    name: str
    rms: float
    lost: int
    nees: tuple[float, ...]
    seconds: float


def draw_disturbed(number: int, seed: int) -> Plan:
    """Return the plan of the `number`-th certified scenario of a seed."""
    generator = np.random.default_rng([seed, number, 27])
    return next(certified_plans(lambda: _drawn(generator), bound="always"))


def _drawn(generator: np.random.Generator) -> dict[str, Any]:
    sigma = float(generator.uniform(0.5, 15.0))
    document = draw_document(generator, sigma)
    document["initial_sigma"] = {"position_m": sigma, "heading_rad": HEADING_RAD_A_METRE * sigma}
    for section, key, most in LASTING:
        if generator.random() < 0.5:
            drawn = float(generator.uniform(0.0, most))
            document[section] = {**document.get(section, {}), key: drawn}
    if "gust_sigma_mps" in document.get("wind", {}):
        document["wind"]["gust_time_s"] = float(generator.uniform(3.0, 20.0))
    return document


def search_one(number: int, *, seed: int, trials: int) -> list[Filtered]:
    """Return what the filters made of the `number`-th scenario of a seed."""
    made, found = draw_disturbed(number, seed), []
    bound = made.prediction.rms
    assert bound is not None
    steps = steps_within(made.scenario.duration_s, made.sensors.sample_time)
    seen = possible_sightings(made.team, made.windows, steps)
    for name in FILTERS:
        options = FilterOptions(trials=trials, seed=seed + 1, filter=name)
        run_trials(made.team, seen, 2, options, threads=1)
        began = time.process_time()
        result = run_trials(made.team, seen, steps, options, threads=1)
        seconds = time.process_time() - began
        squares = result.late_mean_squares[..., :2].sum(axis=-1)
        squares[~np.isfinite(squares)] = np.inf
        lost = np.any(np.sqrt(squares) > LOST * bound, axis=1)
        nees = tuple((result.nees / (3 * made.team.count))[~lost].tolist())
        rms = float(np.sqrt(squares.mean()))
        found.append(Filtered(number, name, rms, int(lost.sum()), nees, seconds))
    return found


def main(
    draws: int = 300, seed: int = 0, *, trials: int = 20, processes: int | None = None
) -> bool:
    """Print how `robust` compares with the others; return whether it is never much worse."""
    one = partial(search_one, seed=seed, trials=trials)
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(one, range(draws)))
    kept = [each for each in found if not each[1].lost]
    ratios = np.array([robust.rms / second.rms for _, second, robust in kept])
    print(f"{draws} certified scenarios, {trials} trials each, seed {seed}")
    for k, name in enumerate(FILTERS):
        own = [each[k] for each in found]
        anees = np.mean([value for each in own for value in each.nees])
        far = [np.mean(each.nees) for each in own if each.nees]
        outside = sum(not LEAST_ANEES <= one <= LARGEST_ANEES for one in far)
        print(
            f"{name:<13} lost {sum(each.lost for each in own):>4} in "
            f"{sum(each.lost > 0 for each in own)} scenarios; ANEES of the others {anees:.3f}, "
            f"by scenario {min(far):.2f} to {max(far):.2f}, {outside} outside"
        )
    print(
        f"second-order loses nobody in {len(kept)}: RMS of robust over its own "
        f"{ratios.min():.3f} to {ratios.max():.3f}, median {np.median(ratios):.3f}"
    )
    worse = 0
    for (_, second, robust), ratio in zip(kept, ratios, strict=True):
        if ratio <= WORSE:
            continue
        _, more, again = search_one(robust.number, seed=seed, trials=MORE * trials)
        worse += not more.lost and again.rms > WORSE * more.rms
        print(
            f"  draw {robust.number}: {robust.rms:.3g} m, second-order {second.rms:.3g} m; in "
            f"{MORE * trials} trials {again.rms:.3g} m, {more.rms:.3g} m with {more.lost} lost"
        )
    calm = [each for each in found if not any(one.lost for one in each[:2])]
    times = sum(robust.seconds for *_, robust in calm) / sum(ekf.seconds for ekf, *_ in calm)
    each = np.array([robust.seconds / ekf.seconds for ekf, _, robust in calm])
    print(
        f"robust takes {times:.2f} times as long as ekf over {len(calm)} scenarios in which none "
        f"is lost: median {np.median(each):.2f}, nine in ten {np.quantile(each, 0.9):.2f}"
    )
    nees = np.mean([value for *_, robust in found for value in robust.nees])
    return bool(
        np.all(ratios <= WORSE) and LEAST_ANEES <= nees <= LARGEST_ANEES and (times <= MOST_TIMES)
    )


if __name__ == "__main__":
    sys.exit(not main(**vars(search_arguments(__doc__, 300).parse_args())))
