"""How a vehicle answers its command; `test_closed_loop` has all else of how vehicles truly move."""

import numpy as np

from syncplan.flight.flying import flight_run
from syncplan.flight.truth import move_truly
from syncplan.planning.planner import plan
from tests.tools.inner_kernels import called_alone
from tests.tools.scenarios import changed

TIME, LANES = 0.1, np.zeros(1, dtype=np.int8)

move_alone = called_alone(move_truly)


def test_a_response_lags_as_fine_euler_steps_of_it_do() -> None:
    """Means over a sample, and what is left at its end, are in closed form."""
    lag, parts, command = 0.35, 4000, np.array([6.0, 0.5])
    motion = {"speed_sigma_mps": 0.0, "turn_rate_sigma_rad_s": 0.0, "lag_s": lag}
    made = plan(changed("paper-grid-same", motion=motion), bound="never", pilot=False)
    team = flight_run(made, None, duration=20.0).team
    flown, readings, _ = team.begun(range(1))
    speeds, turn_rates = readings.speeds[0], readings.turn_rates[0]
    response = flown.responses[0, :, 0].copy()
    for step in range(3):
        means = np.zeros(2)
        for _ in range(parts):
            before = response.copy()
            response += (TIME / parts) / lag * (command - response)
            means += 0.5 * (before + response) / parts
        flown.commands[0, :, 0] = command
        move_alone(team.setup, flown, step, speeds, turn_rates, LANES)
        np.testing.assert_allclose(flown.responses[0, :, 0], response, rtol=1e-4)
        np.testing.assert_allclose([speeds[0, 0], turn_rates[0, 0]], means, rtol=1e-4)
