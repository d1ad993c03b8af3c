"""Geometric proofs that no drawing meets its demands, and messages on a drawing's shortfalls.

Every reason that `obstacle` returns is a proof; if it finds none, there may still be no drawing.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.placement.drawing import Demands, Drawing

_SHOWN = 3
_REMEDY = "give a longer range, smaller circles or fewer links"
_ARC_ERROR = 1e-3
_MOST_TRIALS = 500


def obstacle(demands: Demands) -> str:
    """Return a proof that the demands can't be met, in one line; empty where none is found."""
    return (
        _tight_link(demands)
        or _crowd(demands)
        or _no_room(demands)
        or _landmark_out_of_reach(demands)
        or _landmarks_too_far_apart(demands)
    )


def complaint(drawing: Drawing) -> str:
    """Return the shortfalls of a drawing in one line, links first and the worst first."""
    demands, missed, gaps = drawing.demands, drawing.missed, drawing.link_gaps
    names, faults = demands.names, []
    for k in _worst(missed.links):
        faults.append(
            f"link {names.link(demands.links[k])}: circles {gaps[k]:.3g} m apart, range "
            f"{demands.most[k] + names.margin:.4g} m less margin {names.margin:.3g} m"
        )
    for k in _worst(missed.gaps):
        a, b = (names.vehicles[int(v)] for v in missed.pairs[k])
        gap = demands.least - missed.gaps[k]
        near = f"{gap:.3g} m apart" if gap >= 0.0 else f"cross by {-gap:.3g} m"
        faults.append(f"{a} and {b}: circles {near}, at least {demands.least:.3g} m are required")
    for k in _worst(missed.landmarks):
        vehicle, landmark = drawing.sightings[k]
        faults.append(
            f"landmark {names.landmarks[landmark]}: {missed.landmarks[k]:.3g} m out of range "
            f"of {names.vehicles[vehicle]}, the nearest of the vehicles linked to it"
        )
    for k in _worst(missed.area):
        faults.append(
            f"{names.vehicles[k]}: its circle lies {missed.area[k]:.3g} m across area_m or "
            "keep_out_m"
        )
    more = f" (and {len(faults) - _SHOWN} more)" if len(faults) > _SHOWN else ""
    roomier = ", or a larger area" if demands.area.limited else ""
    return "; ".join(faults[:_SHOWN]) + f"{more}; {_REMEDY}{roomier}"


def _worst(missed: Array) -> list[int]:
    order = np.argsort(-missed, kind="stable")
    return [int(k) for k in order if missed[k] > 0.0]


def _tight_link(demands: Demands) -> str:
    names = demands.names
    for k in np.flatnonzero(demands.most < demands.least):
        return (
            f"link {names.link(demands.links[k])}: its circles must be at least "
            f"{demands.least:.4g} m apart, more than the range {demands.most[k] + names.margin:.4g}"
            f" m less margin {names.margin:.3g} m; lower min_separation_m or give a longer range"
        )
    return ""


def _crowd(demands: Demands) -> str:
    """Proof that more circles are linked to one than fit round it within range and apart.

    The centres of two neighbours at distances p and q from the middle are at least L apart, so the
    angle between them is at least acos((p^2 + q^2 - L^2) / 2pq), smallest at an end of the ranges
    of p and of q. In a full turn, the angles of each circle to its two neighbours are no less than
    its two smallest; half their sum over all circles can't exceed 2 pi.
    """
    names = demands.names
    for middle in range(demands.count):
        own = np.flatnonzero(np.any(demands.links == middle, axis=1))
        if len(own) < 4:
            continue
        around = demands.links[own].sum(axis=1) - middle
        radii = demands.radii[around]
        near = demands.radii[middle] + radii + demands.least
        far = demands.radii[middle] + radii + demands.most[own]
        apart = radii[:, None] + radii[None] + demands.least
        cosines = [
            (p[:, None] ** 2 + q[None] ** 2 - apart**2) / (2.0 * p[:, None] * q[None])
            for p in (near, far)
            for q in (near, far)
        ]
        angles = np.arccos(np.clip(np.max(cosines, axis=0), -1.0, 1.0))
        np.fill_diagonal(angles, np.inf)
        share = np.sort(np.sort(angles, axis=1)[:, :2].mean(axis=1))
        room = int(np.searchsorted(np.cumsum(share), 2.0 * math.pi * (1.0 + 1e-12), side="right"))
        if room < len(own):
            listed = [names.link(demands.links[k]) for k in own]
            shown = listed if len(listed) <= 8 else [*listed[:7], "..."]
            far_off = float(np.max(demands.most[own])) + names.margin
            return (
                f"links {', '.join(shown)}: {len(own)} circles are linked to "
                f"{names.vehicles[middle]}, but at most {room} fit round it without crossing, "
                f"within range {far_off:.4g} m less margin {names.margin:.3g} m; {_REMEDY}"
            )
    return ""


