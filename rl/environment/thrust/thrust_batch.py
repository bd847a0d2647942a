"""Many flights under thrusts that an agent gives, one control period at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel
from guidance.thrust_limits import limit_into
from hda.flight.held_thrust import FlightConditions, VehicleLimits, hold_period
from hda.task.look_noise import draw_symmetric
from hda.task.scenario import Scenario
from rl.environment.action import clip_actions
from rl.environment.native.batch_settings import BatchSettings
from rl.environment.native.flight_batch import FlightBatch
from rl.environment.native.flight_kernels import Flights, Vehicle
from rl.environment.thrust.thrust_action import site_shift, thrust_acceleration
from rl.inference.arrays import Array32


@compile_kernel
def hold_thrusts(first: int, last: int, flights: Flights, vehicle: Vehicle) -> None:
    """Hold a thrust for one control period in flights `first` to `last` - 1, or until the target plane.

    The first three numbers of a flight's command are the thrust acceleration that it asks for [m/s^2].
    """
    limits = VehicleLimits(*vehicle.limits)
    commanded, after = np.empty(3), np.empty(7)
    for k in range(first, last):
        error = draw_symmetric(flights.thrust_seed[k], flights.thrust_bound[k])
        conditions = FlightConditions(
            vehicle.period,
            flights.site[k, 2],
            vehicle.gravity,
            limits,
            error,
            flights.navigation_error[k],
            None,  # compiled code takes no defaults
            None,
        )
        for axis in range(3):
            commanded[axis] = flights.state[k, 6] * flights.command[k, axis]
        if limit_into(commanded, limits.min_thrust, limits.max_thrust, limits.pointing_limit):
            flights.limited[k] += 1
        _, flights.status[k] = hold_period(flights.state[k], commanded, conditions, after)
        for number in range(7):
            flights.state[k, number] = after[number]


class ThrustBatch(FlightBatch):
    """As `FlightBatch`, but `advance` flies one control period under the thrusts of the actions.

    Attributes:
        held: shape (n,), control periods flown since the last look; 0 where a look is due.
        middle: [m] shape (n, 3), the target that the last look was centred on.
    """

    KEPT = (*FlightBatch.KEPT, "held", "middle", "width")

    def __init__(self, settings: BatchSettings) -> None:
        """Make room; `begin` fills it."""
        super().__init__(settings)
        self.held, self.middle = np.zeros(settings.count, np.int64), np.zeros((settings.count, 3))

    @property
    def steps(self) -> Index:
        """Control periods flown in each episode, shape (n,)."""
        return self.index * self.settings.preset.rules.control_periods + self.held

    def begin(self, place: int, scenario: Scenario) -> None:
        """Begin an episode at a place, whatever was flown there."""
        super().begin(place, scenario)
        self.held[place] = 0

    def look(self, places: Index, take: Callable[[int, Array32], None]) -> None:
        """Take the look of this instant of some of the episodes; as of `FlightBatch`."""
        super().look(places, take)
        self.middle[places] = self.target[places]

    def advance(self, actions: NDArray[np.floating]) -> Array:
        """Fly an action of each episode for one control period, or to the plane: the rewards, shape (n,).

        Raises:
            ValueError: the actions do not have shape (n, 5), or are not finite.
        """
        values, rules = clip_actions(actions, (len(self.held), 5)), self.settings.preset.rules
        shift = site_shift(values, self.width, self.settings.action_ranges.shift)
        self.target = self.target + np.where(self.held[:, None] == 0, shift, 0.0)
        asked = thrust_acceleration(values, self._vehicle.gravity)
        mass = self.state[:, 6].copy()
        self._fly(hold_thrusts, asked)
        self.time_to_go = self.time_to_go - rules.control_period
        self.held = np.where(self.landed, rules.control_periods, self.held + 1)
        whole = self.held == rules.control_periods
        self.index += whole
        self.held[whole] = 0
        return self._pay(mass)
