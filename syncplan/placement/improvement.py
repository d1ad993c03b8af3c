"""Improvement of drawings by sequential convex programming.

Each round solves a QP about the present drawing that prices every shortfall. The step is taken only
if the true, curved merit improves too, and the trust region follows how well the two agree (Nocedal
and Wright, Numerical Optimization, chapter 18).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import turned
from syncplan.orbits.contacts import outer_gaps
from syncplan.placement.drawing import Demands, Drawing, draw, others
from syncplan.runtime.machine import has_solution, load_cvxpy

# --- the quadratic program of one step ------------------------------------------------------------
#
# Constraints on the steps of all centres, within a trust region about the present drawing:
#
#     apart       u . (c_a - c_b) >= R_a + R_b + gap      u the present direction: never too lenient
#     linked      f . (c_a - c_b) <= R_a + R_b + gap      f = u, and u turned a little each way
#     landmark    as linked, about a fixed point
#     area        n . (c - q) >= R                        q the nearest point of an edge, n from it
#
# A polygon's edge lies beyond the line through its point nearest the centre, so the last holds for
# convex corners and others alike.
#
# Every constraint may be violated at a price, so that any drawing has a step.


@dataclass(frozen=True, slots=True)
class LayoutQP:
    """Compiled QP, with lengths in typical distances of linked centres.

    Attributes
    ----------
    problem : cvxpy problem
    steps : variable (n, 2), steps of the centres
    parameters : parameters by name, see set_parameters
    free : (p, 2) unlinked pairs that have rows
    """

    problem: Any
    steps: Any
    parameters: dict[str, Any]
    free: Index


PRICE = 50.0
"""Price of missing a link by a typical distance."""

FIRM = 3.0
"""Price of other shortfalls relative to links, so that infeasibility shows in the links."""

APART_WEIGHT = 0.1
"""Weight of the target distances of unlinked circles and landmarks, relative to those of links."""


def compile_qp(demands: Demands, free: Index) -> LayoutQP:
    """Compile the QP for the links and the unlinked pairs `free`."""
    cp = load_cvxpy()
    from scipy import sparse

    n, e, p = demands.count, len(demands.links), len(free)
    holds = _holds(demands)
    given = _parameters(demands, p, holds)

    # Variables
    step = cp.Variable((n, 2))

    def along(name: str, matrix: Any) -> Any:
        return cp.sum(cp.multiply(given[name], matrix @ step), axis=1)

    # Objective and constraints
    cost = 1e-4 * cp.sum_squares(step)
    limits = [step <= given["trust"], step >= -given["trust"]]
    if e:
        linked = _differences(demands.links, n)
        over, under, off = cp.Variable(e, nonneg=True), cp.Variable(e, nonneg=True), cp.Variable(e)
        limits += [
            along(name, linked) <= given[f"{name}_limit"] + over
            for name in ("link", "link_left", "link_right")
        ]
        limits += [along("link", linked) + under >= given["link_least"]]
        limits += [off == along("link", linked) - given["link_wanted"]]
        cost += cp.sum_squares(off) + PRICE * (cp.sum(over) + FIRM * cp.sum(under))
    if p:
        crossing, close = cp.Variable(p, nonneg=True), cp.Variable(p, nonneg=True)
        stretch = along("free", _differences(free, n))
        limits += [
            stretch + crossing >= given["free_limit"],
            stretch + close >= given["free_wanted"],
        ]
        cost += APART_WEIGHT * cp.sum_squares(close) + FIRM * PRICE * cp.sum(crossing)
    for name, size in holds.items():
        each = sparse.vstack([sparse.identity(n)] * (size // n), format="csr")
        miss = cp.Variable(size, nonneg=True)
        limits += [along(name, each) + miss >= given[f"{name}_limit"]]
        cost += FIRM * PRICE * cp.sum(miss)
        if name == "mark":
            cost += APART_WEIGHT * cp.sum_squares(along(name, each) - given["mark_wanted"])
    return LayoutQP(cp.Problem(cp.Minimize(cost), limits), step, given, free)


_EDGES = 6
"""Largest number of polygon edges that limit a circle at a time."""


def _holds(demands: Demands) -> dict[str, int]:
    """Number of rows of each kind that limits single circles, equally many for every circle."""
    n = demands.count
    holds = {"edge": n * min(_EDGES, len(demands.area.edges()))}
    if len(demands.landmarks):
        holds |= {"mark": 2 * n, "mark_left": 2 * n, "mark_right": 2 * n, "mark_in": 2 * n}
    return {name: size for name, size in holds.items() if size}


def _parameters(demands: Demands, free: int, holds: dict[str, int]) -> dict[str, Any]:
    """Directions (k, 2) and limits (k,) of every kind of row, and the trust region."""
    cp = load_cvxpy()
    e = len(demands.links)
    sizes = {"link": e, "link_left": e, "link_right": e, "free": free, **holds}
    sizes = {name: size for name, size in sizes.items() if size}
    given = {name: cp.Parameter((size, 2)) for name, size in sizes.items()}
    given |= {f"{name}_limit": cp.Parameter(size) for name, size in sizes.items()}
    for name in ("link", "free", "mark"):
        if name in sizes:
            given[f"{name}_wanted"] = cp.Parameter(sizes[name])
    if e:
        given["link_least"] = cp.Parameter(e)
    given["trust"] = cp.Parameter(nonneg=True)
    return given


def _differences(pairs: Index, count: int) -> Any:
    """Sparse (p, n) matrix that subtracts the second of each pair from the first."""
    from scipy import sparse

    rows, ones = np.arange(len(pairs)), np.ones(len(pairs))
    first = sparse.csr_matrix((ones, (rows, pairs[:, 0])), (len(pairs), count))
    return first - sparse.csr_matrix((ones, (rows, pairs[:, 1])), (len(pairs), count))


def solved(qp: LayoutQP) -> tuple[Array | None, float]:
    """Return the steps (n, 2) in units, None if the solver failed, and their predicted merit."""
    settings = {
        "solver": "OSQP",
        "warm_start": False,
        "eps_abs": 1e-5,
        "eps_rel": 1e-5,
        "max_iter": 4000,
        "polishing": True,
        "adaptive_rho_interval": 50,
    }
    if not has_solution(qp.problem, **settings):
        return None, np.inf
    return np.asarray(qp.steps.value, dtype=float), float(qp.problem.value)


_FACET = 0.3
"""Turn of the outer facets of a link, rad."""


_SAFETY = 1e-3
"""Share of the play of a link by which the QP stays within its limits."""


def set_parameters(qp: LayoutQP, drawing: Drawing, trust: float) -> None:
    """Set the parameters of the QP about the present drawing."""
    demands, centers = drawing.demands, drawing.centers
    values: dict[str, Any] = {"trust": trust}
    radii, links, free = demands.radii, demands.links, qp.free
    if len(links):
        base = radii[links].sum(axis=1)
        safety = _SAFETY * np.maximum(demands.most - demands.least, 0.0)
        apart, direction = _directions(centers[links[:, 0]] - centers[links[:, 1]])
        values["link_least"] = base + demands.least + safety - apart
        values["link_wanted"] = base + demands.wanted - apart
        for name, turn in (("link", 0.0), ("link_left", _FACET), ("link_right", -_FACET)):
            values[name] = turned(direction, turn)
            values[f"{name}_limit"] = base + demands.most - safety - apart * np.cos(turn)
    if len(free):
        base = radii[free].sum(axis=1)
        apart, values["free"] = _directions(centers[free[:, 0]] - centers[free[:, 1]])
        safety = np.full(len(free), _SAFETY * (demands.apart - demands.least))
        values["free_limit"] = base + demands.least + safety - apart
        values["free_wanted"] = base + demands.apart - apart
    if len(demands.landmarks):
        values |= _landmark_limits(drawing)
    if demands.area.limited:
        values["edge"], values["edge_limit"] = _edge_limits(drawing)
    lengths = {name for name in values if name.endswith(("_limit", "_least", "_wanted"))}
    for name, value in values.items():
        qp.parameters[name].value = value / demands.unit if name in lengths else value


def _landmark_limits(drawing: Drawing) -> dict[str, Array]:
    """Rows for at most two landmarks per vehicle; rows of zeros where there are fewer."""
    demands, chosen = drawing.demands, drawing.sightings
    n = demands.count
    slots: list[int] = []
    for k, (vehicle, _) in enumerate(chosen.tolist()):
        slots.append(vehicle + n * int(np.count_nonzero(chosen[:k, 0] == vehicle)))
    vehicle, landmark = chosen.T
    apart, direction = _directions(demands.landmarks[landmark] - drawing.centers[vehicle])
    radius, sight = demands.radii[vehicle], demands.sight[vehicle] * (1.0 - _SAFETY)
    values: dict[str, Array] = {}

    def put(name: str, rows: Array) -> None:
        values[name] = np.zeros((2 * n, *rows.shape[1:]))
        values[name][slots] = rows

    for name, turn in (("mark", 0.0), ("mark_left", _FACET), ("mark_right", -_FACET)):
        put(name, turned(direction, turn))
        put(f"{name}_limit", apart * np.cos(turn) - (radius + sight))
    put("mark_wanted", apart - (radius + 0.5 * sight))
    put("mark_in", -direction)
    put("mark_in_limit", radius - sight - apart)
    return values


def _edge_limits(drawing: Drawing) -> tuple[Array, Array]:
    """Normals (k n, 2) of k edges, and how far (k n,) m each circle must still move along them."""
    demands, centers = drawing.demands, drawing.centers
    edges = demands.area.edges()
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    offset = centers[:, None] - start[None]
    share = np.clip(np.sum(offset * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
    away, normal = _directions(offset - share[..., None] * along)
    wrong = demands.area.clearances(centers, np.zeros(demands.count)) < 0.0
    nearest = np.argsort(away, axis=1, kind="stable")[:, : min(_EDGES, len(edges))]
    rows = np.arange(demands.count)[:, None]
    normal, away = normal[rows, nearest], away[rows, nearest]
    # On the wrong side: move back through the nearest edge; no other edge counts.
    normal[wrong, 0] *= -1.0
    away[wrong, 0] *= -1.0
    normal[wrong, 1:] = 0.0
    limit = demands.radii[:, None] * (1.0 + demands.room) - away
    limit[wrong, 1:] = 0.0
    return normal.transpose(1, 0, 2).reshape(-1, 2), limit.T.reshape(-1)


def _directions(vectors: Array) -> tuple[Array, Array]:
    """Lengths and unit vectors of `vectors` (..., 2) m; +x where the length is zero."""
    length = np.hypot(vectors[..., 0], vectors[..., 1])
    safe = np.where(length > 0.0, length, 1.0)[..., None]
    return length, np.where(length[..., None] > 0.0, vectors / safe, np.array([1.0, 0.0]))


# --- steps ----------------------------------------------------------------------------------------


_ALL_PAIRS = 40
"""Number of circles up to which every pair is in the QP; above it, only pairs nearby."""

_NEARBY = 1.5
"""Excess over the target gap, in typical distances, up to which a pair is nearby."""

_TRUST = 0.5
_LEAST_TRUST = 1e-6
_PERFECT = 0.01
"""Charge for each circle below which a drawing is as good as perfect."""

_PATIENCE = {True: 2, False: 5}
"""Rounds of hardly any gain after which to stop, by whether all demands are met."""


def improved(drawing: Drawing, *, rounds: int = 100, accuracy: float = 1e-3) -> Drawing:
    """Return a drawing no worse than the given one.

    Ends after several rounds in a row that gain less than `accuracy` of the remaining charge, more
    of them while demands are unmet, or when no step helps.
    """
    demands, unit = drawing.demands, drawing.demands.unit
    worth = _merit(drawing)
    trust, done, stalled = _TRUST, 0, 0
    qp: LayoutQP | None = None
    while (
        done < rounds and trust >= _LEAST_TRUST and stalled < _PATIENCE[drawing.missed.total == 0.0]
    ):
        done += 1
        if qp is None or _strangers_near(drawing, qp.free, trust * unit):
            qp = compile_qp(demands, _near(drawing, _NEARBY * unit))
        set_parameters(qp, drawing, trust)
        step, promised = solved(qp)
        if step is None:
            trust *= 0.25
            continue
        tried = draw(demands, drawing.centers + unit * step)
        value = _merit(tried)
        gain, hoped = worth - value, worth - promised
        enough = accuracy * (worth + _PERFECT * demands.count)
        stalled = stalled + 1 if max(gain, hoped) < enough else 0
        if gain > 0.05 * hoped and gain > 0.0:
            drawing, worth = tried, value
            trust = min(2.0 * trust, _TRUST) if gain > 0.5 * hoped else trust
        else:
            trust = 0.35 * min(trust, max(float(np.max(np.abs(step))), 1e-9))
    return replace(drawing, rounds=done)


def _merit(drawing: Drawing) -> float:
    """Merit of a drawing from its true, curved shortfalls, in typical distances; 0 is perfect."""
    demands, missed = drawing.demands, drawing.missed
    unit = demands.unit
    free = others(demands.count, demands.links)
    near = demands.apart - outer_gaps(drawing.centers, demands.radii, free)
    vehicle = drawing.sightings[:, 0]
    aim = demands.radii[vehicle] + 0.5 * demands.sight[vehicle]
    soft = (
        np.sum((drawing.link_gaps - demands.wanted) ** 2)
        + APART_WEIGHT * np.sum(np.maximum(near, 0.0) ** 2)
        + APART_WEIGHT * np.sum((drawing.sighted_from - aim) ** 2)
    )
    firm = missed.total - float(missed.links.sum())
    price = PRICE * (float(missed.links.sum()) + FIRM * firm)
    return float(soft) / unit**2 + price / unit


# --- pairs in the QP ------------------------------------------------------------------------------


def _near(drawing: Drawing, allowance: float) -> Index:
    """Unlinked pairs within `allowance` m of their target gap; all of them in a small team."""
    demands = drawing.demands
    free = others(demands.count, demands.links)
    if demands.count <= _ALL_PAIRS:
        return free
    return free[outer_gaps(drawing.centers, demands.radii, free) < demands.apart + allowance]


def _strangers_near(drawing: Drawing, known: Index, trust: float) -> bool:
    """Whether a pair that is not in the QP could cross within one step."""
    demands = drawing.demands
    if demands.count <= _ALL_PAIRS:
        return False
    free = others(demands.count, demands.links)
    inside = np.isin(free @ [demands.count, 1], known @ [demands.count, 1])
    reach = demands.least + 2.0 * np.sqrt(2.0) * trust
    return bool(np.any(outer_gaps(drawing.centers, demands.radii, free[~inside]) < reach))
