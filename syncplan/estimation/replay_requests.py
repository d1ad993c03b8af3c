"""Replays as requests name them: keys with units, and what they stand for."""

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from syncplan.errors import InputError
from syncplan.estimation.filter_options import REQUEST_KEYS, FilterChanges, FilterOptions
from syncplan.estimation.replay_settings import GROUND_ROBOTS, START_SIGMAS, ReplaySettings
from syncplan.estimation.replays import replay_options
from syncplan.orbits.sensors import Noise

KEYS: Mapping[str, str] = MappingProxyType(
    {
        "bearing_sigma": "bearing_sigma_rad",
        "range_sigma": "range_sigma_m",
        "speed_sigma": "speed_sigma_mps",
        "turn_rate_sigma": "turn_rate_sigma_rad_s",
        "position_sigma": "start_sigma_m",
        "heading_sigma": "start_sigma_rad",
        "turn_rate_bias_sigma": "turn_rate_bias_sigma_rad_s",
        "bearing_bias_sigma": "bearing_bias_sigma_rad",
        "bearing_walk_sigma": "bearing_walk_sigma_rad",
        "bearing_walk_time": "bearing_walk_time_s",
        "sample_time": "sample_time_s",
        "delay": "delay_s",
        "window": "window_s",
    }
)
"""Keys of requests by what they stand for in ReplaySettings and Noise, where the names differ."""


OF_FILTER = {
    name: REQUEST_KEYS[name] for name in ("seed", "filter", "gate_probability", "with_series")
}
"""Those of the filter, as every request for a run has them."""


def settings_of_request(request: Mapping[str, Any]) -> ReplaySettings:
    """Return what a request asks for, which may have further keys; raises InputError naming one."""
    given = {name: request[key] for name, key in _keys(ReplaySettings) if key in request}
    noise = {name: request[key] for name, key in _keys(Noise) if key in request}
    place, heading = START_SIGMAS.get(request.get("start", "truth"), (0.0, 0.0))
    usual = {
        "speed_sigma": GROUND_ROBOTS.speed_sigma,
        "turn_rate_sigma": GROUND_ROBOTS.turn_rate_sigma,
        "position_sigma": place,
        "heading_sigma": heading,
    }
    if given.get("landmarks") is not None:
        given["landmarks"] = tuple(given["landmarks"])
    if given.get("start_poses") is not None:
        given["start_poses"] = np.array(given["start_poses"], np.float64)
    try:
        return ReplaySettings(**given, noise=Noise(**{**usual, **noise}))
    except InputError as error:
        raise InputError(error.problem, key=KEYS.get(error.key, error.key)) from None


def options_of_request(request: Mapping[str, Any]) -> FilterOptions:
    """Return which filter a request asks for; raises InputError naming the key at fault."""
    changes = {name: request[key] for name, key in OF_FILTER.items() if key in request}
    return replay_options(None, cast(FilterChanges, changes))


def _keys(kind: Any) -> list[tuple[str, str]]:
    """Names of a dataclass's fields, each with its key in requests."""
    return [(one.name, KEYS.get(one.name, one.name)) for one in fields(kind)]
