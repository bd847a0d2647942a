"""Brute-force Bayes over the levels of a cell: one reading at a time, with scipy's normal distribution.

Nothing here is shared with `hda.policies.beliefs.belief` but the levels and their shares, its assumption.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm


class Look(NamedTuple):
    lander: NDArray[np.float64]
    target: NDArray[np.float64]
    width: float
    safety_map: NDArray[np.float32]


class Sensor(NamedTuple):
    noise: float
    noise_range: float
    off_nadir_limit: float


def readings_of_cell(
    cell: tuple[int, int], looks: Sequence[Look], sensor: Sensor
) -> list[tuple[float, float]]:
    """(value, deviation) of every seen pixel whose centre lies in the cell (row, column)."""
    found = []
    for look in looks:
        n = look.safety_map.shape[0]
        for i in range(n):
            for j in range(n):
                x = look.target[0] + ((j + 0.5) / n - 0.5) * look.width
                y = look.target[1] + ((i + 0.5) / n - 0.5) * look.width
                if (math.floor(y), math.floor(x)) != cell:
                    continue
                across = math.dist((x, y), look.lander[:2])
                height = look.lander[2] - look.target[2]
                if math.atan2(across, height) > sensor.off_nadir_limit:
                    continue
                deviation = sensor.noise * math.hypot(across, height) / sensor.noise_range
                found.append((float(look.safety_map[i, j]), deviation))
    return found


def probability_safe(
    readings: Sequence[tuple[float, float]], levels: NDArray[np.float64], shares: NDArray[np.float64]
) -> float:
    """Posterior share of the levels above one half."""
    weight = shares.astype(float).copy()
    for value, deviation in readings:
        for k, level in enumerate(levels):
            if value == 0.0:
                weight[k] *= norm.cdf(0.0, level, deviation)
            elif value == 1.0:
                weight[k] *= norm.sf(1.0, level, deviation)
            else:
                weight[k] *= norm.pdf(value, level, deviation)
    return float(weight[levels > 0.5].sum() / weight.sum())
