"""Names for unobservable directions of errors that last: which errors trade against which.

From the null space of [P E], the motions that no sighting can detect even with all errors known
(syncplan.observability.unobservable_modes) are taken out. One direction is left for each error too
many, chosen so that each has an error of its own. Such a direction may move poses too:

    speed scales of v1, v3 and v5 against v2, v4 and v6, with a turn of the team

A vehicle whose speed scale is c flies a circle that is larger by c; with its centre kept, it starts
c times its radius further out. What its pose moves besides is compared with shifts, turns and
stretches of all the vehicles concerned.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from syncplan.arrays import Array, Index
from syncplan.observability.extended_rank import MOVES, ExtendedObservability, assess_extended
from syncplan.observability.rank import Observability
from syncplan.observability.window_assessment import Assessment
from syncplan.orbits.circles import perpendicular, position
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.team import Team
from syncplan.phrases import joined
from syncplan.scenario.disturbances import ESTIMABLE, EstimableName

MOST_NAMED = 6

_TAKES_PART = 1e-3
"""Share of a direction's largest error from which another is named."""

_MATCHES = 1e-3
"""Share of the poses' motion that may differ from the one it is named for."""


@dataclass(frozen=True, slots=True)
class ErrorMode:
    """One way in which errors, and poses with them, can change without any sighting changing.

    Attributes
    ----------
    description : in words
    states : of the errors that change, as the layout labels them
    vehicles : indices of those whose errors or poses change
    moves_poses : whether some position or heading changes too
    cure : what would determine the errors
    """

    description: str
    states: tuple[str, ...]
    vehicles: tuple[int, ...]
    moves_poses: bool
    cure: str


@dataclass(frozen=True, slots=True)
class ErrorVerdict:
    """What one window determines of the errors that the filter estimates.

    Attributes
    ----------
    state_dim : number of poses' coordinates and constant errors
    extended : rank with the errors as states; None where they are too many
    modes : a named one for each dimension in which errors are not determined
    """

    state_dim: int
    extended: ExtendedObservability | None
    modes: tuple[ErrorMode, ...] = ()


def judge_errors(
    assessed: Assessment, names: Sequence[str], most_states: int
) -> ErrorVerdict | None:
    """Return what is determined of the errors of vehicles named; None where none are estimated.

    With more than `most_states` states, only their number.
    """
    team = assessed.team
    estimated = [name for name in team.errors.estimated if ERROR_STATES[name].constant]
    layout = layout_of(team, estimated)
    if not layout.names:
        return None
    extended = assess_extended(assessed) if layout.size <= most_states else None
    if extended is None:
        return ErrorVerdict(layout.size, None)
    modes = name_error_modes(team, assessed.observability, extended, names)
    return ErrorVerdict(layout.size, extended, tuple(modes))


def name_error_modes(
    team: Team, poses: Observability, found: ExtendedObservability, names: Sequence[str]
) -> list[ErrorMode]:
    """Return a named mode for each dimension in which errors are not determined.

    `poses` is the verdict with all errors known; `names` are those of the vehicles.
    """
    return [_mode(team, found, vector, names) for vector in _directions(poses, found)]


def _directions(poses: Observability, found: ExtendedObservability) -> Array:
    """(k, size) null vectors beside those of the poses alone, each with an error of its own."""
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
    # lists of vehicles have an "and" of their own
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
    """Each kind of error that takes part, in words: those that grow against those that fall."""
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
    """How the poses of the vehicles concerned move, besides the growth of their circles."""
    count, orbits = found.layout.count, team.orbits
    scale = float(orbits.radii.mean())
    places = position(orbits, 0.0)
    motion = vector[: 3 * count].reshape(-1, 3).copy()
    if "speed_scale" in found.layout.columns:
        columns = found.layout.columns["speed_scale"][:, 0]
        grown = np.where(columns >= 0, vector[columns] * team.errors.speed_scale, 0.0)
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
    """What would determine the errors; a compass where headings change with them."""
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
