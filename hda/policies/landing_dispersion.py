"""Where a touchdown that is aimed at a cell comes down: Gaussian along each axis, over five cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_vector_kernel


def gaussian_shares(deviation: float, reach: int) -> Array:
    """Chance of a Gaussian to lie in each cell from the middle one to `reach` beside it, and in none beyond.

    Args:
        deviation: its standard deviation about the middle of a cell, in cells, above zero.
        reach: at least 0.

    Returns:
        Shape (reach + 1,), of the cells on one side; both sides together add up to one.
    """
    within = np.array([math.erf((k + 0.5) / (deviation * math.sqrt(2.0))) for k in range(reach + 1)])
    return np.diff(within, prepend=0.0) * np.where(np.arange(reach + 1) == 0, 1.0, 0.5) / within[-1]


def dispersion_weights(dispersion: float) -> tuple[float, float, float]:
    """Chance to come down in the row aimed at, and in each of the rows one and two beside it."""
    middle, near, far = gaussian_shares(dispersion, 2).tolist()
    return middle, near, far


def landing_probability(safe: NDArray[np.float32], dispersion: float, cell: tuple[int, int]) -> float:
    """Probability that a touchdown aimed at a cell's centre ends on a safe cell.

    Args:
        safe: shape (n, n), probability that each cell is safe.
        dispersion: [m] standard deviation of the touchdown along each axis, Gaussian, up to 2.5 m.
        cell: (row, column).

    Returns:
        The probability; 0 within two cells of the square's edge.
    """
    return float(landing_chance(safe, dispersion_weights(dispersion), *cell))


@compile_vector_kernel
def smooth_row(row: NDArray[np.float32], weights: tuple[float, float, float], out: Array) -> None:
    """Weighted mean over five cells along a row, but for two at each end."""
    middle, near, far = weights
    first, here, third, fourth, inside = row[1:], row[2:], row[3:], row[4:], out[2:]
    for column in range(row.size - 4):
        total = middle * here[column] + near * (first[column] + third[column])
        inside[column] = total + far * (row[column] + fourth[column])


@compile_vector_kernel
def smooth_across(
    smoothed: Array, row: int, weights: tuple[float, float, float], out: NDArray[np.float32]
) -> None:
    """Weighted mean of five smoothed rows about one; row k stands in `smoothed[k % 5]`."""
    middle, near, far = weights
    second, first, here = smoothed[(row - 2) % 5], smoothed[(row - 1) % 5], smoothed[row % 5]
    third, fourth = smoothed[(row + 1) % 5], smoothed[(row + 2) % 5]
    for column in range(out.size):
        total = middle * here[column] + near * (first[column] + third[column])
        out[column] = total + far * (second[column] + fourth[column])


@compile_vector_kernel
def landing_chance(
    safe: NDArray[np.float32], weights: tuple[float, float, float], row: int, column: int
) -> np.float32:
    """The same of one cell; beyond the square nothing is safe."""
    n, chance = safe.shape[0], np.zeros(5, dtype=np.float32)
    if 2 <= row < n - 2 and 2 <= column < n - 2:
        smoothed = np.zeros((5, 5))
        for step in range(5):
            smooth_row(safe[row - 2 + step, column - 2 : column + 3], weights, smoothed[step])
        smooth_across(smoothed, 2, weights, chance)
    return chance[2]
