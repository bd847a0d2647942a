"""The shortfall study: what was seen of the ground, its tables and its command."""

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
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.inference.artefacts import WEIGHTS_FOLDER, ArtefactError, load_artefact, save_artefact
from studies.failures.readings import read_pixels
from studies.shortfall.command import Shortfall, study_shortfall
from studies.shortfall.encoded_sight import (
    AREAS,
    DEPTHS,
    HEIGHTS,
    Loss,
    NearSight,
    SeenHazards,
    SeenIslands,
    SiteSight,
    count_hazards,
    count_islands,
    explain_loss,
    measure_depth,
    measure_near,
    sight_choice,
)
from studies.shortfall.flights import FlownEpisode, find_encoder, open_policy
from studies.shortfall.propellant_parts import Move, PropellantParts
from studies.shortfall.propellant_table import average_parts
from studies.shortfall.table import FAILED, count_losses, count_shown, share_hazards, share_islands


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


@pytest.fixture(scope="module")
def failed() -> EpisodeRecord:
    """A flight that lands on a hazard."""
    for episode in range(40):
        record = fly(make_policy("no-divert"), sample_scenario("paper", 0, episode))
        if record.outcome.ending == "unsafe-site" and not is_safe_at_the_site(record):
            return record
    raise AssertionError("no flight of forty to the first target lands on a hazard")


def is_safe_at_the_site(record: EpisodeRecord) -> bool:
    return record.scenario.tile.is_safe(record.decisions[-1].site)


@given(sights=st.lists(st.tuples(st.sampled_from([0.0, 12.0]), st.sampled_from([0.0, 5.0])), min_size=1))
def test_a_loss_is_named_by_what_looks_and_encodings_showed(
    failed: EpisodeRecord, sights: list[tuple[float, float]]
) -> None:
    near = [NearSight(read, encoded) for read, encoded in sights if read or not encoded]
    loss = explain_loss(failed, near)
    assert (loss is Loss.NONE_READ) == all(sight.read == 0.0 for sight in near)
    assert (loss is Loss.PASSED) == any(sight.encoded > 0.0 for sight in near)
    assert loss in (Loss.NONE_READ, Loss.PASSED, Loss.LOST)


def test_a_flight_that_did_not_fail_on_its_site_is_none_of_these(
    planned: EpisodeRecord, failed: EpisodeRecord
) -> None:
    hard = replace(planned, outcome=replace(planned.outcome, success=False))
    assert explain_loss(planned, []) is Loss.NONE
    assert explain_loss(hard, []) is Loss.NOT_THE_GROUND
    crashed = replace(failed, outcome=replace(failed.outcome, ending=Ending.CRASH, safe_site=False))
    assert explain_loss(crashed, []) is Loss.NOT_THE_GROUND
    beside = replace(failed, decisions=planned.decisions, scenario=planned.scenario)
    assert is_safe_at_the_site(beside)
    assert explain_loss(beside, []) is Loss.BESIDE


def test_islands_are_counted_by_their_area_and_what_is_kept_of_them(planned: EpisodeRecord) -> None:
    """Islands drawn into the first look: 2 x 2 pixels that touch a third, one far away, one at the edge."""
    first = planned.observations[0]
    drawn = np.zeros_like(first.safety_map)
    middle = drawn.shape[0] // 2
    drawn[middle : middle + 2, middle : middle + 2] = 1.0
    drawn[middle + 2, middle + 2] = 0.9
    drawn[middle, middle + 6] = 0.8
    rows, columns = np.nonzero(read_pixels(planned, 0)[2])
    drawn[rows[0], columns[0]] = 1.0
    seen = replace(planned, observations=(replace(first, safety_map=drawn),))
    kept = np.zeros_like(drawn)
    kept[middle + 2, middle + 2] = 0.5
    counts = {one.area: one for one in count_islands(seen, kept[None])}
    pixel = first.pixel_size**2
    large, small = (int(np.searchsorted(AREAS, pixels * pixel)) for pixels in (5, 1))
    assert large != small
    assert counts[large] == SeenIslands(len(HEIGHTS), large, 1, 1)
    assert counts[small] == SeenIslands(len(HEIGHTS), small, 1, 0)
    (near,) = measure_near(seen, kept[None])
    assert (near.read, near.encoded) == pytest.approx((6.0 * pixel, pixel))
    inside = replace(first, safety_map=np.ones_like(drawn))
    assert count_islands(replace(planned, observations=(inside,)), drawn[None]) == []
    every = count_islands(planned, maps_of(planned))
    assert all(0 < one.islands == one.shown for one in every)


def test_an_encoding_that_keeps_everything_shows_what_the_look_reads(planned: EpisodeRecord) -> None:
    scenario, maps = planned.scenario, maps_of(planned)
    depth = measure_depth(scenario.tile.deterministic, scenario.view.nominal_target)
    counts = count_hazards(planned, maps, depth)
    assert counts
    assert all(0 <= seen.read == seen.encoded <= seen.pixels for seen in counts)
    assert sum(seen.pixels for seen in counts) <= len(maps) * 34**2
    blind = count_hazards(planned, np.ones_like(maps), depth)
    assert [replace(seen, encoded=0) for seen in counts] == blind
    deep = [seen for seen in counts if seen.depth == len(DEPTHS)]
    assert sum(seen.read for seen in deep) >= 0.99 * sum(seen.pixels for seen in deep)
    assert max(seen.height for seen in counts) == len(HEIGHTS)


