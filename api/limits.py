"""The most a request may ask for, so that no client can starve the others."""

from dataclasses import dataclass

from syncplan.errors import InputError
from syncplan.scenario.specification import Scenario

__all__ = ["RequestLimits", "check_at_most", "check_size", "check_trials"]

TRIALS_OF_VEHICLES = 10
"""A run may hold this many times as many trials of one vehicle as it may hold trials."""


@dataclass(frozen=True, slots=True)
class RequestLimits:
    """The most a request may ask for.

    Attributes
    ----------
    vehicles : of a team
    samples : in a run or a window
    trials : of a validation, or of all rows of a sweep together
    run_s : s, length of a run
    refine_s : s, time of a refinement
    sweep_values : rows of a sweep
    """

    vehicles: int
    samples: int
    trials: int
    run_s: float
    refine_s: float
    sweep_values: int


def check_at_most(key: str, value: float, limit: float, unit: str = "") -> None:
    """Raise InputError naming `key` if `value` is above what this service takes."""
    if value > limit:
        raise InputError(
            f"{value:g}{unit} asked for; this service takes up to {limit:g}{unit}", key=key
        )


def check_size(scenario: Scenario, limits: RequestLimits) -> None:
    """Raise InputError if planning a scenario is more than the service does in one request."""
    check_at_most("formation", scenario.size, limits.vehicles, " vehicles")
    for key, length in (("duration_s", scenario.duration_s), ("window_s", scenario.window)):
        check_at_most(key, length / scenario.sample_time, limits.samples, " samples")


def check_trials(trials: int, vehicles: int, limits: RequestLimits) -> None:
    """Raise InputError if a run holds more figures than the service keeps."""
    check_at_most("trials", trials, limits.trials, " trials")
    check_at_most(
        "trials", trials * vehicles, TRIALS_OF_VEHICLES * limits.trials, " trials times vehicles"
    )
