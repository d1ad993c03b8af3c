"""Joint observability of poses and bias states in one window, undetermined directions named."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.observability.multifrontal import Block, dissected
from syncplan.observability.rank import Assessment, equal_runs
from syncplan.observability.referred_rows import SightingRows, state_rows
from syncplan.observability.spectrum import DENSE_STATES, Observability, observability_of
from syncplan.orbits.circles import perpendicular, position
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from syncplan.phrases import joined
from syncplan.scenario.disturbances import ESTIMABLE, EstimableName

# --- rank -----------------------------------------------------------------------------------------
#
# The matrix is [P E]. P has the columns of the poses, as in syncplan.observability.rank, E those of
# the constant errors, each in units of the error's own sigma. The filter's prior on the errors is
# left out.
#
# Errors that vary have no column. They change at every sample, so within the window they act as
# correlated noise: gusts on the motion, bearing walks on the readings. Noise whose covariance has
# full rank weights the rows of [P E] but leaves their rank unchanged. A walk so slow that it is
# constant over the window is a bearing bias; state it as one to see what it hides.
#
# The team's rank, `observable` and the certificate remain those of P. With the priors, one row of I
# for each error, the matrix [P E; 0 I] has full rank exactly where P has: every error has a prior,
# so P alone decides whether a filter can estimate all states. The states that the null space of
# [P E] moves, poses included, rest on a prior.
#
# The rows of each pair are first reduced by QR to at most as many as the states that they depend
# on; this leaves the singular values unchanged.


MOVES = 1e-6
"""Largest motion of a determined state by any null vector of length 1.

Null vectors are accurate to about 1e-15 / RANK_TOLERANCE.
"""


@dataclass(frozen=True, slots=True)
class ExtendedObservability(Observability):
    """Observability of poses and constant errors.

    Attributes
    ----------
    layout : columns of the matrix: three per vehicle, then the errors
    """

    layout: StateLayout

    @property
    def determined(self) -> Flags:
        """(state_dim,) whether each state is determined, whatever the others are."""
        return np.asarray(np.sqrt(self.moved) <= MOVES)

    @property
    def poses_determined(self) -> bool:
        """Whether every position and heading is determined, whatever the errors are."""
        return bool(self.determined[: 3 * self.layout.count].all())


def assess_extended(
    assessed: Assessment, names: Sequence[str] | None = None
) -> ExtendedObservability | None:
    """Return the rank with constant errors as states; None if there are none.

    `names` selects the errors: by default those that the filter estimates, tuple(ERROR_STATES) for
    all that have a sigma.
    """
    team = assessed.team
    wanted = team.errors.estimated if names is None else names
    layout = layout_of(team, [name for name in wanted if ERROR_STATES[name].constant])
    if not layout.names:
        return None
    rows = state_rows(team, assessed.sightings, layout)
    blocks = _blocks(rows, assessed.sightings)
    parts = _parts(team, layout, assessed.sightings) if layout.size > DENSE_STATES else None
    found = observability_of(blocks, layout.size, assessed.observability.scale, parts)
    own = {field.name: getattr(found, field.name) for field in fields(found)}
    return ExtendedObservability(**own, layout=layout)


def _blocks(rows: SightingRows, sightings: Sightings) -> list[Block]:
    """Columns (c,) and reduced rows (r, c) of each pair."""
    low = np.minimum(sightings.observers, sightings.targets)
    high = np.maximum(sightings.observers, sightings.targets)
    order = np.lexsort((high, low))
    blocks = []
    for begin, end in equal_runs(low[order], high[order]):
        own = order[begin:end]
        columns, place = np.unique(rows.columns[own], return_inverse=True)
        block = np.zeros((len(own), len(columns)))
        number = np.arange(len(own))[:, None]
        np.add.at(block, (number, place.reshape(len(own), -1)), rows.entries[own])
        if len(block) > len(columns):
            block = np.asarray(np.linalg.qr(block, mode="r"))
        blocks.append((columns, block))
    return blocks


def _parts(team: Team, layout: StateLayout, sightings: Sightings) -> list[Index]:
    """Columns of each part of the dissected team; common errors are eliminated last."""
    own: list[list[int]] = [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(team.count)]
    common: set[int] = set()
    for name in layout.names:
        columns = layout.columns[name]
        if ERROR_STATES[name].common:
            common.update(columns[columns >= 0].tolist())
            continue
        for vehicle, places in enumerate(columns.tolist()):
            own[vehicle] += [column for column in places if column >= 0]
    seen = sightings.targets < team.count
    pairs = np.unique(np.column_stack([sightings.observers, sightings.targets])[seen], axis=0)
    parts = [
        np.concatenate([np.array(own[k]) for k in part.tolist()])
        for part in dissected(team.orbits.centers, pairs)
    ]
    return [*parts, np.array(sorted(common), dtype=np.int64)]


# --- names ----------------------------------------------------------------------------------------
#
# Motions that no sighting can detect even with all errors known, those of
# syncplan.observability.unobservable_modes, are removed from the null space of [P E]. One direction
# remains for each error too many, chosen so that each contains an error that the others lack. Such
# a direction may move poses too:
#
#     speed scales of v1, v3 and v5 against v2, v4 and v6, with a turn of the team
#
# A vehicle whose speed scale is c flies a circle that is larger by c; with its centre kept, it
# starts c times its radius further out. The rest of its motion is compared with shifts, turns and
# stretches of all the vehicles concerned.


MOST_NAMED = 6

_TAKES_PART = 1e-3
"""Share of a direction's largest error above which another error is named."""

