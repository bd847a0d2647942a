"""The check of a rigid body's plan: fly its commands through the true motion, in SI, and measure every limit.

Nothing here is shared with a solver: no scaling, no linearised motion. The commands are flown open loop, from
the start to the landing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.rigid_body.motion import fly_intervals
from guidance.rigid_body.quaternion import tilt_angle
from guidance.rigid_descent.flight import RigidFlight
from guidance.rigid_descent.problem import RigidLandingProblem
from guidance.validation import whole_number

_PARTS = 4  # of an interval, at whose ends the limits are measured
_TOLERANCE = {
    "position": 1.0,
    "velocity": 0.1,
    "attitude": 0.02,
    "rates": 0.01,
    "tilt": 0.02,
    "rate": 0.01,
    "glide_slope": 1.0,
    "altitude": 0.5,
    "propellant": 0.01,
}


@dataclass(frozen=True)
class RigidResiduals:
    """Greatest departures of the flown plan from what was planned and allowed; zero is perfect.

    Attributes:
        position: [m] greatest distance between flown and planned position at a node.
        velocity: [m/s] the same for velocity.
        attitude: [rad] the same for attitude.
        rates: [rad/s] the same for the rates.
        mass: [kg] the same for mass.
        landing_position: [m] flown end from the target.
        landing_velocity: [m/s] flown velocity at the end from the target velocity.
        landing_tilt: [rad] flown tilt at the end.
        landing_rates: [rad/s] size of the flown rates at the end.
        thrust_above: [N] greatest excess of the commanded thrust over max_thrust.
        thrust_below: [N] greatest lack below min_thrust.
        gimbal: [rad] greatest excess of the commanded thrust's angle from the body's z axis.
        torque: [N m] greatest excess of a commanded torque.
        rate: [rad/s] greatest excess over the body's rate limit, flown.
        tilt: [rad] the same over the tilt limit, and over `first_tilt_limit` before the second node.
        glide_slope: [m] greatest horizontal distance outside the glide slope cone, flown.
        altitude: [m] greatest depth below the target, flown.
        propellant: [kg] flown propellant beyond what was on board.
    """

    position: float
    velocity: float
    attitude: float
    rates: float
    mass: float
    landing_position: float
    landing_velocity: float
    landing_tilt: float
    landing_rates: float
    thrust_above: float
    thrust_below: float
    gimbal: float
    torque: float
    rate: float
    tilt: float
    glide_slope: float
    altitude: float
    propellant: float

    def excess(self, problem: RigidLandingProblem) -> dict[str, float]:
        """Each departure in units of what is allowed of it: 1 m and 0.1 m/s on the Moon, and so on."""
        unit = max(1.0, math.hypot(*problem.gravity) / -MOON_GRAVITY[2])
        lander, torque = problem.body.lander, max(problem.body.torque_limit)
        allowed = dict(_TOLERANCE)
        for name in ("position", "velocity", "glide_slope", "altitude"):
            allowed[name] *= unit
        allowed |= {
            "landing_position": allowed["position"],
            "landing_velocity": allowed["velocity"],
            "landing_tilt": allowed["attitude"],
            "landing_rates": allowed["rates"],
            "thrust_above": 1e-3 * lander.max_thrust,
            "thrust_below": 1e-3 * lander.max_thrust,
            "gimbal": 1e-2,
            "torque": 1e-3 * torque + 1e-9,
        }
        return {name: getattr(self, name) / bound for name, bound in allowed.items()}

    def keeps_limits(self, problem: RigidLandingProblem) -> bool:
        """Whether the flown plan lands where it should and keeps every limit, to the tolerance."""
        return max(self.excess(problem).values()) <= 1.0


def fly_plan(flight: RigidFlight, problem: RigidLandingProblem, parts: int = 1) -> Array:
    """Fly the commands of a planned flight open loop.

    Args:
        flight: a flight from the problem's start.
        problem: its vehicle and gravity.
        parts: into how many equal parts an interval is cut.

    Returns:
        Shape ((N - 1) parts + 1, 17): flown states, every `parts`-th at a node. The first is the problem's
        start, with the flight's attitude or thrust only where these are free.

    Raises:
        ValueError: parts is not a whole number of at least 1.
    """
    body = problem.body
    start = problem.state.as_array()
    if problem.free_attitude:
        start[6:10] = flight.attitude[0]
    if problem.free_thrust:
        start[14:17] = flight.thrust[0]
    thrust = cut_commands(flight.thrust_commands(body.engine_lag), parts)
    torque = cut_commands(flight.torque_commands(), parts)
    durations = np.repeat(np.diff(flight.time) / parts, parts)
    return fly_intervals(start, thrust, torque, durations, body.numbers(problem.gravity))


def cut_commands(commands: Array, parts: int) -> Array:
    """Cut each interval of linear commands in equal parts.

    Args:
        commands: shape (K, 2, 3), at both ends of each of K intervals; [N], [N m] or whatever they are.
        parts: of an interval.

    Returns:
        Shape (K parts, 2, 3): the same commands, in time order, at both ends of each part.

    Raises:
        ValueError: parts is not a whole number of at least 1.
    """
    whole_number("parts", parts, at_least=1)
    shares = np.linspace(0.0, 1.0, parts + 1)
    first, last = commands[:, None, 0], commands[:, None, 1]
    at = first + shares[None, :, None] * (last - first)
    return np.stack([at[:, :-1], at[:, 1:]], axis=2).reshape(-1, 2, 3)


def _turn_between(first: Array, second: Array) -> Array:
    """[rad] shape (n,): angle between attitudes, shape (n, 4)."""
    cosine = np.abs(np.sum(first * second, axis=1))
    gap = np.minimum(np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1))
    return 2.0 * np.arctan2(gap * np.sqrt(np.maximum(1.0 - 0.25 * gap**2, 0.0)), cosine)


def fly_rigid_residuals(flight: RigidFlight, problem: RigidLandingProblem) -> RigidResiduals:
    """Fly a plan and measure it.

    Args:
        flight: a flight from the problem's start.
        problem: its limits.
    """
    body, lander = problem.body, problem.body.lander
    fine = fly_plan(flight, problem, _PARTS)
    nodes, end = fine[::_PARTS], fine[-1]
    command = flight.thrust_commands(body.engine_lag).reshape(-1, 3)
    size = np.linalg.norm(command, axis=1)
    lean = np.arctan2(np.linalg.norm(command[:, :2], axis=1), command[:, 2])
    burning = size > 1e-3 * lander.max_thrust
    offset = fine[:, :3] - problem.target
    cone = math.tan(problem.glide_slope) if problem.glide_slope is not None else math.inf
    outside = np.linalg.norm(offset[:, :2], axis=1) - cone * np.maximum(offset[:, 2], 1e-9)
    tilts = np.array([tilt_angle(attitude) for attitude in fine[:, 6:10]])
    bound = np.full(len(fine), body.tilt_limit)
    bound[:_PARTS] = problem.first_tilt_limit

    def greatest(values: Array) -> float:
        return max(0.0, float(np.max(values, initial=0.0)))

    return RigidResiduals(
        position=greatest(np.linalg.norm(nodes[:, :3] - flight.position, axis=1)),
        velocity=greatest(np.linalg.norm(nodes[:, 3:6] - flight.velocity, axis=1)),
        attitude=greatest(_turn_between(nodes[:, 6:10], flight.attitude)),
        rates=greatest(np.linalg.norm(nodes[:, 10:13] - flight.rates, axis=1)),
        mass=greatest(np.abs(nodes[:, 13] - flight.mass)),
        landing_position=math.dist(end[:3], problem.target),
        landing_velocity=math.dist(end[3:6], problem.target_velocity),
        landing_tilt=float(tilts[-1]),
        landing_rates=float(np.linalg.norm(end[10:13])),
        thrust_above=greatest(size - lander.max_thrust),
        thrust_below=greatest(lander.min_thrust - size),
        gimbal=greatest(lean[burning] - body.gimbal_limit),
        torque=greatest(np.abs(flight.torque) - np.array(body.torque_limit)),
        rate=greatest(np.linalg.norm(fine[:, 10:13], axis=1) - body.rate_limit),
        tilt=greatest(tilts - bound),
        glide_slope=greatest(outside) if problem.glide_slope is not None else 0.0,
        altitude=greatest(-offset[:, 2]),
        propellant=max(0.0, lander.dry_mass - float(end[13])),
    )
