"""Landmark sites: which k of given candidates leave the worst vehicle the smallest window bound.

    relax     shares and a bound that no choice can beat        (syncplan.site_relaxation)
    round     the largest shares, seeded draws, and dropping sites one by one
    swap      one or two sites for others, while any swap helps
    prove     try all that the cuts do not rule out, where they are few enough
    judge     the chosen sites by the exact code that judges every plan

Every evaluation yields cuts: lines above the precision of any choice. A choice whose cuts lie
below the best known can't be better and is passed over, so searches lose nothing by being quick.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from syncplan.blas import single_threaded_blas
from syncplan.candidates import new_sites
from syncplan.errors import InputError, NoSolutionError
from syncplan.loading import scenario_from
from syncplan.planner import BoundChoice, Plan, judge, plan
from syncplan.quantities import Point
from syncplan.scenario import Scenario
from syncplan.site_information import Cuts, SiteInformation, candidate_information, evaluate
from syncplan.site_relaxation import Relaxation, relax

__all__ = ["SiteChoice", "choose_sites"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MOST_LISTED = 50_000
"""Choices are tried exhaustively, less those ruled out, up to this many."""

CUT_VEHICLES = 2
"""Each evaluation of a choice adds cuts of this many vehicles, the worst."""

MOST_EVALUATIONS = 1500
"""A proof or a round of swaps is given up after this many exact evaluations."""

DRAWS = 20
"""Seeded choices drawn in proportion to the shares."""

CLIMBS = 6
"""Swaps begin from this many of the best starts."""

_SPARE = 12
_BETTER = 1.0 + 1e-9


@dataclass(frozen=True, slots=True)
class SiteChoice:
    """The chosen sites, what they reach, and what no choice can.

    Attributes
    ----------
    chosen : indices into the candidates, ascending
    value : m, window bound of the worst vehicle with the chosen sites, by the exact code
    bound : m, no choice of as many sites has a smaller value; from the convex relaxation
    gap : value / bound - 1
    proven : whether every other choice was tried or ruled out: none is better
    shares : (S,) the relaxation's, in [0, 1]
    seen_by : (S,) how many vehicles see each candidate
    names, candidates : of all S candidates; (S, 2) m
    before : (n,) m, window bound of each vehicle without the sites; NaN where not determined
    plan : judged with the scenario's landmarks and the chosen sites
    """

    chosen: tuple[int, ...]
    value: float
    bound: float
    gap: float
    proven: bool
    shares: Array
    seen_by: Index
    names: tuple[str, ...]
    candidates: Array
    before: Array
    plan: Plan


@single_threaded_blas
def choose_sites(
    subject: Plan | Scenario,
    candidates: Array | Mapping[str, Point],
    choose: int,
    *,
    seed: int = 0,
    exhaustive: bool = True,
    bound: BoundChoice = "auto",
) -> SiteChoice:
    """Return the `choose` candidates (S, 2) m that minimise the worst vehicle's window bound.

    Phases do not depend on landmarks: a plan keeps its own. `exhaustive` allows the proof by
    trying all choices that are not ruled out, where they are few. `bound` is the plan's posterior
    bound, see syncplan.planner.plan. Raises InputError for unusable candidates, NoSolutionError
    where no choice found determines every vehicle.
    """
    before = subject if isinstance(subject, Plan) else plan(subject, bound="never")
    sites = new_sites(before.scenario, candidates)
    if not 1 <= choose <= len(sites):
        raise InputError(
            f"{choose}: must be from 1 to the number of candidates, {len(sites)}", key="choose"
        )
    if seed < 0:
        raise InputError(f"{seed}: must not be negative", key="seed")
    places = np.array(list(sites.values()), dtype=float)
    information = candidate_information(before, places)
    whole = evaluate(information, np.ones(len(sites)))
    if not whole.least > 0.0:
        everything = _judged(before, sites, range(len(sites)), "never")
        raise NoSolutionError(_lacking(everything, f"even all {len(sites)} candidates leave"))
    relaxation = relax(information, choose)
    search = _Search(information, choose, relaxation.cuts)
    _improve(search, relaxation, np.random.default_rng(seed))
    proven = exhaustive and _prove(search, relaxation)
    chosen = tuple(sorted(search.best.tolist()))
    made = _judged(before, sites, chosen, bound)
    value = float(np.max(made.prediction.window))
    if not np.isfinite(value):
        which = "any" if proven else "the best found"
        raise NoSolutionError(_lacking(made, f"{which} {choose} of {len(sites)} candidates leave"))
    floor = min(information.scale / float(np.sqrt(relaxation.ceiling)), value)
    return SiteChoice(
        chosen=chosen,
        value=value,
        bound=floor,
        gap=value / floor - 1.0,
        proven=proven,
        shares=relaxation.shares,
        seen_by=information.seen_by,
        names=tuple(sites),
        candidates=places,
        before=before.prediction.window,
        plan=made,
    )


# --- search -----------------------------------------------------------------------------------


class _Search:
    """The best choice known, and the cuts that rule others out.

    Choices that leave a vehicle undetermined all have precision 0; their rank tells them apart.
    """

    def __init__(self, information: SiteInformation, choose: int, cuts: Cuts) -> None:
        self.information = information
        self.choose = choose
        self.cuts = cuts
        self.best: Index = np.arange(choose)
        self.key = (-1.0, 0)

    def offer(self, subsets: Index, most: int = MOST_EVALUATIONS) -> bool:
        """Try (b, k) choices, most promising first; return whether all were tried or ruled out."""
        ceilings = self.cuts.ceilings(subsets)
        for _ in range(most):
            first = int(np.argmax(ceilings)) if len(ceilings) else -1
            if first < 0 or ceilings[first] <= self.key[0] * _BETTER:
                return True
            at = self.reached(subsets[first])
            ceilings[first] = -np.inf
            np.minimum(ceilings, at.ceilings(subsets), out=ceilings)
        return bool(np.all(ceilings <= self.key[0] * _BETTER))

    def reached(self, subset: Index) -> Cuts:
        """Evaluate one choice, keep it if it is the best, and return its cuts."""
        shares = np.zeros(self.information.site_count)
        shares[subset] = 1.0
        at = evaluate(self.information, shares, CUT_VEHICLES)
        self.cuts = self.cuts.joined(at.cuts)
        self.keep(np.sort(subset), (at.least, at.rank))
        return at.cuts

    def keep(self, subset: Index, key: tuple[float, int]) -> None:
        """Take a choice for the best if it is."""
        level = key[0] == self.key[0] and key[1] > self.key[1]
        if key[0] > self.key[0] * _BETTER or level:
            self.best, self.key = subset, key

    def swap(self, relaxation: Relaxation, count: int, passed: set[tuple[int, ...]]) -> bool:
        """Exchange `count` of the best choice's sites while that helps; return whether it did.

        Ends at a choice already `passed`: what follows it is known.
        """
        begun, known = self.key, None
        while self.key != known and tuple(self.best.tolist()) not in passed:
            passed.add(tuple(self.best.tolist()))
            known = self.key
            self.offer(_swaps(self.best, self.useful(relaxation), count))
        return self.key != begun

    def useful(self, relaxation: Relaxation) -> Index:
        """Sites that a better choice than the best known may hold."""
        ceilings = relaxation.ceilings_with(self.choose)
        return np.flatnonzero(ceilings > self.key[0] * _BETTER).astype(np.int64)


def _improve(search: _Search, relaxation: Relaxation, generator: np.random.Generator) -> None:
    """Swap single sites from the best starts, then pairs of the best, while any swap helps."""
    rounded = _rounded(relaxation.shares, search.choose, generator)
    dropped = _dropped_one_by_one(search.information, relaxation.shares, search.choose)
    climbs = []
    for start in np.unique(np.concatenate([dropped[None], rounded]), axis=0):
        climbs.append(_Search(search.information, search.choose, relaxation.cuts))
        climbs[-1].reached(start)
    climbs.sort(key=lambda climb: climb.key, reverse=True)
    passed: set[tuple[int, ...]] = set()
    for climb in climbs[:CLIMBS]:
        climb.swap(relaxation, 1, passed)
        search.keep(climb.best, climb.key)
    while search.swap(relaxation, 2, set()):
        search.swap(relaxation, 1, set())


def _prove(search: _Search, relaxation: Relaxation) -> bool:
    """Try all choices of sites that may be useful; return whether none better is left."""
    useful = search.useful(relaxation)
    if comb(len(useful), search.choose) > MOST_LISTED:
        return False
    return search.offer(_listed(useful, search.choose))


def _rounded(shares: Array, choose: int, generator: np.random.Generator) -> Index:
    """(1 + DRAWS, k) choices: the largest shares, then draws in proportion to the shares."""
    with np.errstate(divide="ignore"):
        weight = np.log(np.maximum(shares, 1e-12))
    noise = generator.gumbel(size=(DRAWS, len(shares)))
    scores = np.concatenate([weight[None], weight + noise])
    return np.sort(np.argsort(-scores, axis=1, kind="stable")[:, :choose], axis=1)


def _dropped_one_by_one(information: SiteInformation, shares: Array, choose: int) -> Index:
    """The choice left when, of the largest shares, the site missed least is dropped in turn."""
    left = np.argsort(-shares, kind="stable")[: choose + _SPARE]
    left = np.sort(left)
    while len(left) > choose:
        keys = []
        for k in range(len(left)):
            trial = np.zeros(len(shares))
            trial[np.delete(left, k)] = 1.0
            at = evaluate(information, trial)
            keys.append((at.least, at.rank))
        left = np.delete(left, max(range(len(left)), key=keys.__getitem__))
    return left


def _swaps(chosen: Index, useful: Index, count: int) -> Index:
    """(b, k) choices that exchange `count` of the chosen for useful ones; none if too many."""
    others = np.setdiff1d(useful, chosen)
    if comb(len(chosen), count) * comb(len(others), count) > MOST_LISTED:
        return np.zeros((0, len(chosen)), dtype=np.int64)
    kept, into = _listed(chosen, len(chosen) - count), _listed(others, count)
    return np.hstack([np.repeat(kept, len(into), axis=0), np.tile(into, (len(kept), 1))])


def _listed(sites: Index, choose: int) -> Index:
    """(b, choose) all choices of some of the sites."""
    return np.array(list(combinations(sites.tolist(), choose)), dtype=np.int64).reshape(-1, choose)


# --- judgement --------------------------------------------------------------------------------


def _judged(
    before: Plan, sites: dict[str, Point], chosen: Sequence[int], bound: BoundChoice
) -> Plan:
    """The plan with the chosen sites as further landmarks, on the same orbits."""
    names = list(sites)
    given = dict(zip(before.scenario.landmark_names, before.scenario.landmarks, strict=True))
    added = {names[k]: sites[names[k]] for k in chosen}
    document = before.scenario.model_dump(mode="json", exclude_none=True)
    scenario = scenario_from(
        {**document, "landmarks_m": {**given, **added}}, max_vehicles=before.scenario.size
    )
    judged = judge(scenario, before.orbits, bound=bound, found=before.synchronisation)
    return replace(
        judged,
        synchronisation=before.synchronisation,
        alternating_proven=before.alternating_proven,
    )


def _lacking(judged: Plan, which: str) -> str:
    """What stays undetermined, in words, and a remedy."""
    motion = judged.unobservable[0]
    rank, size = judged.observability.rank, judged.observability.state_dim
    return (
        f"no choice of sites determines every vehicle: {which} rank {rank} of {size}: "
        f"{motion.description}; cure: {motion.cure}"
    )
