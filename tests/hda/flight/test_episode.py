"""Flying whole episodes: reproducibility, consistent records, recomputed measures, ends, bad policies."""

import copy
import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest

import hda
from guidance import State
from hda.flight.episode import advance, begin_flight, elevation_angle, fly, fly_legs, observe
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.policy import Decision, Policy, ZemZevCommand
from hda.sensing.lidar import look
from hda.task.rules import Range, Rules, StartConditions
from hda.task.scenario import Scenario
from tests.equality import same

POLICIES = ("no-divert", "single-divert", "nearest-safe", "oracle")
EXHAUST_VELOCITY = 9.80665 * 325.0


@dataclass(frozen=True)
class Answering:
    """A policy made of one function of the observation."""

    answer: Any
    name: str = "answering"

    def begin(self, scenario_view, rng) -> None:
        return None

    def decide(self, observation, memory) -> Any:
        return self.answer(observation)


def steady(time_to_go: float, site=None) -> Policy[None]:
    """Always the same command, to the present target."""

    def answer(observation):
        place = observation.target if site is None else site
        return Decision(place, ZemZevCommand(6.0, 2.0, time_to_go)), None

    return Answering(answer)


def with_rules(scenario: Scenario, **changes: Any) -> Scenario:
    preset = scenario.preset
    return replace(scenario, preset=replace(preset, rules=replace(preset.rules, **changes)))


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    return [hda.sample_scenario("paper", 3, episode) for episode in range(6)]


@pytest.fixture(scope="module")
def records(scenarios) -> dict[tuple[str, int], EpisodeRecord]:
    return {
        (name, k): fly(hda.make_policy(name), scenario)
        for name in POLICIES
        for k, scenario in enumerate(scenarios)
    }


def same_record(first: EpisodeRecord, second: EpisodeRecord) -> bool:
    """All fields but the wall time and the scenario, which holds the map."""
    names = {field.name for field in fields(EpisodeRecord)} - {"decision_time", "scenario"}
    return all(same(getattr(first, name), getattr(second, name)) for name in names)


# Reproducibility


def test_an_episode_flown_again_is_the_same_bit_for_bit(records):
    for (name, k), record in records.items():
        assert same_record(fly(hda.make_policy(name), hda.sample_scenario("paper", 3, k)), record)


def test_the_order_of_episodes_and_policies_does_not_matter(records, scenarios):
    order = list(records)
    np.random.default_rng(0).shuffle(order)
    made = {name: hda.make_policy(name) for name in POLICIES}  # one object for all its episodes
    for name, k in order:
        assert same_record(fly(made[name], scenarios[int(k)]), records[name, int(k)])


def test_records_of_different_episodes_and_policies_differ(records):
    assert not same_record(records["no-divert", 0], records["no-divert", 1])
    assert not same_record(records["no-divert", 0], records["oracle", 0])


def test_policies_meet_the_same_noise_and_the_same_thrust_errors(records):
    for k in range(6):
        flown = [records[name, k] for name in POLICIES]
        for other in flown[1:]:
            assert same(flown[0].observations[0], other.observations[0])
        errors = [[s.thrust_error for s in record.segments] for record in flown]
        shortest = min(len(e) for e in errors)
        assert len({tuple(e[:shortest]) for e in errors}) == 1
        assert all(abs(e) <= 0.05 for record in errors for e in record)


def test_the_steps_are_the_flight(scenarios):
    """Whoever calls begin_flight, observe and advance gets what `fly` gets."""
    policy: Any = hda.make_policy("nearest-safe")
    for scenario in scenarios[:3]:
        record = fly(policy, scenario)
        memory = policy.begin(scenario.view, scenario.streams.policy())
        flight = begin_flight(scenario)
        for k in range(len(record.decisions)):
            observation = observe(scenario, flight)
            assert same(observation, record.observations[k])
            decision, memory = policy.decide(observation, memory)
            assert same(decision, record.decisions[k])
            step = advance(scenario, flight, decision)
            assert same(step.segment, record.segments[k])
            assert same(step.reward, record.rewards[k])
            flight = step.flight
            assert (step.outcome is None) == (k < len(record.decisions) - 1)
            if step.outcome is not None:
                assert same(step.outcome, record.outcome)


