"""Two flights under the same noise, side by side."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, position
from tests.crosschecks.closed_loop import Flight
from tests.tools.flown_trials import FlownTrials

MOST_ERROR = 0.10
MOST_SEPARATION = 0.1
MOST_SIGHTINGS = 0.03
"""How far a plant may be from the model: share of errors, of the radius, of sightings."""

LOST = 5.0
"""Times the median error, from which on a trial is lost."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures of a flight.

    Attributes
    ----------
    estimation, tracking : (trials,) m, rms over vehicles and the second half
    starting, separation : (trials,) m, least in the first period, and from then on
    sightings : (trials,)
    """

    estimation: Array
    tracking: Array
    starting: Array
    separation: Array
    sightings: Array


@dataclass(frozen=True, slots=True)
class Comparison:
    """A plant beside the model, each pair the model's figure and the plant's.

    Errors and separations are of the trials that neither lost, of all if there are none: one is
    lost where the error of its estimates is over LOST times the median of the model's. Plants are
    held to separations after the first period. In it vehicles turn round at their limits, slowly,
    to reach places that they were drawn far from, in wind that they do not know: a moment's
    difference decides which way.

    Attributes
    ----------
    estimation, tracking : m, rms
    starting, separation : m, least in the first period, and from then on
    sightings : of all trials
    lost : trials
    widest : m, m, largest difference of a trial's estimation rms, and of its separation
    radius : m, of the circles
    """

    estimation: tuple[float, float]
    tracking: tuple[float, float]
    starting: tuple[float, float]
    separation: tuple[float, float]
    sightings: tuple[float, float]
    lost: tuple[int, int]
    widest: tuple[float, float]
    radius: float

    @property
    def agrees(self) -> bool:
        """Whether the plant is as near to the model as it should be."""
        errors = [abs(b / a - 1.0) for a, b in (self.estimation, self.tracking)]
        apart = abs(self.separation[1] - self.separation[0]) / self.radius
        seen = abs(self.sightings[1] / self.sightings[0] - 1.0)
        near = max(errors) <= MOST_ERROR and apart <= MOST_SEPARATION and seen <= MOST_SIGHTINGS
        return near and self.lost[0] == self.lost[1]

    def line(self) -> str:
        """Return the figures as a line of a table below HEAD."""
        pairs = [f"{a:8.3f}{b:8.3f}{b / a:7.3f}" for a, b in (self.estimation, self.tracking)]
        apart = "".join(f"{a:8.2f}{b:7.2f}" for a, b in (self.starting, self.separation))
        seen, more = self.sightings
        return (
            f"{''.join(pairs)}{apart}{seen:9.0f}{more / seen:7.3f}"
            f"{self.lost[0]:5}{self.lost[1]:3}{self.widest[0]:9.3f}{self.widest[1]:7.2f}"
            f"  {'agrees' if self.agrees else 'DIFFERS'}"
        )


HEAD = (
    "  estimation m    ratio   tracking m    ratio   first period m     after it m"
    "  sightings  ratio   lost   widest m    m"
)
"""Of a table of comparisons."""


def summary_of_kernels(flown: FlownTrials) -> Summary:
    """Return the figures of what syncplan.flight itself flies: the simple model."""
    run, lanes = flown.run, flown.lanes
    kept = _kept(np.moveaxis(flown.path, -1, 1), run.plan.orbits, run.plan.sensors.sample_time)
    n, late = run.plan.team.count, run.team.steps - run.team.steps // 2
    poses = lanes.statistics.late_squares[: 3 * n].reshape(n, 3, -1)
    squares = poses[:, :2].sum(axis=1).mean(axis=0) / late
    return Summary(np.sqrt(squares), *kept, flown.figures.sightings.astype(float))


def _kept(path: Array, orbits: Orbits, time: float) -> tuple[Array, Array, Array]:
    """Tracking, starting and separation, as Summary has them, of (steps + 1, trials, n, 3)."""
    places = path[..., :2]
    plan = position(orbits, time * np.arange(len(places)))[:, None]
    a, b = np.triu_indices(orbits.count, 1)
    apart = np.linalg.norm(places[:, :, a] - places[:, :, b], axis=-1)
    nearest, settled = apart.min(axis=2), round(orbits.period / time)
    later = nearest[settled:].min(axis=0, initial=np.inf)
    return _late_rms(places - plan), nearest[:settled].min(axis=0), later


def summary_of(flight: Flight, orbits: Orbits, time: float) -> Summary:
    """Return the figures of a flight whose samples last `time` s."""
    kept = _kept(flight.path, orbits, time)
    estimation = _late_rms((flight.estimates - flight.path)[..., :2])
    return Summary(estimation, *kept, flight.sightings)


def compared(model: Summary, plant: Summary, radius: float) -> Comparison:
    """Return how a plant differs from the model under the same noise, on circles of `radius` m."""
    both = (model, plant)
    most = LOST * float(np.median(model.estimation))
    lost = [one.estimation > most for one in both]
    kept = ~(lost[0] | lost[1])
    if not kept.any():
        kept[:] = True

    def rms(errors: Array) -> float:
        return float(np.sqrt(np.mean(errors[kept] ** 2)))

    return Comparison(
        estimation=(rms(model.estimation), rms(plant.estimation)),
        tracking=(rms(model.tracking), rms(plant.tracking)),
        starting=(float(model.starting[kept].min()), float(plant.starting[kept].min())),
        separation=(float(model.separation[kept].min()), float(plant.separation[kept].min())),
        sightings=(float(model.sightings.sum()), float(plant.sightings.sum())),
        lost=(int(lost[0].sum()), int(lost[1].sum())),
        widest=(
            float(np.abs(plant.estimation - model.estimation)[kept].max()),
            float(np.abs(plant.separation - model.separation)[kept].max()),
        ),
        radius=radius,
    )


def _late_rms(errors: Array) -> Array:
    """(trials,) over vehicles and the second half, of errors (steps + 1, trials, n, 2)."""
    late = (len(errors) - 1) // 2 + 1
    return np.asarray(np.sqrt(np.mean(np.sum(errors[late:] ** 2, axis=-1), axis=(0, 2))))
