"""The loop with unicycles against what `fly` flies, and what is found of unicycles themselves."""

from dataclasses import replace

import numpy as np
import pytest

from tests.crosschecks.closed_loop import fly
from tests.crosschecks.comparisons import summary_of, summary_of_kernels
from tests.crosschecks.courses import COURSES, READINGS, Flying, run_of
from tests.crosschecks.responses import Step, answer_to, steady_errors
from tests.crosschecks.unicycle_team import unicycles
from tests.tools.flown_trials import flown_of

TRIALS = 2
LAG = 0.17


@pytest.mark.parametrize("readings", READINGS)
def test_the_loop_with_unicycles_flies_what_the_kernels_fly(readings: str) -> None:
    course = replace(COURSES["grid"], duration=8.0)
    run = run_of(
        course, course.plan(), Flying("gusts", readings, LAG, course.duration, TRIALS, seed=3)
    )
    kernels, plain = flown_of(run, range(TRIALS)), fly(run, TRIALS, unicycles(LAG))
    np.testing.assert_allclose(np.moveaxis(kernels.path, -1, 1), plain.path, rtol=0.0, atol=1e-9)
    theirs = summary_of_kernels(kernels)
    ours = summary_of(plain, run.plan.orbits, run.plan.sensors.sample_time)
    for name in ("estimation", "tracking", "starting", "sightings"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=1e-9)


def test_unicycles_have_no_errors_on_circles_and_the_lag_that_they_are_given() -> None:
    steady = steady_errors(unicycles(LAG), (4.0, 0.2), np.array([1.0, -2.0]), 0.1, 10.0)
    assert max(abs(steady.speed), abs(steady.turn_rate), steady.slip) < 1e-9
    for after in ((4.5, 0.2), (4.0, 0.0)):
        answer = answer_to(unicycles(LAG), Step((4.0, 0.2), after, 5.0, 5.0), 0.1)
        assert answer.lag == pytest.approx(LAG, abs=1e-4)
        assert answer.misfit < 1e-5
