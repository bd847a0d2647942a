"""Planned descent that waits for a look where the sensor may fail: no map yet, no hurry down."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from guidance.arrays import Array
from guidance.tracking.reference import TrackingReference
from guidance.tracking.soft_landing import plan_timed_landing
from guidance.validation import finite_number
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.planned_descent import DescentMemory
from hda.policy import Command, DecisionStatus
from hda.sensing.lidar import Lidar
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True, eq=False)
class WaitingMemory:
    """What the law remembers between looks.

    Attributes:
        descent: memory of the law that flies.
        blind: no look has brought a map yet, and the next may.
    """

    descent: DescentMemory
    blind: bool


@dataclass(frozen=True)
class WaitingDescent:
    """As `AdjustedDescent`, but as long as no look has brought a map the landing is put off.

    While no more than `look_time` is left of the flight and nothing was seen, each look plans a landing one
    decision interval later than the last plan: the next look comes as long before the landing as this one. It
    ends with the first map, or where the later plan would come to the gate with less than `reserve` of the
    propellant on board. On a sensor that always brings a map it is `AdjustedDescent`, and so it is for
    a rigid body: the later plan is a point mass's, which no body follows.

    Attributes:
        adjusted: flies otherwise.
        look_time: [s] what a first look should leave of the flight.
        reserve: share of the propellant on board that the later plan leaves in the tank at the gate. The
            terminal phase, and what a late divert costs, are paid from it.
    """

    adjusted: AdjustedDescent = field(default_factory=AdjustedDescent)
    look_time: float = 20.0
    reserve: float = 0.3

    def __post_init__(self) -> None:
        """Refuse a reserve that is no share."""
        finite_number("look_time", self.look_time, at_least=0.0)
        finite_number("reserve", self.reserve, at_least=0.0, at_most=1.0)

    def begin(self, view: ScenarioView) -> WaitingMemory:
        """No plan yet, nothing seen."""
        fails = isinstance(view.lidar, Lidar) and view.lidar.dropout > 0.0
        return WaitingMemory(self.adjusted.begin(view), fails)

    def command(
        self, observation: Observation, site: Array, memory: WaitingMemory
    ) -> tuple[Command, DecisionStatus, WaitingMemory]:
        """Fly on, or put the landing off."""
        blind = memory.blind and not observation.has_map
        descent = memory.descent
        command, status, after = self.adjusted.command(observation, site, descent)
        if blind and status is DecisionStatus.NOMINAL:
            later = self._later(observation, site, descent)
            if later is not None:
                view = descent.view
                command = self.adjusted.planned.command_of(later, view, observation.state.mass)
                after = replace(after, site=site.copy(), reference=later.after(view.control_periods))
        return command, status, WaitingMemory(after, blind)

    def _later(
        self, observation: Observation, site: Array, descent: DescentMemory
    ) -> TrackingReference | None:
        """A landing one decision interval after the last plan's; None where it is too early or too dear."""
        view, state, remaining = descent.view, observation.state, descent.reference
        if view.body is not None or remaining is None or remaining.duration > self.look_time:
            return None
        periods = remaining.thrust_acceleration.shape[0] + view.control_periods
        options = self.adjusted.planned.options_for(view)
        landing = plan_timed_landing(
            state, site, view.lander, (view.control_period, periods), options, view.gravity
        )
        aboard = state.mass - view.lander.dry_mass
        if landing.plan is None or landing.plan.propellant > (1.0 - self.reserve) * aboard:
            return None
        return landing.reference
