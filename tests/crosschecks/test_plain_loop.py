"""The plain loop against what `fly` flies, and unicycles against what they are commanded to do."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.flight.keyed_noise import Word, key_of, normal_pair, words_at
from tests.crosschecks.closed_loop import fly, normal_of
from tests.crosschecks.comparisons import summary_of
from tests.crosschecks.courses import AIRS, COURSES, READINGS, Flying, flown_of
from tests.crosschecks.kernel_flights import flown_by_kernels, summary_of_kernels
from tests.crosschecks.responses import Step, answer_to, steady_errors
from tests.crosschecks.unicycle_team import Response, unicycles
from tests.tools.inner_kernels import called_alone

TRIALS = 2
LAG = 0.17


@pytest.mark.parametrize("readings", READINGS)
@pytest.mark.parametrize("air", AIRS)
def test_what_is_flown_is_what_the_plain_loop_flies(air: str, readings: str) -> None:
    course = replace(COURSES["grid"], duration=25.0)
    how = Flying(air, readings, LAG, course.duration, TRIALS, seed=3)
    flown = flown_of(course, course.plan(), how)
    kernels = flown_by_kernels(flown, TRIALS)
    plain = fly(flown, TRIALS, LAG, unicycles(LAG))
    path = np.moveaxis(kernels.flown.path, -1, 1)
    np.testing.assert_allclose(path, plain.path, rtol=0.0, atol=1e-9)
    theirs = summary_of_kernels(flown, TRIALS)
    ours = summary_of(plain, flown.team.orbits, flown.setup.time)
    for name in ("estimation", "tracking", "starting", "sightings"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=1e-9)


def test_the_noise_of_a_bearing_is_that_of_the_kernels() -> None:
    key, pair = key_of(5, 2), called_alone(normal_pair)
    for sighted in [(1, 0, 1), (2, 3, 0), (4000, 5, 7)]:
        words = words_at(key, *sighted)
        assert normal_of(key, *sighted) == pytest.approx(
            pair(Word(words[0]), Word(words[1]))[0], abs=1e-14
        )


def test_the_mean_response_is_that_of_small_steps() -> None:
    commands, time, small = np.array([[1.0, -2.0]]), 0.1, 10_000
    whole, parts = Response(np.zeros((1, 2)), 0.3, time), Response(np.zeros((1, 2)), 0.3, 1e-5)
    mean = np.mean([parts.follow(commands) for _ in range(small)], axis=0)
    np.testing.assert_allclose(whole.follow(commands), mean, rtol=1e-9)


def test_unicycles_have_no_errors_on_circles_and_the_lag_that_they_are_given() -> None:
    steady = steady_errors(unicycles(LAG), (4.0, 0.2), np.array([1.0, -2.0]), 0.1, 10.0)
    assert max(abs(steady.speed), abs(steady.turn_rate), steady.slip) < 1e-9
    for after in ((4.5, 0.2), (4.0, 0.0)):
        answer = answer_to(unicycles(LAG), Step((4.0, 0.2), after, 5.0, 5.0), 0.1)
        assert answer.lag == pytest.approx(LAG, abs=1e-4)
        assert answer.misfit < 1e-5
