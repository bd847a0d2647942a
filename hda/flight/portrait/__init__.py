"""The lander as pictures show it: how it stands, its shape with the engine's plume, and what its sensor sees.

`pose` reads it from a record or from the steps of an episode; `shape` is its surface, in triangles; `view`
draws both on a flat picture, beside the path, from above, or close by. Films, the environments' pictures and
the report draw with it. It imports the record and the task, no other picture.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.flight.portrait.pose import LanderPose, end_pose, find_pose

_HOMES = {"hda.flight.portrait.pose": ("LanderPose", "end_pose", "find_pose")}

__all__ = ["LanderPose", "end_pose", "find_pose"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
