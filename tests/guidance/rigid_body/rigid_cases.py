"""Rigid bodies and states that tests draw, and a published case."""

import math

import numpy as np
from hypothesis import strategies as st

from guidance import Lander, solve_pdg_6dof
from guidance.rigid_body import RigidBody, RigidState, attitude_along
from guidance.rigid_descent import RigidPlan
from guidance.successive.solve import RigidPlanningMethod

UNITS = st.floats(-1.0, 1.0)


def vectors(scale: float):
    return st.tuples(UNITS, UNITS, UNITS).map(lambda numbers: scale * np.array(numbers))


DIRECTIONS = vectors(1.0).filter(lambda vector: np.linalg.norm(vector) > 0.1)
ATTITUDES = st.builds(attitude_along, DIRECTIONS, st.floats(-3.0, 3.0))
STATES = st.builds(
    RigidState, vectors(1000.0), vectors(50.0), st.floats(1160.0, 1200.0), ATTITUDES, vectors(0.17)
)
"""States of the default lander at its limit of rates, the engine off."""

SZMUK = RigidBody(
    Lander(dry_mass=1.0, max_thrust=5.0, min_thrust=0.3, specific_impulse=100.0 / 9.80665),
    inertia=(0.01, 0.01, 0.01),
    inertia_mass=2.0,
    inertia_exponent=0.0,
    torque_limit=(0.0, 0.0, 0.0),
    rate_limit=math.radians(60.0),
    tilt_limit=math.radians(90.0),
    engine_lag=0.0,
    gimbal_limit=math.radians(20.0),
    engine_arm=0.01,
)
"""The vehicle of Szmuk and Acikmese, AIAA 2018-0617, tables 1 and 2, in their units."""


def plan_szmuk_case(nodes: int, method: RigidPlanningMethod = "successive") -> RigidPlan:
    """Their descent in the shortest time, which an independent reproduction puts at 3.3901 units."""
    state = RigidState(np.array([4.0, 0.0, 4.0]), np.array([-4.0, 0.0, 0.0]), 2.0)
    return solve_pdg_6dof(
        state,
        [0.0, 0.0, 0.0],
        SZMUK,
        gravity=(0.0, 0.0, -1.0),
        target_velocity=(0.0, 0.0, -0.1),
        glide_slope_limit=math.radians(70.0),
        free_attitude=True,
        objective="time",
        nodes=nodes,
        method=method,
    )
