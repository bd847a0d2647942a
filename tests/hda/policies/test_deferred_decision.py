"""The deferred-decision policy: its candidates, when it commits, and that it lands."""

import numpy as np
import pytest

from hda.flight.episode import begin_flight, fly, observe
from hda.policies.deferred_decision import Candidates, DeferredDecisionOptions, DeferredDecisionPolicy
from hda.task.scenario import sample_scenario


def test_chances_are_those_of_the_first_safe_candidate():
    candidates = Candidates(np.zeros((3, 3)), np.array([0.9, 0.5, 1.0]))
    np.testing.assert_allclose(candidates.chances, [0.9, 0.05, 0.05])
    assert candidates.without((1,)).sites.shape == (2, 3)


@pytest.mark.parametrize("field", ["candidates", "nodes", "dispersion", "keep_probability", "budget"])
def test_an_option_that_means_nothing_is_named(field):
    with pytest.raises(ValueError, match=field):
        DeferredDecisionOptions(**{field: -1})


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
