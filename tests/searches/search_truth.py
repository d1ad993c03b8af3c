"""Search for worlds that cost a filter more, or less, than is expected of it in them.

    python -m tests.searches.search_truth [DRAWS [SEED]] [--trials N] [--processes N]

Part of `make check-all`. Certified teams are drawn as in search_start_up, with small initial sigmas
and small errors of every kind, all of them states of the filter, so that linear algebra holds:
clocks are off by no more than 0.01 s, as noise in the rows of larger offsets counts as knowledge of
them (docs/what-is-modelled.md). Each is validated in worlds with each stated sigma at twice the
scenario's, one at a time. Found over expected is the RMS position error of the second half, over
all vehicles. Fails where any key's mean over the draws is off by over 10 %, or its expected error
is not that of the prediction where the world is as stated.
"""

import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from syncplan.estimation.considered_errors import expected_errors
from syncplan.planning.planner import Plan, plan
from syncplan.planning.validation import validate
from syncplan.planning.variations import doubled_sigmas
from syncplan.scenario.loading import scenario_from
from tests.searches.search_start_up import draw_plan
from tests.tools.search_arguments import search_arguments

OFF = 0.1


@dataclass(frozen=True, slots=True)
class Held:
    """What a drawn scenario came to in one world.

    Attributes
    ----------
    key : that is twice its sigma there
    found, expected, predicted : m, RMS over the second half and all vehicles
    """

    key: str
    found: float
    expected: float
    predicted: float

    @property
    def ratio(self) -> float:
        """Found over expected."""
        return self.found / self.expected


def draw_small(number: int, seed: int) -> Plan:
    """Return the plan of the `number`-th scenario of a seed, all of whose errors are small."""
    generator = np.random.default_rng([seed, number, 270_405])
    document = draw_plan(number, seed).scenario.model_dump(exclude_none=True)

    def some(low: float, high: float) -> float:
        return float(np.exp(generator.uniform(np.log(low), np.log(high))))

    keys = {
        "initial_sigma": {"position_m": some(0.3, 1.0), "heading_rad": some(0.01, 0.03)},
        "heading_sigma_rad": some(0.03, 0.1),
        "duration_s": min(document["duration_s"], 120.0),
        "filter": {"kind": "ekf"},
        "wind": {
            "sigma_mps": some(0.02, 0.1),
            "gust_sigma_mps": some(0.02, 0.1),
            "gust_time_s": some(4.0, 20.0),
        },
    }
    motion = {
        "speed_scale_sigma": some(0.003, 0.01),
        "turn_rate_bias_sigma_rad_s": some(0.0005, 0.002),
        "clock_offset_sigma_s": some(0.002, 0.01),
    }
    sensor = {
        "bearing_sigma_rad": some(0.01, 0.05),
        "bearing_bias_sigma_rad": some(0.003, 0.01),
        "range_sigma_m": some(0.2, 0.6),
        "bearing_walk": {"sigma_rad": some(0.01, 0.03), "time_s": some(4.0, 20.0)},
    }
    made = {
        **document,
        **keys,
        "motion": {**document["motion"], **motion},
        "sensor": {**document["sensor"], **sensor},
    }
    return plan(scenario_from(made), bound="always", pilot=False)


def search_one(number: int, *, seed: int, trials: int) -> list[Held]:
    """Return what the `number`-th scenario of a seed came to in each world."""
    made, found = draw_small(number, seed), []
    team, length = made.team, made.scenario.duration_s
    assert made.prediction.rms is not None
    same = expected_errors(team, made.windows, length, true=team).rms_second_half()
    np.testing.assert_allclose(same, made.prediction.rms, rtol=1e-5)
    for key, truth in doubled_sigmas(made.scenario).items():
        flown = validate(made, trials=trials, seed=seed + 1, threads=1, truth=truth)
        assert flown.expected is not None
        each = flown.accuracy.late_position, flown.expected, made.prediction.rms
        found.append(Held(key, *(float(np.sqrt(np.mean(one**2))) for one in each)))
    return found


def main(
    draws: int = 10, seed: int = 0, *, trials: int = 100, processes: int | None = None
) -> bool:
    """Print what became of the draws, by key; return whether all was as expected."""
    with ProcessPoolExecutor(processes) as pool:
        worlds = pool.map(partial(search_one, seed=seed, trials=trials), range(draws))
        by_key: dict[str, list[Held]] = defaultdict(list)
        for one in (one for world in worlds for one in world):
            by_key[one.key].append(one)
    print(f"{draws} scenarios, {trials} trials each in worlds with a sigma doubled, seed {seed}")
    passed = True
    for key, held in by_key.items():
        ratios = np.array([one.ratio for one in held])
        cost = np.mean([one.expected / one.predicted for one in held])
        mean = float(np.mean(ratios))
        passed &= abs(mean - 1.0) <= OFF
        print(
            f"{key}: found over expected {mean:.3f}, {ratios.min():.3f} to {ratios.max():.3f}; "
            f"expected over predicted {cost:.2f}"
        )
    return passed


if __name__ == "__main__":
    sys.exit(not main(**vars(search_arguments(__doc__, 10).parse_args())))
