"""Common random numbers: what chance does to an episode, whatever the policy does.

`SeedSequence([study_seed, episode]).spawn(5)` gives the scenario, sensor, actuator, policy and navigation
streams. Look k and interval k draw from children of their own, keyed by k, so that two policies that fly the
same episode meet the same noise at the same look, even if one of them draws more or flies longer.

SeedSequence reads a number as words of 32 bits, and pads two words with two zeros. A study seed of more words
would run into the episode's: (2^32, 0) into (0, 1). It is therefore given as its first word, the episode, how
many words follow, and these; the count is zero for the others, so that no two seeds share streams.

A flight may be branched before any look (`EpisodeStreams.branch`): what chance does from there on comes from
streams of the branch's own, what it decides for the whole episode stays. Such a seed gives its count with the
highest bit set, then the branch; no seed has so many words.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.navigation.sensor_errors import FixDraws, ReadingDraws, draw_fix, draw_readings
from hda.sensing.scan_draws import ScanDraws, draw_scan
from hda.task.look_noise import POOL, Words, draw_normals, draw_symmetric, draw_unit

_SCENARIO, _SENSOR, _ACTUATOR, _POLICY, _NAVIGATION, _ROULETTE = range(6)
_WORD = 2**32
_BRANCHED = 2**31


@dataclass(frozen=True)
class EpisodeStreams:
    """The random streams of one episode.

    Attributes:
        study_seed: seed of the whole study, at least zero; of any size.
        episode: number of the episode within the study, at least zero and below 2^32.
        branch: number of the branch of its flight, at least zero and below 2^32; 0 is the flight itself.

    Raises:
        ValueError: a field is not such a whole number.
    """

    study_seed: int
    episode: int
    branch: int = 0

    def __post_init__(self) -> None:
        """Refuse what SeedSequence would refuse later, with a name."""
        for name in ("study_seed", "episode", "branch"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
                raise ValueError(f"{name} must be a whole number of at least 0, got {value!r}")
        for name in ("episode", "branch"):
            if getattr(self, name) >= _WORD:
                raise ValueError(f"{name} must be below 2^32, got {getattr(self, name)!r}")

    def _entropy(self, branch: int) -> list[int]:
        """Words of the seed that all streams of a branch share."""
        entropy = [int(self.study_seed) % _WORD, int(self.episode)]
        rest = int(self.study_seed) // _WORD
        words = [rest >> shift & _WORD - 1 for shift in range(0, rest.bit_length(), 32)]
        if branch:
            entropy += [_BRANCHED | len(words), int(branch), *words]
        elif rest:
            entropy += [len(words), *words]
        return entropy

    def _seed(self, *key: int) -> Words:
        """Words of a seed as SeedSequence has them: the shared ones, filled up with zeros, then the key.

        A key of one word is that of the whole episode, which has no branches.
        """
        entropy = self._entropy(self.branch if len(key) > 1 else 0)
        return np.array([*entropy, *[0] * (POOL - len(entropy)), *key], dtype=np.uint32)

    def _generator(self, *key: int) -> np.random.Generator:
        sequence = np.random.SeedSequence(self._seed(*key))  # a spawn key would take numpy longer
        return np.random.Generator(np.random.PCG64(sequence))

    def scenario(self) -> np.random.Generator:
        """Stream of the tile, the first target and the initial state."""
        return self._generator(_SCENARIO)

    def policy(self) -> np.random.Generator:
        """Stream that a policy may draw from."""
        return self._generator(_POLICY)

    def look(self, index: int, pixels: int) -> NDArray[np.float32]:
        """Standard normal noise of look `index`, shape (pixels, pixels); read-only."""
        return _draw_look(self, index, pixels)

    def look_seed(self, index: int) -> Words:
        """Seed of the noise of look `index`, for `hda.task.look_noise`; its last word is the index."""
        return self._seed(_SENSOR, index)

    def scan(self, index: int, rays: int) -> ScanDraws:
        """All that chance does to the scan of look `index`, of rays x rays."""
        return draw_scan(self._generator(_SENSOR, index, 2), rays)

    def navigation_error(self, position_error: float, velocity_error: float) -> Array:
        """Error of the estimated position [m] and velocity [m/s], shape (6,), one for the whole episode."""
        draw = self._generator(_SENSOR).standard_normal(6)
        return draw * np.repeat((position_error, velocity_error), 3)

    def navigation(self) -> np.random.Generator:
        """Stream of what errs for a whole episode in the navigation sensors."""
        return self._generator(_NAVIGATION)

    def readings(self, index: int, periods: int, gyroscope: bool = False) -> ReadingDraws:
        """All that chance does to the navigation sensors over the control periods of interval `index`."""
        return draw_readings(self._generator(_NAVIGATION, index), periods, gyroscope)

    def site_fix(self, index: int) -> FixDraws:
        """All that chance does to the fix of the landing site in look `index`."""
        return draw_fix(self._generator(_NAVIGATION, index, 0))

    def roulette(self) -> np.random.Generator:
        """Stream that decides which branches of the flight go on; no flight draws from it."""
        return self._generator(_ROULETTE)

    def map_is_missing(self, index: int, probability: float) -> bool:
        """Whether look `index` comes without a map."""
        return bool(draw_unit(self._seed(_SENSOR, index, 1)) < probability)

    def thrust_seed(self, index: int) -> Words:
        """Seed of the thrust error of interval `index`; its last word is the index."""
        return self._seed(_ACTUATOR, index)

    def thrust_error(self, index: int, bound: float) -> float:
        """Relative thrust error of interval `index`, uniform in [-bound, bound]."""
        return _draw_thrust_error(self, index, bound)


@lru_cache(maxsize=32)
def _draw_look(streams: EpisodeStreams, index: int, pixels: int) -> NDArray[np.float32]:
    """Kept for the other policies that fly the episode."""
    noise = draw_normals(streams.look_seed(index), (pixels, pixels))
    noise.flags.writeable = False
    return noise


@lru_cache(maxsize=64)
def _draw_thrust_error(streams: EpisodeStreams, index: int, bound: float) -> float:
    """Kept as `_draw_look` is."""
    return float(draw_symmetric(streams.thrust_seed(index), float(bound)))
