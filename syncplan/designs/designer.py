"""Design: a ladder over teams, the cheapest one that meets the need, and what else would help.

    proof that it is impossible, or
    cells (vehicles, landmarks), each searched alone, then on from its neighbours   -> front
    the cheapest that meet the need, refined              -> plan, losses, validation, flight
    where none does                                       -> purchases, each searched

A search is on a coarse sample grid and begins with the results of earlier ones only, so that the
number of processes changes nothing. Whatever is returned is judged by the exact code.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from syncplan.arrays import Array
from syncplan.designs.candidates import Cell, Space
from syncplan.designs.cell_search import Found, search
from syncplan.designs.impossibility import Proof, proof_against
from syncplan.designs.purchases import Purchase, offers_for
from syncplan.errors import InputError
from syncplan.flight.flying import Flight, fly
from syncplan.planning.loss_study import what_if
from syncplan.planning.planner import Plan
from syncplan.planning.validation import Validation, validate
from syncplan.refinement.refiner import refine
from syncplan.results import Result
from syncplan.runtime.machine import single_threaded_blas, usable_cores
from syncplan.runtime.task_crew import Work, run_orders
from syncplan.scenario.brief import Brief, Effort, brief_of

Status = Literal["met", "not_found", "impossible"]

EVALUATIONS: Mapping[Effort, int] = {"quick": 800, "normal": 6000, "thorough": 40_000}
"""Number of candidates looked at in each cell."""

NEARLY = 1.3
"""Multiple of the need up to which a cell is worth refining."""

MOST_TRIED = 6
"""Number of cells that are refined, validated and flown at most."""

BOX_M = 5.0
"""How far a refinement may move each centre."""

REFINEMENT_S = 600.0
"""Time limit of a refinement, which takes some seconds."""

TRIALS = 40
"""Trials of the validation and of the flight of a winner."""


@dataclass(frozen=True, slots=True)
class FrontCell:
    """What a search found for so many vehicles and landmarks.

    Attributes
    ----------
    cell : numbers of vehicles and landmarks
    found : its best candidate, with the error on the coarse grid
    cost : of the team, in the unit of the brief's costs
    """

    cell: Cell
    found: Found
    cost: float


@dataclass(frozen=True, slots=True)
class Judgement:
    """A formation judged by the exact code.

    Attributes
    ----------
    cell : numbers of vehicles and landmarks
    plan : refined, and with its flight where it was flown
    validation, flight : None where an earlier judgement failed
    binding : the requirement that it misses; empty if it meets the brief
    covered : share of the area that is covered; None for other purposes
    """

    cell: Cell
    plan: Plan
    validation: Validation | None = None
    flight: Flight | None = None
    binding: str = ""
    covered: float | None = None

    @property
    def worst(self) -> float:
        """Largest predicted RMS error of a vehicle in m; infinite where none is predicted."""
        rms = self.plan.prediction.rms
        return float("inf") if rms is None else float(rms.max())


@dataclass(frozen=True, slots=True, repr=False)
class Design(Result):
    """Result of a design.

    Attributes
    ----------
    brief : the brief
    status : met, not_found, or impossible
    proof : why it is impossible; None otherwise
    best : the winner, or the best formation found; None if there is none
    binding : the requirement that decides; empty if the brief is met
    front : what was found for each number of vehicles and landmarks
    purchases : what changes of the brief would bring, where it is not met
    evaluations : number of candidates looked at
    cut_short : whether Ctrl-C ended the search
    """

    brief: Brief
    status: Status
    proof: Proof | None
    best: Judgement | None
    binding: str
    front: tuple[FrontCell, ...]
    purchases: tuple[Purchase, ...]
    evaluations: int
    cut_short: bool

    def __repr__(self) -> str:
        """Return one line: the brief and the status."""
        return f"<{type(self).__name__} of {self.brief!r}: {self.status}>"

    def cost(self, cell: Cell) -> float:
        """Return the cost of a team, without its sensors, by the brief's costs."""
        return _cost(self.brief, cell)


