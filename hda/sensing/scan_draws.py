"""What chance does to one scan of a ranging LIDAR."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array


@dataclass(frozen=True, eq=False)
class ScanDraws:
    """What chance does to one scan of n x n rays; all standard normal but the last.

    Attributes:
        attitude: shape (3,).
        bias: one number.
        motion: shape (3,).
        range: shape (n, n).
        jitter: shape (n, n, 2).
        dropout: shape (n, n), uniform in [0, 1).
    """

    attitude: Array
    bias: float
    motion: Array
    range: NDArray[np.float32]
    jitter: NDArray[np.float32]
    dropout: NDArray[np.float32]


def draw_scan(rng: np.random.Generator, rays: int) -> ScanDraws:
    """Draw all of a scan's chances, in one order whatever the sensor's errors are."""
    return ScanDraws(
        attitude=rng.standard_normal(3),
        bias=float(rng.standard_normal()),
        motion=rng.standard_normal(3),
        range=rng.standard_normal((rays, rays), dtype=np.float32),
        jitter=rng.standard_normal((rays, rays, 2), dtype=np.float32),
        dropout=rng.random((rays, rays), dtype=np.float32),
    )
