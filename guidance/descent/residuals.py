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
from guidance.descent.flown_path import BETWEEN, distance_between, fly_states, length_of
from guidance.descent.limits import Cone
from guidance.descent.problem import LandingProblem
from guidance.descent.thrust_direction import final_thrust_excess, pointing_excess
from guidance.descent.trajectory import Trajectory
from guidance.kernel import compile_kernel

_ALIGNED = 0.9999  # cosine of the change of direction over an interval whose thrust keeps it


@dataclass(frozen=True)
class FlightTolerance:
    """How far a flown plan may depart from what was planned and allowed, and still keep its limits.

    Flights of one duration are similar with lengths in proportion to gravity, and so is what a mesh hides:
    lengths and speeds are for the Moon and below, and grow with gravity above.

    Attributes:
        position: [m] of `position`, `glide_slope` and `line_of_sight`.
        velocity: [m/s] of `velocity` and `speed`.
        altitude: [m].
        thrust: of `thrust_above` and `thrust_below`, relative to max_thrust and min_thrust.
        thrust_dip: of `thrust_dip`, relative to min_thrust.
        thrust_rate: of `thrust_rate`, relative to the limit.
        pointing: [rad] of `pointing` and `final_thrust_direction`.
        propellant: [kg].
    """

    position: float = 0.5
    velocity: float = 0.1
    altitude: float = 0.2
    thrust: float = 1e-3
    thrust_dip: float = 0.04
    thrust_rate: float = 0.01
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
    "thrust_rate": "N/s",
    "pointing": "rad",
    "final_thrust_direction": "rad",
    "glide_slope": "m",
    "line_of_sight": "m",
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
        thrust_rate: [N/s] greatest excess of the thrust's change per second over its limit.
        pointing: [rad] greatest excess over the pointing limit at nodes.
        final_thrust_direction: [rad] excess over that limit at the last node.
        glide_slope: [m] greatest horizontal distance outside the glide slope cone, flown, at nodes.
        line_of_sight: [m] greatest distance outside that cone, flown, at nodes.
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
    thrust_rate: float
    pointing: float
    final_thrust_direction: float
    glide_slope: float
    line_of_sight: float
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
        unit = max(1.0, math.hypot(*problem.gravity.tolist()) / -MOON_GRAVITY[2])
        rate = tolerance.thrust_rate * (problem.limits.thrust_rate or math.inf)
        return {
            "position": self.position / (tolerance.position * unit),
            "velocity": self.velocity / (tolerance.velocity * unit),
            "thrust_above": self.thrust_above / (tolerance.thrust * lander.max_thrust),
            "thrust_below": self.thrust_below / max(tolerance.thrust * lander.min_thrust, 1e-9),
            "thrust_dip": self.thrust_dip / max(tolerance.thrust_dip * lander.min_thrust, 1e-9),
            "thrust_rate": self.thrust_rate / rate,
            "pointing": self.pointing / tolerance.pointing,
            "final_thrust_direction": self.final_thrust_direction / tolerance.pointing,
            "glide_slope": self.glide_slope / (tolerance.position * unit),
            "line_of_sight": self.line_of_sight / (tolerance.position * unit),
            "altitude": self.altitude / (tolerance.altitude * unit),
            "speed": self.speed / (tolerance.velocity * unit),
            "propellant": self.propellant / tolerance.propellant,
        }

    def keeps_limits(self, problem: LandingProblem) -> bool:
        """Whether the flown plan lands where it says and keeps every limit of `problem`, to the tolerance."""
        return max(self.excess(problem).values()) <= 1.0


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
        fine: flown states, as of `fly_states`.
        thrust: [N] shape (N - 1, 2 * BETWEEN + 1, 3).
        trajectory: time, position, velocity and mass at the nodes.
        exhaust_velocity: [m/s].
    """
    time, position, velocity, mass = trajectory
    far, fast, heavy, last, speed = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(time.size):
        flown = fine[k * BETWEEN]
        last = distance_between(flown[:3], position[k])
        far, fast = max(far, last), max(fast, distance_between(flown[3:6], velocity[k]))
        heavy = max(heavy, abs(flown[6] - mass[k]))
        speed = max(speed, length_of(flown[3], flown[4], flown[5]))
    lowest = np.inf
    for k in range(fine.shape[0]):
        lowest = min(lowest, fine[k, 2])
    greatest, least, between, gap = 0.0, np.inf, np.inf, 0.0
    for k in range(time.size - 1):
        for part in range(thrust.shape[1]):
            size = length_of(thrust[k, part, 0], thrust[k, part, 1], thrust[k, part, 2])
            greatest, between = max(greatest, size), min(between, size)
        first, second = thrust[k, 0], thrust[k, -1]
        before, after = length_of(first[0], first[1], first[2]), length_of(second[0], second[1], second[2])
        least = min(least, before, after)
        along = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
        if along > _ALIGNED * before * after:
            flow = (mass[k] - mass[k + 1]) / (time[k + 1] - time[k]) * exhaust_velocity
            gap = max(gap, flow - 0.5 * (before + after))
    return _Departures(far, fast, heavy, last, greatest, least, between, lowest, speed, gap)


@compile_kernel
def _fly_and_measure(
    start: tuple[Array, Array, float],
    thrust: Array,
    trajectory: tuple[Array, Array, Array, Array],
    field: tuple[Array, Array],
    exhaust_velocity: float,
) -> tuple[Array, _Departures]:
    """Flown states, and what they depart from; arguments as of `fly_states` and `_measure`."""
    fine = fly_states(start, trajectory[0], thrust, field, exhaust_velocity)
    return fine, _measure(fine, thrust, trajectory, exhaust_velocity)


def _rate_excess(thrust: Array, time: Array, limit: float | None) -> float:
    """[N/s] of thrusts sampled within intervals; a jump between two of them counts as one sample's change."""
    if limit is None:
        return 0.0
    part = np.diff(time) / (thrust.shape[1] - 1)
    within = np.linalg.norm(np.diff(thrust, axis=1), axis=2) / part[:, None]
    jumps = np.linalg.norm(thrust[1:, 0] - thrust[:-1, -1], axis=1) / part[1:]
    return max(0.0, float(within.max()) - limit, float(jumps.max()) - limit)


