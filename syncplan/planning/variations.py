"""Sweeps of one key, and stress tests in worlds that are worse than the scenario states."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from syncplan.errors import InputError
from syncplan.estimation.divided_runs import results_of
from syncplan.estimation.filter_options import FilterOptions, options_with
from syncplan.options import lists_options
from syncplan.orbits.circles import position
from syncplan.orbits.graphs import bottleneck
from syncplan.phrases import listed
from syncplan.planning.filter_choice import asked_filter, choose_filter
from syncplan.planning.judged_team import MOST_NAMED, PlanFinding, PlanVerdict, Remark
from syncplan.planning.plan_files import PlanSubject, in_world, planned
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.planning.validation import TrialRun, Validation, trial_run
from syncplan.results.result import Result
from syncplan.scenario.dotted_keys import IN_TRUTH, SWEPT_KEYS, numeric_keys, swept_key
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import keys_over

# --- sweeps ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PlannedRow:
    """One value of a sweep, planned and not yet validated."""

    label: str
    value: float
    plan: Plan


@dataclass(frozen=True, slots=True)
class ValidatedRow:
    """One value of a sweep: its label, plan and validation."""

    label: str
    value: float
    validation: Validation


class Sweep(Result, list[ValidatedRow]):
    """The rows of a sweep, in the order of its values; `name` is the key that was varied."""

    def __init__(self, name: str, rows: Iterable[ValidatedRow]) -> None:
        super().__init__(rows)
        self.name = name

    def __repr__(self) -> str:
        """Return one line: the key and its values."""
        labels = listed([row.label for row in self], 8)
        return f"<{type(self).__name__} of {self.name}: {labels}>"


@lists_options(FilterOptions)
def sweep(
    scenario: Scenario,
    name: str,
    values: Sequence[float],
    options: FilterOptions | None = None,
    *,
    connected: bool = False,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> Sweep:
    """Return a row for each value of the key `name`; see syncplan.scenario.dotted_keys.

    `name` is the key of any number in a scenario, such as sensor.range_sigma_m; range,
    angular_rate, radius and spacing are short names. In a list, the number is set for all vehicles.

    `options`, or changes of it by name, are those of syncplan.validate: trials=200, seed=0,
    duration=None (s, the scenario's) and the rest. `connected` adds a last row: the first value
    again, with the sensor's range raised until the team is connected at every instant. All values
    are planned before the first is validated, so that a bad value costs nothing. `progress` is
    called with the number of trials done in all.
    """
    chosen = options_with(options, changes)
    rows = planned_rows(scenario, name, values, connected=connected)
    runs = (trial_run(row.plan, options_of_row(row.plan, chosen)) for row in rows)
    return swept(name, rows, results_of(runs, threads=threads, progress=progress))


def planned_rows(
    scenario: Scenario, name: str, values: Sequence[float], *, connected: bool = False
) -> list[PlannedRow]:
    """Return the plans of a sweep, none of them validated; see sweep."""
    key = swept_key(name)
    if not values:
        raise InputError("no values given; give a list such as 0.2,0.4", key=name)
    rows = [
        PlannedRow(f"{value:g}", value, plan(key.varied(scenario, value), pilot=False))
        for value in values
    ]
    if connected:
        first = rows[0]
        reach = connected_range(first.plan)
        wider = plan(SWEPT_KEYS["range"].varied(first.plan.scenario, reach), pilot=False)
        label = f"connected, {first.label} at range {reach:.4g} m"
        rows.append(PlannedRow(label, first.value, wider))
    return rows


def swept(name: str, rows: Iterable[PlannedRow], results: Iterable[Validation]) -> Sweep:
    """Return the sweep of the key `name` from the validations of its rows."""
    return Sweep(
        name,
        [
            ValidatedRow(row.label, row.value, validation)
            for row, validation in zip(rows, results, strict=True)
        ],
    )


def options_of_row(flown: Plan, options: FilterOptions) -> FilterOptions:
    """Return the options with the filter that validates a row of a sweep.

    It is the one that options or scenario ask for, else ekf: rows are compared, so all share it.
    """
    asked = asked_filter(flown.scenario, options)
    return replace(options, filter="ekf") if asked is None else asked.applied(options)


_INSTANTS = 720
_RANGE_MARGIN = 1.01


def connected_range(subject: Plan) -> float:
    """Return a range in m at which all vehicles and landmarks are connected at every instant.

    It is the longest edge of the shortest spanning tree, the largest over a period, with one per
    cent added for the time between the sampled instants. Fields of view are not considered.
    """
    times = np.arange(_INSTANTS) * subject.orbits.period / _INSTANTS
    longest = 0.0
    for places in position(subject.orbits, times):
        everything = np.concatenate([places, subject.landmarks])
        apart = np.hypot(*(everything[:, None] - everything[None]).T)
        # landmarks see nothing: each needs a vehicle in range, not another landmark
        apart[subject.orbits.count :, subject.orbits.count :] = np.inf
        longest = max(longest, bottleneck(apart))
    return float(_RANGE_MARGIN * longest)


# --- stress tests ---------------------------------------------------------------------------------
#
# Each sigma that the scenario states is doubled, one at a time and all together; one sighting in
# five is missed; one bearing in a hundred is false. Plan and filter stay the same and are unaware
# of the change. The cost of a wrong key is the ratio of the error found to that in the world as
# stated.


FACTOR, MISSED, FALSE = 2.0, 0.2, 0.01

MOST_HARM = 2.0 * 1.1
"""Largest harm in proportion: in a linear system, doubled sigmas double the error; plus 10 %."""

ALL_SIGMAS, MISSES, FALSE_BEARINGS = "all sigmas doubled", "20 % missed", "1 % false bearings"

_FURTHER = ("random_walk",)
"""Parts of the names of keys that are standard deviations without `sigma` in the name."""


@dataclass(frozen=True, slots=True)
class StressedRow:
    """Validation of a plan in one world of a stress test.

    Attributes
    ----------
    world : description of what is worse there
    validation : validation in that world
    harm : ratio of the RMS error of all vehicles, second half, to that in the world as stated
    """

    world: str
    validation: Validation
    harm: float

    @property
    def expected(self) -> float | None:
        """Expected RMS error of all vehicles, second half, in m; None if not computed."""
        each = self.validation.expected
        each = self.validation.predicted if each is None else each
        return None if each is None else float(np.sqrt(np.mean(each**2)))


@dataclass(frozen=True, slots=True)
class StressTest(Result):
    """Validations of a plan in the world as stated, and in worse ones, the most harmful first."""

    nominal: Validation
    rows: tuple[StressedRow, ...]

    @property
    def observable(self) -> bool:
        """Whether the plan is observable."""
        return self.nominal.observable

    @property
    def verdict(self) -> PlanVerdict:
        """The verdict in the world as stated."""
        return self.nominal.verdict

    @property
    def fragile(self) -> tuple[StressedRow, ...]:
        """Worlds that cost more than in proportion: over MOST_HARM times the error."""
        return tuple(row for row in self.rows if row.harm > MOST_HARM)

    @property
    def findings(self) -> tuple[PlanFinding, ...]:
        """Finding that some world costs more than in proportion; empty if none does."""
        if not self.fragile:
            return ()
        each = [f"{row.world}: {row.harm:.3g} times the error" for row in self.fragile]
        message = (
            f"stated values that are wrong cost over {MOST_HARM:g} times the error that they are "
            f"stated for: {listed(each, MOST_NAMED)}"
        )
        cure = "state sigmas as large as they may be, or estimate what is not"
        return (PlanFinding.of("not-robust", Remark("warning", message, cure=cure)),)


def doubled_sigmas(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """Return a world for each sigma that a scenario states, with that sigma doubled, by its key."""
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
    """Double the number at a path, or those in a list of sections; None if there is none."""
    if isinstance(value, list):
        each = [_doubled(one, path) for one in value]
        # a vehicle without the number keeps its values
        empty: Any = {} if path else None
        return [empty if one is None else one for one in each] if any(each) else None
    if path:
        inner = _doubled(value[path[0]], path[1:]) if path[0] in value else None
        return None if inner is None else {path[0]: inner}
    return FACTOR * value if value else None


def stress_worlds(scenario: Scenario) -> Mapping[str, dict[str, Any]]:
    """Return the truth of each world of a stress test, by the description of the world."""
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
    """Return the set-ups of a stress test by world; the first, as stated, has an empty name.

    All run the same filter. The truth stated by the options and the scenario holds in all.
    """
    chosen = options_with(options, changes)
    plan = planned(subject)
    chosen, flown = choose_filter(plan, chosen).applied(chosen), in_world(plan, chosen.truth)
    # the plan has the truth already, and what a world adds to it counts
    chosen = replace(chosen, truth=None)
    worlds = {"": {}, **stress_worlds(flown.scenario)}
    return {name: trial_run(in_world(flown, truth), chosen) for name, truth in worlds.items()}


def joined_worlds(worlds: Sequence[str], results: Sequence[Validation]) -> StressTest:
    """Return the stress test of validations in these worlds, the first as stated."""
    nominal, *others = results
    least = _late(nominal)
    rows = [
        StressedRow(world, one, _late(one) / least)
        for world, one in zip(worlds[1:], others, strict=True)
    ]
    return StressTest(nominal, tuple(sorted(rows, key=lambda row: row.harm, reverse=True)))


@lists_options(FilterOptions)
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
    return joined_worlds(list(runs), results_of(runs.values(), threads=threads, progress=progress))


def _late(one: Validation) -> float:
    return float(one.accuracy.overall().late_position)
