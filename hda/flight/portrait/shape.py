"""A lander's surface in triangles: descent stage, cabin, nozzle, four legs with pads, and the plume.

It stands for any lander of four legs and one engine: its proportions are chosen, its size is the circle
around its pads. Lengths are in diameters of that circle; the frame is the body's, z along the thrust, with
its origin on the ground between the pads, where the flights have the lander's place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.flight.palette import COLORS

PLUME_COLOR = COLORS[4]
_STAGE, _CABIN, _NOZZLE, _LEG = "#a3a3a3", "#d4d4d4", "#404040", "#5c5c5c"
NOZZLE = np.array([0.0, 0.0, 0.04])
"""Middle of its exit, which the plume hangs from."""
_EXIT = float(NOZZLE[2])
_EXIT_RADIUS = 0.09
_FULL_PLUME = 2.5  # its length at full thrust
_LEG_WIDTH = 0.025


class Surface(NamedTuple):
    """Triangles in space.

    Attributes:
        vertices: shape (n, 3).
        triangles: shape (m, 3), rows of `vertices`; counter-clockwise seen from outside.
        colors: of each triangle, `#rrggbb`.
    """

    vertices: Array
    triangles: NDArray[np.int64]
    colors: tuple[str, ...]


def lander_surface() -> Surface:
    """The lander without its plume."""
    parts = [
        _turned([(0.0, 0.14), (0.21, 0.14), (0.21, 0.32), (0.0, 0.32)], _STAGE, 8),
        _turned([(0.15, 0.32), (0.17, 0.40), (0.10, 0.48), (0.0, 0.48)], _CABIN, 8),
        _turned([(0.05, 0.14), (_EXIT_RADIUS, _EXIT), (0.0, _EXIT + 0.02)][::-1], _NOZZLE, 8),
    ]
    for quarter in range(4):
        angle = 0.25 * math.pi + 0.5 * math.pi * quarter
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        pad = _turned([(0.0, 0.0), (0.05, 0.0), (0.05, 0.02), (0.0, 0.02)], _LEG, 6)
        parts.append(pad._replace(vertices=pad.vertices + 0.45 * out))
        foot = 0.45 * out + [0.0, 0.0, 0.02]
        parts += [_strut(0.2 * out + [0.0, 0.0, height], foot) for height in (0.3, 0.16)]
    return _joined(parts)


def plume_surface(throttle: float) -> Surface:
    """The plume below the nozzle; its length is in proportion to the throttle, 2.5 diameters at full thrust.

    Args:
        throttle: thrust over the engine's greatest, not negative.
    """
    tip = _EXIT - _FULL_PLUME * throttle
    return _turned([(0.0, tip), (0.8 * _EXIT_RADIUS, _EXIT), (0.0, _EXIT)], PLUME_COLOR, 8)


def _turned(profile: list[tuple[float, float]], color: str, sides: int) -> Surface:
    """A profile of (radius, height) from bottom to top, turned about z."""
    angles = 2.0 * math.pi * (np.arange(sides) + 0.5) / sides
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(sides, z)]) for r, z in profile]
    triangles = []
    for ring in range(len(profile) - 1):
        for side in range(sides):
            low, high = ring * sides, (ring + 1) * sides
            after = (side + 1) % sides
            if profile[ring][0] > 0.0:
                triangles.append((low + side, low + after, high + side))
            if profile[ring + 1][0] > 0.0:
                triangles.append((low + after, high + after, high + side))
    return Surface(np.concatenate(rings), np.array(triangles), (color,) * len(triangles))


def _strut(top: Array, foot: Array) -> Surface:
    """A leg: a prism of three sides from its top to its foot, both shape (3,)."""
    along = (foot - top) / np.linalg.norm(foot - top)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    normal = np.cross(along, across)
    turns = 2.0 * math.pi * np.arange(3) / 3.0
    ring = 0.5 * _LEG_WIDTH * (np.outer(np.cos(turns), across) + np.outer(np.sin(turns), normal))
    triangles = []
    for side in range(3):
        after = (side + 1) % 3
        triangles += [(side, after, 3 + side), (after, 3 + after, 3 + side)]
    return Surface(np.concatenate([top + ring, foot + ring]), np.array(triangles), (_LEG,) * 6)


def _joined(parts: list[Surface]) -> Surface:
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Surface(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)]),
        tuple(color for part in parts for color in part.colors),
    )
