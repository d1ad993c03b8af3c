"""Team in flight: set-ups of filter and closed loop, and the random draws of each trial."""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.drawn_errors import DrawnErrors, error_draws
from syncplan.estimation.filter_setup import FilterSetup, Readings, Truth
from syncplan.estimation.montecarlo import setup_along
from syncplan.estimation.trial_readings import split_draws
from syncplan.guidance.anchors import Anchors, anchors_of
from syncplan.guidance.flight_events import FlightEvents, Hold
from syncplan.guidance.flight_options import GUIDANCES, FlightOptions
from syncplan.guidance.flight_setup import (
    Circles,
    Contact,
    Eyes,
    FlightLimits,
    FlightSetup,
    Flown,
    FlownWorld,
    Law,
    Mishaps,
    Response,
)
from syncplan.guidance.keyed_noise import key_of
from syncplan.guidance.reference_tracking import tracking_gains
from syncplan.orbits.circles import heading, position
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import StateLayout, layout_of
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, of_targets, samples_between
from syncplan.orbits.sightings import Sightings, samples_before
from syncplan.orbits.team import Team

NEVER = np.iinfo(np.int64).max

LOOKS_IN_PERIOD = 32
"""Number of times in a period that circles are moved to their anchors, or back."""

SURE_SIGMAS = 4.0
"""Standard deviations within which a place is assumed to be."""

LEAD_PERIODS = 0.5
"""Periods by which a circle begins to move before its vehicle would be off by too much."""


