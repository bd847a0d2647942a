"""Episodes flown for a dataset, block by block: what was seen, done and paid."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hda.flight.episode import advance, begin_flight, observe
from hda.task.presets import find_preset
from hda.task.scenario import Scenario, sample_scenario
from rl.dataset.behaviours import Behaviour, find_behaviour
from rl.dataset.plain_file import Dataset, DatasetError, read_dataset, write_dataset
from rl.dataset.transitions import KINDS, Transitions
from rl.environment.encoding import CURVED
from rl.environment.episode_info import ENDING_CODES
from rl.environment.sight import LookSight
from rl.environment.steering import GainSteering
from rl.inference.artefacts import ENCODER
from rl.inference.latent import encoder_path, load_encoder


@dataclass(frozen=True)
class Block:
    """Successive episodes of one policy, and the file that keeps them.

    Attributes:
        preset: name of the setting.
        split: tile split.
        study_seed: of the study whose episodes they are.
        policy: name of the policy.
        place: of the policy in the dataset's list.
        first: number of the first episode.
        last: one more than that of the last.
        file: where they are kept.
    """

    preset: str
    split: str
    study_seed: int
    policy: str
    place: int
    first: int
    last: int
    file: Path

    @property
    def card(self) -> dict[str, Any]:
        """What the file's card says, so that no other block is taken for it."""
        said = {name: value for name, value in asdict(self).items() if name != "file"}
        return {"policies": [None] * self.place + [self.policy], "block": said}


def fly_block(block: Block) -> None:
    """Fly a block, and write its file."""
    behaviour, preset = find_behaviour(block.policy), find_preset(block.preset)
    columns: dict[str, list[Any]] = {name: [] for name in KINDS}
    for episode in range(block.first, block.last):
        scenario = sample_scenario(preset, block.study_seed, episode, block.split)
        record_episode(behaviour, scenario, columns)
        columns["policy"].append(block.place)
    arrays: dict[str, Any] = {name: np.array(values, KINDS[name]) for name, values in columns.items()}
    write_dataset(block.file, Dataset(block.card, Transitions(**arrays)))


def read_block(block: Block) -> Transitions | None:
    """What is kept of a block; None where nothing is, or nothing whole."""
    try:
        kept = read_dataset(block.file)
    except DatasetError:
        return None
    return kept.transitions if kept.card.get("block") == block.card["block"] else None


def record_episode(behaviour: Behaviour, scenario: Scenario, columns: dict[str, list[Any]]) -> None:
    """Fly one episode as `LunarHDA-v0` flies it, and write down what it saw, did and was paid.

    Args:
        behaviour: what acts.
        scenario: what is flown.
        columns: lists by the names of `Transitions`; all but `policy` become longer.
    """
    sight, steering = LookSight(CURVED, load_encoder(encoder_path(ENCODER))), GainSteering()
    memory = behaviour.begin(scenario.view, scenario.streams.policy())
    remembered = sight.begin(scenario.view)
    flight, outcome, steps = begin_flight(scenario), None, 0
    while True:
        observation = observe(scenario, flight)
        vector, remembered = sight.see(observation, remembered)
        columns["observations"].append(vector)
        if outcome is not None:
            break
        action, memory = behaviour.act(observation, memory)
        decision, _ = steering.decide(action, observation, None)
        step = advance(scenario, flight, decision)
        flight, outcome, steps = step.flight, step.outcome, steps + 1
        columns["actions"].append(action)
        columns["rewards"].append(step.reward.total)
        columns["terminated"].append(outcome is not None and not step.truncated)
        columns["truncated"].append(step.truncated)
    columns["length"].append(steps)
    columns["episode"].append(scenario.streams.episode)
    columns["tile"].append(scenario.tile.number)
    columns["ending"].append(ENDING_CODES[outcome.ending])
    columns["safe_site"].append(bool(outcome.safe_site))
