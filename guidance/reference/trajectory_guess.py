"""First guesses of a whole trajectory, in SI, for a solver that starts from one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory

_ON_AXIS = 1e-6  # horizontal extent over the whole below which a descent counts as vertical
_SWING = 0.01  # of full thrust


def least_energy_flight(problem: LandingProblem, nodes: int, time: float) -> Trajectory:
    """The flight of least thrust acceleration squared, a cubic in time: it keeps the motion, not the limits.

    Args:
        problem: the landing problem.
        nodes: N.
        time: [s] time of flight.

    Returns:
        The flight; its mass is a guess.
    """
    fraction = np.linspace(0.0, 1.0, nodes)[:, None]
    start, speed, arrival = problem.offset, problem.state.velocity * time, problem.target_velocity * time
    second, third = -3.0 * start - 2.0 * speed - arrival, 2.0 * start + speed + arrival
    acceleration = (2.0 * second + 6.0 * third * fraction) / time**2 - problem.pull_at_target
    # a zero thrust has no direction
    acceleration[:, 2] += 1e-3 * problem.lander.max_thrust / problem.state.mass
    burnt = np.linspace(0.0, 0.5 * problem.log_mass_ratio, nodes)
    mass = problem.state.mass * np.exp(-burnt)
    return Trajectory(
        time * fraction[:, 0],
        problem.target + start + speed * fraction + second * fraction**2 + third * fraction**3,
        (speed + 2.0 * second * fraction + 3.0 * third * fraction**2) / time,
        mass,
        acceleration * mass[:, None],
        problem.lander.exhaust_velocity,
    )


def rest_of_flight(problem: LandingProblem, earlier: Trajectory, nodes: int) -> Trajectory:
    """What is left of an earlier flight, from its node nearest to the start, on `nodes` nodes."""
    gap = np.linalg.norm(earlier.position - problem.state.position, axis=1)
    first = min(float(earlier.time[int(gap.argmin())]), 0.98 * earlier.duration)
    times = np.linspace(first, earlier.duration, nodes)

    def at(values: Array) -> Array:
        return np.column_stack([np.interp(times, earlier.time, column) for column in values.T])

    mass = np.interp(times, earlier.time, earlier.mass)
    return Trajectory(
        times - first,
        at(earlier.position),
        at(earlier.velocity),
        np.minimum(mass, problem.state.mass),
        earlier.thrust_at(times),
        problem.lander.exhaust_velocity,
    )


def is_vertical(problem: LandingProblem) -> bool:
    """Whether nothing in the problem points sideways, so that every horizontal direction is alike."""
    vectors = np.array([problem.offset, problem.state.velocity, problem.gravity, problem.angular_velocity])
    across = np.linalg.norm(vectors[:, :2], axis=1)
    return bool((across <= _ON_AXIS * np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)).all())


def swing_sideways(problem: LandingProblem, flight: Trajectory, in_plane: bool = False) -> Trajectory:
    """Give a guess the sideways thrust that a local method cannot find by itself.

    A vertical guess is symmetric: no derivative points to either side, and the method stays on the axis. It
    gets a hundredth of full thrust. And a thrust below min_thrust, as a relaxed flight has, is brought up to
    it by a thrust to one side and back, a full wave of cosine: landing point and speed stay as they were.

    Args:
        problem: the landing problem.
        flight: a guess.
        in_plane: whether to thrust towards the target and back, in place of across the way to it.
    """
    thrust = flight.thrust
    size = np.linalg.norm(thrust, axis=1)
    lack = np.sqrt(np.maximum(problem.lander.min_thrust**2 - size**2, 0.0))
    swing = np.maximum(lack, _SWING * problem.lander.max_thrust if is_vertical(problem) else 0.0)
    if not swing.any():
        return flight
    east, north = problem.offset[:2] if problem.offset[:2].any() else (0.0, 1.0)
    side = np.array([east, north, 0.0] if in_plane else [north, -east, 0.0]) / math.hypot(east, north)
    wave = np.cos(np.linspace(0.0, 2.0 * np.pi, size.size))
    return replace(flight, thrust=thrust + (swing * wave)[:, None] * side)