def _glide_excess(position: Array, limit: float | None) -> float:
    if limit is None or limit >= math.pi / 2 - 1e-6:
        return 0.0
    offset = position - position[-1]
    outside = np.linalg.norm(offset[:, :2], axis=1) - math.tan(limit) * offset[:, 2]
    return max(0.0, float(outside.max()))


def _sight_excess(position: Array, target: Array, cone: Cone | None) -> float:
    return 0.0 if cone is None else max(0.0, float(cone.outside(position - target).max()))


def fly_residuals(trajectory: Trajectory, problem: LandingProblem) -> Residuals:
    """Fly a plan's trajectory and measure it.

    Args:
        trajectory: a flight from the problem's start.
        problem: its limits.
    """
    thrust = trajectory.sample_thrust(2 * BETWEEN)
    lander, state, field = problem.lander, problem.state, (problem.gravity, problem.angular_velocity)
    nodes = trajectory.time, trajectory.position, trajectory.velocity, trajectory.mass
    start = state.position, state.velocity, state.mass
    fine, found = _fly_and_measure(start, thrust, nodes, field, trajectory.exhaust_velocity)
    end, flown = fine[-1].tolist(), fine[::BETWEEN, :3]
    floor = min(float(problem.target[2]), float(state.position[2]))
    limit = math.inf if problem.speed_limit is None else problem.speed_limit
    return Residuals(
        position=found.position,
        velocity=found.velocity,
        mass=found.mass,
        landing_position=found.landing_position,
        landing_velocity=math.dist(end[3:6], problem.target_velocity.tolist()),
        thrust_above=max(0.0, found.greatest_thrust - lander.max_thrust),
        thrust_below=max(0.0, lander.min_thrust - found.least_thrust),
        thrust_dip=max(0.0, lander.min_thrust - found.least_between),
        thrust_rate=_rate_excess(thrust, trajectory.time, problem.limits.thrust_rate),
        pointing=pointing_excess(trajectory.thrust, lander.pointing_limit, lander.max_thrust),
        final_thrust_direction=final_thrust_excess(trajectory.thrust, problem),
        glide_slope=_glide_excess(flown, problem.glide_slope_limit),
        line_of_sight=_sight_excess(flown, problem.target, problem.limits.line_of_sight),
        altitude=max(0.0, floor - found.lowest),
        speed=max(0.0, found.speed - limit),
        propellant=max(0.0, lander.dry_mass - end[6]),
        relaxation_gap=found.relaxation_gap,
    )
