"""What a vehicle does that nobody has sighted for long: it comes nearer to those who could.

After `patience` steps in which it has neither made a sighting nor been sighted, a vehicle flies its
circle moved towards its meeting point, one that more of the team can see, until it is sighted;
then its circle is moved back. Phases stay, so that others are met when they pass.
"""

from syncplan.arrays import Array
from syncplan.estimation.lane_filter import Lanes, inner
from syncplan.flight.flight_setup import FlightSetup, Flown

__all__ = ["seek"]


@inner
def seek(flight: FlightSetup, flown: Flown, step: int, x: Array, lanes: Lanes) -> None:
    """Move the circles of vehicles that look for others, and those of others back."""
    steering = flight.steering
    for i in range(len(x)):
        for lane in range(len(lanes)):
            waited = step - flown.seen[i, lane]
            if waited > steering.patience:
                flown.sought[i, lane] += 1
                flown.moved[i, 0, lane] = steering.meeting_points[i, 0]
                flown.moved[i, 1, lane] = steering.meeting_points[i, 1]
            else:
                flown.moved[i, 0, lane] = 0.0
                flown.moved[i, 1, lane] = 0.0
