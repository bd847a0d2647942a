"""E-guidance and Apollo's polynomial guidance as laws of policies.

Sources: Cherry (1964) and Klumpp (1974), as `guidance.polynomial.descent_polynomial` states them.

Deviations of both. The time of flight is that of the cheapest descent that the lander can fly
(`guidance.polynomial.flight_time`), sought anew when the site changes and a clock between: Cherry finds it
from what the engine gives, Klumpp from the jerk at the end of the braking phase. One descent leads from the
first look to the ground: there is no change from a braking phase (P63) to an approach phase (P64), and no
descent at a constant rate (P66). The astronauts' redesignation is the change of site by the policy.

E-guidance is evaluated at each control instant: for a given time to go its linear acceleration is ZEM/ZEV's
with the gains 6 and 2, so that the two differ in the time alone. Apollo's law is solved anew at each look,
and the vehicle tracks its descent until the next (the lunar module solved every 2 s); in the last ten seconds
to the same site the descent in flight is kept, as the gains of the law grow without bound.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from guidance.arrays import Array
from guidance.polynomial.descent_polynomial import Arrival, meet_arrival
from guidance.polynomial.flight_time import cheapest_time_of_flight
from guidance.tracking.reference import TrackingReference, make_reference
from guidance.validation import finite_number
from guidance.zem_zev import ENERGY_OPTIMAL, time_to_go
from hda.policies.planned_descent import DescentMemory, PlannedDescent, raise_plan
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import Command, DecisionStatus, ZemZevCommand
from hda.task.observation import Observation, ScenarioView

_TIMES = (0.5, 2.5)  # times of flight that are looked at, in the quartic's of ZEM/ZEV


@dataclass(frozen=True)
class EGuidance:
    """Thrust acceleration linear in time, to rest at the site."""

    def begin(self, view: ScenarioView) -> ScenarioView:
        """Remember the lander and gravity."""
        return view

    def command(
        self, observation: Observation, site: Array, memory: ScenarioView
    ) -> tuple[ZemZevCommand, DecisionStatus, ScenarioView]:
        """Keep the clock for the same site; at the first look and for another, seek the cheapest time."""
        remaining = observation.time_to_go
        if observation.index == 0 or not np.array_equal(site[:2], observation.target[:2]):
            remaining = _cheapest_time(observation, Arrival(site), memory)
        gains = ENERGY_OPTIMAL
        command = ZemZevCommand(gains.position_gain, gains.velocity_gain, remaining)
        return command, DecisionStatus.NOMINAL, memory


@dataclass(frozen=True)
class ApolloGuidance:
    """Acceleration quadratic in time, to rest at the site with a given acceleration upward.

    Attributes:
        arrival_acceleration: [m/s^2] of the lander at the end, upward; chosen on tuning episodes of `paper`.
        commit_time: [s] with less time left than this, and the same site, the descent in flight is kept.
        tracking: how a descent is tracked.
    """

    arrival_acceleration: float = 5.5
    commit_time: float = 10.0
    tracking: PlannedDescent = field(default_factory=PlannedDescent)

    def __post_init__(self) -> None:
        """Refuse an end that no flight has."""
        finite_number("arrival_acceleration", self.arrival_acceleration, at_least=0.0)
        finite_number("commit_time", self.commit_time, at_least=0.0)

    def begin(self, view: ScenarioView) -> DescentMemory:
        """No descent yet."""
        return DescentMemory(view)

    def command(
        self, observation: Observation, site: Array, memory: DescentMemory
    ) -> tuple[Command, DecisionStatus, DescentMemory]:
        """Solve for the descent anew, or fly on."""
        memory = raise_plan(memory, site)
        view, remaining = memory.view, memory.reference
        same_site = memory.site is not None and np.array_equal(site, memory.site)
        status = DecisionStatus.NOMINAL
        if not (same_site and remaining is not None and remaining.duration <= self.commit_time):
            fresh = self._descend(observation, site, view, remaining if same_site else None)
            if fresh is not None:
                memory = replace(memory, site=site.copy(), reference=fresh)
            elif remaining is not None:
                status = DecisionStatus.FALLBACK_LAST_PLAN
            else:
                command, _, _ = FixedGainZemZev().command(observation, site, view)
                return command, DecisionStatus.FALLBACK_ZEM_ZEV, replace(memory, site=None)
        assert memory.reference is not None
        flown, mass = memory.reference, observation.state.mass
        command = self.tracking.command_of(flown, view, mass)
        return command, status, replace(memory, reference=flown.after(view.control_periods))

    def _descend(
        self, observation: Observation, site: Array, view: ScenarioView, remaining: TrackingReference | None
    ) -> TrackingReference | None:
        """The descent at the control instants; None from below the site."""
        state, period = observation.state, view.control_period
        if state.position[2] <= site[2]:
            return None
        arrival = Arrival(site, acceleration=np.array([0.0, 0.0, self.arrival_acceleration]))
        seconds = _cheapest_time(observation, arrival, view) if remaining is None else remaining.duration
        periods = max(round(seconds / period), 1)
        descent = meet_arrival(state, arrival, periods * period)
        times = period * np.arange(periods + 1, dtype=np.float64)
        return make_reference(descent.position_at(times), descent.velocity_at(times), period, view.gravity)


def _cheapest_time(observation: Observation, arrival: Arrival, view: ScenarioView) -> float:
    """[s] of the cheapest descent, in whole control periods."""
    period = view.control_period
    quartic = max(time_to_go(observation.state, arrival.position, view.gravity), period)
    least, most = (max(round(factor * quartic / period), 1) for factor in _TIMES)
    times = period * np.arange(least, most + 1, dtype=np.float64)
    return cheapest_time_of_flight(observation.state, arrival, times, view.lander, view.gravity)
