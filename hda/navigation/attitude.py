"""The attitude of a turning body in the filter: carried by a gyroscope, corrected by whatever sees it.

The error angle is multiplicative (MEKF; Lefferts, Markley and Shuster, JGCD 5(5), 1982): the true attitude is
the believed one, turned by a small angle about the site's axes. About those axes it does not turn with the
body, and while the gyroscope reads rates too great by e (body frame)

    tilt' = -R e,    e = bias - its estimate + white noise,

to first order in the tilt, whose square is 1e-6 rad. So the believed attitude need not be integrated beside
the true one: the tilt alone is. A reading's correction goes from the mean into the attitude at once.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.quaternion import rotate_into
from hda.navigation.layout import (
    GYRO_BIAS,
    GYRO_STEP,
    RATE_NOISE,
    TILT,
    FilterMemory,
    GyroNumbers,
    TrueErrors,
    Turn,
)


@compile_kernel
def believe_into(attitude: Array, tilt: Array, out: Array) -> None:
    """Write the attitude that the lander believes to have into `out`.

    Args:
        attitude: the true unit quaternion, shape (4,).
        tilt: [rad] shape (3,): the true attitude is the believed one, turned by it about the site's axes.
        out: unit quaternion, shape (4,), not `attitude`.
    """
    x, y, z = -0.5 * tilt[0], -0.5 * tilt[1], -0.5 * tilt[2]
    w, a, b, c = attitude[0], attitude[1], attitude[2], attitude[3]
    out[0] = w - x * a - y * b - z * c
    out[1] = a + x * w + y * c - z * b
    out[2] = b + y * w + z * a - x * c
    out[3] = c + z * w + x * b - y * a
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for number in range(4):
        out[number] /= length


@compile_kernel
def err_rates_into(
    memory: FilterMemory, errors: TrueErrors, draws: Array, period: float, numbers: GyroNumbers, out: Array
) -> None:
    """Write by how much the lander misjudges its rates over one control period, [rad/s] shape (3,).

    The noise is held over the period, with the variance that white noise leaves in the angle at its end. A
    flight that ends within the period has the same rates; its angle then errs by less than the filter reckons
    with, by the factor of the time over the period in the variance.

    Args:
        memory: of the filter.
        errors: the gyroscope's true bias.
        draws: shape (6,), standard normal.
        period: [s] of a whole control period, also where the flight ends within it.
        numbers: the gyroscope.
        out: written; believed minus true rates, body frame.
    """
    deviation = math.sqrt(numbers.noise_density / period)
    for axis in range(3):
        known = memory.mean[GYRO_BIAS + axis]
        out[axis] = errors.gyro_bias[axis] - known + deviation * draws[RATE_NOISE + axis]


@compile_kernel
def drift(tilt: Array, before: Array, after: Array, rate_error: Array, time: float) -> None:
    """Let the attitude's error grow, in place, over a turn from one attitude to another.

    Args:
        tilt: [rad] shape (3,), true minus believed attitude about the site's axes; changed.
        before: true unit quaternion, shape (4,), at the start.
        after: at the end; in between the mean of both turns the rates into the site frame.
        rate_error: [rad/s] shape (3,), believed minus true rates, body frame.
        time: [s].
    """
    first, last = np.empty(3), np.empty(3)
    rotate_into(before, rate_error, first)
    rotate_into(after, rate_error, last)
    for axis in range(3):
        tilt[axis] -= 0.5 * time * (first[axis] + last[axis])


@compile_kernel
def _carry_rows(table: Array, matrix: Array, time: float, kept: float) -> None:
    """Replace the rows of `table` by F times it; `matrix`, shape (3, 3), turns body vectors into the site."""
    for j in range(table.shape[1]):
        for axis in range(3):
            turned = 0.0
            for k in range(3):
                turned += matrix[axis, k] * table[GYRO_BIAS + k, j]
            table[TILT + axis, j] -= time * turned
        for k in range(3):
            table[GYRO_BIAS + k, j] *= kept


@compile_kernel
def carry_attitude(memory: FilterMemory, errors: TrueErrors, turn: Turn | None, time: float) -> None:
    """Carry what the filter knows of tilt and bias over `time` [s]; the true bias moves on by one step.

    Args:
        memory: of the filter; changed in place.
        errors: the gyroscope's bias is changed in place.
        turn: what the body did; None: there is no gyroscope, and numba compiles nothing.
        time: [s].
    """
    if turn is None:
        return
    mean, covariance, _ = memory
    numbers, unit, column = turn.numbers, np.zeros(3), np.empty(3)
    matrix, believed = np.zeros((3, 3)), np.empty(4)
    for attitude in (turn.before, turn.after):
        believe_into(attitude, errors.tilt, believed)
        for k in range(3):
            unit[k] = 1.0
            rotate_into(believed, unit, column)
            unit[k] = 0.0
            for axis in range(3):
                matrix[axis, k] += 0.5 * column[axis]
    kept = math.exp(-time / numbers.correlation_time)
    _carry_rows(covariance, matrix, time, kept)
    _carry_rows(covariance.T, matrix, time, kept)
    stirred = numbers.bias * math.sqrt(max(1.0 - kept * kept, 0.0))
    for axis in range(3):
        mean[GYRO_BIAS + axis] *= kept
        covariance[TILT + axis, TILT + axis] += numbers.noise_density * time
        covariance[GYRO_BIAS + axis, GYRO_BIAS + axis] += stirred * stirred
        errors.gyro_bias[axis] = kept * errors.gyro_bias[axis] + stirred * turn.draws[GYRO_STEP + axis]


@compile_kernel
def correct_attitude(memory: FilterMemory, tilt: Array) -> None:
    """Turn the believed attitude by what readings told of its error, and forget that: both change in place.

    Without a gyroscope the filter learns nothing of its attitude.
    """
    mean = memory.mean
    if mean.size > TILT:
        for axis in range(3):
            tilt[axis] -= mean[TILT + axis]
            mean[TILT + axis] = 0.0
