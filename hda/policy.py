"""The seam: what a policy is, what it decides, and what the vehicle flies until the next decision."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

import numpy as np

from guidance.arrays import Array
from guidance.tracking.reference import TrackingReference
from guidance.validation import finite_number, finite_vector
from hda.task.observation import Observation, ScenarioView

if TYPE_CHECKING:
    from hda.task.scenario import Scenario

Memory = TypeVar("Memory")


class DecisionStatus(StrEnum):
    """How a decision came about."""

    NOMINAL = "nominal"
    """The policy's own law answered."""
    FALLBACK_NEAREST = "fallback-nearest"
    """The site could not be reached: a plan to the nearest reachable point."""
    FALLBACK_LAST_PLAN = "fallback-last-plan"
    """The planner gave no answer: the last plan flies on."""
    FALLBACK_ZEM_ZEV = "fallback-zem-zev"
    """The planner gave no answer and there is no plan: ZEM/ZEV."""

    @property
    def is_fallback(self) -> bool:
        """Whether the policy's own law failed to answer."""
        return self is not DecisionStatus.NOMINAL


@dataclass(frozen=True)
class ZemZevCommand:
    """Fly ZEM/ZEV feedback to the decision's site.

    Attributes:
        position_gain: K_R, 6 for least energy.
        velocity_gain: K_V, 2 for least energy.
        time_to_go: [s] at the decision, above zero; it counts down in flight.
        time_to_go_rate: seconds of time to go that pass in one second; 1 for a clock.

    Raises:
        ValueError: a field is not finite, or the time to go or its rate is not positive.
    """

    position_gain: float
    velocity_gain: float
    time_to_go: float
    time_to_go_rate: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what the vehicle could not fly."""
        finite_number("position_gain", self.position_gain)
        finite_number("velocity_gain", self.velocity_gain)
        finite_number("time_to_go", self.time_to_go, above=0.0)
        finite_number("time_to_go_rate", self.time_to_go_rate, above=0.0)


@dataclass(frozen=True, eq=False)
class PlanCommand:
    """Track a planned descent; the flight ends where the plan does.

    Attributes:
        reference: states at the control instants from this decision on.
        gains: (K_r [1/s^2], K_v [1/s]) of the feedback about it, along each axis.
        assumed_error: relative error of the thrust that the feedback reckons with until it has felt the
            engine for a control period.
        lateral_gains: as `gains`, across the vertical, if they are others there: a rigid body throttles
            sooner than it turns.
        lead: [s] by which a rigid body points ahead of the reference; a point mass needs none.

    Raises:
        ValueError: the assumed error is -1 or less: no engine answers, or above 1; or the lead is negative.
    """

    reference: TrackingReference
    gains: tuple[float, float]
    assumed_error: float = 0.0
    lateral_gains: tuple[float, float] | None = None
    lead: float = 0.0

    def __post_init__(self) -> None:
        """Refuse an engine that no command moves."""
        finite_number("assumed_error", self.assumed_error, above=-1.0, at_most=1.0)
        finite_number("lead", self.lead, at_least=0.0)


Command = ZemZevCommand | PlanCommand


@dataclass(frozen=True, eq=False)
class Decision:
    """Where to land and how to fly there until the next look.

    Attributes:
        site: [m] shape (3,), the new target; the next look is centred on it.
        command: what the vehicle flies.
        status: how the decision came about; a fallback is counted in the table.

    Raises:
        ValueError: the site is not three finite numbers.
    """

    site: Array
    command: Command
    status: DecisionStatus = DecisionStatus.NOMINAL

    def __post_init__(self) -> None:
        """Copy the site and freeze it."""
        site = finite_vector("site", self.site, 3)
        site.flags.writeable = False
        object.__setattr__(self, "site", site)


@runtime_checkable
class Policy(Protocol[Memory]):
    """Maps an observation to a decision. Memory goes in and comes out; the object holds none."""

    @property
    def name(self) -> str:
        """Name in tables."""
        ...

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> Memory:
        """Memory before the first look; `rng` is the policy's own stream, kept in the memory if needed."""
        ...

    def decide(self, observation: Observation, memory: Memory) -> tuple[Decision, Memory]:
        """Decide on one observation; return the decision and the memory for the next."""
        ...


@runtime_checkable
class PrivilegedPolicy(Protocol):
    """A policy that sees the true map. `fly` gives it the scenario; every table marks it."""

    @property
    def privileged(self) -> bool:
        """Always true."""
        ...

    @property
    def name(self) -> str:
        """Name in tables."""
        ...

    def informed(self, truth: Scenario) -> Policy:
        """Make the policy that knows this scenario: the true map, and the true state at its start."""
        ...
