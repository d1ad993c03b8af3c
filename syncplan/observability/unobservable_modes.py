"""Named unobservable directions: the vehicles that can move undetected, how, and the cure.

The null space of the windowed matrix is matched against motions that have a name, simplest first:
a shift or turn of vehicles that nothing ties to the ground, a turn about the only landmark seen,
a stretch along lines of sight that never turn. Any other direction is described by the vehicles
that move most, also where a motion that has a name comes close to it but still changes sightings.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.rank import Assessment, LinkInformation, lone_rows, reduced_blocks
from syncplan.observability.spectrum import RANK_TOLERANCE, sparse_matrix
from syncplan.orbits.circles import Orbits, perpendicular, position, unit
from syncplan.orbits.contacts import circle_gaps
from syncplan.orbits.graphs import components
from syncplan.orbits.sight_lines import obstructible
from syncplan.orbits.team import Team
from syncplan.phrases import joined


@dataclass(frozen=True, slots=True)
class UnobservableMode:
    """Motion of the team that changes no sighting.

    Attributes
    ----------
    description : in words
    vehicles : indices of the vehicles that move
    motion : (n, 3) m, m, rad of each vehicle's (x, y, heading) at time 0, the largest
        displacement being 1 m (or the largest turn 1 rad where none is displaced)
    remedy : what would make it observable
    desync : rad, orbit.desync_rad that cures it; 0 if that is no cure
    """

    description: str
    vehicles: tuple[int, ...]
    motion: Array
    remedy: str
    desync: float = 0.0

    @property
    def cure(self) -> str:
        """The remedy, with the keys that bring it about."""
        return f"{self.remedy}: {turning_cure(self.desync)}" if self.desync else self.remedy


@dataclass(frozen=True, slots=True)
class _Naming:
    """Team with the other data needed to name its modes."""

    team: Team
    places: Array  # (n, 2) m, at time 0
    names: list[str]
    landmark_names: list[str]
    links: list[LinkInformation]
    scale: float

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return self.team.count


@dataclass(frozen=True, slots=True)
class _Candidate:
    description: str
    vector: Array  # (3 n,) scaled columns
    cure: Callable[[], str]
    desync: float = 0.0


DESYNC_RAD = 0.2
"""Offset from the rule that makes a line of sight turn enough, at little cost in range."""

MATCH_TOLERANCE = 1e-3
"""Share of a named motion that may lie outside the null space."""

MOST_MOTIONS = 100_000
"""Number of vehicles' motions, over all modes, after which no further mode is named."""

_SAME_DIRECTION_RAD = 1e-4
_MOVES = 1e-3


def name_modes(
    assessed: Assessment, names: list[str], landmark_names: list[str]
) -> list[UnobservableMode]:
    """Return a named mode for each dimension of the null space, the simplest first.

    The windowed matrix M bears out each name: |M v| / |v| of its motion v is no more than the
    singular values that do not count. In large teams, no more are named once they move MOST_MOTIONS
    vehicles in all.
    """
    team, result = assessed.team, assessed.observability
    null_space, missing = result.null_space, len(result.null_space)
    if missing == 0:
        return []
    blocks = reduced_blocks(assessed.information, team.count, lone_rows(team, assessed.sightings))
    matrix = sparse_matrix(blocks, result.state_dim)
    places = position(team.orbits, 0.0)
    naming = _Naming(team, places, names, landmark_names, assessed.information, result.scale)
    chosen: list[_Candidate] = []
    basis = np.zeros((0, result.state_dim))
    motions = 0
    for candidate in _candidates(naming):
        if len(chosen) == missing or motions > MOST_MOTIONS:
            break
        vector = candidate.vector / np.linalg.norm(candidate.vector)
        moving = np.flatnonzero(vector)
        parts = null_space[:, moving] @ vector[moving]
        if 1.0 - parts @ parts > MATCH_TOLERANCE**2:
            continue
        # what lies outside may be small, and still be sighted sharply
        if np.linalg.norm(matrix @ vector) > RANK_TOLERANCE * assessed.largest:
            continue
        inside = null_space.T @ parts
        new = inside - basis.T @ (basis @ inside)
        if np.linalg.norm(new) > 10.0 * MATCH_TOLERANCE:
            chosen.append(candidate)
            motions += len(moving) // 3 + 1
            basis = np.vstack([basis, new / np.linalg.norm(new)])
    if len(chosen) < missing and motions <= MOST_MOTIONS:
        most = 1 + (MOST_MOTIONS - motions) // team.count
        for vector in _left_over(null_space, basis)[:most]:
            chosen.append(_joint_mode(naming, vector))
    return [_mode(naming, candidate) for candidate in chosen]


