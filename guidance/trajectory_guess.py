"""First guesses of a whole trajectory, in SI, for a solver that starts from one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.plan import Plan
from guidance.problem import LandingProblem

Array = NDArray[np.float64]


def least_energy_flight(problem: LandingProblem, nodes: int, time: float) -> dict[str, Array]:
    """The flight of least thrust acceleration squared, a cubic in time: it keeps the motion, not the limits.

    Args:
        problem: the landing problem.
        nodes: N.
        time: [s] time of flight.

    Returns:
        Time, position, velocity, mass and thrust at the nodes, as a Plan holds them; the mass is a guess.
    """
    share = np.linspace(0.0, 1.0, nodes)[:, None]
    start, speed, arrival = problem.offset, problem.state.velocity * time, problem.target_velocity * time
    second, third = -3.0 * start - 2.0 * speed - arrival, 2.0 * start + speed + arrival
    push = (2.0 * second + 6.0 * third * share) / time**2 - problem.gravity
    push[:, 2] += 1e-3 * problem.lander.max_thrust / problem.state.mass  # a zero thrust has no direction
    burnt = np.linspace(0.0, 0.5 * problem.log_mass_ratio, nodes)
    mass = problem.state.mass * np.exp(-burnt)
    return {
        "time": time * share[:, 0],
        "position": problem.target + start + speed * share + second * share**2 + third * share**3,
        "velocity": (speed + 2.0 * second * share + 3.0 * third * share**2) / time,
        "mass": mass,
        "thrust": push * mass[:, None],
    }


def rest_of_flight(problem: LandingProblem, earlier: Plan, nodes: int) -> dict[str, Array]:
    """What is left of an earlier plan, from its node nearest to the start, on `nodes` nodes."""
    gap = np.linalg.norm(earlier.position - problem.state.position, axis=1)
    first = min(float(earlier.time[int(gap.argmin())]), 0.98 * earlier.time_of_flight)
    times = np.linspace(first, earlier.time_of_flight, nodes)

    def at(values: Array) -> Array:
        return np.column_stack([np.interp(times, earlier.time, column) for column in values.T])

    mass = np.interp(times, earlier.time, earlier.mass)
    return {
        "time": times - first,
        "position": at(earlier.position),
        "velocity": at(earlier.velocity),
        "mass": np.minimum(mass, problem.state.mass),
        "thrust": earlier.thrust_at(times),
    }
