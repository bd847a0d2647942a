"""The safety map that the LIDAR gives at one look: the paper's Algorithm 2.

A square, axis-aligned window of 64 x 64 pixels, centred on the current target, width w = r_s tan(field of
view). Each pixel takes the probability of safety at the nearest cell of the true map, plus Gaussian noise in
proportion to the range, clipped to [0, 1]. Pixels seen too far from the vertical, and outside the map, read
0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.kernel import compile_vector_kernel
from guidance.validation import finite_number

_LINE = 16  # numbers of a cache line
_NO_LIMIT = 1e9  # tangent


@dataclass(frozen=True)
class Lidar:
    """The sensor model (paper, "Observation Data Generation").

    Attributes:
        field_of_view: [rad] w = range x tan(field_of_view).
        pixels: pixels along each side of the look.
        noise: standard deviation of the observed probability at `noise_range`, growing with range.
        noise_range: [m] range to which `noise` refers.
        off_nadir_limit: [rad] pixels further than this from the lander's vertical read 0 (slant angle under
            70 deg). On a rigid body it counts from the body's own axis.
        dropout: probability that a look comes without a map: every pixel reads 0.
    """

    field_of_view: float = math.radians(11.4)
    pixels: int = 64
    noise: float = 0.05
    noise_range: float = 500.0
    off_nadir_limit: float = math.radians(20.0)
    dropout: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        finite_number("field_of_view", self.field_of_view, above=0.0, at_most=math.radians(89.0))
        finite_number("noise", self.noise, at_least=0.0)
        finite_number("noise_range", self.noise_range, above=0.0)
        finite_number("off_nadir_limit", self.off_nadir_limit, above=0.0, at_most=math.radians(89.0))
        finite_number("dropout", self.dropout, at_least=0.0, at_most=1.0)
        if self.pixels < 2:
            raise ValueError(f"pixels must be at least 2, got {self.pixels}")

    def width(self, position: Array, target: Array) -> float:
        """[m] side of the field of view when `position` looks at `target`, both shape (3,)."""
        return float(np.linalg.norm(position - target)) * math.tan(self.field_of_view)


@compile_vector_kernel
def _fetch(probability: NDArray[np.float32], rows: Index, first: int, last: int) -> float:
    """Read one number of each cache line that a look needs, and give their sum.

    The look's own loop waits for one line after another of a map that is not in the cache; here many are on
    their way at once. Who calls it must use the sum: the compiler drops reads that nothing depends on.
    """
    total = 0.0
    for row in rows:
        if 0 <= row < probability.shape[0] and first <= last:
            line = probability[row]
            for column in range(first, last, _LINE):
                total += line[column]
            total += line[last]
    return total


@compile_vector_kernel
def look_into(
    position: Array,
    target: Array,
    probability: NDArray[np.float32],
    noise: NDArray[np.float32],
    sensor: tuple[float, float, float],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` with the observed map; arguments as of `look`.

    `sensor` is (width, noise per metre, tan off-nadir limit).
    """
    width, noise_per_metre, limit = sensor
    rows, columns = probability.shape
    n = out.shape[0]
    height = position[2] - target[2]
    reach_squared = (limit * height) ** 2
    row, column = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.uint64)
    across_east, across_north = np.empty(n), np.empty(n)
    first, last = columns, -1
    for k in range(n):
        x = target[0] + ((k + 0.5) / n - 0.5) * width
        y = target[1] + ((k + 0.5) / n - 0.5) * width
        place = math.floor(x)
        inside = 0 <= place < columns
        row[k], column[k] = math.floor(y), np.uint64(place if inside else 0)
        dx, dy = x - position[0], y - position[1]
        across_east[k], across_north[k] = dx * dx if inside else math.inf, dy * dy
        if inside:
            first, last = min(first, place), max(last, place)
    if _fetch(probability, row, first, last) < 0.0:
        return  # never, as no probability is negative
    true = np.empty(n, dtype=np.float32)
    for i in range(n):
        seen, drawn = out[i], noise[i]
        if not 0 <= row[i] < rows:
            for j in range(n):
                seen[j] = 0.0
            continue
        line = probability[row[i]]
        for j in range(n):
            true[j] = line[column[j]]
        for j in range(n):
            across = across_east[j] + across_north[i]
            deviation = noise_per_metre * math.sqrt(across + height * height)
            value = true[j] + deviation * drawn[j]
            value = value if value > 0.0 else 0.0
            value = value if value < 1.0 else 1.0
            seen[j] = value if across <= reach_squared else 0.0


def look(
    lidar: Lidar,
    position: Array,
    target: Array,
    probability: NDArray[np.float32],
    noise: NDArray[np.float32],
    axis: Array | None = None,
) -> NDArray[np.float32]:
    """Observe the safety map around `target` (Algorithm 2).

    Args:
        lidar: the sensor.
        position: [m] shape (3,), lander; above the target.
        target: [m] shape (3,), centre of the field of view, on the target plane.
        probability: shape (rows, columns), V_P of the true map at 1 m a cell; row 0 is the south edge.
        noise: standard normal, shape (pixels, pixels).
        axis: unit vector, shape (3,), that the limit counts from; straight down if left out.

    Returns:
        Shape (pixels, pixels) in [0, 1]; row i grows north, column j east.
    """
    out = np.empty((lidar.pixels, lidar.pixels), dtype=np.float32)
    sensor = (
        lidar.width(position, target),
        lidar.noise / lidar.noise_range,
        math.tan(lidar.off_nadir_limit) if axis is None else _NO_LIMIT,
    )
    look_into(position, target, probability, noise, sensor, out)
    if axis is not None:
        out[_beyond(lidar, position, target, axis)] = 0.0
    return out


def _beyond(lidar: Lidar, position: Array, target: Array, axis: Array) -> NDArray[np.bool_]:
    """Shape (pixels, pixels): which lie further than the limit from an axis, shape (3,)."""
    offset = ((np.arange(lidar.pixels) + 0.5) / lidar.pixels - 0.5) * lidar.width(position, target)
    rays = np.empty((lidar.pixels, lidar.pixels, 3))
    rays[..., 0] = target[0] - position[0] + offset
    rays[..., 1] = (target[1] - position[1] + offset)[:, None]
    rays[..., 2] = target[2] - position[2]
    return rays @ axis < math.cos(lidar.off_nadir_limit) * np.linalg.norm(rays, axis=2)
