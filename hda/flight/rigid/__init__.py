"""A rigid body in the vehicle's loop, where the lander must turn to thrust elsewhere.

`turning` is the body under way, with what it believes of its attitude; `pointing` says where it points, for
both laws; `held_command` flies a commanded thrust over a control period, or the fall after the cut-off, to
the plane, the ground or the empty tank. The laws of `hda.flight.interval` call it as they call the point
mass. It imports the body of `guidance.rigid_body`, the stance of `hda.safety`, and of `hda.navigation` the
filter's kernels; nothing else of the simulator.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.flight.rigid.turning import believed_attitude

_HOMES = {"hda.flight.rigid.turning": ("believed_attitude",)}

__all__ = ["believed_attitude"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
