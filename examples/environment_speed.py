"""Steps a second of one environment, or of many in one vector, on this checkout or on an older one.

python -m examples.environment_speed rl:LunarHDA-v0                # one, by gymnasium.make
python -m examples.environment_speed rl:LunarHDA-v0 64 2           # 64 in a native vector, two threads

It uses nothing but Gymnasium, so that code from before there were native vectors can be timed with it too:
run this file with PYTHONPATH set to a checkout of that code. `make bench` times every way of today's.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time

import gymnasium
import numpy as np

ROUNDS, STEPS = 9, 4096


def measure_step(name: str, count: int, threads: int) -> tuple[float, float]:
    """[s] a step takes by the clock and of the processor, medians over rounds; the first round warms up."""
    rng = np.random.default_rng(0)
    alone = count == 1
    env = gymnasium.make(name) if alone else gymnasium.make_vec(name, count, threads=threads)
    env.reset(seed=0)
    times = []
    for _ in range(ROUNDS + 1):
        actions = rng.uniform(-1.0, 1.0, (STEPS // count, count, 5)).astype(np.float32)
        begun = time.perf_counter(), time.process_time()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action[0] if alone else action)
            if alone and (terminated or truncated):
                env.reset()
        times.append((time.perf_counter() - begun[0], time.process_time() - begun[1]))
    wall, processor = zip(*times[1:], strict=True)
    return statistics.median(wall) / STEPS, statistics.median(processor) / STEPS


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Time of a step of one environment or of many.")
    parser.add_argument("environment", nargs="?", default="rl:LunarHDA-v0", help="id (default %(default)s)")
    parser.add_argument("count", nargs="?", type=int, default=1, help="many at a time; 1: gymnasium.make")
    parser.add_argument("threads", nargs="?", type=int, default=1, help="of the native vector")
    wanted = parser.parse_args()
    clock, used = measure_step(wanted.environment, wanted.count, wanted.threads)
    sys.stdout.write(
        f"{wanted.environment}, {wanted.count} at a time: {1e6 * clock:.0f} us a step, "
        f"{1e6 * used:.0f} of the processor\n"
    )
