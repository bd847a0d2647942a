"""What the episodes of a batch share, and which presets a batch serves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hda.sensing.lidar import Lidar
from hda.task.presets import Preset
from rl.environment.action import ActionRanges


def check_count(name: str, value: object) -> None:
    """Raise ValueError naming `name` where `value` is no whole number of at least one."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} must be a whole number of at least 1, got {value!r}")


def is_served(preset: Preset) -> bool:
    """Whether the kernels can fly a preset."""
    beyond = preset.stance, preset.navigation, preset.body
    return isinstance(preset.lidar, Lidar) and all(part is None for part in beyond)


def refuse_unserved(preset: Preset, way_out: str = "vectorization_mode='sync' flies the others") -> None:
    """Raise ValueError where the kernels cannot fly a preset; its message ends in the way out."""
    if not is_served(preset):
        raise ValueError(
            f"preset must have looks by Algorithm 2, touchdown on the plane, no filter and no body, got"
            f" {preset.name!r}: {way_out}"
        )


@dataclass(frozen=True)
class BatchSettings:
    """What the episodes of a batch share.

    Attributes:
        preset: the setting; its dispersions may differ from episode to episode.
        count: episodes at a time.
        action_ranges: what -1 and 1 of an action mean.
        threads: over which flights and looks are spread; the numbers do not depend on it.

    Raises:
        ValueError: a batch does not serve the preset, or a number is below one.
    """

    preset: Preset
    count: int
    action_ranges: ActionRanges
    threads: int = 1

    def __post_init__(self) -> None:
        """Refuse what the kernels cannot fly."""
        check_count("num_envs", self.count)
        check_count("threads", self.threads)
        refuse_unserved(self.preset)
