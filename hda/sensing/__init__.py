"""What a look at the ground is.

Algorithm 2: the map of safety that the LIDAR gives around a target, with its noise and its limits of view.
It sees tiles (`hda.ground`); the task and the simulator import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.sensing.lidar import Lidar, look

_HOMES = {
    "hda.sensing.lidar": (
        "Lidar",
        "look",
    ),
}

__all__ = [
    "Lidar",
    "look",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
