"""How far a look of a ranging LIDAR can be trusted: precision and recall of "safe", by range and rays.

Looks are taken at the tuning tiles, around places where an episode could begin. A pixel is called safe where
Algorithm 1, on the elevation map of this one scan, gives it at least `threshold`; the truth is the verdict on
the whole map. Precision is the share of what is called safe that is, recall the share of what is safe that is
called so. Coarse posts step over rocks: from high up much that looks safe is not.

What the belief makes of the looks of a whole flight is held against the truth too: the calibration is the
share of safe ground among the cells of which it tells one probability. flight.png shows one flight of
`hazard-aware` look by look: measured heights, verdict, truth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.ground.library import Ground, prepare_tiles, tile_numbers
from hda.registry import make_policy
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import Journal, open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.looks.calibration import (
    CALIBRATION_COLUMNS,
    CalibrationRow,
    StatementCounts,
    count_statements,
    score_statements,
)
from studies.looks.counts import LookSeries, PixelCounts, count_pixels, sensor_of
from studies.looks.table import COLUMNS, LookRow, score_looks

_SHOWN = "hazard-aware"
_PRODUCTS = (
    "table.csv",
    "table.md",
    "looks.png",
    "calibration.csv",
    "calibration.md",
    "calibration.png",
    "flight.png",
    "provenance.json",
)


@dataclass(frozen=True, kw_only=True)
class Looks(FolderOptions):
    """Command line of the looks study.

    Attributes:
        preset: the setting, with a ranging LIDAR.
        rays: numbers of rays along each side of a scan.
        ranges: [m] from the vehicle to the target.
        looks: per tile.
        flights: whose beliefs are held against the truth, for each number of rays; 0 leaves it out.
        tiles: tuning tiles, the first ones.
        off_nadir: [deg] angle of the line of sight from the vertical.
        threshold: least V_P that is called safe.
        study_seed: seed of places and errors; equal seeds give equal looks.
        workers: processes that build tiles.
        figures: draw the figure.
    """

    preset: str = "lidar"
    rays: Annotated[tuple[int, ...], tyro.conf.arg(metavar="RAYS ...")] = (64, 128)
    ranges: Annotated[tuple[float, ...], tyro.conf.arg(metavar="METRES ...")] = (950.0, 600.0, 300.0, 150.0)
    looks: int = 4
    flights: int = 120
    tiles: int = 60
    off_nadir: float = 10.0
    threshold: float = 0.5
    study_seed: int = 0
    workers: int = 2
    figures: bool = True
    out: Path = Path("results/looks")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("looks", "tiles", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)
        finite_number("flights", self.flights, at_least=0)
        finite_number("off_nadir", self.off_nadir, at_least=0.0, at_most=60.0)
        finite_number("threshold", self.threshold, above=0.0, at_most=1.0)
        for name in ("rays", "ranges"):
            if not getattr(self, name):
                raise ValueError(f"{name} must hold at least one number")
        for slant_range in self.ranges:
            finite_number("ranges", slant_range, above=0.0)
        for rays in self.rays:
            finite_number("rays", rays, at_least=2)


@dataclass(frozen=True)
class Finished:
    """What is kept of one piece of work: the pixels over a tile, or the statements of a flight."""

    pixels: tuple[PixelCounts, ...] = ()
    statements: tuple[StatementCounts, ...] = ()


def take_looks(options: Looks, preset: Preset, journal: Journal[Finished]) -> list[LookRow]:
    """Take the looks at every tile, from every range, with every number of rays."""
    lidar, angle = sensor_of(preset), math.radians(options.off_nadir)
    series = LookSeries(preset, options.looks, angle, options.threshold, options.study_seed)
    tiles = tile_numbers("tuning", Ground(preset.terrain, preset.criteria))[: options.tiles]
    work = [(rays, far, tile) for rays in options.rays for far in options.ranges for tile in tiles]
    counts: dict[tuple[int, float], list[PixelCounts]] = {}
    for rays, far, tile in track(work, "looks", transient=True):
        key = (rays, far, tile)
        found = journal.find(key)
        if found is None:
            found = journal.keep(key, Finished(pixels=(count_pixels(series, tile, rays, far),)))
        counts.setdefault((rays, far), []).extend(found.pixels)
    rows = []
    for (rays, far), own in counts.items():
        spacing = replace(lidar, rays=rays).ray_spacing(np.array([0.0, 0.0, far]), np.zeros(3))
        rows.append(score_looks(rays, far, spacing, options.looks, own))
    return rows


def fly_beliefs(options: Looks, preset: Preset, journal: Journal[Finished]) -> list[CalibrationRow]:
    """Hold the beliefs of flights against the truth, for every number of rays."""
    work = [(rays, episode) for rays in options.rays for episode in range(options.flights)]
    counts: dict[int, list[StatementCounts]] = {}
    for rays, episode in track(work, "flights", transient=True):
        key = ("flight", rays, episode)
        found = journal.find(key)
        if found is None:
            statements = count_statements(preset, rays, options.study_seed, episode)
            found = journal.keep(key, Finished(statements=(statements,)))
        counts.setdefault(rays, []).extend(found.statements)
    return [row for rays, own in counts.items() for row in score_statements(rays, own)]


def study_looks(options: Looks) -> tuple[list[LookRow], list[CalibrationRow]]:
    """Take the looks, fly the beliefs, write the folder and print both tables.

    Raises:
        ValueError: an option is out of range or names something unknown, or the folder holds another study.
        OSError: the folder cannot be written.
    """
    preset = find_preset(options.preset)
    sensor_of(preset)
    decided = {
        name: getattr(options, name) for name in ("preset", "looks", "off_nadir", "threshold", "study_seed")
    }
    identity = identify_run(Path(__file__).parent, decided)
    out = open_folder(options.out)
    with open_journal(out, Finished, _PRODUCTS, identity, options.existing) as journal:
        prepare_tiles(Ground(preset.terrain, preset.criteria), "tuning", options.workers)
        rows, beliefs = take_looks(options, preset, journal), fly_beliefs(options, preset, journal)
        write_csv(out / "table.csv", COLUMNS, rows)
        write_markdown(out / "table.md", COLUMNS, rows)
        write_csv(out / "calibration.csv", CALIBRATION_COLUMNS, beliefs)
        write_markdown(out / "calibration.md", CALIBRATION_COLUMNS, beliefs)
        if options.figures:
            from hda.flight.look_picture import draw_looks as draw_flown_looks
            from studies.looks.picture import draw_calibration, draw_looks

            flown = fly(make_policy(_SHOWN), sample_scenario(preset, options.study_seed, 0, "tuning"))
            draw_flown_looks(flown).savefig(out / "flight.png", dpi=85)
            draw_looks(rows).savefig(out / "looks.png", dpi=110)
            draw_calibration(beliefs).savefig(out / "calibration.png", dpi=110)
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    console = Console(width=max(Console().width, 120))
    title = f"{preset.name}: what one look is worth; tuning tiles, intervals clustered by tile"
    console.print(console_table(COLUMNS, rows, title))
    if beliefs:
        title = f"{preset.name}: what the belief tells, and how often it is so ({options.flights} flights)"
        console.print(console_table(CALIBRATION_COLUMNS, beliefs, title))
    console.print(f"results in {out}")
    return rows, beliefs


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_looks(tyro.cli(Looks, description=__doc__))
