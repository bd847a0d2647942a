"""The vehicle between two looks: it flies a command at the control rate within the limits of its thrust.

At each control instant the law gives a thrust, the vehicle takes the nearest within its bounds and its
pointing limit (`guidance.thrust_limits`), applies it with this interval's relative error, and holds it for
one control period; motion under a held thrust is exact (`guidance.dynamics`). When the time to go falls to
half a control period the engine is cut off and the vehicle falls freely to the target plane. The flight ends
where the plane is crossed, whatever the engine does; over true ground, where its pads or its belly touch it.
A rigid body flies the same thrusts by its attitude loop (`hda.flight.rigid`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from guidance.arrays import Array
from guidance.lander import Lander
from guidance.rigid_body.attitude_loop import DEFAULT_LOOP, AttitudeLoop
from guidance.rigid_body.body import RigidBody
from guidance.rigid_body.state import RigidState
from guidance.state import State
from guidance.thrust_limits import pointing_angle
from hda.flight import held_thrust
from hda.flight.interval import enter_plan, enter_zem_zev, plain_footing
from hda.flight.rigid.turning import PlainTurning, begin_turning
from hda.navigation.steering import Sensing, plain_sensing
from hda.policy import Command, Decision, PlanCommand, ZemZevCommand
from hda.safety.touchdown_stance import Footing


@dataclass(frozen=True)
class ControlPeriods:
    """Control periods between two looks.

    Attributes:
        period: [s] over which a thrust is held.
        count: how many.
        loop: by which a rigid body turns to its thrust, in periods of its own.
    """

    period: float
    count: int
    loop: AttitudeLoop = DEFAULT_LOOP


class FlightStatus(IntEnum):
    """Where an interval left the vehicle."""

    FLYING = held_thrust.FLYING
    TOUCHDOWN = held_thrust.TOUCHDOWN
    """The target plane was crossed, or the true ground was touched."""
    TANK_EMPTY = held_thrust.TANK_EMPTY
    """The tank ran dry above; the vehicle then fell."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What acts on the vehicle from outside.

    Attributes:
        gravity: [m/s^2] shape (3,), pointing down.
        footing: the lander over the true ground; None: the flight ends on the plane of the site.
    """

    gravity: Array
    footing: Footing | None = None


@dataclass(frozen=True, eq=False)
class FlightErrors:
    """What chance does to one interval.

    Attributes:
        thrust: relative error of the applied thrust.
        navigation: estimated minus true position [m] and velocity [m/s], shape (6,); the vehicle steers by
            the estimate.
        sensing: a filter that goes on estimating during the interval, from the given error on; its memory is
            changed, and a rigid body believes its attitude with the tilt of its true errors. None: the error
            stays, and a rigid body knows its attitude.
    """

    thrust: float = 0.0
    navigation: Array = field(default_factory=lambda: np.zeros(6))
    sensing: Sensing | None = None


@dataclass(frozen=True, eq=False)
class Segment:
    """Flight between two decisions, or up to the ground. n nodes have n - 1 intervals.

    Attributes:
        time: [s] shape (n,), since the decision.
        path: shape (n, 7): position [m], velocity [m/s], mass [kg].
        commanded: [N] shape (n - 1, 3), thrust within the vehicle's limits, held over each interval. What a
            rigid body gives of it is in its states.
        time_to_go: [s] what remains at the last node.
        thrust_error: relative error of the applied thrust over the whole segment.
        status: where the vehicle is at the last node.
        pointing_limited: control periods in which the pointing limit changed the thrust.
        body_path: shape (n, 17), states of a rigid body as `guidance.rigid_body.state.SIZE` says; None of a
            point mass.
    """

    time: Array
    path: Array
    commanded: Array
    time_to_go: float
    thrust_error: float
    status: FlightStatus
    pointing_limited: int = 0
    body_path: Array | None = None

    @property
    def final_state(self) -> State:
        """State at the last node."""
        return State(self.path[-1, :3], self.path[-1, 3:6], float(self.path[-1, 6]))

    @property
    def final_body(self) -> RigidState | None:
        """State of a rigid body at the last node; None of a point mass."""
        return None if self.body_path is None else RigidState.of_array(self.body_path[-1])


def fly_over(
    state: State | RigidState,
    decision: Decision,
    vehicle: Lander | RigidBody,
    surroundings: Surroundings,
    interval: ControlPeriods,
    errors: FlightErrors,
) -> Segment:
    """Fly a decision until the next look or the ground.

    Args:
        state: where the interval starts, above the ground. Without attitude a rigid body stands upright, at
            rest, its engine off.
        decision: site and command.
        vehicle: a point mass, or a rigid body; it limits the thrust.
        surroundings: gravity, and the true ground if there is one.
        interval: control periods to the next look.
        errors: of the applied thrust and of the estimated state over this interval.

    Returns:
        The flown segment.

    Raises:
        ValueError: a plan was sampled at another control period than the vehicle's.
    """
    periods, command = interval.count, decision.command
    time, path, commanded = np.empty(periods + 2), np.empty((periods + 2, 7)), np.empty((periods + 1, 3))
    plane, limits = float(decision.site[2]), _vehicle_limits(vehicle)
    gravity, ground = surroundings.gravity, surroundings.footing
    footing = None if ground is None else plain_footing(ground)
    sensing = None if errors.sensing is None else plain_sensing(errors.sensing)
    believed = errors.navigation.copy()
    tilt = np.zeros(3) if errors.sensing is None else errors.sensing.errors.tilt
    turning = _begin_turning(state, vehicle, interval, gravity, tilt, command)
    conditions = (interval.period, plane, gravity, limits, errors.thrust, believed, footing, turning)
    point = state.point if isinstance(state, RigidState) else state
    start, log = point.as_array(), (time, path, commanded)
    if isinstance(command, ZemZevCommand):
        rate = command.time_to_go_rate
        asked = (command.position_gain, command.velocity_gain, command.time_to_go, rate)
        nodes, status, limited = enter_zem_zev(start, decision.site, asked, conditions, sensing, log)
        time_to_go = command.time_to_go - rate * float(time[nodes - 1])
    else:
        reference = command.reference
        _check_period(reference.control_period, interval.period)
        parts = (reference.position, reference.velocity, reference.thrust_acceleration)
        feedback = command.lateral_gains or command.gains, command.gains, command.assumed_error
        nodes, status, limited = enter_plan(start, parts, feedback, conditions, sensing, log)
        time_to_go = reference.duration - float(time[nodes - 1])
    return Segment(
        time=time[:nodes],
        path=path[:nodes],
        commanded=commanded[: nodes - 1],
        time_to_go=time_to_go,
        thrust_error=errors.thrust,
        status=FlightStatus(status),
        pointing_limited=limited,
        body_path=None if turning is None else turning[4][:nodes],
    )


def _begin_turning(
    state: State | RigidState,
    vehicle: Lander | RigidBody,
    interval: ControlPeriods,
    gravity: Array,
    tilt: Array,
    command: Command,
) -> PlainTurning | None:
    """The body at the start of an interval; None of a point mass."""
    if not isinstance(vehicle, RigidBody):
        return None
    lead = command.lead if isinstance(command, PlanCommand) else 0.0
    parts = vehicle.numbers(gravity), interval.loop.numbers, tilt, lead
    return begin_turning(RigidState.parse(state), *parts, interval.count + 2)


def _vehicle_limits(vehicle: Lander | RigidBody) -> tuple[float, float, float, float, float]:
    """`VehicleLimits` without names."""
    if isinstance(vehicle, RigidBody):
        lander, limit = vehicle.lander, vehicle.tilt_limit
    else:
        lander, limit = vehicle, pointing_angle(vehicle)
    bounds = lander.min_thrust, lander.max_thrust
    return (*bounds, lander.exhaust_velocity, lander.dry_mass, limit)


def _check_period(planned: float, flown: float) -> None:
    if abs(planned - flown) > 1e-9 * flown:
        raise ValueError(
            f"command: its reference has a control period of {planned:g} s, the vehicle {flown:g} s"
        )
