"""Relief without its means over posts: against a literal mean, for posts of any side and any tile."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.ground.post_means import PostAxis, lay_posts, remove_post_means

SIDES = st.one_of(st.sampled_from([1.2, 1.5, 2.0, 2.5, 5.0, 10.0]), st.floats(1.05, 10.0))


def post_means(relief: np.ndarray, axis: PostAxis, side: float, posts: range) -> np.ndarray:
    """The mean over each post, each cell of 1 m counted by the length that it shares with the post."""
    shares = np.zeros((len(posts), axis.cells))
    for row, post in enumerate(posts):
        for cell in range(axis.cells):
            west = axis.first_cell + cell
            shared = min((post + 1) * side, west + 1.0) - max(post * side, float(west))
            shares[row, cell] = max(shared, 0.0) / side
    return shares @ relief @ shares.T


@given(side=SIDES, first=st.sampled_from([0, 40, 1000]), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_the_means_go_and_nothing_else_is_needed(side: float, first: int, seed: int) -> None:
    axis = lay_posts(first, 60, side, int(2000.0 / side))
    posts = range(int(first / side + 1e-9), int(first / side + 1e-9) + axis.posts)
    assert axis.first_cell <= first
    assert axis.first_cell + axis.cells >= first + 60
    relief = np.random.default_rng(seed).normal(size=(axis.cells, axis.cells))
    found = remove_post_means(relief, axis, axis)
    assert np.abs(post_means(found, axis, side, posts)).max() < 1e-9
    assert np.abs(post_means(relief, axis, side, posts)).max() > 0.01
    np.testing.assert_allclose(remove_post_means(found, axis, axis), found, atol=1e-12)


@pytest.mark.parametrize("side", [5.0, 10.0])
def test_what_is_taken_has_no_edges_between_posts(side: float) -> None:
    """Steps at the edges of posts would be hazards that nobody drew."""
    axis = lay_posts(0, 200, side, int(400.0 / side))
    rng = np.random.default_rng(1)
    relief = rng.normal(size=(axis.cells, axis.cells))
    taken = relief - remove_post_means(relief, axis, axis)
    steps = np.abs(np.diff(taken, axis=1))
    edge = (np.arange(1, axis.cells) % side) == 0
    assert np.sqrt((steps[:, edge] ** 2).mean()) < 1.5 * np.sqrt((steps[:, ~edge] ** 2).mean())


def test_the_last_posts_of_a_file_end_within_its_cells() -> None:
    axis = lay_posts(1000, 993, 4.9826, 400)
    assert axis.posts == 400 - 200
    assert axis.first_cell == 996
    assert axis.first_cell + axis.cells == int(np.ceil(400 * 4.9826))
