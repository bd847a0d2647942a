"""Values of an elevation model that only look like ground, refused with what to do about them.

A void that its file does not declare is one exact number over an area: a warp's zeros, -9999, the end of a
type. As ground it would be perfectly flat and safe. It is known by what it looks like
(`hda.ground.flat_areas`): most of its outline is a cliff. On ground of whole metres or of
repeated pixels equal neighbours are common, so that an area must be larger there and its outline clearer.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.ground.elevation_source import ElevationFile, ElevationFileError
from hda.ground.flat_areas import FlatAreas
from hda.ground.survey import LEAST_AREA, TileSurvey, high_step

LEAST_RELIEF = 0.05
"""[m] Less over a whole tile is no measured ground."""

MOST_RELIEF = 3000.0
"""[m] More on one tile is a value that stands for unknown ground."""

_CLIFF_SHARE = 0.25  # of a value's outline; a lake's shore on the roughest ground here has 0.17
_HIGH_SHARE = 0.9  # of an area's outline, of steps as high as no ground has them
_PAIRS = 8  # values of which equal neighbours are found, at most, on continuous ground,
_PAIR_SHARE = 5e-4  # as a share of a tile's pixels
_STEPPED_GROUND = 0.01  # share of a tile in flat areas without cliffs that makes it ground of steps
_LEAST_SIDES = 12
_LEAST_FOREIGN = 16  # [pixels] of one value on a tile of continuous ground
_LEAST_LONELY = 25  # [pixels]
_STEPPED_CLIFF_SHARES = ((25, 0.8), (100, 0.5), (400, 0.25))
"""[pixels] of an area there, and how much of its outline must be a cliff. Ground in steps that was measured
or generated reaches 0.42, 0.21 and 0.05."""

_NAMED = 10

_PROBABLY = "probably a no-data value that the file does not declare"


@dataclass(frozen=True, eq=False)
class TileFinding:
    """What of a tile does not look like ground.

    Attributes:
        number: of the tile.
        pixels: of the file.
        unknown_share: share of them without a height.
        lowest: [m] of the heights that may be real; infinite where there are none.
        highest: [m] of the heights that may be real.
        impossible: height -> pixels of values that are no heights.
        voids: height -> pixels of values that look like unknown ground.
        spikes: height -> pixels of specks that stand out of their surroundings as no ground does.
    """

    number: int
    pixels: int
    unknown_share: float
    lowest: float
    highest: float
    impossible: Counter[float]
    voids: Counter[float]
    spikes: Counter[float]

    @property
    def relief(self) -> float:
        """[m] Between the lowest and the highest ground; 0 where there is none."""
        return max(0.0, self.highest - self.lowest)


def judge_tile(survey: TileSurvey, pixel_size: float) -> TileFinding:
    """Tell from what was seen on a tile what does not look like ground.

    Args:
        survey: of the tile.
        pixel_size: [m] side of the file's pixels.
    """
    voids = survey.marked.copy()
    if survey.highest == survey.lowest:
        known = survey.pixels - survey.unknown - survey.marked.total() - survey.impossible.total()
        voids += Counter({survey.lowest: known})
    else:
        voids += _find_filled_areas(survey, pixel_size)
    return TileFinding(
        survey.number,
        survey.pixels,
        survey.unknown / survey.pixels,
        survey.lowest,
        survey.highest,
        survey.impossible,
        voids,
        _find_spikes(survey),
    )


def refuse_voids(
    file: Path, source: ElevationFile, findings: Sequence[TileFinding], flat_is_ground: bool
) -> None:
    """Raise where the tiles of a file hold what does not look like ground.

    Args:
        file: for the message.
        source: the same, open.
        findings: one a tile.
        flat_is_ground: areas of one height, and tiles without relief, are ground.

    Raises:
        ElevationFileError: a value stands for unknown ground, as far as one can see; the message gives it,
            its share of the tiles, and what to do.
    """
    _refuse_values(file, source, {finding: finding.impossible for finding in findings}, "")
    flats = ", --flat-is-ground (flat_is_ground=True) takes it as ground"
    if not flat_is_ground:
        _refuse_flat_tiles(file, findings, flats)
        _refuse_values(file, source, {finding: finding.voids for finding in findings}, flats)
    for finding in findings:
        if finding.relief > MOST_RELIEF:
            ends = (source.stored(height) for height in (finding.lowest, finding.highest))
            raise ElevationFileError(
                f"{file}: tile {finding.number} has heights from {finding.lowest:g} to {finding.highest:g} m;"
                f" {_PROBABLY}: {' or '.join(f'--nodata={end}' for end in ends)} (nodata=... in Python) makes"
                " it unknown ground"
            )
    _refuse_values(file, source, {finding: finding.spikes for finding in findings}, "")


def name_tiles(tiles: Sequence[int]) -> str:
    """The numbers of some tiles, as words; of many the first few."""
    more = f" and {len(tiles) - _NAMED} more" if len(tiles) > _NAMED else ""
    numbers = ", ".join(str(number) for number in tiles[:_NAMED])
    return f"tile{'s' if len(tiles) > 1 else ''} {numbers}{more}"


def _refuse_flat_tiles(file: Path, findings: Sequence[TileFinding], way_out: str) -> None:
    """Refuse tiles whose heights differ by rounding."""
    flat = [finding for finding in findings if 0.0 < finding.relief < LEAST_RELIEF]
    if flat:
        raise ElevationFileError(
            f"{file}: {name_tiles([finding.number for finding in flat])} without relief (heights"
            f" {flat[0].lowest:.9g} to {flat[0].highest:.9g} m); if that is unknown ground, let the file say"
            f" so (NaN, or a declared no-data value){way_out}"
        )


def _refuse_values(
    file: Path, source: ElevationFile, found: dict[TileFinding, Counter[float]], way_out: str
) -> None:
    total: Counter[float] = sum(found.values(), Counter())
    if not total:
        return
    (height, pixels), *others = total.most_common(4)
    tiles = [finding for finding, counts in found.items() if counts[height]]
    share = 100.0 * pixels / sum(finding.pixels for finding in tiles)
    stored = source.stored(height)
    also = f" (as are others: {', '.join(f'{value:.9g} m' for value, _ in others)})" if others else ""
    raise ElevationFileError(
        f"{file}: {share:.3g}% of {name_tiles([finding.number for finding in tiles])} is exactly"
        f" {height:.9g} m{also}; {_PROBABLY}: --nodata={stored} (nodata={stored} in Python) makes it unknown"
        f" ground{way_out}"
    )


def _find_filled_areas(survey: TileSurvey, pixel_size: float) -> Counter[float]:
    """Height -> pixels of values that fill areas as no ground does."""
    areas = _join(survey.areas)
    chosen = _is_broken_off(areas) if _is_stepped(survey, areas) else _is_foreign(areas)
    chosen |= (areas.pixels >= LEAST_AREA) & (areas.high_steps > _HIGH_SHARE * areas.steps)
    found = _count(areas.height[chosen], areas.pixels[chosen])
    lonely = (areas.sides == 0) & (areas.pixels >= _LEAST_LONELY) & ~np.isin(areas.height, list(found))
    for value in np.unique(areas.height[lonely]):  # nothing beside it to compare: with the rest of the tile
        others = survey.levels[np.abs(survey.levels - np.round(value)) > 1.0]
        if others.size and np.abs(others - value).min() > high_step(pixel_size):
            found[float(value)] = int(areas.pixels[areas.height == value].sum())
    repeats = survey.examined / max(1, survey.looked)
    return Counter({height: round(repeats * pixels) for height, pixels in found.items()})


def _join(parts: Sequence[FlatAreas]) -> FlatAreas:
    names = [entry.name for entry in fields(FlatAreas)]
    return FlatAreas(
        *(np.concatenate([getattr(part, name) for part in parts] or [np.empty(0)]) for name in names)
    )


def _is_stepped(survey: TileSurvey, areas: FlatAreas) -> bool:
    """Whether equal neighbours are common on the ground itself: pairs of many values, or areas of several."""
    pairs = np.unique(areas.height[(areas.pixels > 1) & (areas.pixels < LEAST_AREA)])
    even = (areas.cliffs < _CLIFF_SHARE * areas.sides) & (areas.sides >= LEAST_AREA)
    even &= areas.pixels >= LEAST_AREA
    _, value = np.unique(areas.height[even], return_inverse=True)
    covered = np.sort(np.bincount(value, areas.pixels[even]))[:-1]  # without one that may be a void
    return bool(
        pairs.size > max(_PAIRS, _PAIR_SHARE * survey.looked)
        or covered.sum() > _STEPPED_GROUND * survey.looked
    )


def _is_broken_off(areas: FlatAreas) -> NDArray[np.bool_]:
    """Which areas of ground of steps are large, and end in a cliff."""
    broken = np.zeros(areas.pixels.shape, bool)
    for least, share in _STEPPED_CLIFF_SHARES:
        broken |= (areas.pixels >= least) & (areas.cliffs >= share * areas.sides)
    return broken & (areas.sides >= _LEAST_SIDES)


def _is_foreign(areas: FlatAreas) -> NDArray[np.bool_]:
    """Which areas of continuous ground are of a value whose areas end in cliffs."""
    large = areas.pixels >= LEAST_AREA
    _, value = np.unique(areas.height, return_inverse=True)
    pixels, sides, cliffs = (
        np.bincount(value, np.where(large, count, 0)) for count in (areas.pixels, areas.sides, areas.cliffs)
    )
    foreign = (pixels >= _LEAST_FOREIGN) & (sides >= _LEAST_SIDES) & (cliffs >= _CLIFF_SHARE * sides)
    return large & foreign[value]


def _find_spikes(survey: TileSurvey) -> Counter[float]:
    found: Counter[float] = Counter()
    for areas in survey.areas:
        lone = (areas.pixels < LEAST_AREA) & (areas.steps >= 2) & (areas.high_steps == areas.steps)
        found += _count(areas.height[lone], areas.pixels[lone])
    return found


def _count(heights: Array, pixels: NDArray[Any]) -> Counter[float]:
    found: Counter[float] = Counter()
    for height, count in zip(heights.tolist(), pixels.tolist(), strict=True):
        found[height] += int(count)
    return found
