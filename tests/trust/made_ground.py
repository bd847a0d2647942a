"""Elevation models made by chance: grounds, and voids that their files do not declare."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, zoom

from hda.task.presets import PRESETS
from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng

SIDES = (1.0, 2.0, 5.0, 10.0)
FILLS = (0.0, -9999.0, -32767.0, -32768.0, -3.4028234663852886e38, 65535.0, 1e20, 255.0, 32767.0, -1e30)
SHAPES = ("wedge", "corner", "disc", "line", "blobs", "rows", "frame", "blurred wedge")


@dataclass(frozen=True, eq=False)
class Case:
    """A square kilometre of heights [m], the side of its pixels [m], and what was done to it."""

    heights: np.ndarray
    side: float
    story: str
    void: np.ndarray
    fill: float = np.nan


@cache
def rough_ground(name: str) -> np.ndarray:
    """A tile of a preset's own ground; not to be written to."""
    terrain = PRESETS[name].terrain
    assert isinstance(terrain, TerrainParameters)
    return generate_terrain(terrain, terrain_rng(17))


def draw_ground(rng: np.random.Generator) -> Case:
    """Continuous or stepped ground without voids."""
    side = float(rng.choice(SIDES))
    pixels = round(1000 / side)
    kind = str(rng.choice(["paper", "hard", "smooth", "tracks", "steep"]))
    if kind in ("paper", "hard"):
        heights = rough_ground(kind)[:: round(side), :: round(side)][:pixels, :pixels].copy()
    elif kind == "tracks":  # most pixels are interpolated between a few that were measured
        coarse = np.asarray(gaussian_filter(rng.normal(size=(40, 40)), 2.0))
        heights = np.asarray(zoom(coarse, pixels / 40, order=1, grid_mode=True, mode="nearest"))
        heights *= rng.uniform(2.0, 40.0) / coarse.std()
    else:
        width = rng.uniform(10.0, 120.0)
        noise = np.asarray(gaussian_filter(rng.normal(size=(pixels, pixels)), width / side, mode="wrap"))
        slope_deg = rng.uniform(0.5, 10.0) if kind == "smooth" else rng.uniform(10.0, 30.0)
        heights = noise / noise.std() * width * np.tan(np.radians(slope_deg))  # RMS slope along an axis
        heights += rng.normal(size=heights.shape) * rng.choice([0.0, 0.02, 0.2])
    east, north = np.meshgrid(np.arange(pixels) * side, np.arange(pixels) * side)
    heights = heights + rng.uniform(-0.1, 0.1) * east + rng.uniform(-0.1, 0.1) * north
    heights += rng.uniform(-8000.0, 8000.0) * rng.integers(2)
    step = float(rng.choice([0.0, 0.0, 0.0, 0.1, 0.5, 1.0]))
    if step:
        heights = np.round(heights / step) * step
    repeat = int(rng.choice([1, 1, 1, 2, 5]))  # pixels made of larger ones, without interpolation
    repeat = min(repeat, round(10.0 / side))
    if repeat > 1:
        heights = np.repeat(np.repeat(heights[::repeat, ::repeat], repeat, axis=0), repeat, axis=1)
    whole = step == 1.0 and rng.integers(2)
    heights = heights.astype(rng.choice(["int16", "int32"]) if whole else rng.choice(["float32", "float64"]))
    story = f"{kind} ground, {side:g} m, {repeat}-fold, steps of {step:g} m, {heights.dtype}"
    return Case(heights, side, story, np.zeros(heights.shape, bool))


def draw_shape(rng: np.random.Generator, pixels: int) -> tuple[np.ndarray, str]:
    """Where the void lies."""
    row, column = np.mgrid[:pixels, :pixels]
    shape = str(rng.choice(SHAPES))
    share = rng.uniform(0.05, 0.6)
    if shape.endswith("wedge"):
        void = column < row * share
    elif shape == "corner":
        void = (row < share * pixels) & (column > (1.0 - share) * pixels)
    elif shape == "disc":
        center, radius = rng.uniform(0.2, 0.8, 2) * pixels, max(3.0, 0.3 * share * pixels)
        void = np.hypot(row - center[0], column - center[1]) < radius
    elif shape == "line":
        first = rng.integers(pixels - 5)
        void = (row >= first) & (row < first + rng.integers(1, 5))
    elif shape == "rows":  # up to where a tile is read in strips
        void = row < pixels // 10 * rng.integers(1, 5)
    elif shape == "frame":
        edge = max(2, round(0.1 * share * pixels))
        void = (np.minimum(row, column) < edge) | (np.maximum(row, column) >= pixels - edge)
    else:
        field = np.asarray(gaussian_filter(rng.normal(size=(pixels, pixels)), 8.0))
        void = field > np.quantile(field, 0.9)
    return (void if rng.integers(2) else void[::-1, ::-1]), shape


def put_void(rng: np.random.Generator, ground: Case) -> Case:
    """The ground with a void in it that no one declares."""
    heights, pixels = ground.heights, ground.heights.shape[0]
    void, shape = draw_shape(rng, pixels)
    fill = float(rng.choice(FILLS))
    if ground.heights.dtype.kind == "i":
        ends = np.iinfo(ground.heights.dtype)
        fill = float(rng.choice([value for value in FILLS if ends.min <= value <= ends.max]))
    filled = heights.copy()
    filled[void] = fill
    if shape == "blurred wedge" and abs(fill) < 1e5:  # resampled by one who did not know of the void
        shift = rng.uniform(0.2, 0.8, 2)
        places = np.mgrid[:pixels, :pixels] + shift[:, None, None]
        blurred = map_coordinates(filled.astype(np.float64), places, order=1, mode="nearest")
        filled = blurred.astype(heights.dtype)
        void = filled == np.array(fill).astype(heights.dtype)
    return Case(filled, ground.side, f"{ground.story}; {shape} of {fill:g}", void, fill)
