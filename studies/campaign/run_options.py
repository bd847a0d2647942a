"""What the commands that keep finished work, and those that fly several studies in one run, ask alike."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from guidance.validation import finite_number
from studies.campaign.claimed_folder import Existing


@dataclass(frozen=True, kw_only=True)
class KeepingOptions:
    """Options of a run that keeps finished work.

    Attributes:
        resume: keep finished work of the same study in the folder, and do what is missing.
        overwrite: replace the study in the folder.
    """

    resume: bool = False
    overwrite: bool = False

    @property
    def existing(self) -> Existing:
        """What to do with a folder that holds a study.

        Raises:
            ValueError: two answers were given.
        """
        if self.resume and self.overwrite:
            raise ValueError("resume and overwrite exclude each other")
        if self.resume:
            return Existing.RESUME
        return Existing.OVERWRITE if self.overwrite else Existing.REFUSE


@dataclass(frozen=True, kw_only=True)
class FolderOptions(KeepingOptions):
    """Options of a run that keeps finished work in a folder with a name of its own.

    Attributes:
        out: folder for results.
    """

    out: Path


@dataclass(frozen=True, kw_only=True)
class FlyingOptions(FolderOptions):
    """Options of a run that flies policies; a command adds its own, and describes those that differ there.

    Attributes:
        policies: names of policies; `default` is every one that is not slow, not made for another
            preset and no rival, `rivals` those rebuilt from the papers of others;
            `package.module:Name` is your own.
        episodes: episodes per policy.
        study_seed: seed of the study; equal seeds give equal episodes.
        split: tile split: validation or fresh.
        workers: processes; changes nothing but the time.
    """

    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("default",)
    episodes: int
    study_seed: int = 0
    split: str = "validation"
    workers: int = 2

    def __post_init__(self) -> None:
        """Check every number."""
        finite_number("episodes", self.episodes, at_least=1)
        finite_number("workers", self.workers, at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)


@dataclass(frozen=True, kw_only=True)
class RunOptions(FlyingOptions):
    """Options of a run that flies policies and draws a figure.

    Attributes:
        figures: draw the figure.
    """

    figures: bool = True
