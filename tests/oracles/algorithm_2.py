"""The paper's Algorithm 2, the observed safety map, written for reading: one pixel after another.

Nothing here is shared with `hda`: the nearest cell is found by its distance, and the angle by trigonometry.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Sensor(NamedTuple):
    field_of_view: float = math.radians(11.4)
    pixels: int = 64
    noise: float = 0.05
    noise_range: float = 500.0
    off_nadir_limit: float = math.radians(20.0)


def nearest_cell(coordinate: float, cells: int) -> int:
    """Number of the cell of 1 m whose centre is nearest, along one axis."""
    return min(range(cells), key=lambda cell: abs(cell + 0.5 - coordinate))


def observe(
    sensor: Sensor,
    lander: NDArray[np.float64],
    target: NDArray[np.float64],
    probability: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Safety map seen by a lander that looks at `target`, (pixels, pixels), row north, column east."""
    rows, columns = probability.shape
    n = sensor.pixels
    slant_range = math.dist(lander, target)
    width = slant_range * math.tan(sensor.field_of_view)
    observed = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            x = target[0] + ((j + 0.5) / n - 0.5) * width
            y = target[1] + ((i + 0.5) / n - 0.5) * width
            pixel = (x, y, target[2])
            if not (0.0 <= x < columns and 0.0 <= y < rows):
                continue
            off_nadir = math.atan2(math.dist(pixel[:2], lander[:2]), lander[2] - target[2])
            if off_nadir > sensor.off_nadir_limit:
                continue
            deviation = sensor.noise * math.dist(pixel, lander) / sensor.noise_range
            value = probability[nearest_cell(y, rows), nearest_cell(x, columns)] + deviation * noise[i, j]
            observed[i, j] = min(max(value, 0.0), 1.0)
    return observed
