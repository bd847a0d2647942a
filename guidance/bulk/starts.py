"""What is asked in bulk: many starts, many targets, one vehicle and one set of limits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.descent.limits import NO_LIMITS, Limits
from guidance.descent.problem import LARGEST_NUMBER, ROUNDING, LandingProblem
from guidance.lander import Lander
from guidance.state import State
from guidance.validation import finite_vector

_VECTORS = ("gravity", "target_velocity", "angular_velocity")


@dataclass(frozen=True, eq=False)
class Starts:
    """N landing problems of one lander; arrays are read-only.

    Attributes:
        states: (x, y, z, vx, vy, vz, mass) in SI, shape (N, 7).
        targets: [m] shape (N, 3), site frame.
        lander: the vehicle.
        gravity: [m/s^2] shape (3,).
        limits: what the paths have to keep.
        target_velocity: [m/s] shape (3,), at the targets.
        angular_velocity: [rad/s] shape (3,), of the site frame.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape; the first row that is so
            is named.
    """

    states: Array
    targets: Array
    lander: Lander
    gravity: Array
    limits: Limits = NO_LIMITS
    target_velocity: Array = field(default_factory=lambda: np.zeros(3))
    angular_velocity: Array = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def parse(
        cls,
        states: State | ArrayLike,
        targets: ArrayLike,
        lander: Lander,
        limits: Limits = NO_LIMITS,
        **vectors: ArrayLike,
    ) -> Starts:
        """Accept one state or N, and one target or N; `vectors` by their names, gravity at least."""
        if isinstance(states, State):
            states = states.as_array()
        rows, sites = _finite_rows("states", states, 7), _finite_rows("targets", targets, 3)
        if len(rows) != len(sites) and 1 not in (len(rows), len(sites)):
            raise ValueError(
                f"states and targets must be as many, or one of either, got {len(rows)} and {len(sites)}"
            )
        count = 0 if 0 in (len(rows), len(sites)) else max(len(rows), len(sites))
        return cls(
            np.broadcast_to(rows, (count, 7)).copy(),
            np.broadcast_to(sites, (count, 3)).copy(),
            lander,
            limits=limits,
            **{name: finite_vector(name, vector, 3) for name, vector in vectors.items()},
        )

    def __post_init__(self) -> None:
        """Refuse what no solver should see."""
        if not isinstance(self.lander, Lander):
            raise ValueError(f"lander must be a Lander, got {self.lander!r}")
        for name in _VECTORS:
            numbers = getattr(self, name)
            if np.abs(numbers).max() > LARGEST_NUMBER:
                raise ValueError(f"{name}: no number may exceed {LARGEST_NUMBER:g}, got {numbers.tolist()}")
        for name, rows in (("states", self.states), ("targets", self.targets)):
            _refuse(
                name,
                np.abs(rows).max(axis=1, initial=0.0) > LARGEST_NUMBER,
                f"no number may exceed {LARGEST_NUMBER:g}",
            )
        light = self.states[:, 6] <= self.lander.dry_mass
        _refuse("states", light, f"mass must exceed the dry mass {self.lander.dry_mass:g} kg")
        offset = self.states[:, :3] - self.targets
        depth = -offset[:, 2]
        below = (depth > 0.0) & (depth > ROUNDING * np.maximum(1.0, np.linalg.norm(offset, axis=1)))
        _refuse("states", below, "the start lies below the target's altitude")
        for array in (self.states, self.targets, *(getattr(self, name) for name in _VECTORS)):
            array.flags.writeable = False

    def __len__(self) -> int:
        """N."""
        return len(self.states)

    @property
    def in_bulk(self) -> bool:
        """Whether the indirect method knows such problems: an end at rest, in a frame that does not turn.

        Nor does it know a limited rate of the thrust.
        """
        still = not (self.target_velocity.any() or self.angular_velocity.any())
        return still and self.limits.thrust_rate is None

    def problem(self, index: int) -> LandingProblem:
        """One of the landing problems."""
        return LandingProblem(
            State.parse(self.states[index]),
            self.targets[index],
            self.lander,
            self.gravity,
            self.limits,
            self.target_velocity,
            self.angular_velocity,
        )


def _finite_rows(name: str, value: ArrayLike, size: int) -> Array:
    """The value as rows of finite numbers, shape (n, size); a single row is one."""
    try:
        rows = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be rows of {size} numbers") from error
    if rows.ndim not in (1, 2) or rows.shape[-1] != size:
        raise ValueError(f"{name} must have shape ({size},) or (N, {size}), got {rows.shape}")
    rows = rows.reshape(-1, size)
    _refuse(name, np.logical_not(np.isfinite(rows).all(axis=1)), "must be finite")
    return rows


def _refuse(name: str, wrong: np.ndarray, words: str) -> None:
    if wrong.any():
        raise ValueError(f"{name}[{int(wrong.argmax())}]: {words}")
