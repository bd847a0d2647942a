"""Deferred decision: keep several candidate sites open on one trunk, and commit when its branches part.

The peer from the literature (Elango et al., 2025; HALO, Hayner, Buckner et al., 2023). The belief ranks the
candidates. While the longest trunk that the budget allows reaches the next look, it is flown; when it does
not, the best candidate is committed to, and left only if a later look shows it to be unsafe.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.descent.plan import PlanStatus
from guidance.planning.deferred_decision import DeferredDecision, TrunkOptions, plan_deferred
from guidance.tracking.reference import TrackingReference
from guidance.tracking.soft_landing import SoftLanding, plan_soft_landing, sample_descent
from guidance.validation import finite_number
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.beliefs.belief import GroundBelief
from hda.policies.hazard_aware import HazardAwareSite, fuse_look, judge_ground, landing_spread
from hda.policies.landing_dispersion import landing_probability
from hda.policies.planned_descent import DescentMemory
from hda.policies.site_price import HazardAwareWeights
from hda.policies.turning_law import reversal_time
from hda.policy import Decision, DecisionStatus
from hda.task.observation import Observation, ScenarioView

_NEVER = 1e9  # [s] no later look counts in the ranking


@dataclass(frozen=True)
class DeferredDecisionOptions:
    """How candidates are chosen and kept open; tuned on the tuning tiles.

    Attributes:
        candidates: most sites that are kept open.
        separation: [m] least distance between two of them, along one axis at least.
        budget: [kg] by which each branch may exceed its candidate's cheapest flight.
        failure_cost: [kg] of propellant that a failed landing is worth, in the ranking.
        dispersion: [m] standard deviation of the touchdown about the site, along each axis, before that of a
            filter is added (`landing_spread`).
        switch_gain: [kg] by which another site must be better than the present one to come first.
        keep_probability: a site committed to is kept while a landing there is at least this likely to be
            safe.
        commit_time: [s] with less time to go than this the site is kept whatever is seen.
        nodes: of each branch.
        sheds: where the trunk to all candidates parts too early, the last of them is given up and the others
            are kept open, down to two (HALO); else the first is committed to at once.
    """

    candidates: int = 3
    separation: float = 15.0
    budget: float = 0.5
    failure_cost: float = 200.0
    dispersion: float = 0.3
    switch_gain: float = 0.05
    keep_probability: float = 0.9
    commit_time: float = 2.5
    nodes: int = 21
    sheds: bool = False

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        finite_number("candidates", self.candidates, at_least=1)
        finite_number("nodes", self.nodes, at_least=3)
        finite_number("keep_probability", self.keep_probability, at_least=0.0, at_most=1.0)
        for name in ("separation", "budget", "failure_cost", "switch_gain", "commit_time"):
            finite_number(name, getattr(self, name), at_least=0.0)
        finite_number("dispersion", self.dispersion, above=0.0)


@dataclass(frozen=True, eq=False)
class DeferredDecisionMemory:
    """What the policy remembers between looks.

    Attributes:
        view: the scenario.
        descent: memory of the guidance law.
        belief: from all looks so far; None before the first.
        committed: whether the branches have parted.
        parting_time: [s] when they will, as planned at the last look and counted from this one; None before.
    """

    view: ScenarioView
    descent: DescentMemory
    belief: GroundBelief | None = None
    committed: bool = False
    parting_time: float | None = None


@dataclass(frozen=True, eq=False)
class Candidates:
    """Sites worth keeping open, the best first.

    Attributes:
        sites: [m] shape (k, 3).
        probability: shape (k,), that a landing there ends on safe ground.
    """

    sites: Array
    probability: Array

    @property
    def chances(self) -> Array:
        """Shape (k,): chance that each is the first safe one in this order."""
        unsafe = 1.0 - self.probability
        return self.probability * np.concatenate([[1.0], np.cumprod(unsafe[:-1])])

    def first(self, count: int) -> Candidates:
        """The best of them."""
        return Candidates(self.sites[:count], self.probability[:count])

    def without(self, numbers: tuple[int, ...]) -> Candidates:
        """Those not numbered."""
        kept = [k for k in range(len(self.sites)) if k not in numbers]
        return Candidates(self.sites[kept], self.probability[kept])


@dataclass(frozen=True, eq=False)
class _Trunk:
    """The flight to the first candidate, and the time [s] at which the others' part from it."""

    reference: TrackingReference
    parting_time: float


