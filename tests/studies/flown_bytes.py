"""Flights whose bytes are kept, of six presets without a body (`PRESETS`): no work on bodies may move them.

`PYTHONPATH=. python tests/studies/flown_bytes.py` flies them and writes flown_bytes.json anew. That belongs
to a change that moves flights on purpose, and the change log says so.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import llvmlite.binding
import numpy as np

import rl  # registers the agents
from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.registry import make_policy
from hda.task.scenario import sample_scenario

assert rl.__doc__
KEPT = Path(__file__).with_name("flown_bytes.json")
EPISODES = 3
PRESETS = ("paper", "hard", "partial", "lidar", "lidar-coarse", "navigated")
POLICIES = ("single-divert", "nearest-safe+convex", "hazard-aware")
FLIGHTS = [(preset, policy) for preset in PRESETS for policy in POLICIES] + [("paper", "td3")]


def flown_on() -> dict[str, str]:
    """What bytes may depend on beside the sources: numba compiles for the processor that it finds."""
    packages = ("clarabel", "llvmlite", "numba", "numpy", "scipy")
    return {
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": llvmlite.binding.get_host_cpu_name(),
        **{name: metadata.version(name) for name in packages},
    }


def digest_flight(record: EpisodeRecord) -> str:
    """Of all that a flight is made of: its nodes and commands, and what was seen and decided."""
    total = hashlib.sha256()
    arrays: list[Any] = [record.time, record.path, record.commanded_thrust, record.thrust]
    for observation, decision in zip(record.observations, record.decisions, strict=True):
        arrays += [observation.state.as_array(), observation.target, observation.safety_map, decision.site]
        arrays += [each for each in (observation.elevation, observation.covariance) if each is not None]
    for array in arrays:
        values = np.ascontiguousarray(array)
        total.update(f"{values.dtype.str}{values.shape}".encode())
        total.update(values.tobytes())
    return total.hexdigest()[:16]


def fly_episodes(preset: str, policy: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name of each flight with its digest, and where [m] and when [s] it ended."""
    for episode in range(EPISODES):
        record = fly(make_policy(policy), sample_scenario(preset, 0, episode, split="tuning"))
        touchdown = [round(float(value), 4) for value in record.outcome.touchdown]
        found = {"digest": digest_flight(record), "touchdown": touchdown, "time": round(record.time[-1], 4)}
        yield f"{preset}, {policy}, {episode}", found


def main() -> None:
    """Write the file anew."""
    flights = dict(pair for each in FLIGHTS for pair in fly_episodes(*each))
    lines = ",\n".join(f"  {json.dumps(name)}: {json.dumps(found)}" for name, found in flights.items())
    KEPT.write_text(f'{{\n "flown_on": {json.dumps(flown_on())},\n "flights": {{\n{lines}\n }}\n}}\n')


if __name__ == "__main__":
    main()
