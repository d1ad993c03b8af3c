"""Sweeps: one key of a scenario varied, each value planned and validated by the same trials."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions, options_with
from syncplan.orbits.circles import position
from syncplan.orbits.graphs import bottleneck
from syncplan.phrases import listed
from syncplan.planning.filter_choice import asked_filter
from syncplan.planning.judged_plan import Plan
from syncplan.planning.planner import plan
from syncplan.planning.swept_keys import SWEPT_KEYS, swept_key
from syncplan.planning.validation import Validation, validate
from syncplan.results import Result
from syncplan.scenario.specification import Scenario


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
    """Return a row for each value of the key `name`; see syncplan.planning.swept_keys.

    `name` is that of any number of a scenario, such as sensor.range_sigma_m; range, angular_rate,
    radius and spacing are short for theirs. Of a list, the number is set for all vehicles.

    `options`, or changes of it by name, are those of syncplan.validate: trials=200, seed=0,
    duration=None (s, the scenario's) and the rest. `connected` adds a last row: the last value
    again, with the sensor's range raised until the team is connected at every instant. All values
    are planned before the first is validated, so that a bad value costs nothing. `progress` is
    called with the number of trials done in all.
    """
    chosen = options_with(options, changes)
    rows = planned_rows(scenario, name, values, connected=connected)
    return validated(name, rows, chosen, threads=threads, progress=progress)


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
        last = rows[-1]
        reach = connected_range(last.plan)
        wider = plan(SWEPT_KEYS["range"].varied(last.plan.scenario, reach), pilot=False)
        label = f"connected, {last.label} at range {reach:.4g} m"
        rows.append(PlannedRow(label, last.value, wider))
    return rows


def validated(
    name: str,
    rows: Iterable[PlannedRow],
    options: FilterOptions,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Sweep:
    """Return the sweep of the key `name` whose planned rows are validated, each in turn."""
    found: list[ValidatedRow] = []
    for one in rows:
        done = _shifted(progress, len(found) * options.trials)
        own = options_of_row(one.plan, options)
        validation = validate(one.plan, own, threads=threads, progress=done)
        found.append(ValidatedRow(one.label, one.value, validation))
    return Sweep(name, found)


def options_of_row(flown: Plan, options: FilterOptions) -> FilterOptions:
    """Return the options with the filter that validates a row of a sweep.

    It is the one asked for by options or scenario, or ekf: rows are compared, so all have the same.
    """
    asked = asked_filter(flown.scenario, options)
    return replace(options, filter="ekf") if asked is None else asked.applied(options)


_INSTANTS = 720
_RANGE_MARGIN = 1.01


def connected_range(subject: Plan) -> float:
    """Return a range in m at which all vehicles and landmarks are connected at every instant.

    The longest edge of the shortest spanning tree, the largest over a period, one per cent added
    for what lies between the instants looked at. Fields of view are not considered.
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


def _shifted(progress: Callable[[int], None] | None, done: int) -> Callable[[int], None] | None:
    if progress is None:
        return None
    report = progress
    return lambda trials: report(done + trials)
