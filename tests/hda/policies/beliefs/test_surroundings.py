"""Unseen ground: distances against a slow search, and the calibration of the inferred share."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.belief_statistics import LOOK_WIDTHS
from hda.ground.library import Ground, load_tile
from hda.policies.beliefs.surroundings import (
    DISTANCE_EDGES,
    LARGEST_DISTANCE,
    infer_unseen,
    safe_share_table,
    squared_distance,
)
from hda.task.presets import PRESETS


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    share=st.sampled_from([0.0, 0.002, 0.02, 0.3, 1.0]),
)
def test_distances_are_those_of_a_slow_search(seed, shape, share):
    marked = np.random.default_rng(seed).random(shape) < share
    rows, columns = np.indices(shape)
    expected = np.full(shape, LARGEST_DISTANCE**2)
    for row, column in np.argwhere(marked):
        expected = np.minimum(expected, (rows - row) ** 2 + (columns - column) ** 2)
    np.testing.assert_array_equal(squared_distance(marked), expected)


def test_the_table_is_a_share_that_falls_with_distance_from_safe_and_rises_from_unsafe_ground():
    table = safe_share_table()
    assert table.shape == (DISTANCE_EDGES.size + 1,) * 2
    assert (table >= 0.0).all()
    assert (table <= 1.0).all()
    far = table[3:, 3:]  # nearer classes are shaped by the grid of the looks
    assert (np.diff(far, axis=0) < 0.02).all()
    assert (np.diff(far, axis=1)[:, :-1] > -0.02).all()


@pytest.mark.parametrize("preset", list(PRESETS))
def test_unseen_ground_is_safe_as_often_as_inferred(preset):
    """Training tiles that the table was not counted on; a tile's own share of islands sets the tolerance."""
    ground, rng = Ground(PRESETS[preset].terrain, PRESETS[preset].criteria), np.random.default_rng(1)
    inferred, truth = [], []
    for number in (42, 47, 52, 57, 62, 67):
        safe = np.asarray(load_tile(ground, number, "train").deterministic)
        for width in LOOK_WIDTHS:
            corner = rng.integers(200, 600, 2)
            window = safe[corner[0] : corner[0] + 240, corner[1] : corner[1] + 240]
            cells = np.floor(120.0 + ((np.arange(64) + 0.5) / 64 - 0.5) * width).astype(int)
            seen = np.zeros(window.shape, dtype=np.bool_)
            seen[cells[:, None], cells] = True
            share = infer_unseen(np.where(seen, window, 0.1).astype(np.float32), seen)
            np.testing.assert_array_equal(share[seen], window[seen])
            inferred.append(share[~seen])
            truth.append(window[~seen])
    p, safe = np.concatenate(inferred), np.concatenate(truth)
    for low, high, tolerance in (
        (0.0, 0.05, 0.01),
        (0.3, 0.7, 0.12),
        (0.9, 0.98, 0.06),
        (0.995, 1.01, 0.003),
    ):
        inside = (p >= low) & (p < high)
        assert inside.sum() > 300
        assert abs(safe[inside].mean() - p[inside].mean()) < tolerance
