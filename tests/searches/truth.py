"""Search for worlds that cost a filter more, or less, than is expected of it in them.

Certified teams are drawn as in `neglect`, with small initial sigmas and small errors of every
kind, all of them states of the filter, so that linear algebra holds: clocks are off by no more than
0.01 s, as noise in the rows of larger offsets counts as knowledge of them
(docs/what-is-modelled.md). Each is validated in worlds with each stated sigma at twice the
scenario's, one at a time. The RMS position error of the second half, over all vehicles, is compared
with the one expected. Fails where any key's mean over the cases is off by over 10 %, or the error
expected is not that of the prediction where the world is as stated.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from syncplan.estimation.considered_errors import expected_errors
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.planning.variations import doubled_sigmas
from syncplan.scenario.loading import scenario_from
from tests.searches import Search, outside
from tests.searches.neglect import draw_plan
from tests.tools.on_paper import plan

OFF = 0.1
TRIALS = 60


@dataclass(frozen=True, slots=True)
class Held:
    """Errors of a drawn scenario in one world.

    Attributes
    ----------
    error, expected, predicted : m, RMS over the second half and all vehicles
    """

    error: float
    expected: float
    predicted: float


def draw_small(number: int) -> Plan:
    """Return the plan of a scenario, all of whose errors are small."""
    generator = np.random.default_rng([0, number, 270_405])
    document = draw_plan(number).scenario.model_dump(exclude_none=True)

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
    small = {
        **document,
        **keys,
        "motion": {**document["motion"], **motion},
        "sensor": {**document["sensor"], **sensor},
    }
    return plan(scenario_from(small), bound="always", pilot=False)


def draw(number: int) -> tuple[list[str], dict[str, Held]]:
    """Return the errors of a scenario in each world, by the key with twice its sigma there."""
    planned = draw_small(number)
    team, length = planned.team, planned.scenario.duration_s
    assert planned.prediction.rms is not None
    stated = expected_errors(team, planned.windows, length, true=team).rms_second_half()
    faults = []
    if not np.allclose(stated, planned.prediction.rms, rtol=1e-5, atol=0.0):
        faults.append("as stated, the world costs something")
    held = {}
    for key, truth in doubled_sigmas(planned.scenario).items():
        flown = validate(planned, trials=TRIALS, seed=1, threads=1, truth=truth)
        assert flown.expected is not None
        errors = flown.accuracy.late_position, flown.expected, planned.prediction.rms
        held[key] = Held(*(float(np.sqrt(np.mean(error**2))) for error in errors))
    return faults, held


def judge(cases: Mapping[int, dict[str, Held]], chance: float) -> list[str]:
    """Print how errors compare with those expected, by key; return where they differ."""
    by_key: dict[str, list[Held]] = defaultdict(list)
    for case in cases.values():
        for key, held in case.items():
            by_key[key].append(held)
    faults = []
    for key, some in by_key.items():
        ratios = np.array([held.error / held.expected for held in some])
        cost = np.mean([held.expected / held.predicted for held in some])
        text = f"{key}: error over expected {ratios.mean():.3f}"
        print(
            f"{text}, {ratios.min():.3f} to {ratios.max():.3f}; expected over predicted {cost:.2f}"
        )
        if outside(ratios, 1.0 - OFF, 1.0 + OFF, chance):
            faults.append(text)
    return faults


SEARCH = Search(draw, judge, draws=1)
