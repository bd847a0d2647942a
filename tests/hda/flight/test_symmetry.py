"""No place and no direction is preferred: a world that is moved, mirrored or turned gives such a flight.

The ground, the first target, the start, the sensor's noise and the error of navigation are moved together;
the engine's error is a number and stays. Trained agents have learnt no such symmetry and are left out.

First targets lie on whole metres where a belief is kept, so that its square of 1 m cells is turned into
itself. Of equally good pixels the first in the array is taken, which is no symmetric choice: a flight that
met such is not compared, and single-divert flies ground on which no two pixels read the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

import hda
from guidance import State
from hda.flight.record import EpisodeRecord
from hda.ground.tile import Tile
from hda.site_selection import NearestSafeSite
from hda.task.observation import Observation
from hda.task.random_streams import EpisodeStreams
from hda.task.scenario import Scenario

Array = NDArray[np.float64]
SIDE = 1000
ROUNDING = 1e-9  # of a flight of closed forms, in metres, metres a second and kilogrammes
SOLVER = 1e-3  # of one that a convex solver plans; its newtons are taken as thousands
CLOSED = ("no-divert", "single-divert", "nearest-safe", "oracle", "hazard-aware+zem-zev")
PLANNED = ("nearest-safe+convex", "hazard-aware", "deferred-decision", "oracle-fuel")
TOLERANCE = {**dict.fromkeys(CLOSED, ROUNDING), **dict.fromkeys(PLANNED, SOLVER)}


@dataclass(frozen=True)
class Turn:
    """A mirror or a turn of the square kilometre into itself.

    Attributes:
        grid: rows and columns of a map or look -> the turned ones.
        matrix: what it does to a vector, shape (3, 3).
    """

    grid: Callable[[NDArray], NDArray]
    matrix: tuple[tuple[float, float, float], ...]

    def vector(self, vector: Array) -> Array:
        return np.array(self.matrix) @ vector

    def place(self, place: Array) -> Array:
        middle = np.array([0.5 * SIDE, 0.5 * SIDE, 0.0])
        return self.vector(place - middle) + middle


TURNS = {
    "east-west mirror": Turn(lambda grid: grid[:, ::-1], ((-1, 0, 0), (0, 1, 0), (0, 0, 1))),
    "north-south mirror": Turn(lambda grid: grid[::-1], ((1, 0, 0), (0, -1, 0), (0, 0, 1))),
    "quarter turn": Turn(lambda grid: grid.T[:, ::-1], ((0, -1, 0), (1, 0, 0), (0, 0, 1))),
}


@dataclass(frozen=True)
class TurnedStreams(EpisodeStreams):
    """The random streams of an episode, seen in the turned world."""

    turn: Turn = TURNS["quarter turn"]

    def look(self, index: int, pixels: int) -> NDArray[np.float32]:
        return np.ascontiguousarray(self.turn.grid(super().look(index, pixels)))

    def navigation_error(self, position_error: float, velocity_error: float) -> Array:
        error = super().navigation_error(position_error, velocity_error)
        return np.concatenate([self.turn.vector(error[:3]), self.turn.vector(error[3:])])


def remade(tile: Tile, change: Callable[[NDArray], NDArray]) -> Tile:
    layers = (tile.elevation, tile.probability, tile.deterministic)
    return Tile(tile.number, *(np.ascontiguousarray(change(layer)) for layer in layers))


def turned(scenario: Scenario, turn: Turn) -> Scenario:
    state, streams = scenario.initial_state, scenario.streams
    return replace(
        scenario,
        streams=TurnedStreams(streams.study_seed, streams.episode, turn=turn),
        tile=remade(scenario.tile, turn.grid),
        initial_state=State(turn.place(state.position), turn.vector(state.velocity), state.mass),
        nominal_target=turn.place(scenario.nominal_target),
    )


def shifted(scenario: Scenario, east: int, north: int) -> Scenario:
    """The same ground in a larger map, whose other cells are as unsafe as what lies outside a map."""
    state = scenario.initial_state
    move = np.array([east, north, 0.0])
    margins = ((north, 40), (east, 70))
    return replace(
        scenario,
        tile=remade(scenario.tile, lambda layer: np.pad(layer, margins)),
        initial_state=State(state.position + move, state.velocity, state.mass),
        nominal_target=scenario.nominal_target + move,
    )


def as_drawn(preset: str, episode: int) -> Scenario:
    return hda.sample_scenario(preset, 3, episode)


def on_whole_metres(preset: str, episode: int) -> Scenario:
    drawn = as_drawn(preset, episode)
    return replace(drawn, nominal_target=np.round(drawn.nominal_target))


def on_doubtful_ground(episode: int) -> Scenario:
    """Nothing is surely safe, so that no reading is cut off at 1 and the safest pixel is one alone."""
    drawn = as_drawn("paper", episode)
    doubtful = np.float32(0.6) * drawn.tile.probability
    return replace(drawn, tile=replace(drawn.tile, probability=doubtful))


def fly(name: str, scenario: Scenario) -> EpisodeRecord:
    return hda.fly(hda.make_policy(name), scenario)


def assert_moved(
    first: EpisodeRecord,
    other: EpisodeRecord,
    place: Callable[[Array], Array],
    vector: Callable[[Array], Array],
) -> None:
    """Sites, path, thrust and end of the other flight are those of the first, moved."""
    within = TOLERANCE[first.policy]
    assert len(first.decisions) == len(other.decisions)
    for before, after in zip(first.decisions, other.decisions, strict=True):
        np.testing.assert_allclose(place(before.site), after.site, rtol=0.0, atol=within)
    assert len(first.path) == len(other.path)
    np.testing.assert_allclose([place(r) for r in first.position], other.position, rtol=0.0, atol=within)
    np.testing.assert_allclose([vector(v) for v in first.velocity], other.velocity, rtol=0.0, atol=within)
    np.testing.assert_allclose(first.mass, other.mass, rtol=0.0, atol=within)
    thrust = [vector(t) for t in first.commanded_thrust]
    np.testing.assert_allclose(thrust, other.commanded_thrust, rtol=0.0, atol=1e3 * within)
    assert first.outcome.ending is other.outcome.ending
    assert first.minimum_slant_angle == pytest.approx(other.minimum_slant_angle, abs=within)


def assert_turned(first: EpisodeRecord, turn: Turn) -> None:
    assert_moved(first, fly(first.policy, turned(first.scenario, turn)), turn.place, turn.vector)


@pytest.mark.parametrize("preset", ["paper", "partial"])
@pytest.mark.parametrize("name", [*CLOSED, *PLANNED])
def test_a_flight_over_shifted_ground_is_the_shifted_flight(name: str, preset: str) -> None:
    for episode, (east, north) in enumerate([(137, 61), (0, 250)]):
        first = fly(name, on_whole_metres(preset, episode))
        move = np.array([east, north, 0.0])
        other = fly(name, shifted(first.scenario, east, north))
        assert_moved(first, other, lambda place, move=move: place + move, lambda vector: vector)


@pytest.mark.parametrize("label", TURNS)
@pytest.mark.parametrize("preset", ["paper", "partial"])
@pytest.mark.parametrize(
    "name", ["no-divert", "oracle", "oracle-fuel", "hazard-aware+zem-zev", "hazard-aware"]
)
def test_a_flight_in_a_turned_world_is_the_turned_flight(name: str, preset: str, label: str) -> None:
    draw = on_whole_metres if name.startswith("hazard-aware") else as_drawn
    for episode in range(3):
        assert_turned(fly(name, draw(preset, episode)), TURNS[label])


@pytest.mark.slow
@pytest.mark.parametrize("label", TURNS)
def test_a_deferred_decision_in_a_turned_world_is_the_turned_one(label: str) -> None:
    for preset in ("paper", "partial"):
        for episode in range(6):
            assert_turned(fly("deferred-decision", on_whole_metres(preset, episode)), TURNS[label])


@pytest.mark.parametrize("label", TURNS)
def test_a_single_divert_in_a_turned_world_is_the_turned_one(label: str) -> None:
    diverts = 0
    for episode in range(20):
        first = fly("single-divert", on_doubtful_ground(episode))
        for observation, decision in zip(first.observations, first.decisions, strict=True):
            if not np.array_equal(decision.site, observation.target):
                diverts += 1
                assert np.sum(observation.safety_map == observation.safety_map.max()) == 1
        assert_turned(first, TURNS[label])
    assert diverts == 20


def nearest_was_ambiguous(record: EpisodeRecord) -> bool:
    """Whether NearestSafeSite had equally good pixels before it at a look.

    A site that was kept lies where four pixels meet; it is ambiguous where they disagree about keeping it.
    """
    rule, selected = NearestSafeSite(), False
    for observation in record.observations:
        if not observation.has_map:
            continue
        if selected:
            middle = observation.safety_map.shape[0] // 2
            around = observation.safety_map[middle - 1 : middle + 1, middle - 1 : middle + 1]
            kept = around >= rule.keep_threshold
            if kept.any() != kept.all():
                return True
            if kept.all():
                continue
        if candidates(observation, rule.select_threshold) != 1:
            return True
        selected = True
    return False


def candidates(observation: Observation, threshold: float) -> int:
    """How many pixels are the nearest that look safe; or the safest, where none looks safe enough."""
    reading = observation.safety_map
    safe = reading >= threshold
    if not safe.any():
        return int(np.sum(reading == reading.max()))
    square = observation.pixel_offset**2
    distance = (square[:, None] + square[None, :])[safe]
    return int(np.sum(np.isclose(distance, distance.min(), rtol=1e-9)))


@pytest.mark.parametrize("label", TURNS)
@pytest.mark.parametrize(
    "name", ["nearest-safe", pytest.param("nearest-safe+convex", marks=pytest.mark.slow)]
)
def test_the_nearest_safe_site_in_a_turned_world_is_the_turned_one(name: str, label: str) -> None:
    compared = 0
    for preset in ("paper", "partial"):
        for episode in range(30):
            first = fly(name, as_drawn(preset, episode))
            if not nearest_was_ambiguous(first):
                assert_turned(first, TURNS[label])
                compared += 1
    assert compared >= 10


def test_a_turn_moves_the_ground_with_the_places_on_it() -> None:
    """Else the tests above would compare one mistake with the same."""
    tile = hda.sample_scenario("paper", 3, 0).tile
    rng = np.random.default_rng(5)
    for turn in TURNS.values():
        other = remade(tile, turn.grid)
        for place in rng.uniform(0.0, SIDE, (200, 2)):
            x, y = place
            east, north, _ = turn.place(np.array([x, y, 50.0]))
            assert other.elevation[int(north), int(east)] == tile.elevation[int(y), int(x)]
        assert not np.array_equal(other.elevation, tile.elevation)
