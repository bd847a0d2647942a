"""What is kept of an episode: every look, decision and segment, and how it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.quaternion import tilt_angle
from hda.flight.outcome import Outcome, RewardTerms
from hda.flight.vehicle import Segment
from hda.policy import Decision
from hda.task.observation import Observation
from hda.task.scenario import Scenario

if TYPE_CHECKING:
    from hda.flight.episode import Leg


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """One flown episode. n nodes have n - 1 intervals.

    Attributes:
        policy: name of the policy.
        scenario: what was flown.
        observations: every look, in order.
        decisions: every decision, in order.
        segments: the flown path after each decision, at the control rate.
        rewards: reward terms of each decision.
        outcome: how it ended.
        minimum_slant_angle: [rad] least elevation of the lander seen from the current target at decision
            instants.
        decision_time: [s] shape (decisions,), wall time that the policy took; not reproducible.
    """

    policy: str
    scenario: Scenario
    observations: tuple[Observation, ...]
    decisions: tuple[Decision, ...]
    segments: tuple[Segment, ...]
    rewards: tuple[RewardTerms, ...]
    outcome: Outcome
    minimum_slant_angle: float
    decision_time: Array

    @property
    def time(self) -> Array:
        """[s] shape (n,), time of each node."""
        parts = [self.observations[k].time + s.time[:-1] for k, s in enumerate(self.segments)]
        last = self.observations[len(self.segments) - 1].time + self.segments[-1].time[-1:]
        return np.concatenate([*parts, last])

    @property
    def path(self) -> Array:
        """Shape (n, 7): position [m], velocity [m/s] and mass [kg] at each node."""
        return np.concatenate([*(s.path[:-1] for s in self.segments), self.segments[-1].path[-1:]])

    @property
    def position(self) -> Array:
        """[m] shape (n, 3)."""
        return self.path[:, :3]

    @property
    def velocity(self) -> Array:
        """[m/s] shape (n, 3)."""
        return self.path[:, 3:6]

    @property
    def mass(self) -> Array:
        """[kg] shape (n,)."""
        return self.path[:, 6]

    @property
    def body_path(self) -> Array | None:
        """Shape (n, 17), a body's states in the order of `guidance.rigid_body.state.SIZE`; or None."""
        parts = [s.body_path for s in self.segments if s.body_path is not None]
        if not parts:
            return None
        return np.concatenate([*(part[:-1] for part in parts), parts[-1][-1:]])

    @property
    def commanded_thrust(self) -> Array:
        """[N] shape (n - 1, 3), site frame, command within the vehicle's limits, held over each interval.

        A rigid body gives what of it lies along its axis, with the engine's lag.
        """
        return np.concatenate([s.commanded for s in self.segments])

    @property
    def thrust(self) -> Array:
        """[N] shape (n - 1, 3), site frame, applied over each interval.

        Of a point mass it is the command with the thrust error, held. Of a rigid body it is a mean: its size
        is what the burnt mass tells, its direction that of the velocity gained against gravity.
        """
        if self.body_path is not None:
            return self._mean_thrust()
        return np.concatenate([s.commanded * (1.0 + s.thrust_error) for s in self.segments])

    @property
    def maximum_thrust(self) -> float:
        """[N] greatest applied thrust; of a rigid body the greatest at a node."""
        if self.body_path is not None:
            return float(np.linalg.norm(self.body_path[:, 14:17], axis=1).max())
        return float(np.sqrt((self.thrust**2).sum(axis=1).max()))

    @property
    def maximum_tilt(self) -> float:
        """[rad] greatest angle of the thrust from the vertical while the engine burnt; 0 if it never did.

        Of a rigid body the greatest angle of its axis at a node, whether the engine burnt or not.
        """
        if self.body_path is not None:
            return max(float(tilt_angle(attitude)) for attitude in self.body_path[:, 6:10])
        east, north, up = self.commanded_thrust.T + 0.0  # no thrust reads as 0, and -0.0 as 0.0
        return float(np.arctan2(np.hypot(east, north), up).max())

    def _mean_thrust(self) -> Array:
        preset, time = self.scenario.preset, np.diff(self.time)
        gained = np.diff(self.velocity, axis=0) - time[:, None] * np.array(preset.gravity)
        impulse = -np.diff(self.mass) * preset.lander.exhaust_velocity
        scale = np.linalg.norm(gained, axis=1) * time
        return gained * np.divide(impulse, scale, out=np.zeros_like(scale), where=scale > 0.0)[:, None]

    @property
    def pointing_limited(self) -> int:
        """Control periods in which the lander's pointing limit changed the commanded thrust."""
        return sum(segment.pointing_limited for segment in self.segments)

    @property
    def total_reward(self) -> float:
        """Sum of the rewards, undiscounted."""
        return float(sum(terms.total for terms in self.rewards))

    @property
    def fallbacks(self) -> int:
        """Decisions that fell back from the policy's own law."""
        return sum(decision.status.is_fallback for decision in self.decisions)


def join_legs(policy: str, scenario: Scenario, legs: Sequence[Leg]) -> EpisodeRecord:
    """The record of a flight from its legs, the first to the one that ends the episode."""
    outcome = legs[-1].step.outcome
    assert outcome is not None
    return EpisodeRecord(
        policy=policy,
        scenario=scenario,
        observations=tuple(leg.observation for leg in legs),
        decisions=tuple(leg.decision for leg in legs),
        segments=tuple(leg.step.segment for leg in legs),
        rewards=tuple(leg.step.reward for leg in legs),
        outcome=outcome,
        minimum_slant_angle=min(leg.step.slant_angle for leg in legs),
        decision_time=np.array([leg.decision_time for leg in legs]),
    )
