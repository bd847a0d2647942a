"""Attitude as a unit quaternion, scalar first: it turns a vector of the body into the site frame.

q and -q are the same attitude. q' = q (0, rates)/2, with the rates in the body frame (Shuster, A Survey of
Attitude Representations, J. Astronautical Sciences 41(4), 1993).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import finite_vector


@compile_kernel
def rotate_into(attitude: Array, vector: Array, out: Array) -> None:
    """Write a body vector, seen from the site frame, into `out`, which is not `vector`.

    For a quaternion that is not of unit length the vector grows with the square of that length.
    """
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    along = x * vector[0] + y * vector[1] + z * vector[2]
    size = w * w - x * x - y * y - z * z
    out[0] = size * vector[0] + 2.0 * (along * x + w * (y * vector[2] - z * vector[1]))
    out[1] = size * vector[1] + 2.0 * (along * y + w * (z * vector[0] - x * vector[2]))
    out[2] = size * vector[2] + 2.0 * (along * z + w * (x * vector[1] - y * vector[0]))


@compile_kernel
def error_into(attitude: Array, wanted: Array, out: Array) -> None:
    """Write the turn from an attitude to a wanted one into `out`.

    Args:
        attitude: unit quaternion, shape (4,).
        wanted: unit quaternion, shape (4,).
        out: [rad] shape (3,): the rotation vector in the body frame, of length at most pi.
    """
    w, x, y, z = attitude[0], -attitude[1], -attitude[2], -attitude[3]
    scalar = w * wanted[0] - x * wanted[1] - y * wanted[2] - z * wanted[3]
    out[0] = w * wanted[1] + x * wanted[0] + y * wanted[3] - z * wanted[2]
    out[1] = w * wanted[2] - x * wanted[3] + y * wanted[0] + z * wanted[1]
    out[2] = w * wanted[3] + x * wanted[2] - y * wanted[1] + z * wanted[0]
    sine = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    # the shorter way round; for no turn at all the limit of angle / sine
    gain = 2.0 * math.atan2(sine, abs(scalar)) / sine if sine > 1e-12 else 2.0
    for axis in range(3):
        out[axis] *= gain if scalar >= 0.0 else -gain


@compile_kernel
def point_into(direction: Array, heading: float, out: Array) -> None:
    """Write the attitude with the body's z axis along a direction into `out`: a turn about z, then a tilt.

    Args:
        direction: shape (3,), site frame, not zero; straight down, the tilt is about east.
        heading: [rad] the turn about z.
        out: unit quaternion, shape (4,).
    """
    # relative to the largest component no square under- or overflows
    largest = max(abs(direction[0]), abs(direction[1]), abs(direction[2]))
    east, north, up = direction[0] / largest, direction[1] / largest, direction[2] / largest
    across = math.sqrt(east * east + north * north)
    tilt = math.atan2(across, up)
    cosine, sine = math.cos(0.5 * tilt), math.sin(0.5 * tilt)
    x = -sine * north / across if across > 0.0 else sine
    y = sine * east / across if across > 0.0 else 0.0
    turn, lean = math.cos(0.5 * heading), math.sin(0.5 * heading)
    out[0] = cosine * turn
    out[1] = x * turn + y * lean
    out[2] = y * turn - x * lean
    out[3] = cosine * lean


@compile_kernel
def heading_angle(attitude: Array) -> float:
    """[rad] the turn about z that an attitude, shape (4,), is made of before its tilt; 0 upside down."""
    if attitude[0] == 0.0 and attitude[3] == 0.0:
        return 0.0
    return 2.0 * math.atan2(attitude[3], attitude[0])


@compile_kernel
def tilt_angle(attitude: Array) -> float:
    """[rad] angle of the body's z axis from the vertical for an attitude, shape (4,)."""
    upright = math.sqrt(attitude[0] ** 2 + attitude[3] ** 2)
    return 2.0 * math.atan2(math.sqrt(attitude[1] ** 2 + attitude[2] ** 2), upright)


def attitude_along(direction: ArrayLike, heading: float = 0.0) -> Array:
    """The attitude with the body's z axis along a direction: a turn about z by the heading, then a tilt.

    Args:
        direction: shape (3,), site frame.
        heading: [rad].

    Returns:
        Unit quaternion, scalar first, shape (4,).

    Raises:
        ValueError: the direction is zero, not finite or of the wrong shape.
    """
    vector = finite_vector("direction", direction, 3)
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise ValueError("direction must not be zero")
    out = np.empty(4)
    point_into(vector / largest, float(heading), out)
    return out


def rotate(attitude: ArrayLike, vector: ArrayLike) -> Array:
    """A vector of the body, shape (3,), as the site frame sees it for a unit quaternion, shape (4,)."""
    out = np.empty(3)
    rotate_into(finite_vector("attitude", attitude, 4), finite_vector("vector", vector, 3), out)
    return out
