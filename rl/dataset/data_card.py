"""What is known of a dataset: who flew, over which ground, how well, made by which command."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hda.ground.library import Ground
from hda.task.presets import find_preset
from rl.dataset.behaviours import weights_digest
from rl.dataset.transitions import Transitions
from rl.environment.episode_info import ENDING_CODES
from rl.inference.artefacts import library_versions

_SUCCESS = 1


class Ratio(NamedTuple):
    """[%] how often something came about; the card lists the three numbers.

    Attributes:
        value: share of the episodes.
        low: lower end of Wilson's 95 % interval.
        high: its upper end.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class PolicyScore:
    """How a policy flew.

    Attributes:
        policy: name.
        episodes: how many.
        steps: of all of them.
        success_percent: [%] successes.
        safe_site_percent: [%] touchdowns on safe ground.
        reward: mean over the episodes of their undiscounted sums.
    """

    policy: str
    episodes: int
    steps: int
    success_percent: Ratio
    safe_site_percent: Ratio
    reward: float


@dataclass(frozen=True)
class PolicyIdentity:
    """Who flew.

    Attributes:
        name: of the policy.
        weights_sha256: digest of its weights; None for draws.
    """

    name: str
    weights_sha256: str | None


@dataclass(frozen=True)
class DatasetIdentity:
    """What decides the numbers of a dataset, but how many episodes there are.

    Attributes:
        environment: id.
        preset: setting.
        split: tile split.
        ground: key of the tiles' parameters.
        study_seed: of the episodes.
        policies: who flew.
        endings: their names by code.
        sources: digest of the program's sources.
        versions: of the libraries.
        version: of the program.
    """

    environment: str
    preset: str
    split: str
    ground: str
    study_seed: int
    policies: tuple[PolicyIdentity, ...]
    endings: dict[int, str]
    sources: str
    versions: dict[str, str]
    version: str

    @property
    def json(self) -> dict[str, Any]:
        """As the card says it when it is read back."""
        return json.loads(json.dumps(asdict(self)))


def identify_dataset(preset: str, split: str, study_seed: int, policies: tuple[str, ...]) -> DatasetIdentity:
    """What this program would fly."""
    from guidance.kernel import source_hash

    setting = find_preset(preset)
    return DatasetIdentity(
        environment="LunarHDA-v0",
        preset=preset,
        split=split,
        ground=Ground(setting.terrain, setting.criteria).key,
        study_seed=study_seed,
        policies=tuple(PolicyIdentity(name, weights_digest(name)) for name in policies),
        endings={code: str(ending) for ending, code in ENDING_CODES.items()},
        sources=source_hash(),
        versions=library_versions(),
        version=version("lunar-hda"),
    )


def score_policies(transitions: Transitions, policies: tuple[str, ...]) -> list[PolicyScore]:
    """How each policy flew."""
    return [
        PolicyScore(
            policy=name,
            episodes=int(own.sum()),
            steps=int(transitions.length[own].sum()),
            success_percent=_ratio(transitions.ending[own] == _SUCCESS),
            safe_site_percent=_ratio(transitions.safe_site[own]),
            reward=float(transitions.returns[own].mean()),
        )
        for place, name in enumerate(policies)
        for own in [transitions.policy == place]
    ]


def _ratio(events: NDArray[np.bool_]) -> Ratio:
    """The share, and its interval."""
    from scipy.stats import binomtest

    found = binomtest(int(events.sum()), events.size).proportion_ci(method="wilson")
    return Ratio(*(100.0 * float(value) for value in (events.mean(), found.low, found.high)))


def describe_dataset(card: dict[str, Any]) -> str:
    """The card as a page, in Markdown."""
    steps = sum(score["steps"] for score in card["scores"])
    versions = ", ".join(f"{name} {version}" for name, version in card["versions"].items())
    lines = [
        f"# Episodes of {card['environment']} on `{card['preset']}`",
        "",
        "| | |",
        "|---|---|",
        f"| made by | `{card['command']}` |",
        f"| ground | tiles `{card['split']}`, parameters {card['ground']} |",
        f"| episodes | 0 to {card['episodes'] - 1} of study {card['study_seed']}, the same for each policy |",
        f"| software | lunar-hda {card['version']}, sources {card['sources'][:12]}, {versions} |",
        "",
        "| policy | episodes | steps | share of steps % | success % | safe site % | mean reward |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for score in card["scores"]:
        ratios = [
            "{:.1f} ({:.1f}-{:.1f})".format(*score[name]) for name in ("success_percent", "safe_site_percent")
        ]
        share = f"{100.0 * score['steps'] / steps:.1f}"
        cells = [score["episodes"], score["steps"], share, *ratios, f"{score['reward']:.3f}"]
        lines.append(f"| {score['policy']} | {' | '.join(map(str, cells))} |")
    lines += ["", *_NOTES, ""]
    return "\n".join(lines)


_NOTES = (
    "Intervals: 95 %, Wilson's, over episodes; those of one tile are alike, so the true ones are wider.",
    "",
    "An observation is the vector of `LunarHDA-v0` (layout `curved`), whatever its policy saw: one with"
    " memory or a belief knew more. An action is five numbers in [-1, 1], a reward"
    " `hda.flight.outcome.score_step`. The last observation of an episode is that at its end.",
    "",
    "Meant for offline learning in research. Judge what has learnt from one split on another.",
)
