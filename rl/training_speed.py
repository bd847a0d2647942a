"""Updates a second of plain Stable-Baselines3 TD3 and of ours: same sizes, one thread, taken in turn.

python -m rl.training_speed
"""

from __future__ import annotations

import sys
import time as clock
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro


@dataclass(frozen=True)
class TrainingSpeed:
    """Measure updates a second.

    Attributes:
        rounds: how often each is measured; the median counts.
        updates: in one measurement.
        batch_size: transitions per update.
        hidden: sizes of the hidden layers.
    """

    rounds: int = 7
    updates: int = 60
    batch_size: int = 256
    hidden: tuple[int, ...] = (256, 256)


def _filled(kind: Any, options: TrainingSpeed, fused: bool) -> Any:
    from rl.env import LunarHDAEnv

    extra = {"optimizer_kwargs": {"fused": True}} if fused else {}
    model = kind(
        "MlpPolicy",
        LunarHDAEnv(),
        seed=0,
        buffer_size=10_000,
        device="cpu",
        policy_kwargs={"net_arch": list(options.hidden), **extra},
    )
    model._setup_learn(1, None)
    rng = np.random.default_rng(0)
    replay = model.replay_buffer
    for name in ("observations", "next_observations", "actions"):
        array = getattr(replay, name)
        array[...] = rng.uniform(-1.0, 1.0, array.shape)
    replay.pos, replay.full = 0, True
    return model


def measure_training_speed(options: TrainingSpeed) -> dict[str, float]:
    """Updates a second of processor time: plain SB3, ours in float32, ours with bfloat16 products."""
    import torch
    from stable_baselines3 import TD3

    from rl.td3 import FastTD3

    torch.set_num_threads(1)
    plain, fast = _filled(TD3, options, fused=False), _filled(FastTD3, options, fused=True)
    cases = {
        "stable-baselines3": (plain, "highest"),
        "float32": (fast, "highest"),
        "bfloat16 products": (fast, "medium"),
    }
    times: dict[str, list[float]] = {name: [] for name in cases}
    before = torch.get_float32_matmul_precision()
    for _ in range(options.rounds):
        for name, (model, precision) in cases.items():
            torch.set_float32_matmul_precision(precision)
            model.train(4, options.batch_size)
            started = clock.process_time()
            model.train(options.updates, options.batch_size)
            times[name].append((clock.process_time() - started) / options.updates)
    torch.set_float32_matmul_precision(before)
    return {name: 1.0 / float(np.median(values)) for name, values in times.items()}


def main() -> None:
    """Command line."""
    speeds = measure_training_speed(tyro.cli(TrainingSpeed, description=__doc__))
    reference = speeds["stable-baselines3"]
    for name, speed in speeds.items():
        sys.stdout.write(f"{name:20s} {speed:6.1f} updates/s  {speed / reference:5.2f}\n")


if __name__ == "__main__":
    main()
