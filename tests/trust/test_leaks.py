"""Memory and open files stay flat over many episodes and many solves.

Resident memory is read at equal steps; the first third is warm-up. A straight line is fitted through the
rest: its slope times the length of that part is the growth. The tolerance, 8 MB, is a leak of 1.2 kB per
episode of the 6667 that are fitted: less than one flight's record.
"""

import gc
import os
import subprocess
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import guidance
import hda

TOLERANCE = 8e6  # [bytes]
SAMPLES = 60
ROOT = Path(__file__).parents[2]


def resident() -> int:
    """[bytes] resident memory of this process."""
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


def measure(repeat: Callable[[], object], times: int) -> tuple[float, int]:
    """Growth [bytes] by the fitted line over the last two thirds, and of the number of open files."""
    memory, files = [], []
    for k in range(times):
        repeat()
        if (k + 1) % (times // SAMPLES) == 0:
            gc.collect()
            memory.append(resident())
            files.append(open_files())
    fitted = np.array(memory[SAMPLES // 3 : SAMPLES], dtype=np.float64)
    slope = float(np.polyfit(np.arange(fitted.size), fitted, 1)[0])
    return slope * fitted.size, max(files[SAMPLES // 3 :]) - files[SAMPLES // 3]


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="reads Linux's /proc"),
]


def fly_episodes() -> tuple[float, int]:
    policy, episodes = hda.make_policy("no-divert"), count()

    def fly_next() -> None:
        hda.fly(policy, hda.sample_scenario("paper", 1, next(episodes), "validation"))

    for _ in range(200):
        fly_next()
    return measure(fly_next, 10_000)


def solve_descents() -> tuple[float, int]:
    rng = np.random.default_rng(0)

    def solve() -> None:
        x, y = rng.uniform(-200.0, 200.0, 2)
        guidance.solve_pdg((x, y, 950.0, 0.0, 0.0, -25.0, 1200.0), (0.0, 0.0, 50.0))

    for _ in range(50):
        solve()
    return measure(solve, 3000)


def keep_bytes() -> tuple[float, int]:
    kept = []
    return measure(lambda: kept.append(os.urandom(2000)), 12_000)


def measure_alone(function: Callable[[], tuple[float, int]]) -> tuple[float, int]:
    """Measure in a fresh process: what earlier tests freed would hide a leak."""
    code = f"from tests.trust.test_leaks import {function.__name__}; print(*{function.__name__}())"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    growth, files = done.stdout.split()
    return float(growth), int(files)


@pytest.mark.parametrize("function", [fly_episodes, solve_descents])
def test_memory_and_files_are_flat(function: Callable[[], tuple[float, int]]) -> None:
    growth, files = measure_alone(function)
    assert growth < TOLERANCE, f"{growth / 1e6:.1f} MB"
    assert files <= 0


def test_the_measure_notices_a_leak() -> None:
    growth, files = measure_alone(keep_bytes)
    assert growth > TOLERANCE
    assert files == 0
