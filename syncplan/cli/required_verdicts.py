"""Options that make a verdict count: the exit status of a plan that is not as it has to be."""

from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.console import say

if TYPE_CHECKING:
    from syncplan.planning.judged_plan import Plan

__all__ = ["RequireGo", "RequireObservable", "verdict_status"]

NOT_MET = 3

RequireObservable = Annotated[
    bool, typer.Option("--require-observable", help="Exit with 3 if the plan is not observable")
]


RequireGo = Annotated[
    bool, typer.Option("--require-go", help="Exit with 3 if a finding stops the flight")
]


def verdict_status(plan: "Plan", *, observable: bool, go: bool) -> int:
    """Return the exit status of a plan: 3 if it is to be observable, or a go, and is not."""
    status = 0
    if observable and not plan.observable:
        say("the plan is not observable (--require-observable)")
        status = NOT_MET
    if go and not plan.verdict.go:
        codes = ", ".join(dict.fromkeys(one.code for one in plan.verdict.stops))
        say(f"{plan.verdict.headline}: {codes} (--require-go)")
        status = NOT_MET
    return status