@dataclass(frozen=True, slots=True)
class FlownTeam:
    """Team and set-up that all trials of a flight share.

    Attributes
    ----------
    team, windows : the team as the filter models it, and the plan's contact windows
    true_team : the team of the simulated world
    limits : of the vehicles, as guidance knows them
    layout : of the filter's states
    setup : of the closed loop
    options, events : of the flight
    """

    team: Team
    true_team: Team
    windows: Windows
    limits: FlightLimits
    layout: StateLayout
    setup: FlightSetup
    options: FlightOptions
    events: FlightEvents

    @property
    def steps(self) -> int:
        """Number of samples."""
        return self.setup.steps

    @property
    def size(self) -> int:
        """Number of the filter's states: poses and bias states."""
        return 3 * self.team.count + len(self.layout.sigmas)

    @property
    def present(self) -> Flags:
        """(steps + 1, n) whether a vehicle takes part; False once it is lost."""
        gone = self.setup.mishaps.gone_from[: self.team.count]
        return np.asarray(np.arange(self.steps + 1)[:, None] < gone)

    @property
    def loss_steps(self) -> list[int]:
        """Steps at which losses take effect, in order."""
        time = self.setup.time
        return sorted({samples_before(one.time, time) for one in self.events.losses})

    @property
    def hold_ends(self) -> list[int]:
        """Steps at which held vehicles are released, in order."""
        return sorted({self.steps_after(one).start for one in self.events.holds})

    def steps_after(self, hold: Hold) -> range:
        """Return the steps, from the end of a hold on, at which its vehicle takes part."""
        gone = int(self.setup.mishaps.gone_from[hold.vehicle])
        end = samples_before(hold.time + hold.length, self.setup.time)
        return range(end, min(gone, self.steps + 1))

    def shows_phase_after(self, hold: Hold) -> bool:
        """Return whether a hold leaves its vehicle a period in which it can keep its phase."""
        period = samples_before(self.team.orbits.period, self.setup.time)
        return len(self.steps_after(hold)) >= period

    def setup_from(self, step: int) -> FlightSetup:
        """Return the closed loop's set-up from a step on, with anchors of the remaining team."""
        mishaps, windows = self.setup.mishaps, self.windows
        targeted = of_targets(np.arange(len(mishaps.blind_from)))
        sees = np.any(mishaps.blind_from[targeted] > step, axis=0)[windows.observers]
        there = mishaps.gone_from > step
        left = sees & there[windows.observers] & there[windows.targets]
        anchors = anchors_of(self.team, windows, self.limits.separation, left, there)
        return self.setup._replace(contact=_contact(self.team, anchors, self.options))

    def filter_setup(self) -> FilterSetup:
        """Return the filter's set-up, as yet without sightings."""
        none = Sightings(*np.zeros((4, 0), dtype=np.int64))
        return setup_along(self.team, self.layout, none, self.steps, self.options)

    def begun(self, trials: range) -> tuple[Flown, Readings, Truth]:
        """Return trials at time 0, their readings, without sightings as yet, and true states."""
        n, steps, lanes = self.team.count, self.steps, len(trials)
        sizes = (3 * n, steps * n, steps * n, error_draws(self.true_team, steps))
        poses, speeds, turns, lasting = split_draws(self.options.seed, trials, sizes)
        errors = self._errors(lasting)
        constants, changing = errors.states(self.layout, steps, lanes)
        path = np.zeros((steps + 1, n, 3, lanes))
        circles, noise = self.setup.circles, self.true_team.noise
        planned = np.column_stack(
            [position(self.team.orbits, 0.0), heading(self.team.orbits, 0.0)]
        )[..., None]
        sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        path[0] = planned - sigmas[:, None] * poses.reshape(n, 3, lanes)
        start = np.stack([circles.rate * circles.radii, circles.rate * circles.senses], axis=1)
        scales, turn_biases, clock_offsets = (
            np.zeros((n, lanes)) + errors.constant(act) for act in ("speed", "turn", "delay")
        )
        flown = Flown(
            path=path,
            drift=np.ascontiguousarray(np.zeros((1, 1, 2, lanes)) + errors.drift()),
            scales=scales,
            turn_biases=turn_biases,
            clock_offsets=clock_offsets,
            shifts=tuple(np.zeros((1, n, lanes)) + errors.shifts(kind) for kind in SIGHTING_KINDS),
            speed_noise=np.ascontiguousarray(speeds.reshape(steps, n, lanes)),
            turn_noise=np.ascontiguousarray(turns.reshape(steps, n, lanes)),
            keys=np.stack([key_of(self.options.seed, trial) for trial in trials]),
            commands=np.repeat(start[..., None], lanes, axis=2),
            responses=np.repeat(start[..., None], lanes, axis=2),
            moved=np.zeros((n, 2, lanes)),
            seen=np.zeros((n, lanes), dtype=np.int64),
            heard=np.zeros((n, lanes), dtype=np.int64),
            longest=np.zeros((n, lanes), dtype=np.int64),
            slowest=np.full((n, lanes), np.inf),
            fastest=np.zeros((n, lanes)),
            saturated=np.zeros((n, lanes), dtype=np.int64),
            sought=np.zeros((n, lanes), dtype=np.int64),
            places=np.zeros(2, dtype=np.int64),
            ahead=np.zeros((self.size, lanes)),
            away=np.zeros((3, lanes)),
        )
        readings = Readings(
            initial=np.ascontiguousarray(np.repeat(planned, lanes, axis=2)),
            speeds=np.zeros((steps, n, lanes)),
            turn_rates=np.zeros((steps, n, lanes)),
            sightings=np.zeros((0, lanes)),
        )
        return flown, readings, Truth(path, constants, changing)

    def _errors(self, draws: Array) -> DrawnErrors:
        errors = DrawnErrors.of(self.true_team, self.steps, draws)
        if self.options.wind is None:
            return errors
        wind = np.array(self.options.wind)[None, None, :, None]
        lanes = draws.shape[1]
        return DrawnErrors({**errors.values, "wind": np.repeat(wind, lanes, axis=3)})


def team_in_flight(
    team: Team,
    windows: Windows,
    limits: FlightLimits,
    world: FlownWorld,
    steps: int,
    options: FlightOptions,
    events: FlightEvents,
    lag: float,
) -> FlownTeam:
    """Return the set-up of a team's flight in a world; guidance assumes a lag of `lag` s."""
    time, true = team.sensors.sample_time, world.team
    anchors = anchors_of(team, windows, limits.separation)
    setup = FlightSetup(
        circles=Circles.of(team.orbits),
        response=Response(
            np.array(world.limits.least_speeds, dtype=float),
            np.array(world.limits.most_speeds, dtype=float),
            np.array(world.limits.most_turn_rates, dtype=float),
            left=math.exp(-time / world.lag) if world.lag > 0.0 else 0.0,
            mean_left=world.mean_left(time),
            measured=world.measured,
            speed_sigma=true.noise.speed_sigma,
            turn_rate_sigma=true.noise.turn_rate_sigma,
        ),
        eyes=_eyes(true, team),
        mishaps=_mishaps(true, options, events),
        law=_law(team, limits, lag, options),
        contact=_contact(team, anchors, options),
        time=float(time),
        steps=steps,
    )
    return FlownTeam(team, true, windows, limits, layout_of(team), setup, options, events)


