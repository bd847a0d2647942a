"""What a planner commands, flown by the true motion, and which limits that leaves, whoever planned.

Without air it is `guidance.rigid_body.motion`; with air and a leak, which only the peer's example has, the
same rates of change with these added, integrated by SciPy's DOP853.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.body import BodyNumbers
from guidance.rigid_body.motion import fly_intervals, rate_into
from guidance.rigid_body.quaternion import rotate_into, tilt_angle
from guidance.rigid_descent import RigidFlight, cut_commands
from studies.rigid_plans.peer_problems import PeerProblem, Surroundings

PARTS = 4
"""Of an interval, at whose ends limits are measured."""


@dataclass(frozen=True, eq=False)
class CommandedFlight:
    """A plan as its planner states it, in the problem's units and the site frame.

    Attributes:
        time: shape (K + 1,), of the nodes.
        states: shape (K + 1, 14): position, velocity, attitude, rates, mass, as planned.
        thrust: shape (K, 2, 3), body frame: commanded at both ends of each interval, linear between.
        torque: shape (K, 2, 3), likewise.
    """

    time: Array
    states: Array
    thrust: Array
    torque: Array

    @classmethod
    def of_flight(cls, flight: RigidFlight, lag: float) -> CommandedFlight:
        """What a flight of ours commands to an engine with a time constant `lag`."""
        return cls(flight.time, flight.states, flight.thrust_commands(lag), flight.torque_commands())

    def cut(self, parts: int) -> tuple[Array, Array, Array]:
        """Durations, thrust and torque with each interval cut in equal parts."""
        durations = np.repeat(np.diff(self.time) / parts, parts)
        return durations, cut_commands(self.thrust, parts), cut_commands(self.torque, parts)


def fly_commanded(flight: CommandedFlight, peer: PeerProblem) -> Array:
    """Fly open loop from the problem's start; only a free attitude is the plan's.

    Returns:
        Shape (PARTS K + 1, 17): states in the order of `guidance.rigid_body.state.SIZE`, each PARTS-th at a
        node.
    """
    problem = peer.problem
    start = problem.state.as_array()
    if problem.free_attitude:
        start[6:10] = flight.states[0, 6:10] / np.linalg.norm(flight.states[0, 6:10])
    durations, thrust, torque = flight.cut(PARTS)
    numbers = problem.body.numbers(problem.gravity)
    if peer.surroundings is None:
        return fly_intervals(start, thrust, torque, durations, numbers)
    return fly_in_air(start, thrust, torque, durations, numbers, peer.surroundings)


def fly_in_air(
    start: Array, thrust: Array, torque: Array, durations: Array, body: BodyNumbers, around: Surroundings
) -> Array:
    """As `fly_intervals`, for an engine without a lag, in air and with a leak."""
    assert body.engine_lag == 0.0
    from scipy.integrate import solve_ivp

    path = np.zeros((durations.size + 1, start.size))
    path[0] = start
    for k, duration in enumerate(durations):
        rates = _rates_in_air(thrust[k], torque[k], float(duration), body, around)
        end = solve_ivp(rates, (0.0, duration), path[k, :14], method="DOP853", rtol=1e-10, atol=1e-12)
        path[k + 1, :14] = end.y[:, -1]
        path[k + 1, 6:10] /= np.linalg.norm(path[k + 1, 6:10])
        path[k + 1, 14:] = thrust[k, 1]
    return path


def _rates_in_air(
    thrust: Array, torque: Array, duration: float, body: BodyNumbers, around: Surroundings
) -> Callable[[float, Array], Array]:
    drag, lever = np.array(around.drag), around.pressure_arm + body.engine_arm

    def rates(time: float, state: Array) -> Array:
        share = time / duration
        force = (1.0 - share) * thrust[0] + share * thrust[1]
        couple = (1.0 - share) * torque[0] + share * torque[1]
        y, wind, out = np.ascontiguousarray(state), np.empty(3), np.empty(14)
        y[6:10] = state[6:10] / np.linalg.norm(state[6:10])
        rotate_into(y[6:10] * np.array([1.0, -1.0, -1.0, -1.0]), y[3:6], wind)
        air = -drag * np.linalg.norm(wind) * wind
        # `rate_into` lets all force act at the engine: the couple takes the air to where it acts
        couple = couple + lever * np.array([-air[1], air[0], 0.0])
        rate_into(y, force + air, couple, body, out)
        out[13] = -np.linalg.norm(force) / body.exhaust_velocity - around.leak
        return out

    return rates


def least_between(commands: Array) -> Array:
    """Least size on each interval, shape (K,), of what is linear between its ends, shape (K, 2, 3).

    All other limits of commands are greatest at an end, as sizes and cones are convex.
    """
    first, along = commands[:, 0], commands[:, 1] - commands[:, 0]
    length = np.sum(along**2, axis=1)
    nearest = -np.sum(first * along, axis=1) / np.where(length > 0.0, length, 1.0)
    return np.linalg.norm(first + np.clip(nearest, 0.0, 1.0)[:, None] * along, axis=1)


def limit_excess(flown: Array, flight: CommandedFlight, peer: PeerProblem) -> dict[str, float]:
    """By which share each limit is left, of what the problem states, whatever `looseness` the planner had.

    Angles, rates, forces and speeds count as shares of their limits; lengths as shares of the distance to the
    target at the start; the tank as a share of the propellant. Tilt counts from the second node on.

    Args:
        flown: what `fly_commanded` gave.
        flight: what was commanded.
        peer: the problem.
    """
    problem, body, lander = peer.problem, peer.problem.body, peer.problem.body.lander
    offset = flown[:, :3] - problem.target
    distance = float(np.linalg.norm(problem.state.position - problem.target))
    force = flight.thrust.reshape(-1, 3)
    size = np.linalg.norm(force, axis=1)
    lean = np.arctan2(np.linalg.norm(force[:, :2], axis=1), force[:, 2])[size > 1e-3 * lander.max_thrust]
    tilt = np.array([tilt_angle(attitude) for attitude in flown[PARTS:, 6:10]])
    shares = {
        "most thrust": size / lander.max_thrust - 1.0,
        "gimbal": (lean - body.gimbal_limit) / (body.gimbal_limit or 1.0),
        "rate": np.linalg.norm(flown[:, 10:13], axis=1) / body.rate_limit - 1.0,
        "tilt": tilt / body.tilt_limit - 1.0,
        "altitude": -offset[:, 2] / distance,
        "tank": (lander.dry_mass - flown[-1:, 13]) / (problem.state.mass - lander.dry_mass),
    }
    if lander.min_thrust > 0.0:
        shares["least thrust"] = 1.0 - least_between(flight.thrust) / lander.min_thrust
    if max(body.torque_limit) > 0.0:
        shares["torque"] = np.abs(flight.torque).reshape(-1, 3) / np.array(body.torque_limit) - 1.0
    if problem.glide_slope is not None:
        width = np.linalg.norm(offset[:, :2], axis=1)
        shares["glide slope"] = (width - math.tan(problem.glide_slope) * offset[:, 2]) / distance
    if peer.speed_limit is not None:
        shares["speed"] = np.linalg.norm(flown[:, 3:6], axis=1) / peer.speed_limit - 1.0
    return {name: max(0.0, float(np.max(share, initial=0.0))) for name, share in shares.items()}
