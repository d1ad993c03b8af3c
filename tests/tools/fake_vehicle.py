"""A small vehicle that speaks MAVLink on loopback: beats, takes missions, keeps what it is sent.

What ArduPilot keeps of loiter turns is written out here from AP_Mission.cpp, in bytes, apart from
syncplan's own account of it.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tests.tools.processes import PATIENCE_S

# pymavlink chooses its dialect as it is imported
os.environ.setdefault("MAVLINK20", "1")

MISSION_ITEM, LOITER_TURNS = 16, 18
PX4_ACCEPTS = {16, 17, 19, 20, 21, 22, 31, 177, 178}
UNSUPPORTED, ACCEPTED = 3, 0
AUTOPILOTS = {"ardupilot": 3, "px4": 12}


@dataclass(frozen=True, slots=True)
class StoredLoiter:
    """What ArduPilot makes of loiter turns: turns, radius in m, whether counter-clockwise."""

    turns: int
    radius: int
    ccw: bool


def stored_loiter(turns: float, radius: float) -> StoredLoiter:
    """Return what ArduPilot stores of parameters 1 and 3: bytes, the radius in tens above 255."""
    size, tens = abs(radius), abs(radius) > 255
    low = min(255, int(turns))
    high = min(255, int(size * 0.1)) if tens else int(size)
    return StoredLoiter(low & 0xFF, (high & 0xFF) * (10 if tens else 1), radius < 0)


@dataclass(slots=True)
class FakeVehicle:
    """A vehicle that sends heartbeats to `port` and takes what missions it is sent."""

    port: int
    autopilot: str = "ardupilot"
    items: list[Any] = field(default_factory=list)
    answer: int | None = None
    stopped: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        """Beat and answer until stopped."""
        from pymavlink import mavutil

        link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{self.port}", source_system=1, source_component=1
        )
        try:
            while not self.stopped.is_set():
                link.mav.heartbeat_send(2, AUTOPILOTS[self.autopilot], 0, 0, 3)
                self._listen(link)
        finally:
            link.close()

    def _listen(self, link: Any) -> None:
        """Answer what comes for a fifth of a second of silence."""
        while not self.stopped.is_set():
            message = link.recv_match(blocking=True, timeout=0.2)
            if message is None:
                return
            self._react(link, message)

    def _react(self, link: Any, message: Any) -> None:
        kind, sender = message.get_type(), (message.get_srcSystem(), message.get_srcComponent())
        if kind == "COMMAND_LONG":
            link.mav.command_ack_send(message.command, UNSUPPORTED, 0, 0, *sender)
        elif kind == "MISSION_COUNT":
            self.items, self.expected = [], message.count
            link.mav.mission_request_int_send(*sender, 0, 0)
        elif kind == "MISSION_ITEM_INT" and message.seq == len(self.items):
            if self.autopilot == "px4" and message.command not in PX4_ACCEPTS:
                self.answer = UNSUPPORTED
                link.mav.mission_ack_send(*sender, UNSUPPORTED, 0)
                return
            self.items.append(message)
            if len(self.items) < self.expected:
                link.mav.mission_request_int_send(*sender, len(self.items), 0)
            else:
                self.answer = ACCEPTED
                link.mav.mission_ack_send(*sender, ACCEPTED, 0)

    expected: int = 0


@contextmanager
def flying(port: int, autopilot: str) -> Iterator[FakeVehicle]:
    """Run a vehicle in a thread of its own."""
    vehicle = FakeVehicle(port, autopilot)
    thread = threading.Thread(target=vehicle.run)
    thread.start()
    try:
        yield vehicle
    finally:
        vehicle.stopped.set()
        thread.join(timeout=PATIENCE_S)
        assert not thread.is_alive()
