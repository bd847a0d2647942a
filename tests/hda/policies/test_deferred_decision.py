"""The deferred-decision policy: its candidates, when it commits, and that it lands."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hda.flight.episode import advance, begin_flight, fly, observe
from hda.policies.beliefs.surroundings import infer_unseen
from hda.policies.deferred_decision import Candidates, DeferredDecisionOptions, DeferredDecisionPolicy
from hda.policies.hazard_aware import fuse_look, landing_spread
from hda.policies.landing_dispersion import landing_probability
from hda.task.scenario import sample_scenario


def test_chances_are_those_of_the_first_safe_candidate():
    candidates = Candidates(np.zeros((3, 3)), np.array([0.9, 0.5, 1.0]))
    np.testing.assert_allclose(candidates.chances, [0.9, 0.05, 0.05])
    assert candidates.without((1,)).sites.shape == (2, 3)
    np.testing.assert_array_equal(candidates.first(2).probability, [0.9, 0.5])


@pytest.mark.parametrize("field", ["candidates", "nodes", "dispersion", "keep_probability", "budget"])
def test_an_option_that_means_nothing_is_named(field):
    options: dict[str, Any] = {field: -1}
    with pytest.raises(ValueError, match=field):
        DeferredDecisionOptions(**options)


def test_it_defers_from_high_up_commits_once_and_lands_softly():
    scenario = sample_scenario("paper", 5, 1, "tuning")
    policy = DeferredDecisionPolicy()
    memory = policy.begin(scenario.view, np.random.default_rng(0))
    observation = observe(scenario, begin_flight(scenario))
    decision, after = policy.decide(observation, memory)
    assert not after.committed
    assert memory.belief is None
    again, _ = policy.decide(observation, memory)
    np.testing.assert_array_equal(decision.site, again.site)
    record = fly(policy, scenario)
    assert record.outcome.success
    assert record.fallbacks == 0


def test_without_a_budget_or_another_candidate_there_is_nothing_to_defer():
    scenario = sample_scenario("paper", 5, 1, "tuning")
    observation = observe(scenario, begin_flight(scenario))
    for options in (DeferredDecisionOptions(candidates=1), DeferredDecisionOptions(budget=0.0)):
        policy = DeferredDecisionPolicy(options=options)
        _, after = policy.decide(observation, policy.begin(scenario.view, np.random.default_rng(0)))
        assert after.committed


def test_a_policy_that_sheds_keeps_two_open_where_the_trunk_to_all_parts_too_early():
    scenario = sample_scenario("paper", 5, 3, "tuning")
    observation = observe(scenario, begin_flight(scenario))
    committed = {}
    for count, sheds in ((7, False), (7, True), (2, False)):
        policy = DeferredDecisionPolicy(options=DeferredDecisionOptions(candidates=count, sheds=sheds))
        _, after = policy.decide(observation, policy.begin(scenario.view, np.random.default_rng(0)))
        committed[count, sheds] = after.committed
    assert committed == {(7, False): True, (7, True): False, (2, False): False}
    record = fly(DeferredDecisionPolicy(options=DeferredDecisionOptions(candidates=7, sheds=True)), scenario)
    assert record.outcome.success
    assert record.fallbacks == 0


@pytest.mark.parametrize("episode", range(2))
def test_shedding_never_commits_where_keeping_all_would_not(episode):
    scenario = sample_scenario("paper", 5, episode, "tuning")
    keeps, sheds = (
        DeferredDecisionPolicy(options=DeferredDecisionOptions(sheds=sheds)) for sheds in (False, True)
    )
    memory, flight = keeps.begin(scenario.view, np.random.default_rng(0)), begin_flight(scenario)
    while not memory.committed:
        look, before = observe(scenario, flight), memory
        decision, memory = keeps.decide(look, before)
        other, after = sheds.decide(look, before)
        assert memory.committed or not after.committed
        if not memory.committed:
            np.testing.assert_array_equal(decision.site, other.site)
        flight = advance(scenario, flight, decision).flight


def test_a_site_committed_to_is_left_where_the_filter_scatters_the_landing_over_a_hazard():
    scenario = sample_scenario("paper", 5, 1, "tuning")
    policy, look = DeferredDecisionPolicy(), observe(scenario, begin_flight(scenario))
    belief = fuse_look(look, scenario.view, None)
    safe = infer_unseen(belief.probability(), belief.seen)
    n = belief.side
    sharp, vague = (replace(look, covariance=sigma**2 * np.eye(6)) for sigma in (0.0, 0.9))
    bound, cells = policy.options.keep_probability, [(row, column) for row in range(n) for column in range(n)]
    row, column = next(
        cell
        for cell in cells
        if landing_probability(safe, landing_spread(sharp, policy.options.dispersion), cell) >= bound
        and landing_probability(safe, landing_spread(vague, policy.options.dispersion), cell) < 0.8 * bound
    )
    site = belief.site(row, column, float(look.target[2]))
    begun = policy.begin(scenario.view, np.random.default_rng(0))
    memory = replace(begun, belief=belief, committed=True)
    blank = np.zeros_like(look.safety_map)  # it shows nothing new
    kept, left = (
        policy.decide(replace(one, target=site, safety_map=blank), memory)[0].site for one in (sharp, vague)
    )
    np.testing.assert_array_equal(kept, site)
    assert np.linalg.norm(left - site) >= 1.0
