"""A team placed from its graph: pairs that meet, two landmarks and an area, but no coordinates.

Placement finds centres whose linked circles come within range, inside the area and clear of a
building. `refine` then finds phases, and moves centres within the remaining room.
"""

import syncplan
from syncplan.scenario.loading import scenario_from

SCENARIO = {
    "name": "courtyard",
    "orbit": {"radius_m": 15.0, "angular_rate_rad_s": 0.25, "direction": "ccw"},
    "formation": {
        "links": [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"], ["c", "e"], ["e", "f"]],
    },
    "landmarks_m": {"gate": [10.0, 100.0], "mast": [10.0, 140.0]},
    "sensor": {"range_m": 40.0, "bearing_sigma_rad": 0.05},
    "area_m": [[0.0, 0.0], [240.0, 0.0], [240.0, 200.0], [0.0, 200.0]],
    "keep_out_m": [[[110.0, 80.0], [130.0, 80.0], [130.0, 120.0], [110.0, 120.0]]],
    "min_separation_m": 5.0,
    "refine": {"center_box_m": 20.0, "starts": 2},
}


def main() -> syncplan.Plan:
    """Return the refined plan of a team that was given by its links alone."""
    placed = syncplan.place(scenario_from(SCENARIO))
    return syncplan.refine(placed.scenario)


if __name__ == "__main__":
    refined = main()
    for name, center in zip(
        refined.scenario.vehicle_names, refined.orbits.centers.round(1), strict=True
    ):
        print(f"{name}: centre {center}")
    print("observable:", refined.observable, " predicted error, m:", refined.prediction.rms)
