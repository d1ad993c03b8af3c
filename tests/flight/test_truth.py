"""Who truly sees whom: vehicles that follow the plan see what it says; what is drawn by keys."""

from typing import Any

import numpy as np
import pytest

from syncplan.estimation.drawn_errors import DrawnErrors
from syncplan.guidance import truth
from syncplan.guidance.flight_setup import Eyes
from syncplan.guidance.keyed_noise import Word, key_of, uniform, words_at
from syncplan.orbits.circles import position
from syncplan.orbits.sight_lines import crosses_interior
from syncplan.orbits.sightings import sample_sightings
from tests.tools import plain_truth
from tests.tools.flown_trials import FlownTrials, flown
from tests.tools.inner_kernels import called_alone
from tests.tools.on_paper import plan
from tests.tools.plain_truth import Sighting
from tests.tools.scenarios import changed

HORSESHOE = np.array(
    [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]]
)
SQUARE = np.array([[8.0, 0.0], [12.0, 0.0], [12.0, 4.0], [8.0, 4.0]])

is_hidden = called_alone(truth._is_hidden)

QUIET = {
    "motion": {"speed_sigma_mps": 0.0, "turn_rate_sigma_rad_s": 0.0},
    "initial_sigma": {"position_m": 1e-6, "heading_rad": 1e-6},
}

ON_PLAN = {
    "paper-grid-same": 70.0,
    "paper-grid-alternate": 40.0,
    "camera-pair": 70.0,
    "shelves": 40.0,
    "boats": 130.0,
    "five-ring": 40.0,
    "triangle-lattice": 40.0,
}
"""Scenarios, and s that are flown."""


def _of(found: FlownTrials) -> list[tuple[int, int, int, int]]:
    return [
        (k, one.observer, one.target, one.kind)
        for k, step in enumerate(found.sightings(0))
        for one in step
    ]


@pytest.mark.parametrize(("name", "duration"), ON_PLAN.items())
def test_without_noise_and_wind_the_plan_is_kept_to_a_millimetre_and_seen_exactly(
    name: str, duration: float
) -> None:
    made = plan(changed(name, **_quiet(name)), bound="never", pilot=False)
    found = flown(made, range(1), duration=duration, filter="ekf")
    time, steps = made.sensors.sample_time, found.run.team.steps
    places = position(made.orbits, time * np.arange(steps + 1))
    assert np.abs(found.path[:, :, :2, 0] - places).max() < 1e-3
    planned = sample_sightings(made.windows, made.orbits.period, made.sensors, 1, steps)
    columns = (planned.steps, planned.observers, planned.targets, planned.kinds)
    assert _of(found) == list(zip(*(one.tolist() for one in columns), strict=True))


def _quiet(name: str) -> dict[str, Any]:
    keys: dict[str, Any] = {**QUIET, "sensor": {"detection_probability": 1.0}}
    if name in ("shelves", "boats"):
        walks = {"position_random_walk_m_sqrt_s": 0.0, "angle_random_walk_rad_sqrt_s": 0.0}
        keys["motion"] = walks
    return keys


def test_each_kind_of_sighting_is_shifted_by_its_own_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    keys = {**QUIET, "sensor": {"range_sigma_m": 0.5}, "heading_sigma_rad": 0.1}
    made = plan(changed("paper-grid-same", **keys), bound="never", pilot=False)
    options: dict[str, Any] = {"duration": 10.0, "filter": "ekf", "guidance": "none"}
    plain = flown(made, range(1), **options)
    shifts = {"bearing": 0.1, "distance": 2.0, "compass": -0.2}
    monkeypatch.setattr(DrawnErrors, "shifts", lambda _, kind: shifts[kind])
    shifted = flown(made, range(1), **options)
    assert _of(shifted) == _of(plain)
    for before, after in zip(_sightings(plain), _sightings(shifted), strict=True):
        expected = list(shifts.values())[before.kind]
        assert after.reading - before.reading == pytest.approx(expected, abs=1e-9)
    assert {one.kind for one in _sightings(plain)} == {0, 1, 2}


def _sightings(found: FlownTrials) -> list[Sighting]:
    return [one for step in found.sightings(0) for one in step]


def test_what_hides_is_what_hides_on_the_plan() -> None:
    """Of segments in general position; `sight_lines` has its own tests."""
    eyes = _behind(HORSESHOE, SQUARE)
    generator = np.random.default_rng(4)
    starts, ends = generator.uniform(-3.0, 14.0, (2, 1000, 2))
    hidden = [
        is_hidden(eyes, *start, *(end - start)) for start, end in zip(starts, ends, strict=True)
    ]
    blocked = crosses_interior(HORSESHOE, starts, ends) | crosses_interior(SQUARE, starts, ends)
    assert 200 < blocked.sum() < 800
    np.testing.assert_array_equal(hidden, blocked)


@pytest.mark.parametrize(
    ("start", "end", "hidden"),
    [
        ((7.0, -1.0), (13.0, 5.0), True),  # along a diagonal, through two corners
        ((9.0, 1.0), (11.0, 3.0), True),  # wholly inside
        ((7.0, 5.0), (7.0, -5.0), False),
        ((6.0, 2.0), (10.0, 6.0), False),  # grazes the corner (8, 4)
        ((5.0, 1.0), (8.0, 2.0), False),  # to the wall, from outside
        ((13.0, 1.0), (8.0, 2.0), True),  # to the same place, from behind
    ],
)
def test_a_wall_hides_what_is_behind_it_and_not_what_is_beside(
    start: tuple[float, float], end: tuple[float, float], hidden: bool
) -> None:
    way = np.subtract(end, start)
    assert is_hidden(_behind(SQUARE), *start, *way) == hidden


def _behind(*obstacles: np.ndarray[Any, np.dtype[np.float64]]) -> Eyes:
    none, corners = np.zeros(0), np.concatenate(obstacles)
    return Eyes(
        ranges=none,
        half_views=none,
        boresights=none,
        every=np.zeros((3, 0), dtype=np.int64),
        sigmas=np.zeros((3, 0)),
        taken=np.zeros((3, 0)),
        detection=none,
        landmarks=np.zeros((0, 2)),
        corners=corners,
        first_corner=np.cumsum([0, *(len(one) for one in obstacles)]),
    )


# --- random numbers by key ------------------------------------------------------------------------


def _counters(generator: np.random.Generator) -> list[tuple[int, int, int]]:
    few = [(1, 0, 0), (1, 0, 1), (1, 1, 0), (2**31, 999, 1200)]
    return few + [tuple(int(n) for n in generator.integers(1, 5000, 3)) for _ in range(50)]  # type: ignore[misc]


@pytest.mark.parametrize(("seed", "trial"), [(0, 0), (7, 3), (2**63 - 1, 999_999)])
def test_words_are_those_of_numpys_philox(seed: int, trial: int) -> None:
    key = key_of(seed, trial)
    for counter in _counters(np.random.default_rng(1)):
        found = [int(word) for word in words_at(key, *counter)]
        assert found == plain_truth.words(key, *counter)


def test_uniform_numbers_are_never_0_or_1() -> None:
    number = called_alone(uniform)
    least, most = number(Word(0)), number(Word(2**64 - 1))
    assert 0.0 < least < 1e-15
    assert 1.0 - 1e-15 < most < 1.0
