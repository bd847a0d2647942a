"""The check of a plan: fly its thrust through the true motion, in SI, and measure every limit on the way.

Nothing here is shared with a solver: no scaling, no log-mass, no linearised bound. `solve_pdg` flies every
plan so before it calls it optimal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.kernel import compile_kernel

_ALIGNED = 0.9999  # cosine of the change of direction over an interval whose thrust keeps it
_BETWEEN = 4  # Runge-Kutta steps per interval, in which the thrust is smooth; each is a sample of the path


@dataclass(frozen=True)
class FlightTolerance:
    """How far a flown plan may depart from what was planned and allowed, and still keep its limits.

    Flights of one duration are similar with lengths in proportion to gravity, and so is what a mesh hides:
    lengths and speeds are for the Moon and below, and grow with gravity above.

    Attributes:
        position: [m] of `position` and `glide_slope`.
        velocity: [m/s] of `velocity` and `speed`.
        altitude: [m].
        thrust: of `thrust_above` and `thrust_below`, relative to max_thrust and min_thrust.
        thrust_dip: of `thrust_dip`, relative to min_thrust.
        pointing: [rad].
        propellant: [kg].
    """

    position: float = 0.5
    velocity: float = 0.1
    altitude: float = 0.2
    thrust: float = 1e-3
    thrust_dip: float = 0.04
    pointing: float = 1e-3
    propellant: float = 1e-3


FLIGHT_TOLERANCE = FlightTolerance()
"""What planning, the timing study and the tests hold every plan to."""

RESIDUAL_UNITS = {
    "position": "m",
    "velocity": "m/s",
    "mass": "kg",
    "landing_position": "m",
    "landing_velocity": "m/s",
    "thrust_above": "N",
    "thrust_below": "N",
    "thrust_dip": "N",
    "pointing": "rad",
    "glide_slope": "m",
    "altitude": "m",
    "speed": "m/s",
    "propellant": "kg",
    "relaxation_gap": "N",
}
"""Unit of each of the `Residuals`."""


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
        thrust_below: [N] greatest lack below min_thrust at nodes.
        thrust_dip: [N] the same between nodes, where a change of direction makes the thrust dip.
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
    thrust_dip: float
    pointing: float
    glide_slope: float
    altitude: float
    speed: float
    propellant: float
    relaxation_gap: float

    def excess(self, problem: LandingProblem) -> dict[str, float]:
        """Each departure that a limit bounds, by name, in units of what `FLIGHT_TOLERANCE` allows of it.

        Args:
            problem: what the plan was asked.
        """
        lander, tolerance = problem.lander, FLIGHT_TOLERANCE
        unit = max(1.0, math.hypot(*problem.gravity) / -MOON_GRAVITY[2])
        allowed = {
            "position": tolerance.position * unit,
            "velocity": tolerance.velocity * unit,
            "thrust_above": tolerance.thrust * lander.max_thrust,
            "thrust_below": max(tolerance.thrust * lander.min_thrust, 1e-9),
            "thrust_dip": max(tolerance.thrust_dip * lander.min_thrust, 1e-9),
            "pointing": tolerance.pointing,
            "glide_slope": tolerance.position * unit,
            "altitude": tolerance.altitude * unit,
            "speed": tolerance.velocity * unit,
            "propellant": tolerance.propellant,
        }
        return {name: getattr(self, name) / bound for name, bound in allowed.items()}

    def keeps_limits(self, problem: LandingProblem) -> bool:
        """Whether the flown plan lands where it says and keeps every limit of `problem`, to the tolerance."""
        return max(self.excess(problem).values()) <= 1.0


@compile_kernel
def _length(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@compile_kernel
def _distance(first: Array, second: Array) -> float:
    return _length(first[0] - second[0], first[1] - second[1], first[2] - second[2])


@compile_kernel
def _fly(start: Array, steps: Array, thrust: Array, gravity: Array, exhaust_velocity: float) -> Array:
    """Flown states, shape ((N - 1) * _BETWEEN + 1, 7), by the classical Runge-Kutta method.

    Args:
        start: state, shape (7,).
        steps: [s] shape (N - 1,).
        thrust: [N] shape (N - 1, 2 * _BETWEEN + 1, 3).
        gravity: [m/s^2] shape (3,).
        exhaust_velocity: [m/s].
    """
    out = np.empty((steps.size * _BETWEEN + 1, 7))
    rate, total, here = np.empty(7), np.empty(7), np.empty(7)
    out[0] = start
    for k in range(steps.size):
        dt = steps[k] / _BETWEEN
        for part in range(_BETWEEN):
            state = out[k * _BETWEEN + part]
            here[:] = state
            total[:] = 0.0
            for stage in range(4):
                force = thrust[k, 2 * part + (stage + 1) // 2]
                for axis in range(3):
                    rate[axis] = here[3 + axis]
                    rate[3 + axis] = force[axis] / here[6] + gravity[axis]
                rate[6] = -_length(force[0], force[1], force[2]) / exhaust_velocity
                ahead = dt if stage == 2 else 0.5 * dt
                weight = 2.0 if stage in (1, 2) else 1.0
                for number in range(7):
                    total[number] += weight * rate[number]
                    here[number] = state[number] + ahead * rate[number]
            for number in range(7):
                out[k * _BETWEEN + part + 1, number] = state[number] + dt / 6.0 * total[number]
    return out


class _Departures(NamedTuple):
    """What a flown plan departs from, as its kernel measures it; units as in `Residuals`."""

    position: float
    velocity: float
    mass: float
    landing_position: float
    greatest_thrust: float
    least_thrust: float
    least_between: float
    lowest: float
    speed: float
    relaxation_gap: float


@compile_kernel
def _measure(
    fine: Array, thrust: Array, trajectory: tuple[Array, Array, Array, Array], exhaust_velocity: float
) -> _Departures:
    """Compare flown states with the plan.

    Args:
        fine: what `_fly` gives.
        thrust: [N] shape (N - 1, 2 * _BETWEEN + 1, 3).
        trajectory: time, position, velocity and mass at the nodes.
        exhaust_velocity: [m/s].
    """
    time, position, velocity, mass = trajectory
    far, fast, heavy, last, speed = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(time.size):
        flown = fine[k * _BETWEEN]
        last = _distance(flown[:3], position[k])
        far, fast = max(far, last), max(fast, _distance(flown[3:6], velocity[k]))
        heavy = max(heavy, abs(flown[6] - mass[k]))
        speed = max(speed, _length(flown[3], flown[4], flown[5]))
    lowest = np.inf
    for k in range(fine.shape[0]):
        lowest = min(lowest, fine[k, 2])
    greatest, least, between, gap = 0.0, np.inf, np.inf, 0.0
    for k in range(time.size - 1):
        for part in range(thrust.shape[1]):
            size = _length(thrust[k, part, 0], thrust[k, part, 1], thrust[k, part, 2])
            greatest, between = max(greatest, size), min(between, size)
        first, second = thrust[k, 0], thrust[k, -1]
        before, after = _length(first[0], first[1], first[2]), _length(second[0], second[1], second[2])
        least = min(least, before, after)
        along = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
        if along > _ALIGNED * before * after:
            flow = (mass[k] - mass[k + 1]) / (time[k + 1] - time[k]) * exhaust_velocity
            gap = max(gap, flow - 0.5 * (before + after))
    return _Departures(far, fast, heavy, last, greatest, least, between, lowest, speed, gap)


def fly_trajectory(trajectory: Trajectory, problem: LandingProblem) -> Array:
    """Flown states, shape (4 (N - 1) + 1, 7): at the nodes and three times between each two.

    Position [m], velocity [m/s], mass [kg]. The integration errs by less than a millimetre.
    """
    return _fly_thrust(trajectory, trajectory.sample_thrust(2 * _BETWEEN), problem)


def _fly_thrust(trajectory: Trajectory, thrust: Array, problem: LandingProblem) -> Array:
    time, exhaust = trajectory.time, trajectory.exhaust_velocity
    return _fly(problem.state.as_array(), time[1:] - time[:-1], thrust, problem.gravity, exhaust)


def pointing_excess(thrust: Array, limit: float | None, max_thrust: float) -> float:
    """[rad] by how much thrusts, shape (N, 3) in any unit, lean beyond a limit; next to none has no lean."""
    if limit is None:
        return 0.0
    size = np.linalg.norm(thrust, axis=1)
    burning = size > 1e-3 * max(float(size.max()), 1e-3 * max_thrust)  # what a solver leaves of zero is none
    if not burning.any():
        return 0.0
    angle = np.arctan2(np.linalg.norm(thrust[burning, :2], axis=1), thrust[burning, 2])
    return max(0.0, float(angle.max()) - limit)


def _glide_excess(offset: Array, limit: float | None) -> float:
    if limit is None or limit >= math.pi / 2 - 1e-6:
        return 0.0
    outside = np.linalg.norm(offset[:, :2], axis=1) - math.tan(limit) * offset[:, 2]
    return max(0.0, float(outside.max()))


def fly_residuals(trajectory: Trajectory, problem: LandingProblem) -> Residuals:
    """Fly a plan's trajectory and measure it.

    Args:
        trajectory: a flight from the problem's start.
        problem: its limits.
    """
    thrust = trajectory.sample_thrust(2 * _BETWEEN)
    fine = _fly_thrust(trajectory, thrust, problem)
    lander, end = problem.lander, fine[-1]
    nodes = trajectory.time, trajectory.position, trajectory.velocity, trajectory.mass
    found = _measure(fine, thrust, nodes, trajectory.exhaust_velocity)
    floor = min(float(problem.target[2]), float(fine[0, 2]))
    limit = math.inf if problem.speed_limit is None else problem.speed_limit
    return Residuals(
        position=found.position,
        velocity=found.velocity,
        mass=found.mass,
        landing_position=found.landing_position,
        landing_velocity=math.dist(end[3:6], problem.target_velocity),
        thrust_above=max(0.0, found.greatest_thrust - lander.max_thrust),
        thrust_below=max(0.0, lander.min_thrust - found.least_thrust),
        thrust_dip=max(0.0, lander.min_thrust - found.least_between),
        pointing=pointing_excess(trajectory.thrust, lander.pointing_limit, lander.max_thrust),
        glide_slope=_glide_excess(fine[::_BETWEEN, :3] - end[:3], problem.glide_slope_limit),
        altitude=max(0.0, floor - found.lowest),
        speed=max(0.0, found.speed - limit),
        propellant=max(0.0, lander.dry_mass - float(end[6])),
        relaxation_gap=found.relaxation_gap,
    )
