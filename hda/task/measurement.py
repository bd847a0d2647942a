"""A measured look in an episode: the scan about the target, and the height that it gives the target."""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.state import RigidState
from guidance.state import State
from hda.safety.touchdown_stance import Stance
from hda.sensing.measured_look import MeasuredGround, measure_ground
from hda.sensing.ranging import RangingLidar, scan
from hda.task.scenario import Scenario


def measure_look(
    scenario: Scenario, lidar: RangingLidar, index: int, state: State | RigidState, aim: Array, error: Array
) -> MeasuredGround:
    """Scan the ground about a point, and assess it where the vehicle believes it to lie.

    The sensor points relative to the vehicle: an error of the estimated position moves the points with it.

    Args:
        scenario: the episode.
        lidar: its sensor.
        index: number of the look.
        state: the true state; the sensor turns with a rigid body.
        aim: [m] shape (3,), where the look really points.
        error: shape (6,), estimated minus true position [m] and velocity [m/s].
    """
    draws = scenario.streams.scan(index, lidar.rays)
    tile = scenario.tile
    cloud = scan(lidar, tile.elevation, state, aim, draws, tile.highest)
    position = state.position + error[:3]
    shift = position - state.position
    aim = aim + shift  # the plane's height is believed as wrongly as the vehicle's own
    return measure_ground(cloud, lidar, position, aim, scenario.preset.criteria)


def measured_target(stance: Stance | None, index: int, target: Array, ground: MeasuredGround | None) -> Array:
    """The target at the height of a look's ground; as it was where sites keep the target's height.

    After the first look an earlier height is kept where this one misses the ground of a pad.

    Args:
        stance: pads and belly; None where sites keep the target's height.
        index: number of the look.
        target: [m] shape (3,).
        ground: what the look measured; None where the sensor gives no ranges.
    """
    if stance is None or ground is None:
        return target
    height, pads = ground.site_height(stance, float(target[0]), float(target[1]))
    if index > 0 and pads < stance.pads.shape[0]:
        return target
    return np.array([target[0], target[1], height if pads > 0 else ground.middle_height(float(target[2]))])