def _no_room(demands: Demands) -> str:
    names = demands.names
    if demands.area.inside is None:
        return ""
    corners = demands.area.inside
    x, y = corners.T
    enclosed = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
    for radius in np.unique(demands.radii)[::-1]:
        if demands.area.nearest_clear(corners[:1], np.array([radius])) is None:
            who = names.vehicles[int(np.flatnonzero(demands.radii == radius)[0])]
            return (
                f"{who}: its circle of radius {radius:.4g} m fits nowhere in area_m clear of "
                "keep_out_m; give it a smaller circle or a larger area"
            )
    covered = math.pi * float(np.sum(demands.radii**2))
    if covered > enclosed:
        return (
            f"area_m encloses {enclosed:.4g} m2, the circles {covered:.4g} m2; give smaller "
            "circles, fewer vehicles or a larger area"
        )
    return ""


def _landmark_out_of_reach(demands: Demands) -> str:
    """Proof that too few landmarks are within range of any circle in the area."""
    names = demands.names
    if not demands.area.limited or not len(demands.landmarks):
        return ""
    kinds = np.unique(np.column_stack([demands.radii, demands.sight]), axis=0)
    if len(kinds) * len(demands.landmarks) > _MOST_TRIALS:
        return ""
    lost = []
    for name, mark in zip(names.landmarks, demands.landmarks, strict=True):
        least = np.inf
        for radius, sight in kinds:
            moved = demands.area.nearest_clear(mark[None], np.array([radius]))
            if moved is not None:
                away = math.dist(moved[0], mark) - radius * (1.0 + _ARC_ERROR)
                least = min(least, away - sight)
        if least > 0.0:
            lost.append(f"{name} ({least:.3g} m too far)")
    if len(demands.landmarks) - len(lost) >= min(2, len(demands.landmarks)):
        return ""
    return (
        f"landmarks_m: no circle in the area comes within range of {', '.join(lost[:_SHOWN])}; "
        "every connected group of vehicles needs two landmarks in sight: enlarge the area or give "
        "landmarks nearer to it"
    )


def _landmarks_too_far_apart(demands: Demands) -> str:
    """Proof that a group of linked vehicles is too small to sight any two landmarks."""
    names = demands.names
    if len(demands.landmarks) < 2:
        return ""
    from scipy import sparse, spatial

    between = float(spatial.cKDTree(demands.landmarks).query(demands.landmarks, k=2)[0][:, 1].min())
    a, b = demands.links.T
    longest = demands.radii[a] + demands.radii[b] + demands.most
    n = demands.count
    chains = sparse.csgraph.shortest_path(
        sparse.csr_matrix((longest, (a, b)), shape=(n, n)), directed=False
    )
    out = demands.radii + demands.sight
    for group in demands.groups:
        span = float(np.max(chains[np.ix_(group, group)] + out[group][:, None] + out[group][None]))
        if span < between:
            who = names.vehicles[int(group[0])]
            others = f"{who} and the vehicles linked to it" if len(group) > 1 else f"{who} alone"
            return (
                f"landmarks_m: {others} can sight landmarks at most {span:.4g} m apart, the "
                f"nearest two are {between:.4g} m apart; give landmarks nearer to each other, or "
                "link more vehicles"
            )
    return ""
