"""Rigid bodies and states that the tests of this folder draw."""

import numpy as np
from hypothesis import strategies as st

from guidance.rigid_body import RigidState, attitude_along

UNITS = st.floats(-1.0, 1.0)


def vectors(scale: float):
    return st.tuples(UNITS, UNITS, UNITS).map(lambda numbers: scale * np.array(numbers))


DIRECTIONS = vectors(1.0).filter(lambda vector: np.linalg.norm(vector) > 0.1)
ATTITUDES = st.builds(attitude_along, DIRECTIONS, st.floats(-3.0, 3.0))
STATES = st.builds(
    RigidState, vectors(1000.0), vectors(50.0), st.floats(1160.0, 1200.0), ATTITUDES, vectors(0.17)
)
"""States of the default lander at its limit of rates, the engine off."""
