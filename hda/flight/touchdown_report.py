"""A touchdown on real ground, judged as the lander then stands: what was measured, and what failed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.quaternion import tilt_angle
from guidance.rigid_body.state import RigidState
from guidance.state import State
from hda.safety.touchdown_limits import TouchdownLimits
from hda.safety.touchdown_pose import TippingBody, stand, tip_over_speed
from hda.task.scenario import Scenario
from hda.task.touchdown import GroundTouchdown


class TouchdownFault(StrEnum):
    """What a touchdown fails by."""

    UNKNOWN_GROUND = "unknown-ground"
    """Outside the map, or on ground that the map does not know."""
    SLOPE = "slope"
    """The lander comes to stand on a plane steeper than the limit."""
    CLEARANCE = "clearance"
    """The ground between the pads reaches the belly."""
    VERTICAL_SPEED = "vertical-speed"
    """Too fast square to that plane."""
    HORIZONTAL_SPEED = "horizontal-speed"
    """Too fast along it."""
    TILT = "tilt"
    """The body's axis stands too far from the vertical."""
    TURN_RATE = "turn-rate"
    """The body still turns too fast."""
    TIP_OVER = "tip-over"
    """So fast along it that the lander may tip over."""
    STRIKE = "strike"
    """The ground was met on the way: under power, beside the site, and too fast for a landing."""


_GROUND = frozenset({TouchdownFault.UNKNOWN_GROUND, TouchdownFault.SLOPE, TouchdownFault.CLEARANCE})
_TOO_FAST = frozenset({TouchdownFault.VERTICAL_SPEED, TouchdownFault.HORIZONTAL_SPEED})
_NOT_SOFT = _TOO_FAST | {TouchdownFault.TILT, TouchdownFault.TURN_RATE}
_WRECKS = frozenset({TouchdownFault.TIP_OVER, TouchdownFault.STRIKE})


@dataclass(frozen=True)
class TouchdownReport:
    """How the lander stands, and how it came down; of its two stable planes the worse counts each time.

    Attributes:
        slope: [rad] angle of the plane from horizontal.
        roughness: [m] greatest distance of the ground between the pads above the plane; -inf where none of it
            is known.
        vertical_speed: [m/s] square to the plane.
        horizontal_speed: [m/s] along it.
        tip_over_speed: [m/s] along the plane, above which the lander may tip over, leaning downhill as far as
            it leans.
        safe_cell: the cell under its axis is safe by Algorithm 1 on the true map, the paper's ratio.
        faults: all that failed, in the order of `TouchdownFault`.
        tilt: [rad] angle of the body's axis from the vertical; a point mass stands upright.
        turn_rate: [rad/s] of the body; a point mass does not turn.
    """

    slope: float
    roughness: float
    vertical_speed: float
    horizontal_speed: float
    tip_over_speed: float
    safe_cell: bool
    faults: tuple[TouchdownFault, ...]
    tilt: float = 0.0
    turn_rate: float = 0.0

    @property
    def safe_ground(self) -> bool:
        """The lander can stand there: slope and clearance keep their limits."""
        return not _GROUND.intersection(self.faults)

    @property
    def soft(self) -> bool:
        """Both speeds keep their limits, and so do tilt and rate of turn."""
        return not _NOT_SOFT.intersection(self.faults)

    @property
    def wrecked(self) -> bool:
        """It struck the ground on the way or may tip over."""
        return bool(_WRECKS.intersection(self.faults))


def judge_touchdown(
    scenario: Scenario, final: State, site: Array, under_power: bool, turned: RigidState | None = None
) -> TouchdownReport | None:
    """Judge the contact with the true ground; None where flights end on the target plane.

    Args:
        scenario: what was flown.
        final: state at the contact.
        site: [m] shape (3,), where the lander was flying to, by the true map.
        under_power: whether the engine still burnt.
        turned: state of a rigid body at the contact; None of a point mass.
    """
    touchdown, stance, footing = scenario.preset.touchdown, scenario.preset.stance, scenario.footing
    if not isinstance(touchdown, GroundTouchdown) or stance is None or footing is None:
        return None
    x, y = (float(value) for value in final.position[:2])
    pose = stand(footing, x, y)
    sinking = pose.normals @ final.velocity
    sliding = np.linalg.norm(final.velocity - sinking[:, None] * pose.normals, axis=1)
    tilt = 0.0 if turned is None else float(tilt_angle(turned.attitude))
    body = TippingBody(
        touchdown.centre_of_mass_height, touchdown.moment_of_inertia, stance.edge_distance, final.mass
    )
    slope = float(pose.slopes.max())
    report = TouchdownReport(
        slope=slope,
        roughness=pose.roughness,
        vertical_speed=float(np.abs(sinking).max()),
        horizontal_speed=float(sliding.max()),
        tip_over_speed=tip_over_speed(body, slope + tilt, -scenario.preset.gravity[2]),
        safe_cell=scenario.tile.is_safe(final.position),
        faults=(),
        tilt=tilt,
        turn_rate=0.0 if turned is None else float(np.linalg.norm(turned.rates)),
    )
    beside = float(np.hypot(x - site[0], y - site[1])) > stance.pad_distance + stance.pad_radius
    faults = _find_faults(report, touchdown.limits, stance.clearance)
    if not pose.known:
        faults = (TouchdownFault.UNKNOWN_GROUND, *faults)
    if under_power and beside and _TOO_FAST.intersection(faults):
        faults = (*faults, TouchdownFault.STRIKE)
    return replace(report, faults=faults)


def _find_faults(
    report: TouchdownReport, limits: TouchdownLimits, clearance: float
) -> tuple[TouchdownFault, ...]:
    """The limits that a report's own numbers break."""
    broken = {
        TouchdownFault.SLOPE: report.slope > limits.slope,
        TouchdownFault.CLEARANCE: report.roughness > clearance,
        TouchdownFault.VERTICAL_SPEED: report.vertical_speed > limits.vertical_speed,
        TouchdownFault.HORIZONTAL_SPEED: report.horizontal_speed > limits.horizontal_speed,
        TouchdownFault.TILT: report.tilt > limits.tilt,
        TouchdownFault.TURN_RATE: report.turn_rate > limits.turn_rate,
        TouchdownFault.TIP_OVER: report.horizontal_speed > report.tip_over_speed,
    }
    return tuple(fault for fault, holds in broken.items() if holds)
