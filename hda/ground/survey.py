"""What an elevation model holds where a tile is to be cut, read a strip at a time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.ground.elevation_source import HIGHEST, ElevationFile
from hda.ground.flat_areas import REACH, FlatAreas, find_flat_areas

LEAST_AREA = 4
"""[pixels] Smaller areas of one height are chance."""

_STRIP = 100.0  # [m] of a tile that is looked at at once, ...
_STRIP_ROWS = 50  # ... but so many rows of pixels, ...
_STRIP_PIXELS = 4_000_000  # ... and no more pixels than this
_AROUND = 4 * REACH  # [pixels] of its surroundings, for pixels that are repeated a few times
_MOST_LEVELS = 10_000
_MOST_VALUES = 16
_MARKERS = (-9999.0, -32767.0, -32768.0, -99999.0)


@dataclass
class TileSurvey:
    """What was found on one tile.

    Attributes:
        number: of the tile.
        pixels: of the file.
        unknown: those without a height.
        lowest: [m] of the known heights; infinite where there are none.
        highest: [m] of the known heights.
        marked: height -> pixels of a value that is commonly written for unknown ground.
        impossible: height -> pixels of a value that is no height.
        examined: pixels that were looked at for areas: those of strips with a known height.
        looked: the same, each once where pixels are repeated.
        areas: of one exact height, a strip at a time, without most single pixels.
        levels: [m] whole metres that occur.
    """

    number: int
    pixels: int = 0
    unknown: int = 0
    lowest: float = np.inf
    highest: float = -np.inf
    marked: Counter[float] = field(default_factory=Counter)
    impossible: Counter[float] = field(default_factory=Counter)
    examined: int = 0
    looked: int = 0
    areas: list[FlatAreas] = field(default_factory=list)
    levels: Array = field(default_factory=lambda: np.empty(0))


def survey_tile(
    source: ElevationFile, number: int, rows: tuple[int, int], columns: tuple[int, int], markers: bool
) -> TileSurvey:
    """Look at every pixel of a tile.

    Args:
        source: the open file.
        number: of the tile.
        rows: first and one past the last.
        columns: first and one past the last.
        markers: count the values that are commonly written for unknown ground apart from the heights.
    """
    survey = TileSurvey(number)
    for block, core in _read_strips(source, rows, columns):
        inner = block[core[0] : core[1], core[2] : core[3]]
        survey.pixels += inner.size
        survey.unknown += int(np.isnan(inner).sum())
        _take_out(survey.impossible, block, inner, np.abs(block) > HIGHEST, core)
        if markers:
            _take_out(survey.marked, block, inner, np.isin(block, _marker_heights(source)), core)
        if not np.isnan(inner).all():
            _survey_heights(survey, source, block, core)
    return survey


def _survey_heights(
    survey: TileSurvey, source: ElevationFile, block: Array, core: tuple[int, int, int, int]
) -> None:
    inner = block[core[0] : core[1], core[2] : core[3]]
    survey.lowest = min(survey.lowest, float(np.nanmin(inner)))
    survey.highest = max(survey.highest, float(np.nanmax(inner)))
    levels = np.union1d(survey.levels, np.round(inner[np.isfinite(inner)]))
    survey.levels = levels[:_MOST_LEVELS]
    survey.examined += inner.size
    whole = block.shape
    block, core = _collapse(block, core)
    survey.looked += (core[1] - core[0]) * (core[3] - core[2])
    side = max(source.pixel_size) * math.sqrt(whole[0] * whole[1] / block.size)
    areas = find_flat_areas(block, core, 2.0 * _height_step(block) + 0.15 * side, high_step(side))
    kept = (areas.pixels > 1) | (areas.high_steps > 0)
    survey.areas.append(FlatAreas(*(getattr(areas, entry.name)[kept] for entry in fields(areas))))


def _collapse(block: Array, core: tuple[int, int, int, int]) -> tuple[Array, tuple[int, int, int, int]]:
    """The same ground with each pixel once, where a file was made of larger pixels by repeating them."""
    kept = [_first_of_each(block, axis) for axis in (0, 1)]
    if min(np.count_nonzero(~first) for first in kept) == 0:
        return block, core
    before = [np.append(0, np.cumsum(first)) for first in kept]
    bounds = before[0][core[0]], before[0][core[1]], before[1][core[2]], before[1][core[3]]
    first_row, last_row, first_column, last_column = (int(bound) for bound in bounds)
    thin = np.ascontiguousarray(block[kept[0]][:, kept[1]])
    return thin, (first_row, last_row, first_column, last_column)


def _first_of_each(block: Array, axis: int) -> NDArray[np.bool_]:
    """Which rows (columns) differ from the one before, as far as the same number of them always follows."""
    ahead = np.moveaxis(block, axis, 0)
    same = (ahead[1:] == ahead[:-1]) | (np.isnan(ahead[1:]) & np.isnan(ahead[:-1]))
    changes = np.flatnonzero(~same.all(axis=1)) + 1
    repeats = int(np.gcd.reduce(np.diff(changes))) if changes.size > 2 else 1
    place = np.arange(len(ahead))
    return (place == 0) | (place % repeats == changes[0] % repeats if repeats > 1 else place >= 0)


def _read_strips(
    source: ElevationFile, rows: tuple[int, int], columns: tuple[int, int]
) -> Iterator[tuple[Array, tuple[int, int, int, int]]]:
    """Blocks with the ground around them, and where in them the strip lies."""
    width = columns[1] - columns[0]
    step = max(_STRIP_ROWS, round(_STRIP / source.pixel_size[0]))
    step = max(1, min(step, _STRIP_PIXELS // width))
    west, east = max(0, columns[0] - _AROUND), min(source.shape[1], columns[1] + _AROUND)
    for first in range(rows[0], rows[1], step):
        last = min(first + step, rows[1])
        south, north = max(0, first - _AROUND), min(source.shape[0], last + _AROUND)
        block = source.read(south, north, west, east)
        core = (first - south, last - south, columns[0] - west, columns[1] - west)
        yield np.ascontiguousarray(block), core


def _marker_heights(source: ElevationFile) -> list[float]:
    """[m] What the values commonly written for unknown ground are as heights."""
    values = set(_MARKERS)
    if source.kind.kind in "iu" and source.kind.itemsize > 1:
        ends: Any = np.iinfo(source.kind)
        values |= {float(end) for end in (ends.min, ends.max) if end != 0}
    return sorted(value * source.scale + source.offset for value in values)


def _take_out(
    found: Counter[float],
    block: Array,
    inner: Array,
    taken: NDArray[np.bool_],
    core: tuple[int, int, int, int],
) -> None:
    """Count the pixels of some heights, and go on as if they were unknown."""
    values, counts = np.unique(inner[taken[core[0] : core[1], core[2] : core[3]]], return_counts=True)
    most = np.argsort(counts)[-_MOST_VALUES:]
    found.update(dict(zip(values[most].tolist(), counts[most].tolist(), strict=True)))
    block[taken] = np.nan


def _height_step(block: Array) -> float:
    """[m] The step in which heights are stored; of continuous ground a small one."""
    thin = block[:: max(1, block.shape[0] // 32)]
    steps = np.abs(np.diff(thin, axis=1))
    steps = steps[steps > 0.0]
    return float(np.quantile(steps, 0.1)) if steps.size else 0.0


def high_step(side: float) -> float:
    """[m] Ground whose pixels have this side [m] nowhere rises so much on all sides of a pixel."""
    return max(50.0, 10.0 * side)
