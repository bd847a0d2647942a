"""What an elevation model with posts of metres cannot show, drawn and added: small craters, rocks, relief.

An orbiter's model shows no rock and no crater under about five posts, which are what a lander must avoid.
What is added leaves the mean over each post as it is. The fractal part goes on with the slopes of the model
itself: on self-affine ground the RMS slope over a length L is s(L) = s(L0) (L / L0)^(H - 1). Every tile has
streams of its own, so that neither their order nor the number of workers counts.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.validation import unknown_name
from hda.ground.post_means import PostAxis, remove_post_means
from hda.terrain.base_surface import BaseSurface, generate_base_surface
from hda.terrain.craters import CraterPopulation, DepthLaw, crater_relief, draw_craters
from hda.terrain.rock_clusters import RockClusters, gather_rocks
from hda.terrain.rocks import RockPopulation, draw_rocks, rock_heights, rock_margin
from hda.terrain.settings import ROCK_ABUNDANCES

SMALLEST_CRATER = 1.0
"""[m] diameter; a smaller one is less than a cell."""

LARGEST_CRATER = 4.5
"""[posts] diameter; larger ones are in the model."""

LONGEST_WAVE = 2.0
"""[posts] of the fractal relief; longer waves are in the model."""

ADDED_CRATER = 1
ADDED_ROCK = 2
"""Bits of the mask of what was added."""

_SEEN = 0.01  # [m] a crater that changes a cell by less is not marked there
_STEPS = (2, 8)  # [posts] over which the slopes of the model are measured
_HURST_RANGE = (0.5, 0.95)
_NORMAL_MEDIAN = 0.6745  # of the size of a standard normal number
_FLAT_HURST = 0.8  # of ground without relief: any


@dataclass(frozen=True)
class GroundDetail:
    """What is added to an elevation model with posts of more than 1 m.

    Attributes:
        seed: of all that is drawn, at least zero.
        rock_abundance: sparse, medium or dense: `hda.terrain.settings.ROCK_ABUNDANCES`.

    Raises:
        ValueError: the seed is no whole number of at least 0, or there is no such abundance.
    """

    seed: int
    rock_abundance: str = "medium"

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn."""
        if isinstance(self.seed, bool) or not isinstance(self.seed, int | np.integer) or self.seed < 0:
            raise ValueError(f"detail must be a seed, a whole number of at least 0, got {self.seed!r}")
        if self.rock_abundance not in ROCK_ABUNDANCES:
            raise ValueError(unknown_name("rock abundance", self.rock_abundance, ROCK_ABUNDANCES))

    @property
    def rocks(self) -> RockPopulation:
        """Sizes and abundance of the rocks."""
        return ROCK_ABUNDANCES[self.rock_abundance]

    def craters(self, post: float) -> CraterPopulation:
        """Craters too small for posts of this side [m]: Trask's number, Stopar's depths."""
        return CraterPopulation(
            minimum_diameter=SMALLEST_CRATER,
            maximum_diameter=LARGEST_CRATER * post,
            depth_law=DepthLaw.STOPAR,
        )

    def description(self, post: float) -> dict[str, Any]:
        """All that decides what is added to a model with posts of this side [m]."""
        return {
            "seed": self.seed,
            "rock_abundance": self.rock_abundance,
            "rocks": asdict(self.rocks),
            "rock_clusters": asdict(RockClusters()),
            "craters": asdict(self.craters(post)),
            "longest_wave": LONGEST_WAVE * post,
        }


@dataclass(frozen=True, eq=False)
class AddedGround:
    """What was added to a tile.

    Attributes:
        relief: [m] shape (rows, columns), to be added to the heights.
        kinds: shape (rows, columns), bits `ADDED_CRATER` and `ADDED_ROCK`: what lies in the cell. Fractal
            relief is everywhere.
    """

    relief: Array
    kinds: NDArray[np.uint8]


def measure_surface(posts: Array, side: float) -> BaseSurface:
    """The self-affine surface that goes on below the posts of a model: its slope at 1 m, and its exponent.

    The model's best plane is no roughness. Differences of height are measured over two and over eight posts,
    by their median, as planetary slopes are (Rosenburg et al. 2011, JGR 116): the few steep walls of craters
    would otherwise decide for the ground between them. Ground with normal differences of that median is
    continued. The exponent is kept within 0.5 and 0.95.

    Args:
        posts: [m] shape (rows, columns), NaN where unknown.
        side: [m] of a post.
    """
    place = np.indices(posts.shape).astype(np.float64)
    row, column = place[0], place[1]
    known = np.isfinite(posts)
    places = np.column_stack([row[known], column[known], np.ones(int(known.sum()))])
    (north, east, level), *_ = np.linalg.lstsq(places, posts[known], rcond=None)
    rough = posts - (north * row + east * column + level)
    near, far = (_typical_difference(rough, step) for step in _STEPS)
    hurst = _FLAT_HURST
    if near > 0.0 and far > 0.0:
        hurst = float(np.clip(math.log(far / near) / math.log(_STEPS[1] / _STEPS[0]), *_HURST_RANGE))
    slope = near * (_STEPS[0] * side) ** -hurst
    return BaseSurface(hurst, min(math.atan(slope), math.radians(60.0)))


def _typical_difference(heights: Array, step: int) -> float:
    """[m] Standard deviation of normal differences over `step` posts with the median that these have."""
    parts = (heights[:, step:] - heights[:, :-step], heights[step:] - heights[:-step])
    differences = np.concatenate([np.abs(part[np.isfinite(part)]) for part in parts])
    return float(np.median(differences)) / _NORMAL_MEDIAN if differences.size else 0.0


def draw_detail(
    detail: GroundDetail, surface: BaseSurface, north: PostAxis, east: PostAxis, post: float, tile: int
) -> AddedGround:
    """Draw what is added to one tile, over all cells of the posts that touch it.

    Fractal relief, craters and rocks draw from streams of their own: other rocks leave the craters in place.

    Args:
        detail: what is added.
        surface: that goes on below the posts.
        north: posts along the rows.
        east: posts along the columns.
        post: [m] side of a post.
        tile: its number, which keys the streams.

    Returns:
        Arrays of shape (north.cells, east.cells); the relief has a mean of zero over each post.
    """
    seeds = np.random.SeedSequence(detail.seed, spawn_key=(tile,)).spawn(3)
    fractal_rng, crater_rng, rock_rng = (np.random.default_rng(seed) for seed in seeds)
    size = max(north.cells, east.cells)
    fractal = generate_base_surface(surface, size, 1.0, fractal_rng, LONGEST_WAVE * post)
    population = detail.craters(post)
    craters = crater_relief(
        draw_craters(population, float(size), crater_rng), size, 1.0, population.ejecta_reach
    )
    rocks = draw_rocks(detail.rocks, float(size), rock_rng)
    margin = rock_margin(detail.rocks)
    blocks = rock_heights(gather_rocks(rocks, RockClusters(), float(size), margin, rock_rng), size, 1.0)
    part = np.s_[: north.cells, : east.cells]
    fractal, craters, blocks = fractal[part], craters[part], blocks[part]
    kinds = np.where(np.abs(craters) >= _SEEN, ADDED_CRATER, 0) + np.where(blocks > 0.0, ADDED_ROCK, 0)
    relief = remove_post_means(fractal.astype(np.float64) + craters + blocks, north, east)
    return AddedGround(relief, kinds.astype(np.uint8))
