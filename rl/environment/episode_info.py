"""The `info` of the environments: the same keys with the same types at reset, at every step and at the end.

Vector environments make one array of each key, and recorders of episodes one row of each step; both fail on
keys that come and go and on objects. `LandingEnv.outcome` and `LandingEnv.steps` hold the objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hda.flight.episode import Flight, Step
from hda.flight.outcome import Ending, RewardTerms
from hda.task.random_streams import EpisodeStreams
from hda.task.scenario import Scenario, ground_point

ENDING_CODES = {ending: code for code, ending in enumerate(Ending, start=1)}
"""The number that stands for each ending in `info`; 0 is in flight."""

_LARGEST = 2**63 - 1


def study_number(streams: EpisodeStreams) -> int:
    """The study seed as it stands in `info`: -1 where it has more than 63 bits."""
    return int(streams.study_seed) if streams.study_seed <= _LARGEST else -1


def describe_episode(scenario: Scenario, flight: Flight, steps: Sequence[Step]) -> dict[str, Any]:
    """Numbers of an episode as it stands; see `rl.environment.env.LandingEnv` for the keys.

    Args:
        scenario: what is flown.
        flight: where it stands.
        steps: what was flown so far.
    """
    streams, state = scenario.streams, flight.state
    outcome = steps[-1].outcome if steps else None
    start, dry_mass = scenario.initial_state.mass, scenario.preset.lander.dry_mass
    miss = state.position - ground_point(scenario, flight.target)
    return {
        "study_seed": study_number(streams),
        "episode_number": int(streams.episode),
        "tile": int(scenario.tile.number),
        "reward_terms": asdict(steps[-1].reward if steps else RewardTerms()),
        "target_distance": float(np.linalg.norm(miss)),
        "speed": float(np.linalg.norm(state.velocity)),
        "propellant_fraction": (start - state.mass) / (start - dry_mass),
        "pointing_limited": sum(step.segment.pointing_limited for step in steps),
        "ending": 0 if outcome is None else ENDING_CODES[outcome.ending],
        "is_success": outcome is not None and bool(outcome.success),
        "safe_site": outcome is not None and bool(outcome.safe_site),
    }
