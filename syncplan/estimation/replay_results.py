"""Results of a replay: counts of readings, estimates, and errors where truth is recorded."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.errors import InputError
from syncplan.estimation.consistency import Consistency
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.recorded_observability import SeenOverTime
from syncplan.estimation.recorded_readings import Clock, LeftOut
from syncplan.estimation.recorded_run import Lasting
from syncplan.estimation.replay_settings import ReplaySettings
from syncplan.estimation.replay_tuning import Tuning
from syncplan.estimation.trials import Accuracy, MonteCarloResult
from syncplan.orbits.noise import Noise
from syncplan.recordings.log import Log
from syncplan.results.result import Result


@dataclass(frozen=True, slots=True)
class KindCounts:
    """Counts of readings of one kind of sighting, by their use in the filter.

    Attributes
    ----------
    used, rejected : numbers that the gate accepted and rejected
    left_out : numbers that the filter did not receive
    nis : consistency of the innovations of used ones
    lasting : scatter of sums of these innovations
    """

    used: int
    rejected: int
    left_out: LeftOut
    nis: Consistency
    lasting: Lasting


@dataclass(frozen=True, slots=True)
class FittedError:
    """Final estimate of a lasting error of one robot's odometry or camera.

    Attributes
    ----------
    name, robot, unit : name in ERROR_STATES, name of the robot, unit in words
    value, sigma : in that unit
    """

    name: str
    robot: str
    unit: str
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class ErrorsFromTruth:
    """Errors of the filter against the recorded truth.

    Attributes
    ----------
    accuracy : RMS errors by robot
    coverage : (n,) share of coordinates within the filter's own three sigma
    anees : consistency of errors and covariance
    """

    accuracy: Accuracy
    coverage: Array
    anees: Consistency


@dataclass(frozen=True, slots=True, repr=False)
class Replay(Result):
    """Result of the filter on a recording, with errors where truth is recorded.

    Attributes
    ----------
    log : the recording
    landmarks : names, or numbers, of the landmarks whose sightings were used
    settings : assumptions of the filter
    options : the filter and its gate
    clock : samples at which errors were evaluated
    known : (samples + 1,) whether the truth is known at them; errors elsewhere do not count
    result : one trial's errors; if the recording has no truth, estimates stand for errors, and the
        series is always kept
    estimates : (samples + 1, n, 3) m, m, rad, estimated poses, headings wrapped; no rows unless a
        series was kept
    from_truth : errors; None if the recording has no truth
    nis : consistency of the innovations of all kinds of sighting
    counts : by name of the kind of sighting, of the requested kinds
    lasting_errors : final estimates
    seen : observability over windows of the sightings; None if none is judged
    tuning : fit of sigmas and delay to the part before, with its verdict; None without a fit
    """

    log: Log
    landmarks: tuple[int | str, ...]
    settings: ReplaySettings
    options: FilterOptions
    clock: Clock
    known: Flags
    result: MonteCarloResult
    estimates: Array
    from_truth: ErrorsFromTruth | None
    nis: Consistency
    counts: dict[str, KindCounts]
    lasting_errors: tuple[FittedError, ...]
    seen: SeenOverTime | None
    tuning: Tuning | None = None

    def __repr__(self) -> str:
        """Return one line: number of robots, duration and error."""
        said = "no truth"
        if self.from_truth is not None:
            said = f"RMS {float(self.accuracy.overall().position):.3g} m"
        return (
            f"<{type(self).__name__}: {len(self.log.robots)} robots over {self.duration:.4g} s, "
            f"{said}>"
        )

    @property
    def accuracy(self) -> Accuracy:
        """RMS errors by robot; raises InputError if the recording has no truth."""
        return self._known().accuracy

    @property
    def coverage(self) -> Array:
        """Share (n,) of coordinates within three sigma; raises InputError as `accuracy` does."""
        return self._known().coverage

    @property
    def anees(self) -> Consistency:
        """Consistency of errors and covariance; raises InputError as `accuracy` does."""
        return self._known().anees

    def _known(self) -> ErrorsFromTruth:
        if self.from_truth is None:
            problem = "holds no truth, so errors are not known; the estimates are (estimates)"
            raise InputError(problem, source=self.log.name)
        return self.from_truth

    @property
    def gate_probability(self) -> float:
        """Probability of the innovation gate; 1 accepts all sightings."""
        return 1.0 if self.options.gate_probability is None else self.options.gate_probability

    @property
    def begin(self) -> float:
        """Beginning of the run in s, by the recording's clock."""
        return self.clock.begin

    @property
    def duration(self) -> float:
        """Duration in s."""
        return self.clock.duration

    @property
    def sample_time(self) -> float:
        """Sample time in s."""
        return self.clock.sample_time

    @property
    def unknown_truth_s(self) -> float:
        """Time in s for which the recording has truth, but too far apart to compare with."""
        return float(np.sum(~self.known)) * self.sample_time

    @property
    def meetings(self) -> bool:
        """Whether sightings between robots were used."""
        return self.settings.meetings

    @property
    def bearing_sigma(self) -> float:
        """Standard deviation of a bearing that the filter assumed, rad."""
        return self.settings.bearing_sigma

    @property
    def noise(self) -> Noise:
        """Noise of motion readings and of the start that the filter assumed."""
        return self.settings.noise

    @property
    def bearings(self) -> KindCounts:
        """Counts of bearings."""
        return self.counts["bearing"]

    @property
    def unknown(self) -> int:
        """Number of bearings of an unknown subject."""
        return self.bearings.left_out.unknown

    @property
    def not_asked_for(self) -> int:
        """Number of bearings of landmarks or robots that the settings exclude."""
        return self.bearings.left_out.not_asked_for

    @property
    def outside(self) -> int:
        """Number of requested bearings from before or after the run."""
        return self.bearings.left_out.outside
