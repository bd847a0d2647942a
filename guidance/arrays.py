"""Names of the arrays that stand in signatures; shapes and units are said there."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers."""

Index = NDArray[np.int64]
"""Positions in another array."""
