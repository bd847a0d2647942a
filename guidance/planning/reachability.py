"""Which landing sites a state can still reach, from convex programmes in several directions.

For one time of flight the reachable part of the plane is convex. In each direction a point far outside is
projected on it ("least landing error"). With the thrust bounds relaxed outward the projection's tangent
bounds the set from outside; with the true bounds it is a reachable point, and the hull of those bounds it
from inside. The union over times of flight need not be convex, so slices are kept one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import forbidden_by
from guidance.planning.convex_task import ConvexTask
from guidance.planning.minimum_propellant import minimise_over_time
from guidance.validation import finite_number

DEFAULT_NODES = 11
_COARSE = 1e-4  # tolerance of the search for the shortest useful time, in ln(mass)
_TIMES = (1.05, 1.5)  # times of flight of the slices, in those of the cheapest landing anywhere
_TOLERANCE = 1e-6  # of the conic solver: millimetres of landing point
_FAR = 2.0  # distance of the projected points, in a T^2, four times what any thrust can shift


@dataclass(frozen=True, eq=False)
class ReachableSlice:
    """The sites reachable in one time of flight, in the plane's x and y.

    Attributes:
        time: [s] time of flight.
        vertices: [m] shape (k, 2), reachable points, one for each direction.
        inner: shape (f, 3), facets (n_x, n_y, c) of their hull: inside is n . x + c <= 0.
        outer: shape (k, 3), facets beyond which nothing is reachable on this mesh.
    """

    time: float
    vertices: Array
    inner: Array
    outer: Array


@dataclass(frozen=True, eq=False)
class ReachableSet:
    """Slices at several times of flight; empty where no soft landing was found.

    Attributes:
        slices: by rising time of flight.
    """

    slices: tuple[ReachableSlice, ...]

    def contains(self, sites: ArrayLike) -> NDArray[np.bool_]:
        """Whether sites, shape (..., 2) or (..., 3) [m], surely lie within reach at one of the times."""
        return self._within(sites, "inner")

    def may_contain(self, sites: ArrayLike) -> NDArray[np.bool_]:
        """Whether sites, shape (..., 2) or (..., 3) [m], are not proved out of reach at one of the times."""
        return self._within(sites, "outer")

    def _within(self, sites: ArrayLike, kind: str) -> NDArray[np.bool_]:
        points = np.asarray(sites, dtype=np.float64)[..., :2]
        found = np.zeros(points.shape[:-1], dtype=np.bool_)
        for part in self.slices:
            facets = getattr(part, kind)
            found |= (points @ facets[:, :2].T + facets[:, 2] <= 0.0).all(axis=-1)
        return found


def reachable_set(
    problem: LandingProblem,
    directions: int = 6,
    times: Sequence[float] | None = None,
    nodes: int = DEFAULT_NODES,
) -> ReachableSet:
    """Sites in the plane of `problem.target` that can be reached softly with the propellant on board.

    Args:
        problem: the landing problem; of its target only the altitude counts.
        directions: projections for each time, at least 3.
        times: [s] times of flight; None for two, from that of the cheapest landing anywhere upward.
        nodes: of each programme; more nodes reach a little further.

    Returns:
        The set; times at which no landing is possible have no slice.

    Raises:
        ValueError: fewer than three directions, or a time that is not positive.
    """
    finite_number("directions", directions, at_least=3)
    if times is None:
        anywhere = ConvexTask(problem, nodes, free_landing_point=True)
        cheapest = minimise_over_time(anywhere, _COARSE, coarse_first=False).solution
        times = () if cheapest is None else [factor * cheapest.time for factor in _TIMES]
    slices = [
        _slice_at(problem, finite_number("times", time, above=0.0), directions, nodes) for time in times
    ]
    return ReachableSet(tuple(part for part in slices if part is not None))


def _slice_at(problem: LandingProblem, time: float, directions: int, nodes: int) -> ReachableSlice | None:
    """Project far points from all around; None where fewer than three come back."""
    from scipy.spatial import ConvexHull, QhullError

    if forbidden_by(problem, time, free_landing_point=True):
        return None
    state = problem.state
    far = _FAR * problem.lander.max_thrust / state.mass * time**2
    middle = state.position[:2] + 0.5 * time * state.velocity[:2]
    vertices, outer = [], []
    for angle in 2.0 * np.pi * np.arange(directions) / directions:
        aim = middle + far * np.array([np.cos(angle), np.sin(angle)])
        target = np.array([*aim, problem.target[2]])
        aimed = replace(problem, target=target)
        task = ConvexTask(
            aimed,
            nodes,
            free_landing_point=True,
            least_error=True,
            limit_propellant=True,
            tolerance=_TOLERANCE,
            condense=False,
        )
        relaxed = task.solve(time)
        if not relaxed.solved:
            continue
        edge = relaxed.trajectory(aimed).position[-1, :2]
        normal = (aim - edge) / np.linalg.norm(aim - edge)
        outer.append([*normal, -float(normal @ edge)])
        true, _ = task.refine(relaxed)
        if true.solved:
            vertices.append(true.trajectory(aimed).position[-1, :2])
    if len(vertices) < 3:
        return None
    try:
        hull = ConvexHull(np.array(vertices))
    except QhullError:
        return None  # no area: a point or a line
    return ReachableSlice(time, np.array(vertices), hull.equations, np.array(outer))