DesignProgress = Callable[[int, int, Sequence[FrontCell]], None]
"""Callback that receives the searches done, their number, and the front so far."""


@dataclass(frozen=True, slots=True)
class KeptSearches:
    """Searches kept from an interrupted design, and the function that keeps further ones.

    Attributes
    ----------
    finished : finished searches by name, as they were kept
    keep : called with the name and the bytes of each search that ends by itself
    """

    finished: Mapping[str, bytes] = field(default_factory=dict)
    keep: Callable[[str, bytes], None] = lambda _name, _data: None


def design(
    brief: Brief | str | Path | Mapping[str, Any],
    *,
    workers: int | None = None,
    progress: DesignProgress | None = None,
    earlier: KeptSearches | None = None,
) -> Design:
    """Return the cheapest formation found that meets a brief, or what stands in its way.

    `brief` may be the path of its file or a mapping of its keys. `workers` is the number of
    processes, by default one per core; it changes no result. `earlier` holds the searches of an
    interrupted design, which are not repeated. The winner is predicted, validated and flown over
    ten periods; its worst vehicle stays within `need.worst_rms_m` in all three.

    Raises InputError for a brief that cannot be used.
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} given, at least 1 is needed", key="workers")
    given = brief_of(brief)
    proof = proof_against(given)
    if proof is not None:
        return Design(given, "impossible", proof, None, proof.kind, (), (), 0, False)
    ladder = _Ladder(given, workers or usable_cores(), progress, earlier or KeptSearches())
    return ladder.climbed()


def cells_of(brief: Brief) -> list[Cell]:
    """Return the cells of a brief: all numbers of vehicles and of landmarks that may do."""
    keep = brief.purpose.keep
    first = max(brief.team.min, keep.count if keep else 1)
    # fewer landmarks cannot be observed, see impossibility
    needed = 1 if brief.heading_sigma_rad is not None else 2
    return [
        Cell(count, sites)
        for count in range(first, brief.team.max + 1)
        for sites in range(max(brief.landmarks.least, needed), brief.landmarks.most + 1)
    ]


# --- searches in processes ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SearchOrder:
    """A search to be made.

    Attributes
    ----------
    name : unique in a design; a search of the same name has the same result
    brief : that of the design, or one with a change
    cell : searched cell
    evaluations : number of candidates
    start : (size,) point to begin at; None for a random one
    """

    name: str
    brief: Brief
    cell: Cell
    evaluations: int
    start: Array | None = None


def search_worker(seed: int) -> Work:
    """Return the function that carries out search orders."""

    @single_threaded_blas
    def work(
        order: SearchOrder, stop: threading.Event, _report: Callable[[Any], None]
    ) -> tuple[str, Found, bool]:
        cell = order.cell
        space = Space(order.brief, cell)
        own = (seed, cell.vehicles, cell.landmarks, int(cell.alternate), order.start is None)
        found = search(space, order.evaluations, own, order.start, stop.is_set)
        return order.name, found, stop.is_set()

    return work


@dataclass
class _Ladder:
    brief: Brief
    workers: int
    progress: DesignProgress | None
    earlier: KeptSearches
    evaluations: int = 0
    cut_short: bool = False

    @property
    def wanted(self) -> float:
        """Predicted error in m that meets the need with its margin."""
        return self.brief.need.worst_rms_m * (1.0 - self.brief.need.margin)

    def climbed(self) -> Design:
        """Search all cells, and conclude."""
        cells = cells_of(self.brief)
        budget = EVALUATIONS[self.brief.effort]
        both = [replace(cell, alternate=alternate) for cell in cells for alternate in (False, True)]
        alone = self.found(
            [SearchOrder(f"alone {_named(one)}", self.brief, one, budget // 4) for one in both]
        )
        orders = [self.onward(cell, alone, budget // 2) for cell in cells]
        known = [one for one in orders if one is not None]
        further = self.found(known)
        front = []
        for order in known:
            cell = order.cell
            own = alone.get(f"alone {_named(cell)}")
            best = min(
                (one for one in (own, further.get(order.name)) if one is not None),
                key=lambda one: one.value,
                default=None,
            )
            if best is not None:
                front.append(self.front_cell(cell, best))
        return self.concluded(front)

    def front_cell(self, cell: Cell, found: Found) -> FrontCell:
        """Return a cell with its result and its cost."""
        return FrontCell(cell, found, _cost(self.brief, cell))

    def found(self, orders: list[SearchOrder]) -> dict[str, Found]:
        """Results of searches by name; those that Ctrl-C left out are missing."""
        kept = {
            one.name: Found.of_bytes(self.earlier.finished[one.name])
            for one in orders
            if one.name in self.earlier.finished
        }
        made = dict(kept)
        cells = {one.name: one.cell for one in orders}

        def take(result: tuple[str, Found, bool]) -> None:
            name, found, stopped = result
            made[name] = found
            if not stopped:
                self.earlier.keep(name, found.as_bytes())
            if self.progress is not None:
                front = [self.front_cell(cells[k], one) for k, one in made.items()]
                self.progress(len(made), len(orders), front)

        if not self.cut_short:
            self.cut_short = run_orders(
                search_worker,
                self.brief.seed,
                [one for one in orders if one.name not in kept],
                self.workers,
                begin=lambda order, _busy: order,
                take=take,
            )
        self.evaluations += sum(one.evaluations for one in made.values())
        return made

    def onward(
        self, cell: Cell, alone: Mapping[str, Found], evaluations: int
    ) -> SearchOrder | None:
        """The search of a cell from the best of its own and its neighbours' results."""
        best: tuple[float, Cell, Array] | None = None
        for fewer in (
            cell,
            replace(cell, landmarks=cell.landmarks - 1),
            replace(cell, vehicles=cell.vehicles - 1),
        ):
            for alternate in (False, True):
                other = replace(fewer, alternate=alternate)
                known = alone.get(f"alone {_named(other)}")
                if known is not None and (best is None or known.value < best[0]):
                    best = known.value, other, known.point
        if best is None:
            return None
        _, other, point = best
        own = replace(cell, alternate=other.alternate)
        if other != own:
            point = Space(self.brief, own).extended(point, other, self.brief.seed)
        return SearchOrder(f"onward {_named(own)}", self.brief, own, evaluations, point)

    # --- judgement --------------------------------------------------------------------------------

    def concluded(self, front: list[FrontCell]) -> Design:
        """The cheapest cell that meets the brief, or the best of all."""
        fitting = [one for one in front if one.found.fits]
        nearly = [one for one in fitting if one.found.value <= NEARLY * self.wanted]
        judged: list[Judgement] = []
        for one in sorted(nearly, key=lambda one: (one.cost, one.found.value))[:MOST_TRIED]:
            judged.append(self.judged(one))
            if not judged[-1].binding:
                return self.result("met", judged[-1], "", front, ())
        if not judged and fitting:
            judged.append(self.judged(min(fitting, key=lambda one: one.found.value)))
        best = min(judged, key=lambda one: one.worst, default=None)
        if best is None:
            return self.result("not_found", None, self.fault(front), front, ())
        return self.result("not_found", best, best.binding, front, self.purchases(best, front))

    def result(
        self,
        status: Status,
        best: Judgement | None,
        binding: str,
        front: list[FrontCell],
        purchases: tuple[Purchase, ...],
    ) -> Design:
        """The result with these findings."""
        return Design(
            self.brief,
            status,
            None,
            best,
            binding,
            tuple(front),
            purchases,
            self.evaluations,
            self.cut_short,
        )

    def fault(self, front: list[FrontCell]) -> str:
        """The largest fault of the formation that comes nearest to having none."""
        if not front:
            return "error"
        one = min(front, key=lambda one: one.found.value)
        faults = Space(self.brief, one.cell).faults(one.found.point)
        return max(faults, key=lambda name: faults[name])

    def judged(self, one: FrontCell) -> Judgement:
        """Refine a formation and judge it by the exact code, in the order of what that costs."""
        brief, need, space = self.brief, self.brief.need, Space(self.brief, one.cell)
        made = space.plan(one.found.point)
        if not self.cut_short:
            made = refined(space, made)
        circles = made.orbits.centers, made.orbits.radii
        judged = Judgement(one.cell, made, covered=space.measure.covered(*circles))
        if not made.observable:
            return replace(judged, binding="rank")
        if not made.verdict.go:
            return replace(judged, binding=made.verdict.stops[0].code)
        if not space.measure.served(*circles):
            return replace(judged, binding="area")
        if judged.worst > self.wanted:
            return replace(judged, binding="error")
        if need.losses:
            left = [item.worst_predicted_rms for item in what_if(made).losses]
            if any(worst is None or worst > need.worst_rms_m for worst in left):
                return replace(judged, binding="losses")
        if self.cut_short:
            return replace(judged, binding="time")
        checked = validate(made, trials=TRIALS, seed=brief.seed)
        judged = replace(judged, validation=checked)
        if float(checked.accuracy.late_position.max()) > need.worst_rms_m:
            return replace(judged, binding="filter")
        flown = fly(made, trials=TRIALS, seed=brief.seed)
        judged = replace(judged, plan=flown.plan, flight=flown)
        if float(flown.accuracy.late_position.max()) > need.worst_rms_m:
            return replace(judged, binding="flight")
        if not flown.plan.verdict.go:
            return replace(judged, binding=flown.plan.verdict.stops[0].code)
        return judged

    def purchases(self, best: Judgement, front: list[FrontCell]) -> tuple[Purchase, ...]:
        """What each offer brings to the best formation, searched anew and refined, best first."""
        if self.cut_short:
            return ()
        (one,) = (one for one in front if one.cell == best.cell)
        offers = {}
        for number, offer in enumerate(offers_for(self.brief, one.cell)):
            point = one.found.point
            if offer.cell != one.cell:
                space = Space(offer.brief, offer.cell)
                point = space.extended(point, one.cell, self.brief.seed)
            budget = EVALUATIONS[self.brief.effort] // 2
            order = SearchOrder(f"purchase {number}", offer.brief, offer.cell, budget, point)
            offers[order.name] = offer, order
        found = self.found([order for _, order in offers.values()])
        made = []
        for name, (offer, _) in offers.items():
            if name in found and found[name].fits:
                space = Space(offer.brief, offer.cell)
                rms = refined(space, space.plan(found[name].point)).prediction.rms
                if rms is not None:
                    worst = float(rms.max())
                    made.append(Purchase(offer.words, offer.cost, worst, worst <= self.wanted))
        return tuple(sorted(made, key=lambda one: one.worst))


def refined(space: Space, made: Plan) -> Plan:
    """Return a plan of a space with better phases and centres, or phases alone.

    It serves the purpose still. A plan that is not GO is returned as it is.
    """
    if not made.verdict.go:
        return made
    for vary, box in ((["phases", "centers"], BOX_M), (["phases"], None)):
        better = refine(
            made,
            objective="worst_predicted_rms",
            vary=vary,
            center_box_m=box,
            starts=1,
            time_limit_s=REFINEMENT_S,
            seed=space.brief.seed,
            workers=1,
        )
        if space.measure.served(better.orbits.centers, better.orbits.radii):
            return better
    return made


def _cost(brief: Brief, cell: Cell) -> float:
    return cell.vehicles * brief.prefer.vehicle + cell.landmarks * brief.prefer.landmark


def _named(cell: Cell) -> str:
    return f"{cell.vehicles} {cell.landmarks} {'alternate' if cell.alternate else 'same'}"
