"""The flight of the indirect method, exact: a burn, a coast and a burn along an affine primer, on nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.flight_time.extremal import (
    Burn,
    Extremal,
    PrimerProblem,
    add_burn,
    set_direction,
    touches,
)
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.kernel import compile_kernel

_SLIVER = 1e-9
"""Of the time of flight: how far the two nodes of a switch, one before it and one after, lie apart."""
_CLOSER = 3  # power by which nodes approach a touch
_LONGEST_PART = 0.1  # of the time of flight: of a burn, in its quadrature


@dataclass(frozen=True, eq=False)
class PrimerTrajectory(Trajectory):
    """Full thrust along the primer in the first and the last burn, none between; nothing is interpolated.

    Each arc has nodes at both of its ends, so that a switch has two: the thrust before it and the thrust
    after it, a billionth of the flight later. Within an arc the intervals are equal.

    Attributes:
        flight: the arcs and the primer.
        max_thrust: [N].
    """

    flight: PrimerFlight
    max_thrust: float

    def states_at(self, time: Array, gravity: Array) -> tuple[Array, Array]:
        """Position [m] and velocity [m/s], shape (k, 3) each, exact; as `Trajectory.states_at`."""
        scale = self.max_thrust / float(self.mass[0])
        problem = PrimerProblem(
            np.zeros(3), self.velocity[0] / scale, gravity / scale, self.flight.scaled.mass_flow
        )
        states = _states(self.flight.extremal, problem, np.array(time, dtype=np.float64))
        return self.position[0] + scale * states[:, :3], scale * states[:, 3:6]

    def mass_at(self, time: Array) -> Array:
        """[kg] shape (k,), exact; as `Trajectory.mass_at`."""
        return self.mass[0] * (1.0 - self.flight.burnt_at(np.asarray(time, dtype=np.float64)))

    def sample_thrust(self, parts: int) -> Array:
        """[N] thrust within the intervals, shape (N - 1, parts + 1, 3); as `Trajectory.sample_thrust`."""
        out = np.empty((self.nodes - 1, parts + 1, 3))
        _sample(self.flight.extremal, self.max_thrust, self.time, out)
        return out

    def _thrust_within(self, time: Array) -> Array:
        flat = np.array(time, dtype=np.float64).reshape(-1)
        return _thrust(self.flight.extremal, self.max_thrust, flat).reshape((*np.shape(time), 3))


def lay_nodes(problem: LandingProblem, flight: PrimerFlight, nodes: int) -> PrimerTrajectory:
    """A flight of the indirect method on nodes.

    Args:
        problem: that it solves.
        flight: the flight.
        nodes: N, shared among the arcs by their durations; two for each arc at least.
    """
    lander, state = problem.lander, problem.state
    engine = float(lander.max_thrust), state.mass
    ends = state.position, state.velocity, problem.target
    time, position, velocity, mass, thrust = _lay(flight.extremal, flight.scaled, nodes, engine, ends)
    return PrimerTrajectory(
        time, position, velocity, mass, thrust, lander.exhaust_velocity, flight, lander.max_thrust
    )


@compile_kernel
def _node_times(x: Extremal, nodes: int) -> Array:
    """[s] the nodes of every arc, from the start to the end.

    A touch of the ground, where the thrust goes on, is one node, and they stand closer next to it, where the
    thrust turns fast; a switch of the engine is two.
    """
    final, share, laid, arcs = x.times[2], 0.0, 0, 0
    ends = np.empty(4)
    for k in range(-1, 3):
        end = x.touch[0] if k < 0 else x.times[k]
        if end > 0.0:
            ends[arcs] = end
            arcs += 1
    touched = touches(x)
    fewest = 2 * arcs - (1 if touched else 0)
    free, begin = max(nodes - fewest, 0), 0.0
    out = np.empty(fewest + free + 1)
    for arc in range(arcs):
        end = ends[arc]
        before = round(share)
        share += free * (end - max(begin, 0.0)) / final
        count = 2 + (free if arc == arcs - 1 else round(share)) - before
        for node in range(count):
            share_of_arc = node / (count - 1)
            if touched and arc == 0:
                share_of_arc = 1.0 - (1.0 - share_of_arc) ** _CLOSER
            elif touched and arc == 1:
                share_of_arc = share_of_arc**_CLOSER
            out[laid + node] = begin + (end - begin) * share_of_arc
        laid += count
        out[laid - 1] = end
        begin = end + _SLIVER * final
        if touched and arc == 0:
            laid, begin = laid - 1, end
    return out[:laid]


@compile_kernel
def _burning(x: Extremal, time: float) -> bool:
    """Whether the engine burns; at a switch it does what it did before."""
    return 0.0 <= time <= x.times[0] or time > x.times[1]


@compile_kernel
def _thrust(x: Extremal, max_thrust: float, times: Array) -> Array:
    """[N] shape (k, 3)."""
    out, direction = np.zeros((times.size, 3)), np.empty(3)
    for k in range(times.size):
        if _burning(x, times[k]):
            set_direction(x, times[k], direction)
            for axis in range(3):
                out[k, axis] = max_thrust * direction[axis]
    return out


@compile_kernel
def _sample(x: Extremal, max_thrust: float, times: Array, out: Array) -> None:
    """Write the thrust [N] within each interval to `out`, shape (N - 1, parts + 1, 3)."""
    parts, first = out.shape[1] - 1, x.primer[0]
    turn = (x.primer[1] - first) / (x.times[1] - x.times[0])
    for k in range(times.size - 1):
        step = (times[k + 1] - times[k]) / parts
        if not _burning(x, 0.5 * (times[k] + times[k + 1])):
            out[k] = 0.0
            continue
        for part in range(parts + 1):  # `primer_at` with what does not change taken out of the loop
            time = times[k] + part * step
            since = time - x.times[0]
            east, north = first[0] + turn[0] * since, first[1] + turn[1] * since
            up = first[2] + turn[2] * since
            if time < x.touch[0]:
                up += x.touch[1] * (x.touch[0] - time)
            scale = max_thrust / max(math.sqrt(east * east + north * north + up * up), 1e-12)
            out[k, part, 0], out[k, part, 1], out[k, part, 2] = scale * east, scale * north, scale * up


@compile_kernel
def advance_extremal(x: Extremal, problem: PrimerProblem, begin: float, end: float, state: Array) -> None:
    """Take position, velocity and mass, shape (7,) in the units of `PrimerProblem`, to a later time."""
    step = end - begin
    for axis in range(3):
        fall = problem.gravity[axis] * step
        state[axis] += (state[3 + axis] + 0.5 * fall) * step
        state[3 + axis] += fall
    for first, last in ((begin, min(x.times[0], end)), (max(x.times[1], begin), end)):
        burn = last - first
        if burn <= 0.0:
            continue
        parts = 1 + int(burn / (_LONGEST_PART * x.times[2]))
        for part in range(parts):
            at = first + burn * part / parts
            add_burn(x, Burn(at, at + burn / parts, state[6]), problem.mass_flow, end, state)
            state[6] -= problem.mass_flow * burn / parts


@compile_kernel
def _states(x: Extremal, problem: PrimerProblem, times: Array) -> Array:
    """Position, velocity and mass at given times, shape (k, 7), in the units of `PrimerProblem`."""
    out, state, time = np.empty((times.size, 7)), np.empty(7), math.inf
    for k in range(times.size):
        if times[k] < time:  # times need not rise
            for axis in range(3):
                state[axis], state[3 + axis] = problem.position[axis], problem.velocity[axis]
            state[6], time = 1.0, 0.0
        advance_extremal(x, problem, time, times[k], state)
        time = times[k]
        for number in range(7):
            out[k, number] = state[number]
    return out


@compile_kernel
def _lay(
    x: Extremal,
    problem: PrimerProblem,
    nodes: int,
    engine: tuple[float, float],
    ends: tuple[Array, Array, Array],
) -> tuple[Array, Array, Array, Array, Array]:
    """Time, position, velocity, mass and thrust at the nodes, in SI.

    Args:
        x: the extremal, in seconds.
        problem: its problem, in seconds.
        nodes: as of `lay_nodes`.
        engine: full thrust [N], and mass at the start [kg].
        ends: position [m] and velocity [m/s] at the start, to the last bit, and the target [m].
    """
    max_thrust, start_mass = engine
    time = _node_times(x, nodes)
    states, thrust = _states(x, problem, time), _thrust(x, max_thrust, time)
    position, velocity, mass = np.empty((time.size, 3)), np.empty((time.size, 3)), np.empty(time.size)
    scale = max_thrust / start_mass
    for k in range(time.size):
        for axis in range(3):
            position[k, axis] = scale * states[k, axis] + ends[2][axis]
            velocity[k, axis] = scale * states[k, 3 + axis]
        mass[k] = start_mass * states[k, 6]
    for axis in range(3):
        position[0, axis], velocity[0, axis] = ends[0][axis], ends[1][axis]
    return time, position, velocity, mass, thrust
