from __future__ import annotations

import pytest

from rl.training_speed import TrainingSpeed, measure_memory_speed, measure_training_speed


@pytest.mark.slow
def test_training_is_at_least_15_percent_faster_than_plain_sb3():
    speeds = measure_training_speed(TrainingSpeed(rounds=9))
    ours = speeds["float32"], speeds["bfloat16 products"]  # the processor decides which is faster
    assert max(ours) >= 1.15 * speeds["stable-baselines3"]


def test_the_speed_of_agents_with_memory_is_measured_in_both_precisions():
    options = TrainingSpeed(rounds=1, updates=2, sequences=4, length=3, memory=8)
    speeds = measure_memory_speed(options)
    names = [f"{name} {kind}" for name in ("td3-lstm", "td3-lstm-plus") for kind in ("float32", "bfloat16")]
    assert list(speeds) == names
    for rate in speeds.values():
        assert rate.processor > 0.0
        assert 0.0 < rate.wall <= 1.05 * rate.processor  # one thread: the wall clock runs no slower
