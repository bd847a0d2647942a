from __future__ import annotations

import pytest

from rl.training_speed import TrainingSpeed, measure_training_speed


@pytest.mark.slow
def test_training_is_at_least_15_percent_faster_than_plain_sb3():
    speeds = measure_training_speed(TrainingSpeed(rounds=9))
    ours = speeds["float32"], speeds["bfloat16 products"]  # the processor decides which is faster
    assert max(ours) >= 1.15 * speeds["stable-baselines3"]
