"""Pictures of a tile: shaded relief, slope and safety map, side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hda.safety.safety_map import SafetyMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUN_AZIMUTH = 315.0  # [deg] clockwise from north
SUN_ELEVATION = 30.0  # [deg]
STEEPEST_SHOWN = 30.0  # [deg] upper end of the slope's colours


def draw_terrain(
    dem: NDArray[np.floating], safety: SafetyMap, pixel_size: float = 1.0, max_slope: float | None = None
) -> Figure:
    """Draw a tile: relief lit from the north-west, worst slope of the lander, probability of a safe landing.

    Args:
        dem: (m, n) elevation [m].
        safety: its safety map.
        pixel_size: [m] side of a cell.
        max_slope: [rad] slope limit, marked on the slope's colour bar.

    Returns:
        The figure, not tied to any window. Its colours keep their order in grey and for colour-blind readers.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LightSource
    from matplotlib.figure import Figure

    figure = Figure(figsize=(17.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    relief_axes, slope_axes, safety_axes = figure.subplots(1, 3, sharex=True, sharey=True)
    sun = LightSource(azdeg=SUN_AZIMUTH, altdeg=SUN_ELEVATION)
    # LightSource takes row 0 for the north edge unless told otherwise by the sign of dy.
    shade = sun.hillshade(np.asarray(dem, dtype=np.float64), dx=pixel_size, dy=-pixel_size)
    _show_map(relief_axes, shade, pixel_size, "shaded relief", cmap="gray")
    steepness = np.degrees(safety.slope)
    image = _show_map(
        slope_axes, steepness, pixel_size, "worst slope", cmap="viridis", vmin=0.0, vmax=STEEPEST_SHOWN
    )
    bar = figure.colorbar(image, ax=slope_axes, label="slope [deg]", extend="max")
    if max_slope is not None:
        bar.ax.axhline(math.degrees(max_slope), color="white", linewidth=2.0)
    image = _show_map(
        safety_axes, safety.probability, pixel_size, "safety map", cmap="cividis", vmin=0.0, vmax=1.0
    )
    figure.colorbar(image, ax=safety_axes, label="probability of safe ground [-]")
    relief_axes.set_ylabel("north [m]")
    return figure


def _show_map(axes: Axes, values: NDArray[np.floating], pixel_size: float, title: str, **style: object):
    rows, columns = values.shape
    axes.set_title(title)
    axes.set_xlabel("east [m]")
    extent = (0.0, columns * pixel_size, 0.0, rows * pixel_size)
    return axes.imshow(values, origin="lower", extent=extent, interpolation="nearest", **style)  # pyright: ignore[reportArgumentType]
