"""Which constraint families a landing problem needs: what decides the sparsity of its convex problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from guidance.convex import constraints
from guidance.convex.condensed import burnt_mass, landing_moments
from guidance.convex.constraints import Rows
from guidance.convex.rotating_motion import rotating_motion
from guidance.convex.scaling import ScaledProblem
from guidance.descent.problem import LandingProblem

Family = Callable[[Any, ScaledProblem], Rows]  # a Layout or a CondensedLayout


@dataclass(frozen=True)
class ConstraintSet:
    """What decides the sparsity of the problem.

    Attributes:
        nodes: N.
        min_thrust: whether the engine has a lower bound.
        pointing: whether the thrust direction is limited.
        glide_slope: whether there is a glide slope limit below the horizon.
        speed_limit: whether the speed is limited.
        final_thrust_direction: whether the last thrust's direction is limited.
        thrust_rate: whether the change of the thrust is limited.
        line_of_sight: whether the vehicle must stay within a cone from the target.
        rotates: whether the frame turns.
        free_landing_point: whether the landing point may move in the target's plane.
    """

    nodes: int
    min_thrust: bool = False
    pointing: bool = False
    glide_slope: bool = False
    speed_limit: bool = False
    final_thrust_direction: bool = False
    thrust_rate: bool = False
    line_of_sight: bool = False
    rotates: bool = False
    free_landing_point: bool = False

    @classmethod
    def of(cls, problem: LandingProblem, nodes: int, free_landing_point: bool = False) -> ConstraintSet:
        """The constraint set that `problem` needs."""
        pointing, limits = problem.lander.pointing_limit, problem.limits
        return cls(
            nodes,
            min_thrust=problem.lander.min_thrust > 0.0,
            pointing=pointing is not None and pointing < np.pi,
            glide_slope=problem.has_glide_slope,
            speed_limit=limits.speed is not None,
            final_thrust_direction=limits.final_thrust_direction is not None,
            thrust_rate=limits.thrust_rate is not None,
            line_of_sight=limits.line_of_sight is not None,
            rotates=problem.rotates,
            free_landing_point=free_landing_point,
        )

    @property
    def families(self) -> list[Family]:
        """Constraint functions in row order."""
        chosen: list[tuple[bool, Family]] = [
            (True, constraints.start),
            (not self.rotates, constraints.motion),
            (self.rotates, rotating_motion),
            (True, constraints.landing),
            (True, constraints.max_thrust),
            (self.min_thrust, constraints.min_thrust),
            (True, constraints.altitude_floor),
            (self.pointing, constraints.pointing),
            (self.final_thrust_direction, constraints.final_thrust_direction),
            (True, constraints.dry_mass),
            (self.free_landing_point, constraints.landing_error_limit),
            (True, constraints.thrust_cone),
            (self.thrust_rate, constraints.thrust_rate),
            (self.glide_slope, constraints.glide_slope),
            (self.speed_limit, constraints.speed_limit),
            (self.line_of_sight, constraints.line_of_sight),
            (self.free_landing_point, constraints.landing_error),
        ]
        return [family for wanted, family in chosen if wanted]

    @property
    def can_condense(self) -> bool:
        """Whether the problem without its states says all but the altitude floor."""
        on_path = self.glide_slope or self.speed_limit or self.line_of_sight
        return not (on_path or self.rotates or self.free_landing_point)

    @property
    def condensed_families(self) -> list[Family]:
        """Constraint functions of the problem without its states, in row order."""
        chosen: list[tuple[bool, Family]] = [
            (True, burnt_mass),
            (True, landing_moments),
            (True, constraints.max_thrust),
            (self.min_thrust, constraints.min_thrust),
            (self.pointing, constraints.pointing),
            (self.final_thrust_direction, constraints.final_thrust_direction),
            (True, constraints.dry_mass),
            (True, constraints.thrust_cone),
            (self.thrust_rate, constraints.thrust_rate),
        ]
        return [family for wanted, family in chosen if wanted]
