"""Stress: a plan in worlds each of which is worse in one way than its scenario states.

Each sigma that the scenario states is doubled, one at a time and all together; one sighting in five
is missed; one bearing in a hundred is false. Plan and filter are the same in all of them, and know
nothing of it. The found error over that of the world as stated is what a wrong key costs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from syncplan.estimation.filter_options import FilterOptions, options_with
from syncplan.phrases import listed
from syncplan.planning.filter_choice import choose_filter
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.subjects import PlanSubject, in_world, planned
from syncplan.planning.validation import TrialRun, Validation, conclude, run_part, trial_run
from syncplan.scenario.dotted_keys import IN_TRUTH, numeric_keys
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import keys_over

FACTOR, MISSED, FALSE = 2.0, 0.2, 0.01

MOST_HARM = 2.0 * 1.1
"""Where all is linear, all sigmas doubled double the error; some more counts as no more."""

ALL_SIGMAS, MISSES, FALSE_BEARINGS = "all sigmas doubled", "20 % missed", "1 % false bearings"

_FURTHER = ("random_walk",)
"""In names of keys that are standard deviations but do not say so."""


@dataclass(frozen=True, slots=True)
class StressedRow:
    """What one world did to the filter of a plan.

    Attributes
    ----------
    world : what is worse there, in words
    validation : in that world
    harm : RMS error of all vehicles, second half, over that of the world as stated
    """

    world: str
    validation: Validation
    harm: float

    @property
    def expected(self) -> float | None:
        """RMS error of all vehicles to be expected, second half, in m; None if not computed."""
        each = self.validation.expected
        each = self.validation.predicted if each is None else each
        return None if each is None else float(np.sqrt(np.mean(each**2)))


@dataclass(frozen=True, slots=True)
class StressTest:
    """A plan in the world as stated, and in worse ones, the most harmful first."""

    nominal: Validation
    rows: tuple[StressedRow, ...]

    @property
    def fragile(self) -> tuple[StressedRow, ...]:
        """The worlds that cost more than in proportion: over MOST_HARM times the error."""
        return tuple(row for row in self.rows if row.harm > MOST_HARM)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The finding that some world costs more than in proportion; none where none does."""
        if not self.fragile:
            return ()
        each = [f"{row.world}: {row.harm:.3g} times the error" for row in self.fragile]
        message = (
            f"stated values that are wrong cost over {MOST_HARM:g} times the error that they are "
            f"stated for: {listed(each, MOST_NAMED)}"
        )
        cure = Cure("state sigmas as large as they may be, or estimate what is not")
        return (Finding("not-robust", "warning", message, cure=cure),)


def doubled_sigmas(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """Return worlds in each of which one sigma that a scenario states is doubled, by its key."""
    found, document = {}, scenario.model_dump(exclude_none=True)
    for key in numeric_keys():
        own = key.removeprefix(IN_TRUTH)
        deviates = "sigma" in own or any(one in own for one in _FURTHER)
        if key == own or not deviates:
            continue
        truth = _doubled(document, own.split("."))
        if truth is not None:
            found[own] = truth
    return found


def _doubled(value: Any, path: list[str]) -> Any:
    """The number at a path doubled, or those of a list of sections; None where there is none."""
    if isinstance(value, list):
        each = [_doubled(one, path) for one in value]
        # a vehicle that has none keeps what it has
        empty: Any = {} if path else None
        return [empty if one is None else one for one in each] if any(each) else None
    if path:
        inner = _doubled(value[path[0]], path[1:]) if path[0] in value else None
        return None if inner is None else {path[0]: inner}
    return FACTOR * value if value else None


def stress_worlds(scenario: Scenario) -> Mapping[str, dict[str, Any]]:
    """Return the truth of each world of a stress test, by what is worse there."""
    scenario = scenario.in_truth
    each = doubled_sigmas(scenario)
    together: dict[str, Any] = {}
    for truth in each.values():
        together = keys_over(together, truth)
    least = min(one.detection_probability or 1.0 for one in scenario.sensors)
    return MappingProxyType(
        {
            **{f"{key} doubled": truth for key, truth in each.items()},
            ALL_SIGMAS: together,
            MISSES: {"sensor": {"detection_probability": (1.0 - MISSED) * least}},
            FALSE_BEARINGS: {"false_bearings": FALSE},
        }
    )


def stress_runs(
    subject: PlanSubject, options: FilterOptions | None = None, **changes: Any
) -> dict[str, TrialRun]:
    """Return the set-ups of a stress test by world, that as stated first, under an empty name.

    All run the same filter. What the options or the scenario say of the truth holds in all.
    """
    chosen = options_with(options, changes)
    flown = in_world(planned(subject, pilot=False), chosen.truth)
    chosen = choose_filter(flown, chosen).applied(chosen)
    worlds = {"": {}, **stress_worlds(flown.scenario)}
    return {name: trial_run(in_world(flown, truth), chosen) for name, truth in worlds.items()}


def joined_worlds(worlds: Sequence[str], results: Sequence[Validation]) -> StressTest:
    """Return the stress test of validations in these worlds, the first that as stated."""
    nominal, *others = results
    least = _late(nominal)
    rows = [
        StressedRow(world, one, _late(one) / least)
        for world, one in zip(worlds[1:], others, strict=True)
    ]
    return StressTest(nominal, tuple(sorted(rows, key=lambda row: row.harm, reverse=True)))


def stressed(
    subject: PlanSubject,
    options: FilterOptions | None = None,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> StressTest:
    """Return a plan's validations in worlds that are worse than its scenario states.

    Options are those of syncplan.validate. The same seed gives the same draws in all worlds.
    `progress` is called with the number of trials done in all.
    """
    runs = stress_runs(subject, options, **changes)
    found: list[Validation] = []
    for run in runs.values():
        before = len(found) * run.trials
        done = None if progress is None else _later(progress, before)
        found.append(conclude(run, [run_part(run, 0, run.trials, threads=threads, progress=done)]))
    return joined_worlds(list(runs), found)


def _later(progress: Callable[[int], None], before: int) -> Callable[[int], None]:
    return lambda trials: progress(before + trials)


def _late(one: Validation) -> float:
    return float(one.accuracy.overall().late_position)
