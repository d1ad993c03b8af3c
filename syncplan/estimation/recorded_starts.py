"""Where the filter starts on a recording: at the truth, drawn about it, or where it is told."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.replay_settings import ReplaySettings

__all__ = ["STARTS", "start_of"]


def start_of(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    """Return the initial estimate (n, 3) m, m, rad, from the true poses at the beginning."""
    return STARTS[settings.start](truth, settings, seed)


def _at_truth(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    return truth.copy()


def _drawn(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    """About the truth, by the sigmas of the start."""
    noise, random = settings.noise, np.random.default_rng(seed)
    sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    drawn: Array = truth + sigmas * random.standard_normal(truth.shape)
    return drawn


def _given(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    poses = np.array(settings.start_poses, dtype=np.float64)
    if poses.shape != truth.shape:
        problem = f"has shape {poses.shape}; needed are x, y and heading of {len(truth)} robots"
        raise InputError(problem, key="start_poses")
    if not np.isfinite(poses).all():
        raise InputError("holds a value that is not finite", key="start_poses")
    return poses


STARTS: Mapping[str, Callable[[Array, ReplaySettings, int], Array]] = MappingProxyType(
    {"truth": _at_truth, "prior": _drawn, "given": _given}
)
"""By name, of the true poses at the beginning, settings and a seed."""
