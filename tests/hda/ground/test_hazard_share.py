"""The share of unsafe ground around a place, against a count over every cell."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hda.ground.tile import Tile

SIDE = 60


def counted(safe: np.ndarray, x: float, y: float, radius: float) -> float:
    """Over a sheet of cells that reaches beyond the map, where nothing is safe."""
    margin = 200
    rows, columns = np.mgrid[-margin : SIDE + margin, -margin : SIDE + margin]
    sheet = np.zeros(rows.shape, bool)
    sheet[margin : margin + SIDE, margin : margin + SIDE] = safe
    dx, dy = columns + 0.5 - x, rows + 0.5 - y
    within = dx * dx + dy * dy <= radius * radius
    return float(np.sum(within & ~sheet) / np.sum(within))


@given(
    x=st.floats(-40.0, 100.0),
    y=st.floats(-40.0, 100.0),
    radius=st.floats(0.75, 90.0) | st.integers(1, 90).map(float),
    seed=st.integers(0, 5),
)
def test_it_is_the_count_over_all_cells_on_and_off_the_map(x, y, radius, seed):
    safe = np.random.default_rng(seed).random((SIDE, SIDE)) < 0.4
    flat = np.zeros((SIDE, SIDE), np.float32)
    tile = Tile(-1, flat, flat.copy(), safe)
    for east, north in ((x, y), (round(x), round(y)), (round(x) + 0.5, round(y) + 0.5)):
        share = tile.hazard_share(np.array([east, north]), radius)
        assert share == counted(safe, east, north, radius)
