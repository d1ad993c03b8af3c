"""Two flights under the same noise, side by side."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from tests.crosschecks.closed_loop import Flight

__all__ = ["Comparison", "Summary", "compared", "summary_of"]

MOST_ERROR = 0.10
MOST_SEPARATION = 2.0
MOST_SIGHTINGS = 0.03
"""How far a plant may be from the model: share of errors, m, share of sightings."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures of a flight.

    Attributes
    ----------
    estimation, tracking : (trials,) m, rms over vehicles and the second half
    separation : (trials,) m, least
    sightings : (trials,)
    """

    estimation: Array
    tracking: Array
    separation: Array
    sightings: Array


@dataclass(frozen=True, slots=True)
class Comparison:
    """A plant beside the model, over all trials.

    Attributes
    ----------
    estimation, tracking : m, rms of the model and of the plant
    separation : m, least of each
    sightings : of each
    parted : m, median and largest difference of a trial's estimation rms; and of its separation
    """

    estimation: tuple[float, float]
    tracking: tuple[float, float]
    separation: tuple[float, float]
    sightings: tuple[float, float]
    parted: tuple[float, float, float, float]

    @property
    def agrees(self) -> bool:
        """Whether the plant is as near to the model as Done when 5 of the issue asks."""
        errors = [abs(_ratio(one) - 1.0) for one in (self.estimation, self.tracking)]
        apart = abs(self.separation[1] - self.separation[0])
        seen = abs(_ratio(self.sightings) - 1.0)
        return max(errors) <= MOST_ERROR and apart <= MOST_SEPARATION and seen <= MOST_SIGHTINGS

    def line(self) -> str:
        """Return the figures as a line of a table."""
        pairs = [f"{a:7.3f}{b:8.3f}{b / a:7.3f}" for a, b in (self.estimation, self.tracking)]
        a, b = self.separation
        seen, more = self.sightings
        median, most, separation_median, separation_most = self.parted
        return (
            f"{'  '.join(pairs)}  {a:6.2f}{b:7.2f}  {seen:8.0f}{more / seen:7.3f}"
            f"  {median:6.3f}{most:7.3f}{separation_median:7.2f}{separation_most:6.2f}"
            f"  {'agrees' if self.agrees else 'differs'}"
        )

    HEAD = (
        " estimation m    ratio    tracking m    ratio  separation m   sightings  ratio"
        "  trials apart: m      m"
    )


def summary_of(flight: Flight) -> Summary:
    """Return the figures of a flight."""
    late = len(flight.estimation) // 2 + 1
    return Summary(
        estimation=_rms(flight.estimation[late:]),
        tracking=_rms(flight.tracking[late:]),
        separation=flight.separation.min(axis=0),
        sightings=flight.sightings.astype(float),
    )


def compared(model: Summary, plant: Summary) -> Comparison:
    """Return how a plant differs from the model under the same noise."""
    estimation = np.abs(plant.estimation - model.estimation)
    separation = np.abs(plant.separation - model.separation)
    both = (model, plant)
    return Comparison(
        estimation=_pair([float(np.sqrt(np.mean(one.estimation**2))) for one in both]),
        tracking=_pair([float(np.sqrt(np.mean(one.tracking**2))) for one in both]),
        separation=_pair([float(one.separation.min()) for one in both]),
        sightings=_pair([float(one.sightings.sum()) for one in both]),
        parted=(
            float(np.median(estimation)),
            float(estimation.max()),
            float(np.median(separation)),
            float(separation.max()),
        ),
    )


def _rms(errors: Array) -> Array:
    """(trials,) of errors (steps, trials, n, 2)."""
    return np.asarray(np.sqrt(np.mean(np.sum(errors**2, axis=-1), axis=(0, 2))))


def _ratio(pair: tuple[float, float]) -> float:
    return pair[1] / pair[0]


def _pair(two: list[float]) -> tuple[float, float]:
    return two[0], two[1]