def test_a_site_is_looked_up_in_the_look_on_which_it_was_chosen(planned: EpisodeRecord) -> None:
    """A site that is left and taken again is chosen again; one within a metre is the same."""
    maps, last = maps_of(planned), planned.decisions[-1]
    for looks in (1, 3):
        others = (planned.decisions[0],) * looks
        apart = replace(planned, decisions=(last, *others, *(last,) * (len(maps) - looks - 1)))
        assert sight_of(planned, looks + 1) == sight_choice(apart, 0.5 * maps)
    near = replace(planned.decisions[0], site=last.site + np.array([0.6, -0.6, 0.0]))
    moved = replace(planned, decisions=(near, *(last,) * (len(maps) - 1)))
    assert sight_choice(moved, 0.5 * maps) == sight_of(planned, 0)
    away = replace(last, site=last.site + np.array([900.0, 0.0, 0.0]))
    assert sight_choice(replace(planned, decisions=(away,) * len(maps)), maps) is None


def sight_of(record: EpisodeRecord, look: int) -> SiteSight:
    """What a look says of the last site, half of it encoded."""
    pixel = record.observations[look].pixel(record.decisions[-1].site)
    assert pixel is not None
    read = float(record.observations[look].safety_map[pixel])
    return SiteSight(read, 0.5 * read)


def flight(loss: Loss, tile: int, whole: float = 60.0) -> FlownEpisode:
    moves = (Move(900.0, 40.0, 1.0), Move(300.0, 0.5, 0.25))
    parts = PropellantParts(whole, whole - 1.75, moves, 0.5, 40.0, 28.0)
    chosen = (SiteSight(0.9, 0.2),) if tile == 2 else ()
    near = (NearSight(20.0, 1.0), NearSight(9.0, 7.0))
    hazards, islands = (SeenHazards(4, 1, 10, 9, 6),), (SeenIslands(4, 0, 3, 1), SeenIslands(3, 2, 1, 1))
    return FlownEpisode(tile, loss, 3.0, chosen, near, hazards, islands, parts)


def test_tables_count_average_and_compare() -> None:
    flown = [flight(Loss.NONE, 1), flight(Loss.PASSED, 1), flight(Loss.PASSED, 2), flight(Loss.LOST, 2)]
    rows = count_losses("one", flown)
    assert [(row.seen, row.flights, row.tiles, row.episodes) for row in rows] == [
        (Loss.NONE.value, 1, 1, 4),
        (Loss.LOST.value, 1, 1, 4),
        (Loss.PASSED.value, 2, 2, 4),
        (FAILED, 3, 2, 4),
    ]
    assert {(row.depth, row.read, row.encoded) for row in rows} == {(3.0, 20.0, 7.0)}
    assert [(row.chosen, row.refused, row.warned) for row in rows] == [(k, 0, k) for k in (0, 1, 1, 2)]
    far = [replace(one, depth=depth) for one, depth in zip(flown, (0, math.inf, math.nan, 8.0), strict=True)]
    assert [row.depth for row in count_losses("one", far)] == pytest.approx([0, 8, math.nan, 8], nan_ok=True)
    (seen,) = share_hazards("one", flown)
    assert seen.policy == "one"
    assert (seen.height, seen.depth, seen.pixels) == (4, 1, 40)
    assert (seen.read.estimate, seen.encoded.estimate) == pytest.approx((0.9, 0.6))
    many = [
        replace(one, near=(NearSight(9.0, area), NearSight(9.0, 999.0)))
        for one, area in zip(flown, (0, 0, 50, 500), strict=True)
    ]
    assert [(row.shown, row.flights, row.failed) for row in count_shown("one", many)] == [
        (0, 2, 1),  # what the second look's encoding shows comes too late
        (1, 1, 1),
        (3, 1, 1),
    ]
    shares = [(row.height, row.area, row.islands, row.shown.estimate) for row in share_islands("one", flown)]
    assert shares == [(4, 0, 12, pytest.approx(1.0 / 3.0)), (3, 2, 4, 1.0)]
    cheap = [flight(Loss.NONE, each.tile, 58.5) for each in flown]
    row = average_parts("one", flown)
    assert (row.whole.estimate, row.direct.estimate, row.guidance.estimate) == (60.0, 58.25, 0.5)
    assert (row.first.estimate, row.early.estimate, row.late.estimate) == (1.0, 1.0, 0.25)
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
    for pair in (("td3", "td3"), ("runs/a/td3.json", "runs/b/td3.json"), ("runs/td3.json", "td3")):
        with pytest.raises(ValueError, match=f"different names, got '{pair[0]}' and '{pair[1]}'"):
            Shortfall(policies=pair)


def test_the_encoder_is_the_one_that_the_agents_see_through(tmp_path: Path) -> None:
    names = ("td3", "nearest-safe+convex", "td3+convex", "td3-lstm")
    policies = {name: open_policy(name) for name in (*names, "td3-lidar")}
    assert find_encoder([policies[name] for name in names]).name == "autoencoder"
    assert find_encoder([policies["td3-lidar"]]).name == "autoencoder-lidar"
    with pytest.raises(ValueError, match="autoencoder of td3, autoencoder-lidar of td3-lidar"):
        find_encoder([policies["td3"], policies["td3-lidar"]])
    with pytest.raises(ValueError, match=r"policies must name an agent.* got none"):
        find_encoder([policies["nearest-safe+convex"]])
    agent = load_artefact(WEIGHTS_FOLDER / "td3", "actor")
    card = {**agent.card, "sight": "belief"}
    save_artefact(tmp_path / "seer", "actor", agent.tensors, card)
    with pytest.raises(ValueError, match="policies must see looks, and seer sees beliefs"):
        find_encoder([open_policy(str(tmp_path / "seer.json"))])


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
    with (tmp_path / "short" / "islands.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["islands"]) for row in rows] == [row.islands for row in first.islands]
    assert all(0.0 <= float(row["shown_percent"]) <= 100.0 for row in rows)
    assert (tmp_path / "short" / "provenance.json").exists()