def turning_cure(desync: float) -> str:
    """Return the cures of a line of sight that never turns; offsets of `desync` rad turn it."""
    return f"a small desynchronisation by orbit.desync_rad {desync:g}, unequal radii, or refinement"


def lost_bearings(orbits: Orbits, links: Sequence[LinkInformation]) -> list[float | None]:
    """Return the direction in [0, pi) rad along which each vehicle link's distance is lost.

    A link of rank 2 loses one motion besides those of both vehicles together. If that is a relative
    translation, this is its direction; None if it is a turn, or if the rank is another.
    """
    found: list[float | None] = [None] * len(links)
    short = [k for k, link in enumerate(links) if link.rank == 2]
    if not short:
        return found
    ends = np.array([(links[k].a, links[k].b) for k in short])
    places = orbits.centers[ends] + orbits.radii[ends, None] * unit(orbits.phases[ends])
    places /= orbits.radii.mean()
    turns = perpendicular(places)
    # two shifts and a turn of both together, then what the sightings hold
    rows = np.zeros((len(short), 5, 6))
    rows[:, :2, :2] = rows[:, :2, 3:5] = np.eye(2)
    rows[:, 2, :2], rows[:, 2, 3:5], rows[:, 2, 2::3] = turns[:, 0], turns[:, 1], 1.0
    rows[:, 3:] = [links[k].directions[:2] for k in short]
    lost = np.linalg.qr(rows.transpose(0, 2, 1), mode="complete")[0][:, :, 5]
    shifts = lost[:, 3:5] - lost[:, :2] - (turns[:, 1] - turns[:, 0]) * lost[:, 2:3]
    turned = np.abs(lost[:, 5] - lost[:, 2]) > 1e-4 * np.hypot(*shifts.T)
    bearings = np.arctan2(shifts[:, 1], shifts[:, 0]) % np.pi
    for k in np.flatnonzero(~turned).tolist():
        found[short[k]] = float(bearings[k])
    return found


def _candidates(naming: _Naming) -> Iterator[_Candidate]:
    """Yield the motions that have a name, simplest first."""
    count = naming.count
    seen = [(link.a, link.b) for link in naming.links if link.b < count]
    rigid = [(link.a, link.b) for link in naming.links if link.b < count and link.rank >= 3]
    held: dict[int, set[int]] = {k: set() for k in range(count)}
    for link in naming.links:
        if link.b >= count:
            held[link.a].add(link.b - count)
    whole, parts = components(count, seen), components(count, rigid)
    known = {tuple(part) for part in whole}
    parts = [part for part in parts if tuple(part) not in known]
    known.update(map(tuple, parts))
    parts += [[k] for k in range(count) if (k,) not in known]
    for part in whole:
        yield from _rigid_modes(naming, part, held)
    yield from _stretches(naming, held)
    for part in parts:
        yield from _rigid_modes(naming, part, held)


def _rigid_modes(naming: _Naming, part: list[int], held: dict[int, set[int]]) -> list[_Candidate]:
    anchors = sorted(set().union(*(held[k] for k in part)))
    turns = [_turn_about(naming, part, landmark) for landmark in anchors]
    return turns if anchors else _free_modes(naming, part)


