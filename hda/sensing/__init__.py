"""What a look at the ground is.

`lidar` is Algorithm 2, the map of safety with noise on the answer. The others measure: `ranging` sends rays
(`ray_casting`; `scan_draws` is their chance), `gridding` makes an elevation map of their echoes, `fusion` one
of several scans, and `measured_look` assesses it by Algorithm 1, as it would be done on board. It sees tiles
(`hda.ground`); the task, the policies and the simulator import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.sensing.fusion import fuse_elevations
    from hda.sensing.gridding import ElevationMap, Gridding, PixelGrid, grid_points, lay_grid
    from hda.sensing.lidar import Lidar, look
    from hda.sensing.measured_look import MeasuredGround, assess_elevation, find_holes, measure_ground
    from hda.sensing.ranging import PointCloud, RangingLidar, scan
    from hda.sensing.ray_casting import find_ground
    from hda.sensing.scan_draws import ScanDraws, draw_scan

_HOMES = {
    "hda.sensing.fusion": ("fuse_elevations",),
    "hda.sensing.gridding": ("ElevationMap", "Gridding", "PixelGrid", "grid_points", "lay_grid"),
    "hda.sensing.lidar": ("Lidar", "look"),
    "hda.sensing.measured_look": ("MeasuredGround", "assess_elevation", "find_holes", "measure_ground"),
    "hda.sensing.ranging": ("PointCloud", "RangingLidar", "scan"),
    "hda.sensing.ray_casting": ("find_ground",),
    "hda.sensing.scan_draws": ("ScanDraws", "draw_scan"),
}

__all__ = [
    "ElevationMap",
    "Gridding",
    "Lidar",
    "MeasuredGround",
    "PixelGrid",
    "PointCloud",
    "RangingLidar",
    "ScanDraws",
    "assess_elevation",
    "draw_scan",
    "find_ground",
    "find_holes",
    "fuse_elevations",
    "grid_points",
    "lay_grid",
    "look",
    "measure_ground",
    "scan",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
