"""The record of a flight that a plan was given: what its verdict takes into account."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FlownVehicleRecord:
    """How one vehicle flew, over the second half of all trials.

    Attributes
    ----------
    name : the vehicle's
    phase_rms, phase_worst : s, ahead of the plan or behind it
    tracking_rms : m, from the plan's place
    speeds : m/s, least and largest airspeed that was commanded, once a steady state is reached,
        holds apart
    """

    name: str
    phase_rms: float
    phase_worst: float
    tracking_rms: float
    speeds: tuple[float, float]


@dataclass(frozen=True, slots=True)
class FlownPairRecord:
    """How many of their meetings in the plan two bodies kept.

    Attributes
    ----------
    between : names, of a vehicle and a vehicle or landmark
    meetings : in the plan, in a trial
    kept_share : of all trials' meetings, those in which a sighting was made
    """

    between: tuple[str, str]
    meetings: int
    kept_share: float


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """What flying a plan has found.

    Attributes
    ----------
    trials, seed : of the flight
    duration : s
    guidance, filter : by name
    events : what happened on the way, in words; empty where nothing did
    lost_share : of trials in which a filter was lost
    out_of_contact_share : of trials in which a vehicle was out of contact
    separations : m, closest approach of the median and of the worst trial; None for one vehicle
    too_close_share : of trials below the separation asked; None where none is
    vehicles : of those there to the end, in order
    pairs : that meet in the plan; none in older files
    saturated_share : of samples with a command at a limit; None in older files
    """

    trials: int
    seed: int
    duration: float
    guidance: str
    filter: str
    events: tuple[str, ...]
    lost_share: float
    out_of_contact_share: float
    separations: tuple[float, float] | None
    too_close_share: float | None
    vehicles: tuple[FlownVehicleRecord, ...]
    pairs: tuple[FlownPairRecord, ...] = ()
    saturated_share: float | None = None
