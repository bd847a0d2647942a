"""The observation vector of the agents: named elements with fixed physical scales, no running statistics.

Each element is (value - center) / scale, clipped to its bounds. The scales are constants of this version,
so a vector means the same in every run; weights carry the version and the layout that they were trained
with.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.task.observation import Observation
from rl.inference.arrays import Array32

ENCODING_VERSION = 1
LATENT_BOUND = 8.0


@dataclass(frozen=True)
class Element:
    """One element of the vector.

    Attributes:
        name: what it is.
        center: physical value that is encoded as 0.
        scale: physical difference that is encoded as 1.
        low: least encoded value.
        high: greatest encoded value.
        curved: the encoded value x becomes asinh(x) / 2: fine near the center, coarse far from it.
    """

    name: str
    center: float
    scale: float
    low: float
    high: float
    curved: bool = False


@dataclass(frozen=True)
class Layout:
    """Which elements stand before the 32 latent numbers.

    Attributes:
        name: name in weight cards.
        elements: in order.
        constant: names of the elements that never change, because every target lies on one plane.
    """

    name: str
    elements: tuple[Element, ...]
    constant: tuple[str, ...]

    @cached_property
    def center(self) -> Array:
        """Shape (k,)."""
        return np.array([element.center for element in self.elements])

    @cached_property
    def scale(self) -> Array:
        """Shape (k,)."""
        return np.array([element.scale for element in self.elements])

    @cached_property
    def curved(self) -> NDArray[np.bool_]:
        """Which elements are curved, shape (k,)."""
        return np.array([element.curved for element in self.elements])

    @cached_property
    def low(self) -> Array32:
        """Least encoded values, shape (k,)."""
        return np.array([element.low for element in self.elements], dtype=np.float32)

    @cached_property
    def high(self) -> Array32:
        """Greatest encoded values, shape (k,)."""
        return np.array([element.high for element in self.elements], dtype=np.float32)

    def scaled(self, values: Array) -> Array32:
        """Encode the physical values of the elements, shape (..., k)."""
        scaled = (values - self.center) / self.scale
        scaled[..., self.curved] = 0.5 * np.arcsinh(scaled[..., self.curved])
        return np.clip(scaled, self.low, self.high).astype(np.float32)


_VELOCITY = (
    Element("velocity_x", 0.0, 20.0, -5.0, 5.0),
    Element("velocity_y", 0.0, 20.0, -5.0, 5.0),
    Element("velocity_z", -20.0, 20.0, -5.0, 5.0),
)
_MASS = Element("mass", 1175.0, 25.0, -8.0, 8.0)

RELATIVE = Layout(
    "relative",
    (
        Element("offset_x", 0.0, 200.0, -8.0, 8.0),
        Element("offset_y", 0.0, 200.0, -8.0, 8.0),
        Element("height", 450.0, 450.0, -1.0, 8.0),
        *_VELOCITY,
        _MASS,
        Element("width", 100.0, 100.0, -1.0, 8.0),
        Element("time_to_go", 20.0, 20.0, -2.0, 8.0),
        Element("diversion_x", 0.0, 100.0, -8.0, 8.0),
        Element("diversion_y", 0.0, 100.0, -8.0, 8.0),
        Element("diversion_z", 0.0, 100.0, -8.0, 8.0),
    ),
    ("diversion_z",),
)
"""Position relative to the current target, velocity, mass, width of the look, time to go, and how far the
target has been moved from the first one."""

CURVED = Layout(
    "curved",
    (
        Element("offset_x", 0.0, 5.0, -8.0, 8.0, curved=True),
        Element("offset_y", 0.0, 5.0, -8.0, 8.0, curved=True),
        Element("height", 0.0, 5.0, -1.0, 8.0, curved=True),
        Element("velocity_x", 0.0, 2.0, -8.0, 8.0, curved=True),
        Element("velocity_y", 0.0, 2.0, -8.0, 8.0, curved=True),
        Element("velocity_z", 0.0, 2.0, -8.0, 8.0, curved=True),
        _MASS,
        Element("width", 0.0, 2.0, -1.0, 8.0, curved=True),
        Element("time_to_go", 0.0, 1.0, -8.0, 8.0, curved=True),
        *RELATIVE.elements[9:],
    ),
    ("diversion_z",),
)
"""The elements of RELATIVE, fine near the ground, where metres and tenths of a second decide."""

PRINTED = Layout(
    "printed",
    (
        Element("position_x", 500.0, 500.0, -8.0, 8.0),
        Element("position_y", 500.0, 500.0, -8.0, 8.0),
        Element("position_z", 500.0, 450.0, -2.0, 8.0),
        *_VELOCITY,
        _MASS,
        Element("width_x", 100.0, 100.0, -1.0, 8.0),
        Element("width_y", 100.0, 100.0, -1.0, 8.0),
        Element("target_x", 500.0, 500.0, -8.0, 8.0),
        Element("target_y", 500.0, 500.0, -8.0, 8.0),
        Element("target_z", 50.0, 500.0, -8.0, 8.0),
    ),
    ("target_z",),
)
"""The vector that the paper prints: absolute position, two equal widths, absolute target, no time to go."""

LAYOUTS = {layout.name: layout for layout in (RELATIVE, CURVED, PRINTED)}


class SeenFlight(NamedTuple):
    """All that is seen but the map, of one flight or of many: the leading axes of every array.

    Attributes:
        position: [m] shape (..., 3), estimated.
        velocity: [m/s] shape (..., 3), estimated.
        mass: [kg] shape (..., 1).
        width: [m] shape (..., 1), of the look.
        time_to_go: [s] shape (..., 1).
        target: [m] shape (..., 3).
    """

    position: Array
    velocity: Array
    mass: Array
    width: Array
    time_to_go: Array
    target: Array


def encode_flights(layout: Layout, seen: SeenFlight, nominal_target: Array) -> Array32:
    """Encode all that is seen but the map.

    Heights count as if the target lay on the plane of the first one: on measured ground as on the plane.

    Args:
        layout: which elements.
        seen: of one flight or of many.
        nominal_target: [m] shape (..., 3), first target of each episode.

    Returns:
        Shape (..., 12).
    """
    lift = np.zeros_like(seen.target)
    lift[..., 2] = seen.target[..., 2] - nominal_target[..., 2]
    position, target = seen.position - lift, seen.target - lift
    if layout is not PRINTED:
        clock = seen.width, seen.time_to_go
        parts = position - target, seen.velocity, seen.mass, *clock, target - nominal_target
    else:
        parts = position, seen.velocity, seen.mass, seen.width, seen.width, target
    return layout.scaled(np.concatenate(parts, axis=-1))


def encode_flight(layout: Layout, observation: Observation, nominal_target: Array) -> Array32:
    """Encode all of an observation but its map: shape (12,).

    Args:
        layout: which elements.
        observation: what was seen.
        nominal_target: [m] shape (3,), first target of the episode.
    """
    return encode_flights(layout, seen_flight(observation), nominal_target)


def seen_flight(observation: Observation) -> SeenFlight:
    """All of an observation but its map."""
    state = observation.state
    mass, width, clock = np.array([[state.mass], [observation.width], [observation.time_to_go]])
    return SeenFlight(state.position, state.velocity, mass, width, clock, observation.target)


def encode_observation(
    layout: Layout,
    observation: Observation,
    nominal_target: Array,
    latent: Array32,
) -> Array32:
    """Join the encoded flight and the latent of the map: shape (44,)."""
    return np.concatenate([encode_flight(layout, observation, nominal_target), clip_latent(latent)])


def clip_latent(latent: Array32) -> Array32:
    """The latent of a map as it stands in the vector, shape (..., 32)."""
    return np.clip(latent, -LATENT_BOUND, LATENT_BOUND)


@compile_kernel
def map_into(safety_map: Array32, out: NDArray[np.uint8]) -> None:
    """Write a safety map times 255 into `out`, of the same shape."""
    for i in range(safety_map.shape[0]):
        for j in range(safety_map.shape[1]):
            out[i, j] = np.uint8(np.rint(safety_map[i, j] * np.float32(255.0)))


def encode_map(safety_map: Array32) -> NDArray[np.uint8]:
    """A safety map times 255, shape (pixels, pixels)."""
    out = np.empty(safety_map.shape, np.uint8)
    map_into(safety_map, out)
    return out
