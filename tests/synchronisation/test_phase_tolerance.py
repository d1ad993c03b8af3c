"""How far a phase may slip before two vehicles come too near."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from syncplan.orbits.circles import Orbits
from syncplan.orbits.paths import relative_motion
from syncplan.orbits.separation import least_distances
from syncplan.synchronisation.phase_tolerance import safe_slips

PAIR = np.array([[0, 1]])
RADII = st.floats(5.0, 40.0)
PHASES = st.floats(-3.0, 3.0)


def pair(
    distance: float, radii: tuple[float, float], sense: float, phases: tuple[float, float]
) -> Orbits:
    """Two circles beside each other along x, the first counter-clockwise."""
    return Orbits(
        np.array([[0.0, 0.0], [distance, 0.0]]),
        np.array(radii),
        np.array([1.0, sense]),
        np.array(phases),
        0.2,
    )


def apart_when_slipped(orbits: Orbits, slips: np.ndarray) -> np.ndarray:
    """Least distance over a turn with the second phase slipped, one by one."""
    count = len(slips)
    phases = np.column_stack([np.full(count, orbits.phases[0]), orbits.phases[1] + slips])
    many = Orbits(
        np.tile(orbits.centers, (count, 1)),
        np.tile(orbits.radii, count),
        np.tile(orbits.senses, count),
        phases.ravel(),
        orbits.rate,
    )
    first = 2 * np.arange(count)
    return least_distances(relative_motion(many, first, first + 1))[0]


@settings(deadline=None)
@given(st.floats(1.0, 60.0), RADII, RADII, PHASES, PHASES, st.floats(0.5, 10.0))
def test_turning_the_same_way_the_slip_is_an_arccosine(
    distance: float, ra: float, rb: float, one: float, other: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), 1.0, (one, other))
    assume(abs(distance - np.abs(ra * np.exp(1j * one) - rb * np.exp(1j * other))) > asked + 1e-3)
    # at m = distance +- asked, with m^2 = Ra^2 + Rb^2 - 2 Ra Rb cos(difference), they come so near
    m = np.array([distance - asked, distance + asked])
    cosine = (ra**2 + rb**2 - m**2) / (2.0 * ra * rb)
    there = np.arccos(cosine[(np.abs(cosine) < 1.0) & (m > 0.0)])
    now = other - one
    slips = np.abs(np.angle(np.exp(1j * (np.concatenate([there, -there]) - now))))
    expected = min(slips, default=np.pi)
    assert safe_slips(orbits, PAIR, asked)[0] == pytest.approx(expected, abs=2e-3)
    assert safe_slips(orbits, PAIR, asked)[0] <= expected + 1e-9


@settings(deadline=None)
@given(st.floats(5.0, 70.0), RADII, RADII, PHASES, PHASES, st.sampled_from([-1.0, 1.0]))
def test_without_a_distance_it_is_the_slip_at_which_they_collide(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    # where the circles cross: each is there at its own moment, and the slip makes it the same one
    x = (distance**2 + ra**2 - rb**2) / (2.0 * distance)
    expected = np.pi
    if abs(x) < ra:
        for y in (np.sqrt(ra**2 - x**2), -np.sqrt(ra**2 - x**2)):
            turned = np.arctan2(y, x) - one
            meets = np.arctan2(y, x - distance) - sense * turned
            expected = min(expected, abs(np.angle(np.exp(1j * (meets - other)))))
    assume(abs(abs(x) - ra) > 0.05)
    assert safe_slips(orbits, PAIR, 0.0)[0] == pytest.approx(expected, abs=2e-3)


@settings(deadline=None)
@given(
    st.floats(1.0, 80.0),
    RADII,
    RADII,
    PHASES,
    PHASES,
    st.sampled_from([-1.0, 1.0]),
    st.floats(0.5, 15.0),
)
def test_no_smaller_slip_brings_them_too_near(
    distance: float, ra: float, rb: float, one: float, other: float, sense: float, asked: float
) -> None:
    orbits = pair(distance, (ra, rb), sense, (one, other))
    slip = safe_slips(orbits, PAIR, asked)[0]
    smaller = np.linspace(-slip, slip, 301)
    if slip > 0.0:
        assert apart_when_slipped(orbits, smaller).min() >= asked - 1e-9
    if slip < np.pi:
        beyond = slip + np.linspace(0.0, 0.02, 41)
        both = np.concatenate([beyond, -beyond])
        assert apart_when_slipped(orbits, both).min() < asked + 0.05


def test_equal_circles_turning_against_each_other_have_slips_too() -> None:
    # mirror images 70 m apart on circles of 20 m: 30 m between, whatever the phases
    orbits = pair(70.0, (20.0, 20.0), -1.0, (0.0, np.pi))
    assert safe_slips(orbits, PAIR, 29.9)[0] == np.pi
    assert safe_slips(orbits, PAIR, 31.0)[0] == 0.0
    assert safe_slips(orbits, np.zeros((0, 2), dtype=int), 5.0).shape == (0,)
