"""The shortfall study: what was seen of the ground, and parts that add up to the propellant."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.inference.artefacts import WEIGHTS_FOLDER, ArtefactError
from studies.shortfall.command import Shortfall, open_policy, study_shortfall
from studies.shortfall.encoded_sight import (
    DEPTHS,
    HEIGHTS,
    Loss,
    SeenHazards,
    SiteSight,
    count_seen,
    explain_loss,
    measure_depth,
    name_loss,
    trace_site,
)
from studies.shortfall.propellant_parts import ForeseenSite, Move, PropellantParts, part_propellant
from studies.shortfall.table import FlownEpisode, average_parts, count_losses, share_seen


@pytest.fixture(scope="module")
def planned() -> EpisodeRecord:
    """A flight that moves its site after the first look."""
    for episode in range(40):
        record = fly(make_policy("nearest-safe+convex"), sample_scenario("paper", 0, episode))
        if not np.array_equal(record.decisions[0].site, record.decisions[-1].site):
            return record
    raise AssertionError("no flight of forty moves its site twice")


def maps_of(record: EpisodeRecord) -> NDArray[np.float32]:
    return np.stack([observation.safety_map for observation in record.observations])


def test_depth_is_the_distance_to_safe_ground_and_unknown_outside() -> None:
    safe = np.zeros((1000, 1000), dtype=np.bool_)
    safe[500, 420] = True
    depth = measure_depth(safe, np.array([430.0, 480.0, 50.0]))
    rows, columns = np.array([500, 500, 497, 0]), np.array([420, 410, 424, 0])
    found = depth.read(rows, columns)
    assert found[:3].tolist() == [0.0, 10.0, 5.0]
    assert math.isnan(found[3])
    assert math.isinf(measure_depth(~safe & safe, np.array([430.0, 480.0, 50.0])).read(rows, columns)[0])


@given(
    sights=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), max_size=7),
    last=st.booleans(),
)
def test_a_loss_is_named_by_the_first_look_whose_encoding_shows_it(
    sights: list[tuple[float, float]], last: bool
) -> None:
    seen = [SiteSight(5.0 * k, *pair) for k, pair in enumerate(sights)]
    last_look = 5.0 * (len(sights) - 1) if last else 5.0 * len(sights)
    loss = name_loss(seen, last_look)
    hazard = [read < 0.5 for read, _ in sights]
    shown = [encoded < 0.5 for _, encoded in sights]
    assert (loss is Loss.NEVER_READ) == (not any(hazard))
    if any(hazard):
        assert (loss is Loss.LOST) == (not any(shown))
        assert (loss is Loss.LATE) == (last and any(shown) and not any(shown[:-1]))
        assert (loss is Loss.KEPT) == (any(shown) and loss is not Loss.LATE)


def test_an_encoding_that_keeps_everything_shows_what_the_look_reads(planned: EpisodeRecord) -> None:
    scenario, maps = planned.scenario, maps_of(planned)
    depth = measure_depth(scenario.tile.deterministic, scenario.view.nominal_target)
    counts = count_seen(planned, maps, depth)
    assert counts
    assert all(0 <= seen.read == seen.encoded <= seen.pixels for seen in counts)
    assert sum(seen.pixels for seen in counts) <= len(maps) * 34**2
    blind = count_seen(planned, np.ones_like(maps), depth)
    assert [replace(seen, encoded=0) for seen in counts] == blind
    deep = [seen for seen in counts if seen.depth == len(DEPTHS)]
    assert sum(seen.read for seen in deep) >= 0.99 * sum(seen.pixels for seen in deep)
    assert max(seen.height for seen in counts) == len(HEIGHTS)


def test_a_site_is_traced_through_the_looks_that_read_it(planned: EpisodeRecord) -> None:
    maps = maps_of(planned)
    sights = trace_site(planned, 0.5 * maps)
    assert 2 <= len(sights) <= len(planned.observations)
    assert [sight.encoded for sight in sights] == [0.5 * sight.read for sight in sights]
    assert sights[-1].read > 0.95
    assert explain_loss(planned, sights) is Loss.NONE


def test_a_site_is_foreseen_from_its_look_on_and_beyond_the_flight(planned: EpisodeRecord) -> None:
    sites = tuple(decision.site for decision in planned.decisions)
    for known in (0, 2, len(sites) + 3):
        selection = ForeseenSite(sites, known)
        for k in range(len(sites) + 2):
            site, memory = selection.select(replace(planned.observations[0], index=k), None)
            assert memory is None
            assert site is (sites[k] if k < min(known, len(sites)) else sites[-1])


def test_the_parts_add_up_and_the_flight_that_foresees_nothing_is_the_flight(planned: EpisodeRecord) -> None:
    parts = part_propellant(planned)
    spent = parts.direct + sum(move.cost for move in parts.moves) + parts.guidance
    assert spent == pytest.approx(parts.whole, abs=1e-9)
    assert parts.whole == 100.0 * planned.outcome.propellant_fraction
    assert [move.cost for move in parts.moves][-1] == 0.0
    assert any(move.cost != 0.0 for move in parts.moves)
    adjusted = fly(make_policy("td3+convex"), planned.scenario)
    assert part_propellant(adjusted).guidance == pytest.approx(0.0, abs=1e-9)


def flight(loss: Loss, tile: int, whole: float = 60.0) -> FlownEpisode:
    moves = (Move(900.0, 40.0, 1.0), Move(300.0, 0.5, 0.25))
    parts = PropellantParts(whole, whole - 1.75, moves, 0.5, 40.0, 28.0)
    sights = (SiteSight(5.0, 0.9, 0.9), SiteSight(10.0, 0.1, 0.2))
    return FlownEpisode(tile, loss, 3.0, sights, 28.0, (SeenHazards(4, 1, 10, 9, 6),), parts)


def test_tables_count_average_and_compare() -> None:
    flown = [flight(Loss.NONE, 1), flight(Loss.KEPT, 1), flight(Loss.KEPT, 2), flight(Loss.LOST, 2)]
    rows = count_losses("one", flown)
    assert [(row.loss, row.failed, row.tiles, row.episodes) for row in rows] == [
        (Loss.LOST, 1, 1, 4),
        (Loss.KEPT, 2, 2, 4),
    ]
    assert {(row.depth, row.warned) for row in rows} == {(3.0, 18.0)}
    (seen,) = share_seen(flown)
    assert (seen.height, seen.depth, seen.pixels) == (4, 1, 40)
    assert (seen.read.estimate, seen.encoded.estimate) == pytest.approx((0.9, 0.6))
    cheap = [flight(Loss.NONE, each.tile, 58.5) for each in flown]
    row = average_parts("one", flown)
    assert [part.estimate for part in (row.whole, row.direct, row.early, row.late, row.guidance)] == [
        60.0,
        58.25,
        1.0,
        0.25,
        0.5,
    ]
    assert (row.moves, row.moved, row.offset, row.time) == (1.0, 40.0, 40.0, 28.0)
    less = average_parts("one less two", flown, cheap)
    assert (less.whole.estimate, less.direct.estimate, less.early.estimate) == (1.5, 1.5, 0.0)


def test_a_card_is_a_policy_and_what_is_neither_is_named(tmp_path: Path) -> None:
    weights = WEIGHTS_FOLDER / "td3-lstm.json"
    scenario = sample_scenario("paper", 0, 3)
    named, opened = (fly(open_policy(name), scenario) for name in ("td3-lstm", str(weights)))
    assert np.array_equal(named.path, opened.path)
    with pytest.raises(ArtefactError, match="cannot read the weight card"):
        open_policy(str(tmp_path / "none.json"))
    with pytest.raises(ValueError, match="unknown policy"):
        open_policy("td33")
    with pytest.raises(ValueError, match="policies must name at least one"):
        Shortfall(policies=())
    with pytest.raises(ValueError, match="policies must be different ones"):
        Shortfall(policies=("td3", "td3"))


@pytest.mark.slow
def test_the_study_leaves_its_tables_and_goes_on(tmp_path: Path) -> None:
    options = Shortfall(
        policies=("td3", "nearest-safe+convex"), episodes=3, out=tmp_path / "short", workers=1
    )
    first = study_shortfall(options)
    again = study_shortfall(replace(options, resume=True))
    assert again == first
    assert [row.policy for row in first.parts] == [
        "td3",
        "nearest-safe+convex",
        "td3 less nearest-safe+convex",
    ]
    assert first.parts[0].guidance.estimate > 5.0  # ZEM/ZEV burns a tenth more than plans do
    with (tmp_path / "short" / "seen.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(first.seen)
    assert all(float(row["read_percent"]) >= 0.0 for row in rows)
    assert (tmp_path / "short" / "provenance.json").exists()
