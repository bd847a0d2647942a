"""Looks over one tile, and how many of their pixels say of the ground what is true."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.state import State
from hda.ground.library import Ground, load_tile
from hda.ground.tile import Tile
from hda.sensing.measured_look import MeasuredGround, measure_ground
from hda.sensing.ranging import RangingLidar, scan
from hda.task.first_target import draw_target
from hda.task.presets import Preset
from hda.task.random_streams import EpisodeStreams

_DESCENT_TIME = 30.0  # [s] range over speed: the ends of a flight of a minute at a constant deceleration


@dataclass(frozen=True)
class LookSeries:
    """How the looks of a study are taken.

    Attributes:
        preset: ground, first targets, criteria of the lander; its sensor is a ranging LIDAR.
        looks: per tile, each around another first target.
        off_nadir: [rad] angle of the line of sight from the vertical.
        threshold: least V_P that is called safe.
        study_seed: of the places and of the sensor's errors; the same at every range and number of rays.
    """

    preset: Preset
    looks: int
    off_nadir: float
    threshold: float
    study_seed: int


@dataclass(frozen=True)
class PixelCounts:
    """Pixels of the looks over one tile, the true verdict being that of the cell under the pixel's centre.

    Attributes:
        safe: truly safe.
        called: called safe.
        right: both.
        known: where the look gave a verdict at all.
        pixels: all of them.
    """

    safe: int
    called: int
    right: int
    known: int
    pixels: int


def sensor_of(preset: Preset) -> RangingLidar:
    """The ranging LIDAR of a preset.

    Raises:
        ValueError: its sensor gives no ranges.
    """
    if not isinstance(preset.lidar, RangingLidar):
        raise ValueError(f"preset must have a ranging LIDAR, such as lidar; {preset.name!r} has none")
    return preset.lidar


def take_look(
    lidar: RangingLidar, tile: Tile, state: State, target: Array, series: LookSeries, number: int
) -> MeasuredGround:
    """Look `number` of a series at a tile; the vehicle knows where it is."""
    streams = EpisodeStreams(series.study_seed, number)
    cloud = scan(lidar, tile.elevation, state, target, streams.scan(0, lidar.rays))
    return measure_ground(cloud, lidar, state.position, target, series.preset.criteria)


def place_look(series: LookSeries, tile: Tile, number: int, slant_range: float) -> tuple[State, Array]:
    """State of the vehicle and first target of a look; azimuth and target are the same at every range."""
    rng = np.random.default_rng([series.study_seed, tile.number, number])
    preset = series.preset
    target = draw_target(tile, preset.start, preset.terrain.maximum_elevation, rng)
    azimuth = rng.uniform(0.0, 2.0 * math.pi)
    across, up = math.sin(series.off_nadir), math.cos(series.off_nadir)
    line_of_sight = np.array([across * math.cos(azimuth), across * math.sin(azimuth), up])
    velocity = -slant_range / _DESCENT_TIME * line_of_sight
    return State(target + slant_range * line_of_sight, velocity, preset.start.mass.high), target


def count_pixels(series: LookSeries, tile_number: int, rays: int, slant_range: float) -> PixelCounts:
    """Take the looks of a series over one tuning tile from `slant_range` [m] and count their pixels."""
    lidar = replace(sensor_of(series.preset), rays=rays)
    tile = load_tile(Ground(series.preset.terrain, series.preset.criteria), tile_number, "tuning")
    safe = called = right = known = pixels = 0
    for number in range(series.looks):
        state, target = place_look(series, tile, number, slant_range)
        ground = take_look(lidar, tile, state, target, series, tile_number * series.looks + number)
        width = lidar.width(state.position, target)
        offset = ((np.arange(lidar.pixels) + 0.5) / lidar.pixels - 0.5) * width
        row, column = np.floor(target[1] + offset).astype(int), np.floor(target[0] + offset).astype(int)
        truth = tile.deterministic[np.ix_(row, column)]  # targets lie far enough inside a tile
        says = ground.safety_map(target, width, lidar.pixels) >= series.threshold
        safe += int(truth.sum())
        called += int(says.sum())
        right += int((truth & says).sum())
        known += int(ground.known_map(target, width, lidar.pixels).sum())
        pixels += says.size
    return PixelCounts(safe, called, right, known, pixels)
