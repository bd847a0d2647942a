"""Where a ray meets a bilinear surface, found by walking along it in small steps.

Nothing here is shared with `hda`: the surface is scipy's, and the crossing is bracketed by steps and halved.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator


def find_ground(
    elevation: NDArray[np.float32],
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
    reach: float,
    step: float = 0.005,
) -> float:
    """[m] range of the first crossing from above, NaN if there is none over the map's cell centres."""
    rows, columns = elevation.shape
    surface = RegularGridInterpolator(
        (np.arange(rows) + 0.5, np.arange(columns) + 0.5), elevation.astype(float), bounds_error=False
    )

    distance = np.arange(0.0, reach, step)
    points = origin + distance[:, None] * direction
    height = points[:, 2] - surface(points[:, 1::-1])
    for k in range(1, distance.size):
        if height[k - 1] > 0.0 >= height[k]:
            low, high = distance[k - 1], distance[k]
            for _ in range(60):
                middle = 0.5 * (low + high)
                point = origin + middle * direction
                if point[2] - surface(point[1::-1])[0] > 0.0:
                    low = middle
                else:
                    high = middle
            return high
    return float("nan")