def test_legs_carry_the_memory_from_look_to_look_and_end_with_the_flight(scenarios):
    def decide(observation, memory: tuple[int, ...]):
        command = ZemZevCommand(6.0, 2.0, observation.time_to_go)
        return Decision(observation.target, command), (*memory, observation.index)

    given = []

    def remember(observation, memory):
        given.append(memory)
        return decide(observation, memory)

    legs = list(fly_legs(scenarios[0], remember, ()))
    record = fly(hda.make_policy("no-divert"), scenarios[0])
    assert given == [tuple(range(k)) for k in range(len(legs))]
    assert [leg.step.outcome is None for leg in legs] == [True] * (len(legs) - 1) + [False]
    assert same(tuple(leg.observation for leg in legs), record.observations)
    assert same(tuple(leg.step.segment for leg in legs), record.segments)
    assert all(min(leg.look_time, leg.decision_time, leg.flight_time) > 0.0 for leg in legs)


def test_a_step_taken_twice_is_the_same_step(scenarios):
    flight = begin_flight(scenarios[0])
    observation = observe(scenarios[0], flight)
    decision = Decision(observation.target, ZemZevCommand(6.0, 2.0, 40.0))
    before = copy.deepcopy((flight, observation))
    assert same(advance(scenarios[0], flight, decision), advance(scenarios[0], flight, decision))
    assert same(observe(scenarios[0], flight), observation)
    assert same((flight, observation), before)


# What begins and what is seen


def test_the_first_time_to_go_is_the_smallest_positive_root_of_the_printed_quartic():
    for episode in range(40):
        scenario = hda.sample_scenario("paper", 8, episode)
        flight = begin_flight(scenario)
        state, target = scenario.initial_state, scenario.nominal_target
        away, v = target - state.position, state.velocity
        quartic = np.array([1.62**2, 0.0, -2.0 * (v @ v), 12.0 * (away @ v), -18.0 * (away @ away)])
        roots = np.roots(quartic)
        real = roots[np.abs(roots.imag) < 1e-6 * np.abs(roots)].real
        assert flight.time_to_go == pytest.approx(real[real > 0.0].min(), rel=1e-8)
        assert same(flight.state, state)
        assert flight.target.tolist() == target.tolist()
        assert flight.index == 0
        assert observe(scenario, flight).time_to_go == flight.time_to_go


def test_each_look_stands_where_and_when_the_flight_stands(records):
    for record in records.values():
        targets = [record.scenario.nominal_target, *(d.site for d in record.decisions)]
        for k, observation in enumerate(record.observations):
            assert observation.index == k
            assert observation.time == 5.0 * k
            assert same(observation.target, targets[k])
            assert observation.safety_map.shape == (64, 64)
            slant_range = math.dist(observation.state.position, targets[k])
            assert observation.width == pytest.approx(slant_range * math.tan(math.radians(11.4)), rel=1e-12)
            if k:
                ended = record.segments[k - 1]
                assert same(observation.state.as_array(), ended.path[-1])
                assert observation.time_to_go == ended.time_to_go


def test_look_k_meets_the_noise_of_look_k(records):
    for (_, episode), record in records.items():
        sensor = np.random.SeedSequence([3, int(episode)]).spawn(4)[1]
        for k, child in enumerate(sensor.spawn(len(record.observations))):
            observation = record.observations[k]
            noise = np.random.default_rng(child).standard_normal((64, 64), dtype=np.float32)
            truth = record.scenario.tile.probability
            seen = look(hda.Lidar(), observation.state.position, observation.target, truth, noise)
            np.testing.assert_array_equal(observation.safety_map, seen)


