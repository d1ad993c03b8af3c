"""The filter one step at a time, as a vehicle's computer runs it, by the kernels of trials.

A step is what was read since the last one: motion readings over its span, then sightings at its
end. There is no truth to compare with. What `robust` looks back at is kept, about 100 bytes a
vehicle and step; other filters keep nothing but their state.

Source: as of `augmented_filter` and `robust_filter`.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_options import lane_filter_of
from syncplan.estimation.filter_setup import (
    FilterRun,
    FilterSetup,
    Readings,
    State,
    poses_of,
    run_without_truth,
)
from syncplan.estimation.lane_filter import LaneRun
from syncplan.estimation.rivals import LOOKS, Rivals
from syncplan.estimation.robust_filter import RobustFilter, RobustRun, steps_passing
from syncplan.scenario.filters import FilterModel

Kept = TypeVar("Kept", Array, Index)

_COUNTED = ("nis", "accepted", "gated")
_LOOKED_BACK = ("counted", "limit", "doubtful", "ends")
_RIVALS = ("lanes", "began", "lead", "at")
_ROWS = ("observers", "targets", "kinds", "variances")

FIRST_ROOM = 64
"""Steps, and sightings, that there is room for at first."""


class Arrived(NamedTuple):
    """Sightings of one step.

    Fields
    ------
    observers, targets, kinds : (s,) as in FilterSetup
    variances : (s,) each sighting's, in its kind's unit squared
    values : (s,)
    """

    observers: Index
    targets: Index
    kinds: Index
    variances: Array
    values: Array


class OnlineFilter:
    """A team's filter on its way.

    Attributes
    ----------
    steps : taken in
    time : s, since the start
    """

    def __init__(
        self, setup: FilterSetup, initial: Array, model: FilterModel, stream: np.random.SeedSequence
    ) -> None:
        """Begin at time 0, at poses `initial` (n, 3); runs and truth of `setup` do not matter.

        A filter that draws numbers draws them from the `stream`.
        """
        self.steps, self.time = 0, 0.0
        n = len(initial)
        self._sample = setup.motion.time
        readings = Readings(
            initial=np.array(initial, dtype=float)[..., None],
            speeds=np.zeros((2, n, 1)),
            turn_rates=np.zeros((2, n, 1)),
            sightings=np.zeros((FIRST_ROOM, 1)),
        )
        own = _without_steps(setup._replace(judged_from=0))
        given, found = run_without_truth(own, readings), lane_filter_of(model)
        self._run: LaneRun
        if isinstance(found, RobustFilter):
            self._run = RobustRun.begun(found.base, given, [stream])
        else:
            self._run = LaneRun.begun(found, given)

    @property
    def state(self) -> State:
        """State (3n + e, 1) and covariance (3n + e, 3n + e, 1), of which the lower triangle counts.

        As kernels take them; views.
        """
        return self._run.state

    @property
    def poses(self) -> Array:
        """(n, 3) m, m, rad: the estimate; a view."""
        return poses_of(self.state[0], self.setup.vehicles)[..., 0]

    @property
    def errors(self) -> Array:
        """(e,) the bias states; a view."""
        return self.state[0][3 * self.setup.vehicles :, 0]

    @property
    def covariance(self) -> Array:
        """(3n + e, 3n + e) of the estimate."""
        lower = np.tril(self.state[1][..., 0])
        return lower + np.tril(lower, -1).T

    @property
    def setup(self) -> FilterSetup:
        """The set-up, whose steps are the filter's own."""
        return self._run.setup

    @property
    def counts(self) -> Mapping[str, float]:
        """Sum of innovation^2 / variance of sightings, and how many were accepted and gated."""
        counted = self._run.statistics
        return {name: float(getattr(counted, name)[0]) for name in _COUNTED}

    @property
    def memory(self) -> dict[str, Array | Index]:
        """All that it goes on from, by name; what a filter of the same set-up takes back."""
        run, counted = self._run, self._run.statistics
        found: dict[str, Array | Index] = {
            "steps": np.array(self.steps),
            "time": np.array(self.time),
            **self._parts("state", run.state),
            **{name: getattr(counted, name) for name in _COUNTED},
        }
        if isinstance(run, RobustRun):
            setup, readings, k = self.setup, run.readings, self.steps
            used = int(setup.first[k + 1])
            found |= self._parts("began", run.began)
            found |= {name: getattr(run, name) for name in _LOOKED_BACK}
            found |= {f"rivals_{name}": np.asarray(getattr(run.rivals, name)) for name in _RIVALS}
            found["rivals_began"] = poses_of(run.rivals.began, setup.vehicles)
            found |= self._parts("present", run.rivals.present)
            found |= self._parts("rival", run.rivals.rival)
            found |= {name: getattr(setup, name)[:used] for name in _ROWS}
            found |= {
                "initial": readings.initial,
                "sightings": readings.sightings[:used],
                "speeds": readings.speeds[:k],
                "turn_rates": readings.turn_rates[:k],
                "spans": setup.spans[:k],
                "first": setup.first[: k + 2],
            }
        return found

    @memory.setter
    def memory(self, kept: Mapping[str, Array | Index]) -> None:
        run, counted = self._run, self._run.statistics
        self.steps, self.time = int(kept["steps"]), float(kept["time"])
        for own, one in zip(run.state, _joined("state", kept), strict=True):
            own[:] = one
        for name in _COUNTED:
            getattr(counted, name)[:] = kept[name]
        if isinstance(run, RobustRun):
            used, k = len(kept["sightings"]), self.steps
            self._make_room(0, max(used, FIRST_ROOM))
            self.steps, run.at = 0, k
            self._lengthen(max(k, 2))
            self.steps = k
            setup, readings = self.setup, self._run.readings
            for name in _ROWS:
                getattr(setup, name)[:used] = kept[name]
            setup.spans[:k], setup.first[: k + 2] = kept["spans"], kept["first"]
            setup.first[k + 2 :] = used
            readings.initial[:], readings.sightings[:used] = kept["initial"], kept["sightings"]
            readings.speeds[:k], readings.turn_rates[:k] = kept["speeds"], kept["turn_rates"]
            for own, one in zip(run.began, _joined("began", kept), strict=True):
                own[:] = one
            for name in _LOOKED_BACK:
                setattr(run, name, np.array(kept[name]))
            run.looks = steps_passing(setup.spans[:k], setup.period, LOOKS)
            run.rivals = _rivals(kept, run)

    def _parts(self, name: str, state: State) -> dict[str, Array | Index]:
        """A state as it is kept: poses (n, 3, k), bias states (e, k) and covariance."""
        (x, P), n = state, self.setup.vehicles
        return {f"{name}_0": poses_of(x, n), f"{name}_1": x[3 * n :], f"{name}_2": P}

    def step(
        self, speeds: Array, turn_rates: Array, arrived: Arrived, span: float | None = None
    ) -> None:
        """Take in readings (n,) in m/s and rad/s over `span` s, a sample's if None, and sightings.

        Sightings that are NaN are missed. All are taken for what they say: who calls has checked
        that indices are those of the team.
        """
        span = self._sample if span is None else span
        if isinstance(self._run, RobustRun):
            self._look_back(speeds, turn_rates, arrived, span)
        else:
            self._forget(speeds, turn_rates, arrived, span)
        self.steps += 1
        self.time += span

    def _forget(self, speeds: Array, turn_rates: Array, arrived: Arrived, span: float) -> None:
        """Take in a step in the place of the last one: the second of a run of two."""
        run = self._run
        count = len(arrived.values)
        if count > len(run.readings.sightings):
            self._make_room(0, 2 * count)
        setup, readings = run.setup, run.readings
        readings.speeds[1, :, 0], readings.turn_rates[1, :, 0] = speeds, turn_rates
        setup.spans[1] = span
        setup.first[3] = count
        self._write(0, arrived)
        run.at = 1
        run.advance(2)

    def _look_back(self, speeds: Array, turn_rates: Array, arrived: Arrived, span: float) -> None:
        """Take in a step after all others."""
        run, k = self._run, self.steps
        assert isinstance(run, RobustRun)
        used, count = int(self.setup.first[k + 1]), len(arrived.values)
        if used + count > len(run.readings.sightings):
            self._make_room(used, 2 * (used + count))
        if k + 1 > len(run.readings.speeds):
            self._lengthen(2 * (k + 1))
        setup, readings = self.setup, run.readings
        readings.speeds[k, :, 0], readings.turn_rates[k, :, 0] = speeds, turn_rates
        setup.spans[k] = span
        setup.first[k + 2] = used + count
        self._write(used, arrived)
        passed, passing = (at / setup.period + 1e-9 for at in (self.time, self.time + span))
        if math.floor(LOOKS * passing) > math.floor(LOOKS * passed):
            run.looks = np.append(run.looks, k + 1)
            if math.floor(passing) > math.floor(passed):
                run.ends = np.append(run.ends, k + 1)
        run.advance(k + 1)

    def _write(self, begin: int, arrived: Arrived) -> None:
        setup, end = self.setup, begin + len(arrived.values)
        setup.observers[begin:end], setup.targets[begin:end] = arrived.observers, arrived.targets
        setup.kinds[begin:end], setup.variances[begin:end] = arrived.kinds, arrived.variances
        self._run.readings.sightings[begin:end, 0] = arrived.values

    def _make_room(self, used: int, rows: int) -> None:
        """Let set-up and readings hold so many sightings."""
        self._run.given = with_room(self._run.given, used, rows)

    def _lengthen(self, steps: int) -> None:
        """Let set-up and readings hold so many steps."""
        setup, readings, k = self.setup, self._run.readings, self.steps
        first = grown(setup.first, k + 2, steps + 2)
        first[k + 2 :] = first[k + 1]
        self._run.given = self._run.given._replace(
            setup=setup._replace(
                spans=grown(setup.spans, k, steps), compared=np.full(steps + 1, -1), first=first
            ),
            readings=readings._replace(
                speeds=grown(readings.speeds, k, steps),
                turn_rates=grown(readings.turn_rates, k, steps),
            ),
        )


