"""Made-up episodes."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from rl.dataset.transitions import Transitions

LENGTHS = st.lists(st.integers(1, 5), min_size=1, max_size=6)


def make_transitions(lengths: list[int], seed: int) -> Transitions:
    """Episodes of given lengths, of two policies in turns, with numbers of chance."""
    rng, episodes, steps = np.random.default_rng(seed), len(lengths), sum(lengths)
    over = np.zeros(steps, np.bool_)
    over[np.cumsum(lengths) - 1] = True
    cut = over & (rng.uniform(size=steps) < 0.3)
    return Transitions(
        observations=rng.normal(size=(steps + episodes, 3)).astype(np.float32),
        actions=rng.uniform(-1, 1, (steps, 5)).astype(np.float32),
        rewards=rng.normal(size=steps),
        terminated=over & ~cut,
        truncated=cut,
        length=np.array(lengths, np.int64),
        policy=np.arange(episodes) % 2,
        episode=np.arange(episodes),
        tile=rng.integers(0, 70, episodes),
        ending=rng.integers(1, 4, episodes),
        safe_site=rng.uniform(size=episodes) < 0.5,
    )