def test_observations_share_no_memory_with_each_other_or_with_the_tile(records):
    for record in records.values():
        tile = record.scenario.tile
        truth = [tile.elevation, tile.probability, tile.deterministic]
        arrays = [
            (k, array)
            for k, o in enumerate(record.observations)
            for array in (o.safety_map, o.target, o.state.position, o.state.velocity)
        ]
        for n, (k, array) in enumerate(arrays):
            assert not any(np.shares_memory(array, layer) for layer in truth)
            assert not any(np.shares_memory(array, other) for m, other in arrays[n + 1 :] if m != k)


# The record


def test_a_records_arrays_fit_together(records):
    for record in records.values():
        n = len(record.time)
        assert record.path.shape == (n, 7)
        assert record.position.shape == record.velocity.shape == (n, 3)
        assert record.mass.shape == (n,)
        assert record.thrust.shape == record.commanded_thrust.shape == (n - 1, 3)
        assert record.time[0] == 0.0
        assert (np.diff(record.time) > 0.0).all()
        assert (np.diff(record.mass) <= 0.0).all()
        assert same(record.path[0], record.scenario.initial_state.as_array())
        for before, after in zip(record.segments, record.segments[1:], strict=False):
            assert same(before.path[-1], after.path[0])
            assert before.time[-1] == pytest.approx(5.0, rel=1e-12)
        looks = (
            len(record.observations),
            len(record.segments),
            len(record.rewards),
            len(record.decision_time),
        )
        assert looks == (len(record.decisions),) * 4
        assert (record.position[:-1, 2] > 50.0).all()
        assert record.position[-1, 2] == pytest.approx(50.0, abs=1e-6)
        assert record.total_reward == pytest.approx(math.fsum(r.total for r in record.rewards))
        assert record.fallbacks == 0


def test_the_propellant_is_that_of_the_rocket_equation_over_the_held_intervals(records):
    for record in records.values():
        held = np.linalg.norm(record.thrust, axis=1) * np.diff(record.time)
        np.testing.assert_allclose(-np.diff(record.mass), held / EXHAUST_VELOCITY, rtol=1e-6, atol=1e-9)
        burnt = held.sum() / EXHAUST_VELOCITY
        assert record.outcome.propellant_fraction == pytest.approx(burnt / 50.0, rel=1e-9)
        assert -sum(r.propellant for r in record.rewards) == pytest.approx(burnt / 50.0, rel=1e-9)


def test_thrust_is_the_saturated_command_with_its_error(records):
    for record in records.values():
        assert np.linalg.norm(record.commanded_thrust, axis=1).max() <= 12000.0 * (1.0 + 1e-12)
        repeated = np.concatenate([[s.thrust_error] * len(s.commanded) for s in record.segments])
        np.testing.assert_allclose(
            record.thrust, record.commanded_thrust * (1.0 + repeated[:, None]), rtol=1e-12
        )
        assert record.maximum_thrust == pytest.approx(np.linalg.norm(record.thrust, axis=1).max(), rel=1e-12)


def test_the_minimum_slant_angle_is_the_least_elevation_before_and_after_each_retargeting(records):
    moved = 0
    for record in records.values():
        angles = []
        for observation, decision in zip(record.observations, record.decisions, strict=True):
            for target in (observation.target, decision.site):
                away = observation.state.position - target
                angles.append(math.asin(away[2] / math.hypot(*away)))
            moved += not np.array_equal(observation.target, decision.site)
        assert record.minimum_slant_angle == pytest.approx(min(angles), abs=1e-9)
        assert 0.0 < record.minimum_slant_angle <= math.pi / 2.0
    assert moved > 6


@pytest.mark.parametrize(
    ("position", "angle"), [((0, 0, 9), 90.0), ((7, 0, 7), 45.0), ((3, 4, 5), 45.0), ((0, -2, 0), 0.0)]
)
def test_elevation_angles_of_known_triangles(position, angle):
    assert math.degrees(elevation_angle(np.array(position, float), np.zeros(3))) == pytest.approx(angle)


