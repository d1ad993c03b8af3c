"""Search for a winner of a design that breaks its brief, and for a front that is easily beaten.

Briefs are of all purposes, with keep-outs, obstacles, wind and limits of bank and turn rate. Fails
where a winner is not GO or does not hold its brief by dense sampling, or where its error in a
validation or in flights, of other seeds than the design's, is above the need. Fails, too, where a
vehicle or a landmark more makes the front worse, and where more than one team in ten is worse by
3 % than the best of a simple search.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from syncplan.designs.candidates import UNFIT
from syncplan.designs.designer import design
from syncplan.flight.flying import fly
from syncplan.planning.validation import validate
from syncplan.scenario.brief import Brief, brief_of
from tests.searches import Search, most_of
from tests.tools.briefs import FIELD, broken
from tests.tools.fronts import simple_search, worsened

TRIALS = 40
MOST_BEATEN = 0.1

CHANCE = 1.15
"""Multiple of the need that other trials may reach: the spread of an RMS of 40 trials."""


def draw_brief(number: int) -> Brief:
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


def draw(number: int) -> tuple[list[str], tuple[str, float]]:
    """Return what a design breaks, its status, and its error over that of a simple search.

    The last is that of a team of the front, 1 where neither search has a formation without fault.
    """
    brief = draw_brief(number)
    designed = design(brief, workers=1)
    faults, ratio = worsened(designed.front), 1.0
    if designed.front:
        team = designed.front[number % len(designed.front)]
        simple = simple_search(brief, team.cell)
        ratio = team.value / simple if min(team.value, simple) < UNFIT else 1.0
    if designed.status != "met":
        return faults, (designed.status, ratio)
    assert designed.best is not None
    winner = designed.best.plan
    faults += broken(brief, winner)
    if not winner.verdict.go:
        faults.append("NO-GO")
    limit = CHANCE * brief.need.worst_rms_m
    for run in (validate, fly):
        again = run(winner, trials=TRIALS, seed=brief.seed + 1, threads=1)
        worst = float(again.accuracy.late_position.max())
        if not worst <= limit:
            faults.append(f"{run.__name__}: {worst:.3g} m, limit {limit:.3g} m")
    return faults, (designed.status, ratio)


def judge(cases: Mapping[int, tuple[str, float]], chance: float) -> list[str]:
    """Print how many designs have each status; return whether simple searches beat too many."""
    print(dict(Counter(status for status, _ in cases.values())))
    ratios = np.array([ratio for _, ratio in cases.values()])
    print(f"errors over those of a simple search: median {np.median(ratios):.2f}")
    beaten = [number for number, (_, ratio) in cases.items() if ratio > 1.03]
    if len(beaten) > (most := most_of(len(cases), MOST_BEATEN, chance)):
        return [f"{len(beaten)} beaten by a simple search, at most {most:.3g} may: {beaten[:5]}"]
    return []


SEARCH = Search(draw, judge, draws=1)