def _eyes(team: Team, taken: Team) -> Eyes:
    sensors = team.sensors
    corners = [np.asarray(one, dtype=float) for one in team.obstacles]
    return Eyes(
        ranges=np.array(sensors.ranges, dtype=float),
        half_views=0.5 * np.array(sensors.fields_of_view, dtype=float),
        boresights=np.array(sensors.boresights, dtype=float),
        every=np.ascontiguousarray(samples_between(sensors), dtype=np.int64),
        sigmas=np.stack(
            [np.array(kind.sigmas(sensors), dtype=float) for kind in SIGHTING_KINDS.values()]
        ),
        taken=np.stack(
            [np.array(one.sigmas(taken.sensors), dtype=float) for one in SIGHTING_KINDS.values()]
        ),
        detection=np.array(sensors.detection, dtype=float),
        landmarks=np.array(team.landmarks, dtype=np.float64).reshape(-1, 2),
        corners=np.concatenate([np.zeros((0, 2)), *corners]),
        first_corner=np.cumsum([0, *(len(one) for one in corners)]),
    )


def _mishaps(team: Team, options: FlightOptions, events: FlightEvents) -> Mishaps:
    n, time = team.count, team.sensors.sample_time
    kinds = list(SIGHTING_KINDS.values())
    gone = np.full(n + len(team.landmarks), NEVER)
    blind = np.full((len(kinds), n), NEVER)
    for one in events.losses:
        step, loss = samples_before(one.time, time), one.loss
        gone[[*loss.vehicles, *(n + k for k in loss.landmarks)]] = step
        for place, kind in enumerate(kinds):
            if kind.of_target:
                blind[place, list(loss.sensors)] = step
        for place, vehicle in loss.kinds:
            blind[place, vehicle] = np.minimum(blind[place, vehicle], step)
    most = max([0, *(sum(h.vehicle == k for h in events.holds) for k in range(n))])
    held: list[Index] = [np.zeros((n, most), dtype=np.int64) for _ in range(2)]
    for k in range(n):
        for place, hold in enumerate(h for h in events.holds if h.vehicle == k):
            held[0][k, place] = samples_before(hold.time, time)
            held[1][k, place] = samples_before(hold.time + hold.length, time)
    return Mishaps(
        gone_from=gone,
        blind_from=blind,
        held_from=held[0],
        held_until=held[1],
        dropout=float(options.dropout),
        outliers=min(options.outliers + float(team.sensors.false_bearings.max()), 1.0),
        mistaken=float(options.mistaken),
        late=options.late,
    )


def _law(team: Team, limits: FlightLimits, lag: float, options: FlightOptions) -> Law:
    gains = tracking_gains(team.orbits, limits, team.sensors.sample_time + lag)
    return Law(
        mode=GUIDANCES[options.guidance].mode,
        place_gain=gains.place,
        heading_gain=gains.heading,
        closing_speeds=gains.closing_speeds,
    )


def _contact(team: Team, anchors: Anchors, options: FlightOptions) -> Contact:
    period, time = team.orbits.period, team.sensors.sample_time
    lead, gust_time = LEAD_PERIODS * period, team.errors.gust_time
    return Contact(
        anchors=anchors
        if options.guidance != "none"
        else anchors._replace(order=anchors.order[:0]),
        patience=samples_before(period, time),
        look_every=max(1, round(period / time / LOOKS_IN_PERIOD)),
        sigmas=SURE_SIGMAS,
        lead=lead,
        gust_lead=-gust_time * math.expm1(-lead / gust_time),
    )
