"""Where the filter starts on a recording: at the truth, drawn about it, or at given poses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.replay_settings import ReplaySettings


@dataclass(frozen=True, slots=True)
class RecordedStart:
    """A kind of start.

    Attributes
    ----------
    poses : (n, 3) m, m, rad, of the true poses at the beginning, settings and a seed
    needs_truth : whether those must be known; zeros of the same shape do where they need not
    """

    poses: Callable[[Array, ReplaySettings, int], Array]
    needs_truth: bool


def check_start(settings: ReplaySettings, name: str, *, has_truth: bool) -> None:
    """Raise InputError if the start rests on truth that the recording of this name lacks."""
    if STARTS[settings.start].needs_truth and not has_truth:
        problem = (
            f"{settings.start!r} needs the truth, which {name} does not hold; give the start: "
            "'given' with start_poses (--start given --start-poses ...)"
        )
        raise InputError(problem, key="start")


def start_of(truth: Array, settings: ReplaySettings, seed: int) -> Array:
    """Return the initial estimate (n, 3) m, m, rad, from the true poses at the beginning."""
    return STARTS[settings.start].poses(truth, settings, seed)


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


STARTS: Mapping[str, RecordedStart] = MappingProxyType(
    {
        "truth": RecordedStart(_at_truth, needs_truth=True),
        "prior": RecordedStart(_drawn, needs_truth=True),
        "given": RecordedStart(_given, needs_truth=False),
    }
)
"""By name."""