_MATCHES = 1e-3
"""Share of the poses' motion that may deviate from the named motion."""


@dataclass(frozen=True, slots=True)
class ErrorMode:
    """Direction in which errors, possibly with poses, change without changing any sighting.

    Attributes
    ----------
    description : in words
    states : labels, in the layout, of the errors that change
    vehicles : indices of the vehicles whose errors or poses change
    moves_poses : whether some position or heading changes too
    cure : remedy that would determine the errors
    """

    description: str
    states: tuple[str, ...]
    vehicles: tuple[int, ...]
    moves_poses: bool
    cure: str


@dataclass(frozen=True, slots=True)
class ErrorVerdict:
    """Observability in one window of the errors that the filter estimates.

    Attributes
    ----------
    state_dim : number of pose coordinates and constant errors
    extended : rank with the errors as states; None if there are too many
    modes : one named mode for each dimension in which errors are undetermined
    """

    state_dim: int
    extended: ExtendedObservability | None
    modes: tuple[ErrorMode, ...] = ()


def judge_errors(
    assessed: Assessment, names: Sequence[str], most_states: int
) -> ErrorVerdict | None:
    """Return the verdict on the errors that the filter estimates; None if it estimates none.

    `names` are those of the vehicles. Above `most_states` states, the verdict has only their
    number.
    """
    team = assessed.team
    estimated = [name for name in team.errors.estimated if ERROR_STATES[name].constant]
    layout = layout_of(team, estimated)
    if not layout.names:
        return None
    extended = assess_extended(assessed) if layout.size <= most_states else None
    if extended is None:
        return ErrorVerdict(layout.size, None)
    directions = _directions(assessed.observability, extended)
    modes = tuple(_mode(team, extended, vector, names) for vector in directions)
    return ErrorVerdict(layout.size, extended, modes)


def _directions(poses: Observability, found: ExtendedObservability) -> Array:
    """Null vectors (k, size) besides those of the poses, each with an error that others lack.

    `poses` is the verdict with all errors known.
    """
    from scipy.linalg import qr

    if not len(found.null_space):
        return found.null_space
    size = 3 * found.layout.count
    alone = np.pad(poses.null_space, ((0, 0), (0, found.layout.sigmas.size)))
    rest = found.null_space - (found.null_space @ alone.T) @ alone
    _, values, vectors = np.linalg.svd(rest, full_matrices=False)
    kept = vectors[values > 0.5]
    if not len(kept):
        return kept
    errors = kept[:, size:]
    pivots = qr(errors, mode="r", pivoting=True)[1][: len(kept)]
    sparse = np.linalg.solve(errors[:, np.sort(pivots)], kept)
    return np.asarray(sparse / np.linalg.norm(sparse, axis=1)[:, None])


def _mode(
    team: Team, found: ExtendedObservability, vector: Array, names: Sequence[str]
) -> ErrorMode:
    layout, count = found.layout, found.layout.count
    errors = vector[3 * count :]
    takes = np.abs(errors) > _TAKES_PART * np.abs(errors).max()
    labels = layout.labels(names)
    motion = vector[: 3 * count].reshape(-1, 3)
    moving = np.abs(motion).max(axis=1) > MOVES
    own = np.zeros(count, dtype=bool)
    for columns in layout.columns.values():
        has = columns >= 0
        own |= (has & takes[np.where(has, columns - 3 * count, 0)]).any(axis=1)
    vehicles = np.flatnonzero(moving | own)
    *others, last = _trades(found, errors, takes, names)
    # lists of vehicles already contain an "and"
    description = f"{', '.join(others)}, and {last}" if others else last
    if moving.any():
        description += f", with {_motion_words(team, found, vector, vehicles, names)}"
    return ErrorMode(
        description=description,
        states=tuple(label for label, one in zip(labels, takes, strict=True) if one),
        vehicles=tuple(vehicles.tolist()),
        moves_poses=bool(moving.any()),
        cure=_cure(team, found, vector, takes),
    )


