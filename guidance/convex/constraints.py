"""Constraint families of the convex problem: one function each, returning rows and cones.

Every family states b - A x in a cone, in the units of `guidance.convex.scaling`. Source of the formulation:
Acikmese and Ploen, JGCD 30(5), 2007 (lossless convexification, log-mass); Blackmore, Acikmese and Scharf,
JGCD 33(4), 2010 (landing error); thrust acceleration is a first-order hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.convex.layout import Layout
from guidance.convex.scaling import RateBounds, ScaledProblem


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows b - A x in a product of equal cones.

    Attributes:
        name: the constraint in words.
        cone: 'zero' (equality), 'nonnegative' or 'second_order'.
        cone_size: rows per cone; any number for the first two kinds.
        row: row of each stored entry of A, counted within the family.
        column: its column.
        value: its value.
        bound: b.
        value_power: p for each entry, where the entry goes with the time of flight as T^p; scalar or like
            value.
        bound_rate: T db/dT of each bound; scalar or like `bound`.
    """

    name: str
    cone: str
    cone_size: int
    row: Index
    column: Index
    value: Array
    bound: Array
    value_power: Array = field(default_factory=lambda: np.zeros(1))
    bound_rate: Array = field(default_factory=lambda: np.zeros(1))

    def slack_of(self, decision: Array) -> Array:
        """Slack b - A x, shape (cones, cone_size) (one cone for 'zero' and 'nonnegative')."""
        out = self.bound.copy()
        np.subtract.at(out, self.row, self.value * decision[self.column])
        return out.reshape(-1, self.cone_size)

    def violation(self, decision: Array) -> float:
        """How far b - A x lies outside the cones; inside an inequality: minus the margin."""
        rest = self.slack_of(decision)
        if self.cone == "zero":
            return float(np.abs(rest).max())
        if self.cone == "nonnegative":
            return float(-rest.min())
        return float((np.linalg.norm(rest[:, 1:], axis=1) - rest[:, 0]).max())


def _stack(*blocks: tuple[Index, Index, float | Array]) -> dict[str, NDArray]:
    """Concatenate (row, column, value) blocks of any one shape each."""
    return {
        "row": np.concatenate([row.ravel() for row, _, _ in blocks]),
        "column": np.concatenate([column.ravel() for _, column, _ in blocks]),
        "value": np.concatenate([np.broadcast_to(value, row.shape).ravel() for row, _, value in blocks]),
    }


