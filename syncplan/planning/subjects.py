"""What a function takes as a plan: a plan, or whatever a plan can be made of."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from syncplan.errors import InputError
from syncplan.planning.judged_plan import Plan
from syncplan.planning.judgement import BoundChoice
from syncplan.planning.plan_files import Loaded, load, loaded_from, plan_of
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import with_truth

PlanSubject = Plan | Scenario | str | Path | Mapping[str, Any]
"""A plan; a scenario, which is planned; or a file or a mapping that holds one or the other."""


def planned(subject: PlanSubject, *, bound: BoundChoice = "auto", pilot: bool = True) -> Plan:
    """Return a plan as it is, and the plan of anything else.

    `bound` and `pilot` are those of syncplan.plan. Raises InputError for a file or mapping that
    holds neither a plan nor a scenario.
    """
    if isinstance(subject, Plan):
        return subject
    if isinstance(subject, Scenario):
        return plan_of(Loaded(subject, None), bound=bound, pilot=pilot)
    if isinstance(subject, str | Path):
        return plan_of(load(subject), bound=bound, pilot=pilot)
    if isinstance(subject, Mapping):
        return plan_of(loaded_from(subject), bound=bound, pilot=pilot)
    raise InputError(
        f"is a {type(subject).__name__}; give a Plan, a Scenario, the path of a file or a mapping",
        key="subject",
    )


def in_world(plan: Plan, truth: Mapping[str, Any] | None) -> Plan:
    """Return a plan in a simulated world with these keys too, beside its scenario's truth.

    Raises InputError naming the key at fault.
    """
    if not truth:
        return plan
    return replace(plan, scenario=with_truth(plan.scenario, truth))


def load_plan(
    path: str | Path,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    max_vehicles: int = MAX_VEHICLES,
) -> Plan:
    """Return the plan of a file that `Plan.save` or `syncplan plan -o` wrote; "-" reads input.

    Its orbits are taken as they stand and judged afresh. `bound` and `steady` are those of
    syncplan.plan. Raises InputError naming the file, the key, its value and what is allowed, and
    for a scenario, which syncplan.load_scenario reads.
    """
    loaded = load(path, max_vehicles=max_vehicles)
    if loaded.orbits is None:
        raise InputError(
            "is a scenario, not a plan; syncplan.plan makes one of it", source=str(path)
        )
    return plan_of(loaded, bound=bound, steady=steady)
