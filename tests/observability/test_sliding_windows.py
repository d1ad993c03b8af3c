"""Rank over sliding windows of plans and recordings; the connectivity period."""

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.arrays import Array
from syncplan.estimation.replays import replay
from syncplan.observability.rank import (
    LINK_TOLERANCE,
    Assessment,
    assess,
    assess_team,
    certify,
    link_information,
)
from syncplan.observability.sliding_windows import (
    SEARCHED_PERIODS,
    WatchedTeam,
    _clearly_certified,
    _Starts,
    connectivity_period,
    judged_windows,
    undetermined,
)
from syncplan.orbits.circles import position
from syncplan.orbits.sighting_kinds import sigmas_by_kind
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within
from syncplan.orbits.team import Team
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from syncplan.reports.replay_report import replay_document
from tests.tools.draws import draw_equipped_team, draw_team
from tests.tools.recordings import Recipe, write_recording
from tests.tools.scenarios import example


@pytest.mark.parametrize(
    ("name", "rank"),
    [("paper-grid-same", 18), ("paper-grid-alternate", 16), ("landmark-bridge", 5)],
)
def test_on_circles_a_window_has_the_rank_of_the_plan(name: str, rank: int) -> None:
    plan = syncplan.plan(example(name), bound="never")
    team = plan.team
    assessed = assess_team(team, team.orbits.period)
    seen = assessed.sightings
    times = np.asarray(seen.steps * team.sensors.sample_time, dtype=np.float64)
    order = np.argsort(times, kind="stable")
    scale = 7.0

    def placed(k: int, of: slice) -> tuple[Array, Array]:
        now = order[of]
        everywhere = position(team.orbits, times[now])
        places = np.concatenate(
            [everywhere, np.broadcast_to(team.landmarks, (len(now), *team.landmarks.shape))], axis=1
        )
        row = np.arange(len(now))
        both = [places[row, seen.observers[now]], places[row, seen.targets[now]]]
        return position(team.orbits, np.zeros(1))[0], np.stack(both, axis=1)

    watched = WatchedTeam(
        times=times[order],
        observers=seen.observers[order],
        targets=seen.targets[order],
        kinds=seen.kinds[order],
        sigmas=sigmas_by_kind(team.sensors, seen.kinds, seen.observers)[order],
        count=team.count,
        landmarks=team.landmarks,
        scale=scale,
    )
    ends = np.array([team.orbits.period])
    (found,) = judged_windows(watched, placed, np.array([-1.0]), ends)
    expected = assess(team, link_information(team, seen, scale), scale=scale)
    assert found.observability.rank == expected.rank == rank
    largest = expected.singular_values[0]
    np.testing.assert_allclose(
        found.observability.singular_values, expected.singular_values, atol=1e-9 * largest
    )
    assert found.certificate.holds == assessed.certificate.holds
    assert np.isfinite(found.position_sigma) == (rank == 3 * team.count)
    if rank < 3 * team.count:
        assert undetermined(found.observability)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    recipe = Recipe(duration=80.0, jitter=0.8)
    return load_log(write_recording(tmp_path_factory.mktemp("seen") / "recording", recipe))


def test_a_recording_says_when_its_team_was_observable(log: Log) -> None:
    always = replay(log, window=16.0).seen
    assert always is not None
    assert always.gaps == ()
    assert always.observable == always.certified == always.judged
    assert always.judged == pytest.approx(80.0 - 16.0, abs=always.step)
    assert np.isfinite(always.position_sigmas).all()

    begin = max(robot.truth[0, 0] for robot in log.robots)

    def blind(robot: RobotLog) -> RobotLog:
        """Neither sees nor is seen: no robot sees robot 2 from 30 s to 55 s, nor it anybody."""
        away = (robot.times > begin + 30.0) & (robot.times < begin + 55.0)
        kept = ~(away & ((robot.subjects == 2) | (robot.subject == 2)))
        columns = ("times", "subjects", "bearings", "ranges")
        return replace(robot, **{name: getattr(robot, name)[kept] for name in columns})

    replayed = replay(replace(log, robots=tuple(map(blind, log.robots))), window=16.0)
    seen = replayed.seen
    assert seen is not None
    (gap,) = seen.gaps
    assert 1 in gap.robots
    assert 35.0 < gap.begin < 46.5
    assert 55.0 < gap.end < 65.0
    assert gap.least_rank < seen.state_dim == 9
    assert seen.judged - seen.observable == pytest.approx(gap.end - gap.begin)
    document = replay_document(replayed)
    assert document.observability is not None
    assert document.observability.longest_gap_s == pytest.approx(seen.longest_gap)
    assert "robot2" in document.observability.gaps[0].robots
    assert any("did not determine where all robots were" in note for note in document.notes)


