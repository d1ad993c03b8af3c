"""Step-by-step filter, as a vehicle's computer runs it, with the kernels of the trials.

A step takes motion readings over its span, then the sightings at its end. There is no truth to
compare with. The robust filter keeps past readings, about 100 bytes a vehicle and step; other
filters keep only their state.

Source: as of `lane_filter` and `robust_filter`.
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
"""Initial capacity in sightings."""


class Arrived(NamedTuple):
    """Sightings of one step.

    Fields
    ------
    observers, targets, kinds : (s,) as in FilterSetup
    variances : (s,) in each kind's unit squared
    values : (s,) in each kind's unit
    """

    observers: Index
    targets: Index
    kinds: Index
    variances: Array
    values: Array


class OnlineFilter:
    """Filter of a team, advanced step by step.

    Attributes
    ----------
    steps : number processed
    time : s since the start
    """

    def __init__(
        self, setup: FilterSetup, initial: Array, model: FilterModel, stream: np.random.SeedSequence
    ) -> None:
        """Start the filter at time 0 from poses `initial` (n, 3).

        Steps and sightings of `setup` are ignored. A filter that draws random numbers uses
        `stream`.
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
        """State (3n + e, 1) and covariance (3n + e, 3n + e, 1), whose lower triangle counts.

        Both are views, in the layout of the kernels.
        """
        return self._run.state

    @property
    def poses(self) -> Array:
        """Estimated poses (n, 3) in m, m, rad; a view."""
        return poses_of(self.state[0], self.setup.vehicles)[..., 0]

    @property
    def errors(self) -> Array:
        """Estimated bias states (e,); a view."""
        return self.state[0][3 * self.setup.vehicles :, 0]

    @property
    def covariance(self) -> Array:
        """Covariance (3n + e, 3n + e) of the estimate."""
        lower = np.tril(self.state[1][..., 0])
        return lower + np.tril(lower, -1).T

    @property
    def setup(self) -> FilterSetup:
        """Set-up with the filter's own steps."""
        return self._run.setup

    @property
    def counts(self) -> Mapping[str, float]:
        """Sum of innovation^2 / variance, and numbers of accepted and gated sightings."""
        counted = self._run.statistics
        return {name: float(getattr(counted, name)[0]) for name in _COUNTED}

    @property
    def memory(self) -> dict[str, Array | Index]:
        """Arrays, by name, from which a filter of the same set-up can resume."""
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
        """Parts of a state in a memory: poses (n, 3, k), bias states (e, k) and covariance."""
        (x, P), n = state, self.setup.vehicles
        return {f"{name}_0": poses_of(x, n), f"{name}_1": x[3 * n :], f"{name}_2": P}

    def step(
        self, speeds: Array, turn_rates: Array, arrived: Arrived, span: float | None = None
    ) -> None:
        """Process readings (n,) in m/s and rad/s over `span` s, one sample if None, and sightings.

        NaN marks a missed sighting. Indices are not checked: callers ensure that they are those of
        the team.
        """
        span = self._sample if span is None else span
        if isinstance(self._run, RobustRun):
            self._look_back(speeds, turn_rates, arrived, span)
        else:
            self._forget(speeds, turn_rates, arrived, span)
        self.steps += 1
        self.time += span

    def _forget(self, speeds: Array, turn_rates: Array, arrived: Arrived, span: float) -> None:
        """Process a step in place of the last one, as the second step of a run of two."""
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
        """Process a step and keep its readings."""
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
        """Make room for `rows` sightings; the first `used` are kept."""
        self._run.given = with_room(self._run.given, used, rows)

    def _lengthen(self, steps: int) -> None:
        """Make room for `steps` steps."""
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
    """Rivals of a memory; none for a memory of earlier versions, which lacks them."""
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
    """State from its parts in a memory."""
    poses, errors, P = (np.array(kept[f"{name}_{k}"], dtype=float) for k in range(3))
    return np.concatenate([poses.reshape(3 * len(poses), -1), errors]), P


def grown(array: Kept, used: int, size: int) -> Kept:
    """Return the first `used` entries of an array, zero-padded to `size` along the first axis."""
    larger: Any = np.zeros((size, *array.shape[1:]), dtype=array.dtype)
    larger[:used] = array[:used]
    return cast(Kept, larger)


def with_room(run: FilterRun, used: int, rows: int) -> FilterRun:
    """Return the run with room for `rows` sightings; the first `used` are kept."""
    setup, readings = run.setup, run.readings
    return run._replace(
        setup=setup._replace(**{name: grown(getattr(setup, name), used, rows) for name in _ROWS}),
        readings=readings._replace(sightings=grown(readings.sightings, used, rows)),
    )


def _without_steps(setup: FilterSetup) -> FilterSetup:
    """Set-up without sightings, with room for two steps and FIRST_ROOM sightings."""
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
