"""The check of a plan: fly its thrust through the true motion, in SI, and measure every limit on the way.

Nothing here is shared with a solver: no scaling, no log-mass, no linearised bound. `solve_pdg` flies every
plan so before it calls it optimal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.kernel import compile_kernel

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
        unit = max(1.0, float(np.linalg.norm(problem.gravity)) / -MOON_GRAVITY[2])
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
def _fly(
    start: Array,
    step: float,
    mass: Array,
    acceleration: Array,
    gravity: Array,
    exhaust_velocity: float,
    out: Array,
) -> None:
    """Write flown states to `out`, shape ((N - 1) * _BETWEEN + 1, 7), by the classical Runge-Kutta method.

    The thrust is the plan's: planned mass times an acceleration that is linear between nodes.
    """
    rate, total, here = np.empty(7), np.empty(7), np.empty(7)
    dt = step / _BETWEEN
    out[0] = start
    flow = np.empty(mass.size)
    for k in range(mass.size):
        flow[k] = _length(acceleration[k, 0], acceleration[k, 1], acceleration[k, 2]) / exhaust_velocity
    for k in range(mass.size - 1):
        slope = math.log(mass[k + 1] / mass[k])
        bend = 0.5 * step * (flow[k + 1] - flow[k])
        for part in range(_BETWEEN):
            state = out[k * _BETWEEN + part]
            here[:] = state
            total[:] = 0.0
            planned = 0.0
            for stage in range(4):
                fraction = (part + 0.5 * ((stage + 1) // 2)) / _BETWEEN
                if stage != 2:
                    planned = mass[k] * math.exp(fraction * (slope + bend * (1.0 - fraction)))
                for axis in range(3):
                    u = acceleration[k, axis] + fraction * (acceleration[k + 1, axis] - acceleration[k, axis])
                    rate[axis] = here[3 + axis]
                    rate[3 + axis] = u * planned
                rate[6] = -_length(rate[3], rate[4], rate[5]) / exhaust_velocity
                for axis in range(3):
                    rate[3 + axis] = rate[3 + axis] / here[6] + gravity[axis]
                ahead = dt if stage == 2 else 0.5 * dt
                weight = 2.0 if stage in (1, 2) else 1.0
                for number in range(7):
                    total[number] += weight * rate[number]
                    here[number] = state[number] + ahead * rate[number]
            for number in range(7):
                out[k * _BETWEEN + part + 1, number] = state[number] + dt / 6.0 * total[number]


def fly_trajectory(trajectory: Trajectory, problem: LandingProblem) -> Array:
    """Flown states, shape (4 (N - 1) + 1, 7): at the nodes and three times between each two.

    Position [m], velocity [m/s], mass [kg]. The integration errs by less than a millimetre.
    """
    out = np.empty(((trajectory.nodes - 1) * _BETWEEN + 1, 7))
    start, exhaust = problem.state.as_array(), trajectory.exhaust_velocity
    step, acceleration = float(trajectory.time[1]), trajectory.acceleration
    _fly(start, step, trajectory.mass, acceleration, problem.gravity, exhaust, out)
    return out


def pointing_excess(thrust: Array, limit: float | None, max_thrust: float) -> float:
    """[rad] by how much thrusts, shape (N, 3) in any unit, lean beyond a limit; next to none has no lean."""
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


def _relaxation_gap(trajectory: Trajectory) -> float:
    """Planned flow against planned thrust, over intervals with one direction of thrust."""
    size = np.linalg.norm(trajectory.thrust, axis=1)
    aligned = (
        np.einsum("ij,ij->i", trajectory.thrust[1:], trajectory.thrust[:-1]) > 0.9999 * size[1:] * size[:-1]
    )
    flow = -np.diff(trajectory.mass) / np.diff(trajectory.time) * trajectory.exhaust_velocity
    gap = flow - 0.5 * (size[1:] + size[:-1])
    return max(0.0, float(gap[aligned].max())) if aligned.any() else 0.0


def fly_residuals(trajectory: Trajectory, problem: LandingProblem) -> Residuals:
    """Fly a plan's trajectory and measure it.

    Args:
        trajectory: a flight from the problem's start.
        problem: its limits.
    """
    fine = fly_trajectory(trajectory, problem)
    lander = problem.lander
    flown = fine[::_BETWEEN]
    times = np.linspace(0.0, trajectory.duration, _BETWEEN * (trajectory.nodes - 1) + 1)
    size = np.linalg.norm(trajectory.thrust_at(times), axis=1)
    speed = float(np.linalg.norm(flown[:, 3:6], axis=1).max())
    position_error = np.linalg.norm(flown[:, :3] - trajectory.position, axis=1)
    velocity_error = np.linalg.norm(flown[:, 3:6] - trajectory.velocity, axis=1)
    return Residuals(
        position=float(position_error.max()),
        velocity=float(velocity_error.max()),
        mass=float(np.abs(flown[:, 6] - trajectory.mass).max()),
        landing_position=float(position_error[-1]),
        landing_velocity=float(np.linalg.norm(flown[-1, 3:6] - problem.target_velocity)),
        thrust_above=max(0.0, float(size.max()) - lander.max_thrust),
        thrust_below=max(0.0, lander.min_thrust - float(size[::_BETWEEN].min())),
        thrust_dip=max(0.0, lander.min_thrust - float(size.min())),
        pointing=pointing_excess(trajectory.thrust, lander.pointing_limit, lander.max_thrust),
        glide_slope=_glide_excess(flown[:, :3] - flown[-1, :3], problem.glide_slope_limit),
        altitude=max(0.0, float(min(problem.target[2], fine[0, 2]) - fine[:, 2].min())),
        speed=0.0 if problem.speed_limit is None else max(0.0, speed - problem.speed_limit),
        propellant=max(0.0, lander.dry_mass - float(flown[-1, 6])),
        relaxation_gap=_relaxation_gap(trajectory),
    )