def test_without_landmarks_a_team_is_never_observable(
    log: Log, tmp_path: Path, printed: Any, refused: Any
) -> None:
    replayed = replay(log, landmarks=[])
    assert replayed.seen is not None
    assert replayed.seen.observable == 0.0
    assert [gap.robots for gap in replayed.seen.gaps] == [(0, 1, 2)]
    document = replay_document(replayed)
    assert any("never determined where all robots were" in note for note in document.notes)
    assert document.observability is not None
    assert document.observability.median_position_sigma_m is None
    assert replay_document(replay(log, window=0.0)).observability is None
    folder = write_recording(tmp_path / "brief", Recipe(duration=20.0))
    out = printed("replay", str(folder), "--window-s", "8", "--format", "table")
    assert "observable over the last 8 s during" in " ".join(out.split())
    assert "--window-s: -1 given" in refused("replay", str(folder), "--window-s", "-1")


# --- the connectivity period ----------------------------------------------------------------------


SAMPLES = 14


def _coarse(team: Team) -> Assessment:
    """The team with few samples a period, which do not divide it, over one period."""
    rare = replace(team.sensors, sample_time=team.orbits.period / (SAMPLES - 0.3))
    return assess_team(replace(team, sensors=rare), team.orbits.period)


def _window_by_window(assessed: Assessment) -> float | None:
    """The longest of all starts' shortest windows that certify, each grown sample by sample."""
    team, windows, verdict = assessed.team, assessed.windows, assessed.observability
    orbits, sensors = team.orbits, team.sensors
    samples = steps_within(orbits.period, sensors.sample_time) + 1
    last = (1 + SEARCHED_PERIODS) * samples
    seen = sample_sightings(windows, orbits.period, sensors, 0, last)
    worst = 0
    for start in range(samples):
        for end in range(start, last + 1):
            inside = (seen.steps >= start) & (seen.steps <= end)
            part = Sightings(*(getattr(seen, field.name)[inside] for field in fields(seen)))
            links = link_information(team, part)
            if certify(team, verdict, links).holds:
                worst = max(worst, end - start + 1)
                break
        else:
            return None
    return None if worst > SEARCHED_PERIODS * samples else worst * sensors.sample_time


@pytest.mark.parametrize("draw", [draw_team, draw_equipped_team])
@pytest.mark.parametrize("seed", range(6))
def test_the_connectivity_period_is_the_longest_of_all_shortest_windows(
    seed: int, draw: Callable[[np.random.Generator], Team]
) -> None:
    generator = np.random.default_rng(seed)
    found = 0
    while found < 2:
        assessed = _coarse(draw(generator))
        ours = connectivity_period(assessed)
        assert ours == pytest.approx(_window_by_window(assessed))
        found += ours is not None


@pytest.mark.parametrize("needed", [2, 3])
def test_rank_beyond_doubt_is_rank_by_singular_values(needed: int) -> None:
    generator = np.random.default_rng(needed)
    length, windows = 5, 4000
    rows = generator.normal(size=(windows * length, 6))
    # windows from well conditioned to degenerate, and from weak to strong
    share = 10.0 ** generator.uniform(-9.0, 0.0, (windows, 1, 1))
    blocks = rows.reshape(windows, length, 6)
    blocks[:, :, needed - 1 :] *= share
    blocks *= 10.0 ** generator.uniform(-6.0, 2.0, (windows, 1, 1))
    first = length * np.arange(windows)
    starts = _Starts(rows, np.arange(windows), first, np.full(windows, length), first * 0 + needed)
    squares = np.cumsum(np.concatenate([[0.0], np.sum(rows**2, axis=1)]))
    values = np.linalg.svd(blocks, compute_uv=False)
    for largest in (1e-3, 1.0, 1e3):
        clear = _clearly_certified(starts, squares, np.full(windows, length), largest)
        counted = values[:, needed - 1] > LINK_TOLERANCE * np.maximum(values[:, 0], largest)
        assert not np.any(clear & ~counted)
        assert clear.sum() > 0.4 * counted.sum()
