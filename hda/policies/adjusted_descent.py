"""Planned descent that meets a late change of site by deforming the plan in flight."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from guidance.arrays import Array
from guidance.tracking.reference import TrackingReference
from guidance.tracking.retarget import shift_landing_point, velocity_change, within_pointing, within_thrust
from hda.policies.planned_descent import DescentMemory, PlannedDescent, raise_plan
from hda.policy import Command, DecisionStatus, PlanCommand
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True)
class AdjustedDescent:
    """As `PlannedDescent`, but a new site may also be reached by a sideways shift of the plan in flight.

    Early, the cheaper of the shifted and the fresh plan flies; late, the shifted one wherever it keeps within
    the thrust and the pointing limit. A rigid body cannot lean at once as a shift asks: it flies fresh plans.

    Attributes:
        planned: makes and tracks fresh plans.
        adjust_time: [s] with less time left than this no fresh plan is asked for if the shift will do.
        reserve: share of the thrust, and of the pointing limit, that a shifted plan leaves to the feedback.
    """

    planned: PlannedDescent = field(default_factory=PlannedDescent)
    adjust_time: float = 11.0
    reserve: float = 0.05

    def begin(self, view: ScenarioView) -> DescentMemory:
        """No plan yet."""
        return self.planned.begin(view)

    def command(
        self, observation: Observation, site: Array, memory: DescentMemory
    ) -> tuple[Command, DecisionStatus, DescentMemory]:
        """Shift the plan in flight, replan, or fly on."""
        memory = raise_plan(memory, site)
        remaining, view = memory.reference, memory.view
        kept = remaining is None or memory.site is None or np.array_equal(site, memory.site)
        if remaining is None or kept or view.body is not None:
            return self.planned.command(observation, site, memory)
        shifted = shift_landing_point(remaining, site, view.gravity)
        possible = within_thrust(shifted, view.lander, observation.state.mass, self.reserve)
        possible = possible and within_pointing(shifted, view.lander, self.reserve)
        if not possible or remaining.duration > self.adjust_time:
            fresh = self.planned.command(observation, site, memory)
            if not possible or _is_cheaper(fresh[:2], shifted):
                return fresh
        command = self.planned.command_of(shifted, view, observation.state.mass)
        return (
            command,
            DecisionStatus.NOMINAL,
            replace(memory, site=site.copy(), reference=shifted.after(view.control_periods)),
        )


def _is_cheaper(fresh: tuple[Command, DecisionStatus], shifted: TrackingReference) -> bool:
    """Whether a fresh plan reached its site, and costs no more than the shifted one."""
    command, status = fresh
    if not isinstance(command, PlanCommand) or status is not DecisionStatus.NOMINAL:
        return False
    return velocity_change(command.reference) <= velocity_change(shifted)
