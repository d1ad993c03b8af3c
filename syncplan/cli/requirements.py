"""Verdicts that commands can require, and the exit status of a result that misses one."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from inspect import Parameter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syncplan.cli.arguments import replacing
from syncplan.cli.console import say

if TYPE_CHECKING:
    from syncplan.planning.judged_team import PlanVerdict

NOT_MET = 3


@dataclass(frozen=True, slots=True)
class Requirement:
    """Verdict that a command can require of its result.

    Attributes
    ----------
    sentence : help of its option
    unmet : function that returns messages on how a result misses it, a plan or one of a study
    """

    sentence: str
    unmet: Callable[[Any], list[str]]


REQUIREMENTS: Mapping[str, Requirement] = {
    "observable": Requirement(
        "Exit with 3 if the plan is not observable",
        lambda result: [] if result.observable else ["the plan is not observable"],
    ),
    "go": Requirement(
        "Exit with 3 if a finding stops the flight",
        lambda result: [] if result.verdict.go else [_in_one_line(result.verdict)],
    ),
    "flown": Requirement(
        "Exit with 3 unless flights bear out a GO",
        lambda result: (
            [] if result.verdict.go and result.verdict.flown else [_in_one_line(result.verdict)]
        ),
    ),
    "robust": Requirement(
        "Exit with 3 if the error in some world of --stress is over 2.2 times the error in "
        "the world as stated",
        lambda result: [finding.message for finding in result.findings],
    ),
}
"""Requirements by name."""


def takes_requirements(*names: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that adds an option for each requirement; the command has `required`."""
    options = {f"require_{name}": name for name in names}
    parameters = [
        Parameter(
            option,
            Parameter.KEYWORD_ONLY,
            default=False,
            annotation=Annotated[
                bool, typer.Option(f"--require-{name}", help=REQUIREMENTS[name].sentence)
            ],
        )
        for option, name in options.items()
    ]
    return replacing(
        "required",
        parameters,
        lambda values: tuple(options[option] for option, given in values.items() if given),
    )


def status_of(result: Any, required: Iterable[str]) -> int:
    """Return the exit status of a result: 3 if it misses a requirement, which a message says."""
    status = 0
    for name in required:
        for message in REQUIREMENTS[name].unmet(result):
            say(f"{message} (--require-{name})")
            status = NOT_MET
    return status


def say_verdict(verdict: "PlanVerdict", which: str = "") -> None:
    """Write GO or NO-GO and the codes of its reasons, after `which`, to standard error."""
    say(f"{which}: {_in_one_line(verdict)}" if which else _in_one_line(verdict))


def _in_one_line(verdict: "PlanVerdict") -> str:
    codes = ", ".join(dict.fromkeys(stop.code for stop in verdict.stops))
    return f"{verdict.headline}: {codes}" if codes else verdict.headline
