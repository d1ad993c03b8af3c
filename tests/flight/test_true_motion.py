"""How a vehicle answers its command; `test_closed_loop` has all else of how vehicles truly move."""

import numpy as np

from syncplan.planning.planner import plan
from tests.tools.flown_trials import flown
from tests.tools.scenarios import changed

TIME = 0.1


def test_a_response_lags_as_fine_euler_steps_of_it_do() -> None:
    """Means over a sample, and what is left at its end, are in closed form.

    In open loop only a hold changes a command: to the least speed and the largest turn rate.
    """
    lag, parts = 0.35, 4000
    motion = {"speed_sigma_mps": 0.0, "turn_rate_sigma_rad_s": 0.0, "lag_s": lag}
    limits = {"speed_mps": [1.0, 8.0], "turn_rate_rad_s": 0.5}
    made = plan(changed("paper-grid-same", motion=motion, limits=limits), bound="never")
    lanes = flown(made, range(1), duration=1.0, guidance="none", hold=("v1@0.2:0.4",)).lanes
    response = usual = np.array([4.0, 0.2])
    for step in range(10):
        command = np.array([1.0, 0.5]) if 2 <= step < 6 else usual
        means = np.zeros(2)
        for _ in range(parts):
            before = response
            response = before + (TIME / parts) / lag * (command - before)
            means += 0.5 * (before + response) / parts
        read = [each[step, 0, 0] for each in (lanes.readings.speeds, lanes.readings.turn_rates)]
        np.testing.assert_allclose(read, means, rtol=1e-4)
    np.testing.assert_allclose(lanes.flown.responses[0, :, 0], response, rtol=1e-4)
