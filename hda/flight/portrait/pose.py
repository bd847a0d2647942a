"""How a lander stands at an instant of its flight: where, which way up, and how its engine burns.

A rigid body has an attitude. A point mass has none: it is shown upright, as its sensor counts from the
vertical, with its thrust where that points; along the thrust it would lie upside down when a newton corrects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.quaternion import attitude_along, rotate, tilt_angle
from guidance.rigid_body.state import RigidState
from hda.flight.episode import Step
from hda.flight.record import EpisodeRecord
from hda.task.scenario import Scenario

_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class LanderPose:
    """How a lander stands.

    Attributes:
        position: [m] shape (3,), site frame.
        attitude: unit quaternion, scalar first, shape (4,): turns body vectors into the site frame.
        thrust: shape (3,), site frame, over the engine's greatest; zero while it is off.
    """

    position: Array
    attitude: Array
    thrust: Array

    @property
    def throttle(self) -> float:
        """Thrust over the engine's greatest."""
        return float(np.linalg.norm(self.thrust))

    @property
    def tilt(self) -> float:
        """[rad] angle of the lander's axis from the vertical."""
        return float(tilt_angle(self.attitude))

    def to_site(self, points: Array) -> Array:
        """Body vectors, shape (n, 3), as the site frame sees them."""
        return _turned(points, self.attitude)

    def flame_to_site(self, points: Array, nozzle: Array) -> Array:
        """Points of an upright lander's flame, shape (n, 3), turned about its nozzle along the thrust."""
        return self.to_site(nozzle[None]) + _turned(points - nozzle, _along(self.thrust))


def engine_attitudes(record: EpisodeRecord) -> Array:
    """Attitude of the engine at each node of a flight, shape (n, 4), with a scalar part that is not negative.

    It is the body's. That of a point mass is along the thrust of the interval that begins there, and upright
    without thrust and at the end.
    """
    if record.body_path is None:
        return np.array([*(_along(thrust) for thrust in record.thrust), _UPRIGHT])
    attitudes = record.body_path[:, 6:10]
    return np.where(attitudes[:, :1] < 0.0, -attitudes, attitudes)


def find_pose(record: EpisodeRecord, time: float) -> LanderPose:
    """How the lander stands at one time of a flight.

    Args:
        record: the flight.
        time: [s] since the start; a time outside the flight counts as its start or its end. Between two nodes
            a body's state is interpolated, and the thrust of a point mass is held.
    """
    times = record.time
    time = float(np.clip(time, times[0], times[-1]))
    position = np.array([np.interp(time, times, column) for column in record.position.T])
    if record.body_path is None:
        interval = int(np.searchsorted(times, time, side="right")) - 1
        thrust = record.thrust[interval] if interval < len(record.thrust) else np.zeros(3)
        return _pose_of_point(position, thrust, record.scenario)
    attitude = np.array([np.interp(time, times, column) for column in engine_attitudes(record).T])
    thrust = np.array([np.interp(time, times, column) for column in record.body_path[:, 14:17].T])
    return _pose_of_body(position, attitude / np.linalg.norm(attitude), thrust, record.scenario)


def end_pose(scenario: Scenario, steps: Sequence[Step]) -> LanderPose:
    """How the lander stands after what has been flown of an episode; upright, its engine off, before it.

    Args:
        scenario: what is flown.
        steps: what has been flown. A point mass burns as it last did.
    """
    if not steps:
        return _pose_of_point(scenario.initial_state.position, np.zeros(3), scenario)
    segment = steps[-1].segment
    if segment.body_path is None:
        thrust = segment.commanded[-1] * (1.0 + segment.thrust_error)
        return _pose_of_point(segment.path[-1, :3], thrust, scenario)
    state = RigidState.of_array(segment.body_path[-1])
    return _pose_of_body(state.position, state.attitude, state.thrust, scenario)


def _pose_of_point(position: Array, thrust: Array, scenario: Scenario) -> LanderPose:
    return LanderPose(position, _UPRIGHT, thrust / scenario.preset.lander.max_thrust)


def _pose_of_body(position: Array, attitude: Array, thrust: Array, scenario: Scenario) -> LanderPose:
    burning = _turned(thrust[None], attitude)[0] / scenario.preset.lander.max_thrust
    return LanderPose(position, attitude, burning)


def _along(thrust: Array) -> Array:
    return attitude_along(thrust) if thrust.any() else _UPRIGHT


def _turned(points: Array, attitude: Array) -> Array:
    """Points, shape (n, 3), turned by a unit quaternion."""
    return points @ np.array([rotate(attitude, axis) for axis in np.eye(3)])
