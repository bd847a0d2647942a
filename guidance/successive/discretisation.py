"""Motion over one interval and its derivatives, in scaled units: controls linear in time, multiple shooting.

The variational equations go along with the motion by the classic Runge-Kutta method, for the derivatives by
the state at the start, both controls and the duration of the interval (as in Szmuk and Acikmese, AIAA
2018-0617, with the duration of one interval in place of a common dilation).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.successive.units import ScaledBody

SUBSTEPS = 6
"""Runge-Kutta steps in an interval."""
STATE, CONTROL = 14, 6
_WIDTH = STATE + 2 * CONTROL + 1
_LEAST_THRUST = 1e-9  # below which the direction of the thrust counts as the body's z axis


class Discretisation(NamedTuple):
    """Ends of K intervals and their derivatives.

    Attributes:
        ends: shape (K, 14).
        by_state: shape (K, 14, 14).
        by_first: shape (K, 14, 6), by the control at the start.
        by_last: shape (K, 14, 6), by the control at the end.
        by_duration: shape (K, 14).
    """

    ends: Array
    by_state: Array
    by_first: Array
    by_last: Array
    by_duration: Array


@compile_kernel
def scaled_rate_into(x: Array, u: Array, body: ScaledBody, out: Array) -> None:
    """Write the rate of change of a state under a control into `out`."""
    w, i, j, k, mass = x[6], x[7], x[8], x[9], x[13]
    f, g, h = u[0], u[1], u[2]
    along, size = 2.0 * (i * f + j * g + k * h), w * w - i * i - j * j - k * k
    out[0], out[1], out[2] = x[3], x[4], x[5]
    out[3] = (size * f + along * i + 2.0 * w * (j * h - k * g)) / mass + body.gravity[0]
    out[4] = (size * g + along * j + 2.0 * w * (k * f - i * h)) / mass + body.gravity[1]
    out[5] = (size * h + along * k + 2.0 * w * (i * g - j * f)) / mass + body.gravity[2]
    a, b, c = x[10], x[11], x[12]
    out[6] = 0.5 * (-i * a - j * b - k * c)
    out[7] = 0.5 * (w * a + j * c - k * b)
    out[8] = 0.5 * (w * b + k * a - i * c)
    out[9] = 0.5 * (w * c + i * b - j * a)
    scale = (mass / body.mass) ** body.exponent
    out[10] = (body.turn[0] * u[3] + body.arm[0] * g) / scale + body.couple[0] * b * c
    out[11] = (body.turn[1] * u[4] - body.arm[1] * f) / scale + body.couple[1] * c * a
    out[12] = body.turn[2] * u[5] / scale + body.couple[2] * a * b
    out[13] = -body.flow * math.sqrt(f * f + g * g + h * h)


@compile_kernel
def jacobian_into(x: Array, u: Array, body: ScaledBody, by_state: Array, by_control: Array) -> None:
    """Write the derivatives of the rate by the state and the control; entries that are always zero stay."""
    w, i, j, k, mass = x[6], x[7], x[8], x[9], x[13]
    f, g, h = u[0], u[1], u[2]
    along, size = i * f + j * g + k * h, w * w - i * i - j * j - k * k
    across = np.empty(3)
    across[0], across[1], across[2] = j * h - k * g, k * f - i * h, i * g - j * f
    vector, force = x[7:10], u[:3]
    for row in range(3):
        by_state[row, 3 + row] = 1.0
        pull = size * force[row] + 2.0 * (along * vector[row] + w * across[row])
        by_state[3 + row, 13] = -pull / (mass * mass)
        by_state[3 + row, 6] = 2.0 * (w * force[row] + across[row]) / mass
        for column in range(3):
            turned = vector[row] * force[column] - force[row] * vector[column]
            by_state[3 + row, 7 + column] = 2.0 * turned / mass
            by_control[3 + row, column] = 2.0 * vector[row] * vector[column] / mass
        by_state[3 + row, 7 + row] += 2.0 * along / mass
        by_control[3 + row, row] += size / mass
        # d(v x F)/dv = -[F]x and d(v x F)/dF = [v]x
        after, before = (row + 1) % 3, (row + 2) % 3
        by_state[3 + row, 7 + after] += 2.0 * w * force[before] / mass
        by_state[3 + row, 7 + before] -= 2.0 * w * force[after] / mass
        by_control[3 + row, before] += 2.0 * w * vector[after] / mass
        by_control[3 + row, after] -= 2.0 * w * vector[before] / mass
        # q' = q (0, rates) / 2
        by_state[6, 7 + row] = -0.5 * x[10 + row]
        by_state[6, 10 + row] = -0.5 * vector[row]
        by_state[7 + row, 6] = 0.5 * x[10 + row]
        by_state[7 + row, 10 + row] = 0.5 * w
        by_state[7 + row, 7 + after] = 0.5 * x[10 + before]
        by_state[7 + row, 7 + before] = -0.5 * x[10 + after]
        by_state[7 + row, 10 + before] = 0.5 * vector[after]
        by_state[7 + row, 10 + after] = -0.5 * vector[before]
        by_state[10 + row, 10 + after] = body.couple[row] * x[10 + before]
        by_state[10 + row, 10 + before] = body.couple[row] * x[10 + after]
    scale = (mass / body.mass) ** body.exponent
    moments = np.empty(3)
    moments[0] = body.turn[0] * u[3] + body.arm[0] * g
    moments[1] = body.turn[1] * u[4] - body.arm[1] * f
    moments[2] = body.turn[2] * u[5]
    for row in range(3):
        by_state[10 + row, 13] = -body.exponent * moments[row] / (scale * mass)
        by_control[10 + row, 3 + row] = body.turn[row] / scale
    by_control[10, 1] = body.arm[0] / scale
    by_control[11, 0] = -body.arm[1] / scale
    length = math.sqrt(f * f + g * g + h * h)
    for column in range(3):
        unit = force[column] / length if length > _LEAST_THRUST else (1.0 if column == 2 else 0.0)
        by_control[13, column] = -body.flow * unit


class _Stage(NamedTuple):
    """A place within an interval: state, variations, control, and the share that has passed."""

    state: Array
    variations: Array
    control: Array
    share: float


@compile_kernel
def _slope_into(
    at: _Stage,
    duration: float,
    body: ScaledBody,
    jacobian: tuple[Array, Array],
    slope: Array,
    change: Array,
) -> None:
    """Write d/ds of state and variations, s the share of the interval that has passed.

    Args:
        at: the place.
        duration: of the interval.
        body: the motion.
        jacobian: memory for the derivatives of the rate by state and control.
        slope: that of the state.
        change: that of the variations.
    """
    by_state, by_control = jacobian
    variations, share = at.variations, at.share
    scaled_rate_into(at.state, at.control, body, slope)
    jacobian_into(at.state, at.control, body, by_state, by_control)
    for row in range(STATE):
        for column in range(_WIDTH):
            change[row, column] = 0.0
        for inner in range(STATE):
            weight = duration * by_state[row, inner]
            if weight != 0.0:
                for column in range(_WIDTH):
                    change[row, column] += weight * variations[inner, column]
        for column in range(CONTROL):
            weight = duration * by_control[row, column]
            change[row, STATE + column] += (1.0 - share) * weight
            change[row, STATE + CONTROL + column] += share * weight
        change[row, _WIDTH - 1] += slope[row]
        slope[row] *= duration


@compile_kernel
def discretise(states: Array, controls: Array, durations: Array, body: ScaledBody) -> Discretisation:
    """Fly each interval from its node, with derivatives.

    Args:
        states: shape (K + 1, 14).
        controls: shape (K + 1, 6).
        durations: shape (K,).
        body: the motion.
    """
    count = durations.size
    ends = np.empty((count, STATE))
    table = np.empty((count, STATE, _WIDTH))
    jacobian = (np.zeros((STATE, STATE)), np.zeros((STATE, CONTROL)))
    slopes, changes = np.empty((4, STATE)), np.empty((4, STATE, _WIDTH))
    step = 1.0 / SUBSTEPS
    for k in range(count):
        x, variations = states[k].copy(), np.zeros((STATE, _WIDTH))
        for row in range(STATE):
            variations[row, row] = 1.0
        first, last, h = controls[k], controls[k + 1], durations[k]
        for part in range(SUBSTEPS):
            for stage in range(4):
                ahead = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                share = (part + ahead) * step
                u = (1.0 - share) * first + share * last
                there, moved = x, variations
                if stage > 0:
                    there = x + ahead * step * slopes[stage - 1]
                    moved = variations + ahead * step * changes[stage - 1]
                at = _Stage(there, moved, u, share)
                _slope_into(at, h, body, jacobian, slopes[stage], changes[stage])
            x = x + step / 6.0 * (slopes[0] + 2.0 * (slopes[1] + slopes[2]) + slopes[3])
            total = changes[0] + 2.0 * (changes[1] + changes[2]) + changes[3]
            variations = variations + step / 6.0 * total
        ends[k] = x
        table[k] = variations
    return Discretisation(
        ends,
        table[:, :, :STATE].copy(),
        table[:, :, STATE : STATE + CONTROL].copy(),
        table[:, :, STATE + CONTROL : STATE + 2 * CONTROL].copy(),
        table[:, :, _WIDTH - 1].copy(),
    )


@compile_kernel
def shoot(states: Array, controls: Array, durations: Array, body: ScaledBody) -> Array:
    """The ends of K intervals alone, shape (K, 14): the same steps as in `discretise`."""
    ends = np.empty((durations.size, STATE))
    slopes = np.empty((4, STATE))
    step = 1.0 / SUBSTEPS
    for k in range(durations.size):
        x = states[k].copy()
        for part in range(SUBSTEPS):
            for stage in range(4):
                ahead = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                share = (part + ahead) * step
                u = (1.0 - share) * controls[k] + share * controls[k + 1]
                there = x if stage == 0 else x + ahead * step * slopes[stage - 1]
                scaled_rate_into(there, u, body, slopes[stage])
                slopes[stage] *= durations[k]
            x = x + step / 6.0 * (slopes[0] + 2.0 * (slopes[1] + slopes[2]) + slopes[3])
        ends[k] = x
    return ends
