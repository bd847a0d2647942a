"""The `info` of the vector environments: that of each environment, as arrays of numbers with their masks.

The form is Gymnasium's: each key stands beside one with a leading underscore, that says for which of the
environments it holds, in nested dictionaries too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rl.environment.episode_info import ENDING_CODES, study_number
from rl.environment.native.flight_batch import REWARD_TERMS, FlightBatch, lengths

Mask = NDArray[np.bool_]


def describe_batch(batch: FlightBatch) -> dict[str, Any]:
    """Numbers of every episode as it stands: the keys of `describe_episode`, arrays of shape (n,).

    All episodes must have begun.
    """
    scenarios = [scenario for scenario in batch.scenarios if scenario is not None]
    assert len(scenarios) == batch.settings.count
    outcomes, dry_mass = batch.outcomes, batch.settings.preset.lander.dry_mass
    terms = zip(REWARD_TERMS, batch.reward_terms.T.copy(), strict=True)
    return {
        "study_seed": np.array([study_number(scenario.streams) for scenario in scenarios], np.int64),
        "episode_number": np.array([scenario.streams.episode for scenario in scenarios], np.int64),
        "tile": np.array([scenario.tile.number for scenario in scenarios], np.int64),
        "reward_terms": dict(terms),
        "target_distance": lengths(batch.state[:, :3] - batch.aims()),
        "speed": lengths(batch.state[:, 3:6]),
        "propellant_fraction": (batch.start_mass - batch.state[:, 6]) / (batch.start_mass - dry_mass),
        "pointing_limited": batch.pointing_limited.copy(),
        "ending": np.array([0 if end is None else ENDING_CODES[end.ending] for end in outcomes], np.int64),
        "is_success": np.array([end is not None and end.success for end in outcomes], np.bool_),
        "safe_site": np.array([end is not None and end.safe_site for end in outcomes], np.bool_),
    }


def with_masks(info: dict[str, Any], mask: Mask) -> dict[str, Any]:
    """Put each key's mask beside it; what does not hold reads zero.

    Args:
        info: arrays of shape (n, ...), and dictionaries of such.
        mask: shape (n,), for which environments it holds.
    """
    whole, masked = bool(mask.all()), {}
    for key, value in info.items():
        if isinstance(value, dict):
            masked[key] = with_masks(value, mask)
        else:
            masked[key] = value if whole else blank_others(value, mask)
        masked[f"_{key}"] = mask.copy()
    return masked


def blank_others(values: NDArray[Any], mask: Mask) -> NDArray[Any]:
    """The rows of the mask, and zeros in the others."""
    out = np.zeros_like(values)
    out[mask] = values[mask]
    return out
