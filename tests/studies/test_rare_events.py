"""Splitting and roulette: unbiased on a chain that is solved exactly, and on flights the same to the bit."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.patches import StepPatch

from guidance.state import State
from hda.flight.episode import begin_flight, fly
from hda.registry import make_policy
from hda.task.presets import PRESETS
from hda.task.scenario import branch_scenario, sample_scenario
from studies.campaign.claimed_folder import FolderError
from studies.campaign.monte_carlo import Study, prepare_study
from studies.rare_events import RareEvents, Window, batches, grow_tree, run_rare_events
from studies.rare_events.command import plan_study
from studies.rare_events.flights import describe_leaf, fly_passage, fly_root, grow_episode
from studies.rare_events.level_values import Passage, fit_values
from studies.rare_events.levels import (
    SHAPE,
    find_level,
    hazard_distance,
    nearest_safe_cell,
    safe_share,
    widest_slope,
)
from studies.rare_events.picture import draw_failing
from studies.rare_events.splitting import NO_WINDOW, Ended
from studies.rare_events.table import count_causes, estimate
from studies.statistics.weighted_events import weighted_interval

STEPS, UP = 6, 0.3
"""A walk of STEPS steps, each up by one with probability UP, fails if all are up: probability UP^STEPS."""

_SMALL = RareEvents(episodes=12, effort=0.5, pilot=6, whole=4, workers=1)


def walk(rng: np.random.Generator, height: int = STEPS):
    """The step of the walk; the state is (steps taken, how often it went up)."""

    def advance(state: tuple[int, int], branch: int) -> tuple[int, int] | Ended[bool]:
        del branch
        taken, ups = state[0] + 1, state[1] + int(rng.random() < UP)
        return Ended(ups >= height) if taken == STEPS else (taken, ups)

    return advance


def grow_walks(number: int, window, seed: int, height: int = STEPS) -> tuple[np.ndarray, np.ndarray, int]:
    """Weight of the failing leaves and of all, of each of so many walks, and the steps that they took."""
    rng = np.random.default_rng(seed)
    trees = [grow_tree((0, 0), walk(rng, height), window, rng) for _ in range(number)]
    failing = [sum(leaf.weight for leaf in tree.leaves if leaf.end) for tree in trees]
    weight = [sum(leaf.weight for leaf in tree.leaves) for tree in trees]
    return np.array(failing), np.array(weight), sum(tree.steps for tree in trees)


def by_height(state: tuple[int, int]) -> Window:
    """Weights fall by three for each step up, and rise by two for each that was not."""
    taken, ups = state
    aim = 3.0**-ups * 2.0 ** (taken - ups)
    return Window(0.6 * aim, aim, aim)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0.05, 20.0), min_size=STEPS, max_size=STEPS), st.integers(0, 2**31))
def test_weights_sum_to_the_number_of_starts_in_expectation(aims: list[float], seed: int) -> None:
    """Whatever the windows: five standard errors, a false alarm in two million."""

    def window(state: tuple[int, int]) -> Window:
        aim = aims[(state[0] + 2 * state[1]) % STEPS]
        return Window(0.7 * aim, aim, 1.2 * aim)

    _, weight, _ = grow_walks(300, window, seed)
    spread = max(float(weight.std()), 0.05) / np.sqrt(weight.size)
    assert abs(weight.mean() - 1.0) < 5.0 * spread + 0.02


def test_a_rare_failure_is_found_at_a_fraction_of_the_steps_without_bias() -> None:
    truth = UP**STEPS  # 7.3e-4
    failing, weight, steps = grow_walks(20_000, by_height, 1)
    error = failing.std() / np.sqrt(failing.size)
    assert abs(failing.mean() - truth) < 4.0 * error
    assert abs(weight.mean() - 1.0) < 4.0 * weight.std() / np.sqrt(weight.size)
    plain = np.sqrt(truth * (1.0 - truth) / (steps / STEPS))  # of whole walks that take as many steps
    assert error < plain / 2.0


def test_without_windows_a_tree_is_one_walk_and_roulette_draws_nothing() -> None:
    rng, untouched = np.random.default_rng(3), np.random.default_rng(4)
    tree = grow_tree((0, 0), walk(rng), lambda state: NO_WINDOW, untouched)
    assert (len(tree.leaves), tree.steps, tree.branches) == (1, STEPS, 1)
    assert tree.leaves[0].weight == 1.0
    assert untouched.random() == np.random.default_rng(4).random()


@pytest.mark.parametrize(("height", "number"), [(STEPS, 400), (5, 100), (4, 60)])
def test_the_interval_covers_on_few_failures(height: int, number: int) -> None:
    """Of 300 repeats a 95 % interval misses 30 or more with a probability of 4e-4."""
    chances = [
        float(np.prod([STEPS - k for k in range(ups)]) / np.prod(range(1, ups + 1)))
        * UP**ups
        * (1.0 - UP) ** (STEPS - ups)
        for ups in range(height, STEPS + 1)
    ]
    truth, missed = sum(chances), 0
    for seed in range(300):
        failing, weight, _ = grow_walks(number, by_height, 1000 + seed, height)
        interval = weighted_interval(failing, weight, np.arange(number))
        assert interval.low <= interval.estimate <= interval.high
        missed += not interval.low <= truth <= interval.high
    assert missed < 30


def test_no_splitting_and_no_roulette_is_the_flight_to_the_bit() -> None:
    policy = make_policy("nearest-safe")
    for episode in range(3):
        scenario = sample_scenario("paper", 5, episode)
        tree = grow_episode(policy, scenario, lambda flight: NO_WINDOW)
        (leaf,) = tree.leaves
        record = fly(policy, scenario)
        assert leaf.weight == 1.0
        assert leaf.end.path.tobytes() == record.path.tobytes()
        assert tree.steps == len(record.decisions)
        row = describe_leaf(1.0, record)
        assert row.failed is not record.outcome.success
        assert row.looks == tree.steps


def test_branches_part_where_they_are_split_and_stay_flights_of_their_own() -> None:
    scenario, looks = sample_scenario("paper", 5, 1), 3

    def window(flight) -> Window:
        return Window(0.0, 0.25, 0.25) if flight.index == looks else NO_WINDOW

    tree = grow_episode(make_policy("nearest-safe"), scenario, window)
    assert (len(tree.leaves), tree.branches) == (4, 4)
    assert {leaf.weight for leaf in tree.leaves} == {0.25}
    records = [leaf.end for leaf in tree.leaves]
    for record in records[1:]:
        for look in range(looks):
            own, other = record.observations[look], records[0].observations[look]
            assert own.safety_map.tobytes() == other.safety_map.tobytes()
        assert record.segments[looks].thrust_error != records[0].segments[looks].thrust_error
    ordinary = fly(make_policy("nearest-safe"), scenario)
    assert any(record.path.tobytes() == ordinary.path.tobytes() for record in records)


def test_a_branch_keeps_what_errs_for_the_whole_episode() -> None:
    scenario = sample_scenario("partial", 2, 3)
    branch = branch_scenario(scenario, 7)
    assert branch.navigation_error.tobytes() == scenario.navigation_error.tobytes()
    assert begin_flight(branch).state == begin_flight(scenario).state or np.array_equal(
        begin_flight(branch).state.position, begin_flight(scenario).state.position
    )
    assert branch.streams.thrust_error(0, 0.05) != scenario.streams.thrust_error(0, 0.05)


def test_distances_and_shares_on_a_small_map() -> None:
    safe = np.ones((9, 9), dtype=bool)
    safe[4, 6] = False
    point = np.array([5.2, 4.5, 50.0])
    assert hazard_distance(safe, point, 2) == pytest.approx(0.8)
    assert hazard_distance(safe, np.array([0.3, 4.5, 50.0]), 2) == pytest.approx(0.3)  # the map's edge
    assert hazard_distance(np.ones((9, 9), dtype=bool), point, 2) == np.inf
    assert nearest_safe_cell(~safe, 0, 0, 9) == (4, 6)
    assert nearest_safe_cell(~safe, 0, 0, 3) is None
    assert safe_share(safe, 4, 4, 2) == pytest.approx(24 / 25)
    assert safe_share(safe, 0, 0, 1) == pytest.approx(4 / 9)


@given(st.floats(0.0, 300.0), st.floats(100.0, 900.0), st.floats(8.0, 40.0))
def test_the_slope_of_a_straight_descent_stays_and_none_is_seen_at_the_end(
    east: float, height: float, time: float
) -> None:
    """With velocity towards the site the cubic is a straight line: the angle never changes."""
    offset = np.array([east, 0.0, height])
    state = State(offset, -1.5 * offset / time, 1200.0)
    slope = widest_slope(state, np.zeros(3), time, 5.0)
    assert slope == pytest.approx(east / height, abs=1e-9)
    assert widest_slope(state, np.zeros(3), 4.0, 5.0) == 0.0


def test_levels_where_flights_fail_get_lighter_branches() -> None:
    near, far = (int(np.ravel_multi_index(place, SHAPE)) for place in ((2, 0, 0), (0, 4, 3)))
    passages = [Passage((near, near), True)] * 8 + [Passage((far, far), False)] * 200
    values = fit_values(passages)
    for look in range(2):
        assert values.failure[look, near] > 0.5 > 0.02 > values.failure[look, far]
        assert values.window(look, near, 0.1).aim < values.window(look, far, 0.1).aim
    whole = fit_values([Passage((far, near), False)] * 50)
    assert (whole.failure < 0.05).all()
    with pytest.raises(ValueError, match="pilot must fly at least one flight"):
        fit_values([])


def test_the_level_of_a_start_is_one_of_those_that_exist() -> None:
    for episode in range(4):
        scenario = sample_scenario("paper", 9, episode)
        assert 0 <= find_level(scenario, begin_flight(scenario)) < np.prod(SHAPE)


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["single-divert", "nearest-safe"])
def test_trees_and_whole_flights_agree(policy: str) -> None:
    """The first fails in one flight of ten, the other in one of forty.

    Four standard errors of the difference: a false alarm in 16000.
    """
    study = Study(PRESETS["paper"], (policy,), 1, 4)
    prepare_study(study, workers=1)
    tuning = replace(study, split="tuning")
    values = fit_values([fly_passage(tuning, episode)[0] for episode in range(60)])
    trees = [fly_root(study, episode, values, 0.5) for episode in range(600)]
    flights = [fly_root(study, 10_000 + episode, None, 1.0) for episode in range(600)]
    ways = [np.array([root.failing for root in roots]) for roots in (trees, flights)]
    error = np.sqrt(sum(way.var() / way.size for way in ways))
    assert abs(ways[0].mean() - ways[1].mean()) < 4.0 * error
    assert estimate("whole", policy, flights, 8.0).gain == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"policy": "default"}, "policy must be the name of one policy, got 'default'"),
        ({"policy": "nearest-saf"}, "did you mean nearest-safe"),
        ({"split": "tuning"}, "split must not be 'tuning'"),
        ({"split": "moon"}, "split must be one of"),
        ({"effort": 0.0}, "effort"),
        ({"whole": -1}, "whole"),
    ],
)
def test_options_that_cannot_be_flown_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_study(replace(_SMALL, **change))


def test_a_run_repeats_to_the_byte_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = replace(_SMALL, out=tmp_path / "first")
    lines = run_rare_events(first)
    assert [line.way for line in lines] == ["splitting", "whole flights"]
    assert lines[1].weight == 1.0
    run_rare_events(replace(_SMALL, out=tmp_path / "second", figures=False))
    for name in ("table.csv", "table.md", "causes.csv"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    assert (tmp_path / "first" / "rare-events.png").stat().st_size > 0
    with (tmp_path / "first" / "costs.csv").open() as file:
        assert [row["part"] for row in csv.DictReader(file)] == ["pilot", "splitting", "whole flights"]
    with pytest.raises(FolderError):
        run_rare_events(first)

    def refuse(*arguments: object) -> None:
        raise AssertionError(f"flown again: {arguments}")

    monkeypatch.setattr(batches, "fly_batch", refuse)
    assert run_rare_events(replace(first, resume=True)) == lines


def test_the_figure_shows_shares_of_failing_flights_and_of_all() -> None:
    study = Study(PRESETS["paper"], ("no-divert",), 1)
    roots = [fly_root(study, episode, None, 1.0) for episode in range(4)]
    causes = count_causes(roots)
    assert sum(row.share for row in causes) == pytest.approx(1.0)
    figure = draw_failing(roots, causes)
    panels = figure.get_axes()
    assert len(panels) == 6
    for panel in panels[:5]:
        steps = [patch for patch in panel.patches if isinstance(patch, StepPatch)]
        assert [step.get_label() for step in steps] == ["all flights", "failing"]
        for step in steps:
            assert np.sum(step.get_data()[0]) == pytest.approx(100.0)
