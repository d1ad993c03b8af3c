"""Search for a loss whose judgement differs from the reduced scenario planned from scratch.

    python -m tests.searches.search_losses [TEAMS [SEED]]

Every single loss and some losses of two, of drawn teams: rank, unobservable motions, predicted
errors and findings; the rank also from bearings differentiated by finite differences, with sights
found by sampling. Part of `make check-all`.
"""

import sys

import numpy as np

from syncplan.planning.loss_study import what_if
from tests.tools.lost import differences, drawn_plan, from_scratch


def main(teams: int = 200, seed: int = 0) -> list[str]:
    """Return and print what differs."""
    wrong: list[str] = []
    judged = observable = critical = 0
    for number in range(teams):
        generator = np.random.default_rng([seed, number])
        plan = drawn_plan(generator)
        found = what_if(plan, losses=2 if plan.team.count <= 3 else 1, threads=1)
        observable += plan.observable
        critical += len(found.critical)
        for outcome in found.losses:
            judged += 1
            said = differences(outcome, from_scratch(plan, outcome.lost))
            wrong += [f"team {number}, {outcome.lost}: {one}" for one in said]
    print(
        f"{teams} teams, {observable} observable; {judged} losses, {critical} critical; "
        f"{len(wrong)} differences"
    )
    for one in wrong[:10]:
        print(one)
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
