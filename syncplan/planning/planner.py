"""The planner: from a scenario to a judged plan. The only module that sees the whole chain."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.bounds import posterior_bound, steady_bound, window_bound
from syncplan.observability.certificate import Certificate, certify
from syncplan.observability.connectivity import connectivity_period
from syncplan.observability.link_verdicts import LinkVerdict, landmark_verdicts, vehicle_verdicts
from syncplan.observability.rank import Observability, assess, link_information
from syncplan.observability.unobservable_modes import UnobservableMode, name_modes
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import Windows, find_windows, reachable_pairs
from syncplan.orbits.noise import Noise
from syncplan.orbits.scenario_arrays import radii_of, sensors_of, team_of
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.separation import Approach, closest_approach, pairs_nearer_than
from syncplan.orbits.sightings import sightings_over
from syncplan.orbits.team import Team
from syncplan.placement.centers import Placement, place
from syncplan.planning.refinement_record import RefinementRecord
from syncplan.runtime.blas import single_threaded_blas
from syncplan.scenario.rules import SAME_PLACE_M
from syncplan.scenario.specification import Scenario, per_vehicle
from syncplan.synchronisation.phases import Synchronisation, synchronise
from syncplan.synchronisation.senses import alternating_senses

__all__ = [
    "BoundChoice",
    "DroppedLink",
    "Plan",
    "Prediction",
    "bound_is_affordable",
    "judge",
    "plan",
]

BoundChoice = Literal["auto", "always", "never"]

BOUND_WORK_LIMIT = 4e10
"""Steps times state dimension squared times vehicles up to which `auto` computes the bound."""


@dataclass(frozen=True, slots=True)
class DroppedLink:
    """A listed link that never comes into contact, and why."""

    a: int
    b: int
    reason: str


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted position errors in m, from the posterior Cramer-Rao bound.

    Attributes
    ----------
    rms : (n,) over the second half of the run, or None where not computed
    steady : (n,) over a period once periodic, infinite if it never is; None where not asked for
    window : (n,) bound from one window without motion noise; NaN where not determined
    note : why a figure is missing
    """

    rms: Array | None
    steady: Array | None
    window: Array
    note: str


@dataclass(frozen=True, slots=True)
class Plan:
    """Orbits with all that was judged of them by the exact code.

    Attributes
    ----------
    scenario : as resolved
    team, windows : what the judgement rests on
    synchronisation : how the phases were found; None for a plan whose phases were given
    alternating_proven : whether the number of alternating links is proven largest; None where
        the senses were given
    links, incidental_links, landmark_links, dropped_links : meetings, listed and not
    approach : the closest two vehicles come; None for one vehicle
    too_close : pairs nearer than min_separation_m
    refinement : how the plan was refined, or why it could not be; None if that was not tried
    placement : how the centres were found; None where they were given
    """

    scenario: Scenario
    team: Team
    windows: Windows
    synchronisation: Synchronisation | None
    alternating_proven: bool | None
    links: tuple[LinkVerdict, ...]
    incidental_links: tuple[LinkVerdict, ...]
    landmark_links: tuple[LinkVerdict, ...]
    dropped_links: tuple[DroppedLink, ...]
    connectivity_period: float | None
    approach: Approach | None
    too_close: tuple[Approach, ...]
    observability: Observability
    certificate: Certificate
    unobservable: tuple[UnobservableMode, ...]
    prediction: Prediction
    refinement: RefinementRecord | None = None
    placement: Placement | None = None

    @property
    def orbits(self) -> Orbits:
        """The team's orbits."""
        return self.team.orbits

    @property
    def landmarks(self) -> Array:
        """(m, 2) m: the landmarks that the team knows."""
        return self.team.landmarks

    @property
    def sensors(self) -> Sensors:
        """The team's sensors."""
        return self.team.sensors

    @property
    def noise(self) -> Noise:
        """The team's noise."""
        return self.team.noise

    @property
    def observable(self) -> bool:
        """Whether every position and heading is determined over the window."""
        return self.observability.observable


