"""Flights that a report shows: which ones, flown again, and reduced to what a picture needs."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hda.flight.episode import fly
from hda.flight.outcome import ENDINGS
from hda.flight.picture import save_flight
from hda.flight.portrait.pose import engine_attitudes
from hda.flight.portrait.shape import NOZZLE, Surface, lander_surface, plume_surface
from hda.flight.record import EpisodeRecord
from hda.ground.tile import Tile
from hda.policy import ZemZevCommand
from hda.task.presets import Preset
from hda.task.scenario import ground_point, sample_scenario
from studies.campaign.monte_carlo import Study
from studies.compare.scores import StudyScores

MOST_FLIGHTS = 130
FAILED_PER_POLICY = 8
_GROUND_CELLS = 72
_GROUND_CELL = 8  # [m] a terrain patch of 576 m holds every start (250 m from its target)
_TRUTH_CELLS = 200  # cells of 1 m around the first target whose true safety is shown
_MOST_NODES = 240
_ENLARGED = 8  # times its size that a lander is drawn: at its own it is a few pixels beside 900 m of height


@dataclass(frozen=True)
class FlightPicture:
    """One flight, small enough for a page; plain numbers, strings and lists.

    Attributes:
        policy: name.
        episode: number.
        ending: one word for the end.
        words: the outcome in a sentence.
        data: what the drawing needs.
    """

    policy: str
    episode: int
    ending: str
    words: str
    data: dict[str, Any]


def choose_flights(scores: StudyScores, policies: Sequence[str]) -> list[tuple[str, int]]:
    """Choose (policy, episode) pairs: two episodes that all policies show, and failures of each policy.

    The shared ones are the first that fewest policies landed safely, and the first of the study. Failures are
    taken in turns from each kind of ending, the rarest first. Never more than MOST_FLIGHTS in all, unless the
    shared ones alone are more.
    """
    shared = sorted(scores.shared)
    most_failed = max(0, min(FAILED_PER_POLICY, MOST_FLIGHTS // len(policies) - len(shared)))
    chosen = []
    for policy in policies:
        kinds: dict[str, tuple[int, list[int]]] = {}
        for kind, (count, first) in scores.policies[policy].failures.items():
            shown = [own[policy] for own in scores.shared.values()]
            count -= sum(row.outcome == kind and not row.success for row in shown)
            kinds[kind] = count, [episode for episode in first if episode not in shared]
        failed: list[int] = []
        queues = [kinds[kind][1] for kind in sorted(kinds, key=lambda kind: (kinds[kind][0], kind))]
        while len(failed) < most_failed and any(queues):
            failed += [queue.pop(0) for queue in queues if queue]
        chosen += [(policy, episode) for episode in sorted([*shared, *failed[:most_failed]])]
    return chosen


def fly_pictures(
    study: Study,
    chosen: Sequence[tuple[str, int]],
    executor: Executor | None,
    folder: Path,
    on_progress: Callable[[], None] = lambda: None,
) -> list[FlightPicture]:
    """Fly the chosen episodes again, keep the whole flights as NPZ in `folder`, and give their pictures.

    Where a worker dies, what it had is flown in this process.
    """
    folder.mkdir(parents=True, exist_ok=True)
    futures = {}
    if executor is not None:
        futures = {pair: executor.submit(picture_flight, study, *pair, folder) for pair in chosen}
    pictures = []
    for pair in chosen:
        try:
            future = futures.get(pair)
            picture = picture_flight(study, *pair, folder) if future is None else future.result()
        except BrokenExecutor:
            picture = picture_flight(study, *pair, folder)
        pictures.append(picture)
        on_progress()
    return pictures


def picture_flight(study: Study, policy: str, episode: int, folder: Path) -> FlightPicture:
    """Fly one episode again, save it, and reduce it."""
    record = fly(
        study.make_policy(policy), sample_scenario(study.preset, study.study_seed, episode, study.split)
    )
    save_flight(folder / f"{record.policy}-{episode:06d}.npz", record)
    return reduce_flight(record)


def describe_outcome(record: EpisodeRecord) -> str:
    """The outcome in a sentence."""
    outcome = record.outcome
    words = (
        f"{record.policy} {ENDINGS[outcome.ending]}: {outcome.touchdown_speed:.2f} m/s at the end,"
        f" {outcome.miss_distance:.2f} m from its last target,"
        f" {100.0 * outcome.propellant_fraction:.1f} % of the propellant burnt,"
        f" {len(record.decisions)} looks in {record.time[-1]:.1f} s."
    )
    if record.fallbacks:
        words += f" Its own law gave no answer at {record.fallbacks} of them."
    if record.pointing_limited:
        words += f" The pointing limit held its thrust in {record.pointing_limited} control periods."
    return words


def reduce_flight(record: EpisodeRecord) -> FlightPicture:
    """Reduce a record to what a page draws; lengths to 0.1 m, maps to 16 levels."""
    stride = max(1, -(-record.time.size // _MOST_NODES))
    kept = np.unique(np.append(np.arange(0, record.time.size, stride), record.time.size - 1))
    magnitude = np.linalg.norm(record.thrust, axis=1)
    looks = [
        {
            "time": round(observation.time, 2),
            "target": _rounded(ground_point(record.scenario, observation.target)[:2], 2),
            "width": round(observation.width, 2),
            "pixels": observation.safety_map.shape[0],
            "map": pack_levels(observation.safety_map),
        }
        for observation in record.observations
    ]
    first = record.scenario.nominal_target
    aim = ground_point(record.scenario, first)
    data = {
        "time": _rounded(record.time[kept], 2),
        "x": _rounded(record.position[kept, 0], 1),
        "y": _rounded(record.position[kept, 1], 1),
        "z": _rounded(record.position[kept, 2], 1),
        "speed": _rounded(np.linalg.norm(record.velocity[kept], axis=1), 2),
        "mass": _rounded(record.mass[kept], 2),
        "attitude": [_rounded(part, 3) for part in engine_attitudes(record)[kept, 1:].T],
        "thrust": _rounded(magnitude[kept[:-1]], 0),
        "looks": looks,
        "decisions": _decisions(record),
        "nominal": _rounded([*aim[:2], first[2]], 1),
        "touchdown": _rounded(record.outcome.touchdown, 2),
    }
    episode = record.scenario.streams.episode
    return FlightPicture(record.policy, episode, str(record.outcome.ending), describe_outcome(record), data)


def _decisions(record: EpisodeRecord) -> list[dict[str, Any]]:
    shown = []
    for observation, decision in zip(record.observations, record.decisions, strict=True):
        command = decision.command
        flies_gains = isinstance(command, ZemZevCommand)
        gains = (command.position_gain, command.velocity_gain) if flies_gains else command.gains
        shown.append(
            {
                "time": round(observation.time, 2),
                "site": _rounded(ground_point(record.scenario, decision.site)[:2], 2),
                "gains": _rounded(gains, 3),
                "law": "ZEM/ZEV" if flies_gains else "plan",
                "status": str(decision.status),
            }
        )
    return shown


def picture_ground(study: Study, episode: int) -> dict[str, Any]:
    """Terrain around the first target of an episode (coarse), and its true safety (1 m, near the target)."""
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
    x, y = (float(value) for value in scenario.nominal_target[:2])
    height, hazard = coarse_ground(scenario.tile, x, y)
    low, high = float(height.min()), float(height.max())
    span = max(high - low, 1e-6)
    corner = (int(x) - _TRUTH_CELLS // 2, int(y) - _TRUTH_CELLS // 2)
    safe = _window(scenario.tile.deterministic, corner, _TRUTH_CELLS, False)
    return {
        "corner": [int(x) - _GROUND_CELLS * _GROUND_CELL // 2, int(y) - _GROUND_CELLS * _GROUND_CELL // 2],
        "cell": _GROUND_CELL,
        "cells": _GROUND_CELLS,
        "low": round(low, 2),
        "high": round(high, 2),
        "height": _base64(np.round(255.0 * (height - low) / span).astype(np.uint8)),
        "hazard": _base64(np.round(255.0 * hazard).astype(np.uint8)),
        "truth_corner": list(corner),
        "truth_cells": _TRUTH_CELLS,
        "truth": _base64(np.packbits(safe, bitorder="little")),
        "tile": scenario.tile.number,
    }


def picture_lander(preset: Preset) -> dict[str, Any]:
    """What the page draws of a preset's lander; plain numbers, strings and lists.

    Returns:
        `body` and `plume` (at full thrust) as surfaces in metres, `enlarged` times; `size` [m], the diameter
        that this makes; `nozzle` [m], about which the plume turns; `max_thrust` [N]; `reach` [rad] and
        `reach_deg`, the half-angle of what the sensor can see: about the lander's axis where it is `rigid`,
        else about the vertical.
    """
    size = _ENLARGED * preset.criteria.footprint_diameter
    return {
        "body": _plain(lander_surface(), size),
        "plume": _plain(plume_surface(1.0), size),
        "nozzle": _rounded(size * NOZZLE, 2),
        "enlarged": _ENLARGED,
        "size": size,
        "max_thrust": preset.lander.max_thrust,
        "reach": round(preset.lidar.off_nadir_limit, 6),
        "reach_deg": round(math.degrees(preset.lidar.off_nadir_limit), 1),
        "rigid": preset.body is not None,
    }


def _plain(surface: Surface, size: float) -> dict[str, Any]:
    points = np.round(size * surface.vertices, 2)
    return {
        "x": points[:, 0].tolist(),
        "y": points[:, 1].tolist(),
        "z": points[:, 2].tolist(),
        "triangles": surface.triangles.T.tolist(),
        "colors": list(surface.colors),
    }


def coarse_ground(tile: Tile, x: float, y: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean height [m] and share of unsafe cells on 8 m cells around (x, y), each of shape (72, 72).

    Outside the map the ground is unsafe, at the least height.
    """
    size = _GROUND_CELLS * _GROUND_CELL
    corner = (int(x) - size // 2, int(y) - size // 2)
    known = np.where(np.isfinite(tile.elevation), tile.elevation, np.nanmin(tile.elevation))
    height = _window(known, corner, size, float(known.min()))
    safe = _window(tile.deterministic, corner, size, False)
    blocks = (_GROUND_CELLS, _GROUND_CELL, _GROUND_CELLS, _GROUND_CELL)
    mean = height.reshape(blocks).mean(axis=(1, 3), dtype=np.float64)
    return mean, 1.0 - safe.reshape(blocks).mean(axis=(1, 3))


def _window(layer: NDArray[Any], corner: tuple[int, int], size: int, outside: float) -> NDArray[Any]:
    """Cells [corner, corner + size) of a layer, east and north; `outside` beyond its edges."""
    rows, columns = layer.shape
    window = np.full((size, size), outside, dtype=layer.dtype)
    south, west = max(corner[1], 0), max(corner[0], 0)
    north, east = min(corner[1] + size, rows), min(corner[0] + size, columns)
    if south < north and west < east:
        inner = (slice(south - corner[1], north - corner[1]), slice(west - corner[0], east - corner[0]))
        window[inner] = layer[south:north, west:east]
    return window


def pack_levels(values: NDArray[np.floating[Any]]) -> str:
    """Probabilities as 16 levels, two in a byte (the first in the low half), base64."""
    levels = np.round(15.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8).ravel()
    levels = np.append(levels, np.zeros(levels.size % 2, dtype=np.uint8))
    return _base64(np.bitwise_or(levels[::2], np.left_shift(levels[1::2], 4), dtype=np.uint8))


def _base64(values: NDArray[np.uint8]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def _rounded(values: ArrayLike, digits: int) -> list[float]:
    return [round(float(value), digits) for value in np.asarray(values)]
