"""Difference constraints on time-phases, and the phases that satisfy them.

A link's least distance, tabulated over the size of its residual, turns "within reach by a margin
and no nearer than the separation" into an interval of residuals around the current one. Intervals
on differences theta_a - theta_b are a system of difference constraints; its central solution is as
far from losing a link as those turns allow.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import wrap
from syncplan.synchronisation import difference_tables
from syncplan.synchronisation.phase_rules import Rules, closest_distance, residuals

_SAMPLES, _SAMPLES_SEPARATED = 513, 2049
"""Number of residuals in a table, without and with a separation, whose intervals may be narrow."""


@dataclass(frozen=True, slots=True)
class PhaseConstraints:
    """Links to serve and pairs to keep apart, tabulated over the size of the residual.

    Attributes
    ----------
    rules : of the links, then of the guarded pairs
    links : number of links; the rest are guarded pairs, which only keep their separation
    separation : (e,) m, least distance that each pair keeps
    residual : (k,) rad from 0 to pi
    least_distance : (e, k) m
    cost : (links, k) m, to be minimised: the least distance where the circles are apart. Where
        they cross, nearest is not best. There the cost grows with the residual, from half the
        reach to all of it, so that phases stay near the rule, and steeply near the end of
        contact, so that they stay clear of it. With a separation, which prevents collisions, this
        applies only to vehicles that share a circle, so that they spread out on it
    """

    rules: Rules
    links: int
    separation: Array
    residual: Array
    least_distance: Array
    cost: Array

    @classmethod
    def of(cls, rules: Rules, guards: Rules, separation: float) -> "PhaseConstraints":
        """Return the constraints of `rules` (to serve) and `guards` (to keep apart).

        Pairs that no phases keep apart are exempt: with them nothing would be feasible.
        """
        samples = _SAMPLES if separation == 0.0 else _SAMPLES_SEPARATED
        residual = np.linspace(0.0, np.pi, samples)
        furthest = closest_distance(guards, np.broadcast_to(residual, (len(guards), samples)))
        guards = guards.only(np.max(furthest, axis=1, initial=0.0) >= separation)
        both, links = rules.joined(guards), len(rules)
        least = closest_distance(both, np.broadcast_to(residual, (len(both), samples)))
        kept = np.where(np.max(least, axis=1, initial=0.0) >= separation, separation, 0.0)
        cost = _cost(rules, residual, least[:links], separation)
        return cls(both, links, kept, residual, least, cost)

    def over_differences(self) -> difference_tables.DifferenceTables:
        """Return the margins and clearances over a whole turn of theta_a - theta_b."""
        samples = 2 * (len(self.residual) - 1)
        difference = np.arange(samples) * (2.0 * np.pi / samples)
        away = np.abs(wrap(difference - self.rules.offset[:, None]))
        margin, clearance = np.full(away.shape, np.inf), np.full(away.shape, np.inf)
        for row, one in enumerate(away):
            if row < self.links:
                cost = np.interp(one, self.residual, self.cost[row])
                margin[row] = self.rules.reach[row] - cost
            if self.separation[row] > 0.0:
                least = np.interp(one, self.residual, self.least_distance[row])
                clearance[row] = least - self.separation[row]
        return difference_tables.DifferenceTables(self.rules.a, self.rules.b, margin, clearance)

    def only(self, links: list[int]) -> "PhaseConstraints":
        """Return the constraints of the chosen links and all guarded pairs."""
        rows = np.concatenate(
            [np.array(links, dtype=np.int64), np.arange(self.links, len(self.rules))]
        )
        return replace(
            self,
            rules=self.rules.only(rows),
            links=len(links),
            separation=self.separation[rows],
            least_distance=self.least_distance[rows],
            cost=self.cost[links],
        )

    def intervals(self, margin: float, current: Array) -> tuple[Array, Array, Flags]:
        """Return (low, high, possible), each (e,): the allowed residuals nearest the current ones.

        A residual is allowed if its least distance keeps the separation and, for a link, its cost
        is at least `margin` below the reach. Rows without an allowed residual are not possible.
        """
        lack = self.separation[:, None] - self.least_distance
        reach = self.rules.reach[: self.links, None]
        lack[: self.links] = np.maximum(lack[: self.links], self.cost - (reach - margin))
        allowed = lack <= 0.0
        possible = allowed.any(axis=1)
        away = np.abs(self.residual - np.abs(current)[:, None])
        near = np.argmin(np.where(allowed, away, np.inf), axis=1)[:, None]
        column = np.arange(len(self.residual))
        left = np.where(~allowed & (column < near), column, -1).max(axis=1)
        right = np.where(~allowed & (column > near), column, len(self.residual)).min(axis=1)
        low = self._edge(lack, left, left + 1)
        high = self._edge(lack, right, right - 1)
        to_zero, to_pi, negative = left < 0, right >= len(self.residual), current < 0.0
        turn = 2.0 * np.pi
        signed_low = np.where(negative, np.where(to_pi, low - turn, -high), low)
        signed_high = np.where(negative, -low, np.where(to_pi, turn - low, high))
        return (
            np.where(to_zero, -high, signed_low),
            np.where(to_zero, high, signed_high),
            np.asarray(possible),
        )

    def _edge(self, lack: Array, outside: Index, inside: Index) -> Array:
        """Residual where the lack vanishes between an outside and an inside sample."""
        rows = np.arange(len(lack))
        last = len(self.residual) - 1
        out, inn = np.clip(outside, 0, last), np.clip(inside, 0, last)
        beyond, within = lack[rows, out], lack[rows, inn]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(beyond > 0.0, within / (within - beyond), 0.0)
        step = self.residual[out] - self.residual[inn]
        return np.asarray(self.residual[inn] + np.clip(np.nan_to_num(share), 0.0, 1.0) * step)


_LIMIT_SHARE = 0.5
_ONE_CIRCLE = 1e-3
"""Share of a radius below which circles that differ in centre and radius count as one."""


def _cost(rules: Rules, residual: Array, table: Array, separation: float) -> Array:
    crossing = rules.distance < rules.radius_a + rules.radius_b
    if separation > 0.0:
        alike = np.maximum(rules.distance, np.abs(rules.radius_a - rules.radius_b))
        crossing &= alike < _ONE_CIRCLE * rules.radius_a
    ra, rb = rules.radius_a[:, None], rules.radius_b[:, None]
    spread = np.sqrt(np.maximum(ra**2 + rb**2 + 2.0 * ra * rb * np.cos(residual), 0.0))
    share = (ra + rb - spread) / (ra + rb - np.abs(ra - rb))
    grown = 0.5 * rules.reach[:, None] * (1.0 + share)
    reach = rules.reach[:, None]
    at_limit = reach - (reach - table) / _LIMIT_SHARE
    return np.where(crossing[:, None], np.maximum(grown, at_limit), table)


_BISECTIONS = 40


def largest_margin(
    constraints: PhaseConstraints, start: Array, above: float = -np.inf
) -> tuple[Array, float]:
    """Return (theta, margin in m) of the largest smallest margin with the turns of `start`.

    The margin is reach less cost; below zero not every link is in contact. It is -inf if those
    turns allow no separation or no margin as large as `above`; otherwise it is 0 for a team without
    links.
    """
    if above > -np.inf and _feasible(constraints, above, start) is None:
        return start, -np.inf
    reach = constraints.rules.reach[: constraints.links]
    high = (
        float(np.min(reach - constraints.cost.min(axis=1), initial=np.inf))
        if constraints.links
        else 0.0
    )
    low = min(float(np.min(reach - constraints.cost.max(axis=1), initial=0.0)), high)
    found = difference_tables.highest_level(
        lambda margin: _feasible(constraints, margin, start), low, high, _BISECTIONS
    )
    return (start, -np.inf) if found is None else found


def serve_greedily(constraints: PhaseConstraints, start: Array) -> tuple[Index, Array]:
    """Return a largest-first greedy choice of links (k,) that can be served at once, and phases.

    Links in contact over the widest range of residuals come first. Each is kept if some phases
    serve it and all kept so far, and keep all guarded pairs apart.
    """
    reach = constraints.rules.reach[: constraints.links]
    room = np.sum(constraints.least_distance[: constraints.links] <= reach[:, None], axis=1)
    kept: list[int] = []
    theta = start
    for link in np.argsort(-room, kind="stable"):
        trial = _feasible(constraints.only([*kept, int(link)]), 0.0, theta)
        if trial is not None:
            theta = trial
            kept.append(int(link))
    return np.sort(np.array(kept, dtype=np.int64)), theta


def _feasible(constraints: PhaseConstraints, margin: float, start: Array) -> Array | None:
    """Central time-phases with every margin at least `margin`, or None."""
    rules = constraints.rules
    current = residuals(rules, start)
    low, high, possible = constraints.intervals(margin, current)
    if not possible.all():
        return None
    # theta_a - theta_b = base + residual, with the turns of the start
    base = start[rules.a] - start[rules.b] - current
    low, high = low + base, high + base
    return difference_tables.central_solution((rules.a, rules.b), low, high, start)