@single_threaded_blas
def plan(
    scenario: Scenario,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    margin_bound: bool = True,
) -> Plan:
    """Return the plan of a scenario: senses, phases, meetings and the verdict on observability.

    Centres that are not given are found first, see syncplan.placement.centers.

    `bound` says whether the posterior bound is computed: for teams up to a stated amount of work
    (auto), always or never. `steady` adds its periodic limit. `margin_bound` says whether the
    bound on the links' smallest margin is computed, which takes most of the time where phases have
    no closed form.
    """
    if bound not in ("auto", "always", "never"):
        raise InputError(f"{bound!r}: must be auto, always or never", key="bound")
    placed = None if scenario.formation.placed else place(scenario)
    resolved = (scenario if placed is None else placed.scenario).resolved()
    centers = np.array(resolved.centers, dtype=float)
    radii = radii_of(resolved)
    sensors = sensors_of(resolved)
    pairs = _listed_pairs(resolved, centers, radii, sensors)
    senses, proven = _senses(resolved, centers, radii, pairs)
    found = synchronise(
        centers,
        radii,
        senses,
        sensors.ranges,
        pairs,
        resolved.orbit.first_phase_rad,
        resolved.min_separation_m,
        margin_bound=margin_bound,
    )
    off = np.array(per_vehicle(resolved.orbit.desync_rad, resolved.size), dtype=float)
    phases = (found.phases + off) % (2.0 * np.pi) if off.any() else found.phases
    orbits = Orbits(centers, radii, senses, phases, resolved.orbit.rate)
    judged = judge(resolved, orbits, bound=bound, steady=steady, given=pairs, found=found)
    return replace(judged, synchronisation=found, alternating_proven=proven, placement=placed)


@single_threaded_blas
def judge(
    scenario: Scenario,
    orbits: Orbits,
    *,
    bound: BoundChoice = "auto",
    steady: bool = False,
    given: Index | None = None,
    found: Synchronisation | None = None,
) -> Plan:
    """Return the plan of given orbits, judged afresh: nothing is taken over from who made them."""
    resolved = scenario.resolved()
    team = team_of(resolved, orbits)
    sensors = team.sensors
    pairs = given
    if pairs is None:
        pairs = _listed_pairs(resolved, orbits.centers, orbits.radii, sensors)
    windows = find_windows(team)
    information = link_information(team, sightings_over(team, windows, resolved.window))
    verdict = assess(team, information)
    met = _met_pairs(orbits, windows)
    listed = {(a, b) for a, b in pairs.tolist()}
    kept = as_pairs([(a, b) for a, b in pairs.tolist() if (a, b) in met])
    others = as_pairs(sorted(met - listed))
    largest = float(verdict.singular_values[0])
    names, landmark_names = resolved.vehicle_names, resolved.landmark_names
    return Plan(
        scenario=resolved,
        team=team,
        windows=windows,
        synchronisation=None,
        alternating_proven=None,
        links=tuple(vehicle_verdicts(team, windows, information, largest, kept)),
        incidental_links=tuple(vehicle_verdicts(team, windows, information, largest, others)),
        landmark_links=tuple(landmark_verdicts(team, windows, information, largest)),
        dropped_links=tuple(_dropped(resolved, orbits, sensors, pairs, met, found)),
        connectivity_period=connectivity_period(team, windows, largest),
        approach=closest_approach(orbits),
        too_close=_too_close(orbits, resolved.min_separation_m),
        observability=verdict,
        certificate=certify(team, verdict, information),
        unobservable=tuple(name_modes(team, verdict, information, names, landmark_names)),
        prediction=_predict(resolved, team, windows, verdict, bound, steady),
    )


# --- the scenario as arrays ---------------------------------------------------------------------


def _listed_pairs(scenario: Scenario, centers: Array, radii: Array, sensors: Sensors) -> Index:
    """(e, 2) pairs to synchronise, a < b: as listed, or all that can come within range."""
    if scenario.formation.links is not None:
        return as_pairs(scenario.linked)
    still = Orbits(centers, radii, np.ones(len(radii)), np.zeros(len(radii)), 1.0)
    a, b = reachable_pairs(still, sensors.ranges)
    return np.unique(np.column_stack([np.minimum(a, b), np.maximum(a, b)]), axis=0)


