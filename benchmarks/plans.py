"""How long plans and quick previews take in one process, and their costly parts, again and again.

Processor time of the paper's grid of six vehicles, of grids of 12, 24 and 50, in one warm process:
the plan with its file's text, the posterior bound with its start-up index, the connectivity period,
single points of failure, a preview and a quick one with the map. With `--base PATH`, another
checkout does the same in turn, A B A B, so that a busy machine is as busy for both; figures are
then medians of the ratios, and parts that differ in a byte are named.

    python benchmarks/plans.py
    python benchmarks/plans.py --base ../before
"""

import argparse
import gc
import hashlib
import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.grids import GRIDS, grid_scenario
from benchmarks.sides import Side, answer, served_side

ROOT = Path(__file__).resolve().parents[1]

# the library of the side that is measured: this checkout's, unless another is named
sys.path.insert(0, str(served_side() or ROOT))

REPEATS = {6: 21, 12: 11, 24: 7, 50: 3}

PARTS = {
    "plan": "plan and its text",
    "bound": "posterior bound and start-up index",
    "connectivity": "connectivity period",
    "losses": "search for single points of failure",
    "preview": "preview with the map",
    "quick": "quick preview with the map",
}
"""What is timed, with its label."""

SHARE_TARGET = 0.5
"""Of a whole preview's time that a quick one may take."""


# --- one side, in a process of its own ----------------------------------------------------------


def _scenario(count: int) -> dict[str, Any]:
    return {
        **grid_scenario(count),
        "name": f"grid-{count}",
        "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
        "initial_sigma": {"position_m": 5.0, "heading_rad": 0.1},
    }


def _works(count: int) -> dict[str, Callable[[], Any]]:
    """What is timed, by the names of PARTS; each returns what can be compared, or None."""
    from api.computing.tasks import previewed
    from api.documents import as_plan_text
    from api.limits import RequestLimits
    from syncplan.estimation.bounds import posterior_bound
    from syncplan.observability.loss_ranks import decisive_losses
    from syncplan.observability.rank import assess_team
    from syncplan.observability.sliding_windows import connectivity_period
    from syncplan.orbits.sightings import single_losses
    from syncplan.planning.planner import plan
    from syncplan.plotting.figure_style import PLAIN
    from syncplan.runtime.machine import single_threaded_blas
    from syncplan.scenario.loading import scenario_from

    scenario = scenario_from(_scenario(count))
    made = plan(scenario)
    assessed = assess_team(made.team, made.scenario.window)
    body = json.dumps(_scenario(count)).encode()
    limits = RequestLimits(*[10**9] * len(fields(RequestLimits)))

    def bound() -> str:
        found = posterior_bound(made.team, made.windows, scenario.duration_s, start_up=True)
        return repr((found.rms_second_half().tolist(), found.start_up))

    def losses() -> str:
        found = decisive_losses(assessed, single_losses(made.team))
        return repr([(one.vehicles, one.sensors, one.landmarks) for one in found])

    def preview(quick: bool) -> None:
        previewed(body, "json", limits, quick, ["formation"], PLAIN)

    return {
        "plan": lambda: as_plan_text(plan(scenario)).text,
        "bound": single_threaded_blas(bound),
        "connectivity": single_threaded_blas(lambda: repr(connectivity_period(assessed))),
        "losses": single_threaded_blas(losses),
        "preview": lambda: preview(False),
        "quick": lambda: preview(True),
    }


WORKS: dict[int, dict[str, Callable[[], Any]]] = {}


def timed(request: str) -> tuple[float, str]:
    """Return s and a digest of what a request names, "COUNT PART"."""
    count, part = request.split()
    if int(count) not in WORKS:
        WORKS[int(count)] = _works(int(count))
    work = WORKS[int(count)][part]
    gc.collect()
    began = time.process_time()
    made = work()
    seconds = time.process_time() - began
    return seconds, hashlib.sha256(str(made).encode()).hexdigest()


# --- both sides ---------------------------------------------------------------------------------


def main(base: Path | None = None) -> dict[str, float]:
    """Return the least s of each part by "COUNT PART", and "COUNT PART ratio" to the base's.

    "COUNT PART differs" is 1 where the two sides differ in a byte.
    """
    own, other = Side(__file__, ROOT), None if base is None else Side(__file__, base)
    found: dict[str, float] = {}
    for count in GRIDS:
        for part in PARTS:
            pairs, name = [], f"{count} {part}"
            for repeat in range(REPEATS[count] + 1):
                seconds, digest = own.run(name)
                before, expected = (seconds, digest) if other is None else other.run(name)
                found[f"{name} differs"] = float(digest != expected)
                if repeat:
                    pairs.append((seconds, before))
            found[name] = min(seconds for seconds, _ in pairs)
            if other is not None:
                found[f"{name} base"] = min(before for _, before in pairs)
                found[f"{name} ratio"] = statistics.median(b / seconds for seconds, b in pairs)
    for side in (own, other):
        if side is not None:
            side.end()
    return found


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table: times, the share of a quick preview, ratios to the base."""
    rows = []
    for count in GRIDS:
        for part, label in PARTS.items():
            name = f"{count} {part}"
            rows.append(Figure(f"{label}, {count} vehicles", result[name], "s"))
            if f"{name} ratio" in result:
                rows.append(Figure("  of the base", result[f"{name} base"], "s"))
                rows.append(Figure("  times as fast", result[f"{name} ratio"], "x"))
            if result[f"{name} differs"]:
                rows.append(Figure("  differs from the base in a byte", 1.0, ""))
        share = 100.0 * result[f"{count} quick"] / result[f"{count} preview"]
        what = f"quick preview beside a whole one, {count} vehicles"
        rows.append(Figure(what, share, "%", 100.0 * SHARE_TARGET))
    return rows


if __name__ == "__main__":
    if served_side():
        answer(timed)
    else:
        parser = argparse.ArgumentParser(description=__doc__)
        parser.add_argument("--base", type=Path, help="another checkout to compare with")
        print_figures(figures(main(parser.parse_args().base)))
