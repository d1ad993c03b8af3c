"""Planner and judge: the plan of a scenario, or of given orbits.

The judge takes nothing over from the source of the orbits: the exact code computes every verdict
afresh. Only this module sees the whole chain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypedDict

import numpy as np

from syncplan.arrays import Index, as_pairs
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import (
    posterior_bound,
    steady_bound,
    window_bound,
)
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.estimation.start_up_index import StartUpIndex
from syncplan.observability.error_modes import judge_errors
from syncplan.observability.link_verdicts import landmark_verdicts, vehicle_verdicts
from syncplan.observability.loss_ranks import decisive_losses
from syncplan.observability.rank import Assessment, assess_team
from syncplan.observability.sliding_windows import connectivity_period
from syncplan.observability.unobservable_modes import UnobservableMode, name_modes
from syncplan.orbits import contacts
from syncplan.orbits.circles import Orbits
from syncplan.orbits.sightings import Loss, single_losses
from syncplan.orbits.team import Team, team_of
from syncplan.planning import judged_team
from syncplan.planning.pilot_options import PilotOptions
from syncplan.planning.plans import Plan
from syncplan.planning.rule_orbits import listed_pairs, rule_orbits
from syncplan.planning.weakness import is_weak, least_desync, windows_of
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.loading import scenario_of
from syncplan.scenario.specification import Scenario, per_vehicle
from syncplan.synchronisation.contact_tables import contact_of_pairs
from syncplan.synchronisation.phases import Synchronisation

# --- the judge ------------------------------------------------------------------------------------


BoundChoice = Literal["auto", "always", "never"]


Pilot = PilotOptions | bool
"""Whether a plan is flown before its verdict, and how."""


class JudgementOptions(TypedDict, total=False):
    """Options of syncplan.plan that also apply to given orbits."""

    bound: BoundChoice
    steady: bool
    single_points: bool
    connectivity: bool


LARGEST_SEARCHED = 200
"""Number of vehicles up to which every plan states its single points of failure."""

LARGEST_DESYNCHRONISED = 40
"""Number of vehicles up to which a plan states the desynchronisation that cures it."""

MOST_STATES = 100_000
"""Number of pose coordinates and errors up to which every plan states the undetermined errors."""

MOST_STATES_LEFT = 400
"""The same limit after a loss, as losses are many: 60 vehicles with errors of every kind."""


@single_threaded_blas
def judge(
    scenario: Scenario,
    orbits: Orbits,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    single_points: bool = True,
    connectivity: bool = True,
    given: Index | None = None,
    found: Synchronisation | None = None,
) -> Plan:
    """Return the plan of given orbits on paper; nothing is taken over from their source.

    The options before `given` are those of syncplan.plan. `given` holds the (e, 2) links that the
    phases were found for, by default those that the scenario lists or its circles allow. `found` is
    the synchronisation that found the phases, with the reasons for the links it dropped.
    """
    resolved = scenario.resolved()
    team = team_of(resolved, orbits)
    assessed = assess_team(team, resolved.window)
    pairs = listed_pairs(resolved, team) if given is None else given
    along, note = _bound_along(assessed, resolved.duration_s, bound)
    return judged(
        assessed,
        resolved,
        pairs,
        _predict(assessed, resolved, steady, along, note),
        start_up=None if along is None else along.start_up,
        found=found,
        single_points=single_points,
        connectivity=connectivity,
    )


def judged(
    assessed: Assessment,
    scenario: Scenario,
    pairs: Index,
    prediction: judged_team.Prediction,
    *,
    start_up: StartUpIndex | None = None,
    found: Synchronisation | None = None,
    remainder: bool = False,
    single_points: bool = True,
    connectivity: bool = True,
) -> Plan:
    """Return the plan of an assessed team from its resolved scenario, links and prediction.

    `remainder`, for a team after a loss, leaves out further losses. Without `single_points`, losses
    that end observability are not searched for, as in teams that are too large; without
    `connectivity`, the connectivity period is left out, and with it the search for a longer run.
    """
    team, orbits = assessed.team, assessed.team.orbits
    names = scenario.vehicle_names
    listed = [(a, b) for a, b in pairs.tolist()]
    met = contacts.met_pairs(team, assessed.windows)
    kept = [pair for pair in listed if pair in met]
    unlisted = sorted(met - set(listed))
    modes = tuple(name_modes(assessed, names, scenario.landmark_names))
    return Plan(
        scenario=scenario,
        team=team,
        windows=assessed.windows,
        synchronisation=None,
        alternating_proven=None,
        links=tuple(vehicle_verdicts(assessed, as_pairs(kept))),
        incidental_links=tuple(vehicle_verdicts(assessed, as_pairs(unlisted))),
        landmark_links=tuple(landmark_verdicts(assessed)),
        dropped_links=tuple(_unmet(team, listed, met, found)),
        connectivity_period=connectivity_period(assessed, scenario.duration_s)
        if connectivity
        else None,
        sufficient_run=_sufficient_run(assessed, scenario) if connectivity else None,
        sufficient_desync=_sufficient_desync(assessed, scenario, modes, prediction)
        if connectivity and not remainder
        else None,
        approach=contacts.closest_approach(orbits),
        too_close=_too_close(orbits, judged_team.separation_limit(scenario)),
        observability=assessed.observability,
        certificate=assessed.certificate,
        unobservable=modes,
        prediction=prediction,
        error_verdict=judge_errors(assessed, names, MOST_STATES_LEFT if remainder else MOST_STATES),
        start_up=start_up,
        single_points=() if remainder else _single_points(assessed, sought=single_points),
    )


# --- links --------------------------------------------------------------------------------------


def _unmet(
    team: Team,
    listed: list[tuple[int, int]],
    met: set[tuple[int, int]],
    found: Synchronisation | None,
) -> list[judged_team.UnmetLink]:
    known = {item.link: item.reason for item in found.dropped} if found else {}
    return [
        judged_team.UnmetLink(a, b, known.get(k) or _why_never_in_contact(team, a, b))
        for k, (a, b) in enumerate(listed)
        if (a, b) not in met
    ]


def _why_never_in_contact(team: Team, a: int, b: int) -> str:
    from syncplan.synchronisation.sighted_phases import obstacles_blocking

    pair = team.only(np.array([a, b]))
    near = contacts.pairs_nearer_than(pair.orbits, np.inf)[0].distance
    reach = float(pair.sensors.ranges.max())
    if near > reach:
        return f"comes no nearer than {near:.4g} m with these phases, range {reach:.4g} m"
    both = np.array([[0, 1]])
    if blocking := obstacles_blocking(
        pair, lambda seeing: float(contact_of_pairs(seeing, both)[0])
    ):
        return f"comes within range, but sight is always blocked by {blocking} with these phases"
    return "comes within range, but never inside a field of view"


def _single_points(assessed: Assessment, *, sought: bool) -> tuple[Loss, ...] | None:
    if not assessed.observability.observable:
        return ()
    if not sought or assessed.team.count > LARGEST_SEARCHED:
        return None
    return tuple(decisive_losses(assessed, single_losses(assessed.team)))


def _sufficient_desync(
    assessed: Assessment,
    scenario: Scenario,
    modes: Sequence[UnobservableMode],
    prediction: judged_team.Prediction,
) -> float | None:
    """Least desynchronisation that cures a team of moderate size; None if it needs none."""
    if assessed.team.count > LARGEST_DESYNCHRONISED:
        return None
    lacking = any(mode.desync for mode in modes)
    weak = assessed.observability.observable and is_weak(
        assessed.observability, prediction.rms, windows_of(scenario)
    )
    return least_desync(scenario) if lacking or weak else None


def _sufficient_run(assessed: Assessment, scenario: Scenario) -> float | None:
    """Length in s of a run that makes the team observable, where this one is too short for it.

    None where it does not cut the window, or the whole window is not enough either. The length
    is the connectivity period or, without one, the window; the rank confirms it.
    """
    if assessed.observability.observable or not scenario.run_cuts_window:
        return None
    team, window = assessed.team, scenario.stated_window
    whole = assess_team(team, window)
    if not whole.observability.observable:
        return None
    period = connectivity_period(whole, window)
    if period is not None and assess_team(team, period).observability.observable:
        return period
    return window


def _too_close(orbits: Orbits, limit: judged_team.DistanceLimit) -> tuple[contacts.Approach, ...]:
    least = limit.least(orbits.radii)
    near = contacts.pairs_nearer_than(orbits, least)
    return tuple(item for item in near if item.distance < least * (1.0 - judged_team.TOLERANCE))


# --- predicted errors ---------------------------------------------------------------------------


def why_no_bound(team: Team, duration: float, bound: BoundChoice) -> str:
    """Return why the posterior bound is not computed; empty if it is."""
    if bound == "never":
        return "the posterior bound was not asked for"
    if bound == "auto" and not judged_team.bound_is_affordable(team, duration):
        return (
            f"the posterior bound of {team.count} vehicles over {duration:g} s is "
            "computed on request (--bound always)"
        )
    return ""


def _bound_along(
    assessed: Assessment, duration: float, bound: BoundChoice
) -> tuple[PosteriorBound | None, str]:
    """Posterior bound with its start-up index and what it supposes, or None and the reason."""
    team = assessed.team
    if why := why_no_bound(team, duration, bound):
        return None, why
    observable = assessed.observability.observable
    large = not judged_team.bound_is_affordable(team, duration)
    try:
        found = posterior_bound(team, assessed.windows, duration, start_up=observable, lumped=large)
    except NoSolutionError as error:
        return None, str(error)
    if not found.accuracy:
        return found, ""
    return found, (
        f"the errors of {team.count} vehicles are predicted from sightings lumped over up to "
        f"{found.longest_lump:.2g} s, to an estimated {100.0 * found.accuracy:.2g} %"
    )


def _predict(
    assessed: Assessment,
    scenario: Scenario,
    steady: bool,
    along: PosteriorBound | None,
    note: str,
) -> judged_team.Prediction:
    team = assessed.team
    window = window_bound(assessed.observability)
    limit = None
    if steady:
        limit = steady_bound(team, assessed.windows)
        if scenario.window >= team.orbits.period * (1.0 - 1e-9):
            limit = np.where(np.isnan(window), np.inf, limit)
    if along is None:
        return judged_team.Prediction(rms=None, steady=limit, window=window, note=note)
    return judged_team.Prediction(
        rms=along.rms_second_half(),
        steady=limit,
        window=window,
        note=note,
        states=judged_team.predicted_states(team, along, scenario.vehicle_names),
        neglect=judged_team.neglect_of(team, assessed.windows, scenario.duration_s)
        if not along.accuracy
        else None,
    )


# --- the planner ----------------------------------------------------------------------------------


@single_threaded_blas
def plan(
    scenario: Scenario | str | Path | Mapping[str, Any],
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    margin_bound: bool = True,
    pilot: Pilot = True,
    single_points: bool = True,
    connectivity: bool = True,
) -> Plan:
    """Return the plan of a scenario: senses, phases, links and the verdict on observability.

    `scenario` may be the path of its file or a mapping of its keys; syncplan.load_plan reads plans.
    Centres that are not given are found first, see syncplan.placement.centers.

    `bound` selects when the posterior bound is computed: up to a stated amount of work (auto),
    always or never. `steady` adds its periodic limit. `margin_bound` adds the bound on the links'
    smallest margin, which takes most of the time if phases have no closed form. `pilot` flies a
    plan that says GO, about 31 times, before its verdict, see syncplan.planning.pilot_flight;
    without it, the verdict is on paper. `single_points` finds the single losses that end
    observability, and `connectivity` the connectivity period.
    """
    if bound not in ("auto", "always", "never"):
        raise InputError(f"{bound!r}: must be auto, always or never", key="bound")
    scenario = scenario_of(scenario)
    placed = None
    if not scenario.formation.placed:
        from syncplan.placement.centers import place

        placed = place(scenario)
    resolved = (scenario if placed is None else placed.scenario).resolved()
    exact = rule_orbits(resolved, margin_bound=margin_bound)
    offsets = per_vehicle(resolved.orbit.desync_rad, resolved.size)
    orbits = exact.desynchronised(np.array(offsets, dtype=float))
    judged = judge(
        resolved,
        orbits,
        bound=bound,
        steady=steady,
        single_points=single_points,
        connectivity=connectivity,
        given=exact.pairs,
        found=exact.synchronisation,
    )
    on_paper = replace(
        judged,
        synchronisation=exact.synchronisation,
        alternating_proven=exact.alternating_proven,
        placement=placed,
    )
    return with_flights(on_paper, pilot)


def with_flights(judged: Plan, pilot: Pilot) -> Plan:
    """Return a plan with the record of a pilot flight, if that is wanted."""
    if not pilot:
        return judged
    # flights load the kernels of the closed loop
    from syncplan.planning.pilot_flight import piloted

    return piloted(judged, pilot if isinstance(pilot, PilotOptions) else PilotOptions())
