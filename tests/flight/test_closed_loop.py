"""The compiled closed loop against the same loop in plain NumPy, with the same draws."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from syncplan.guidance.flown_figures import without_gone
from syncplan.scenario.specification import Scenario
from tests.tools.flown_trials import FlownTrials, flown
from tests.tools.on_paper import plan
from tests.tools.plain_flights import PlainFlight, fly_plainly
from tests.tools.scenarios import changed

TRIALS = 2
TOLERANCE = 1e-6
"""m, rad, m/s: rounding, grown over some hundred steps."""


@dataclass(frozen=True)
class Case:
    """A scenario, and how it is flown."""

    scenario: str
    options: dict[str, Any] = field(default_factory=dict)
    keys: dict[str, Any] = field(default_factory=dict)

    def made(self) -> Scenario:
        """The scenario, with its keys changed."""
        return changed(self.scenario, **self.keys)


DISTURBED = {
    "wind": {"sigma_mps": 0.5, "gust_sigma_mps": 0.2, "gust_time_s": 7.0},
    "motion": {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.005, "lag_s": 0.4},
    "limits": {"speed_mps": [2.5, 5.0], "turn_rate_rad_s": 0.4},
}

COARSE = {"sample_time_s": 0.2}

CASES = {
    "open loop, held on the spot": Case(
        "paper-grid-same", {"duration": 12.0, "guidance": "none", "hold": ("v2@5:4",)}
    ),
    "all errors, lost and held": Case(
        "paper-grid-same",
        {"duration": 30.0, "lose": ("v2@4", "sensor:v5@12"), "hold": ("v1@5:8", "v3@2:3")},
        {**DISTURBED, "sensor": {"bearing_bias_sigma_rad": 0.02, **COARSE}},
    ),
    "measured, dropout, outliers": Case(
        "paper-grid-same",
        {"duration": 40.0, "dropout": 0.3, "outliers": 0.1},
        {"motion": {"readings": "measured", "lag_s": 0.3}, "sensor": COARSE},
    ),
    "cameras, outliers in view": Case(
        "camera-pair", {"duration": 60.0, "outliers": 0.3}, {"sensor": COARSE}
    ),
    "obstacles": Case("shelves", {"duration": 40.0}, {"sensor": COARSE}),
    "distances, compasses, sensors of one kind are lost": Case(
        "boats",
        {"duration": 40.0, "filter": "second-order", "lose": ("compass:v3@10", "distance:v4@20")},
    ),
    "given wind, late, lost at the start, all landmarks lost": Case(
        "windy-grid",
        {
            "duration": 40.0,
            "wind": (1.5, 0.0),
            "late": 7,
            "lose": ("v3@0", "v4@16.3", "L1@20", "L2@20"),
        },
        {"sensor": COARSE},
    ),
    "mistaken": Case(
        "paper-grid-same",
        {"duration": 32.0, "mistaken": 0.2, "lose": ("v2@15",)},
        {"sensor": {"range_m": 70.0, "fov_deg": 200.0, **COARSE}},
    ),
}


@dataclass(frozen=True)
class Pair:
    """Both, of the last of the trials: `lane` is its place among those flown side by side."""

    compiled: FlownTrials
    plain: PlainFlight
    lane: int = TRIALS - 1


LONG = {"measured, dropout, outliers", "distances, compasses, sensors of one kind are lost"}


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(case, id=name, marks=[pytest.mark.long] if name in LONG else [])
        for name, case in CASES.items()
    ],
)
def pair(request: pytest.FixtureRequest) -> Pair:
    case: Case = request.param
    made = plan(case.made(), bound="never", pilot=False)
    options = {"filter": "ekf", "seed": 3, **case.options}
    compiled = flown(made, range(TRIALS), **options)
    return Pair(compiled, fly_plainly(compiled.run, TRIALS - 1))


def _apart(a: Any, b: Any) -> float:
    """Largest difference of two arrays; NaN where either has one the other has not."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    assert a.shape == b.shape
    assert np.array_equal(np.isnan(a), np.isnan(b))
    return float(np.nanmax(np.abs(a - b), initial=0.0))


def test_vehicles_fly_the_same_paths(pair: Pair) -> None:
    there = pair.plain.there[..., None]
    path = pair.compiled.path[..., pair.lane]
    assert _apart(there * path, there * pair.plain.truth.path) < TOLERANCE


def test_the_same_is_sighted_and_read(pair: Pair) -> None:
    found, wanted = pair.compiled.sightings(pair.lane), pair.plain.truth.sightings
    of, theirs = (
        [[(s.observer, s.target, s.kind) for s in step] for step in steps]
        for steps in (found, wanted)
    )
    assert of == theirs
    read, expected = ([s.reading for step in steps for s in step] for steps in (found, wanted))
    assert _apart(read, expected) < TOLERANCE


