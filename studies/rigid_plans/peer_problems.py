"""Problems that `solve_pdg_6dof` and OpenSCvx are both asked: OpenSCvx's own example, and our starts.

The example is the six-degree-of-freedom powered descent that OpenSCvx 0.5.2 carries in its source
distribution (examples/rocket/6DoF_pdg.py), which took it from SCvxGEN. Its numbers are its own, without
units; its vertical x axis is our z axis. Its limits with a factor of 0.1 on one side are wider than its
constants name: `looseness` is that factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance import Lander
from guidance.constants import STANDARD_GRAVITY
from guidance.rigid_body import RigidBody, RigidState
from guidance.rigid_descent import RigidLandingProblem
from studies.rigid_plans.starts import draw_start

START_SECONDS = 40.0
"""[s] first guess of the time of flight of a start of ours."""


@dataclass(frozen=True)
class Surroundings:
    """What the example has and `guidance.rigid_body` has not.

    Attributes:
        drag: [kg/m] along each axis of the body, k in the force -k |v| v.
        pressure_arm: [m] how far above the mass centre that force acts.
        leak: [kg/s] mass that is lost whatever the thrust is.
    """

    drag: tuple[float, float, float]
    pressure_arm: float
    leak: float


@dataclass(frozen=True, eq=False)
class PeerProblem:
    """A landing problem, and how the peer counts in it.

    Attributes:
        name: in tables.
        problem: what is asked; its units are SI, or those of the example.
        length: of the problem's unit of length, what the peer counts as one.
        duration: the same of time.
        mass: the same of mass.
        farthest: box of the peer's positions from the target, which also scales them.
        lowest: lower end of that box in height.
        fastest: box of its velocities.
        first_time: first guess of the time of flight; the peer's intervals last 0.2 to 2 times their share.
        longest_time: of a flight.
        surroundings: air and leak; None for none.
        speed_limit: None for none.
        looseness: factor on one side of the limits of thrust, gimbal, speed and glide slope.
    """

    name: str
    problem: RigidLandingProblem
    length: float
    duration: float
    mass: float
    farthest: float
    lowest: float
    fastest: float
    first_time: float
    longest_time: float
    surroundings: Surroundings | None = None
    speed_limit: float | None = None
    looseness: float = 1.0

    @property
    def midway_mass(self) -> float:
        """Half of the propellant burnt: the peer's first guess of the mass at the end."""
        return 0.5 * (self.problem.state.mass + self.problem.body.lander.dry_mass)


EXAMPLE_BODY = RigidBody(
    Lander(dry_mass=1.0, max_thrust=6.5, specific_impulse=30.0 / STANDARD_GRAVITY, min_thrust=1.5),
    inertia=(0.168, 0.168, 0.168 * 0.02),
    inertia_mass=2.0,
    inertia_exponent=0.0,
    torque_limit=(0.0, 0.0, 0.0),
    rate_limit=0.3752,
    tilt_limit=math.radians(75.0),
    engine_lag=0.0,
    gimbal_limit=math.radians(20.0),
    engine_arm=0.25,
)
"""The example's vehicle: a gimballed engine alone turns it, and its inertia does not change."""


def published_example() -> PeerProblem:
    """OpenSCvx's example as it is shipped: with air, with a leak, its limits loose."""
    problem = RigidLandingProblem(
        RigidState(np.array([4.5, 2.5, 7.5]), np.array([-2.8, 0.0, -0.5]), 2.0),
        np.zeros(3),
        EXAMPLE_BODY,
        np.array([0.0, 0.0, -1.0]),
        np.array([0.0, 0.0, -0.1]),
        math.radians(75.0),
        free_attitude=True,
    )
    return PeerProblem(
        "example as shipped",
        problem,
        length=1.0,
        duration=1.0,
        mass=1.0,
        farthest=10.0,
        lowest=-10.0,
        fastest=3.0,
        first_time=10.0,
        longest_time=10.0,
        surroundings=Surroundings(drag=(0.25, 0.25, 0.125), pressure_arm=0.05, leak=0.01),
        speed_limit=3.0,
        looseness=0.1,
    )


def shared_example() -> PeerProblem:
    """The example as both can state it: no air, leak or limit of speed, the rest as its constants name it."""
    return replace(
        published_example(),
        name="example, no air",
        fastest=10.0,
        surroundings=None,
        speed_limit=None,
        looseness=1.0,
    )


def start_problem(preset: str, start: int) -> PeerProblem:
    """The start that `starts.plan_start` plans, and how the peer counts in it."""
    problem = draw_start(preset, start)
    return PeerProblem(
        f"start of {preset}",
        problem,
        length=1000.0,
        duration=10.0,
        mass=problem.state.mass,
        farthest=1000.0,
        lowest=0.0,
        fastest=100.0,
        first_time=START_SECONDS,
        longest_time=3.0 * START_SECONDS,
    )
