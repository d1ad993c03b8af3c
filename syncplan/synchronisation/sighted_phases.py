"""Sighted phases: phases of most contact with limited fields of view or among obstacles.

With limited views the closest approach may lie outside both, and among obstacles behind a wall. So
phases maximise each link's contact time, in either direction and within range and view, as a share
of the longest that any phases give it. The smallest share comes first.

The graph of links, and of pairs to be kept apart, splits into blocks that share only single
vehicles:

    bridge           the link's own best difference, whatever the others; all links of a tree
    3 or 4 vehicles  cell search: global
    more             coordinate descent from many starts, at once

Bisection then finds the largest smallest share for those turns round the cycles, and raises the
shares of links that are not held back. The result is the central phases among those that give every
link 97 % of the share found, so that no vehicle flies at the edge of a window.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.graphs import blocks, traversal
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Team
from syncplan.phrases import listed
from syncplan.synchronisation.contact_tables import seen_when_shifted, tabulated_contact
from syncplan.synchronisation.difference_tables import (
    MOST_VEHICLES,
    DifferenceTables,
    best_phases,
    descended,
    most_served,
)
from syncplan.synchronisation.phase_rules import Rules, along_forest, closest_distance, rules_of

FLOOR = 1e-3
"""Share of its attainable contact from which a link counts as served."""

KEPT = 0.97
"""Part of the share found that the central phases keep."""

LATE_SHARE = 0.01
"""Share of a period, either way, over which a link that meets its rule must keep the part KEPT of
its attainable contact."""

_EXACT_RAD = 1e-9

_ROUNDS = 4
_TIGHT, _ROOM = 1.02, 0.99
_STARTS_TO_POLISHED = 8
_TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class ContactPhases:
    """Time-phases (n,), whether every rule is met exactly, and the links (k,) not served."""

    theta: Array
    by_rule: bool
    unserved: Index


def phases_of_most_contact(
    tables: DifferenceTables, offset: Array, count: int, starts: int
) -> ContactPhases:
    """Return phases of `count` vehicles with the largest smallest share of contact.

    `offset` (e,) rad is the difference that each pair's rule requires. Rules are met where that
    costs almost nothing. `starts` is the number of starts of the descent in blocks of more than
    four vehicles.
    """
    unserved: list[int] = []
    placed: list[tuple[Index, Array]] = []
    by_rule = True
    waiting = [np.array(rows) for rows in blocks(count, tables.edges)]
    while waiting:
        rows = waiting.pop()
        part = tables.only(rows)
        found = _of_block(part, offset[rows], starts)
        lost = rows[found.unserved]
        if len(lost) == 0:
            vehicles = np.unique([tables.a[rows], tables.b[rows]])
            placed.append((vehicles, found.theta))
            by_rule &= found.by_rule or not part.links.any()
            continue
        unserved += lost.tolist()
        # unserved links need only be kept apart, and the block splits without them
        value = tables.value.copy()
        value[lost] = np.inf
        tables = replace(tables, value=value)
        left = rows[np.isfinite(tables.clearance[rows]).any(axis=1) | tables.links[rows]]
        edges = [tables.edges[k] for k in left.tolist()]
        waiting += [left[part] for part in blocks(count, edges)]
    return ContactPhases(_joined(placed, count), by_rule, np.array(sorted(unserved), dtype=int))


def _joined(placed: list[tuple[Index, Array]], count: int) -> Array:
    """Time-phases of all vehicles, with blocks turned to agree on the vehicles they share."""
    theta, known = np.zeros(count), np.zeros(count, dtype=bool)
    of_vehicle: dict[int, list[int]] = {}
    for number, (vehicles, _) in enumerate(placed):
        for k in vehicles.tolist():
            of_vehicle.setdefault(k, []).append(number)
    done = np.zeros(len(placed), dtype=bool)
    for root in range(count):
        known[root] = True
        waiting = [root]
        while waiting:
            shared = waiting.pop()
            for number in of_vehicle.get(shared, []):
                if done[number]:
                    continue
                done[number] = True
                vehicles, local = placed[number]
                turned = local + theta[shared] - local[np.searchsorted(vehicles, shared)]
                new = ~known[vehicles]
                theta[vehicles[new]] = turned[new]
                known[vehicles[new]] = True
                waiting += vehicles[new].tolist()
    return theta


def _of_block(part: DifferenceTables, offset: Array, starts: int) -> ContactPhases:
    none = np.zeros(0, dtype=np.int64)
    count = int(max(part.a.max(), part.b.max())) + 1
    theta = _by_rule(part, offset, count)
    if theta is not None:
        return ContactPhases(theta, True, none)
    if count == 2:
        theta, best = _widest(part)
        served = np.array([best > FLOOR])
    elif count <= MOST_VEHICLES:
        theta, best = best_phases(part, count)
        if not best > FLOOR:
            theta, best = best_phases(part, count, most_served(FLOOR, FLOOR))
        served = part.at(theta) >= FLOOR
        if served.all():
            theta = _central(part, *_polished(part, theta))
    else:
        theta, served = _of_many(part, offset, count, starts)
    clear = bool(np.all(part.at(theta) > -np.inf))
    if not clear and not served[part.links].any() and np.isfinite(part.clearance).any():
        # no phases keep all pairs apart: serve the links as if none had to be
        return _of_block(part.without_clearance(), offset, starts)
    return ContactPhases(theta, False, np.flatnonzero(part.links & ~served))


def _by_rule(part: DifferenceTables, offset: Array, count: int) -> Array | None:
    """Phases that meet every rule; None unless links keep most contact there and to either side."""
    links = np.flatnonzero(part.links)
    if len(links) == 0:
        return None
    forest = traversal(count, [part.edges[k] for k in links.tolist()])
    theta = along_forest(count, forest, part.a[links], offset[links])
    residual = theta[part.a] - theta[part.b] - offset
    residual -= _TURN * np.rint(residual / _TURN)
    if np.any(np.abs(residual[links]) > _EXACT_RAD) or np.any(part.at(theta) == -np.inf):
        return None
    samples = part.value.shape[1]
    late = np.arange(-np.ceil(LATE_SHARE * samples), np.ceil(LATE_SHARE * samples) + 1)
    place = np.rint((theta[part.a] - theta[part.b])[links] * (samples / _TURN))
    near = part.value[links[:, None], (place[:, None] + late).astype(np.int64) % samples]
    return theta if np.all(near >= KEPT) else None


def _widest(part: DifferenceTables) -> tuple[Array, float]:
    """Middle of the widest range of a single pair's nearly best differences, and its best worth."""
    worth = part.worth[0]
    best = float(worth.max())
    good = worth >= (KEPT * best if np.isfinite(best) else best)
    samples = len(worth)
    if good.all():
        return np.zeros(2), best
    first = int(np.argmin(good))
    turned = np.roll(good, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], turned, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2] - 1
    k = int(np.argmax(ends - begins))
    middle = first + 0.5 * (begins[k] + ends[k])
    return np.array([middle * (_TURN / samples), 0.0]), best


