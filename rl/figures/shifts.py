"""When policies move their targets: how far by height above the ground, and how low the last move is made."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from rich.progress import track

from guidance.arrays import Array
from hda.flight.palette import MATPLOTLIB_DASHES, line_style
from rl.figures.flights import fly_episode
from rl.figures.options import ShiftsFigure
from rl.figures.sheet import open_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hda.flight.record import EpisodeRecord

_BIN = 100.0  # [m] of height


@dataclass(frozen=True, eq=False)
class Shifts:
    """Moves of the target in some flights of a policy.

    Attributes:
        heights: [m] shape (n,), of the lander above the target at each decision.
        moved: [m] shape (n,), how far that decision moved the target.
        last: [m] shape (m,), height at the last move of each flight that has one.
        flights: how many.
    """

    heights: Array
    moved: Array
    last: Array
    flights: int

    def describe_last(self) -> str:
        """Mean height of the last move with its 95 % interval (normal), in words."""
        if self.last.size == 0:
            return f"no move in {self.flights} flights"
        mean = float(self.last.mean())
        half = (
            1.96 * float(self.last.std(ddof=1)) / math.sqrt(self.last.size)
            if self.last.size > 1
            else math.nan
        )
        return (
            f"last move at {mean:.0f} m ({mean - half:.0f}-{mean + half:.0f}),"
            f" in {self.last.size} of {self.flights} flights"
        )


def measure_shifts(records: Sequence[EpisodeRecord], least: float) -> Shifts:
    """Collect the moves of a policy's flights.

    Args:
        records: its flights.
        least: [m] a shorter move does not count as the last one.
    """
    heights: list[float] = []
    moved: list[float] = []
    last: list[float] = []
    for record in records:
        pairs = [
            (
                float(observation.state.position[2] - observation.target[2]),
                float(np.linalg.norm(decision.site[:2] - observation.target[:2])),
            )
            for observation, decision in zip(record.observations, record.decisions, strict=True)
        ]
        heights += [height for height, _ in pairs]
        moved += [shift for _, shift in pairs]
        last += [height for height, shift in pairs if shift >= least][-1:]
    return Shifts(np.array(heights), np.array(moved), np.array(last), len(records))


def draw_shifts(options: ShiftsFigure) -> Figure:
    """How far decisions move the target by height; share of the flights whose last move is made lower.

    Prints a line for each policy.

    Raises:
        ValueError: no policy is named, or one is unknown.
    """
    if not options.policies:
        raise ValueError("policies must name at least one policy")
    figure = open_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    for k, name in enumerate(options.policies):
        shifts = measure_shifts(
            [
                fly_episode(name, options.preset, options.study_seed, episode)
                for episode in track(range(options.episodes), name, transient=True)
            ],
            options.least,
        )
        style = line_style(k)
        drawn = {"color": style["color"], "linestyle": MATPLOTLIB_DASHES[style["dash"]]}
        number = np.floor(shifts.heights / _BIN).astype(int)
        middles = [(one + 0.5) * _BIN for one in np.unique(number)]
        means = [float(shifts.moved[number == one].mean()) for one in np.unique(number)]
        left.plot(middles, means, marker="o", markersize=3.5, label=name, **drawn)
        right.plot(
            np.sort(shifts.last), np.arange(1, shifts.last.size + 1) / shifts.flights, label=name, **drawn
        )
        sys.stdout.write(f"{name}: {shifts.describe_last()}\n")
    left.set_xlabel("height above the target [m]")
    left.set_ylabel("mean move of the target by a decision [m]")
    left.invert_xaxis()
    right.set_xlabel("height above the target [m]")
    right.set_ylabel("share with the last move at or below")
    for axes in (left, right):
        axes.grid(alpha=0.25)
    left.legend()
    figure.suptitle(f"{options.preset}, {options.episodes} flights each")
    return figure
