"""Count on the training tiles what a reading of a measured look is worth: how often such ground is safe.

`nearest-safe` flies over the training tiles with ranging LIDARs of several numbers of rays; every look is
fused as a belief does it, and every cell whose class the look gave or changed is counted in it, safe or not.
The truth is read where the vehicle believes the cell to be, so the preset may have no navigation errors.

python -m hda.look_statistics         counts, and prints the shares beside those in use
python -m hda.look_statistics --write counts, and writes hda/policies/beliefs/measured_readings.json
"""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import tyro
from rich.progress import track

from guidance.console import one_line_errors, tolerate_encoding
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.policies.beliefs.measured_belief import MeasuredBelief
from hda.policies.beliefs.measured_readings import (
    PROBABILITY_EDGES,
    SHAPE,
    ReadingCounts,
    read_counts,
    write_counts,
)
from hda.policies.hazard_aware import fuse_look
from hda.registry import make_policy
from hda.sensing.gridding import PIXEL_SIZES
from hda.sensing.ranging import RangingLidar
from hda.task.presets import find_preset
from hda.task.scenario import sample_scenario


@dataclass(frozen=True)
class LookStatistics:
    """Command line of the count.

    Attributes:
        episodes: flights over training tiles, for each number of rays.
        rays: numbers of rays along each side of a scan.
        preset: whose ground and sensor are used.
        write: write hda/policies/beliefs/measured_readings.json instead of comparing with it.
    """

    episodes: int = 200
    rays: Annotated[tuple[int, ...], tyro.conf.arg(metavar="RAYS ...")] = (32, 64, 96, 128, 256)
    preset: str = "lidar"
    write: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        finite_number("episodes", self.episodes, at_least=1)
        if not self.rays:
            raise ValueError("rays must hold at least one number")


def count_record(record: EpisodeRecord, counts: ReadingCounts) -> None:
    """Add to `counts` every cell whose reading a look of the flight gave or changed."""
    view, truth = record.scenario.view, record.scenario.tile.deterministic
    belief: MeasuredBelief | None = None
    for observation in record.observations:
        before = belief
        fused = fuse_look(observation, view, belief)
        assert isinstance(fused, MeasuredBelief)
        belief = fused
        assert observation.ground is not None
        read = belief.seen.copy()
        if before is not None:
            read &= (
                (belief.size_class != before.size_class)
                | (belief.density_class != before.density_class)
                | (belief.probability_class != before.probability_class)
            )
        rows, columns = np.nonzero(read)
        north, east = rows + belief.corner[1], columns + belief.corner[0]
        inside = (north >= 0) & (north < truth.shape[0]) & (east >= 0) & (east < truth.shape[1])
        rows, columns, north, east = rows[inside], columns[inside], north[inside], east[inside]
        classes = (
            belief.size_class[rows, columns],
            belief.density_class[rows, columns],
            belief.probability_class[rows, columns],
        )
        np.add.at(counts.cells, classes, 1)
        np.add.at(counts.safe, classes, truth[north, east])


def count_readings(options: LookStatistics) -> ReadingCounts:
    """Fly and count.

    Raises:
        ValueError: the preset is unknown, has no ranging LIDAR, or has navigation errors.
    """
    preset = find_preset(options.preset)
    if not isinstance(preset.lidar, RangingLidar):
        raise ValueError(f"preset must have a ranging LIDAR, such as lidar; {preset.name!r} has none")
    if preset.rules.navigation_position_error > 0.0 or preset.rules.navigation_velocity_error > 0.0:
        raise ValueError(
            f"preset must have no navigation errors, such as lidar; {preset.name!r} puts its looks beside the"
            " ground that they show"
        )
    counts = ReadingCounts(np.zeros(SHAPE, dtype=np.int64), np.zeros(SHAPE, dtype=np.int64))
    pilot = make_policy("nearest-safe")
    flights = [(rays, episode) for rays in options.rays for episode in range(options.episodes)]
    for rays, episode in track(flights, "flights", transient=True):
        setting = replace(preset, lidar=replace(preset.lidar, rays=rays))
        count_record(fly(pilot, sample_scenario(setting, 0, episode, "train")), counts)
    return counts


def describe_shares(counts: ReadingCounts) -> str:
    """Share of safe ground over all densities: a line a size of cells, a column a class of V_P."""
    cells, safe = counts.cells.sum(1), counts.safe.sum(1)
    heads = [f"<={edge:.8g}" for edge in PROBABILITY_EDGES]
    lines = ["V_P".rjust(8) + "".join(head.rjust(13) for head in [*heads, "more", "hole"])]
    for size, own, good in zip(PIXEL_SIZES, cells, safe, strict=True):
        if own.sum() > 0:
            shares = [f"{g / n:.4f}" if n > 0 else "-" for g, n in zip(good, own, strict=True)]
            lines.append(f"{size:g} m".rjust(8) + "".join(share.rjust(13) for share in shares))
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print, or write, what was counted."""
    tolerate_encoding()
    options = tyro.cli(LookStatistics, description=__doc__)
    with one_line_errors():
        counts = count_readings(options)
    out = sys.stdout.write
    out(f"{counts.cells.sum()} readings; share of safe ground\n" + describe_shares(counts))
    if options.write:
        write_counts(counts, shlex.join(["python", "-m", "hda.look_statistics", *sys.argv[1:]]))
        out("wrote hda/policies/beliefs/measured_readings.json\n")
        return
    out("in use\n" + describe_shares(read_counts()))


if __name__ == "__main__":
    main()
