"""What looks showed of safe and of hazardous ground, and what is left of it in their encodings.

An agent sees the 32 numbers that an encoder makes of a look. What they tell is what the decoder can draw of
them: ground that the look reads as safe, and the decoded map as a hazard, is lost in the encoding. Safe
reads a pixel of `SAFE_READING` or more, in both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.task.observation import Observation
from hda.task.scenario import ground_point
from rl.environment.action import PAPER_ACTIONS
from studies.failures.causes import SAFE_READING
from studies.failures.readings import read_pixels

HEIGHTS = (100.0, 200.0, 400.0, 700.0)
"""[m] of the lander above the target, between the bands that are counted apart."""
DEPTHS = (0.0, 1.0, 2.0, 4.0)
"""[m] from a hazardous cell to the nearest safe one: greatest of each band; 0 is safe ground itself."""
AREAS = (10.0, 30.0, 100.0, 300.0)
"""[m^2] of an island of safe ground in a look: between the bands that are counted apart."""
SAME_SITE = 1.0
"""[m] by which a target moves at least where it is another one."""
_AROUND = 200.0  # [m] of ground about the first target that a flight can look at

Decoder = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Maps (n, 64, 64) -> what is left of them in their encodings, the same shape."""


class Loss(StrEnum):
    """What was seen, before a failed landing, of safe ground within a shift of the target."""

    NONE = "it did not fail"
    NOT_THE_GROUND = "it failed otherwise than on the ground"
    BESIDE = "the site was safe, the touchdown beside it was not"
    NONE_READ = "no look read safe ground within a shift of the target"
    LOST = "looks read safe ground within a shift, no encoding showed any"
    PASSED = "an encoding showed safe ground within a shift, the target did not stay there"


@dataclass(frozen=True)
class SiteSight:
    """What one look said of a place.

    Attributes:
        read: safety that its pixel read.
        encoded: safety that is left of it in the encoding.
    """

    read: float
    encoded: float


@dataclass(frozen=True)
class NearSight:
    """Safe ground in one look, as near the target as one decision can move it.

    Attributes:
        read: [m^2] that the look reads as safe.
        encoded: [m^2] that its encoding shows as safe.
    """

    read: float
    encoded: float


@dataclass(frozen=True)
class SeenIslands:
    """Islands of safe ground in the looks of one band of heights: pixels that touch, corners count.

    Those that touch the limit of what a look read are left out: they may be parts of larger ones.

    Attributes:
        height: number of the band in `HEIGHTS`.
        area: number of the band in `AREAS`.
        islands: that lie wholly in what the looks read.
        shown: of these, those of which the encoding shows a pixel at least as safe.
    """

    height: int
    area: int
    islands: int
    shown: int


@dataclass(frozen=True)
class SeenHazards:
    """Pixels that a policy could have moved its target to, from the looks in one band of heights.

    Attributes:
        height: number of the band in `HEIGHTS`.
        depth: number of the band in `DEPTHS`; the first is safe ground.
        pixels: that read the ground.
        read: of these, those that the look read as a hazard.
        encoded: those that the encoding shows as one.
    """

    height: int
    depth: int
    pixels: int
    read: int
    encoded: int


