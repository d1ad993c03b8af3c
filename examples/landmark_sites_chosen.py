"""Where to put two landmarks: the best pair of twelve sites round the grid.

The convex relaxation bounds what any pair can reach, and the search proves that no pair is better.
"""

from pathlib import Path

import syncplan
from syncplan.landmarks.site_choice import SiteChoice, choose_landmarks
from syncplan.scenario.loading import scenario_from

SCENARIO = Path(__file__).parent / "scenarios" / "paper-grid-same.yaml"
SITES = {
    f"{side}{k}": place
    for side, places in {
        "south": [(0.0, -45.0), (35.0, -45.0), (70.0, -45.0), (105.0, -45.0), (140.0, -45.0)],
        "north": [(0.0, 115.0), (35.0, 115.0), (70.0, 115.0), (105.0, 115.0), (140.0, 115.0)],
        "inner": [(35.0, 35.0), (105.0, 35.0)],
    }.items()
    for k, place in enumerate(places)
}


def main() -> SiteChoice:
    """Return the choice of two sites for a team that has no landmarks yet."""
    document = syncplan.load_scenario(SCENARIO).model_dump(exclude_none=True)
    document.pop("landmarks_m")
    return choose_landmarks(scenario_from(document), SITES, choose=2)


if __name__ == "__main__":
    choice = main()
    print("sites:", ", ".join(choice.names[k] for k in choice.chosen))
    print(f"window bound of the worst vehicle: {choice.value:.2f} m, proven best: {choice.proven}")
