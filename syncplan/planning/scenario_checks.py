"""Findings on values that a scenario states."""

from collections.abc import Iterator, Sequence
from math import hypot, radians, sqrt

import numpy as np

from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.circles import extent
from syncplan.phrases import listed
from syncplan.planning.judged_team import MOST_NAMED, FindingCure, JudgedTeam, Level, Remark
from syncplan.scenario.altitudes import horizontal_reach
from syncplan.scenario.angle_sigmas import AngleSigma, angle_sigmas
from syncplan.scenario.dotted_keys import IN_TRUTH
from syncplan.scenario.ground import map_departure

# --- the flat map ---------------------------------------------------------------------------------


FLAT_MAP_SHARE = 0.1
"""Departure of the flat map over the least predicted error of a vehicle from which it matters."""


def flat_map(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the ground is too curved for the map, beside the predicted errors."""
    origin, rms = judged.scenario.geo_origin, judged.prediction.rms
    if origin is None or rms is None:
        return
    departure = map_departure(origin, extent(judged.orbits, np.array(judged.scenario.landmarks)))
    if departure > FLAT_MAP_SHARE * float(rms.min()):
        yield Remark(
            "warning",
            f"distances on the flat map and on the ground differ by up to {departure:.2g} m over "
            f"the team's extent: more than a tenth of the least predicted error, {rms.min():.2g} m",
            cure="put geo_origin in the middle of the team, or fly smaller teams",
        )


# --- altitudes ------------------------------------------------------------------------------------


SLANT_SHARE = sqrt(1.0 - 0.99**2)
"""Difference of altitude, over a range, that takes 1 % of the range in the plane."""


def slant_ranges(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the findings that pairs in range of each other differ by much in altitude.

    One is on pairs of vehicles, the other on landmarks, which are taken to be on the ground; each
    names the pair with the largest difference. Where that is no less than the range, the pair may
    never see each other: a warning of landmarks, too.
    """
    scenario = judged.scenario
    if not scenario.altitudes:
        return
    ground = [0.0] * len(scenario.landmarks)
    altitudes = np.array([*scenario.altitudes, *ground])
    ranges = np.array([*(sensor.range_m for sensor in scenario.sensors), *ground])
    names = [*scenario.vehicle_names, *scenario.landmark_names]
    levels: dict[Level, Sequence[LinkVerdict]] = {
        "warning": (*judged.links, *judged.incidental_links),
        "note": judged.landmark_links,
    }
    for level, meetings in levels.items():
        pairs = np.array([(meeting.a, meeting.b) for meeting in meetings], dtype=int).reshape(-1, 2)
        differences, reaches = np.ptp(altitudes[pairs], axis=1), ranges[pairs].max(axis=1)
        slanted = np.flatnonzero(differences > SLANT_SHARE * reaches)
        if len(slanted):
            largest = slanted[np.argmax(differences[slanted])]
            apart, reach = float(differences[largest]), float(reaches[largest])
            a, b = (names[k] for k in pairs[largest])
            if apart >= reach:
                yield Remark(
                    "warning",
                    f"{a} and {b} differ by {apart:.4g} m in altitude: if the range, "
                    f"{reach:.4g} m, is meant along the line of sight, they never see each other "
                    "and the verdict does not hold, as it counts ranges in the plane",
                    (a, b),
                    cure="lessen the difference below the range, or take a sensor that reaches "
                    "farther; range_m meant in the plane needs neither",
                )
                continue
            yield Remark(
                level,
                f"{a} and {b} differ by {apart:.4g} m in altitude, and ranges count in the plane: "
                f"at the edge of range, {reach:.4g} m, they are {hypot(reach, apart):.4g} m from "
                "each other",
                (a, b),
                cure="where range_m is meant along the line of sight, state the horizontal reach, "
                f"sqrt(R^2 - d^2) = {horizontal_reach(reach, apart):.4g} m; or lessen the "
                "difference",
            )


# --- sigmas of angles -----------------------------------------------------------------------------


USUAL_ANGLE_SIGMA, LARGEST_ANGLE_SIGMA = 0.5, 1.0
"""Standard deviations of an angle in rad above which it is a warning, and a stop.

Angles wrap round the circle: taken for Gaussian, one of 1 rad claims 1.05 times the information
that it holds, one of 2 rad 6.7 times.
"""

START = "initial_sigma."
"""Beginning of keys of the start, which may be unknown: its heading is never a stop."""


def angle_sigmas_large(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each key with a standard deviation of an angle that is too large."""
    large: dict[str, list[AngleSigma]] = {}
    for sigma in angle_sigmas(judged.scenario):
        if sigma.value > USUAL_ANGLE_SIGMA:
            large.setdefault(sigma.key, []).append(sigma)
    for key, sigmas in large.items():
        names = [judged.scenario.vehicle_names[k] for k in _vehicles(sigmas)]
        yield Remark(
            _level(key, sigmas),
            f"{key} is {_values(sigmas, names)} in radians; were degrees meant? Errors this "
            "large wrap round the circle, which predictions leave out",
            tuple(names),
            cure=_degree_cure(key, sigmas),
        )


def _level(key: str, sigmas: Sequence[AngleSigma]) -> Level:
    start = key.removeprefix(IN_TRUTH).startswith(START)
    largest = max(sigma.value for sigma in sigmas)
    return "stop" if largest > LARGEST_ANGLE_SIGMA and not start else "warning"


def _vehicles(sigmas: Sequence[AngleSigma]) -> list[int]:
    return [sigma.vehicle for sigma in sigmas if sigma.vehicle is not None]


def _values(sigmas: Sequence[AngleSigma], names: Sequence[str]) -> str:
    """Value of a key for all, or those of vehicles with their names."""
    if not names:
        return f"{sigmas[0].value:g}"
    each = [f"{sigma.value:g} for {name}" for sigma, name in zip(sigmas, names, strict=True)]
    return listed(each, MOST_NAMED)


def _degree_cure(key: str, sigmas: Sequence[AngleSigma]) -> FindingCure:
    """Cure that takes a value for degrees; lists of values have no single number to change."""
    if _vehicles(sigmas):
        return FindingCure(text="if degrees were meant, give each times pi/180", change={})
    value = float(f"{radians(sigmas[0].value):.3g}")
    return FindingCure(text=f"if degrees were meant, give {value:g}", change={key: value})