def test_the_outcome_is_judged_on_the_true_map_at_the_touchdown_cell(records):
    endings = set()
    for record in records.values():
        x, y, z = record.outcome.touchdown
        assert (x, y, z) == tuple(record.position[-1])
        assert record.outcome.safe_site == record.scenario.tile.deterministic[math.floor(y), math.floor(x)]
        miss = math.dist(record.outcome.touchdown, record.decisions[-1].site)
        assert record.outcome.miss_distance == pytest.approx(miss, rel=1e-12)
        assert record.outcome.touchdown_speed == pytest.approx(float(np.linalg.norm(record.velocity[-1])))
        endings.add(record.outcome.ending)
    assert {Ending.SUCCESS, Ending.UNSAFE_SITE} <= endings


@pytest.mark.parametrize("safe_where_it_lands", [True, False])
def test_the_ground_under_the_touchdown_counts_and_not_the_site(scenarios, safe_where_it_lands):
    landed = fly(steady(0.01), scenarios[0]).outcome
    x, y, _ = landed.touchdown
    assert landed.miss_distance > 50.0
    verdict = np.full((1000, 1000), not safe_where_it_lands)
    verdict[math.floor(y), math.floor(x)] = safe_where_it_lands
    scenario = replace(scenarios[0], tile=replace(scenarios[0].tile, deterministic=verdict))
    record = fly(steady(0.01), scenario)
    assert record.outcome.safe_site == safe_where_it_lands
    assert record.rewards[-1].safety == (1.0 if safe_where_it_lands else -1.0)


# The end


def test_an_episode_that_never_lands_is_truncated_after_the_last_decision(scenarios):
    """Overdamped gains on a clock that never runs down: it comes ever nearer and never arrives."""
    creep = Answering(lambda o: (Decision(o.target, ZemZevCommand(20.0, 9.0, 60.0)), None))
    assert fly(creep, scenarios[0]).outcome.ending is Ending.TANK_EMPTY
    start = scenarios[0].initial_state
    full = replace(scenarios[0], initial_state=State(start.position, start.velocity, 1400.0))
    record = fly(creep, full)
    assert record.outcome.ending is Ending.TIMED_OUT
    assert len(record.decisions) == 20
    assert record.time[-1] == pytest.approx(100.0)
    assert not record.outcome.safe_site
    assert not record.outcome.success
    assert 50.0 < record.position[-1, 2] < 120.0
    assert [r.safety for r in record.rewards] == [0.0] * 19 + [-1.0]
    assert record.rewards[-1].failure == 0.0


def test_the_greatest_number_of_decisions_is_a_rule(scenarios):
    record = fly(steady(1e6), with_rules(scenarios[0], max_decisions=4))
    assert record.outcome.ending is Ending.TIMED_OUT
    assert len(record.decisions) == 4


def test_only_the_last_step_of_a_timed_out_episode_is_truncated(scenarios):
    scenario = with_rules(scenarios[0], max_decisions=3)
    flight = begin_flight(scenario)
    told = []
    for _ in range(3):
        decision = Decision(flight.target, ZemZevCommand(6.0, 2.0, 1e6))
        step = advance(scenario, flight, decision)
        told.append((step.truncated, step.outcome is not None))
        flight = step.flight
    assert told == [(False, False), (False, False), (True, True)]


def test_a_crash_on_the_last_step_is_a_crash(scenarios):
    scenario = scenarios[1]
    drop = steady(0.01)  # the engine is cut at once
    last = with_rules(scenario, max_decisions=1)
    record = fly(drop, last)
    assert record.outcome.ending is Ending.CRASH
    assert len(record.decisions) == 1
    step = advance(last, begin_flight(last), record.decisions[0])
    assert not step.truncated
    assert step.outcome is not None
    assert step.reward.failure == -10.0
    height, climb = scenario.initial_state.position[2] - 50.0, scenario.initial_state.velocity[2]
    assert -record.velocity[-1, 2] == pytest.approx(math.sqrt(climb**2 + 2.0 * 1.62 * height), rel=1e-9)


def test_a_tank_that_runs_dry_is_a_failure(scenarios):
    preset = scenarios[0].preset
    start = scenarios[0].initial_state
    scarce = replace(
        scenarios[0],
        preset=replace(preset, start=StartConditions(mass=Range(1155.0, 1155.0))),
        initial_state=State(start.position, start.velocity, 1155.0),
    )
    record = fly(hda.make_policy("no-divert"), scarce)
    assert record.outcome.ending is Ending.TANK_EMPTY
    assert record.outcome.propellant_fraction == pytest.approx(1.0)
    assert record.rewards[-1].failure == -10.0


