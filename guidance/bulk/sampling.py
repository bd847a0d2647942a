"""A flight at equal steps of its time: of an extremal, exactly along burn, coast and burn; of a plan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.plan import Plan
from guidance.flight_time.extremal import Extremal, PrimerProblem, set_primer
from guidance.flight_time.linear_system import dot
from guidance.flight_time.primer_trajectory import advance_extremal
from guidance.kernel import compile_kernel


class Nodes(NamedTuple):
    """Flights on n nodes each, written in place; nan where there is no flight.

    Attributes:
        time: [s] shape (N, n), from 0 to the time of flight.
        position: [m] shape (N, n, 3), site frame.
        velocity: [m/s] shape (N, n, 3).
        mass: [kg] shape (N, n).
        thrust: [N] shape (N, n, 3).
    """

    time: Array
    position: Array
    velocity: Array
    mass: Array
    thrust: Array


def no_nodes(starts: int, nodes: int) -> Nodes:
    """Nodes to be written."""
    shapes = [(starts, nodes), (starts, nodes, 3), (starts, nodes, 3), (starts, nodes), (starts, nodes, 3)]
    return Nodes(*(np.full(shape, np.nan) for shape in shapes))


@compile_kernel
def set_thrust(x: Extremal, time: float, max_thrust: float, out: Array) -> None:
    """Write the thrust [N], shape (3,): full along the primer before t1 and from t2 on, else none."""
    if x.times[0] <= time < x.times[1]:
        out[:] = 0.0
        return
    set_primer(x, time, out)
    out *= max_thrust / max(math.sqrt(dot(out, out)), 1e-12)


@compile_kernel
def sample_extremal(
    x: Extremal, problem: PrimerProblem, engine: tuple[float, float], target: Array, row: int, nodes: Nodes
) -> None:
    """Write a flight into a row of the nodes.

    Args:
        x: the extremal, in seconds.
        problem: its problem, in seconds.
        engine: [N] full thrust and [kg] mass at the start.
        target: [m] shape (3,).
        row: which one.
        nodes: the answer.
    """
    max_thrust, mass = engine
    unit, count = max_thrust / mass, nodes.time.shape[1]
    state = np.empty(7)
    state[:3], state[3:6], state[6] = problem.position, problem.velocity, 1.0
    before = 0.0
    for k in range(count):
        time = x.times[2] * k / (count - 1) if k < count - 1 else x.times[2]
        advance_extremal(x, problem, before, time, state)
        before = time
        nodes.time[row, k], nodes.mass[row, k] = time, mass * state[6]
        for axis in range(3):
            nodes.position[row, k, axis] = target[axis] + unit * state[axis]
            nodes.velocity[row, k, axis] = unit * state[3 + axis]
        set_thrust(x, time, max_thrust, nodes.thrust[row, k])


def sample_plan(plan: Plan, row: int, nodes: Nodes) -> None:
    """Write a plan's flight into a row of the nodes."""
    time = np.linspace(0.0, plan.time_of_flight, nodes.time.shape[1])
    nodes.time[row], nodes.mass[row] = time, plan.trajectory.mass_at(time)
    nodes.position[row], nodes.velocity[row] = plan.states_at(time)
    nodes.thrust[row] = plan.thrust_at(time)
