"""Which episodes an environment flies."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from hda.ground.library import Ground, prepare_tiles, tile_numbers
from hda.task.presets import Preset, find_preset
from hda.task.scenario import Scenario, sample_scenario
from rl.environment.dispersions import Dispersions


@dataclass(frozen=True)
class EpisodeSource:
    """Which episodes an environment flies.

    Attributes:
        preset: name of a preset, or a Preset.
        split: tile split; evaluation belongs to `hda.fly` on the other splits.
        dispersions: factors on the preset's dispersions.

    Raises:
        ValueError: unknown preset, or a split that its terrain does not have.
    """

    preset: str | Preset = "paper"
    split: str = "train"
    dispersions: Dispersions = field(default_factory=Dispersions)
    _prepared: bool = field(default=False, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Refuse what no episode could be drawn from."""
        setting = find_preset(self.preset)
        tile_numbers(self.split, Ground(setting.terrain, setting.criteria))

    @cached_property
    def _setting(self) -> Preset:
        return self.dispersions.applied(find_preset(self.preset))

    def prepare(self) -> None:
        """Build the tiles of the split that are missing, with a progress bar; once for each source."""
        if not self._prepared:
            setting = find_preset(self.preset)
            prepare_tiles(Ground(setting.terrain, setting.criteria), self.split)
            object.__setattr__(self, "_prepared", True)

    def scenario(self, study_seed: int, episode: int, changes: dict[str, float]) -> Scenario:
        """Draw one; `changes` replace single dispersions."""
        setting = self._setting
        if changes:
            setting = replace(self.dispersions, **changes).applied(find_preset(self.preset))
        return sample_scenario(setting, study_seed, episode, self.split)
