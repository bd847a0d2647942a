from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.state import State
from hda.policy import ZemZevCommand
from hda.task.observation import Observation
from rl.environment.action import ACTION_NAMES, ActionRanges, decide_action

OBSERVATION = Observation(
    index=1,
    time=5.0,
    state=State(np.array([500.0, 400.0, 700.0]), np.array([3.0, 4.0, -25.0]), 1190.0),
    target=np.array([520.0, 480.0, 50.0]),
    safety_map=np.zeros((64, 64), dtype=np.float32),
    width=120.0,
    time_to_go=31.0,
)


def flown(action):
    decision = decide_action(np.asarray(action), OBSERVATION)
    command = decision.command
    assert isinstance(command, ZemZevCommand)
    shift = (decision.site - OBSERVATION.target) / OBSERVATION.width
    return command.position_gain, command.velocity_gain, 5.0 * command.time_to_go_rate, shift[0], shift[1]


@pytest.mark.parametrize("axis", range(5))
@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_each_axis_moves_its_own_quantity_to_the_end_of_the_papers_table(axis, end):
    middle = (6.0, 2.0, 5.0, 0.0, 0.0)
    half = (1.0, 1.0, 0.75, 0.25, 0.25)
    expected = list(middle)
    expected[axis] += end * half[axis]
    action = np.zeros(5)
    action[axis] = end
    assert flown(action) == pytest.approx(tuple(expected), abs=1e-12), ACTION_NAMES[axis]


def test_no_action_keeps_target_gains_and_clock():
    decision = decide_action(np.zeros(5, dtype=np.float32), OBSERVATION)
    assert np.array_equal(decision.site, OBSERVATION.target)
    assert decision.command == ZemZevCommand(6.0, 2.0, OBSERVATION.time_to_go, 1.0)


@given(st.lists(st.floats(-3.0, 3.0), min_size=5, max_size=5))
def test_values_outside_the_box_are_clipped(values):
    assert flown(values) == flown(np.clip(values, -1.0, 1.0))


@given(st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5), st.floats(0.0, 0.5))
def test_shift_scales_with_the_range(values, shift):
    site = decide_action(np.array(values), OBSERVATION, ActionRanges(shift=shift)).site
    assert site[0] - OBSERVATION.target[0] == pytest.approx(values[3] * shift * OBSERVATION.width, abs=1e-9)
    assert site[1] - OBSERVATION.target[1] == pytest.approx(values[4] * shift * OBSERVATION.width, abs=1e-9)
    assert site[2] == OBSERVATION.target[2]


@pytest.mark.parametrize("bad", [[0.0] * 4, [[0.0] * 5], [math.nan, 0, 0, 0, 0], [0, 0, 0, 0, math.inf]])
def test_bad_actions_are_named(bad):
    with pytest.raises(ValueError, match="action must"):
        decide_action(np.array(bad, dtype=float), OBSERVATION)
