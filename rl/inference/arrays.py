"""The arrays that networks compute with; shapes are said in signatures."""

import numpy as np
from numpy.typing import NDArray

Array32 = NDArray[np.float32]
"""Real numbers in single precision."""
