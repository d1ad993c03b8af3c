"""Two vehicles joined only through a landmark are not joined.

The union of their sightings is a connected graph with two landmarks, which Theorem 3.3 as printed
accepts. Yet v2 sees L2 alone and can turn about it unseen: rank 5 of 6. The corrected certificate
refuses the team; the plan names the motion and its cure.
"""

from pathlib import Path

import syncplan

SCENARIO = Path(__file__).parent / "scenarios" / "landmark-bridge.yaml"


def main() -> syncplan.Plan:
    """Return the plan of the bridge."""
    return syncplan.plan(syncplan.load_scenario(SCENARIO))


if __name__ == "__main__":
    plan = main()
    print(f"rank {plan.observability.rank} of {plan.observability.state_dim}")
    print("certificate holds:", plan.certificate.holds)
    for motion in plan.unobservable:
        print(f"unobservable: {motion.description}\ncure: {motion.cure}")