def _of_many(part: DifferenceTables, offset: Array, count: int, starts: int) -> tuple[Array, Flags]:
    """Phases of a large block, and whether they serve each pair (e,)."""
    candidates = descended(part, offset, count, starts)
    reached = part.at(candidates)
    smallest = reached.min(axis=1)
    order = np.argsort(-smallest, kind="stable")[: max(starts // _STARTS_TO_POLISHED, 1)]
    polished = [_polished(part, candidates[k]) for k in order if smallest[k] > FLOOR]
    if polished:
        theta, levels = max(polished, key=lambda one: float(np.min(one[1])))
        return _central(part, theta, levels), np.ones(len(part), dtype=bool)
    number = np.where(np.isposinf(reached), 0, reached >= FLOOR).sum(axis=1)
    number[np.any(reached == -np.inf, axis=1)] = -1
    best = int(np.argmax(number))
    return candidates[best], reached[best] >= FLOOR


def _polished(part: DifferenceTables, theta: Array) -> tuple[Array, Array]:
    """Phases of the largest smallest share with the turns of `theta`, and each link's level."""
    levels = np.full(len(part), np.inf)
    free = part.links.copy()
    if not free.any():
        return theta, levels
    for _ in range(_ROUNDS):
        found = part.highest(theta, free, _ROOM * np.where(free, np.inf, levels))
        if found is None:
            levels[free] = part.at(theta)[free]
            break
        theta, level = found
        levels[free] = level
        free = free & (part.at(theta) > _TIGHT * level)
        if not free.any():
            break
    return theta, levels


def _central(part: DifferenceTables, theta: Array, levels: Array) -> Array:
    central = part.central(KEPT * levels, theta)
    return theta if central is None else central


# --- phases in sight ----------------------------------------------------------------------------


_SAMPLES, _SAMPLES_APART = 1024, 4096
"""Number of differences in a table, without and with distances to keep."""

_TABLE_ERROR = 2e-5
"""Error of linear interpolation of a least distance, as a share of a radius."""

TOO_NEAR = 0.1
"""Share of the mean radius that linked vehicles on crossing circles keep apart where no separation
is stated."""

_STARTS, _STARTS_QUICK = 32, 12
_LOOKS = 8
_MOST_NAMED = 3


def phases_in_sight(
    rules: Rules, guards: Rules, team: Team, separation: float, *, quick: bool = False
) -> tuple[ContactPhases, Array]:
    """Return phases of largest smallest contact, and each link's attainable share (e,) of a period.

    The links are those of `rules`; `guards` are pairs to be kept `separation` m apart, as linked
    pairs are. The team's own phases do not matter. `quick` tries fewer starts.
    """
    both, links = rules.joined(guards), len(rules)
    contact = tabulated_contact(rules, team)
    clearing = _distances_to_keep(both, links, separation)
    samples = _SAMPLES_APART if np.any(clearing > 0.0) else _SAMPLES
    difference = np.arange(samples) * (2.0 * np.pi / samples)
    residual = difference - both.offset[:, None]
    value = np.full(residual.shape, np.inf)
    value[:links] = contact.at(residual[:links])
    blind = contact.attainable <= 0.0
    value[:links][blind] = np.inf
    clearance = np.full(residual.shape, np.inf)
    rows = np.flatnonzero(clearing > 0.0)
    clearance[rows] = closest_distance(both.only(rows), residual[rows]) - clearing[rows, None]
    never = clearance.max(axis=1) < 0.0
    clearance[never] = np.inf
    tables = DifferenceTables(both.a, both.b, value, clearance)
    starts = _STARTS_QUICK if quick else _STARTS
    found = phases_of_most_contact(tables, both.offset, team.count, starts)
    unserved = np.union1d(found.unserved, np.flatnonzero(blind))
    by_rule = found.by_rule and len(unserved) == 0
    return ContactPhases(found.theta, by_rule, unserved), contact.attainable


def attainable_contact(team: Team, pairs: Index) -> dict[tuple[int, int], float]:
    """Return the longest contact of each pair (e, 2) at any phases, as a share of a period."""
    orbits = team.orbits
    rules = rules_of(orbits, team.sensors.ranges, pairs)
    most = tabulated_contact(rules, team).attainable
    return dict(zip(rules.edges, most.tolist(), strict=True))


def hidden_at_all_phases(team: Team, pairs: Index) -> Flags:
    """Return (e,) whether obstacles hide pairs (e, 2) at all phases; they must come within range.

    Senses, phases and fields of view do not matter: over all phase differences, sight is tried from
    every place on one circle to every place on the other.
    """
    hidden = obstructible(team, pairs[:, 0], pairs[:, 1])
    if hidden.any():
        views = np.full(team.count, 2.0 * np.pi)
        seeing = replace(team, sensors=replace(team.sensors, fields_of_view=views))
        # most pairs see each other at one of these; the others need their tables
        looks = np.arange(_LOOKS) * (2.0 * np.pi / _LOOKS)
        shifts = np.broadcast_to(looks, (int(hidden.sum()), _LOOKS))
        hidden[hidden] = ~seen_when_shifted(seeing, pairs[hidden], shifts).any(axis=1)
        most = attainable_contact(seeing, pairs[hidden])
        hidden[hidden] = [share <= 0.0 for share in most.values()]
    return hidden


def why_unseen(team: Team, pair: Index, attainable: float) -> str:
    """Return why no phases serve a link (2,) that alone could see for `attainable` of a period."""

    def longest(seeing: Team) -> float:
        (found,) = attainable_contact(seeing, pair[None]).values()
        return found

    if attainable <= 0.0:
        if blocking := obstacles_blocking(team, longest):
            return f"sight is blocked by {blocking} at all phases"
        return "at no phases does either vehicle come into the other's range and field of view"
    within = "fields of view and past the obstacles" if team.obstacles else "fields of view"
    return (
        f"the phases can't serve all links at once within the {within}; by itself this link "
        f"could be in contact for {100.0 * attainable:.3g} % of a period"
    )


def obstacles_blocking(team: Team, contact: Callable[[Team], float]) -> str:
    """Return in words the obstacles that reduce a team's contact; "" if it has none anyway."""
    free = contact(replace(team, obstacles=())) if team.obstacles else 0.0
    if free <= 0.0:
        return ""
    each = [
        f"obstacles_m[{k}]"
        for k, one in enumerate(team.obstacles)
        if contact(replace(team, obstacles=(one,))) < free
    ]
    return listed(each, _MOST_NAMED)


def _distances_to_keep(rules: Rules, links: int, separation: float) -> Array:
    """Distances (e,) in m that pairs are to keep; 0 where none is required."""
    if separation > 0.0:
        return separation + _TABLE_ERROR * np.maximum(rules.radius_a, rules.radius_b)
    crossing = rules.distance < rules.radius_a + rules.radius_b
    crossing[links:] = False
    return np.where(crossing, TOO_NEAR * 0.5 * (rules.radius_a + rules.radius_b), 0.0)
