"""The lander on a flat picture: as a sign beside its path, and close by with its sensor's reach.

It is seen without perspective. Its size on the paper says nothing of its size on the ground: at 900 m it
would be a speck.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from guidance.arrays import Array
from hda.flight.palette import COLORS
from hda.flight.portrait.pose import LanderPose
from hda.flight.portrait.shape import NOZZLE, Surface, lander_surface, plume_surface
from hda.sensing.sensor_axis import cone_rim, sensor_axis
from hda.task.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection

_LIGHT = np.array([-0.4, -0.5, 0.77])  # towards it, site frame
_SHADE = 0.55  # of a surface that is turned away from the light
_LIFT = math.radians(12.0)  # of the eye above the horizon, beside the lander
_BESIDE = (-1.8, 1.8, -2.45, 1.15)  # [diameters] what a close picture shows
_REACH = 2.3  # [diameters] of the drawn cone, and of the line towards the site
_NEAR = 1.0  # [m] from its site, where a lander looks at it no more
CONE_COLOR = COLORS[5]


class View(NamedTuple):
    """From where the lander is seen.

    Attributes:
        right: unit vector, shape (3,), site frame, that points to the right on the paper.
        up: unit vector, shape (3,), that points up there.
    """

    right: Array
    up: Array

    def flat(self, points: Array) -> Array:
        """Points, shape (n, 3), on the paper, shape (n, 2)."""
        return points @ np.column_stack(self)


FROM_ABOVE = View(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def view_beside(scenario: Scenario) -> View:
    """The view across the way from the start to the first target, which lies left, from 12 deg above."""
    way = scenario.initial_state.position[:2] - scenario.nominal_target[:2]
    east, north = way / np.linalg.norm(way) if way.any() else (1.0, 0.0)
    right, ahead = np.array([east, north, 0.0]), np.array([-north, east, 0.0])
    return View(right, math.cos(_LIFT) * np.array([0.0, 0.0, 1.0]) + math.sin(_LIFT) * ahead)


def draw_sign(axis: Axes, pose: LanderPose, view: View, place: tuple[float, float], inches: float) -> None:
    """Draw the lander at a place of a picture, in one size whatever the picture's scale.

    Args:
        axis: where.
        pose: how it stands.
        view: from where it is seen.
        place: of the ground between its pads, in the picture's own units.
        inches: on the paper, of the circle around its pads.
    """
    drawn = _draw(pose, view, inches)
    drawn.set(offsets=[place], offset_transform=axis.transData)
    figure = axis.get_figure(root=True)
    assert figure is not None
    drawn.set_transform(figure.dpi_scale_trans)
    drawn.set_in_layout(False)
    axis.add_collection(drawn, autolim=False)


def draw_close(axis: Axes, pose: LanderPose, scenario: Scenario, site: Array) -> None:
    """Draw the lander close by: how it leans, its plume, its sensor's cone, and the line towards its site.

    Args:
        axis: where; it loses its ticks.
        pose: how it stands.
        scenario: what is flown.
        site: [m] shape (3,), where it flies to.
    """
    view = view_beside(scenario)
    down, limit = _sensor(pose, scenario)
    rim = view.flat(_REACH * np.vstack([np.zeros(3), cone_rim(down, limit, 60)]))
    axis.fill(*_hull(rim).T, color=CONE_COLOR, alpha=0.3, linewidth=0.0, label="sensor's reach")
    axis.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
    axis.axvline(0.0, color="0.8", linewidth=0.8, zorder=0)
    way = site - pose.position
    if (distance := float(np.linalg.norm(way))) > _NEAR:
        end = view.flat(_REACH * way[None] / distance)[0]
        axis.plot([0.0, end[0]], [0.0, end[1]], ":", color=COLORS[1], label="towards the target")
    drawn = _draw(pose, view, 1.0)
    axis.add_collection(drawn, autolim=False)
    axis.set_xlim(_BESIDE[:2])
    axis.set_ylim(_BESIDE[2:])
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])


def draw_reach(axis: Axes, pose: LanderPose, scenario: Scenario) -> None:
    """Draw the edge of what the sensor can see of the target plane now, on a picture of the ground.

    On the plane and below it there is nothing to draw: the cone would meet it behind the sensor.
    """
    down, limit = _sensor(pose, scenario)
    height = pose.position[2] - scenario.nominal_target[2]
    if height <= 0.0:
        return
    rim = cone_rim(down, limit, 90)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rim[:, 2] < 0.0, -height / rim[:, 2], np.nan)
    east, north = (pose.position[:2] + reach[:, None] * rim[:, :2]).T
    axis.plot(east, north, "--", color=CONE_COLOR, linewidth=1.2, label="sensor's reach")


def _sensor(pose: LanderPose, scenario: Scenario) -> tuple[Array, float]:
    """Where the sensor looks, shape (3,), and [rad] how far aside; a point mass's looks straight down."""
    preset = scenario.preset
    down = np.array([0.0, 0.0, -1.0]) if preset.body is None else sensor_axis(pose.attitude)
    return down, preset.lidar.off_nadir_limit


def _draw(pose: LanderPose, view: View, size: float) -> PolyCollection:
    """The lander with its plume as polygons on the paper, the farthest first."""
    from matplotlib.collections import PolyCollection

    lander, plume = lander_surface(), plume_surface(pose.throttle)
    corners = pose.to_site(lander.vertices)[lander.triangles]
    colors = _shaded(lander, corners)
    if pose.throttle > 0.0:
        flame = pose.flame_to_site(plume.vertices, NOZZLE)[plume.triangles]
        corners, colors = np.concatenate([corners, flame]), np.concatenate([colors, _plain(plume)])
    eye = np.cross(*view)
    order = np.argsort((corners @ eye).mean(axis=1))
    flat = size * np.array([view.flat(triangle) for triangle in corners[order]])
    return PolyCollection(
        list(flat), facecolors=colors[order], edgecolors=colors[order], linewidths=0.3, zorder=5
    )


def _plain(surface: Surface) -> Array:
    """Colours of the triangles, shape (m, 3)."""
    from matplotlib.colors import to_rgb

    return np.array([to_rgb(color) for color in surface.colors])


def _shaded(surface: Surface, corners: Array) -> Array:
    """Colours, shape (m, 3), of the triangles in the light; `corners` has the shape (m, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    lit = _SHADE + (1.0 - _SHADE) * np.clip(normals @ _LIGHT, 0.0, 1.0)
    return _plain(surface) * lit[:, None]


def _hull(points: Array) -> Array:
    """Corners of the convex hull of points on the paper, shape (n, 2)."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]
