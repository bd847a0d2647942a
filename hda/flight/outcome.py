"""How an episode ended, and what that is worth: pure functions of a flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from guidance.arrays import Array
from guidance.lander import Lander
from guidance.state import State
from hda.flight.touchdown_report import TouchdownReport
from hda.task.rules import Rules


class Ending(StrEnum):
    """One word for the end of an episode, the gravest that holds."""

    SUCCESS = "success"
    """Safe ground, soft touchdown, propellant left."""
    HARD_LANDING = "hard-landing"
    """Safe ground, but too fast; of a rigid body also leaning or turning too far."""
    UNSAFE_SITE = "unsafe-site"
    """Landed on a hazard or outside the map."""
    CRASH = "crash"
    """Touchdown above the crash speed; on real ground also a strike on the way, or a fall to the side."""
    TANK_EMPTY = "tank-empty"
    """The propellant ran out before touchdown."""
    TIMED_OUT = "timed-out"
    """Still in flight after the last decision."""


ENDINGS: dict[str, str] = {
    Ending.SUCCESS: "landed softly on safe ground",
    Ending.HARD_LANDING: "reached safe ground, but not gently enough to be a success",
    Ending.UNSAFE_SITE: "touched down on hazardous ground",
    Ending.CRASH: "crashed into the ground",
    Ending.TANK_EMPTY: "ran out of propellant above the ground",
    Ending.TIMED_OUT: "was still in flight after its last decision",
}
"""Each ending in words that follow the name of who flew."""


@dataclass(frozen=True)
class Contact:
    """How the plane or the ground was met.

    Attributes:
        landed: it was.
        safe_cell: the cell there is safe.
        tank_empty: the tank ran dry before.
        report: how the lander stands on real ground; None where flights end on the plane.
    """

    landed: bool
    safe_cell: bool
    tank_empty: bool
    report: TouchdownReport | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """What is known at the end of an episode.

    Attributes:
        ending: one word for it.
        touchdown: [m] shape (3,), where the target plane was crossed or the ground touched (or the last
            position, if timed out).
        safe_site: the touchdown cell is safe, the paper's ratio; on real ground, slope and clearance keep
            their limits where the lander stands. False if timed out.
        success: safe site, soft touchdown, propellant left, no crash.
        miss_distance: [m] from the touchdown to the last target.
        touchdown_speed: [m/s].
        propellant_fraction: propellant burnt over propellant at the start.
        report: of the touchdown on real ground; None where flights end on the plane, or in flight.
    """

    ending: Ending
    touchdown: Array
    safe_site: bool
    success: bool
    miss_distance: float
    touchdown_speed: float
    propellant_fraction: float
    report: TouchdownReport | None = None


def classify(
    initial: State,
    final: State,
    target: Array,
    contact: Contact,
    lander: Lander,
    rules: Rules,
) -> Outcome:
    """Judge the end of a flight.

    Args:
        initial: state at t = 0.
        final: state at the crossing of the plane or the contact, or after the last decision.
        target: [m] shape (3,), the last target.
        contact: how the plane or the ground was met.
        lander: the vehicle.
        rules: they set the speed limits; those of a touchdown on real ground are in its report.
    """
    report = contact.report
    speed = float(np.linalg.norm(final.velocity))
    horizontal = math.hypot(final.velocity[0], final.velocity[1])
    soft = abs(final.velocity[2]) <= rules.soft_speed and horizontal <= rules.soft_speed
    safe_site = contact.landed and contact.safe_cell
    wrecked = speed > rules.crash_speed
    if report is not None:
        soft, safe_site = report.soft, report.safe_ground
        wrecked = wrecked or report.wrecked
    if not contact.landed:
        ending = Ending.TIMED_OUT
    elif contact.tank_empty:
        ending = Ending.TANK_EMPTY
    elif wrecked:
        ending = Ending.CRASH
    elif not safe_site:
        ending = Ending.UNSAFE_SITE
    elif not soft:
        ending = Ending.HARD_LANDING
    else:
        ending = Ending.SUCCESS
    return Outcome(
        ending=ending,
        touchdown=final.position.copy(),
        safe_site=safe_site,
        success=ending is Ending.SUCCESS,
        miss_distance=float(np.linalg.norm(final.position - target)),
        touchdown_speed=speed,
        propellant_fraction=(initial.mass - final.mass) / (initial.mass - lander.dry_mass),
        report=report,
    )


@dataclass(frozen=True)
class RewardWeights:
    """The paper's reward weights, applied with the signs it means (penalties lower the reward).

    Attributes:
        propellant: per fraction of the propellant (alpha_m).
        failure: for a crash or an empty tank (alpha_f).
        speed: per m/s at the end (alpha_v).
        miss: per metre from the last target at the end (alpha_r).
        safety: for safe ground, lost on unsafe ground (alpha_s).
    """

    propellant: float = 1.0
    failure: float = -10.0
    speed: float = 0.1
    miss: float = 0.01
    safety: float = 1.0


@dataclass(frozen=True)
class RewardTerms:
    """The named parts of one step's reward, each already weighted and signed."""

    propellant: float = 0.0
    failure: float = 0.0
    speed: float = 0.0
    miss: float = 0.0
    safety: float = 0.0

    @property
    def total(self) -> float:
        """Sum of the terms."""
        return self.propellant + self.failure + self.speed + self.miss + self.safety


def score_step(
    propellant_fraction: float, outcome: Outcome | None, weights: RewardWeights = RewardWeights()
) -> RewardTerms:
    """Reward of one decision interval (paper, equation of r_t, signs as meant).

    Args:
        propellant_fraction: propellant burnt in the interval over propellant at the start of the episode.
        outcome: the outcome if the interval ended the episode, else None.
        weights: weights of the terms.
    """
    propellant = -weights.propellant * propellant_fraction
    if outcome is None:
        return RewardTerms(propellant=propellant)
    failed = outcome.ending in (Ending.CRASH, Ending.TANK_EMPTY)
    return RewardTerms(
        propellant=propellant,
        failure=weights.failure if failed else 0.0,
        speed=-weights.speed * outcome.touchdown_speed,
        miss=-weights.miss * outcome.miss_distance,
        safety=weights.safety if outcome.safe_site else -weights.safety,
    )
