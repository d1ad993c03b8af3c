"""Search for errors that are not estimated and cost more, or less, than the plan expects.

Certified teams of 2 to 8 vehicles are drawn, with initial sigmas of up to 2 m, and with some of the
errors that last, further kinds of sighting and misses. The filter estimates some of these errors or
none. Each is planned and validated; the RMS position error of the second half, over all vehicles,
is compared with the one expected. Fails where more than a tenth of the cases are off by over 30 %,
of those where linear algebra can hold: the error expected is below a tenth of the sensors' range.
Fails too where the report's ANEES does not say that the filter is optimistic in more than a tenth
of the cases whose error is expected to be over 1.5 times the bound.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.errors import NoSolutionError
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.scenario.loading import scenario_from
from tests.searches import Search, most_of
from tests.tools.on_paper import plan
from tests.tools.scenario_draws import certified_plans, draw_document

OFF, MOST_OFF = 0.3, 0.1
COSTLY = 1.5
"""Expected over predicted error from which on the ANEES has to find the filter optimistic."""

LINEAR_SHARE = 0.1
"""Of the range: up to this error, tangents are taken nearly where they should be."""

TRIALS = 100


@dataclass(frozen=True, slots=True)
class Cost:
    """Errors of a drawn scenario.

    Attributes
    ----------
    neglected : what the filter does not estimate
    bound, expected, error : m, RMS over the second half and all vehicles; the error is infinite
        where the filter diverged
    reach : m, range of the sensors
    anees, verdict : of the validation; of a filter that diverged, NaN and its diverging
    """

    neglected: tuple[str, ...]
    bound: float
    expected: float
    error: float
    reach: float
    anees: float
    verdict: str

    @property
    def linear(self) -> bool:
        """Whether linear algebra can hold."""
        return self.expected <= LINEAR_SHARE * self.reach

    @property
    def ratio(self) -> float:
        """Error over the one expected."""
        return self.error / self.expected

    @property
    def said(self) -> bool:
        """Whether the validation says that the filter is too sure."""
        return self.verdict in ("optimistic", "diverged")


SIGMAS_M = (0.5, 2.0, 5.0, 15.0, 30.0)
"""Initial sigmas of certified teams."""


def draw_plan(number: int) -> Plan:
    """Return the plan of a certified scenario whose errors are predicted."""
    generator = np.random.default_rng([0, number, 60413])
    sigma = SIGMAS_M[number % len(SIGMAS_M)]
    plans = certified_plans(lambda: draw_document(generator, sigma))
    return next(planned for planned in plans if planned.start_up is not None)


def draw_neglect(number: int) -> Plan:
    """Return the plan of a scenario whose filter neglects something."""
    generator = np.random.default_rng([0, number, 150_415])
    document = draw_plan(number).scenario.model_dump(exclude_none=True)
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


def draw(number: int) -> tuple[list[str], Cost]:
    """Return the errors of a scenario."""
    planned = draw_neglect(number)
    neglect, rms = planned.prediction.neglect, planned.prediction.rms
    assert neglect is not None
    assert neglect.expected is not None
    assert rms is not None
    error, anees, verdict = np.inf, np.nan, "diverged"
    try:
        flown = validate(planned, trials=TRIALS, seed=1, threads=1)
    except NoSolutionError:
        pass
    else:
        error = _rms(flown.accuracy.late_position)
        anees, verdict = float(flown.anees.value), flown.anees.verdict
    reach = float(planned.sensors.ranges.max())
    expected = _rms(neglect.expected)
    return [], Cost(neglect.names, _rms(rms), expected, error, reach, anees, verdict)


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def judge(cases: Mapping[int, Cost], chance: float) -> list[str]:
    """Print how errors compare with those expected; return where too many do not."""
    linear = {number: case for number, case in cases.items() if case.linear}
    costly = {n: case for n, case in cases.items() if case.expected > COSTLY * case.bound}
    off = {n: case for n, case in linear.items() if not abs(case.ratio - 1.0) <= OFF}
    unsaid = {n: case for n, case in costly.items() if not case.said}
    faults = []
    for title, failed, some in (
        (f"linear, off by over {OFF:.0%}", off, linear),
        (f"over {COSTLY:g} times the bound, not called optimistic", unsaid, costly),
    ):
        for number, case in failed.items():
            print(f"  {number}: {title}: {case}")
        print(f"{title}: {len(failed)} of {len(some)}")
        if len(failed) > most_of(len(some), MOST_OFF, chance):
            faults.append(f"{title}: {len(failed)} of {len(some)}")
    return faults


SEARCH = Search(draw, judge, draws=12)
