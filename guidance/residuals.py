"""The check of a plan: fly its thrust through the true motion, in SI, and measure every limit on the way.

Nothing here is shared with a solver: no scaling, no log-mass, no linearised bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.dynamics import integrate
from guidance.plan import Plan

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Residuals:
    """Greatest departures of the flown plan from what was planned and allowed; zero is perfect.

    Attributes:
        position: [m] greatest distance between flown and planned position at a node.
        velocity: [m/s] the same for velocity.
        mass: [kg] the same for mass; it holds the relaxation gap, propellant that is planned but not burnt.
        landing_position: [m] flown landing point from the planned one.
        landing_velocity: [m/s] flown velocity at the end from the problem's target velocity.
        thrust_above: [N] greatest excess over max_thrust, at nodes and between.
        thrust_below: [N] greatest lack below min_thrust at nodes (between them a change of direction may
            dip).
        pointing: [rad] greatest excess over the pointing limit at nodes.
        glide_slope: [m] greatest horizontal distance outside the glide slope cone, flown, at nodes.
        altitude: [m] greatest depth below the target's altitude, or below a start that rounding puts beneath
            it, flown, at nodes and between.
        speed: [m/s] greatest excess over the speed limit, flown, at nodes.
        propellant: [kg] flown propellant beyond what was on board.
        relaxation_gap: [N] mean planned mass flow times exhaust velocity, minus mean thrust, greatest over
            intervals whose thrust keeps its direction: zero where the relaxation is tight.
    """

    position: float
    velocity: float
    mass: float
    landing_position: float
    landing_velocity: float
    thrust_above: float
    thrust_below: float
    pointing: float
    glide_slope: float
    altitude: float
    speed: float
    propellant: float
    relaxation_gap: float


def _fly(plan: Plan, between: int) -> Array:
    """Flown states, shape ((N - 1) * between + 1, 7)."""
    steps = np.linspace(0.0, 1.0, between + 1)[1:]
    times = np.concatenate([[0.0], (plan.time[:-1, None] + np.diff(plan.time)[:, None] * steps).ravel()])
    problem = plan.problem
    return integrate(problem.state, plan.thrust_at, times, problem.lander, problem.gravity)


def _pointing_excess(thrust: Array, limit: float | None, max_thrust: float) -> float:
    size = np.linalg.norm(thrust, axis=1)
    burning = size > 1e-3 * max(float(size.max()), 1e-3 * max_thrust)  # what a solver leaves of zero is none
    if limit is None or not burning.any():
        return 0.0
    angle = np.arctan2(np.linalg.norm(thrust[burning, :2], axis=1), thrust[burning, 2])
    return max(0.0, float(angle.max()) - limit)


def _glide_excess(offset: Array, limit: float | None) -> float:
    if limit is None or limit >= math.pi / 2 - 1e-6:
        return 0.0
    outside = np.linalg.norm(offset[:, :2], axis=1) - math.tan(limit) * offset[:, 2]
    return max(0.0, float(outside.max()))


def _relaxation_gap(plan: Plan) -> float:
    """Planned flow against planned thrust, over intervals with one direction of thrust."""
    size = np.linalg.norm(plan.thrust, axis=1)
    aligned = np.einsum("ij,ij->i", plan.thrust[1:], plan.thrust[:-1]) > 0.9999 * size[1:] * size[:-1]
    flow = -np.diff(plan.mass) / np.diff(plan.time) * plan.problem.lander.exhaust_velocity
    gap = flow - 0.5 * (size[1:] + size[:-1])
    return max(0.0, float(gap[aligned].max())) if aligned.any() else 0.0


def fly_residuals(plan: Plan, between: int = 2) -> Residuals:
    """Fly a plan and measure it.

    Args:
        plan: a plan with a flight.
        between: samples of the flown path per interval.

    Raises:
        ValueError: the plan holds no flight.
    """
    if plan.nodes == 0:
        raise ValueError(f"a plan with status '{plan.status.value}' cannot be flown")
    problem, lander = plan.problem, plan.problem.lander
    fine = _fly(plan, between)
    flown = fine[::between]
    times = np.linspace(0.0, plan.time_of_flight, 4 * (plan.nodes - 1) + 1)
    greatest = float(np.linalg.norm(plan.thrust_at(times), axis=1).max())
    speed = float(np.linalg.norm(flown[:, 3:6], axis=1).max())
    position_error = np.linalg.norm(flown[:, :3] - plan.position, axis=1)
    velocity_error = np.linalg.norm(flown[:, 3:6] - plan.velocity, axis=1)
    return Residuals(
        position=float(position_error.max()),
        velocity=float(velocity_error.max()),
        mass=float(np.abs(flown[:, 6] - plan.mass).max()),
        landing_position=float(position_error[-1]),
        landing_velocity=float(np.linalg.norm(flown[-1, 3:6] - problem.target_velocity)),
        thrust_above=max(0.0, greatest - lander.max_thrust),
        thrust_below=max(0.0, lander.min_thrust - float(np.linalg.norm(plan.thrust, axis=1).min())),
        pointing=_pointing_excess(plan.thrust, lander.pointing_limit, lander.max_thrust),
        glide_slope=_glide_excess(flown[:, :3] - flown[-1, :3], problem.glide_slope_limit),
        altitude=max(0.0, float(min(problem.target[2], fine[0, 2]) - fine[:, 2].min())),
        speed=0.0 if problem.speed_limit is None else max(0.0, speed - problem.speed_limit),
        propellant=max(0.0, lander.dry_mass - float(flown[-1, 6])),
        relaxation_gap=_relaxation_gap(plan),
    )
