"""Many episodes under way at once, as arrays: what `hda.flight.episode` is to one.

The same kernels fly and look, and the same functions draw, begin and judge. It serves worlds of the paper's
kind: a look is the true map with noise (Algorithm 2), flights end on the target plane, and the lander knows
its state but for constant errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.state import State
from guidance.thrust_limits import pointing_angle
from hda.flight.episode import begin_flight
from hda.flight.outcome import Contact, Outcome, RewardTerms, classify, score_step
from hda.flight.vehicle import FlightStatus
from hda.sensing.lidar import Lidar
from hda.task.scenario import Scenario, ground_point
from rl.environment.action import scale_actions
from rl.environment.encoding import SeenFlight
from rl.environment.native.batch_settings import BatchSettings
from rl.environment.native.flight_kernels import Flights, Vehicle, fly_decisions, take_look
from rl.inference.arrays import Array32

REWARD_TERMS = tuple(term.name for term in fields(RewardTerms))
"""The terms of the reward, in the order of the arrays here."""


class FlightBatch:
    """Episodes under way, each array with one row for each.

    Attributes:
        scenarios: what is flown.
        outcomes: how each ended; None in flight.
        state: shape (n, 7), true position [m], velocity [m/s] and mass [kg].
        start_mass: [kg] shape (n,).
        target: [m] shape (n, 3), in the frame of the estimated position.
        nominal_target: [m] shape (n, 3).
        navigation_error: shape (n, 6), estimated minus true position [m] and velocity [m/s].
        time_to_go: [s] shape (n,), what remains.
        width: [m] shape (n,), of the newest look.
        index: shape (n,), decisions flown.
        pointing_limited: shape (n,), control periods so far in which the pointing limit acted.
        landed: shape (n,), on the plane after the last decision.
        timed_out: shape (n,), in flight after the last decision that the rules allow.
        reward_terms: shape (n, 5), of the last decision, in the order of `REWARD_TERMS`.
    """

    KEPT: tuple[str, ...] = ("state", "target", "time_to_go", "index", "pointing_limited")
    """What flights become, beside what `begin` draws: the arrays that a snapshot keeps."""

    def __init__(self, settings: BatchSettings) -> None:
        """Make room; `begin` fills it."""
        n, preset = settings.count, settings.preset
        self.settings = settings
        self.scenarios: list[Scenario | None] = [None] * n
        self.outcomes: list[Outcome | None] = [None] * n
        self.state, self.navigation_error = np.zeros((n, 7)), np.zeros((n, 6))
        self.target, self.nominal_target = np.zeros((n, 3)), np.zeros((n, 3))
        self.start_mass, self.time_to_go, self.width = np.zeros((3, n))
        self.index, self.pointing_limited, self._status = np.zeros((3, n), np.int64)
        self.landed, self.timed_out = np.zeros((2, n), np.bool_)
        self.reward_terms = np.zeros((n, len(REWARD_TERMS)))
        self._thrust_bound, self._noise = np.zeros((2, n))
        self._look_seed = self._thrust_seed = np.zeros((n, 0), np.uint32)
        lander, rules = preset.lander, preset.rules
        limits = lander.min_thrust, lander.max_thrust, lander.exhaust_velocity, lander.dry_mass
        self._vehicle = Vehicle(
            rules.control_period,
            rules.control_periods,
            np.array(preset.gravity),
            (*limits, pointing_angle(lander)),
        )
        self._pool = None if settings.threads == 1 else ThreadPoolExecutor(settings.threads)

    @property
    def steps(self) -> Index:
        """Steps flown in each episode, shape (n,): decisions."""
        return self.index

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()

    def spread(self, work: Callable[[int, int], None], count: int) -> None:
        """Call `work(first, last)` for parts of range(count), each in a thread of its own."""
        if self._pool is None:
            return work(0, count)
        ends = np.linspace(0, count, self.settings.threads + 1).astype(int).tolist()
        for done in [self._pool.submit(work, first, last) for first, last in pairwise(ends)]:
            done.result()
        return None

    def begin(self, place: int, scenario: Scenario) -> None:
        """Begin an episode at a place, whatever was flown there."""
        flight, streams = begin_flight(scenario), scenario.streams
        self.scenarios[place], self.outcomes[place] = scenario, None
        self.state[place] = scenario.initial_state.as_array()
        self.start_mass[place] = scenario.initial_state.mass
        self.target[place] = self.nominal_target[place] = scenario.nominal_target
        self.navigation_error[place] = scenario.navigation_error
        self.time_to_go[place] = flight.time_to_go
        self.index[place] = self.pointing_limited[place] = 0
        self.landed[place] = self.timed_out[place] = False
        self.reward_terms[place] = 0.0
        lidar = scenario.preset.lidar
        assert isinstance(lidar, Lidar)
        self._noise[place] = lidar.noise / lidar.noise_range
        self._thrust_bound[place] = scenario.preset.rules.thrust_error
        look, thrust = streams.look_seed(0), streams.thrust_seed(0)
        if self._look_seed.shape[1] != look.size:  # of a study whose seed has another number of words
            self._look_seed, self._thrust_seed = np.zeros((2, self.settings.count, look.size), np.uint32)
        self._look_seed[place], self._thrust_seed[place] = look, thrust

    def kept(self) -> dict[str, NDArray[Any]]:
        """What the flights have become, each array with one row for each."""
        return {name: getattr(self, name).copy() for name in self.KEPT}

    def take_up(self, kept: dict[str, NDArray[Any]]) -> None:
        """Let the flights be what they had become, after `begin` of each."""
        for name in self.KEPT:
            getattr(self, name)[:] = kept[name]

    def advance(self, actions: NDArray[np.floating]) -> Array:
        """Fly an action of each episode to the next look or the plane: the rewards, shape (n,).

        Raises:
            ValueError: the actions do not have shape (n, 5), or are not finite.
        """
        scaled = scale_actions(actions, self.width, self.settings.action_ranges)
        shift = np.stack([scaled.shift_x, scaled.shift_y, np.zeros_like(self.width)], axis=1)
        gains = scaled.position_gain, scaled.velocity_gain
        command = np.stack([*gains, self.time_to_go, scaled.time_to_go_rate], axis=1)
        mass, self.target = self.state[:, 6].copy(), self.target + shift
        self._fly(fly_decisions, command)
        self.time_to_go = command[:, 2].copy()
        self.index += 1
        return self._pay(mass)

    def _fly(self, kernel: Callable[[int, int, Flights, Vehicle], None], command: Array) -> None:
        """Fly every episode by a kernel, which reads a row of `command` for each; `landed` is set."""
        self._thrust_seed[:, -1] = self.index
        flights = Flights(
            self.state,
            self.target,
            command,
            self.navigation_error,
            self._thrust_seed,
            self._thrust_bound,
            self._status,
            self.pointing_limited,
        )
        self.spread(lambda first, last: kernel(first, last, flights, self._vehicle), len(command))
        self.landed = self._status != FlightStatus.FLYING

    def _pay(self, mass: Array) -> Array:
        """Rewards, shape (n,), of flights that began with a mass [kg], shape (n,); `timed_out` is set."""
        preset = self.settings.preset
        self.timed_out = ~self.landed & (self.index >= preset.rules.max_decisions)
        self._score((mass - self.state[:, 6]) / (self.start_mass - preset.lander.dry_mass))
        return reduce(np.add, self.reward_terms.T)

    def _score(self, burnt: Array) -> None:
        """Judge what ended, and fill in the terms of the reward."""
        self.reward_terms[:] = 0.0
        self.reward_terms[:, 0] = score_step(1.0, None).propellant * burnt
        for place in np.flatnonzero(self.landed | self.timed_out).tolist():
            outcome = self.outcomes[place] = self._judge(place)
            terms = score_step(float(burnt[place]), outcome)
            self.reward_terms[place] = [getattr(terms, name) for name in REWARD_TERMS]

    def _judge(self, place: int) -> Outcome:
        scenario, state = self.scenarios[place], self.state[place]
        assert scenario is not None
        final = State(state[:3], state[3:6], float(state[6]))
        return judge_flight(scenario, final, self.target[place], FlightStatus(self._status[place]))

    def aims(self) -> Array:
        """[m] shape (n, 3), where the targets really lie (`hda.task.scenario.ground_point`)."""
        aims = self.target.copy()
        aims[:, :2] -= self.navigation_error[:, :2]
        return aims

    def look(self, places: Index, take: Callable[[int, Array32], None]) -> None:
        """Take the look of this instant of some of the episodes.

        Args:
            places: shape (m,), which.
            take: called with k and the map of the k-th, shape (pixels, pixels), which is written over later.
        """
        lidar = self.settings.preset.lidar
        assert isinstance(lidar, Lidar)
        aims, limit = self.aims(), math.tan(lidar.off_nadir_limit)
        self.width[places] = lengths(self.state[places, :3] - aims[places]) * math.tan(lidar.field_of_view)
        self._look_seed[:, -1] = self.index

        def look_at(first: int, last: int) -> None:
            out = np.empty((lidar.pixels, lidar.pixels), np.float32)
            for k in range(first, last):
                place = int(places[k])
                scenario = self.scenarios[place]
                assert scenario is not None
                if self._map_is_missing(scenario, int(self.index[place])):
                    out[:] = 0.0
                else:
                    sensor = float(self.width[place]), float(self._noise[place]), limit
                    where = self.state[place, :3], aims[place]
                    take_look(self._look_seed[place], *where, scenario.tile.probability, sensor, out)
                take(k, out)

        self.spread(look_at, len(places))

    @staticmethod
    def _map_is_missing(scenario: Scenario, index: int) -> bool:
        lidar = scenario.preset.lidar
        assert isinstance(lidar, Lidar)
        return lidar.dropout > 0.0 and scenario.streams.map_is_missing(index, lidar.dropout)

    def seen(self, places: Index) -> SeenFlight:
        """What is seen of some of the episodes but the maps, after `look`."""
        state, error = self.state[places], self.navigation_error[places]
        return SeenFlight(
            position=state[:, :3] + error[:, :3],
            velocity=state[:, 3:6] + error[:, 3:],
            mass=state[:, 6:],
            width=self.width[places, None],
            time_to_go=self.time_to_go[places, None],
            target=self.target[places],
        )


def judge_flight(scenario: Scenario, final: State, target: Array, status: FlightStatus) -> Outcome:
    """How a flight ended that was to end on the target plane.

    Args:
        scenario: what was flown.
        final: the last state.
        target: [m] shape (3,), the last, in the frame of the estimated position.
        status: where the vehicle was left; in flight, if the rules allow no more decisions.
    """
    landed, preset = status != FlightStatus.FLYING, scenario.preset
    contact = Contact(
        landed=landed,
        safe_cell=landed and scenario.tile.is_safe(final.position),
        tank_empty=status == FlightStatus.TANK_EMPTY,
    )
    aim = ground_point(scenario, target)
    return classify(scenario.initial_state, final, aim, contact, preset.lander, preset.rules)


def lengths(vectors: Array) -> Array:
    """Lengths of vectors, shape (n, 3), to the bit as `numpy.linalg.norm` gives that of each alone."""
    return np.sqrt(np.vecdot(vectors, vectors))
