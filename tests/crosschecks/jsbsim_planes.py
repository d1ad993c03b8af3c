"""Somebody else's aeroplanes: Cessna 172s of JSBSim under simple autopilot loops.

JSBSim (pypi.org/project/jsbsim; Berndt, "JSBSim: An open source flight dynamics model in C++",
AIAA 2004-4923) has the aircraft in its wheel. A turn is banked for, v tan(bank) = g w, with what
the heading has fallen behind the integral of the commanded turn rates; throttle holds air speed,
elevator height. A plane starts trimmed and flies its first command for SETTLE, so that the flight
finds it in its circle. The earth is taken for flat: places are integrals of ground velocities.
"""

import math
import os
from typing import Any

import numpy as np

from syncplan.arrays import Array
from tests.crosschecks.plants import Done

STEP = 1.0 / 120.0
"""s, of JSBSim and of the autopilot."""

SETTLE = 60.0
"""s of flight before the first sample."""

AIRCRAFT, HEIGHT, FOOT, G = "c172p", 1000.0, 0.3048, 9.80665

MOST_BANK = math.radians(40.0)
BEHIND, MOST_BEHIND = 0.15, 0.2
"""1/s of turn rate for a heading behind its reference, and by how many rad it may be behind."""

BANK_GAINS, PITCH_GAINS = (3.0, 0.8), (3.0, 1.2)
"""Per rad and per rad/s."""

RUDDER_GAINS = (1.0, 2.0)
"""Per rad of sideslip, and per rad/s of yaw rate off that of a coordinated turn."""

CLIMB_GAIN, CLIMB_RATE_GAIN, CLIMB_INTEGRAL = 0.004, 0.012, 0.0008
"""rad of pitch for a m of height, a m/s of climb, a m s of height's integral."""

THROTTLE_GAIN, THROTTLE_INTEGRAL = 0.20, 0.03
"""Per m/s and per m."""


class _Plane:
    """One aeroplane and its autopilot."""

    def __init__(self, pose: Array, command: Array, wind: Array) -> None:
        speed, turn_rate = map(float, command)
        begun = float(pose[2]) - SETTLE * turn_rate
        self._model = model = _trimmed(0.5 * math.pi - begun, speed)
        self._throttle, self._pitch = model["fcs/throttle-cmd-norm"], model["attitude/theta-rad"]
        self._aileron = model["fcs/aileron-cmd-norm"]
        self._climb = 0.0
        self.yaw = self._reference = begun
        self._place = np.zeros(2)
        self._speed = 0.0
        for _ in range(round(SETTLE / STEP)):
            self._step(speed, turn_rate, wind)
        self._place = np.array(pose[:2])

    def fly(self, command: Array, wind: Array, steps: int) -> tuple[float, ...]:
        """Return x, y m and yaw rad after as many steps, and the mean air speed m/s."""
        (speed, turn_rate), total = map(float, command), 0.0
        for _ in range(steps):
            self._step(speed, turn_rate, wind)
            total += self._speed
        return float(self._place[0]), float(self._place[1]), self.yaw, total / steps

    def _step(self, speed: float, turn_rate: float, wind: Array) -> None:
        model = self._model
        model["atmosphere/wind-east-fps"] = wind[0] / FOOT
        model["atmosphere/wind-north-fps"] = wind[1] / FOOT
        self._turn(speed, turn_rate)
        self._hold(speed)
        before = np.array([model["velocities/v-east-fps"], model["velocities/v-north-fps"]])
        model.run()
        after = np.array([model["velocities/v-east-fps"], model["velocities/v-north-fps"]])
        self._place += 0.5 * STEP * FOOT * (before + after)
        yaw = 0.5 * math.pi - model["attitude/psi-rad"]
        self.yaw += math.remainder(yaw - self.yaw, 2.0 * math.pi)
        air = FOOT * after - wind
        self._speed = float(air[0] * math.cos(self.yaw) + air[1] * math.sin(self.yaw))

    def _turn(self, speed: float, turn_rate: float) -> None:
        """Bank for the turn, and for what the heading is behind."""
        model = self._model
        reference = self._reference + STEP * turn_rate
        self._reference = min(max(reference, self.yaw - MOST_BEHIND), self.yaw + MOST_BEHIND)
        rate = turn_rate + BEHIND * (self._reference - self.yaw)
        # to the left, as turn rates are counted; JSBSim's bank and ailerons are to the right
        bank = -min(max(math.atan(speed * rate / G), -MOST_BANK), MOST_BANK)
        gain, damping = BANK_GAINS
        banked, rolling = model["attitude/phi-rad"], model["velocities/p-rad_sec"]
        model["fcs/aileron-cmd-norm"] = self._aileron + gain * (bank - banked) - damping * rolling
        gain, damping = RUDDER_GAINS
        swinging = model["velocities/r-rad_sec"] - G / speed * math.sin(banked)
        model["fcs/rudder-cmd-norm"] = damping * swinging - gain * model["aero/beta-rad"]

    def _hold(self, speed: float) -> None:
        """Hold height by pitch, and air speed by throttle."""
        model = self._model
        low = HEIGHT - FOOT * model["position/h-sl-ft"]
        self._climb += STEP * CLIMB_INTEGRAL * low
        pitch = self._pitch + self._climb + CLIMB_GAIN * low
        pitch -= CLIMB_RATE_GAIN * FOOT * model["velocities/h-dot-fps"]
        gain, damping = PITCH_GAINS
        off, pitching = pitch - model["attitude/theta-rad"], model["velocities/q-rad_sec"]
        model["fcs/elevator-cmd-norm"] = -gain * off + damping * pitching
        slow = speed - self._speed if self._speed else 0.0
        wanted = self._throttle + THROTTLE_GAIN * slow
        if 0.0 < wanted < 1.0:
            self._throttle += STEP * THROTTLE_INTEGRAL * slow
        model["fcs/throttle-cmd-norm"] = min(max(wanted, 0.0), 1.0)


