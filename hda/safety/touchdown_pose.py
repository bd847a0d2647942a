"""The lander at rest on true ground: its stable planes, what is under its belly, and when it tips over."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from hda.safety.touchdown_stance import Footing, between_pads, pad_height


@dataclass(frozen=True, eq=False)
class Pose:
    """How the lander stands: on its higher diagonal, rocking between two planes.

    Attributes:
        slopes: [rad] shape (2,), angle of each stable plane from horizontal.
        normals: shape (2, 3), upward unit normal of each.
        roughness: [m] greatest distance of the ground between the pads above either plane; -inf where no
            cell's centre lies between them.
        known: whether all ground under the pads and between them is.
    """

    slopes: Array
    normals: Array
    roughness: float
    known: bool


def stand(footing: Footing, x: float, y: float) -> Pose:
    """Set the lander down at (x, y) [m].

    A pad without known ground stands as high as the highest other, or on the plane where there is none.
    """
    pads, radius = footing.pads, footing.pad_radius
    found = [pad_height(footing.elevation, x + east, y + north, radius) for east, north in pads.tolist()]
    known = all(complete for _, complete in found)
    heights = np.array([height for height, _ in found])
    others = heights[np.isfinite(heights)].max(initial=-np.inf)
    heights[~np.isfinite(heights)] = others if math.isfinite(others) else footing.plane
    centre, gradients = _stable_planes(pads, heights)
    offsets, ground = _ground_between(footing, x, y)
    known = known and bool(np.isfinite(ground).all())
    secants = np.sqrt(1.0 + (gradients**2).sum(axis=1))
    above = (ground[:, None] - centre - offsets @ gradients.T) / secants
    roughness = float(np.max(above[np.isfinite(ground)], initial=-np.inf))
    normals = np.column_stack([-gradients, np.ones(2)]) / secants[:, None]
    return Pose(np.arctan(np.sqrt((gradients**2).sum(axis=1))), normals, roughness, known)


def _stable_planes(pads: Array, heights: Array) -> tuple[float, Array]:
    """Height of both stable planes at the axis, and their gradients, shape (2, 2): each holds three pads."""
    first, second = 0.5 * (heights[0] + heights[2]), 0.5 * (heights[1] + heights[3])
    k = 0 if first >= second else 1  # the higher diagonal carries the lander
    centre = max(first, second)
    square = float((pads[0] ** 2).sum())
    along = 0.5 * (heights[k] - heights[k + 2]) * pads[k]
    other, opposite = (k + 1) % 4, (k + 3) % 4
    across = [(heights[other] - centre) * pads[other], (centre - heights[opposite]) * pads[other]]
    return float(centre), (along + np.array(across)) / square


def _ground_between(footing: Footing, x: float, y: float) -> tuple[Array, Array]:
    """Cells' centres between the pads, shape (n, 2) from the axis, and their heights, NaN off the map."""
    rows, columns = footing.elevation.shape
    reach = float(np.hypot(*footing.pads[0]))
    offsets, heights = [], []
    for row in range(math.floor(y - reach), math.floor(y + reach) + 1):
        for column in range(math.floor(x - reach), math.floor(x + reach) + 1):
            east, north = column + 0.5 - x, row + 0.5 - y
            if between_pads(footing.pads, east, north):
                inside = 0 <= row < rows and 0 <= column < columns
                offsets.append((east, north))
                heights.append(float(footing.elevation[row, column]) if inside else math.nan)
    return np.array(offsets).reshape(-1, 2), np.array(heights)


@dataclass(frozen=True)
class TippingBody:
    """What decides whether a lander tips over.

    Attributes:
        height: [m] of its centre of mass above the pads' plane.
        inertia: [kg m^2] about a horizontal axis through its centre of mass.
        edge_distance: [m] from its axis to the line through two neighbouring pads.
        mass: [kg].
    """

    height: float
    inertia: float
    edge_distance: float
    mass: float


def tip_over_speed(body: TippingBody, slope: float, gravity: float) -> float:
    """[m/s] speed along the ground above which the lander tips over when two pads catch on it.

    The momentum m v at the centre of mass becomes a rotation about the pads' line; its energy must lift the
    centre of mass over that line. Worst case: the lander moves downhill, nothing gives, and the fall onto the
    other pads does not help.

    Args:
        body: the lander.
        slope: [rad] of the plane that it stands on.
        gravity: [m/s^2] positive.

    Returns:
        The speed; 0 where it does not even stand.
    """
    arm = math.hypot(body.height, body.edge_distance)
    margin = math.atan2(body.edge_distance, body.height) - slope
    if margin <= 0.0:
        return 0.0
    lift = body.mass * gravity * arm * (1.0 - math.cos(margin))
    return math.sqrt(2.0 * (body.inertia + body.mass * arm * arm) * lift) / (body.mass * body.height)
