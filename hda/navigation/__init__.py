"""Where the lander believes it is: its navigation sensors, and the filter that makes an estimate of them.

`sensors` and `system` say what is aboard, `sensor_errors` what chance does to it. `navigation_state` is what
the filter knows, `filter` takes it along a flown path, `site_tracking` puts the landing site into it. The
other modules are their kernels: `layout` names the numbers, `propagation` is the inertial unit, `attitude`
that of a turning body, `readings` and `site_fixes` are the other sensors, `schmidt_update` takes a
measurement in, `control_period` takes the filter over one period or along a path, `steering` calls it in the
vehicle's loop. It sees the ground by `hda.sensing`; the task and the simulator import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.navigation.filter import FlownPath, NavigationLog, measure_ranges, navigate
    from hda.navigation.navigation_state import NavigationState, begin_navigation
    from hda.navigation.sensor_errors import (
        FixDraws,
        ReadingDraws,
        SensorErrors,
        draw_fix,
        draw_readings,
        draw_sensor_errors,
    )
    from hda.navigation.sensors import (
        Altimeter,
        Gyroscope,
        InertialUnit,
        SiteFixes,
        TerrainFixes,
        Velocimeter,
    )
    from hda.navigation.site_tracking import choose_site, find_site, track_site
    from hda.navigation.system import NAVIGATION_FAULTS, NavigationSystem, add_fault

_HOMES = {
    "hda.navigation.filter": ("FlownPath", "NavigationLog", "measure_ranges", "navigate"),
    "hda.navigation.navigation_state": ("NavigationState", "begin_navigation"),
    "hda.navigation.sensor_errors": (
        "FixDraws",
        "ReadingDraws",
        "SensorErrors",
        "draw_fix",
        "draw_readings",
        "draw_sensor_errors",
    ),
    "hda.navigation.sensors": (
        "Altimeter",
        "Gyroscope",
        "InertialUnit",
        "SiteFixes",
        "TerrainFixes",
        "Velocimeter",
    ),
    "hda.navigation.site_tracking": ("choose_site", "find_site", "track_site"),
    "hda.navigation.system": ("NAVIGATION_FAULTS", "NavigationSystem", "add_fault"),
}

__all__ = [
    "NAVIGATION_FAULTS",
    "Altimeter",
    "FixDraws",
    "FlownPath",
    "Gyroscope",
    "InertialUnit",
    "NavigationLog",
    "NavigationState",
    "NavigationSystem",
    "ReadingDraws",
    "SensorErrors",
    "SiteFixes",
    "TerrainFixes",
    "Velocimeter",
    "add_fault",
    "begin_navigation",
    "choose_site",
    "draw_fix",
    "draw_readings",
    "draw_sensor_errors",
    "find_site",
    "measure_ranges",
    "navigate",
    "track_site",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