def test_estimates_and_their_covariance_are_the_same(pair: Pair) -> None:
    plain, errors = pair.plain, pair.plain.states.shape[1] - 3 * pair.plain.there.shape[1]
    there = np.concatenate([np.repeat(plain.there[-1], 3), np.ones(errors)])
    apart = there * (pair.compiled.state(pair.lane) - plain.states[-1])
    assert np.abs(apart).max() < TOLERANCE
    variances = pair.compiled.covariance(pair.lane).diagonal()
    assert _apart(there * variances, there * plain.variances[-1]) < TOLERANCE


def test_statistics_are_of_the_vehicles_that_are_there_while_they_are(pair: Pair) -> None:
    run, plain, lane = pair.compiled.run, pair.plain, pair.lane
    found, steps = without_gone(run.team, pair.compiled.lanes), run.team.steps
    sampled = np.array([k > 0 and (k % 10 == 0 or k == steps) for k in range(steps + 1)])
    squares, there = plain.offs**2, plain.there > 0
    n, late = there.shape[1], 2 * np.arange(steps + 1) > steps
    states = 3.0 * there[sampled].sum()
    wanted = plain.nees[sampled].sum() / states
    assert found.nees[lane] / (3 * n * sampled.sum()) == pytest.approx(wanted, rel=1e-5)
    within = squares <= 9.0 * plain.variances[:, : 3 * n].reshape(-1, n, 3)
    for i in range(n):
        counted = there[1:, i]
        if not counted.any():
            continue
        wanted = squares[1:, i][counted].mean(axis=0)
        own = slice(3 * i, 3 * i + 3)
        assert _apart(found.squares[own, lane] / steps, wanted) < 1e-3 * TOLERANCE
        if (there[:, i] & late).any():
            wanted = squares[there[:, i] & late, i].mean(axis=0)
            assert _apart(found.late_squares[own, lane] / late.sum(), wanted) < TOLERANCE
        taken = sampled & there[:, i]
        share = within[taken, i].mean() if taken.any() else np.nan
        assert _apart(found.covered[own, lane].mean() / sampled.sum(), share) < 1e-9
        final = plain.offs[-1, i] if there[-1, i] else np.full(3, np.nan)
        assert _apart(found.final[own, lane], final) < TOLERANCE


def test_circles_are_moved_alike(pair: Pair) -> None:
    there = pair.plain.there[-1][:, None]
    moved = pair.compiled.lanes.flown.moved[..., pair.lane]
    assert _apart(there * moved, there * pair.plain.moved[-1]) < TOLERANCE
    sought = pair.compiled.lanes.flown.sought[:, pair.lane]
    np.testing.assert_array_equal(there[:, 0] * sought, there[:, 0] * pair.plain.sought)


def test_figures_are_those_of_the_path(pair: Pair) -> None:
    figures, run, plain = pair.compiled.figures, pair.compiled.run, pair.plain
    time, orbits, lane = run.plan.sensors.sample_time, run.plan.orbits, pair.lane
    turned = orbits.phases + np.outer(
        time * np.arange(run.team.steps + 1), orbits.senses * orbits.rate
    )
    circle = np.stack([np.cos(turned), np.sin(turned)], axis=-1) * orbits.radii[:, None]
    off = plain.truth.path[..., :2] - orbits.centers - circle
    with np.errstate(invalid="ignore"):
        tracking = plain.second_half(np.sum(off**2, axis=-1))
        bounds = plain.second_half(plain.bounds)
    assert _apart(figures.tracking_squares[lane], tracking) < 1e-4 * TOLERANCE + 1e-5
    assert _apart(figures.bound_squares[lane], bounds) < 1e-5
    assert figures.separations[lane] == pytest.approx(plain.least_separation(), abs=TOLERANCE)
    assert _apart(figures.longest_unseen[lane], time * plain.longest_unseen()) < 1e-9
    flown_for = np.maximum(plain.there[:-1].sum(axis=0), 1)
    saturated = (plain.truth.saturated * plain.there[:-1]).sum(axis=0) / flown_for
    assert _apart(figures.saturated[lane], saturated) < 1e-9
    assert figures.sightings[lane] == sum(len(step) for step in plain.truth.sightings)


@pytest.mark.parametrize("late", [0, 7, 40])
@pytest.mark.parametrize("guidance", ["track", "mpc"])
def test_a_hold_lasts_as_long_as_it_is_to(guidance: str, late: int) -> None:
    quiet = {"motion": {"speed_sigma_mps": 0.0, "turn_rate_sigma_rad_s": 0.0}}
    made, hold = changed("paper-grid-same", **quiet), ("v2@2.1:3.2",)
    found = flown(made, range(2), guidance=guidance, hold=hold, late=late, duration=10.0)
    moved = np.abs(np.diff(found.path[:, 1], axis=0)).max(axis=1)
    for lane in range(2):
        assert np.flatnonzero(moved[:, lane] == 0.0).tolist() == list(range(21, 53))


# --- how a vehicle answers its command ------------------------------------------------------------

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
