"""How long a tile and its safety map take; `python -m studies.bench` prints it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numba
import numpy as np

from guidance.validation import finite_number
from hda.safety.safety_map import assess_safety
from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng


@dataclass(frozen=True)
class WallTime:
    """Repeated wall times of one piece of work, after a first run that compiles.

    Attributes:
        name: what was done.
        seconds: [s] each repetition, in order.
    """

    name: str
    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """[s] the middle one."""
        return float(np.median(self.seconds))


def measure_terrain(repeats: int = 7, size: int = 1000) -> list[WallTime]:
    """Time a default tile of `size` cells, and its safety map on one thread and on all.

    Raises:
        ValueError: `repeats` is less than one, or `size` too small for the lander.
    """
    finite_number("repeats", repeats, at_least=1)
    parameters = replace(TerrainParameters(), size=size)
    dem = generate_terrain(parameters, terrain_rng(0))
    shape = f"{size} x {size} cells of 1 m"
    times = [
        _measure(f"terrain, {shape}", lambda: generate_terrain(parameters, terrain_rng(0)), repeats),
    ]
    threads = numba.get_num_threads()
    try:
        for count in sorted({1, threads}):
            numba.set_num_threads(count)
            name = f"safety map, {shape}, {count} thread{'s' if count > 1 else ''}"
            times.append(_measure(name, lambda: assess_safety(dem), repeats))
    finally:
        numba.set_num_threads(threads)
    return times


def _measure(name: str, work: Callable[[], object], repeats: int) -> WallTime:
    work()
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return WallTime(name, tuple(seconds))
