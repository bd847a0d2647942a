"""Intervals of linear commands, cut in parts, say the same."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.rigid_descent import cut_commands


@given(st.integers(0, 10**6), st.integers(0, 5), st.integers(1, 6))
def test_parts_are_the_same_commands_in_time_order(seed, intervals, parts):
    commands = np.random.default_rng(seed).normal(size=(intervals, 2, 3))
    cut = cut_commands(commands, parts)
    assert cut.shape == (intervals * parts, 2, 3)
    for part, (first, last) in enumerate(cut):
        whole, share = commands[part // parts], (part % parts) / parts
        np.testing.assert_allclose(first, (1.0 - share) * whole[0] + share * whole[1], atol=1e-14)
        share += 1.0 / parts
        np.testing.assert_allclose(last, (1.0 - share) * whole[0] + share * whole[1], atol=1e-14)


@pytest.mark.parametrize("parts", [0, -1, 1.5])
def test_an_interval_has_at_least_one_part(parts):
    with pytest.raises(ValueError, match="parts must be an integer of at least 1"):
        cut_commands(np.zeros((2, 2, 3)), parts)