class JsbsimPlanes:
    """k aeroplanes; see `tests.crosschecks.plants`."""

    def __init__(self, poses: Array, commands: Array, wind: Array, time: float) -> None:
        self._steps = round(time / STEP)
        if abs(self._steps * STEP - time) > 1e-9:
            raise ValueError(f"a sample of {time} s is not a whole number of steps of 1/120 s")
        self._planes = [_Plane(*one) for one in zip(poses, commands, wind, strict=True)]
        self._yaw = np.array([plane.yaw for plane in self._planes])

    def fly(self, commands: Array, wind: Array, disturbance: Array) -> Done:
        """Return what they do in the next sample, as Plant has it."""
        asked = zip(self._planes, commands + disturbance, wind, strict=True)
        rows = np.array([one.fly(command, air, self._steps) for one, command, air in asked])
        turned, self._yaw = rows[:, 2] - self._yaw, rows[:, 2]
        means = np.column_stack([rows[:, 3], turned / (self._steps * STEP)])
        return Done(rows[:, :3], means)


def _trimmed(heading: float, speed: float) -> Any:
    """A model in level flight at `heading` rad from north, clockwise, and `speed` m/s."""
    os.environ.setdefault("JSBSIM_DEBUG", "0")
    import jsbsim

    model = jsbsim.FGFDMExec(None)
    model.set_debug_level(0)
    model.load_model(AIRCRAFT)
    model.set_dt(STEP)
    model["ic/h-sl-ft"], model["ic/vt-fps"] = HEIGHT / FOOT, speed / FOOT
    model["ic/psi-true-rad"], model["ic/gamma-deg"] = heading % (2.0 * math.pi), 0.0
    model.run_ic()
    model["propulsion/set-running"] = -1
    model["fcs/mixture-cmd-norm"], model["fcs/throttle-cmd-norm"] = 0.9, 0.7
    model["simulation/do_simple_trim"] = 1
    return model
