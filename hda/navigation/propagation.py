"""The filter between two control instants: carried by what the inertial unit measured.

With the changes of velocity dV and of position dR that the specific force alone made, as measured,

    r+ = r + v t + g t^2/2 + dR + tilt x dR - b t^2/2,     v+ = v + g t + dV + tilt x dV - b t.

The engine's error is in dV, as the unit feels it; a filter that trusted its thrust command would lack it.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.navigation.layout import (
    ACCELEROMETER_BIAS,
    BIAS_STEP,
    GROUND,
    IMU_POSITION,
    IMU_VELOCITY,
    POSITION,
    TILT,
    VELOCITY,
    FilterMemory,
    FilterNumbers,
    InertialNumbers,
    TrueErrors,
)


@compile_kernel
def cross(left: Array, right: Array) -> Array:
    """Vector product, shape (3,)."""
    out = np.empty(3)
    out[0] = left[1] * right[2] - left[2] * right[1]
    out[1] = left[2] * right[0] - left[0] * right[2]
    out[2] = left[0] * right[1] - left[1] * right[0]
    return out


@compile_kernel
def measure_force(
    nodes: tuple[Array, Array, float],
    gravity: Array,
    errors: TrueErrors,
    draws: Array,
    numbers: InertialNumbers,
) -> tuple[Array, Array]:
    """What the inertial unit makes of a flown interval; its true bias moves on by one step.

    Args:
        nodes: true states (x y z vx vy vz m) before and after, and the time between [s].
        gravity: [m/s^2] shape (3,).
        errors: the unit's true errors; the bias is changed in place.
        draws: shape (16,), standard normal.
        numbers: the unit.

    Returns:
        Changes of velocity [m/s] and of position [m] by the specific force, shape (3,) each. White noise of
        density q gives them variances q t and q t^3/3, and the covariance q t^2/2.
    """
    before, after, time = nodes
    gained = after[3:6] - before[3:6] - gravity * time
    moved = after[:3] - before[:3] - before[3:6] * time - 0.5 * gravity * time * time
    gained -= cross(errors.tilt, gained)
    moved -= cross(errors.tilt, moved)
    deviation = math.sqrt(numbers.noise_density * time)
    for axis in range(3):
        first, second = draws[IMU_VELOCITY + axis], draws[IMU_POSITION + axis]
        bias = errors.accelerometer_bias[axis]
        gained[axis] += bias * time + deviation * first
        moved[axis] += 0.5 * bias * time * time
        moved[axis] += deviation * time * (0.5 * first + second / math.sqrt(12.0))
    kept = math.exp(-time / numbers.correlation_time)
    stirred = numbers.bias * math.sqrt(max(1.0 - kept * kept, 0.0))
    for axis in range(3):
        errors.accelerometer_bias[axis] *= kept
        errors.accelerometer_bias[axis] += stirred * draws[BIAS_STEP + axis]
    return gained, moved


@compile_kernel
def _carry_rows(table: Array, gained: Array, moved: Array, time: float, kept: float) -> None:
    """Replace the rows of `table` by F times it; whole rows take each step."""
    for axis in range(3):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        tilted, turned = table[TILT + second], table[TILT + third]
        position, velocity = table[POSITION + axis], table[VELOCITY + axis]
        bias = table[ACCELEROMETER_BIAS + axis]
        for j in range(table.shape[1]):
            by_move = tilted[j] * moved[third] - turned[j] * moved[second]
            by_gain = tilted[j] * gained[third] - turned[j] * gained[second]
            position[j] += velocity[j] * time - 0.5 * bias[j] * time * time + by_move
            velocity[j] += by_gain - bias[j] * time
            bias[j] = kept * bias[j]


@compile_kernel
def carry(
    memory: FilterMemory,
    measured: tuple[Array, Array],
    time: float,
    gravity: Array,
    numbers: FilterNumbers,
) -> None:
    """Carry estimate and covariance over `time` [s] by the measured changes of velocity and position.

    The ground under the beam is a random walk: a horizontal path d within this period adds to its variance
    2 s^2 (1 - exp(-d/L)), the variogram of relief of deviation s and correlation length L. Each period adds
    its own, so the variance goes on growing with the path, past the 2 s^2 at which the variogram levels off.
    """
    gained, moved = measured
    mean, covariance, _ = memory
    inertial = numbers.inertial
    kept = math.exp(-time / inertial.correlation_time)
    start_x, start_y = mean[POSITION], mean[POSITION + 1]
    for axis in range(3):
        bias = mean[ACCELEROMETER_BIAS + axis]
        mean[POSITION + axis] += (
            mean[VELOCITY + axis] * time + 0.5 * (gravity[axis] - bias) * time * time + moved[axis]
        )
        mean[VELOCITY + axis] += (gravity[axis] - bias) * time + gained[axis]
        mean[ACCELEROMETER_BIAS + axis] = kept * bias
    _carry_rows(covariance, gained, moved, time, kept)
    _carry_rows(covariance.T, gained, moved, time, kept)
    density = inertial.noise_density
    for axis in range(3):
        r, v, b = POSITION + axis, VELOCITY + axis, ACCELEROMETER_BIAS + axis
        covariance[r, r] += density * time**3 / 3.0
        covariance[v, v] += density * time
        covariance[r, v] += 0.5 * density * time * time
        covariance[v, r] += 0.5 * density * time * time
        covariance[b, b] += inertial.bias**2 * (1.0 - kept * kept)
    flown = math.hypot(mean[POSITION] - start_x, mean[POSITION + 1] - start_y)
    covariance[GROUND, GROUND] += -2.0 * numbers.relief**2 * math.expm1(-flown / numbers.relief_length)
    for i in range(covariance.shape[0]):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
