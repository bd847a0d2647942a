"""What an agent sees of the belief: pictures of it, and where nothing has been read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.flight.episode import begin_flight, fly, observe
from hda.policies.hazard_aware import fuse_look, judge_ground
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.environment.encoding import CURVED, encode_flight
from rl.environment.env import LunarHDAEnv
from rl.environment.sight import BeliefMemory, BeliefSight, LookSight, make_sight, picture_window, share_read
from rl.inference.latent import load_encoder
from tests.equality import same


def belief_arrays(memory: BeliefMemory) -> dict[str, np.ndarray]:
    assert memory.belief is not None
    return {"probability": memory.belief.probability(), "seen": memory.belief.seen}


def belief_sight() -> BeliefSight:
    sight = make_sight("belief", CURVED, load_encoder())
    assert isinstance(sight, BeliefSight)
    return sight


@settings(max_examples=25)
@given(
    x=st.floats(-20.0, 60.0),
    y=st.floats(-20.0, 60.0),
    width=st.floats(0.2, 90.0),
    seed=st.integers(0, 1000),
)
def test_a_picture_reads_the_nearest_cell(x, y, width, seed):
    cells = np.random.default_rng(seed).random((40, 30)).astype(np.float32)
    offset = ((np.arange(64) + 0.5) / 64 - 0.5) * width
    rows, columns = np.floor(y + offset).astype(int), np.floor(x + offset).astype(int)
    padded = np.zeros((300, 300), np.float32)
    padded[100:140, 100:130] = cells
    expected = padded[np.ix_(rows + 100, columns + 100)]
    np.testing.assert_array_equal(picture_window(cells, (x, y, width)), expected)


@settings(max_examples=25)
@given(
    x=st.floats(-20.0, 60.0),
    y=st.floats(-20.0, 60.0),
    width=st.floats(16.0, 90.0),
    seed=st.integers(0, 1000),
)
def test_the_share_read_counts_the_cells_of_each_block(x, y, width, seed):
    """Block by block over the middles of all cells of a larger field; on a border either side may count."""
    seen = np.random.default_rng(seed).random((40, 30)) < 0.5
    padded = np.zeros((400, 400), np.bool_)
    padded[150:190, 150:180] = seen
    middles = np.arange(400) - 150 + 0.5
    share, side = share_read(seen, (x, y, width)), width / 4
    for i in range(4):
        low = y - width / 2 + i * side
        rows = (middles >= low) & (middles < low + side)
        for j in range(4):
            left = x - width / 2 + j * side
            columns = (middles >= left) & (middles < left + side)
            assert share[i, j] == pytest.approx(padded[np.ix_(rows, columns)].mean(), abs=0.3 / side)


@pytest.mark.parametrize("preset", ["paper", "partial", "lidar", "navigated"])
def test_the_vector_holds_the_flight_the_belief_and_what_was_read(preset):
    """Against the belief itself, fused apart; the latents are those of its pictures."""
    scenario = sample_scenario(preset, 5, 0, "train")
    record = fly(make_policy("nearest-safe"), scenario)
    sight, belief = belief_sight(), None
    memory, (low, high) = sight.begin(scenario.view), sight.bounds
    for look in record.observations:
        vector, memory = sight.see(look, memory)
        belief = fuse_look(look, scenario.view, belief)
        assert vector.shape == (92,)
        assert vector.dtype == np.float32
        assert np.all((low <= vector) & (vector <= high))
        expected = encode_flight(CURVED, look, scenario.nominal_target)
        np.testing.assert_array_equal(vector[:12], expected)
        width = max(look.width, 16.0)
        place = look.target[:2] - np.array(belief.corner)
        for start, window in ((12, width), (44, 2.0 * width)):
            picture = picture_window(judge_ground(belief), (*place, window))
            latent = np.clip(load_encoder().encode(picture), -8.0, 8.0)
            np.testing.assert_array_equal(vector[start : start + 32], latent)
        np.testing.assert_array_equal(vector[76:], share_read(belief.seen, (*place, 2.0 * width)).ravel())


def test_a_look_without_a_map_takes_nothing_away():
    """With the look alone the agent would be blind; the belief still shows what it has read."""
    scenario = sample_scenario("paper", 5, 0, "train")
    look, sight = observe(scenario, begin_flight(scenario)), belief_sight()
    first, memory = sight.see(look, sight.begin(scenario.view))
    blank = replace(look, index=1, safety_map=np.zeros_like(look.safety_map))
    second, _ = sight.see(blank, memory)
    np.testing.assert_array_equal(second, first)
    alone = LookSight(CURVED, load_encoder())
    seen = [alone.see(each, scenario.nominal_target)[0][12:] for each in (look, blank)]
    assert not np.array_equal(seen[0], seen[1])


def test_nothing_is_read_before_the_first_map():
    scenario = sample_scenario("paper", 5, 0, "train")
    look, sight = observe(scenario, begin_flight(scenario)), belief_sight()
    blank = replace(look, safety_map=np.zeros_like(look.safety_map))
    vector, _ = sight.see(blank, sight.begin(scenario.view))
    assert not vector[76:].any()
    seen, _ = sight.see(look, sight.begin(scenario.view))
    share = seen[76:].reshape(4, 4)
    pixel = look.width / 64.0
    assert share.max() == pytest.approx(pixel**-2, rel=0.1)  # the nearest cell of each pixel was read
    assert not share[0].any()  # the look is the middle half
    assert not share[:, 0].any()


def test_an_episode_remembers_nothing_of_those_before():
    env = LunarHDAEnv(sight="belief")
    scenario = sample_scenario("paper", 5, 3, "train")
    first, _ = env.reset(options={"scenario": scenario})
    for _ in range(3):
        env.step(np.full(5, 0.5, np.float32))
    again, _ = env.reset(options={"scenario": scenario})
    assert same(first, again)


def test_memory_goes_in_and_comes_out():
    scenario = sample_scenario("paper", 5, 0, "train")
    look, sight = observe(scenario, begin_flight(scenario)), belief_sight()
    memory = sight.begin(scenario.view)
    _, after = sight.see(look, memory)
    assert after.belief is not None
    assert memory.belief is None
    kept = {name: value.copy() for name, value in belief_arrays(after).items()}
    state = replace(look.state, position=look.state.position - np.array([8.0, -5.0, 20.0]))
    moved = replace(look, state=state, target=look.target + np.array([6.0, -4.0, 0.0]))
    one, first = sight.see(moved, after)
    other, second = sight.see(moved, after)
    assert same(one, other)
    assert same(belief_arrays(first), belief_arrays(second))
    assert not same(belief_arrays(first), kept)  # the second look changed what is believed
    assert same(belief_arrays(after), kept)  # but in arrays of its own
