"""Fuel-optimal guidance in closed loop: replan at each look, track the plan, fall back in a stated order."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from guidance.arrays import Array
from guidance.descent.plan import PlanStatus
from guidance.lander import Lander
from guidance.state import State
from guidance.tracking.engine_error import assumed_error, bearing_margin
from guidance.tracking.reference import TrackingReference
from guidance.tracking.regulator import DEFAULT_WEIGHTS, TrackingWeights, tracking_gains
from guidance.tracking.retarget import shift_landing_point
from guidance.tracking.soft_landing import DEFAULT_OPTIONS, SoftLanding, SoftLandingOptions, plan_soft_landing
from hda.policies.turning_law import TurningLaw, load_smooth_planner
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import Command, DecisionStatus, PlanCommand
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True, eq=False)
class DescentMemory:
    """What planned guidance remembers between looks.

    Attributes:
        view: the scenario.
        site: [m] shape (3,), where the last plan goes; None before the first.
        reference: what is left of the last plan at the next look; None if nothing is.
    """

    view: ScenarioView
    site: Array | None = None
    reference: TrackingReference | None = None


@dataclass(frozen=True)
class PlannedDescent:
    """Plan the least-propellant descent at each look and track it; for a rigid body a smooth one.

    If the site is out of reach it flies to the reachable point nearest to it; if the planner gives no answer,
    the last plan flies on; if there is none, ZEM/ZEV flies. Each is labelled in the decision's status.

    Attributes:
        options: how plans are made.
        weights: feedback about them.
        commit_time: [s] with less time left than this, and the same site, the last plan flies on as it is.
        bears_engine: the thrust margin is at least the bound of the engine's error
            (`guidance.tracking.engine_error`), and an engine that the margin does not cover by far is taken
            for a weak one until it is felt; else the options' margin stays as it is.
        turning: how a rigid body is flown instead.
    """

    options: SoftLandingOptions = DEFAULT_OPTIONS
    weights: TrackingWeights = DEFAULT_WEIGHTS
    commit_time: float = 10.0
    bears_engine: bool = True
    turning: TurningLaw = field(default_factory=TurningLaw)

    def begin(self, view: ScenarioView) -> DescentMemory:
        """No plan yet; the planner is made ready here, so that the first decision does not wait for it."""
        if view.body is None:
            _load_planner(self.options_for(view), self.weights, view.control_period)
        else:
            load_smooth_planner(self.turning, view.control_period)
        return DescentMemory(view)

    def command(
        self, observation: Observation, site: Array, memory: DescentMemory
    ) -> tuple[Command, DecisionStatus, DescentMemory]:
        """Replan, or fly on."""
        memory = raise_plan(memory, site)
        remaining = memory.reference
        same_site = memory.site is not None and np.array_equal(site, memory.site)
        if same_site and remaining is not None and remaining.duration <= self.commit_time:
            return self._track(observation, remaining, DecisionStatus.NOMINAL, memory)
        landing = self._plan(observation, site, memory, remaining if same_site else None)
        if same_site and remaining is not None and (landing is None or landing.reference is None):
            return self._track(
                observation, remaining, DecisionStatus.NOMINAL, memory
            )  # the plan in flight is still good
        if landing is not None and landing.reference is not None:
            nearest = landing.status is PlanStatus.NEAREST
            status = DecisionStatus.FALLBACK_NEAREST if nearest else DecisionStatus.NOMINAL
            return self._track(observation, landing.reference, status, replace(memory, site=site.copy()))
        if remaining is not None:
            return self._track(observation, remaining, DecisionStatus.FALLBACK_LAST_PLAN, memory)
        command, _, _ = FixedGainZemZev().command(observation, site, memory.view)
        return command, DecisionStatus.FALLBACK_ZEM_ZEV, replace(memory, site=None, reference=None)

    def _plan(
        self,
        observation: Observation,
        site: Array,
        memory: DescentMemory,
        remaining: TrackingReference | None,
    ) -> SoftLanding | None:
        """Ask the planner; None where the question itself is out of its range, such as below the gate."""
        view, state = memory.view, observation.state
        if state.mass <= view.lander.dry_mass:
            return None
        if view.body is not None:
            smooth = self.turning.plan(observation, site, view)
            return SoftLanding(
                PlanStatus.LIMIT_REACHED if smooth is None else PlanStatus.OPTIMAL, smooth, None
            )
        duration = self.options.terminal_periods * view.control_period
        if state.position[2] - site[2] <= 0.5 * self.options.terminal_deceleration * duration**2:
            return None
        periods = None if remaining is None else remaining.thrust_acceleration.shape[0]
        options = self.options_for(view)
        return plan_soft_landing(
            state, site, view.lander, view.control_period, options, view.gravity, periods
        )

    def options_for(self, view: ScenarioView) -> SoftLandingOptions:
        """How plans are made for this lander: with a margin that bears its engine."""
        if not self.bears_engine:
            return self.options
        margin = bearing_margin(view.rules.thrust_error, self.options.thrust_margin)
        return replace(self.options, thrust_margin=margin)

    def command_of(self, reference: TrackingReference, view: ScenarioView, mass: float) -> PlanCommand:
        """The command that tracks a reference from now on, with a vehicle of `mass` [kg]."""
        if view.body is not None:
            return self.turning.command(reference, view.control_period)
        gains = tracking_gains(view.control_period, self.weights)
        if not self.bears_engine:
            return PlanCommand(reference, gains)
        greatest, margin = view.lander.max_thrust / mass, self.options_for(view).thrust_margin
        assumed = assumed_error(reference, greatest, view.rules.thrust_error, margin, view.control_periods)
        return PlanCommand(reference, gains, assumed)

    def _track(
        self,
        observation: Observation,
        reference: TrackingReference,
        status: DecisionStatus,
        memory: DescentMemory,
    ) -> tuple[PlanCommand, DecisionStatus, DescentMemory]:
        view = memory.view
        command = self.command_of(reference, view, observation.state.mass)
        return command, status, replace(memory, reference=reference.after(view.control_periods))


def raise_plan(memory: DescentMemory, site: Array) -> DescentMemory:
    """The memory with its plan raised or lowered to a new height of the same place; as it was elsewhere."""
    remaining, old = memory.reference, memory.site
    if remaining is None or old is None or not np.array_equal(site[:2], old[:2]) or site[2] == old[2]:
        return memory
    end = remaining.position[-1] + (site - old)
    return replace(
        memory, site=site.copy(), reference=shift_landing_point(remaining, end, memory.view.gravity)
    )


@lru_cache(maxsize=8)
def _load_planner(options: SoftLandingOptions, weights: TrackingWeights, control_period: float) -> None:
    """Plan a descent once per process: compiled code is loaded and the programme's sparsity is set up."""
    tracking_gains(control_period, weights)
    state = State(np.array([200.0, 100.0, 900.0]), np.array([-8.0, -4.0, -30.0]), 1200.0)
    if options.method in ("auto", "convex"):
        plan_soft_landing(state, np.zeros(3), Lander(), control_period, options)
