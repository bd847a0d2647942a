"""The ground without craters and rocks: a self-affine (fractal) surface."""

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

SLOPE_BASELINE = 1.0  # [m] the step over which the RMS slope is stated


@dataclass(frozen=True)
class BaseSurface:
    """A self-affine surface, stated as planetary surfaces usually are (Shepard et al. 2001, JGR 106, 32777).

    Attributes:
        hurst: [-] Hurst exponent in (0, 1): the RMS height difference grows as step^hurst. 0.8 is an
            engineering choice between mare and highland values.
        rms_slope: [rad] atan of the RMS height difference over a 1 m step divided by the step, along a
            profile. The lunar surface at 1 m without craters and rocks is gentle; 1.5 deg is an engineering
            choice.

    Raises:
        ValueError: a field is out of range.
    """

    hurst: float = 0.8
    rms_slope: float = math.radians(1.5)

    def __post_init__(self) -> None:
        """Refuse a surface that is not self-affine."""
        finite_number("hurst", self.hurst, at_least=0.01, at_most=0.99)
        finite_number("rms_slope", self.rms_slope, at_least=0.0, at_most=math.radians(60.0))


@lru_cache(maxsize=4)
def _spectrum(
    surface: BaseSurface, size: int, pixel_size: float, longest_wave: float | None
) -> FieldSpectrum:
    # A period of two tiles keeps opposite edges unlike and leaves waves longer than the tile in it.
    period = fast_period(2 * size)
    frequency = frequency_grid(period)
    frequency[0, 0] = 1.0
    density = frequency ** -(2.0 * surface.hurst + 2.0)
    density[0, 0] = 0.0
    spectrum = make_spectrum(density, period)
    # Mean square height difference over the baseline; coarser grids are carried down by the Hurst law.
    step = max(SLOPE_BASELINE, pixel_size)
    phase = 2.0 * np.pi * np.fft.rfftfreq(period) * step / pixel_size
    difference = math.sqrt(float(np.sum(spectrum.variance_per_column() * 2.0 * (1.0 - np.cos(phase)))))
    wanted = math.tan(surface.rms_slope) * SLOPE_BASELINE * (step / SLOPE_BASELINE) ** surface.hurst
    spectrum = spectrum.scaled(wanted / difference)
    if longest_wave is not None:
        spectrum.amplitude[frequency * longest_wave < pixel_size] = 0.0
    return spectrum


def generate_base_surface(
    surface: BaseSurface,
    size: int,
    pixel_size: float,
    rng: np.random.Generator,
    longest_wave: float | None = None,
) -> NDArray[np.float32]:
    """Draw heights [m] of a square of `size` cells of `pixel_size` [m], by spectral synthesis.

    The power spectral density falls as frequency^-(2 hurst + 2). The RMS slope holds over the ensemble; a
    single tile scatters about it.

    Args:
        surface: of which heights are drawn.
        size: [cells] side of the square.
        pixel_size: [m] side of a cell.
        rng: source of the modes.
        longest_wave: [m] only the part of the surface in waves up to this length; all of it if left out.

    Returns:
        (size, size) float32, [m], row north, column east.
    """
    return synthesise_field(_spectrum(surface, size, pixel_size, longest_wave), size, rng)


def rms_slope(dem: NDArray[np.floating], pixel_size: float = 1.0, cells: int = 1) -> float:
    """RMS slope [rad] of a map over a step of `cells` cells: along rows and columns, their mean square.

    Args:
        dem: (m, n) elevation [m].
        pixel_size: [m] side of a cell.
        cells: the baseline, in cells.
    """
    heights = np.asarray(dem, dtype=np.float64)
    east = np.mean((heights[:, cells:] - heights[:, :-cells]) ** 2)
    north = np.mean((heights[cells:] - heights[:-cells]) ** 2)
    return math.atan(math.sqrt(0.5 * (east + north)) / (cells * pixel_size))
