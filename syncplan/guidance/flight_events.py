"""Events of a flight: losses and holds at their times, and checks of late or mistaken sightings.

Events are written as on the command line: v3@60 loses vehicle v3 at 60 s, sensor:v3@60 its sensor,
L1@60 landmark L1; v2@100:20 holds vehicle v2 from 100 s on for 20 s.
"""

import math
from dataclasses import dataclass

from syncplan.errors import InputError
from syncplan.guidance.flight_options import FlightOptions
from syncplan.orbits.lost_parts import lost_together, phrase_of
from syncplan.orbits.sightings import Loss, samples_before, steps_within
from syncplan.scenario.specification import Scenario


@dataclass(frozen=True, slots=True)
class TimedLoss:
    """Loss of a vehicle, sensor or landmark at a time in s; `name` is as given."""

    name: str
    loss: Loss
    time: float

    @property
    def sentence(self) -> str:
        """The event in one sentence."""
        return f"{phrase_of(self.name)} is lost at {self.time:g} s"


@dataclass(frozen=True, slots=True)
class Hold:
    """Hold of a vehicle, by name and number, from `time` s for `length` s.

    The vehicle stands still in the air and drifts with the wind. If it has a least speed, it flies
    the smallest circles it can.
    """

    name: str
    vehicle: int
    time: float
    length: float

    @property
    def sentence(self) -> str:
        """The event in one sentence."""
        return f"{self.name} is held from {self.time:g} s for {self.length:g} s"


@dataclass(frozen=True, slots=True)
class FlightEvents:
    """Losses and holds of a flight, in order of time."""

    losses: tuple[TimedLoss, ...] = ()
    holds: tuple[Hold, ...] = ()

    @property
    def sentences(self) -> list[str]:
        """The events as sentences, in order of time."""
        timed: list[TimedLoss | Hold] = [*self.losses, *self.holds]
        found = sorted(timed, key=lambda one: one.time)
        return [one.sentence for one in found]


@dataclass(frozen=True, slots=True)
class _FlightTime:
    """Duration of a flight, in s and in samples."""

    duration: float
    sample_time: float

    @property
    def steps(self) -> int:
        return steps_within(self.duration, self.sample_time)

    def first_step(self, time: float) -> int:
        """Return the first step at or after a time."""
        return samples_before(time, self.sample_time)


def events_of(options: FlightOptions, scenario: Scenario, duration: float) -> FlightEvents:
    """Return the events that the options name, in a flight of `duration` s.

    Raises InputError, key `lose` or `hold`, for a malformed text, an unknown name, a time outside
    the flight, and for a part that is lost or held twice; key `late` if sightings never arrive, key
    `mistaken` if no other vehicle could be sighted instead.
    """
    run = _FlightTime(duration, scenario.sample_time)
    _check_sightings(options, scenario, run)
    losses = sorted((_loss(text, scenario, run) for text in options.lose), key=_time_of)
    if losses:
        lost_together([one.name for one in losses], scenario)
    holds = sorted((_hold(text, scenario, run) for text in options.hold), key=_time_of)
    for k, one in enumerate(holds):
        for other in holds[:k]:
            if other.vehicle == one.vehicle and other.time + other.length > one.time:
                problem = f"{one.name} is held twice at {one.time:g} s; give one hold"
                raise InputError(problem, key="hold")
        gone = next((loss for loss in losses if one.vehicle in loss.loss.vehicles), None)
        if gone is not None and one.time + one.length > gone.time:
            problem = f"{one.name} is lost at {gone.time:g} s; end its hold before"
            raise InputError(problem, key="hold")
    return FlightEvents(tuple(losses), tuple(holds))


def _time_of(event: TimedLoss | Hold) -> float:
    return event.time


def _check_sightings(options: FlightOptions, scenario: Scenario, run: _FlightTime) -> None:
    if options.late >= run.steps:
        problem = f"{options.late} given, the flight has {run.steps} samples; give fewer"
        raise InputError(problem, key="late")
    others = scenario.size - 2 if not scenario.landmarks else scenario.size - 1
    if options.mistaken > 0.0 and others < 1:
        problem = f"{options.mistaken:g} given, but no other vehicle could be sighted instead"
        raise InputError(f"{problem}; leave it out", key="mistaken")


def _loss(text: str, scenario: Scenario, run: _FlightTime) -> TimedLoss:
    name, at, when = text.rpartition("@")
    if not at:
        raise InputError(f"{text!r} has no time; give it as v3@60, in s", key="lose")
    time = _time(when, text, "lose", "v3@60", run)
    return TimedLoss(name, lost_together([name], scenario), time)


def _hold(text: str, scenario: Scenario, run: _FlightTime) -> Hold:
    name, at, rest = text.rpartition("@")
    when, colon, long = rest.partition(":")
    if not (at and colon):
        problem = f"{text!r} is not a hold; give it as v2@100:20, from 100 s for 20 s"
        raise InputError(problem, key="hold")
    names = scenario.vehicle_names
    if name not in names:
        problem = f"{text}: no vehicle is named {name}; vehicles are {_shown(names)}"
        raise InputError(problem, key="hold")
    time = _time(when, text, "hold", "v2@100:20", run)
    length = _number(long, text, "hold", "v2@100:20")
    if not length > 0.0:
        raise InputError(f"{text}: {length:g} s is not a length; give more than 0 s", key="hold")
    end = time + length
    if end - run.duration > 1e-9 * run.sample_time:
        most = f"{name}@{time:g}:{run.duration - time:.6g}"
        problem = f"{text}: ends at {end:g} s, after the flight of {run.duration:g} s"
        raise InputError(f"{problem}; give at most {most}", key="hold")
    if run.first_step(end) == run.first_step(time):
        problem = f"{text}: no sample begins in this time; samples are {run.sample_time:g} s long"
        raise InputError(f"{problem}, give a longer hold", key="hold")
    return Hold(name, names.index(name), time, length)


def _time(text: str, whole: str, key: str, example: str, run: _FlightTime) -> float:
    time, until = _number(text, whole, key, example), run.duration
    if not 0.0 <= time < until:
        problem = f"{whole}: {time:g} s is outside the flight, which is from 0 to {until:g} s"
        raise InputError(f"{problem}; give one before its end", key=key)
    if run.first_step(time) >= run.steps:
        last = (run.steps - 1) * run.sample_time
        problem = f"{whole}: the last sample of the flight begins at {last:.6g} s"
        raise InputError(f"{problem}; give a time up to then", key=key)
    return time


def _number(text: str, whole: str, key: str, example: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        problem = f"{whole!r}: {text!r} is not a number of seconds; give it as {example}"
        raise InputError(problem, key=key)
    return found


def _shown(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{names[0]} to {names[-1]}"