def test_a_landing_off_the_map_is_unsafe(scenarios):
    site = np.array([-300.0, 500.0, 50.0])
    # From 900 m up and 500 m and more to the side: enough time to go there softly.
    record = fly(steady_clock(site, 70.0), scenarios[0])
    assert record.outcome.touchdown[0] < 0.0
    assert not record.outcome.safe_site
    assert not record.outcome.success


def steady_clock(site: np.ndarray, time_to_go: float) -> Policy[None]:
    """One site and one clock from the start."""

    def answer(observation):
        remaining = time_to_go if observation.index == 0 else observation.time_to_go
        return Decision(site, ZemZevCommand(6.0, 2.0, remaining)), None

    return Answering(answer)


def test_a_short_control_period_without_dispersions_lands_on_the_target(scenarios):
    for scenario in scenarios:
        calm = with_rules(scenario, thrust_error=0.0, control_period=0.01)
        record = fly(hda.make_policy("no-divert"), calm)
        assert record.outcome.miss_distance < 1e-3
        assert record.outcome.touchdown_speed < 0.05
        assert {s.thrust_error for s in record.segments} == {0.0}


# Policies that answer wrongly


def a_decision(observation) -> Decision:
    return Decision(observation.target, ZemZevCommand(6.0, 2.0, 40.0))


@pytest.mark.parametrize(
    "answer",
    [
        lambda o: None,
        a_decision,
        lambda o: (None, None),
        lambda o: ("land", None),
        lambda o: (o.target, None),
        lambda o: (a_decision(o), None, None),
        lambda o: [a_decision(o), None],
        lambda o: 42,
    ],
)
def test_a_policy_that_answers_rubbish_is_named(scenarios, answer):
    with pytest.raises(ValueError, match=r"^policy 'rubbish' must return"):
        fly(Answering(answer, "rubbish"), scenarios[0])


@pytest.mark.parametrize("offset", [1.0, -1.0, 1e-5, -50.0])
def test_a_site_off_the_target_plane_is_refused(scenarios, offset):
    with pytest.raises(ValueError, match=r"site must lie on the target plane z = 50 m"):
        fly(steady(40.0, scenarios[0].nominal_target + np.array([0.0, 0.0, offset])), scenarios[0])


@pytest.mark.parametrize("site", [(1.0, 2.0), (1.0, math.nan, 50.0), (1.0, 2.0, math.inf), None, "here"])
def test_a_site_that_is_no_place_is_refused(site: Any):
    with pytest.raises(ValueError, match=r"^site must"):
        Decision(site, ZemZevCommand(6.0, 2.0, 40.0))


@pytest.mark.parametrize("name", ["position_gain", "velocity_gain", "time_to_go", "time_to_go_rate"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, "fast", None])
def test_a_command_that_cannot_be_flown_is_refused(name, bad: Any):
    numbers = {"position_gain": 6.0, "velocity_gain": 2.0, "time_to_go": 40.0, name: bad}
    with pytest.raises(ValueError, match=rf"^{name} must"):
        ZemZevCommand(**numbers)


@pytest.mark.parametrize("name", ["time_to_go", "time_to_go_rate"])
@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_a_clock_that_does_not_run_down_is_refused(name, bad):
    with pytest.raises(ValueError, match=rf"^{name} must be greater than 0"):
        ZemZevCommand(**{"position_gain": 6.0, "velocity_gain": 2.0, "time_to_go": 40.0, name: bad})


def test_the_rules_of_both_presets_are_the_papers():
    for preset in hda.PRESETS.values():
        rules: Rules = preset.rules
        assert (rules.decision_interval, rules.thrust_error, rules.crash_speed, rules.soft_speed) == (
            5,
            0.05,
            5,
            2,
        )
        assert rules.max_decisions == 20
