"""Distributions over a stream of episodes: counts in bins, never the values."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hda.flight.episode_row import MEASURES, EpisodeRow

BINS = 40
EPISODES_BEFORE_BINS = 10_000
"""Episodes that decide the edges of the bins; all of them where a study has no more."""

_FINEST, _COARSEST = 1e-7, 1e5  # [s] decision times outside stand in the end bins
_BINS_PER_DECADE = 500  # a bin is 0.46 % wide


class DecisionTimes:
    """Quantiles of times, to a quarter of a per cent: counts in equal bins of their logarithm."""

    def __init__(self) -> None:
        """Begin with none."""
        decades = round(math.log10(_COARSEST / _FINEST))
        self._counts = np.zeros(decades * _BINS_PER_DECADE, dtype=np.int64)
        self._greatest = 0.0

    def add(self, seconds: NDArray[np.float64]) -> None:
        """Add times [s]."""
        place = _BINS_PER_DECADE * np.log10(np.maximum(seconds, _FINEST) / _FINEST)
        bins = np.minimum(place.astype(np.int64), self._counts.size - 1)
        np.add.at(self._counts, bins, 1)
        self._greatest = max(self._greatest, float(np.max(seconds, initial=0.0)))

    def quantile(self, level: float) -> float:
        """Time [s] that so many decisions (ratio) do not exceed; level 1 gives the greatest; nan of none."""
        total = int(self._counts.sum())
        if total == 0:
            return math.nan
        if level >= 1.0:
            return self._greatest
        place = int(np.searchsorted(np.cumsum(self._counts), level * (total - 1), side="right"))
        return min(_FINEST * 10.0 ** ((place + 0.5) / _BINS_PER_DECADE), self._greatest)


class MeasureHistograms:
    """Histograms of every measure, with the same bins for each policy.

    The first EPISODES_BEFORE_BINS episodes are kept until they have decided the edges (their 0.2 and 99.8 %
    quantiles over all policies); then only counts are. The end bins hold what lies beyond.
    """

    def __init__(self, policies: tuple[str, ...]) -> None:
        """Begin with no episode."""
        self.policies = policies
        self.edges: dict[str, NDArray[np.float64]] = {}
        self._counts: dict[str, NDArray[np.int64]] = {}
        self._waiting: list[NDArray[np.float64]] = []

    def add(self, rows: Mapping[str, EpisodeRow]) -> None:
        """Add the rows of one episode."""
        values = [[getattr(rows[name], measure) for name in self.policies] for measure in MEASURES]
        self._waiting.append(np.array(values, dtype=np.float64))
        if len(self._waiting) == EPISODES_BEFORE_BINS:
            self.finish()

    def finish(self) -> None:
        """Count what is waiting; called after the last episode."""
        if not self._waiting:
            return
        values = np.array(self._waiting)  # (episodes, measures, policies)
        self._waiting = []
        for k, measure in enumerate(MEASURES):
            if measure not in self.edges:
                low, high = (float(end) for end in np.quantile(values[:, k], (0.002, 0.998)))
                self.edges[measure] = np.linspace(low, max(high, low + 1e-9), BINS + 1)
                self._counts[measure] = np.zeros((len(self.policies), BINS), dtype=np.int64)
            edges = self.edges[measure]
            for p in range(len(self.policies)):
                inside = np.clip(values[:, k, p], edges[0], edges[-1])
                self._counts[measure][p] += np.histogram(inside, bins=edges)[0]

    def count(self, measure: str, policy: str) -> NDArray[np.int64]:
        """Episodes of a policy in each bin, shape (BINS,); `finish` first."""
        return self._counts[measure][self.policies.index(policy)]
