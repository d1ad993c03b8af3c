"""The verdict in words and as exit status: of a plan that is not as it has to be."""

from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.console import say

if TYPE_CHECKING:
    from syncplan.planning.judged_team import PlanVerdict
    from syncplan.planning.planner import Plan
    from syncplan.planning.variations import StressTest

NOT_MET = 3

RequireObservable = Annotated[
    bool, typer.Option("--require-observable", help="Exit with 3 if the plan is not observable")
]


RequireGo = Annotated[
    bool, typer.Option("--require-go", help="Exit with 3 if a finding stops the flight")
]


RequireRobust = Annotated[
    bool,
    typer.Option(
        "--require-robust",
        help="Exit with 3 if in some world of --stress the error is over 2.2 times that as stated",
    ),
]


def robust_status(test: "StressTest") -> int:
    """Return the exit status of a plan that is to be robust: 3 if it is not."""
    for one in test.findings:
        say(f"{one.message} (--require-robust)")
    return NOT_MET if test.findings else 0


def verdict_status(plan: "Plan", *, observable: bool, go: bool) -> int:
    """Return the exit status of a plan: 3 if it is to be observable, or a go, and is not."""
    status = 0
    if observable and not plan.observable:
        say("the plan is not observable (--require-observable)")
        status = NOT_MET
    if go and not plan.verdict.go:
        say(f"{_in_one_line(plan.verdict)} (--require-go)")
        status = NOT_MET
    return status


def say_verdict(verdict: "PlanVerdict", which: str = "") -> None:
    """Write which plan it is, and GO or NO-GO with the codes of its reasons, to standard error."""
    say(f"{which}: {_in_one_line(verdict)}" if which else _in_one_line(verdict))


def _in_one_line(verdict: "PlanVerdict") -> str:
    codes = ", ".join(dict.fromkeys(one.code for one in verdict.stops))
    return f"{verdict.headline}: {codes}" if codes else verdict.headline
