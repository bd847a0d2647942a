"""The convex problem without its states: position and velocity at the nodes are sums over the thrust.

Landing is then six rows, the moments of the thrust acceleration, and the problem half as large. Limits on the
path have no place here: the caller looks at the path and, where it goes below the target's altitude, solves
the whole problem. A problem that is infeasible here is infeasible with the altitude floor.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from guidance.arrays import Array, Index
from guidance.convex.constraints import Rows
from guidance.convex.layout import CONTROL_SIZE, STATE_SIZE, CondensedLayout, Layout
from guidance.convex.scaling import ScaledProblem

_BELOW = 1e-8  # scaled altitude below the target's that counts as rounding


@lru_cache(maxsize=64)
def _mass_entries(layout: CondensedLayout) -> tuple[Index, Index, Array]:
    n, half = layout.nodes, 0.5 / (layout.nodes - 1)
    row = np.arange(1, n)
    mass, slack = layout.log_mass, layout.slack
    column = np.concatenate([mass[:1], mass[1:], mass[:-1], slack[1:], slack[:-1]])
    value = np.concatenate([[1.0], np.repeat([1.0, -1.0, half, half], n - 1)])
    return np.concatenate([[0], np.tile(row, 4)]), column, value


def burnt_mass(layout: CondensedLayout, scaled: ScaledProblem) -> Rows:
    """Log-mass at the first node, and its fall from node to node."""
    row, column, value = _mass_entries(layout)
    return Rows("motion", "zero", layout.nodes, row, column, value, np.zeros(layout.nodes))


@lru_cache(maxsize=64)
def _moment_entries(layout: CondensedLayout) -> tuple[Index, Index, Array]:
    """What each node's thrust acceleration adds to position and velocity at the end."""
    n, h = layout.nodes, 1.0 / (layout.nodes - 1)
    remaining = 1.0 - h * np.arange(1, n)  # after each interval
    to_position, to_velocity = np.zeros(n), np.zeros(n)
    to_position[:-1] += h * h / 3.0 + 0.5 * h * remaining
    to_position[1:] += h * h / 6.0 + 0.5 * h * remaining
    to_velocity[:-1] += 0.5 * h
    to_velocity[1:] += 0.5 * h
    column = np.concatenate([layout.acceleration.T.ravel()] * 2)
    value = np.concatenate([np.tile(to_position, 3), np.tile(to_velocity, 3)])
    return np.repeat(np.arange(6), n), column, value


def landing_moments(layout: CondensedLayout, scaled: ScaledProblem) -> Rows:
    """The end: on the target, at its velocity."""
    row, column, value = _moment_entries(layout)
    r, v, g = scaled.position, scaled.velocity, scaled.gravity
    change = v - scaled.target_velocity
    bound = np.concatenate([-r - v - 0.5 * g, -change - g])
    rate = np.concatenate([2.0 * r + v, change])
    return Rows("landing", "zero", 6, row, column, value, bound, bound_rate=rate)


def expand(layout: CondensedLayout, scaled: ScaledProblem, primal: Array) -> Array:
    """Decision vector of the whole problem (`Layout`): the states by recursion."""
    n, h = layout.nodes, 1.0 / (layout.nodes - 1)
    out = np.empty((n, STATE_SIZE + CONTROL_SIZE))
    r, v, controls = out[:, :3], out[:, 3:STATE_SIZE], out[:, STATE_SIZE:]
    controls[:] = primal.reshape(n, CONTROL_SIZE)
    u, g = controls[:, 1:4], scaled.gravity
    r[0], v[0] = scaled.position, scaled.velocity
    v[1:] = (0.5 * h) * (u[:-1] + u[1:]) + h * g
    np.cumsum(v, axis=0, out=v)
    r[1:] = h * v[:-1] + (h * h) * (u[:-1] / 3.0 + u[1:] / 6.0 + 0.5 * g)
    np.cumsum(r, axis=0, out=r)
    return out.ravel()


def keeps_altitude(layout: Layout, primal: Array) -> bool:
    """Whether no node of a whole decision vector lies below the target's altitude."""
    return bool(primal[layout.position[1:-1, 2]].min() >= -_BELOW)