@dataclass(frozen=True)
class DeferredDecisionPolicy:
    """Fly the trunk to several candidates; commit when its branches part.

    Attributes:
        name: name in tables.
        options: how candidates are chosen and kept open.
        descent: guidance once committed, and where there is nothing to defer.
    """

    name: str = "deferred-decision"
    options: DeferredDecisionOptions = DeferredDecisionOptions()
    descent: AdjustedDescent = field(default_factory=AdjustedDescent)

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> DeferredDecisionMemory:
        """Nothing seen yet; no random numbers are drawn."""
        self._ranking().begin(scenario_view)
        return DeferredDecisionMemory(scenario_view, self.descent.begin(scenario_view))

    def decide(
        self, observation: Observation, memory: DeferredDecisionMemory
    ) -> tuple[Decision, DeferredDecisionMemory]:
        """Fuse the look, rank the candidates, and fly the trunk or the site committed to."""
        first = memory.belief is None
        belief = fuse_look(observation, memory.view, memory.belief)
        memory = replace(memory, belief=belief)
        height = float(observation.state.position[2] - observation.target[2])
        if height <= 0.0 or (not first and observation.time_to_go <= self._commit_time(memory.view)):
            return self._fly_to(observation.target, observation, replace(memory, committed=True))
        safe = judge_ground(belief)
        present = belief.cell(observation.target)
        if memory.committed and present is not None:
            landing = landing_probability(safe, self._spread(observation), present)
            if landing >= self.options.keep_probability:
                return self._fly_to(observation.target, observation, memory)
        price = self._ranking().price_by(safe, observation, memory.view, belief)
        candidates = self._choose(price, safe, observation, belief)
        trunk = None if memory.committed else self._defer(observation, candidates, memory)
        if trunk is None:
            return self._fly_to(candidates.sites[0], observation, replace(memory, committed=True))
        return self._track(trunk, candidates.sites[0], memory, observation.state.mass)

    def _ranking(self) -> HazardAwareSite:
        """The objective of `hazard_aware` without the looks to come: deferral stands in for them."""
        return HazardAwareSite(
            HazardAwareWeights(
                failure_cost=self.options.failure_cost,
                divert_cost=0.0,
                dispersion=self.options.dispersion,
                commit_time=_NEVER,
            )
        )

    def _commit_time(self, view: ScenarioView) -> float:
        """[s] of time to go below which the site is kept: of a rigid body, what a divert takes."""
        own = self.options.commit_time
        return own if view.body is None else max(own, reversal_time(view.body))

    def _spread(self, observation: Observation) -> float:
        """[m] scatter of a landing, as the ranking counts it: of control, and of a filter if there is one."""
        return landing_spread(observation, self.options.dispersion)

    def _choose(
        self, price: Array, safe: NDArray[np.float32], observation: Observation, belief: GroundBelief
    ) -> Candidates:
        """The best site, then the best of those far enough from all before, and so on."""
        options, price = self.options, price.copy()
        apart = max(math.ceil(options.separation) - 1, 0)
        present = belief.cell(observation.target)
        cells: list[tuple[int, int]] = []
        for _ in range(options.candidates):
            row, column = divmod(int(np.argmin(price)), price.shape[1])
            if not math.isfinite(price[row, column]):
                break
            if (
                not cells
                and present is not None
                and price[present] <= price[row, column] + options.switch_gain
            ):
                row, column = present
            cells.append((row, column))
            price[max(row - apart, 0) : row + apart + 1, max(column - apart, 0) : column + apart + 1] = np.inf
        plane = float(observation.target[2])
        sites = np.array([observation.settled(belief.site(*cell, plane)) for cell in cells])
        if cells[0] == present:
            sites[0] = observation.target
        spread = self._spread(observation)
        return Candidates(sites, np.array([landing_probability(safe, spread, cell) for cell in cells]))

    def _defer(
        self, observation: Observation, candidates: Candidates, memory: DeferredDecisionMemory
    ) -> _Trunk | None:
        """The trunk and its first branch; None where the trunk does not reach the next look."""
        view, planned = memory.view, self.descent.planned
        landing = self._soft_landing(observation, candidates.sites[0], view)
        if landing is None or landing.status is not PlanStatus.OPTIMAL or landing.plan is None:
            return None
        answer = self._branch(landing, candidates, memory.parting_time)
        if len(answer.unreachable) > 0 and 0 not in answer.unreachable:
            candidates = candidates.without(answer.unreachable)
            answer = self._branch(landing, candidates, memory.parting_time)
        while self.options.sheds and len(candidates.sites) > 2 and not self._reaches_next_look(answer, view):
            candidates = candidates.first(len(candidates.sites) - 1)
            answer = self._branch(landing, candidates, memory.parting_time)
        if not self._reaches_next_look(answer, view):
            return None
        options = planned.options
        sinking = options.terminal_deceleration * options.terminal_periods * view.control_period
        reference = sample_descent(answer.plans[0], sinking, view.control_period, options)
        return _Trunk(reference, answer.parting_time)

    def _reaches_next_look(self, answer: DeferredDecision, view: ScenarioView) -> bool:
        """Whether there is something to defer, and the trunk lasts until more is known."""
        return len(answer.plans) >= 2 and answer.parting_time >= view.decision_interval

    def _branch(
        self, landing: SoftLanding, candidates: Candidates, parting_time: float | None
    ) -> DeferredDecision:
        """The programme, in the frame of the plan to the first candidate's gate, and on its level."""
        assert landing.plan is not None
        gate = landing.plan.problem.target
        across = (candidates.sites - candidates.sites[0]) * np.array([1.0, 1.0, 0.0])
        return plan_deferred(
            landing.plan.problem,
            gate + across,
            self.options.budget,
            landing.plan.time_of_flight,
            TrunkOptions(self.options.nodes, candidates.chances, parting_time),
        )

    def _soft_landing(self, observation: Observation, site: Array, view: ScenarioView) -> SoftLanding | None:
        """Plan to the first candidate; None where that is out of the planner's range.

        So it is for a rigid body, which cannot follow a trunk of switched thrust: it flies to the best site.
        """
        if view.body is not None:
            return None
        options, state = self.descent.planned.options_for(view), observation.state
        duration = options.terminal_periods * view.control_period
        if state.mass <= view.lander.dry_mass:
            return None
        if state.position[2] - site[2] <= 0.5 * options.terminal_deceleration * duration**2:
            return None
        return plan_soft_landing(state, site, view.lander, view.control_period, options, view.gravity)

    def _track(
        self, trunk: _Trunk, site: Array, memory: DeferredDecisionMemory, mass: float
    ) -> tuple[Decision, DeferredDecisionMemory]:
        view, reference = memory.view, trunk.reference
        command = self.descent.planned.command_of(reference, view, mass)
        descent = replace(memory.descent, site=site.copy(), reference=reference.after(view.control_periods))
        left = trunk.parting_time - view.decision_interval
        memory = replace(memory, descent=descent, parting_time=left)
        return Decision(site, command, DecisionStatus.NOMINAL), memory

    def _fly_to(
        self, site: Array, observation: Observation, memory: DeferredDecisionMemory
    ) -> tuple[Decision, DeferredDecisionMemory]:
        command, status, descent = self.descent.command(observation, site, memory.descent)
        return Decision(site, command, status), replace(memory, descent=descent)