def _trades(
    found: ExtendedObservability, errors: Array, takes: Array, names: Sequence[str]
) -> list[str]:
    """Phrases for the errors that take part: vehicles whose error grows against the others."""
    layout, words = found.layout, []
    for name in layout.names:
        state, columns = ERROR_STATES[name], layout.columns[name] - 3 * layout.count
        what = name.replace("_", " ")
        if state.common:
            words += [
                " ".join(filter(None, [what, axis]))
                for axis, column in zip(state.axes, columns[0].tolist(), strict=True)
                if takes[column]
            ]
            continue
        part = [k for k in range(len(columns)) if columns[k, 0] >= 0 and takes[columns[k, 0]]]
        if not part:
            continue
        first = np.sign(errors[columns[part[0], 0]])
        sides = [
            joined([names[k] for k in part if np.sign(errors[columns[k, 0]]) == sign], MOST_NAMED)
            for sign in (first, -first)
        ]
        whose = " against ".join(filter(None, sides))
        plural = "es" if what.endswith("s") else "s"
        words.append(f"{what}{plural if len(part) > 1 else ''} of {whose}")
    return words


def _motion_words(
    team: Team, found: ExtendedObservability, vector: Array, vehicles: Index, names: Sequence[str]
) -> str:
    """Phrase for the motion of the poses, apart from the growth of their circles."""
    count, orbits = found.layout.count, team.orbits
    scale = float(orbits.radii.mean())
    places = position(orbits, 0.0)
    motion = vector[: 3 * count].reshape(-1, 3).copy()
    if "speed_scale" in found.layout.columns:
        columns = found.layout.columns["speed_scale"][:, 0]
        grown = np.where(columns >= 0, vector[columns] * team.errors.of("speed_scale"), 0.0)
        motion[:, :2] -= grown[:, None] * (places - orbits.centers) / scale
    named = np.zeros((4, len(vehicles), 3))
    named[0, :, 0] = named[1, :, 1] = 1.0
    named[2, :, :2] = perpendicular(places[vehicles] - places[vehicles].mean(axis=0)) / scale
    named[2, :, 2] = 1.0
    centers = orbits.centers[vehicles]
    named[3, :, :2] = (centers - centers.mean(axis=0)) / scale
    flat, seen = named.reshape(4, -1), motion[vehicles].ravel()
    shares = np.linalg.lstsq(flat.T, seen, rcond=None)[0]
    everyone = len(vehicles) == count > 1
    who = "the team" if everyone else joined([names[k] for k in vehicles], MOST_NAMED)
    size = np.linalg.norm(seen)
    if size <= MOVES or np.linalg.norm(seen - shares @ flat) > _MATCHES * size:
        return f"motions of {who}"
    takes = np.abs(shares[2:]) > _MATCHES * size
    words = [word for word, one in zip(("turn", "stretch"), takes, strict=True) if one]
    return f"a {' and '.join(words) or 'shift'} of {who}"


def _cure(team: Team, found: ExtendedObservability, vector: Array, takes: Array) -> str:
    """Remedy that would determine the errors; a compass where headings change with them."""
    layout, count = found.layout, found.layout.count
    kinds: list[EstimableName] = [
        name
        for name in ESTIMABLE
        if name in layout.columns
        and np.any(takes[layout.columns[name][layout.columns[name] >= 0] - 3 * count])
    ]
    turning = np.abs(vector[2 : 3 * count : 3])
    if "turn_rate_bias" in layout.columns:
        columns = layout.columns["turn_rate_bias"][:, 0]
        turning += np.where(columns >= 0, np.abs(vector[columns]), 0.0)
    keys = joined([ESTIMABLE[name] for name in kinds], MOST_NAMED)
    lacking = ~np.isfinite(team.sensors.compass_sigmas)
    compass = "a compass (heading_sigma_rad), " if np.any(lacking & (turning > MOVES)) else ""
    return (
        f"the filter rests on the prior, {keys}; {compass}sightings of further vehicles or "
        "landmarks, or refinement may determine more"
    )
