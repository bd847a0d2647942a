"""The landing site in the filter: found in a look, tracked from look to look, changed for another.

A look measures the place of the site relative to the vehicle, m = s - r. The first one puts the site into
the filter with all the error of the vehicle's own position, and their covariance keeps that the two errors
are one: what the landing needs, s - r, is known as well as the look, however badly the map is.
"""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.navigation.layout import POSITION, SITE, SITE_FIX, TILT, FilterMemory, cross_matrix
from hda.navigation.propagation import cross
from hda.navigation.schmidt_update import take_in


@compile_kernel
def measure_site(offset: Array, tilt: Array, deviation: float, draws: Array) -> Array:
    """[m] shape (3,), the site's true place from the vehicle as a look measures it, m - tilt x m + noise."""
    return offset - cross(tilt, offset) + deviation * draws


@compile_kernel
def fix_site(memory: FilterMemory, reading: Array, deviation: float, gate: float, patience: int) -> float:
    """Take in where a look sees the site: the squared innovation.

    Args:
        memory: of the filter; changed in place.
        reading: [m] shape (3,), from `measure_site`.
        deviation: [m] one sigma of the reading along each axis.
        gate: greatest squared innovation that is taken in.
        patience: rejections in a row before the site is doubted.
    """
    design, innovation, noise = np.zeros((3, memory.covariance.shape[0])), np.empty(3), np.empty(3)
    predicted = memory.mean[SITE : SITE + 3] - memory.mean[POSITION : POSITION + 3]
    turned = cross_matrix(predicted)
    for axis in range(3):
        design[axis, SITE + axis] = 1.0
        design[axis, POSITION + axis] = -1.0
        design[axis, TILT : TILT + 3] = turned[axis]
        innovation[axis] = reading[axis] - predicted[axis]
        noise[axis] = deviation * deviation
    return take_in(memory, design, innovation, noise, (gate, patience, SITE_FIX, SITE, SITE + 3))


@compile_kernel
def acquire_site(memory: FilterMemory, reading: Array, deviation: float) -> None:
    """Put a site into the filter where a look sees it, `reading` [m] shape (3,) from the vehicle.

    Its error is that of the vehicle's position, of the attitude, and the look's own, `deviation` [m].
    """
    mean, covariance, rejections = memory
    turned = cross_matrix(reading)
    size = covariance.shape[0]
    rows = np.empty((3, size))
    for i in range(3):
        for j in range(size):
            rows[i, j] = covariance[POSITION + i, j]
            for k in range(3):
                rows[i, j] -= turned[i, k] * covariance[TILT + k, j]
    block = rows[:, POSITION : POSITION + 3].copy()
    for i in range(3):
        for j in range(3):
            for k in range(3):
                block[i, j] -= rows[i, TILT + k] * turned[j, k]
    for i in range(3):
        mean[SITE + i] = mean[POSITION + i] + reading[i]
        for j in range(size):
            covariance[SITE + i, j] = rows[i, j]
            covariance[j, SITE + i] = rows[i, j]
    for i in range(3):
        for j in range(3):
            covariance[SITE + i, SITE + j] = 0.5 * (block[i, j] + block[j, i])
        covariance[SITE + i, SITE + i] += deviation * deviation
    rejections[SITE_FIX] = 0
