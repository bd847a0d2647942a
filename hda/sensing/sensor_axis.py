"""The axis that a sensor's field of regard is counted from: the vertical, or that of the body it rides on.

A sensor looks down along the body. On gimbals it turns to its target within a limit about that axis; fixed to
the body it sees what lies within half its field of view. Both are one cone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.quaternion import rotate

if TYPE_CHECKING:
    from hda.sensing.lidar import Lidar
    from hda.sensing.ranging import RangingLidar


def sensor_axis(attitude: Array) -> Array:
    """Unit vector, shape (3,), site frame: down along a body of an attitude, shape (4,)."""
    return -rotate(attitude, np.array([0.0, 0.0, 1.0]))


def cone_rim(axis: Array, limit: float, rays: int) -> Array:
    """Unit vectors along the edge of the cone about an axis.

    Args:
        axis: unit vector, shape (3,), site frame.
        limit: [rad] the cone's half-angle.
        rays: how many, evenly around; the last is the first again.

    Returns:
        Shape (rays, 3).
    """
    turns = np.linspace(0.0, 2.0 * np.pi, rays)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    around = np.outer(np.cos(turns), across) + np.outer(np.sin(turns), np.cross(axis, across))
    return np.cos(limit) * axis + np.sin(limit) * around


def is_fixed(sensor: Lidar | RangingLidar) -> bool:
    """Whether a sensor has no gimbals: it looks no further aside than its own field of view reaches."""
    return sensor.off_nadir_limit <= 0.5 * sensor.field_of_view * (1.0 + 1e-9)


@compile_kernel
def is_outside(axis: Array | None, limit: float, ray: tuple[float, float, float], across: float) -> bool:
    """Whether a ray leaves the cone about the axis.

    Args:
        axis: unit vector, shape (3,); None: straight down.
        limit: tangent of the cone's half-angle.
        ray: direction, of any length.
        across: horizontal length of the ray.
    """
    x, y, z = ray
    if axis is None:
        return across > -limit * z
    along = axis[0] * x + axis[1] * y + axis[2] * z
    return along <= 0.0 or x * x + y * y + z * z - along * along > (limit * along) ** 2
