"""A first guess of a rigid body's flight: the point mass's plan, the body along its thrust."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from guidance.arrays import Array
from guidance.descent.plan import Plan
from guidance.descent.problem import LandingProblem
from guidance.rigid_body.quaternion import error_into, heading_angle, point_into
from guidance.rigid_descent.flight import RigidFlight
from guidance.rigid_descent.problem import RigidLandingProblem

_BURNING = 0.02  # of full thrust: below, the thrust's direction says nothing
_LONGER = 1.05  # the flight that must turn takes longer


def easily_followed(problem: RigidLandingProblem) -> LandingProblem:
    """The point mass that keeps the least thrust and the limit of tilt from the start on.

    It bounds nothing, and may have no flight. Where it has one, the body follows that more easily than one of
    `problem.point_mass`, which may leave the engine off where the body's cannot be.
    """
    point, body = problem.point_mass, problem.body
    pointing = body.tilt_limit + body.gimbal_limit
    lander = replace(body.lander, pointing_limit=pointing if pointing < math.pi else None)
    return replace(point, lander=lander)


def guess_flight(problem: RigidLandingProblem, plan: Plan, nodes: int) -> RigidFlight:
    """Nodes at equal intervals along a plan of the point mass, stretched a little in time.

    The motion is not kept: the attitude follows the thrust as it turns, with no thought of torque.

    Args:
        problem: the rigid body's problem.
        plan: a flight of its point mass.
        nodes: N.
    """
    times = np.linspace(0.0, plan.time_of_flight, nodes)
    position, velocity = plan.states_at(times)
    thrust = plan.thrust_at(times - 1e-9 * (times == times[-1]) * times[-1])
    attitude = _attitudes(problem, thrust)
    rates = np.zeros((nodes, 3))
    duration = _LONGER * plan.time_of_flight
    for k in range(nodes - 1):
        error_into(attitude[k], attitude[k + 1], rates[k])
    rates[:-1] *= (nodes - 1) / duration
    size = np.linalg.norm(rates, axis=1)
    rates *= np.minimum(1.0, problem.body.rate_limit / np.maximum(size, 1e-12))[:, None]
    rates[0], rates[-1] = problem.state.rates, 0.0
    force = np.zeros((nodes, 3))
    force[:, 2] = np.linalg.norm(thrust, axis=1)
    if not problem.free_thrust:
        force[0] = problem.state.thrust
    mass = np.interp(times, plan.time, plan.mass)
    return RigidFlight(
        _LONGER * times, position, velocity / _LONGER, attitude, rates, mass, force, np.zeros((nodes, 3))
    )


def _attitudes(problem: RigidLandingProblem, thrust: Array) -> Array:
    """Along the thrust within the tilt limit, where there is any; between, from one to the next."""
    size = np.linalg.norm(thrust, axis=1)
    burning = np.flatnonzero(size > _BURNING * problem.body.lander.max_thrust)
    direction = np.tile([0.0, 0.0, 1.0], (len(thrust), 1))
    if burning.size:
        unit = thrust[burning] / size[burning, None]
        index = np.arange(len(thrust))
        direction = np.column_stack([np.interp(index, burning, column) for column in unit.T])
    lean = np.arctan2(np.linalg.norm(direction[:, :2], axis=1), direction[:, 2])
    tilt = np.minimum(lean, 0.98 * problem.body.tilt_limit)
    across = direction[:, :2] / np.maximum(np.linalg.norm(direction[:, :2], axis=1), 1e-12)[:, None]
    heading = heading_angle(problem.state.attitude)
    out = np.empty((len(thrust), 4))
    for k in range(len(thrust)):
        aim = np.array([*(np.sin(tilt[k]) * across[k]), np.cos(tilt[k])])
        point_into(aim, heading, out[k])
    point_into(np.array([0.0, 0.0, 1.0]), heading, out[-1])
    if not problem.free_attitude:
        out[0] = problem.state.attitude
    for k in range(1, len(out)):
        if out[k] @ out[k - 1] < 0.0:
            out[k] *= -1.0
    return out