def _rivals(kept: Mapping[str, Array | Index], run: RobustRun) -> Rivals:
    """The rivals of a memory; none in one that was kept before there were any."""
    if "rivals_lanes" not in kept:
        return Rivals.none(run.state)
    present, rival = (_joined(which, kept) for which in ("present", "rival"))
    began = np.array(kept["rivals_began"], dtype=float)
    return Rivals(
        np.array(kept["rivals_lanes"], dtype=np.int64),
        present,
        rival,
        np.concatenate([began.reshape(3 * len(began), -1), present[0][3 * len(began) :]]),
        np.array(kept["rivals_lead"], dtype=float),
        int(kept["rivals_at"]),
    )


def _joined(name: str, kept: Mapping[str, Array | Index]) -> State:
    """A state of its parts, as they are kept."""
    poses, errors, P = (np.array(kept[f"{name}_{k}"], dtype=float) for k in range(3))
    return np.concatenate([poses.reshape(3 * len(poses), -1), errors]), P


def grown(array: Kept, used: int, size: int) -> Kept:
    """Return an array of `size` entries along its first axis, the first `used` those given."""
    larger: Any = np.zeros((size, *array.shape[1:]), dtype=array.dtype)
    larger[:used] = array[:used]
    return cast(Kept, larger)


def with_room(run: FilterRun, used: int, rows: int) -> FilterRun:
    """Return the run with room for so many sightings; the first `used` are kept."""
    setup, readings = run.setup, run.readings
    return run._replace(
        setup=setup._replace(**{name: grown(getattr(setup, name), used, rows) for name in _ROWS}),
        readings=readings._replace(sightings=grown(readings.sightings, used, rows)),
    )


def _without_steps(setup: FilterSetup) -> FilterSetup:
    """A set-up with room for the first steps and sightings, none of which there are."""
    index = np.zeros(FIRST_ROOM, dtype=np.int64)
    return setup._replace(
        spans=np.full(2, setup.motion.time),
        compared=np.full(3, -1),
        first=np.zeros(4, dtype=np.int64),
        observers=index.copy(),
        targets=index.copy(),
        kinds=index.copy(),
        variances=np.ones(FIRST_ROOM),
    )
