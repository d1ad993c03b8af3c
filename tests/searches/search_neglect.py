"""Search for errors that are not estimated and cost more, or less, than the plan expects.

    python -m tests.searches.search_neglect [DRAWS [SEED]] [--trials N] [--processes N]
        [--most SHARE]

Part of `make check-all`. Certified teams are drawn as in search_start_up, with initial sigmas of
up to 2 m, and with some of the errors that last, further kinds of sighting and misses. The filter
estimates some of these errors or none. Each is planned and validated; found over expected is the
RMS position error of the second half, over all vehicles. Fails where more than a tenth of the draws
is off by over 30 %, of those where linear algebra can hold: the error expected is below a tenth of
the sensors' range. Fails too where the report's ANEES does not say that the filter is optimistic in
more than a tenth of the draws whose error is expected to be over 1.5 times the bound.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from syncplan.errors import NoSolutionError
from syncplan.planning.planner import Plan, plan
from syncplan.planning.validation import validate
from syncplan.scenario.loading import scenario_from
from tests.searches.search_start_up import draw_plan
from tests.tools.search_arguments import search_arguments

OFF, MOST_OFF = 0.3, 0.1
COSTLY = 1.5
"""Expected over predicted error from which on the ANEES has to find the filter optimistic."""

LINEAR_SHARE = 0.1
"""Of the range: up to this error, tangents are taken nearly where they should be."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What one drawn scenario came to.

    Attributes
    ----------
    neglected : what the filter does not estimate
    bound, expected, found : m, RMS over the second half and all vehicles; found is infinite where
        the filter diverged
    reach : m, range of the sensors
    anees, verdict : of the validation; of a filter that diverged, NaN and its diverging
    """

    neglected: tuple[str, ...]
    bound: float
    expected: float
    found: float
    reach: float
    anees: float
    verdict: str

    @property
    def linear(self) -> bool:
        """Whether linear algebra can hold."""
        return self.expected <= LINEAR_SHARE * self.reach

    @property
    def ratio(self) -> float:
        """Found over expected."""
        return self.found / self.expected


def draw_neglect(number: int, seed: int) -> Plan:
    """Return the plan of the `number`-th scenario of a seed whose filter neglects something."""
    generator = np.random.default_rng([seed, number, 150_415])
    scenario = draw_plan(number, seed).scenario
    document = scenario.model_dump(exclude_none=True)
    sigma = float(generator.uniform(0.3, 2.0))
    document["initial_sigma"] = {"position_m": sigma, "heading_rad": 0.02 * sigma}
    while True:
        drawn = _with_errors(document, generator)
        estimable = list(scenario_from(drawn).error_sigmas)
        states = [name for name in estimable if generator.random() < 0.3]
        if len(states) < len(estimable):
            break
    return plan(scenario_from({**drawn, "filter": {"estimate": states}}), pilot=False)


def _with_errors(document: dict[str, Any], generator: np.random.Generator) -> dict[str, Any]:
    def some(low: float, high: float, share: float = 0.4) -> float | None:
        value = float(np.exp(generator.uniform(np.log(low), np.log(high))))
        return value if generator.random() < share else None

    motion = {
        "speed_scale_sigma": some(0.005, 0.03),
        "turn_rate_bias_sigma_rad_s": some(0.001, 0.008),
    }
    sensor = {
        "bearing_bias_sigma_rad": some(0.005, 0.03),
        "range_sigma_m": some(0.2, 2.0, 0.3),
        "detection_probability": some(0.6, 1.0, 0.3),
    }
    wind = {"sigma_mps": some(0.01, 0.1), "gust_sigma_mps": some(0.03, 0.2)}
    return {
        **document,
        "motion": {**document["motion"], **_given(motion)},
        "sensor": {**document["sensor"], **_given(sensor)},
        "wind": _given(wind),
        **_given({"heading_sigma_rad": some(0.02, 0.2, 0.2)}),
    }


def _given(keys: dict[str, float | None]) -> dict[str, float]:
    return {key: value for key, value in keys.items() if value is not None}


def search_one(number: int, *, seed: int, trials: int) -> Cost:
    """Return what the `number`-th scenario of a seed came to."""
    made = draw_neglect(number, seed)
    neglect, rms = made.prediction.neglect, made.prediction.rms
    assert neglect is not None
    assert neglect.expected is not None
    assert rms is not None
    found, consistency, verdict = np.inf, np.nan, "diverged"
    try:
        flown = validate(made, trials=trials, seed=seed + 1, threads=1)
    except NoSolutionError:
        pass
    else:
        found = _rms(flown.accuracy.late_position)
        consistency, verdict = float(flown.anees.value), flown.anees.verdict
    reach = float(made.sensors.ranges.max())
    expected = _rms(neglect.expected)
    return Cost(neglect.names, _rms(rms), expected, found, reach, consistency, verdict)


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main(
    draws: int = 100,
    seed: int = 0,
    *,
    trials: int = 100,
    processes: int | None = None,
    most: float = MOST_OFF,
) -> bool:
    """Print what became of the draws; return whether the plans expected well enough."""
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(partial(search_one, seed=seed, trials=trials), range(draws)))
    linear = [one for one in found if one.linear]
    off = [one for one in linear if not abs(one.ratio - 1.0) <= OFF]
    print(f"{draws} scenarios whose filter neglects errors, {trials} trials each, seed {seed}")
    for title, some in (("linear", linear), ("beyond", [one for one in found if not one.linear])):
        if some:
            ratios = np.percentile([one.ratio for one in some], (5, 50, 95))
            spread = ", ".join(f"{ratio:.2f}" for ratio in ratios)
            print(f"{title}: {len(some)} draws; found over expected, 5, 50, 95 %: {spread}")
    for one in off:
        print(f"  off: {one}")
    share = len(off) / max(len(linear), 1)
    print(f"{share:.1%} of the linear ones are off by over {OFF:.0%}")
    costly = [one for one in found if one.expected > COSTLY * one.bound]
    unsaid = [one for one in costly if one.verdict not in ("optimistic", "diverged")]
    for one in unsaid:
        print(f"  not said: {one}")
    print(f"{len(costly)} cost over {COSTLY:g} times the bound; ANEES misses {len(unsaid)}")
    return share <= most and len(unsaid) <= most * len(costly)


if __name__ == "__main__":
    arguments = search_arguments(__doc__, 100)
    arguments.add_argument("--most", type=float)
    sys.exit(not main(**vars(arguments.parse_args())))
