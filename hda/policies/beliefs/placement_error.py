"""What a belief loses because its looks were not placed where they belong.

A look is placed by the lander's estimate of that moment. What it shows at a cell is the ground of another
place, off by the error of that estimate. Between an earlier look and the newest its variance is taken as the
difference of the two that the filter stated, p_k - p_n. That assumes an optimal filter, whose newest error is
uncorrelated with what it was corrected by since, and an error that does not move by itself. It does move
between fixes, with velocity and the inertial unit, so that the difference says too little. Where p_n is the
greater, as below `SiteFixes.floor`, where no fix is taken, the look is not blurred at all. What is left
between the newest look and the touchdown is counted where a landing is priced
(`hda.policies.hazard_aware.landing_spread`).

The probability that a cell is safe is then the mean over the cells around it, with the normal distribution's
weights. The absolute error of the position does not come in: it moves all looks, and the lander, alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel, compile_vector_kernel
from hda.task.observation import Observation

_STEP = 0.05
"""[m] to which a deviation is rounded: weights are made once for each."""
_WIDEST = 2.5
"""[m] greatest deviation; greater ones are taken as this."""
_REACH = 9
"""Cells on each side over which the mean is taken at most: 3.8 deviations of the widest."""
_LEAST_WEIGHT = 1e-6
"""Less is left out."""


def placement_variance(observation: Observation) -> float:
    """[m^2] variance of position less site along each horizontal axis, their mean; 0 without a filter."""
    if observation.covariance is None:
        return 0.0
    return 0.5 * (float(observation.covariance[0, 0]) + float(observation.covariance[1, 1]))


@dataclass(frozen=True, eq=False)
class Placement:
    """By how much the looks behind a belief are misplaced.

    Attributes:
        variance: [m^2] shape (n, n), along each horizontal axis, of the looks behind each cell; where points
            of several lie in one cell, the mean over the points.
        newest: [m^2] of the newest look that showed ground.
    """

    variance: NDArray[np.float32] = field(repr=False)
    newest: float

    @classmethod
    def blank(cls, side: int) -> Placement:
        """Over `side` x `side` cells, before any look."""
        return cls(np.zeros((side, side), dtype=np.float32), 0.0)

    def blurred(self, safe: NDArray[np.float32]) -> NDArray[np.float32]:
        """Probability that each cell is safe, shape (n, n), where `safe` was read from misplaced looks.

        Along rows first, then along columns, each cell with its own deviation relative to the newest look: 0
        where the newest is placed worse, and at most 2.5 m.
        """
        number = np.empty(safe.shape, dtype=np.int8)
        if not number_deviations(self.variance, np.float32(self.newest), number):
            return safe
        along, out = np.empty_like(safe), np.empty_like(safe)
        _mean_along(safe, number, cell_weights(), (0, 1), along)
        _mean_along(along, number, cell_weights(), (1, 0), out)
        return out


@lru_cache(maxsize=1)
def cell_weights() -> Array:
    """Share of a normal distribution that lies in each cell from its middle outward.

    Returns:
        Shape (m, 10): row k for a deviation of 0.05 k m, up to 2.5 m. Both sides together add up to one.
    """
    deviations = np.arange(1, round(_WIDEST / _STEP) + 1) * _STEP
    edges = np.arange(-1, _REACH + 1) + 0.5
    below = np.array([[math.erf(edge / (s * math.sqrt(2.0))) for edge in edges] for s in deviations])
    weights = np.vstack([np.arange(_REACH + 1) == 0, 0.5 * np.diff(below)])
    weights[weights < _LEAST_WEIGHT] = 0.0
    return weights / (2.0 * weights.sum(axis=1, keepdims=True) - weights[:, :1])


@compile_vector_kernel
def number_deviations(variance: NDArray[np.float32], newest: np.float32, number: NDArray[np.int8]) -> bool:
    """Fill the row of `cell_weights` for each cell: whether any is not the first."""
    most, step, bits = np.float32(_WIDEST), np.float32(1.0 / _STEP), np.int8(0)
    for i in range(variance.shape[0]):
        for j in range(variance.shape[1]):
            deviation = math.sqrt(max(variance[i, j] - newest, np.float32(0.0)))
            number[i, j] = np.int8(min(deviation, most) * step + np.float32(0.5))
            bits |= number[i, j]
    return bits != 0


@compile_kernel
def _mean_along(
    values: NDArray[np.float32],
    number: NDArray[np.int8],
    weights: Array,
    way: tuple[int, int],
    out: NDArray[np.float32],
) -> None:
    """Weighted mean along a way of (rows, columns) to the next cell; the last cell goes on outside.

    Each cell has the weights of its number.
    """
    down, right = way
    last, end = values.shape[0] - 1, values.shape[1] - 1
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            own = np.uint64(number[i, j])
            if own == 0:
                out[i, j] = values[i, j]
                continue
            total = weights[own, 0] * values[i, j]
            for k in range(1, _REACH + 1):
                weight = weights[own, k]
                if weight == 0.0:
                    break
                before = values[max(i - down * k, 0), max(j - right * k, 0)]
                after = values[min(i + down * k, last), min(j + right * k, end)]
                total += weight * (before + after)
            out[i, j] = total
