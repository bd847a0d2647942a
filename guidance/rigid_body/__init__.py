"""A lander that must turn: body, attitude, true motion, and the loop that points its thrust.

Quaternions are scalar first and turn vectors of the body into the site frame. Rates, torque and the engine's
thrust stand in the body frame, everything else in the site frame. It stands beside `guidance.dynamics`, and
planners and vehicles may import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.rigid_body.attitude_loop import DEFAULT_LOOP, AttitudeLoop, hold_thrust
    from guidance.rigid_body.body import DEFAULT_BODY, RigidBody
    from guidance.rigid_body.loop_response import LoopMargins, StepResponse, fly_turn, loop_margins
    from guidance.rigid_body.motion import fly_commands
    from guidance.rigid_body.quaternion import attitude_along, rotate
    from guidance.rigid_body.state import RigidState

_HOMES = {
    "guidance.rigid_body.attitude_loop": ("DEFAULT_LOOP", "AttitudeLoop", "hold_thrust"),
    "guidance.rigid_body.body": ("DEFAULT_BODY", "RigidBody"),
    "guidance.rigid_body.loop_response": (
        "LoopMargins",
        "StepResponse",
        "fly_turn",
        "loop_margins",
    ),
    "guidance.rigid_body.motion": ("fly_commands",),
    "guidance.rigid_body.quaternion": ("attitude_along", "rotate"),
    "guidance.rigid_body.state": ("RigidState",),
}

__all__ = [
    "DEFAULT_BODY",
    "DEFAULT_LOOP",
    "AttitudeLoop",
    "LoopMargins",
    "RigidBody",
    "RigidState",
    "StepResponse",
    "attitude_along",
    "fly_commands",
    "fly_turn",
    "hold_thrust",
    "loop_margins",
    "rotate",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
