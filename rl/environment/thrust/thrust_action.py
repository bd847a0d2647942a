"""What an agent that gives the thrust does and sees, for one flight or for many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from rl.environment.encoding import Layout, SeenFlight, clip_latent, encode_flights
from rl.inference.arrays import Array32
from rl.inference.latent import LATENT_SIZE

REACH = 5.0
"""[m/s^2] acceleration along each axis that an action of 1 asks for: half of what the engine can give."""

THRUST_ACTIONS = ("acceleration_x", "acceleration_y", "acceleration_z", "shift_x", "shift_y")
"""What each element of the action moves, in order."""

LOOK_ELEMENTS = ("look_age", "look_offset_x", "look_offset_y")
"""What follows the latent: how old the look is, and where its middle lies from the target."""


class LookPlace(NamedTuple):
    """The last look beside the present flight, of one flight or of many: the leading axes of every array.

    Attributes:
        latent: shape (..., 32), of its map.
        age: shape (..., 1), control periods flown since, over those between two looks.
        middle: [m] shape (..., 3), the target that it was centred on.
        width: [m] shape (..., 1).
    """

    latent: Array32
    age: Array
    middle: Array
    width: Array


def thrust_acceleration(actions: Array, gravity: Array) -> Array:
    """[m/s^2] thrust acceleration that actions ask for; 0 holds the velocity.

    Args:
        actions: shape (..., 5), within [-1, 1].
        gravity: [m/s^2] shape (3,).

    Returns:
        Shape (..., 3): REACH times the first three elements, less gravity. The vehicle multiplies it by its
        mass, and takes the nearest thrust within its limits.
    """
    return REACH * actions[..., :3] - gravity


def site_shift(actions: Array, width: Array, share: float) -> Array:
    """[m] shape (..., 3), by which a target moves under an action that is taken at a look.

    Args:
        actions: shape (..., 5), within [-1, 1].
        width: [m] shape (...), of the look.
        share: of the width that the target moves by at most.
    """
    shift = np.zeros((*actions.shape[:-1], 3))
    shift[..., :2] = share * actions[..., 3:] * np.asarray(width)[..., None]
    return shift


def encode_thrust_flights(
    layout: Layout, seen: SeenFlight, nominal_target: Array, look: LookPlace
) -> Array32:
    """What the agent sees: the flight now, the latent of the last look, its age and its place.

    Args:
        layout: which elements describe the flight.
        seen: the flight; its width is that of the last look.
        nominal_target: [m] shape (..., 3), first target of each episode.
        look: the last one.

    Returns:
        Shape (..., 47).
    """
    flight = encode_flights(layout, seen, nominal_target)
    offset = (look.middle - seen.target)[..., :2] / np.maximum(look.width, 1e-9)
    place = np.clip(np.concatenate([look.age, offset], axis=-1), -1.0, 1.0).astype(np.float32)
    return np.concatenate([flight, clip_latent(look.latent), place], axis=-1)


def thrust_vector_size(layout: Layout) -> int:
    """Numbers in what the agent sees."""
    return len(layout.elements) + LATENT_SIZE + len(LOOK_ELEMENTS)
