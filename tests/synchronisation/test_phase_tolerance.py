"""How far a phase may shift before two vehicles come too near."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits, relative_motion
from syncplan.orbits.contacts import least_distances
from syncplan.synchronisation.contact_tables import separation_tolerances

PAIR = np.array([[0, 1]])
RADII = st.floats(5.0, 40.0)
PHASES = st.floats(-3.0, 3.0)
SENSES = st.sampled_from([-1.0, 1.0])


def pair(
    distance: float, radii: tuple[float, float], sense: float, phases: tuple[float, float]
) -> Orbits:
    """Two circles beside each other along x, the first counter-clockwise."""
    centers = np.array([[0.0, 0.0], [distance, 0.0]])
    return Orbits(centers, np.array(radii), np.array([1.0, sense]), np.array(phases), 0.2)


def apart_when_shifted(orbits: Orbits, shifts: np.ndarray) -> np.ndarray:
    """Least distance over a turn with the second phase shifted, one by one."""
    count = len(shifts)
    phases = orbits.phases + np.outer(shifts, [0.0, 1.0])
    centers = np.tile(orbits.centers, (count, 1))
    radii, senses = np.tile(orbits.radii, count), np.tile(orbits.senses, count)
    many = Orbits(centers, radii, senses, phases.ravel(), orbits.rate)
    first = 2 * np.arange(count)
    return least_distances(relative_motion(many, first, first + 1))[0]


def cosines_at(distance: float, radii: tuple[float, float], asked: float) -> np.ndarray:
    """Cosines of the phase differences at which same-sense vehicles come as near as asked.

    Their least distance is |D - m| with m^2 = Ra^2 + Rb^2 - 2 Ra Rb cos(difference), so m is
    D - asked or D + asked; beyond [-1, 1] no difference makes it so, at its ends they only touch.
    """
    m = np.array([distance - asked, distance + asked])
    return (radii[0] ** 2 + radii[1] ** 2 - m[m > 0.0] ** 2) / (2.0 * radii[0] * radii[1])


def least_shift(cosines: np.ndarray, now: float) -> float:
    """Smallest change of the phase difference `now` to one with such a cosine, pi for none."""
    there = np.arccos(cosines[np.abs(cosines) <= 1.0])
    shifts = np.abs(np.angle(np.exp(1j * (np.concatenate([there, -there]) - now))))
    return min(shifts, default=np.pi)


@given(st.floats(1.0, 60.0), RADII, RADII, PHASES, PHASES, st.floats(0.5, 10.0))
@example(1.0, 5.0, 7.0, 0.0, 1.0, 1.0)  # m = 2 = 7 - 5: the least distance touches 1 m
def test_turning_the_same_way_the_tolerance_is_an_arccosine(
    distance: float, ra: float, rb: float, one: float, other: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), 1.0, (one, other))
    apart = abs(distance - np.abs(ra * np.exp(1j * one) - rb * np.exp(1j * other)))
    assume(apart > asked + 1e-3)
    cosines = cosines_at(distance, (ra, rb), asked)
    expected = least_shift(cosines, other - one)
    tolerance = separation_tolerances(orbits, PAIR, asked)[0]
    assert tolerance <= expected + 1e-9
    if np.all(np.abs(np.abs(cosines) - 1.0) > 1e-3):
        assert tolerance == pytest.approx(expected, abs=2e-3)
    # where they touch, or nearly, the steps end early: not before they are as near as a centimetre
    elif apart > asked + 0.01:
        nearly = cosines_at(distance, (ra, rb), asked + 0.01)
        assert tolerance >= least_shift(nearly, other - one) - 2e-3


@given(st.floats(5.0, 70.0), RADII, RADII, PHASES, PHASES, SENSES)
def test_without_a_distance_it_is_the_shift_at_which_they_collide(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    # where the circles cross: each is there at its own moment, and the shift makes it the same one
    x = (distance**2 + ra**2 - rb**2) / (2.0 * distance)
    expected = np.pi
    if abs(x) < ra:
        for y in (np.sqrt(ra**2 - x**2), -np.sqrt(ra**2 - x**2)):
            turned = np.arctan2(y, x) - one
            meets = np.arctan2(y, x - distance) - sense * turned
            expected = min(expected, abs(np.angle(np.exp(1j * (meets - other)))))
    assume(abs(abs(x) - ra) > 0.05)
    assert separation_tolerances(orbits, PAIR, 0.0)[0] == pytest.approx(expected, abs=2e-3)


@given(st.floats(1.0, 80.0), RADII, RADII, PHASES, PHASES, SENSES, st.floats(0.5, 15.0))
def test_no_smaller_shift_brings_them_too_near(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    shift = separation_tolerances(orbits, PAIR, asked)[0]
    smaller = np.linspace(-shift, shift, 301)
    if shift > 0.0:
        assert apart_when_shifted(orbits, smaller).min() >= asked - 1e-9
    if shift < np.pi:
        beyond = shift + np.linspace(0.0, 0.02, 41)
        both = np.concatenate([beyond, -beyond])
        assert apart_when_shifted(orbits, both).min() < asked + 0.05


def test_equal_circles_turning_against_each_other_have_tolerances_too() -> None:
    # mirror images 70 m apart on circles of 20 m: 30 m between, whatever the phases
    orbits = pair(70.0, (20.0, 20.0), -1.0, (0.0, np.pi))
    assert separation_tolerances(orbits, PAIR, 29.9)[0] == np.pi
    assert separation_tolerances(orbits, PAIR, 31.0)[0] == 0.0
    assert separation_tolerances(orbits, np.zeros((0, 2), dtype=int), 5.0).shape == (0,)
