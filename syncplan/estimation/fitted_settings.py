"""The table of what a recording's filter is fitted in. A new setting is a line of FITTED.

The simplex method takes logarithms of sigmas, and a delay in a unit that counts for as much as a
sigma that is e times as large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.replay_settings import LARGEST_DELAY, ReplaySettings


@dataclass(frozen=True, slots=True)
class FittedSetting:
    """A setting that can be fitted.

    Attributes
    ----------
    of_noise : whether it is one of the settings' `noise`, or of the settings themselves
    least, largest : limits of a fit, in the setting's own unit
    unit : step of the simplex of a setting on a linear scale; None for a logarithmic one
    """

    of_noise: bool
    least: float
    largest: float
    unit: float | None = None

    def scaled(self, value: float) -> float:
        """The value as the simplex takes it."""
        if self.unit is None:
            return float(np.log(np.clip(value, self.least, self.largest)))
        return value / self.unit

    def value(self, scaled: float) -> float:
        """The value of what the simplex takes, within the limits."""
        value = float(np.exp(min(scaled, 50.0))) if self.unit is None else scaled * self.unit
        return min(max(value, self.least), self.largest)


FITTED: Mapping[str, FittedSetting] = MappingProxyType(
    {
        "bearing_sigma": FittedSetting(of_noise=False, least=1e-4, largest=3.0),
        "range_sigma": FittedSetting(of_noise=False, least=1e-4, largest=1e3),
        "speed_sigma": FittedSetting(of_noise=True, least=1e-4, largest=1e3),
        "turn_rate_sigma": FittedSetting(of_noise=True, least=1e-4, largest=1e2),
        "bearing_walk_sigma": FittedSetting(of_noise=False, least=1e-4, largest=1.0),
        "bearing_walk_time": FittedSetting(of_noise=False, least=0.1, largest=1e3),
        "delay": FittedSetting(
            of_noise=False, least=-LARGEST_DELAY, largest=LARGEST_DELAY, unit=0.25
        ),
    }
)
"""By name: rad, m, m/s and rad/s per sample, rad, s, s."""


def point_of(settings: ReplaySettings, names: Sequence[str]) -> Array:
    """Return (k,) what the simplex takes for the named settings."""
    found = []
    for name in names:
        holder = settings.noise if FITTED[name].of_noise else settings
        found.append(FITTED[name].scaled(getattr(holder, name)))
    return np.array(found)


def settings_at(settings: ReplaySettings, names: Sequence[str], point: Array) -> ReplaySettings:
    """Return settings whose named ones are at a point; raises InputError for one out of bounds."""
    values = {
        name: FITTED[name].value(one) for name, one in zip(names, point.tolist(), strict=True)
    }
    noise = {name: value for name, value in values.items() if FITTED[name].of_noise}
    own: dict[str, Any] = {name: value for name, value in values.items() if name not in noise}
    return replace(settings, **own, noise=replace(settings.noise, **noise))