def _free_modes(naming: _Naming, part: list[int]) -> list[_Candidate]:
    who = _who(naming, part)
    compasses = np.isfinite(naming.team.sensors.compass_sigmas[part])
    wanted = "a landmark" if compasses.any() else "two landmarks"
    cure = partial(_grounding, naming, part, f"sightings of {wanted}")
    shifts = [
        _Candidate(f"shift of {who} along {axis}", _shift(naming, part, angle), cure)
        for axis, angle in (("x", 0.0), ("y", np.pi / 2.0))
    ]
    middle = naming.places[part].mean(axis=0)
    about = "its middle" if len(part) == naming.count else "their middle"
    about = "itself" if len(part) == 1 else about
    return [*shifts, _Candidate(f"turn of {who} about {about}", _turn(naming, part, middle), cure)]


def _turn_about(naming: _Naming, part: list[int], landmark: int) -> _Candidate:
    name = naming.landmark_names[landmark]
    return _Candidate(
        f"turn of {_who(naming, part)} about {name}",
        _turn(naming, part, naming.team.landmarks[landmark]),
        partial(_grounding, naming, part, f"a sighting of a landmark other than {name}", landmark),
    )


_MOST_NAMED = 6


def _stretches(naming: _Naming, held: dict[int, set[int]]) -> list[_Candidate]:
    """Shifts along lines of sight that never turn, one direction at a time."""
    count = naming.count
    links = [link for link in naming.links if link.b < count]
    bearings = lost_bearings(naming.team.orbits, links)
    lost = [(one, link) for one, link in zip(bearings, links, strict=True) if one is not None]
    found = []
    while lost:
        bearing = lost[0][0]
        along = [item for item in lost if _parallel(item[0], bearing)]
        lost = [item for item in lost if not _parallel(item[0], bearing)]
        stretched = {(link.a, link.b) for _, link in along}
        kept = [(link.a, link.b) for link in links if (link.a, link.b) not in stretched]
        for part in components(count, kept):
            if not any(held[k] for k in part):
                found.append(_stretch(naming, part, bearing, [link for _, link in along]))
    return sorted(found, key=lambda item: int(np.count_nonzero(item.vector)))


def _stretch(
    naming: _Naming, part: list[int], bearing: float, links: list[LinkInformation]
) -> _Candidate:
    inside = set(part)
    cut = [link for link in links if (link.a in inside) != (link.b in inside)]
    pairs = ", ".join(
        f"{naming.names[link.a]}-{naming.names[link.b]}" for link in cut[:_MOST_NAMED]
    )
    degrees = round(float(np.degrees(bearing)), 1) % 180.0  # either way along the same line
    return _Candidate(
        f"stretch of {pairs or 'links'} along {degrees:.1f} deg: "
        f"{_who(naming, part)} shift{'s' if len(part) == 1 else ''}",
        _shift(naming, part, bearing),
        lambda: f"let the line of sight of {pairs or 'these links'} turn",
        desync=DESYNC_RAD,
    )


def _grounding(
    naming: _Naming, part: list[int], wanted: str, passed_over: int | None = None
) -> str:
    """Remedy for floating vehicles: landmarks and how near they are, and the nearest vehicle."""
    choices = []
    for number, place in enumerate(naming.team.landmarks):
        if number != passed_over:
            gap, k = _nearest_to(naming, np.array(part), place)
            who, what = naming.names[k], naming.landmark_names[number]
            beyond = _beyond(naming, gap, k, naming.count + number)
            choices.append(f"{who} passes {what} at {beyond}")
    text = wanted + (f" ({'; '.join(choices[:2])})" if choices else "")
    others = np.setdiff1d(np.arange(naming.count), part)
    if len(others):
        gap, a, b = _nearest_pair(naming, np.array(part), others)
        text += (
            f", or a rank-3 link to a located vehicle "
            f"({naming.names[a]} and {naming.names[b]} can pass at {_beyond(naming, gap, a, b)})"
        )
    return text


