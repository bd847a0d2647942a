"""Whether the belief on measured looks means what it says: probability told against share of safe ground.

`nearest-safe` flies over the tuning tiles; every cell that a look read, or read anew, is a statement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hda.flight.episode import fly
from hda.policies.hazard_aware import fuse_look
from hda.registry import make_policy
from hda.task.presets import Preset
from hda.task.scenario import sample_scenario
from studies.columns import Column
from studies.looks.counts import sensor_of
from studies.statistics.ratios import Interval, clustered_count_interval

EDGES = (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
"""Classes of the probability that is told."""


@dataclass(frozen=True)
class StatementCounts:
    """Statements of one flight, by class of the probability told; n classes.

    Attributes:
        tile: that was flown over.
        cells: shape (n,), number of statements.
        told: shape (n,), sum of their probabilities.
        safe: shape (n,), number of them about safe ground.
    """

    tile: int
    cells: tuple[int, ...]
    told: tuple[float, ...]
    safe: tuple[int, ...]


def count_statements(preset: Preset, rays: int, study_seed: int, episode: int) -> StatementCounts:
    """Fly an episode of the tuning tiles and count what the belief says after each look that it changed."""
    setting = replace(preset, lidar=replace(sensor_of(preset), rays=rays))
    record = fly(make_policy("nearest-safe"), sample_scenario(setting, study_seed, episode, "tuning"))
    truth, view = record.scenario.tile.deterministic, record.scenario.view
    classes = len(EDGES) - 1
    cells, told, safe = np.zeros(classes), np.zeros(classes), np.zeros(classes)
    belief, before = None, None
    for observation in record.observations:
        belief = fuse_look(observation, view, belief)
        probability = belief.probability()
        rows, columns = np.nonzero(belief.seen & (True if before is None else probability != before))
        before = probability
        north, east = rows + belief.corner[1], columns + belief.corner[0]
        inside = (north >= 0) & (north < truth.shape[0]) & (east >= 0) & (east < truth.shape[1])
        said = probability[rows[inside], columns[inside]].astype(float)
        own = np.clip(np.searchsorted(EDGES, said, side="right") - 1, 0, classes - 1)
        cells += np.bincount(own, minlength=classes)
        told += np.bincount(own, weights=said, minlength=classes)
        safe += np.bincount(own, weights=truth[north[inside], east[inside]], minlength=classes)
    return StatementCounts(
        record.scenario.tile.number,
        tuple(int(count) for count in cells),
        tuple(float(total) for total in told),
        tuple(int(count) for count in safe),
    )


@dataclass(frozen=True)
class CalibrationRow:
    """One class of the probability that is told.

    Attributes:
        rays: along each side of a scan.
        told: mean probability that was told.
        cells: number of statements.
        safe: share of them about safe ground, clustered by tile.
    """

    rays: int
    told: float
    cells: int
    safe: Interval


def score_statements(rays: int, flights: Sequence[StatementCounts]) -> list[CalibrationRow]:
    """A row for each class in which anything was said."""
    _, member = np.unique([flight.tile for flight in flights], return_inverse=True)
    rows = []
    for k in range(len(EDGES) - 1):
        cells = np.bincount(member, weights=[flight.cells[k] for flight in flights])
        safe = np.bincount(member, weights=[flight.safe[k] for flight in flights])
        some = cells > 0
        if some.any():
            told = sum(flight.told[k] for flight in flights) / cells.sum()
            share = clustered_count_interval(safe[some], cells[some].astype(int))
            rows.append(CalibrationRow(rays, float(told), int(cells.sum()), share))
    return rows


CALIBRATION_COLUMNS: tuple[Column[CalibrationRow], ...] = (
    Column("rays", "rays a side", lambda row: row.rays),
    Column("told", "told", lambda row: row.told, digits=4),
    Column("cells", "statements", lambda row: row.cells),
    Column("safe", "safe", lambda row: row.safe, digits=4, interval=True),
)
"""Probability told and share of safe ground: calibration.csv, .md and the console read this list."""