def _senses(
    scenario: Scenario, centers: Array, radii: Array, pairs: Index
) -> tuple[Array, bool | None]:
    direction = scenario.orbit.direction
    if direction == "alternate":
        shared = _sharing_a_circle(centers, radii)
        edges = [(int(a), int(b)) for a, b in pairs]
        return alternating_senses(scenario.size, edges, shared)
    turn = {"ccw": 1.0, "cw": -1.0}
    listed = direction if isinstance(direction, list) else [direction] * scenario.size
    return np.array([turn[one] for one in listed]), None


def _sharing_a_circle(centers: Array, radii: Array) -> list[tuple[int, int]]:
    """Pairs of vehicles whose circles are the same, to SAME_PLACE_M in centre and radius."""
    still = Orbits(centers, radii, np.ones(len(radii)), np.zeros(len(radii)), 1.0)
    a, b = reachable_pairs(still, np.full(len(radii), SAME_PLACE_M))
    apart = np.hypot(*(centers[a] - centers[b]).T)
    same = (apart <= SAME_PLACE_M) & (np.abs(radii[a] - radii[b]) <= SAME_PLACE_M) & (a < b)
    return list(zip(a[same].tolist(), b[same].tolist(), strict=True))


# --- judgement --------------------------------------------------------------------------------


def _met_pairs(orbits: Orbits, windows: Windows) -> set[tuple[int, int]]:
    """Vehicle pairs (a < b) in contact at some time, either way."""
    met = (np.diff(windows.first) > 0) & (windows.targets < orbits.count)
    a, b = windows.observers[met], windows.targets[met]
    return set(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True))


def _dropped(
    scenario: Scenario,
    orbits: Orbits,
    sensors: Sensors,
    pairs: Index,
    met: set[tuple[int, int]],
    found: Synchronisation | None,
) -> list[DroppedLink]:
    known = {item.link: item.reason for item in found.dropped} if found else {}
    dropped = []
    for k, (a, b) in enumerate(pairs.tolist()):
        if (a, b) in met:
            continue
        reason = known.get(k) or _why_never_in_contact(orbits, sensors, a, b)
        dropped.append(DroppedLink(a, b, reason))
    return dropped


def _why_never_in_contact(orbits: Orbits, sensors: Sensors, a: int, b: int) -> str:
    near = pairs_nearer_than(orbits.only(np.array([a, b])), np.inf)[0].distance
    reach = float(max(sensors.ranges[a], sensors.ranges[b]))
    if near > reach:
        return f"comes no nearer than {near:.4g} m with these phases, range {reach:.4g} m"
    return "comes within range, but never inside a field of view"


def _too_close(orbits: Orbits, min_separation: float) -> tuple[Approach, ...]:
    if min_separation <= 0.0:
        return ()
    near = pairs_nearer_than(orbits, min_separation)
    return tuple(item for item in near if item.distance < min_separation * (1.0 - 1e-12))


def bound_is_affordable(count: int, duration: float, sample_time: float) -> bool:
    """Return whether the posterior bound is cheap enough to be computed without being asked for."""
    work = duration / sample_time * (3.0 * count) ** 2 * count
    return work <= BOUND_WORK_LIMIT


def _predict(
    scenario: Scenario,
    team: Team,
    windows: Windows,
    verdict: Observability,
    bound: BoundChoice,
    steady: bool,
) -> Prediction:
    orbits, landmarks, sensors, noise = team.orbits, team.landmarks, team.sensors, team.noise
    rms, note = None, "the posterior bound was not asked for"
    affordable = bound_is_affordable(orbits.count, scenario.duration_s, sensors.sample_time)
    if bound == "auto" and not affordable:
        note = (
            f"the posterior bound of {orbits.count} vehicles over {scenario.duration_s:g} s is "
            "computed on request (--bound always)"
        )
    elif bound != "never":
        try:
            run = posterior_bound(orbits, landmarks, sensors, windows, noise, scenario.duration_s)
            rms, note = run.rms_second_half(), ""
        except NoSolutionError as error:
            note = str(error)
    window = window_bound(verdict)
    limit = None
    if steady:
        limit = steady_bound(orbits, landmarks, sensors, windows, noise)
        if scenario.window >= orbits.period * (1.0 - 1e-9):
            limit = np.where(np.isnan(window), np.inf, limit)
    return Prediction(rms=rms, steady=limit, window=window, note=note)
