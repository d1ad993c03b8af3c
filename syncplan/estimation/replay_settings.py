"""Settings of a replay: noise, delay, start and the sightings that count."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from syncplan.errors import InputError
from syncplan.estimation.filter_options import LARGEST_SEED, FilterOptions
from syncplan.options import RunOptions, option, options_of
from syncplan.orbits.noise import Noise
from syncplan.scenario.filters import RecordingFilterName

GROUND_ROBOTS = Noise(
    speed_sigma=0.09, turn_rate_sigma=0.22, position_sigma=0.01, heading_sigma=0.01
)
"""Sigmas for the robots of the MRCLAM data sets, at samples of 0.05 s, from a known start: random
walks of 0.02 m and 0.05 rad after a second."""

SPEED_SCALE_SIGMA = 0.05
TURN_RATE_BIAS_SIGMA = 0.01
"""Sigmas of these robots' odometry, 1 and rad/s: they moved 7 to 10 % less than they read."""

BEARING_SIGMA = 0.01
RANGE_SIGMA = 0.4
"""Sigmas of these robots' cameras, rad and m. Distances scatter by 0.13 m, but the errors of one
target last for seconds, and a filter that treats them as independent needs a larger sigma."""

BEARING_WALK_TIME = 10.0
"""Time in s over which the correlation of a changing bearing error falls to 1/e."""

SAMPLE_TIME = 0.05
WINDOW = 30.0


@dataclass(frozen=True, slots=True)
class RecordedStart:
    """Start of the filter on a recording.

    Attributes
    ----------
    sigmas : m, rad, default standard deviations of position and heading
    needs_truth : whether it needs the true poses; otherwise start poses are given
    is_drawn : whether it is drawn about the true poses, by its sigmas
    """

    sigmas: tuple[float, float]
    needs_truth: bool = True
    is_drawn: bool = False


STARTS: Mapping[str, RecordedStart] = MappingProxyType(
    {
        "truth": RecordedStart((0.01, 0.01)),
        "prior": RecordedStart((5.0, 0.5), is_drawn=True),
        "given": RecordedStart((1.0, 0.2), needs_truth=False),
    }
)
"""Starts by name."""

if TYPE_CHECKING:
    from syncplan.arrays import Array

    StartKind: TypeAlias = str
    Poses: TypeAlias = Array
else:
    StartKind = Literal[tuple(STARTS)]
    Poses = Sequence[Sequence[float]]
"""Name in STARTS; poses (n, 3) in m, m, rad."""

LEAST_SIGMA, LARGEST_SIGMA = 1e-6, 1e6
"""Limits of any sigma; those of motion, of lasting errors and of the start may also be 0."""

POSITIVE: dict[str, Any] = {"ge": LEAST_SIGMA, "le": LARGEST_SIGMA}
AMOUNT: dict[str, Any] = {"ge": 0, "le": LARGEST_SIGMA}

