"""Non-dimensional numbers of the convex problem.

Units of one solve: the time of flight T, the acceleration a = max_thrust / start mass, hence a T for
velocity and a T^2 for length; origin at the target. The logarithm of m / m_start is measured in units of
kappa = a T / exhaust velocity, so that its rate is minus the slack. Then the equations of motion hold the
same numbers at every solve. In raw SI the solver says "Solved" and is a percent of the propellant wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from guidance.arrays import Array
from guidance.descent.limits import Cone
from guidance.descent.problem import LandingProblem

_LOOSE = 10.0  # scaled limit that binds no flight worth comparing


@dataclass(frozen=True, eq=False)
class MassBounds:
    """Affine stand-ins for thrust <= max_thrust and thrust >= min_thrust, as bounds on the slack s.

        s + upper_slope * zeta <= upper_bound        s + lower_slope * zeta >= lower_bound

    Attributes:
        upper_slope: shape (N,).
        upper_bound: shape (N,).
        lower_slope: shape (N,).
        lower_bound: shape (N,).
    """

    upper_slope: Array
    upper_bound: Array
    lower_slope: Array
    lower_bound: Array


@dataclass(frozen=True, eq=False)
class RateBounds:
    """Convex stand-in for |dT/dt| <= limit from node to node.

        |weight[k + 1] u[k + 1] - weight[k] u[k]| <= step[k] + eased[k] s[k + 1]

    Attributes:
        weight: shape (N,); masses over the start mass, or ones.
        step: shape (N - 1,).
        eased: shape (N - 1,).
    """

    weight: Array
    step: Array
    eased: Array


@dataclass(frozen=True, eq=False)
class ScaledProblem:
    """A LandingProblem at one time of flight, in the units of the module docstring.

    Attributes:
        time: [s] T, the unit of time.
        acceleration: [m/s^2] the unit of acceleration.
        kappa: the unit of log-mass.
        mass_ratio: ln(start mass / dry mass).
        position: start position from the target, shape (3,).
        velocity: start velocity, shape (3,).
        target_velocity: velocity at the landing point, shape (3,).
        gravity: at the target, shape (3,).
        mass_bounds: affine thrust bounds.
        propellant: greatest allowed -zeta at the end.
        pointing_cosine: cosine of the pointing limit; -1 for none.
        glide_angle: [rad] glide slope limit; pi/2 for none.
        speed_limit: greatest speed; 0 for none.
        final_thrust: axis of the final thrust's cone and the cosine of its angle, shape (4,); zeros for none.
        thrust_rate: bound on the change of the thrust.
        sight: of the line of sight, rows sine of the angle times the axis, and cosine times two unit vectors
            across, shape (3, 3); zeros for none.
        sight_apex: where its cone stands, shape (3,).
        rotation: [rad] of the frame during the flight, shape (3,).
        error_limit: greatest landing error where the landing point is free.
    """

    time: float
    acceleration: float
    kappa: float
    mass_ratio: float
    position: Array
    velocity: Array
    target_velocity: Array
    gravity: Array
    mass_bounds: MassBounds
    propellant: float
    pointing_cosine: float = -1.0
    glide_angle: float = np.pi / 2
    speed_limit: float = 0.0
    final_thrust: Array = field(default_factory=lambda: np.zeros(4))
    thrust_rate: RateBounds | None = None
    sight: Array = field(default_factory=lambda: np.zeros((3, 3)))
    sight_apex: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.zeros(3))
    error_limit: float = 0.0

    @property
    def length(self) -> float:
        """[m] the unit of length."""
        return self.acceleration * self.time**2

    @property
    def unknown_bound(self) -> float:
        """Bound on every scaled unknown of any flight within the thrust bounds (for certificates).

        All are reached from the start: the velocity at the end too, whatever is asked for. In a frame that
        turns by an angle A the velocity against the stars, v + A x r, grows as it does in one at rest.
        """
        turn, far = float(np.linalg.norm(self.rotation)), float(np.linalg.norm(self.position))
        gravity = float(np.linalg.norm(self.gravity))
        slack = float(
            np.max(self.mass_bounds.upper_bound + np.abs(self.mass_bounds.upper_slope) * self.propellant)
        )
        speed = float(np.linalg.norm(self.velocity)) + turn * far + gravity + slack
        return (1.0 + far + speed) * (1.0 + turn)


def least_log_mass(problem: LandingProblem, time: float, nodes: int) -> Array:
    """Lower bound on ln(m / m_start) at each node, shape (N,): full thrust throughout, and the dry mass.

    Guarded where full thrust would burn the whole vehicle: there the dry mass is the bound. The 2 % covers
    the trapezoidal rule of the mass equation, which burns a little more than the continuous engine can.
    """
    elapsed = np.linspace(0.0, time, nodes)
    remaining = 1.0 - problem.lander.max_mass_flow / problem.state.mass * elapsed
    dry = -problem.log_mass_ratio
    burnt = np.log(np.maximum(remaining, 1e-3 * np.exp(dry)))
    return np.maximum(1.02 * burnt, dry)


def outer_mass_bounds(problem: LandingProblem, time: float, kappa: float, nodes: int) -> MassBounds:
    """Outer relaxation of the thrust bounds: no flight above the dry mass that keeps them is excluded.

    s <= exp(-z) becomes its chord on [least log-mass, 0], which lies above the convex curve; s >= rho exp(-z)
    becomes a tangent, which lies below.
    """
    least = least_log_mass(problem, time, nodes)
    safe = np.minimum(least, -1e-9)
    chord = np.expm1(-safe) / safe  # slope of exp(-z), negative
    ratio = problem.lander.min_thrust / problem.lander.max_thrust
    middle = 0.5 * least
    touch = ratio * np.exp(-middle)
    return MassBounds(-chord * kappa, np.ones(nodes), touch * kappa, touch * (1.0 + middle))


def tangent_mass_bounds(problem: LandingProblem, log_mass: Array, kappa: float) -> MassBounds:
    """Thrust bounds linearised at a log-mass history ln(m / m_start), shape (N,).

    They are exact where the mass equals it. The upper bound is an inner one everywhere: a tangent lies below
    the convex curve.
    """
    touch = np.exp(-log_mass)
    ratio = problem.lander.min_thrust / problem.lander.max_thrust
    bound = touch * (1.0 + log_mass)
    return MassBounds(touch * kappa, bound, ratio * touch * kappa, ratio * bound)


def _axis_and_cosine(cone: Cone | None) -> Array:
    return np.zeros(4) if cone is None else np.append(cone.direction, math.cos(cone.angle))


def _cone_rows(cone: Cone | None) -> Array:
    if cone is None:
        return np.zeros((3, 3))
    return np.vstack([math.sin(cone.angle) * cone.direction, math.cos(cone.angle) * cone.across])


def rate_bounds(
    problem: LandingProblem, time: float, nodes: int, log_mass: Array | None
) -> RateBounds | None:
    """Bounds on the change of the thrust from node to node; None without a limit.

    With a reference ln(m / m_start) the thrust is its mass times the acceleration: what is wrong in the mass
    is wrong in the rate. Without one no flight is excluded: m_k (u_{k+1} - u_k) is the change of the thrust
    plus (m_k - m_{k+1}) u_{k+1}, where full thrust burns the most and the least mass is the lightest.
    """
    if problem.limits.thrust_rate is None:
        return None
    lander, intervals = problem.lander, nodes - 1
    allowed = np.full(intervals, problem.limits.thrust_rate / lander.max_thrust * time / intervals)
    if log_mass is not None:
        return RateBounds(np.exp(log_mass), allowed, np.zeros(intervals))
    lightest = np.exp(-least_log_mass(problem, time, nodes))
    burnt = lander.max_mass_flow / problem.state.mass * time / intervals
    return RateBounds(np.ones(nodes), lightest[:-1] * allowed, lightest[1:] * burnt)


def scale_problem(
    problem: LandingProblem,
    time: float,
    nodes: int,
    log_mass: Array | None = None,
    error_limit: float | None = None,
    limit_propellant: bool = False,
) -> ScaledProblem:
    """Non-dimensional numbers of `problem` at one time of flight.

    Args:
        problem: what to solve.
        time: [s] time of flight, above zero.
        nodes: N.
        log_mass: reference ln(m / m_start) for the thrust bounds, shape (N,); None for the outer relaxation.
        error_limit: [m] greatest landing error; None for no limit that could bind.
        limit_propellant: whether the dry mass bounds the flight. A least-propellant flight needs no such
            bound (it has the propellant or no flight has), and without it every time of flight can be
            compared.

    Returns:
        The scaled problem.
    """
    lander = problem.lander
    acceleration = lander.max_thrust / problem.state.mass
    kappa = acceleration * time / lander.exhaust_velocity
    length = acceleration * time**2
    if log_mass is None:
        bounds = outer_mass_bounds(problem, time, kappa, nodes)
    else:
        bounds = tangent_mass_bounds(problem, log_mass, kappa)
    loose = max(_LOOSE, math.exp(problem.log_mass_ratio))  # full thrust on the dry mass burns no more
    limit = lander.pointing_limit
    speed = problem.speed_bound
    return ScaledProblem(
        time=time,
        acceleration=acceleration,
        kappa=kappa,
        mass_ratio=problem.log_mass_ratio,
        position=problem.offset / length,
        velocity=problem.state.velocity / (acceleration * time),
        target_velocity=problem.target_velocity / (acceleration * time),
        gravity=problem.pull_at_target / acceleration,
        mass_bounds=bounds,
        propellant=min(problem.log_mass_ratio / kappa, loose) if limit_propellant else loose,
        pointing_cosine=-1.0 if limit is None else float(np.cos(limit)),
        glide_angle=np.pi / 2 if problem.glide_slope_limit is None else problem.glide_slope_limit,
        speed_limit=0.0 if speed is None else speed / (acceleration * time),
        final_thrust=_axis_and_cosine(problem.limits.final_thrust_direction),
        thrust_rate=rate_bounds(problem, time, nodes, log_mass),
        sight=_cone_rows(problem.limits.line_of_sight),
        rotation=problem.angular_velocity * time,
        error_limit=_LOOSE if error_limit is None else error_limit / length,
    )
