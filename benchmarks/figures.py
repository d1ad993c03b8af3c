"""How long the values of figures take, and how large they are: what a live page waits for."""

import json
from dataclasses import dataclass
from time import perf_counter

from benchmarks import Figure, print_figures
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.plotting.figure_files import figure_page
from syncplan.plotting.figures import specs_of
from syncplan.scenario.loading import scenario_from

__all__ = ["Timings", "figures", "main"]

ROUNDS = 20
TEAM = {
    "name": "twelve",
    "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "alternate"},
    "formation": {"shape": "grid", "count": 12, "columns": 4, "spacing_m": 70.0},
    "landmarks_m": [[-50.0, 0.0], [260.0, 0.0], [260.0, 140.0]],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
}
"""Twelve vehicles that are not observable: every kind of mark is drawn."""


@dataclass(frozen=True, slots=True)
class Timings:
    """Seconds and bytes of JSON of each figure of a plan of twelve, and of a page of them all."""

    seconds: dict[str, float]
    sizes: dict[str, int]
    page: float
    page_bytes: int


def main() -> Timings:
    """Return the timings: the least of ROUNDS."""
    made = plan(scenario_from(TEAM))
    specs = specs_of(made)
    return Timings(
        seconds={name: _least(made, name) for name in specs},
        sizes={name: len(json.dumps(spec, separators=(",", ":"))) for name, spec in specs.items()},
        page=_page_time(made),
        page_bytes=len(figure_page("twelve", specs).encode()),
    )


def figures(timings: Timings) -> list[Figure]:
    """Return the table's rows."""
    rows = [
        Figure("figures: formation of 12", timings.seconds["formation"], "s", 0.02),
        Figure("figures: formation of 12, its JSON", timings.sizes["formation"] / 1e6, "MB", 0.15),
        Figure("figures: animation of 12", timings.seconds["animation"], "s"),
        Figure("figures: animation of 12, its JSON", timings.sizes["animation"] / 1e6, "MB", 1.0),
        Figure("figures: timeline of 12", timings.seconds["timeline"], "s"),
        Figure("figures: page of all figures of 12", timings.page, "s"),
        Figure("figures: page of all figures of 12, size", timings.page_bytes / 1e6, "MB", 2.0),
    ]
    return rows


def _least(made: Plan, name: str) -> float:
    times = []
    for _ in range(ROUNDS):
        start = perf_counter()
        specs_of(made, [name])
        times.append(perf_counter() - start)
    return min(times)


def _page_time(made: Plan) -> float:
    figure_page("twelve", specs_of(made))
    start = perf_counter()
    figure_page("twelve", specs_of(made))
    return perf_counter() - start


if __name__ == "__main__":
    print_figures(figures(main()))
