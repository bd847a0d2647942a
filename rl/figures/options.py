"""What each figure is drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from guidance.validation import finite_number
from rl.inference.artefacts import WEIGHTS_FOLDER

_OUT = Path("results/figures")


@dataclass(frozen=True)
class TrainingFigure:
    """Critic loss, actor loss, reward and safe ratio over a run.

    Attributes:
        run: folder of the run.
        window: rows of `training.csv` in the moving average.
        out: picture to write.
    """

    run: Path
    window: int = 10
    out: Path = _OUT / "training.png"


@dataclass(frozen=True)
class ReconstructionFigure:
    """Looks at unseen ground above, what the autoencoder keeps of them below.

    Attributes:
        columns: how many.
        preset: setting.
        seed: of the random rollouts that the looks are from.
        out: picture to write.
    """

    columns: int = 8
    preset: str = "paper"
    seed: int = 0
    out: Path = _OUT / "reconstruction.png"


@dataclass(frozen=True)
class GainsFigure:
    """The agent's gains, rate of time and shift of the target over one episode.

    Attributes:
        policy: name of an agent.
        episode: number of the episode on the validation tiles.
        preset: setting.
        study_seed: seed of the study.
        out: picture to write.
    """

    policy: str = "td3"
    episode: int = 0
    preset: str = "paper"
    study_seed: int = 0
    out: Path = _OUT / "gains.png"


@dataclass(frozen=True)
class ComparisonFigure:
    """Agent and fixed gains side by side, on the first episode of which only the agent lands safely.

    Attributes:
        agent: name of the left policy.
        other: name of the right policy.
        search: episodes of the validation tiles to search; it is an error if none parts them.
        preset: setting.
        study_seed: seed of the study.
        out: picture to write.
    """

    agent: str = "td3"
    other: str = "td3-fixed-gain"
    search: int = 300
    preset: str = "paper"
    study_seed: int = 0
    out: Path = _OUT / "comparison.png"


@dataclass(frozen=True)
class AgentsFigure:
    """Every learnt agent beside rules and an optimiser, on each preset, by training seed: picture and table.

    Attributes:
        results: folders of `studies.compare` and `studies.realism`, whose `table.csv` gives the intervals.
        runs: run folders, for seeds that no card names; as last judged on the tuning tiles.
        weights: folder with the cards of exported weights.
        beside: policies that are not learnt, drawn as lines.
        presets: to draw; all by default.
        out: picture to write.
    """

    results: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="DIR ...")] = ()
    runs: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="DIR ...")] = ()
    weights: Annotated[Path, tyro.conf.arg(metavar="DIR")] = WEIGHTS_FOLDER
    beside: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = (
        "nearest-safe",
        "nearest-safe+convex",
        "hazard-aware",
    )
    presets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()
    out: Path = _OUT / "agents.png"


@dataclass(frozen=True)
class ShiftsFigure:
    """How far each policy moves its target, by the height at which it does, and the height of its last move.

    Attributes:
        policies: names.
        episodes: episodes of the validation tiles.
        preset: setting.
        study_seed: seed of the study.
        least: [m] a shorter move does not count as one.
        out: picture to write.
    """

    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("td3", "nearest-safe")
    episodes: int = 100
    preset: str = "paper"
    study_seed: int = 0
    least: float = 1.0
    out: Path = _OUT / "shifts.png"

    def __post_init__(self) -> None:
        """Check every number."""
        finite_number("episodes", self.episodes, at_least=1)
        finite_number("least", self.least, above=0.0)
