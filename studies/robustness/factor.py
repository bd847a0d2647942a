"""What a factor of the robustness sweep is: one number of a preset, its levels, and how it is changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hda.task.presets import Preset


@dataclass(frozen=True)
class Factor:
    """One number of a preset.

    Attributes:
        name: lower case, hyphens; also the name of files.
        label: axis of the figure, with the unit.
        nominal: gives the preset's own value.
        levels: values to fly, those of most interest first: the first n make a sweep of n levels.
        vary: gives the preset with another value.
        applies: whether a preset has this number.
    """

    name: str
    label: str
    nominal: Callable[[Preset], float]
    levels: tuple[float, ...]
    vary: Callable[[Preset, float], Preset]
    applies: Callable[[Preset], bool] = lambda preset: True

    def chosen(self, preset: Preset, count: int) -> tuple[float, ...]:
        """The first `count` levels that differ from the preset's own value, rising."""
        own = self.nominal(preset)
        others = [level for level in self.levels if not math.isclose(level, own, abs_tol=1e-9)]
        return tuple(sorted(others[:count]))
