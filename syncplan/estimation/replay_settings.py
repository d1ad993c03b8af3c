"""What the filter assumes of a recording, and which of its sightings it is given."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.orbits.sensors import Noise

GROUND_ROBOTS = Noise(
    speed_sigma=0.09, turn_rate_sigma=0.22, position_sigma=0.01, heading_sigma=0.01
)
"""Sigmas for the robots of the MRCLAM data sets, at samples of 0.05 s, from a known start: random
walks of 0.02 m and 0.05 rad after a second."""

SPEED_SCALE_SIGMA = 0.05
TURN_RATE_BIAS_SIGMA = 0.01
"""Of these robots' odometry, 1 and rad/s: they moved 7 to 10 % less than they read."""

BEARING_SIGMA = 0.01
RANGE_SIGMA = 0.4
"""Of these robots' cameras, rad and m. Distances scatter by 0.13 m, but the errors of one target
last for seconds, and a filter that takes them for new at each sighting needs a larger sigma."""

BEARING_WALK_TIME = 10.0
"""s, over which the correlation of bearing errors that change falls to 1/e."""

SAMPLE_TIME = 0.05
WINDOW = 30.0

START_SIGMAS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"truth": (0.01, 0.01), "prior": (5.0, 0.5), "given": (1.0, 0.2)}
)
"""By kind of start, what position and heading are known to, m and rad, unless stated."""

LEAST_SIGMA, LARGEST_SIGMA = 1e-6, 1e6
"""Limits of any sigma; those of motion, of lasting errors and of the start may also be 0."""

LARGEST_DELAY = 60.0
"""s: more is a wrong clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings:
    """What a replay rests on; raises InputError naming the setting at fault.

    Attributes
    ----------
    landmarks : names of those whose sightings count, all if None
    meetings, distances : whether sightings between robots count, and distances where recorded
    bearing_sigma, range_sigma : rad, m
    noise : of motion readings, per sample, and of the start
    speed_scale_sigma, turn_rate_bias_sigma, bearing_bias_sigma : 1, rad/s, rad; each robot's error
        is a state of the filter where it is more than 0
    bearing_walk_sigma, bearing_walk_time : rad, s; the same of the bearing error that changes
    sample_time : s, between the samples at which errors are taken, to which motion noise refers
    delay : s, by which sightings are recorded later than they were made
    start : kind of start, one of START_SIGMAS
    start_poses : (n, 3) m, m, rad, where the start is given
    window : s, of the sightings that are judged together; 0 judges none
    portion : shares of the recording at which the run begins and ends
    """

    landmarks: tuple[int | str, ...] | None = None
    meetings: bool = True
    distances: bool = True
    bearing_sigma: float = BEARING_SIGMA
    range_sigma: float = RANGE_SIGMA
    noise: Noise = GROUND_ROBOTS
    speed_scale_sigma: float = SPEED_SCALE_SIGMA
    turn_rate_bias_sigma: float = TURN_RATE_BIAS_SIGMA
    bearing_bias_sigma: float = 0.0
    bearing_walk_sigma: float = 0.0
    bearing_walk_time: float = BEARING_WALK_TIME
    sample_time: float = SAMPLE_TIME
    delay: float = 0.0
    start: str = "truth"
    start_poses: Array | None = None
    window: float = WINDOW
    portion: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        allowed = f"allowed is {LEAST_SIGMA:g} to {LARGEST_SIGMA:g}"
        for key in ("bearing_sigma", "range_sigma", "sample_time", "bearing_walk_time"):
            value = getattr(self, key)
            if not LEAST_SIGMA <= value <= LARGEST_SIGMA:
                raise InputError(f"{value:g} given; {allowed}", key=key)
        of_noise = ("speed_sigma", "turn_rate_sigma", "position_sigma", "heading_sigma")
        for key in (*of_noise, *self.lasting_errors().values()):
            value = getattr(self.noise if key in of_noise else self, key)
            if value != 0.0 and not LEAST_SIGMA <= value <= LARGEST_SIGMA:
                raise InputError(f"{value:g} given; {allowed}, or 0", key=key)
        if not abs(self.delay) <= LARGEST_DELAY:
            problem = f"{self.delay:g} given; allowed is -{LARGEST_DELAY:g} to {LARGEST_DELAY:g} s"
            raise InputError(problem, key="delay")
        if not 0.0 <= self.window <= LARGEST_SIGMA:
            raise InputError(f"{self.window:g} given; it must not be negative", key="window")
        if self.start not in START_SIGMAS:
            problem = f"{self.start!r} is unknown; choose {' or '.join(START_SIGMAS)}"
            raise InputError(problem, key="start")
        if (self.start == "given") != (self.start_poses is not None):
            problem = "poses belong to a start that is given, and only to such"
            raise InputError(problem, key="start_poses")

    @property
    def has_lasting_errors(self) -> bool:
        """Whether any lasting error is a state of the filter."""
        return any(getattr(self, key) > 0.0 for key in self.lasting_errors().values())

    @staticmethod
    def lasting_errors() -> Mapping[str, str]:
        """Return the errors that a recording's filter may have as states, and their settings."""
        names = ("speed_scale", "turn_rate_bias", "bearing_bias", "bearing_walk")
        return {name: f"{name}_sigma" for name in names}
