"""Stationary, isotropic Gaussian random fields by spectral synthesis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array


@dataclass(frozen=True)
class FieldSpectrum:
    """Amplitudes of the Fourier modes of a periodic field, in the layout of a real two-dimensional FFT.

    Attributes:
        amplitude: (period, period // 2 + 1) float32; mode variance is four times its square, or once its
            square in the two columns that stand for themselves alone (frequency zero and Nyquist).
        period: [cells] side of the periodic square.
    """

    amplitude: NDArray[np.float32]
    period: int

    def variance_per_column(self) -> Array:
        """Variance carried by each east-west frequency, shape (period // 2 + 1,)."""
        return (self.amplitude.astype(np.float64) ** 2).sum(axis=0) * _multiplicity(self.period) ** 2

    def scaled(self, factor: float) -> FieldSpectrum:
        """The spectrum of the same field times `factor`."""
        return FieldSpectrum((self.amplitude * factor).astype(np.float32), self.period)


def _multiplicity(period: int) -> Array:
    """How many columns of the full transform each column of the real one stands for."""
    count = np.full(period // 2 + 1, 2.0)
    count[0] = 1.0
    if period % 2 == 0:
        count[-1] = 1.0
    return count


def frequency_grid(period: int) -> Array:
    """Radial frequency [cycles per cell] of each mode, shape (period, period // 2 + 1)."""
    return np.hypot(np.fft.fftfreq(period)[:, None], np.fft.rfftfreq(period)[None, :])


def make_spectrum(density: Array, period: int) -> FieldSpectrum:
    """Turn a power spectral density (any scale) on `frequency_grid(period)` into mode amplitudes."""
    # A mode and its mirror image add in amplitude: four times the variance, where twice is due.
    amplitude = np.sqrt(density / _multiplicity(period))
    return FieldSpectrum(amplitude.astype(np.float32), period)


def fast_period(cells: int) -> int:
    """Smallest even FFT length with small prime factors that holds `cells`."""
    from scipy.fft import next_fast_len

    return 2 * cast("int", next_fast_len((cells + 1) // 2, real=True))


def synthesise_field(spectrum: FieldSpectrum, size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw one field and cut out a square of `size` cells.

    Args:
        spectrum: mode amplitudes; its period should exceed `size`, or the opposite edges look alike.
        size: [cells] side of the square that is returned.
        rng: source of the modes.

    Returns:
        (size, size) float32, of mean zero and the variance that the spectrum states, over the ensemble.
    """
    from scipy.fft import irfft2

    rows, columns = spectrum.amplitude.shape
    modes = rng.standard_normal((rows, 2 * columns), dtype=np.float32).view(np.complex64)
    modes *= spectrum.amplitude
    shape = (spectrum.period, spectrum.period)
    field = np.asarray(irfft2(modes, s=shape, norm="forward", overwrite_x=True, workers=1))
    return np.ascontiguousarray(field[:size, :size])
