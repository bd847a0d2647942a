"""Where rocks lie: everywhere but on islands of clear ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.validation import finite_number
from hda.terrain.gaussian_field import (
    FieldSpectrum,
    fast_period,
    frequency_grid,
    make_spectrum,
    synthesise_field,
)


@dataclass(frozen=True)
class IslandField:
    """A smooth Gaussian field of mean zero and variance one; an island is where it lies below a threshold.

    Rocks scattered evenly leave only pin-holes of safe ground. Islands stand for the patches that real sites
    have. All three numbers are engineering choices, to be calibrated.

    Attributes:
        smoothing_scale: [m] standard deviation of the Gaussian kernel that smooths white noise into the
            field, so its correlation is exp(-distance^2 / (4 smoothing_scale^2)).
        threshold: [standard deviations] islands cover a share Phi(threshold) of the ground.
        remaining_share: [-] share of the rocks that stay on islands.

    Raises:
        ValueError: a field is out of range.
    """

    smoothing_scale: float = 15.0
    threshold: float = -0.8
    remaining_share: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a field that cannot be drawn."""
        finite_number("smoothing_scale", self.smoothing_scale, above=0.0)
        finite_number("threshold", self.threshold)
        finite_number("remaining_share", self.remaining_share, at_least=0.0, at_most=1.0)


@lru_cache(maxsize=4)
def _spectrum(scale: float, size: int) -> FieldSpectrum:
    # Six kernel widths apart the correlation is 1e-4: opposite edges are independent.
    period = fast_period(size + math.ceil(6.0 * scale))
    density = np.exp(-((2.0 * np.pi * scale * frequency_grid(period)) ** 2))
    spectrum = make_spectrum(density, period)
    return spectrum.scaled(1.0 / math.sqrt(float(spectrum.variance_per_column().sum())))


def generate_island_field(
    islands: IslandField, size: int, pixel_size: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Draw the field, (size, size) float32, row north, column east; islands lie below the threshold."""
    return synthesise_field(_spectrum(islands.smoothing_scale / pixel_size, size), size, rng)
