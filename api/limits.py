"""Limits on requests, so that no client can starve the others."""

from dataclasses import dataclass

from syncplan.errors import InputError
from syncplan.guidance.flight_options import GuidanceModel
from syncplan.planning.expected_work import ExpectedWork, work_of
from syncplan.scenario.specification import Scenario

_REMEDY = "use a shorter range_m, a longer sample_time_s, a shorter run or fewer vehicles"
MOST_PAIRS = 50_000
"""Most pairs of an observer and a target in range: each takes a plan 2 to 4 kB and about 0.2 ms."""

MOST_BOUND_WORK = 5e10
"""Most work of a plan's bound: a core does 0.3e9 to 4e9 a second, and a request has 20 s."""
MOST_TRIAL_WORK = 2e11
"""Most work of a trial: a job first times 17 of them, in one part, which may take an hour."""

FLIGHT_TIMES = 8.0
"""Work of a flight relative to a trial of the filter along the same circles."""

TRIALS_OF_VEHICLES = 10
"""Most trials times vehicles in a run, relative to the most trials."""

FIGURES_OF_VEHICLE = 18
"""Figures kept of each vehicle of a flight, in addition to one of each pair."""


@dataclass(frozen=True, slots=True)
class RequestLimits:
    """Upper limits on a request.

    Attributes
    ----------
    vehicles : vehicles of a team
    samples : samples in a run or a window
    trials : trials of a validation or flight, or of all rows of a sweep together
    run_s : s, length of a run
    refine_s : s, time of a refinement
    sweep_values : rows of a sweep
    design_evaluations : candidates that the searches of all teams of a design look at
    sightings : sightings in all samples of a run, as expected from circles and ranges
    """

    vehicles: int
    samples: int
    trials: int
    run_s: float
    refine_s: float
    sweep_values: int
    design_evaluations: int
    sightings: int


def check_at_most(key: str, value: float, limit: float, unit: str = "") -> None:
    """Raise InputError naming `key` if `value` exceeds `limit`."""
    if value > limit:
        raise InputError(
            f"{value:g}{unit} asked for; this service takes up to {limit:g}{unit}", key=key
        )


def check_size(scenario: Scenario, limits: RequestLimits) -> None:
    """Raise InputError if a scenario is too large to be planned in one request."""
    check_at_most("formation", scenario.size, limits.vehicles, " vehicles")
    for key, length in (("duration_s", scenario.duration_s), ("window_s", scenario.stated_window)):
        check_at_most(key, length / scenario.sample_time, limits.samples, " samples")
    work = work_of(scenario)
    if work is None:
        return
    # a narrow view is sampled for each pair: they are counted before
    if work.pairs > MOST_PAIRS:
        raise InputError(
            f"{work.pairs} pairs of an observer and a target may come within range; this service "
            f"takes up to {MOST_PAIRS}; use a shorter range_m, fewer landmarks or fewer vehicles",
            key="sensor",
        )
    # without the bound, planning looks at no samples
    if work.bounded:
        _check_work(scenario, work, MOST_BOUND_WORK, limits)


def check_run_work(scenario: Scenario, duration: float, limits: RequestLimits) -> None:
    """Raise InputError if a trial of the filter over `duration` s is too much for a task."""
    work = work_of(scenario, duration)
    if work is not None:
        _check_work(scenario, work, MOST_TRIAL_WORK, limits)


def check_flights(
    trials: int,
    scenario: Scenario,
    duration: float,
    guidance: GuidanceModel,
    limits: RequestLimits,
) -> None:
    """Raise InputError if flights of `duration` s are too many, or one is too much for a task."""
    check_trials(trials, scenario.size, limits)
    work = work_of(scenario, duration)
    if work is None:
        return
    figures = trials * (FIGURES_OF_VEHICLE * scenario.size + work.pairs)
    most = FIGURES_OF_VEHICLE * TRIALS_OF_VEHICLES * limits.trials
    check_at_most("trials", figures, most, " figures of trials")
    flown = FLIGHT_TIMES * work.pass_work + guidance.work_per_s * scenario.size * duration
    if flown > MOST_TRIAL_WORK:
        raise InputError(
            f"a flight of {duration:g} s takes about {flown:.2g} operations; this service takes "
            f"up to {MOST_TRIAL_WORK:.2g}; fly a shorter time, or choose a guidance that takes "
            "less",
            key="duration_s",
        )


def check_replay_work(sightings: int, robots: int, limits: RequestLimits) -> None:
    """Raise InputError if a recording is too large for a task to filter."""
    for figure, limit, what in (
        (sightings, limits.sightings, "sightings"),
        (
            sightings * (3 * robots) ** 2,
            MOST_TRIAL_WORK,
            "sightings times squared size of the state",
        ),
    ):
        if figure > limit:
            raise InputError(
                f"about {figure:.2g} {what}; this service takes up to {limit:.2g}; send a part of "
                "the recording",
                key="recording_id",
            )


def _check_work(scenario: Scenario, work: ExpectedWork, most: float, limits: RequestLimits) -> None:
    if work.sightings > limits.sightings:
        raise InputError(
            f"about {work.sightings:.2g} sightings expected of {scenario.size} vehicles; this "
            f"service takes up to {limits.sightings:.2g} in a run; {_REMEDY}",
            key="sensor",
        )
    if work.pass_work > most:
        raise InputError(
            f"about {work.sightings:.2g} sightings expected, whose filter takes "
            f"{work.pass_work:.2g} operations, sightings times squared size of the state; this "
            f"service takes up to {most:.2g}; {_REMEDY}",
            key="sensor",
        )


def check_trials(trials: int, vehicles: int, limits: RequestLimits) -> None:
    """Raise InputError if a run has too many trials, or trials times vehicles."""
    check_at_most("trials", trials, limits.trials, " trials")
    check_at_most(
        "trials", trials * vehicles, TRIALS_OF_VEHICLES * limits.trials, " trials times vehicles"
    )
