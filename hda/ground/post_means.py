"""Relief without the part that an elevation model of coarse posts shows already: its mean over each post."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from guidance.arrays import Array
from hda.ground.resampling import axis_weights

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_SMOOTH_PASSES = 8  # each leaves at most 0.6 of the means; the worst is a chequerboard of posts
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class PostAxis:
    """The posts along one axis that touch a row of cells of 1 m.

    Attributes:
        first_cell: first cell that these posts reach into; cell 0 begins where post 0 begins.
        cells: number of cells that they reach into.
        posts: their number.
        mean: shape (posts, cells), the mean over each post from the cells.
        surface: shape (cells, posts), the cells of a smooth surface through the posts (cubic convolution).
    """

    first_cell: int
    cells: int
    posts: int
    mean: csr_array
    surface: csr_array


def lay_posts(first_cell: int, cells: int, side: float, posts: int) -> PostAxis:
    """Find the posts that touch cells `first_cell` to `first_cell + cells - 1`.

    Args:
        first_cell: cell 0 begins where post 0 begins.
        cells: at least 1; the last begins on a post.
        side: [m] of a post, above 1.
        posts: along the whole axis, at least 4.
    """
    first = math.floor(first_cell / side + _ROUNDING)
    last = min(posts, math.ceil((first_cell + cells) / side - _ROUNDING))
    mean = axis_weights(first, last - first, 1.0 / side, math.ceil(posts * side) + 1)
    count = mean.last - mean.first
    through = axis_weights(mean.first, count, side, posts)
    surface = through.weights[:, first - through.first : last - through.first]
    return PostAxis(mean.first, count, last - first, mean.weights, surface.tocsr())


def remove_post_means(relief: Array, north: PostAxis, east: PostAxis) -> Array:
    """Take a smooth surface from relief so that its mean over each post is zero.

    A surface that has the means is found by passes of cubic convolution, which leave no edges between posts;
    the little that is left goes by the smallest change that takes it away.

    Args:
        relief: [m] shape (north.cells, east.cells).
        north: posts along the rows.
        east: posts along the columns.

    Returns:
        [m] the same shape.
    """
    out = np.array(relief, dtype=np.float64)
    for _ in range(_SMOOTH_PASSES):
        out -= _both_axes(_both_axes(out, north.mean, east.mean), north.surface, east.surface)
    rest = _both_axes(out, north.mean, east.mean)
    for axis, place in ((north, 0), (east, 1)):
        overlap = (axis.mean @ axis.mean.T).toarray()
        rest = np.moveaxis(np.linalg.solve(overlap, np.moveaxis(rest, place, 0)), 0, place)
    out -= _both_axes(rest, north.mean.T, east.mean.T)
    return out


def _both_axes(values: Array, north: csr_array, east: csr_array) -> Array:
    return (east @ (north @ values).T).T
