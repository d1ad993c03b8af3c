"""A team of processes that steers by the commands of its navigator, over JSON lines.

Each vehicle is a process of its own: it obeys commands, drifts with a wind that it does not know,
and measures bearings. This program stands for the radio and the ground station: it carries lines
between the vehicles and runs the navigator, which knows nothing but what the vehicles have read.

    to a vehicle      {"command": [speed, turn rate]}          from it   {"pose": [x, y, heading]}
                      {"bodies": {"v2": [x, y], ...}}                    {"sightings": [...]}

The pose is there for its neighbours' cameras, and to say in the end how far the estimate was off.
"""

import json
import math
import random
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import syncplan
from syncplan.flight.onboard_data import Sensed

SCENARIO = Path(__file__).parent / "scenarios" / "windy-grid.yaml"
WIND_MPS = (0.7, -0.4)


@dataclass(frozen=True)
class Found:
    """RMS over the vehicles in the last quarter: of the estimates, and from the planned places."""

    estimation_m: float
    tracking_m: float
    wind_mps: tuple[float, float]


def fly_vehicle(name: str, start: list[float], sensing: dict[str, float]) -> None:
    """Be a vehicle: read lines, answer lines, until there are no more."""
    draw, (x, y, heading), time = random.Random(name), start, sensing["time"]
    for line in sys.stdin:
        asked = json.loads(line)
        if "command" in asked:
            speed = asked["command"][0] + draw.gauss(0.0, sensing["speed_sigma"])
            turn = time * (asked["command"][1] + draw.gauss(0.0, sensing["turn_rate_sigma"]))
            x += time * (speed * math.cos(heading + 0.5 * turn) + WIND_MPS[0])
            y += time * (speed * math.sin(heading + 0.5 * turn) + WIND_MPS[1])
            heading += turn
            answer: dict[str, Any] = {"pose": [x, y, heading]}
        else:
            near = {
                body: math.atan2(place[1] - y, place[0] - x) - heading
                for body, place in asked["bodies"].items()
                if math.hypot(place[0] - x, place[1] - y) <= sensing["range"]
            }
            answer = {
                "sightings": [
                    [name, body, "bearing", bearing + draw.gauss(0.0, sensing["bearing_sigma"])]
                    for body, bearing in near.items()
                ]
            }
        print(json.dumps(answer), flush=True)


def main(duration: float = 120.0) -> Found:
    """Fly a team of processes for so many seconds; return how it went."""
    plan = syncplan.plan(syncplan.load_scenario(SCENARIO), pilot=False)
    scenario, sensors, time = plan.scenario, plan.sensors, plan.sensors.sample_time
    sensing = {
        "time": time,
        "range": float(sensors.ranges[0]),
        "bearing_sigma": float(sensors.bearing_sigmas[0]),
        "speed_sigma": plan.noise.speed_sigma,
        "turn_rate_sigma": plan.noise.turn_rate_sigma,
    }
    navigator = syncplan.Navigator(plan)
    draws = np.random.default_rng(1).standard_normal((plan.team.count, 3))
    poses = planned(plan, 0.0) + draws * [2.0, 2.0, 0.05]
    vehicles = [
        subprocess.Popen(
            [sys.executable, __file__, json.dumps([name, pose, sensing])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for name, pose in zip(scenario.vehicle_names, poses.tolist(), strict=True)
    ]
    landmarks = dict(zip(scenario.landmark_names, plan.landmarks.tolist(), strict=True))
    squares, steps = [], round(duration / time)
    try:
        for step in range(1, steps + 1):
            command = navigator.command
            commands = np.column_stack([command.speeds, command.turn_rates]).tolist()
            answers = [ask(v, {"command": c}) for v, c in zip(vehicles, commands, strict=True)]
            true = np.array([answer["pose"] for answer in answers])
            places = dict(zip(scenario.vehicle_names, true[:, :2].tolist(), strict=True))
            seen = []
            for name, vehicle in zip(places, vehicles, strict=True):
                bodies = {body: at for body, at in (places | landmarks).items() if body != name}
                seen += ask(vehicle, {"bodies": bodies})["sightings"]
            estimate, _ = navigator.step(Sensed(sightings=navigator.named(seen)))
            off = estimate.poses - true, planned(plan, step * time) - true
            if 4 * step > 3 * steps:
                squares.append([np.square(one[:, :2]).sum(axis=1).mean() for one in off])
    finally:
        for vehicle in vehicles:
            vehicle.communicate()
    estimation, tracking = np.sqrt(np.mean(squares, axis=0)).tolist()
    return Found(estimation, tracking, (float(estimate.errors[0]), float(estimate.errors[1])))


def ask(vehicle: "subprocess.Popen[str]", line: dict[str, Any]) -> dict[str, Any]:
    """Send a vehicle a line; return its answer."""
    assert vehicle.stdin is not None
    assert vehicle.stdout is not None
    vehicle.stdin.write(json.dumps(line) + "\n")
    vehicle.stdin.flush()
    found: dict[str, Any] = json.loads(vehicle.stdout.readline())
    return found


def planned(plan: syncplan.Plan, time: float) -> np.ndarray:
    """Return the poses (n, 3) that the plan has at a time."""
    from syncplan.orbits.circles import heading, position

    return np.column_stack([position(plan.orbits, time), heading(plan.orbits, time)])


if __name__ == "__main__":
    if len(sys.argv) > 1:
        fly_vehicle(*json.loads(sys.argv[1]))
    else:
        found = main()
        print(f"estimates off by {found.estimation_m:.2f} m, vehicles {found.tracking_m:.2f} m")
        print(
            "wind found: {:.2f}, {:.2f} m/s; it is {:.2f}, {:.2f}".format(
                *found.wind_mps, *WIND_MPS
            )
        )
