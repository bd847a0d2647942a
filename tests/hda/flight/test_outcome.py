"""How an episode ended and what it is worth: every ending, its boundaries, and the reward by hand."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance import PAPER_LANDER, State
from hda.flight.outcome import Contact, Ending, Outcome, RewardWeights, classify, score_step
from hda.task.rules import Rules

TARGET = np.array([400.0, 300.0, 50.0])
INITIAL = State(np.array([300.0, 200.0, 950.0]), np.array([5.0, 5.0, -30.0]), 1200.0)
RULES = Rules()


def judge(
    velocity=(0.0, 0.0, -0.5), landed=True, safe=True, empty=False, miss=(0.0, 0.0), mass=1165.0, rules=RULES
) -> Outcome:
    final = State(TARGET + np.array([*miss, 0.0]), np.array(velocity), mass)
    return classify(INITIAL, final, TARGET, Contact(landed, safe, empty), PAPER_LANDER, rules)


BEYOND = 1.0 + 1e-12


@pytest.mark.parametrize(
    ("ending", "case"),
    [
        (Ending.SUCCESS, {}),
        (Ending.SUCCESS, {"velocity": (0.0, 0.0, 0.0)}),
        (Ending.SUCCESS, {"velocity": (0.0, 0.0, -2.0)}),
        (Ending.SUCCESS, {"velocity": (1.2, 1.6, -2.0)}),  # 2 m/s each way: both limits, 2.83 in all
        (Ending.HARD_LANDING, {"velocity": (0.0, 0.0, -2.0 * BEYOND)}),
        (Ending.HARD_LANDING, {"velocity": (2.0 * BEYOND, 0.0, 0.0)}),
        (Ending.HARD_LANDING, {"velocity": (1.5, 1.5, 0.0)}),  # 2.12 m/s across, each component below 2
        (Ending.HARD_LANDING, {"velocity": (0.0, 0.0, -5.0)}),
        (Ending.HARD_LANDING, {"velocity": (3.0, 0.0, -4.0)}),
        (Ending.CRASH, {"velocity": (0.0, 0.0, -5.0 * BEYOND)}),
        (Ending.CRASH, {"velocity": (4.0, 0.0, -4.0)}),
        (Ending.CRASH, {"velocity": (0.0, 0.0, -9.0), "safe": False}),
        (Ending.UNSAFE_SITE, {"safe": False}),
        (Ending.UNSAFE_SITE, {"safe": False, "velocity": (0.0, 0.0, -5.0)}),
        (Ending.TANK_EMPTY, {"empty": True}),
        (Ending.TANK_EMPTY, {"empty": True, "velocity": (0.0, 0.0, -40.0), "safe": False}),
        (Ending.TIMED_OUT, {"landed": False}),
        (Ending.TIMED_OUT, {"landed": False, "velocity": (0.0, 0.0, -40.0)}),
    ],
)
def test_the_ending_is_the_gravest_that_holds(ending, case):
    outcome = judge(**case)
    assert outcome.ending is ending
    assert outcome.success == (ending is Ending.SUCCESS)


@given(
    velocity=st.tuples(*[st.floats(-8.0, 8.0)] * 3),
    landed=st.booleans(),
    safe=st.booleans(),
    empty=st.booleans(),
)
def test_success_is_a_safe_site_a_soft_touchdown_and_propellant_left(velocity, landed, safe, empty):
    outcome = judge(velocity, landed, safe, empty)
    soft = abs(velocity[2]) <= 2.0 and math.hypot(*velocity[:2]) <= 2.0
    assert outcome.success == (landed and safe and not empty and soft)
    assert outcome.safe_site == (landed and safe)  # the paper's ratio asks nothing else
    assert outcome.touchdown_speed == pytest.approx(math.hypot(*velocity))


def test_every_ending_is_met_and_nothing_else():
    speeds = [(0.0, 0.0, -1.0), (0.0, 0.0, -3.0), (0.0, 0.0, -6.0)]
    flags = [True, False]
    met = {judge(*case).ending for case in itertools.product(speeds, flags, flags, flags)}
    assert met == set(Ending)


def test_the_limits_are_the_rules():
    rules = Rules(crash_speed=10.0, soft_speed=7.0)
    assert judge((0.0, 0.0, -7.0), rules=rules).ending is Ending.SUCCESS
    assert judge((0.0, 0.0, -9.0), rules=rules).ending is Ending.HARD_LANDING
    assert judge((0.0, 0.0, -10.5), rules=rules).ending is Ending.CRASH


def test_the_measures_of_a_touchdown():
    outcome = judge((0.3, 0.4, -1.2), miss=(3.0, -4.0), mass=1167.5)
    assert outcome.miss_distance == pytest.approx(5.0)
    assert outcome.touchdown_speed == pytest.approx(1.3)
    assert outcome.propellant_fraction == pytest.approx(0.65)
    np.testing.assert_allclose(outcome.touchdown, [403.0, 296.0, 50.0])


# The reward


def test_the_reward_of_a_landing_by_hand():
    # -dm/(m0 - m_dry) - 0.1 |v| - 0.01 |r - r_f| + V
    outcome = judge((0.3, 0.4, -1.2), miss=(3.0, -4.0))
    assert score_step(0.08, outcome).total == pytest.approx(-0.08 - 0.13 - 0.05 + 1.0)


@pytest.mark.parametrize("fraction", [0.0, 0.07, 1.0])
def test_the_reward_in_flight_is_the_propellant_alone(fraction):
    terms = score_step(fraction, None)
    assert terms.total == terms.propellant == -fraction


@given(
    velocity=st.tuples(*[st.floats(-8.0, 8.0)] * 3),
    miss=st.tuples(*[st.floats(-50.0, 50.0)] * 2),
    flags=st.tuples(st.booleans(), st.booleans(), st.booleans()),
    fraction=st.floats(0.0, 1.0),
)
def test_the_reward_is_the_papers_with_the_signs_it_means(velocity, miss, flags, fraction):
    landed, safe, empty = flags
    outcome = judge(velocity, landed, safe, empty, miss)
    terms = score_step(fraction, outcome)
    crashed = landed and (empty or math.hypot(*velocity) > 5.0)
    by_hand = -fraction - 10.0 * crashed - 0.1 * math.hypot(*velocity) - 0.01 * math.hypot(*miss)
    by_hand += 1.0 if landed and safe else -1.0
    assert terms.total == pytest.approx(by_hand, abs=1e-12)
    assert max(terms.propellant, terms.failure, terms.speed, terms.miss) <= 0.0
    assert terms.failure == (-10.0 if crashed else 0.0)
    assert terms.total == pytest.approx(
        terms.propellant + terms.failure + terms.speed + terms.miss + terms.safety, abs=1e-12
    )


def test_each_weight_scales_its_own_term():
    outcome = judge((0.0, 0.0, -6.0), miss=(3.0, 4.0))
    weights = RewardWeights(propellant=2.0, failure=-3.0, speed=0.5, miss=0.2, safety=7.0)
    terms = score_step(0.1, outcome, weights)
    assert (terms.propellant, terms.failure, terms.safety) == pytest.approx((-0.2, -3.0, 7.0))
    assert (terms.speed, terms.miss) == pytest.approx((-3.0, -1.0))
