"""What the first look tells of the map, and a bound that is penalised by what the clairvoyant peeks at.

The ground of an episode is one tile of a split that anyone can generate, so what a policy may know of it
after the first look is the posterior over those tiles. It is computed up to the quadrature of how many first
targets each tile has. With any function V of tile and landing place, V(truth, s) - sum_j P(j | look) V(j, s)
has the mean zero, up to that quadrature, for every rule that settles s by the look: added to the loss, it
takes from the clairvoyant what knowing the tile is worth (Brown, Smith and Sun, Operations Research 58,
2010).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.special import log_ndtr, logsumexp

from guidance.arrays import Array
from hda.flight.episode import begin_flight, observe
from hda.ground.library import Ground, load_tile, tile_numbers
from hda.ground.tile import Tile
from hda.sensing.lidar import Lidar, look
from hda.task.first_target import offers_targets
from hda.task.observation import Observation
from hda.task.rules import StartConditions
from hda.task.scenario import Scenario

MOST_TILES = 100
"""A split with more tiles is not asked."""
_LATTICE = 10.0  # [m] greatest side of the squares in whose middles first targets are tried


def penalised_loss(loss: Array, weights: Array, truth: int, value: Array) -> float:
    """Least loss over all places, with the penalty for knowing the hypothesis that is true.

    Its mean over episodes is at most the loss of any rule that settles the place by what the weights are
    conditioned on. With `value` equal to `loss` it is their least expected loss, with zero the clairvoyant's.

    Args:
        loss: shape (m, n), of each place under each hypothesis; the row of the truth may hold bounds.
        weights: shape (m,), probability of each hypothesis given what is seen; they sum to one.
        truth: index of the one that holds.
        value: shape (m, n), the function that the penalty is built of: any.
    """
    peek = value[truth] - weights @ value
    return float((loss[truth] - peek).min())


def can_recognise(scenario: Scenario) -> bool:
    """Whether the posterior of the tiles is computed: there are few, and looks lie where they say."""
    preset, rules = scenario.preset, scenario.preset.rules
    exact = not (rules.navigation_position_error or rules.navigation_velocity_error or preset.navigation)
    few = len(tile_numbers(scenario.split, Ground(preset.terrain, preset.criteria))) <= MOST_TILES
    return exact and few and isinstance(preset.lidar, Lidar)


@dataclass(frozen=True, eq=False)
class Candidates:
    """The tiles of a split over which episodes begin, each as likely as any.

    Attributes:
        tiles: m of them.
        density: shape (m,), of a first target on each, up to one factor: one over its `target_share`.
    """

    tiles: tuple[Tile, ...]
    density: Array


def candidate_tiles(scenario: Scenario) -> Candidates:
    """The tiles that the episode may lie on, before anything is seen."""
    preset = scenario.preset
    return _candidates(Ground(preset.terrain, preset.criteria), scenario.split, preset.start)


@lru_cache(maxsize=2)
def _candidates(ground: Ground, split: str, start: StartConditions) -> Candidates:
    opened = (load_tile(ground, number, split) for number in tile_numbers(split, ground))
    tiles = tuple(tile for tile in opened if offers_targets(tile, start))
    return Candidates(tiles, np.array([1.0 / target_share(tile, start) for tile in tiles]))


def target_share(tile: Tile, start: StartConditions) -> float:
    """Share of the target area that is first targets, by the midpoint rule on squares of at most 10 m.

    Where it finds none, as much as one square: for tiles over which episodes begin.
    """
    area = start.target_area
    side = max(1, math.ceil((area.high - area.low) / _LATTICE))
    middles = area.low + (np.arange(side) + 0.5) * (area.high - area.low) / side
    found = sum(_is_target(tile, np.array(place), start) for place in product(middles, repeat=2))
    return max(found, 1) / side**2


def _is_target(tile: Tile, place: Array, start: StartConditions) -> bool:
    return tile.hazard_share(place, start.hazard_radius) >= start.hazard_share


def log_likelihoods(scenario: Scenario, candidates: Candidates) -> Array:
    """Log-likelihood of first target and first look over each tile, shape (m,), up to one constant.

    A tile on whose map the first target is not one, as the ground about it is too safe, has -inf.
    """
    seen = observe(scenario, begin_flight(scenario))
    start, target = scenario.preset.start, scenario.nominal_target
    return np.array(
        [
            _log_likelihood(scenario, seen, tile) + math.log(density)
            if _is_target(tile, target, start)
            else -math.inf
            for tile, density in zip(candidates.tiles, candidates.density, strict=True)
        ]
    )


def _log_likelihood(scenario: Scenario, seen: Observation, tile: Tile) -> float:
    lidar = scenario.preset.lidar
    if not isinstance(lidar, Lidar) or not seen.has_map:
        return 0.0
    position, offset = seen.state.position, seen.pixel_offset
    silent = np.zeros((lidar.pixels, lidar.pixels), dtype=np.float32)
    true = look(lidar, position, seen.target, tile.probability, silent).astype(np.float64)
    place = seen.target[:2, None] + offset - position[:2, None]
    across = place[0][None, :] ** 2 + place[1][:, None] ** 2
    height = float(position[2] - seen.target[2])
    visible = across <= (math.tan(lidar.off_nadir_limit) * height) ** 2
    deviation = lidar.noise / lidar.noise_range * np.sqrt(across + height**2)
    reading = seen.safety_map.astype(np.float64)
    off = (reading - true) / deviation
    between = -0.5 * off**2 - np.log(deviation) - 0.5 * math.log(2.0 * math.pi)
    at_end = log_ndtr(np.where(reading >= 1.0, -off, off))
    inside = (reading > 0.0) & (reading < 1.0)
    return float(np.where(inside, between, at_end)[visible].sum())


def weigh_tiles(log_likelihood: Array) -> Array:
    """Posterior of tiles that are equally likely before the look, shape (m,)."""
    return np.exp(log_likelihood - logsumexp(log_likelihood))


def log_odds(log_likelihood: Array, truth: int) -> float:
    """Natural logarithm of the odds that the look gives for the true tile against all others together."""
    others = np.delete(log_likelihood, truth)
    return float(log_likelihood[truth] - logsumexp(others)) if np.isfinite(others).any() else math.inf