def _nearest_pair(naming: _Naming, part: Index, others: Index) -> tuple[float, int, int]:
    """Least gap in m between circles of a part and of others, and the two vehicles."""
    orbits, nearest = naming.team.orbits, []
    for a in part.tolist():
        pairs = np.column_stack([np.full(len(others), a), others])
        gaps = np.maximum(circle_gaps(orbits.centers, orbits.radii, pairs), 0.0)
        k = int(np.argmin(gaps))
        nearest.append((float(gaps[k]), a, int(others[k])))
    return min(nearest)


def _nearest_to(naming: _Naming, part: Index, place: Array) -> tuple[float, int]:
    """Least gap in m between circles of a part and a place, and the vehicle."""
    orbits = naming.team.orbits
    gaps = np.abs(np.hypot(*(orbits.centers[part] - place).T) - orbits.radii[part])
    k = int(np.argmin(gaps))
    return float(gaps[k]), int(part[k])


def _beyond(naming: _Naming, gap: float, vehicle: int, body: int) -> str:
    excess = gap - float(naming.team.sensors.ranges[vehicle])
    within = f"{gap:.3g} m, {f'{excess:.3g} m out of' if excess > 0.0 else 'within'} range"
    hindered = obstructible(naming.team, np.array([vehicle]), np.array([body]))[0]
    return f"{within}, with an obstacle nearby" if hindered else within


def _left_over(null_space: Array, basis: Array) -> Array:
    """Orthonormal null vectors that the named motions do not span."""
    rest = null_space - (null_space @ basis.T) @ basis
    _, _, vectors = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(vectors[: len(null_space) - len(basis)])


def _joint_mode(naming: _Naming, vector: Array) -> _Candidate:
    motion = _scaled(naming, vector)
    size = np.hypot(motion[:, 0], motion[:, 1])
    order = [k for k in np.argsort(-size, kind="stable") if size[k] > _MOVES][:3]
    parts = [
        f"{naming.names[k]} {size[k]:.2f} m toward "
        f"{np.degrees(np.arctan2(motion[k, 1], motion[k, 0])):.0f} deg"
        for k in order
    ]
    turns = [k for k in range(len(motion)) if k not in order and abs(motion[k, 2]) > _MOVES][:3]
    parts += [f"{naming.names[k]} turning {np.degrees(motion[k, 2]):.1f} deg" for k in turns]
    return _Candidate(
        f"joint motion: {', '.join(parts)}",
        vector,
        lambda: (
            "more sightings between these vehicles and others: a longer range or window, another "
            "link, or refinement"
        ),
    )


def _mode(naming: _Naming, candidate: _Candidate) -> UnobservableMode:
    motion = _scaled(naming, candidate.vector)
    moving = np.flatnonzero(np.max(np.abs(motion), axis=1) > _MOVES)
    return UnobservableMode(
        candidate.description,
        tuple(int(k) for k in moving),
        motion,
        candidate.cure(),
        candidate.desync,
    )


def _scaled(naming: _Naming, vector: Array) -> Array:
    """Motion (n, 3) in m and rad, scaled to a largest displacement of 1 m, or turn of 1 rad."""
    motion = vector.reshape(-1, 3) * np.array([naming.scale, naming.scale, 1.0])
    largest = np.max(np.hypot(motion[:, 0], motion[:, 1]))
    if largest < 1e-9 * naming.scale:
        largest = np.max(np.abs(motion[:, 2]))
    return np.asarray(motion / largest)


def _shift(naming: _Naming, part: list[int], angle: float) -> Array:
    vector = np.zeros((naming.count, 3))
    vector[part, :2] = unit(angle)
    return vector.ravel()


def _turn(naming: _Naming, part: list[int], pivot: Array) -> Array:
    vector = np.zeros((naming.count, 3))
    vector[part, :2] = perpendicular(naming.places[part] - pivot) / naming.scale
    vector[part, 2] = 1.0
    return vector.ravel()


def _who(naming: _Naming, part: list[int]) -> str:
    if len(part) == naming.count and len(part) > 1:
        return "everything"
    return joined([naming.names[k] for k in part], _MOST_NAMED)


def _parallel(a: float, b: float) -> bool:
    turn = abs(a - b) % np.pi
    return min(turn, np.pi - turn) < _SAME_DIRECTION_RAD
