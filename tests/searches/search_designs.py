"""Search for a winner of a design that breaks its brief.

    python -m tests.searches.search_designs [DRAWS [FIRST]]

Random briefs of all purposes, with keep-outs, obstacles, wind and limits of bank and turn rate.
Every winner has to be GO and to hold its brief by dense sampling, and its error in a validation and
in flights, of other seeds than the design's, has to be within the need. Part of `make check-all`.
"""

import sys
from typing import Any

import numpy as np

from syncplan.designs.designer import design
from syncplan.flight.flying import fly
from syncplan.planning.validation import validate
from syncplan.scenario.brief import Brief, brief_of
from tests.tools.briefs import FIELD, broken

TRIALS = 40

CHANCE = 1.15
"""Multiple of the need that other trials may reach: the spread of an RMS of 40 trials."""


def drawn(number: int) -> Brief:
    """Return a random brief; its need is drawn too, so that some are not met."""
    generator = np.random.default_rng(number)
    width, height = generator.uniform(120.0, 400.0), generator.uniform(90.0, 250.0)
    size = min(width, height)
    swath = float(generator.uniform(0.25, 0.6) * size)
    keys: dict[str, Any] = {
        **FIELD,
        "area_m": [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
        "sensor": {
            "range_m": float(generator.uniform(0.4, 1.0) * max(width, height)),
            "bearing_sigma_rad": float(generator.uniform(0.01, 0.05)),
            "sample_time_s": 0.25,
        },
        "team": {"max": int(generator.integers(3, 6))},
        "landmarks": {"max": int(generator.integers(2, 4)), "on_edge": bool(generator.integers(2))},
        "need": {"worst_rms_m": float(np.exp(generator.uniform(np.log(0.3), np.log(4.0))))},
        "seed": number,
    }
    inner = generator.uniform([0.1 * width, 0.1 * height], [0.9 * width, 0.9 * height], (3, 2))
    keys["purpose"] = (
        {"cover": {"share": float(generator.uniform(0.4, 0.8)), "swath_m": swath}},
        {"visit_m": inner.tolist(), "within_m": 0.05 * size},
        {"keep": {"count": 3, "spread_m": float(generator.uniform(0.2, 0.4) * size)}},
    )[number % 3]
    corner = generator.uniform([0.2 * width, 0.2 * height], [0.6 * width, 0.6 * height])
    polygon = (corner + size * np.array([[0.0, 0.0], [0.1, 0.0], [0.05, 0.1]])).tolist()
    if generator.uniform() < 0.4:
        keys["keep_out_m"] = [polygon]
    if generator.uniform() < 0.4:
        keys["obstacles_m"] = [polygon]
    if generator.uniform() < 0.3:
        keys["wind"] = {"sigma_mps": 0.5}
    if generator.uniform() < 0.3:
        keys["heading_sigma_rad"] = 0.05
    keys["vehicle"] = (
        {"speed_mps": 5.0, "min_radius_m": 0.1 * size},
        {"speed_mps": [6.0, 9.0], "bank_deg": 30.0},
        {"speed_mps": 4.0, "turn_rate_rad_s": 0.4},
    )[int(generator.integers(3))]
    return brief_of(keys)


def differences(number: int) -> tuple[str, list[str]]:
    """Return the status of a draw's design, and what its winner breaks."""
    given = drawn(number)
    found = design(given)
    if found.status != "met":
        return found.status, []
    assert found.best is not None
    made = found.best.plan
    faults = broken(given, made)
    if not made.verdict.go:
        faults.append("NO-GO")
    limit = CHANCE * given.need.worst_rms_m
    for run in (validate, fly):
        again = run(made, trials=TRIALS, seed=given.seed + 1)
        worst = float(again.accuracy.late_position.max())
        if not worst <= limit:
            faults.append(f"{run.__name__}: {worst:.3g} m, limit {limit:.3g} m")
    return found.status, faults


def main(draws: int = 50, first: int = 0) -> list[int]:
    """Return the numbers of draws whose winner breaks its brief, from number `first` on."""
    failures, count = [], {"met": 0, "not_found": 0, "impossible": 0}
    for number in range(first, first + draws):
        status, faults = differences(number)
        count[status] += 1
        if faults:
            failures.append(number)
            print(f"{number}: {'; '.join(faults)}", flush=True)
    print(f"{draws} draws, {count}; {len(failures)} break their brief {failures[:10]}")
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
