"""What an agent sees: the flight, and beside it the last look or the belief that all looks have left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import unknown_name
from hda.policies.beliefs.belief import GroundBelief
from hda.policies.hazard_aware import fuse_look, judge_ground, load_kernels
from hda.sensing.ranging import RangingLidar
from hda.task.observation import Observation, ScenarioView
from rl.environment.encoding import LATENT_BOUND, Layout, clip_latent, encode_flight, encode_observation
from rl.inference.arrays import Array32
from rl.inference.latent import LATENT_SIZE
from rl.inference.networks import MapEncoder

_PIXELS = 64
_BLOCKS = 4
_NEAR = 16.0  # [m] chosen: 4 pixels a cell; a look of the last metres shows few
_WIDE = 2.0  # times the width, chosen: twice the ground of a look, for what lies beyond its edge


class Sight(Protocol):
    """Turns observations into vectors. Memory goes in and comes out."""

    @property
    def bounds(self) -> tuple[Array32, Array32]:
        """Least and greatest values of the vector, each shape (o,)."""
        ...

    def begin(self, view: ScenarioView) -> Any:
        """Memory before the first look."""
        ...

    def see(self, observation: Observation, memory: Any) -> tuple[Array32, Any]:
        """The vector of a look, shape (o,), and the memory for the next."""
        ...


@dataclass(frozen=True, eq=False)
class LookSight:
    """The flight and the latent of the last look: 44 numbers.

    Attributes:
        layout: which elements describe the flight.
        encoder: makes the latent of a map.
    """

    layout: Layout
    encoder: MapEncoder

    @property
    def bounds(self) -> tuple[Array32, Array32]:
        """Of the elements, then of the latent."""
        bound = np.full(LATENT_SIZE, LATENT_BOUND, np.float32)
        return np.concatenate([self.layout.low, -bound]), np.concatenate([self.layout.high, bound])

    def begin(self, view: ScenarioView) -> Array:
        """The first target."""
        return view.nominal_target

    def see(self, observation: Observation, memory: Array) -> tuple[Array32, Array]:
        """Encode the look."""
        latent = self.encoder.encode(observation.safety_map)
        return encode_observation(self.layout, observation, memory, latent), memory


class BeliefMemory(NamedTuple):
    """What is remembered of the looks so far.

    Attributes:
        view: the scenario.
        belief: from all looks; None before the first.
    """

    view: ScenarioView
    belief: GroundBelief | None = None


@dataclass(frozen=True, eq=False)
class BeliefSight:
    """The flight and the fused belief about the target: 92 numbers.

    The belief is that of `hda.policies.hazard_aware`: the probability that each 1 m cell is safe, from every
    look so far, and inferred from its surroundings where none has read it. After the 12 elements of the
    flight stand the latent of its picture over the look's width (16 m at least), that of its picture over
    twice that, and of 4 x 4 blocks of the wider square, from the south-west, the share of cells that have
    been read: about one in nine under the first look, whose pixels lie 3 m apart, and all near the ground.

    Attributes:
        layout: which elements describe the flight.
        encoder: makes the latent of a picture, with the weights that it learnt on looks.
    """

    layout: Layout
    encoder: MapEncoder

    @property
    def bounds(self) -> tuple[Array32, Array32]:
        """Of the elements, of both latents, then of the shares."""
        bound = np.full(2 * LATENT_SIZE, LATENT_BOUND, np.float32)
        nothing, all_of_it = np.zeros(_BLOCKS**2, np.float32), np.ones(_BLOCKS**2, np.float32)
        low = np.concatenate([self.layout.low, -bound, nothing])
        return low, np.concatenate([self.layout.high, bound, all_of_it])

    def begin(self, view: ScenarioView) -> BeliefMemory:
        """Nothing seen yet; the kernels of the belief are loaded here."""
        load_kernels(ranging=isinstance(view.lidar, RangingLidar))
        return BeliefMemory(view)

    def see(self, observation: Observation, memory: BeliefMemory) -> tuple[Array32, BeliefMemory]:
        """Fuse the look, and encode what is believed now."""
        view = memory.view
        belief = fuse_look(observation, view, memory.belief)
        safe, seen = judge_ground(belief), belief.seen
        width = max(observation.width, _NEAR)
        place = (
            float(observation.target[0]) - belief.corner[0],
            float(observation.target[1]) - belief.corner[1],
        )
        wide = (*place, _WIDE * width)
        pictures = picture_window(safe, (*place, width)), picture_window(safe, wide)
        latents = [clip_latent(self.encoder.encode(picture)) for picture in pictures]
        share = share_read(seen, wide)
        flight = encode_flight(self.layout, observation, view.nominal_target)
        return np.concatenate([flight, *latents, share.ravel()]), BeliefMemory(view, belief)


@compile_kernel
def picture_window(cells: Array32, window: tuple[float, float, float]) -> Array32:
    """Read a square window of a field of 1 m cells at pixels, as a look reads the map: the nearest cell each.

    Args:
        cells: shape (n, n), row grows north, column east.
        window: x and y of its middle from the cells' south-west corner, and its width [m].

    Returns:
        Shape (64, 64); 0 outside the cells.
    """
    x, y, width = window
    picture = np.zeros((_PIXELS, _PIXELS), np.float32)
    for i in range(_PIXELS):
        row = int(np.floor(y + ((i + 0.5) / _PIXELS - 0.5) * width))
        for j in range(_PIXELS):
            column = int(np.floor(x + ((j + 0.5) / _PIXELS - 0.5) * width))
            if 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1]:
                picture[i, j] = cells[row, column]
    return picture


@compile_kernel
def share_read(seen: NDArray[np.bool_], window: tuple[float, float, float]) -> Array32:
    """The share of cells that have been read, in blocks of a square window.

    Args:
        seen: shape (n, n), whether a cell has been read.
        window: as of `picture_window`, at least 8 m wide.

    Returns:
        Shape (4, 4); cells beyond those given count as not read.
    """
    x, y, width = window
    south, west = y - 0.5 * width, x - 0.5 * width
    read, cells = np.zeros((_BLOCKS, _BLOCKS)), np.zeros((_BLOCKS, _BLOCKS))
    for row in range(int(np.floor(south)), int(np.ceil(south + width))):
        i = int(np.floor((row + 0.5 - south) / width * _BLOCKS))
        if 0 <= i < _BLOCKS:
            for column in range(int(np.floor(west)), int(np.ceil(west + width))):
                j = int(np.floor((column + 0.5 - west) / width * _BLOCKS))
                if 0 <= j < _BLOCKS:
                    cells[i, j] += 1.0
                    inside = 0 <= row < seen.shape[0] and 0 <= column < seen.shape[1]
                    if inside and seen[row, column]:
                        read[i, j] += 1.0
    return (read / cells).astype(np.float32)


SIGHTS = {"look": LookSight, "belief": BeliefSight}


def make_sight(name: str, layout: Layout, encoder: MapEncoder) -> LookSight | BeliefSight:
    """Make one by name.

    Raises:
        ValueError: there is none of that name.
    """
    if name not in SIGHTS:
        raise ValueError(unknown_name("sight", name, SIGHTS))
    return SIGHTS[name](layout, encoder)
