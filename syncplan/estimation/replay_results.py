"""What a replay found: what became of readings, estimates, and errors where truth is recorded."""

from dataclasses import dataclass

from syncplan.arrays import Array
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
from syncplan.results import Result


@dataclass(frozen=True, slots=True)
class KindCounts:
    """Counts of readings of one kind of sighting, by what the filter did with them.

    Attributes
    ----------
    used, rejected : number that the gate accepted, and that it did not
    left_out : those that the filter was not given
    nis : of the used ones
    lasting : how their innovations add up
    """

    used: int
    rejected: int
    left_out: LeftOut
    nis: Consistency
    lasting: Lasting


@dataclass(frozen=True, slots=True)
class FittedError:
    """A lasting error of one robot's odometry or camera, as the filter has it at the end.

    Attributes
    ----------
    name, robot, unit : name in ERROR_STATES, of the robot, unit in words
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
    """The filter on a recording, and its errors where truth is recorded.

    Attributes
    ----------
    log : the recording
    landmarks : l names, or numbers, of the landmarks whose sightings were used
    settings : what the filter assumed
    options : which filter, and its gate
    clock : when errors were taken
    result : one trial's errors; where the recording has no truth, estimates stand for errors, and
        the series is always kept
    estimates : (samples + 1, n, 3) m, m, rad where robots are taken to be, headings wrapped; no
        rows unless a series was kept
    from_truth : errors; None where the recording has no truth
    nis : consistency of the innovations of all kinds of sighting
    counts : by name of the kind of sighting, of the kinds that were asked for
    lasting_errors : as the filter has them at the end
    seen : what windows of the sightings determined; None where none is judged
    tuning : how sigmas and delay were fitted to what came before, and whether the fit was taken;
        None where they were not
    """

    log: Log
    landmarks: tuple[int | str, ...]
    settings: ReplaySettings
    options: FilterOptions
    clock: Clock
    result: MonteCarloResult
    estimates: Array
    from_truth: ErrorsFromTruth | None
    nis: Consistency
    counts: dict[str, KindCounts]
    lasting_errors: tuple[FittedError, ...]
    seen: SeenOverTime | None
    tuning: Tuning | None = None

    def __repr__(self) -> str:
        """Return one line: how many robots, how long, and the error."""
        said = "no truth"
        if self.from_truth is not None:
            said = f"RMS {float(self.accuracy.overall().position):.3g} m"
        return (
            f"<{type(self).__name__}: {len(self.log.robots)} robots over {self.duration:.4g} s, "
            f"{said}>"
        )

    @property
    def accuracy(self) -> Accuracy:
        """RMS errors by robot; raises InputError where the recording has no truth."""
        return self._known().accuracy

    @property
    def coverage(self) -> Array:
        """(n,) share of coordinates within three sigma; raises InputError as `accuracy` does."""
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
        """Of the innovation gate; 1 accepts all."""
        return 1.0 if self.options.gate_probability is None else self.options.gate_probability

    @property
    def begin(self) -> float:
        """When the run begins by the recording's clock, s."""
        return self.clock.begin

    @property
    def duration(self) -> float:
        """In s."""
        return self.clock.duration

    @property
    def sample_time(self) -> float:
        """In s."""
        return self.clock.sample_time

    @property
    def meetings(self) -> bool:
        """Whether sightings between robots were used."""
        return self.settings.meetings

    @property
    def bearing_sigma(self) -> float:
        """Standard deviation that the filter assumed, rad."""
        return self.settings.bearing_sigma

    @property
    def noise(self) -> Noise:
        """Noise that the filter assumed of motion readings and the start."""
        return self.settings.noise

    @property
    def bearings(self) -> KindCounts:
        """Counts of bearings."""
        return self.counts["bearing"]

    @property
    def unknown(self) -> int:
        """Number of bearings of a subject that there is not."""
        return self.bearings.left_out.unknown

    @property
    def not_asked_for(self) -> int:
        """Number of bearings of landmarks or robots left out on purpose."""
        return self.bearings.left_out.not_asked_for

    @property
    def outside(self) -> int:
        """Number of bearings asked for, but from before or after the run."""
        return self.bearings.left_out.outside
