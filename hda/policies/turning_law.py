"""How planned guidance flies a lander that must turn: smooth descents, and gentle feedback."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.body import DEFAULT_BODY, RigidBody
from guidance.rigid_body.motion import turning_acceleration
from guidance.rigid_body.state import RigidState
from guidance.tracking.looks_ahead import LooksAhead
from guidance.tracking.reference import TrackingReference
from guidance.tracking.regulator import TrackingWeights, tracking_gains
from guidance.tracking.turning_descent import DEFAULT_TURNING, TurningOptions, plan_turning_descent
from hda.policy import PlanCommand
from hda.sensing.sensor_axis import is_fixed
from hda.task.observation import Observation, ScenarioView

_REVERSAL = math.radians(6.0)  # of lean, one way and the other, by which a late divert is flown


@dataclass(frozen=True)
class TurningLaw:
    """Plans and feedback for a rigid body.

    Attributes:
        options: how descents are planned. Where they have no looks, a sensor that is fixed to the body adds
            its own.
        upward: weights of the feedback along the vertical, which the throttle answers.
        across: weights across it, which the body answers some seconds later.
        lead: [s] by which the body points ahead of its plan: about what its turn takes.

    Raises:
        ValueError: a field is out of range.
    """

    options: TurningOptions = DEFAULT_TURNING
    upward: TrackingWeights = field(default_factory=lambda: TrackingWeights(acceleration=0.1))
    across: TrackingWeights = field(default_factory=lambda: TrackingWeights(1.0, 0.25, 0.07))
    lead: float = 1.5

    def plan(self, observation: Observation, site: Array, view: ScenarioView) -> TrackingReference | None:
        """A smooth descent from the present attitude; None where there is none within the limits."""
        if view.body is None or observation.attitude is None:
            return None
        seen = observation.state
        state = RigidState(seen.position, seen.velocity, seen.mass, observation.attitude)
        options = self.options
        if options.looks is None and is_fixed(view.lidar):
            half_angle, least = view.lidar.off_nadir_limit, reversal_time(view.body)
            options = replace(options, looks=LooksAhead(view.decision_interval, half_angle, least))
        return plan_turning_descent(state, site, view.body, view.control_period, options, view.gravity)

    def command(self, reference: TrackingReference, period: float) -> PlanCommand:
        """Track a descent with control periods of `period` [s]."""
        across, upward = tracking_gains(period, self.across), tracking_gains(period, self.upward)
        return PlanCommand(reference, upward, lateral_gains=across, lead=self.lead)


@lru_cache(maxsize=8)
def load_smooth_planner(law: TurningLaw, period: float) -> None:
    """Plan once per process, so that the first decision does not wait for compiled code.

    Args:
        law: makes the plans.
        period: [s] between two control instants.
    """
    state = RigidState(np.array([200.0, 100.0, 900.0]), np.array([-8.0, -4.0, -30.0]), 1200.0)
    reference = plan_turning_descent(state, np.zeros(3), DEFAULT_BODY, period, law.options)
    if reference is not None:
        law.command(reference, period)


def reversal_time(body: RigidBody) -> float:
    """[s] that a late divert takes at least: the body leans one way, the other, and stands upright again.

    A turn by an angle takes 2 sqrt(angle / acceleration) with the torques of two axes.

    Args:
        body: the vehicle.
    """
    acceleration = turning_acceleration(body.inertia_mass, body.numbers())
    turns = (_REVERSAL, 2.0 * _REVERSAL, _REVERSAL)
    return sum(2.0 * math.sqrt(angle / acceleration) for angle in turns)