@dataclass(frozen=True, eq=False)
class HazardDepth:
    """How far each cell near an episode's first target lies from safe ground.

    Attributes:
        corner: (row, column) of the first cell.
        depth: [m] shape (rows, columns), to the nearest safe cell; 0 on safe ground.
    """

    corner: tuple[int, int]
    depth: Array

    def read(self, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Array:
        """[m] of cells of the tile, as the arrays broadcast; nan outside what is held."""
        i, j = np.broadcast_arrays(rows - self.corner[0], columns - self.corner[1])
        inside = (i >= 0) & (i < self.depth.shape[0]) & (j >= 0) & (j < self.depth.shape[1])
        found = np.full(i.shape, math.nan)
        found[inside] = self.depth[i[inside], j[inside]]
        return found


def measure_depth(safe: NDArray[np.bool_], place: Array) -> HazardDepth:
    """Distances to safe ground around a place.

    Args:
        safe: shape (rows, columns), the true map.
        place: [m] x and y of the middle.
    """
    from scipy.ndimage import distance_transform_edt

    row, column = (max(0, int(place[axis] - _AROUND)) for axis in (1, 0))
    end = (int(place[axis] + _AROUND) for axis in (1, 0))
    window = safe[row : next(end), column : next(end)]
    if not window.any():
        return HazardDepth((row, column), np.full(window.shape, math.inf))
    return HazardDepth((row, column), np.asarray(distance_transform_edt(~window)))


def count_hazards(
    record: EpisodeRecord, decoded: NDArray[np.float32], depth: HazardDepth
) -> list[SeenHazards]:
    """Count the pixels of a flight's looks, within a shift of the target, by height and depth of the hazard.

    Args:
        record: the flight.
        decoded: shape (looks, n, n), what its looks' encodings show.
        depth: of the ground.
    """
    counts: NDArray[np.int_] = np.zeros((len(HEIGHTS) + 1, len(DEPTHS) + 1, 3), dtype=int)
    for index, observation in enumerate(record.observations):
        rows, columns, read = read_pixels(record, index)
        deep = depth.read(rows[:, None], columns[None, :])
        kept, band = read & _within_shift(observation) & np.isfinite(deep), _band_of(observation)
        number = np.searchsorted(np.array(DEPTHS), deep[kept] - 1e-9)
        told = observation.safety_map[kept] < SAFE_READING, decoded[index][kept] < SAFE_READING
        counts[band, :, 0] += np.bincount(number, minlength=len(DEPTHS) + 1)
        for column, called in enumerate(told, 1):
            counts[band, :, column] += np.bincount(number[called], minlength=len(DEPTHS) + 1)
    return [
        SeenHazards(*where, *(int(count) for count in counts[where]))
        for where in np.ndindex(counts.shape[:2])
        if counts[where][0]
    ]


def sight_choice(record: EpisodeRecord, decoded: NDArray[np.float32]) -> SiteSight | None:
    """What the look on which the last site was chosen said of it; None where it did not read that ground.

    Chosen is a site at the first decision from which the target stays within `SAME_SITE` of it.

    Args:
        record: the flight.
        decoded: as of `count_hazards`.
    """
    site = record.decisions[-1].site
    away = [
        index
        for index, decision in enumerate(record.decisions)
        if np.linalg.norm(decision.site[:2] - site[:2]) >= SAME_SITE
    ]
    index = away[-1] + 1 if away else 0
    observation = record.observations[index]
    pixel = observation.pixel(site)
    if pixel is None or not read_pixels(record, index)[2][pixel]:
        return None
    return SiteSight(float(observation.safety_map[pixel]), float(decoded[index][pixel]))


def count_islands(record: EpisodeRecord, decoded: NDArray[np.float32]) -> list[SeenIslands]:
    """Count the islands of safe ground in a flight's looks by height and area.

    Args:
        record: the flight.
        decoded: as of `count_hazards`.
    """
    from scipy.ndimage import binary_erosion, label

    touching = np.ones((3, 3))
    counts: NDArray[np.int_] = np.zeros((len(HEIGHTS) + 1, len(AREAS) + 1, 2), dtype=int)
    for index, observation in enumerate(record.observations):
        read = read_pixels(record, index)[2]
        safe = read & (observation.safety_map >= SAFE_READING)
        number: NDArray[np.int_] = label(safe, touching)[0]  # type: ignore[index]
        limit, kept = safe & np.logical_not(binary_erosion(read, touching)), decoded[index] >= SAFE_READING
        cells = (number[part] for part in (safe, safe & kept, limit))
        pixels, shown, cut = (np.bincount(one, minlength=int(number.max()) + 1)[1:] for one in cells)
        area, shown = np.searchsorted(AREAS, pixels[cut == 0] * observation.pixel_size**2), shown[cut == 0]
        for column, bands in enumerate((area, area[shown > 0])):
            counts[_band_of(observation), :, column] += np.bincount(bands, minlength=len(AREAS) + 1)
    return [
        SeenIslands(*where, *(int(count) for count in counts[where]))
        for where in np.ndindex(counts.shape[:2])
        if counts[where][0]
    ]


def measure_near(record: EpisodeRecord, decoded: NDArray[np.float32]) -> list[NearSight]:
    """Safe ground within a shift of the target, in each look and its encoding.

    Args:
        record: the flight.
        decoded: as of `count_hazards`.
    """
    sights = []
    for index, observation in enumerate(record.observations):
        near = _within_shift(observation) & read_pixels(record, index)[2]
        safe = [int((seen[near] >= SAFE_READING).sum()) for seen in (observation.safety_map, decoded[index])]
        sights.append(NearSight(*(count * observation.pixel_size**2 for count in safe)))
    return sights


def explain_loss(record: EpisodeRecord, near: Sequence[NearSight]) -> Loss:
    """Why a flight did not land on safe ground, where it failed; only `unsafe-site` is the ground's.

    Args:
        record: the flight.
        near: of its looks.
    """
    if record.outcome.success:
        return Loss.NONE
    if record.outcome.ending is not Ending.UNSAFE_SITE:
        return Loss.NOT_THE_GROUND
    if record.scenario.tile.is_safe(ground_point(record.scenario, record.decisions[-1].site)):
        return Loss.BESIDE
    if not any(sight.read for sight in near):
        return Loss.NONE_READ
    return Loss.PASSED if any(sight.encoded for sight in near) else Loss.LOST


def _band_of(observation: Observation) -> int:
    """Number of the look's band in `HEIGHTS`."""
    return int(np.searchsorted(HEIGHTS, float(observation.state.position[2] - observation.target[2])))


def _within_shift(observation: Observation) -> NDArray[np.bool_]:
    """Pixels that one decision can move the target to."""
    near = np.abs(observation.pixel_offset) <= PAPER_ACTIONS.shift * observation.width
    return near[:, None] & near[None, :]


def load_decoder(encoder: Path) -> Decoder:
    """The shipped encoder and its decoder, one behind the other.

    Args:
        encoder: where its weights stand, without suffix.

    Raises:
        TrainingLibrariesError: torch, which decodes, is not installed.
    """
    from rl.inference.latent import load_autoencoder
    from rl.training_libraries import require_training_libraries

    require_training_libraries()
    from rl.learning.autoencoder import autoencoder_from_tensors, reconstruct

    network = autoencoder_from_tensors(load_autoencoder(encoder).tensors)

    def decode(maps: NDArray[np.float32]) -> NDArray[np.float32]:
        return reconstruct(network, np.round(maps * 255.0).astype(np.uint8))

    return decode