def start(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Position, velocity and log-mass at the first node."""
    column = np.arange(7)
    bound = np.concatenate([scaled.position, scaled.velocity, [0.0]])
    rate = np.concatenate([-2.0 * scaled.position, -scaled.velocity, [0.0]])
    return Rows("start", "zero", 7, np.arange(7), column, np.ones(7), bound, bound_rate=rate)


@lru_cache(maxsize=64)
def _motion_entries(layout: Layout) -> dict[str, NDArray]:
    """Rows of A of `motion`: the same at every solve, by the choice of units."""
    intervals = layout.nodes - 1
    h = 1.0 / intervals
    row = np.arange(intervals * 7).reshape(intervals, 7)
    to_position, to_velocity, to_mass = row[:, :3], row[:, 3:6], row[:, 6]
    position, velocity, acceleration = layout.position, layout.velocity, layout.acceleration
    mass, slack = layout.log_mass, layout.slack
    return _stack(
        (to_position, position[1:], 1.0),
        (to_position, position[:-1], -1.0),
        (to_position, velocity[:-1], -h),
        (to_position, acceleration[:-1], -h * h / 3.0),
        (to_position, acceleration[1:], -h * h / 6.0),
        (to_velocity, velocity[1:], 1.0),
        (to_velocity, velocity[:-1], -1.0),
        (to_velocity, acceleration[:-1], -h / 2.0),
        (to_velocity, acceleration[1:], -h / 2.0),
        (to_mass, mass[1:], 1.0),
        (to_mass, mass[:-1], -1.0),
        (to_mass, slack[:-1], h / 2.0),
        (to_mass, slack[1:], h / 2.0),
    )


def motion(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Exact motion between nodes under a thrust acceleration linear in time, and the burnt log-mass."""
    intervals = layout.nodes - 1
    h = 1.0 / intervals
    fall = np.concatenate([scaled.gravity * (h * h / 2.0), scaled.gravity * h, [0.0]])
    return Rows("motion", "zero", 7, bound=np.tile(fall, intervals), **_motion_entries(layout))


def landing(layout: Layout, scaled: ScaledProblem) -> Rows:
    """The last node: on the target, or in its plane where the landing point is free, at its velocity."""
    position = layout.position[-1]
    column = np.concatenate([position[2:] if layout.free_landing_point else position, layout.velocity[-1]])
    size = column.size
    bound = np.zeros(size)
    bound[-3:] = scaled.target_velocity
    return Rows("landing", "zero", size, np.arange(size), column, np.ones(size), bound, bound_rate=-bound)


def thrust_cone(layout: Layout, scaled: ScaledProblem) -> Rows:
    """|thrust acceleration| <= slack: the relaxation, tight at an optimum (lossless)."""
    row = np.arange(layout.nodes * 4).reshape(-1, 4)
    entries = _stack((row[:, 0], layout.slack, -1.0), (row[:, 1:], layout.acceleration, -1.0))
    return Rows("thrust", "second_order", 4, bound=np.zeros(row.size), **entries)


def max_thrust(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Slack <= max_thrust / mass, in the affine form of `scaled.mass_bounds`."""
    n = layout.nodes
    bounds = scaled.mass_bounds
    row = np.arange(n)
    entries = _stack((row, layout.slack, 1.0), (row, layout.log_mass, bounds.upper_slope))
    power = np.repeat([0.0, 1.0], n)
    return Rows("maximum thrust", "nonnegative", n, bound=bounds.upper_bound, value_power=power, **entries)


def min_thrust(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Slack >= min_thrust / mass, in the affine form of `scaled.mass_bounds`."""
    n = layout.nodes
    bounds = scaled.mass_bounds
    row = np.arange(n)
    entries = _stack((row, layout.slack, -1.0), (row, layout.log_mass, -bounds.lower_slope))
    power = np.repeat([0.0, 1.0], n)
    return Rows("minimum thrust", "nonnegative", n, bound=-bounds.lower_bound, value_power=power, **entries)


def altitude_floor(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Nodes between the first and the last are not below the target's altitude."""
    n = layout.nodes - 2
    row = np.arange(n)
    return Rows("altitude", "nonnegative", n, row, layout.position[1:-1, 2], -np.ones(n), np.zeros(n))


def pointing(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Upward thrust acceleration >= cos(limit) * slack: convex also for limits beyond a right angle."""
    n = layout.nodes
    row = np.arange(n)
    entries = _stack((row, layout.acceleration[:, 2], -1.0), (row, layout.slack, scaled.pointing_cosine))
    return Rows("pointing", "nonnegative", n, bound=np.zeros(n), **entries)


def final_thrust_direction(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Thrust acceleration along the axis >= cos(limit) * slack at the last node; convex as `pointing` is."""
    column = np.append(layout.acceleration[-1], layout.slack[-1])
    value = scaled.final_thrust * np.array([-1.0, -1.0, -1.0, 1.0])
    row = np.zeros(4, dtype=np.int64)
    return Rows("final thrust direction", "nonnegative", 1, row, column, value, np.zeros(1))


def thrust_rate(layout: Layout, scaled: ScaledProblem) -> Rows:
    """The thrust changes from node to node by no more than a step, in the form of `scaled.thrust_rate`."""
    intervals = layout.nodes - 1
    free = RateBounds(np.ones(layout.nodes), np.ones(intervals), np.zeros(intervals))
    bounds = scaled.thrust_rate or free
    row, push = np.arange(intervals * 4).reshape(-1, 4), layout.acceleration
    entries = _stack(
        (row[:, 1:], push[1:], np.repeat(-bounds.weight[1:], 3).reshape(-1, 3)),
        (row[:, 1:], push[:-1], np.repeat(bounds.weight[:-1], 3).reshape(-1, 3)),
        (row[:, 0], layout.slack[1:], -bounds.eased),
    )
    bound = np.zeros(row.shape)
    bound[:, 0] = bounds.step
    step, power = bound.ravel(), np.repeat([0.0, 1.0], [6 * intervals, intervals])
    return Rows("thrust rate", "second_order", 4, bound=step, value_power=power, bound_rate=step, **entries)


def glide_slope(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Every node but the last lies in the upright cone above the landing point."""
    position = layout.position[:-1]
    sine, cosine = np.sin(scaled.glide_angle), np.cos(scaled.glide_angle)
    row = np.arange(position.size).reshape(-1, 3)
    landing_point = np.broadcast_to(layout.position[-1, :2], position[:, :2].shape)
    entries = _stack(
        (row[:, 0], position[:, 2], -sine),
        (row[:, 1:], position[:, :2], -cosine),
        (row[:, 1:], landing_point, cosine),
    )
    return Rows("glide slope", "second_order", 3, bound=np.zeros(row.size), **entries)


def line_of_sight(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Every node but the last lies in the cone about its axis from the target; a free landing point too."""
    position = layout.position if layout.free_landing_point else layout.position[:-1]
    row = np.arange(position.size).reshape(-1, 3)
    rows, columns = np.broadcast_arrays(row[:, :, None], position[:, None, :])
    entries = _stack((rows, columns, -scaled.sight))
    bound = np.tile(-scaled.sight @ scaled.sight_apex, position.shape[0])
    return Rows("line of sight", "second_order", 3, bound=bound, bound_rate=-2.0 * bound, **entries)


def speed_limit(layout: Layout, scaled: ScaledProblem) -> Rows:
    """|velocity| <= limit at every node but the last."""
    velocity = layout.velocity[:-1]
    row = np.arange(velocity.shape[0] * 4).reshape(-1, 4)
    bound = np.zeros(row.shape)
    bound[:, 0] = scaled.speed_limit
    return Rows(
        "speed",
        "second_order",
        4,
        row[:, 1:].ravel(),
        velocity.ravel(),
        -np.ones(velocity.size),
        bound.ravel(),
        bound_rate=-bound.ravel(),
    )


def dry_mass(layout: Layout, scaled: ScaledProblem) -> Rows:
    """The tank is not overdrawn: -zeta at the last node <= propellant."""
    return Rows(
        "propellant",
        "nonnegative",
        1,
        np.zeros(1, dtype=np.int64),
        layout.log_mass[-1:],
        -np.ones(1),
        np.array([scaled.propellant]),
        bound_rate=np.array([-scaled.propellant]),
    )


def landing_error(layout: Layout, scaled: ScaledProblem) -> Rows:
    """|landing point - target| <= landing error, in the target's plane."""
    column = np.concatenate([[layout.landing_error], layout.position[-1, :2]])
    return Rows("landing error", "second_order", 3, np.arange(3), column, -np.ones(3), np.zeros(3))


def landing_error_limit(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Landing error <= its limit."""
    return Rows(
        "landing error limit",
        "nonnegative",
        1,
        np.zeros(1, dtype=np.int64),
        np.array([layout.landing_error]),
        np.ones(1),
        np.array([scaled.error_limit]),
        bound_rate=np.array([-2.0 * scaled.error_limit]),
    )