LARGEST_DELAY = 60
"""Largest delay in s; a larger one means a wrong clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings(RunOptions):
    """Settings of a replay; raises InputError naming the setting at fault.

    Attributes
    ----------
    noise : of motion readings, per sample, and of the start
    portion : shares of the recording at which the run begins and ends
    """

    landmarks: tuple[int | str, ...] | None = option(
        None,
        "Names, or numbers, of the landmarks whose sightings count; all if not given",
        example=[7, 15],
    )
    meetings: bool = option(True, "Whether sightings between robots count")
    distances: bool = option(True, "Whether distances count, where recorded")
    bearing_sigma: float = option(
        BEARING_SIGMA,
        "Sigma of a bearing that the filter assumes",
        key="bearing_sigma_rad",
        **POSITIVE,
    )
    range_sigma: float = option(
        RANGE_SIGMA, "Sigma of a distance that the filter assumes", key="range_sigma_m", **POSITIVE
    )
    noise: Noise = GROUND_ROBOTS
    speed_scale_sigma: float = option(
        SPEED_SCALE_SIGMA,
        "Sigma of the share by which a robot's speeds are wrong; 0: not a state",
        **AMOUNT,
    )
    turn_rate_bias_sigma: float = option(
        TURN_RATE_BIAS_SIGMA,
        "Sigma of a robot's turn-rate bias; 0: not a state",
        key="turn_rate_bias_sigma_rad_s",
        **AMOUNT,
    )
    bearing_bias_sigma: float = option(
        0.0,
        "Sigma of a robot's bearing bias (mounting); 0: not a state",
        key="bearing_bias_sigma_rad",
        **AMOUNT,
    )
    bearing_walk_sigma: float = option(
        0.0,
        "Sigma of a robot's bearing error that changes slowly; 0: not a state",
        key="bearing_walk_sigma_rad",
        **AMOUNT,
    )
    bearing_walk_time: float = option(
        BEARING_WALK_TIME,
        "Time over which the correlation of the slowly changing bearing error falls to 1/e",
        key="bearing_walk_time_s",
        **POSITIVE,
    )
    sample_time: float = option(
        SAMPLE_TIME,
        "Time between samples; each sigma of motion is that of a reading of this length",
        key="sample_time_s",
        **POSITIVE,
    )
    delay: float = option(
        0.0,
        "Time from the making of a sighting to its recording",
        key="delay_s",
        ge=-LARGEST_DELAY,
        le=LARGEST_DELAY,
    )
    start: StartKind = option(
        "truth",
        "Where the filter starts: at the true poses (truth), at poses drawn about them by the "
        "start's sigmas (prior), or at the start poses (given), as a recording without truth needs",
    )
    start_poses: Poses | None = option(
        None, "x, y and heading of each robot, where the start is given"
    )
    max_truth_gap: float | None = option(
        None,
        "Longest interval between entries of the truth over which it is a straight line; errors in "
        "longer ones are not known. By default 3 usual intervals, and at least 2 samples",
        key="max_truth_gap_s",
        **POSITIVE,
    )
    window: float = option(
        WINDOW,
        "Length of the windows of sightings whose rank is judged together; 0 judges none",
        key="window_s",
        **AMOUNT,
    )
    portion: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        super(ReplaySettings, self).__post_init__()
        _check_amounts({name: getattr(self, name) for name in self.lasting_errors().values()})
        _check_amounts({one.name: getattr(self.noise, one.name) for one in fields(self.noise)})
        if STARTS[self.start].needs_truth == (self.start_poses is not None):
            problem = "poses belong to a start that is given, and only to such"
            raise InputError(problem, key="start_poses")

    def check_start(self, name: str, *, has_truth: bool) -> None:
        """Raise InputError if the start needs truth that the recording `name` lacks."""
        if STARTS[self.start].needs_truth and not has_truth:
            problem = (
                f"{self.start!r} needs the truth, which {name} does not hold; give the start: "
                "'given' with start_poses (--start given --start-poses ...)"
            )
            raise InputError(problem, key="start")

    @staticmethod
    def lasting_errors() -> Mapping[str, str]:
        """Return the lasting errors that can be states of the filter, and their settings."""
        names = ("speed_scale", "turn_rate_bias", "bearing_bias", "bearing_walk")
        return {name: f"{name}_sigma" for name in names}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions(ReplaySettings):
    """Options of a replay: settings, single sigmas of its noise, and options of the filter."""

    speed_sigma: float = option(
        GROUND_ROBOTS.speed_sigma,
        "Sigma of the speed that the filter assumes, per sample",
        key="speed_sigma_mps",
        **AMOUNT,
    )
    turn_rate_sigma: float = option(
        GROUND_ROBOTS.turn_rate_sigma,
        "Sigma of the turn rate that the filter assumes, per sample",
        key="turn_rate_sigma_rad_s",
        **AMOUNT,
    )
    position_sigma: float | None = option(
        None,
        "Sigma of each start coordinate; by default 0.01, 5 or 1 for start truth, prior or given",
        key="start_sigma_m",
        **AMOUNT,
    )
    heading_sigma: float | None = option(
        None,
        "Sigma of each start heading; by default 0.01, 0.5 or 0.2 for start truth, prior or given",
        key="start_sigma_rad",
        **AMOUNT,
    )
    seed: int = option(0, "Seed of a start that is drawn", ge=0, le=LARGEST_SEED)
    tune: bool = option(False, "Fit sigmas and delay to the first third, and run on the rest")
    filter: RecordingFilterName = option("robust", "Which filter runs")
    gate_probability: float = option(
        0.999,
        "Probability of the innovation gate; 1 accepts every sighting",
        flag="--gate",
        gt=0,
        le=1,
    )
    with_series: bool = option(False, "Add errors and sigmas over time to the report", key="series")

    def __post_init__(self) -> None:
        super(ReplayOptions, self).__post_init__()
        own = ("speed_sigma", "turn_rate_sigma", "position_sigma", "heading_sigma")
        _check_amounts({name: getattr(self, name) for name in own})

    @property
    def settings(self) -> ReplaySettings:
        """Settings of the replay."""
        place, heading = STARTS[self.start].sigmas
        noise = Noise(
            speed_sigma=self.speed_sigma,
            turn_rate_sigma=self.turn_rate_sigma,
            position_sigma=place if self.position_sigma is None else self.position_sigma,
            heading_sigma=heading if self.heading_sigma is None else self.heading_sigma,
        )
        own = {one.name: getattr(self, one.name) for one in options_of(ReplaySettings)}
        return ReplaySettings(**own, noise=noise)

    @property
    def filter_options(self) -> FilterOptions:
        """Options of the filter, without a gate if it accepts every sighting."""
        return FilterOptions(
            trials=1,
            seed=self.seed,
            filter=self.filter,
            gate_probability=None if self.gate_probability == 1.0 else self.gate_probability,
            with_series=self.with_series,
        )


def _check_amounts(values: Mapping[str, float | None]) -> None:
    """Raise InputError for a nonzero sigma that is too small or too large to compute with."""
    for name, value in values.items():
        if value and not LEAST_SIGMA <= value <= LARGEST_SIGMA:
            allowed = f"allowed is {LEAST_SIGMA:g} to {LARGEST_SIGMA:g}, or 0"
            raise InputError(f"{value:g} given; {allowed}", key=name)
