"""Pictures of flights, by what they draw."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, StepPatch

import hda
from hda.flight.episode import fly
from hda.flight.outcome import ENDINGS, Ending
from hda.flight.palette import COLORS, line_style, marker_style
from hda.flight.picture import draw_flight, draw_ground_track, draw_thrust, draw_velocity, save_flight
from hda.flight.record import EpisodeRecord


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return fly(hda.make_policy("nearest-safe"), hda.sample_scenario("paper", 0, 3))


def test_the_ground_track_shows_the_flight_its_targets_and_every_field_of_view(record: EpisodeRecord) -> None:
    axis = Figure().subplots()
    draw_ground_track(axis, record)
    lines = {line.get_label(): np.column_stack(line.get_data()) for line in axis.lines}
    assert np.array_equal(lines["flight"], record.position[:, :2])
    assert np.array_equal(lines["targets"][0], record.scenario.nominal_target[:2])
    assert np.array_equal(lines["targets"][1:], [decision.site[:2] for decision in record.decisions])
    assert np.array_equal(lines["touchdown"][0], record.outcome.touchdown[:2])
    squares = [patch for patch in axis.patches if isinstance(patch, Rectangle)]
    assert len(squares) == len(record.observations)
    for square, observation in zip(squares, record.observations, strict=True):
        assert square.get_width() == square.get_height() == observation.width
        assert square.get_center() == pytest.approx(observation.target[:2])
    (west, east), (south, north) = axis.get_xlim(), axis.get_ylim()
    assert east - west == pytest.approx(north - south)
    assert west <= record.position[:, 0].min()
    assert record.position[:, 0].max() <= east
    assert south <= record.position[:, 1].min()
    assert record.position[:, 1].max() <= north


def test_what_a_lander_takes_for_a_place_is_drawn_where_it_really_lies() -> None:
    """`partial` errs about its position by half a metre."""
    flown = fly(hda.make_policy("nearest-safe"), hda.sample_scenario("partial", 0, 3))
    error = flown.scenario.navigation_error[:2]
    assert np.abs(error).max() > 0.01
    axis = Figure().subplots()
    draw_ground_track(axis, flown)
    squares = [patch for patch in axis.patches if isinstance(patch, Rectangle)]
    for square, observation in zip(squares, flown.observations, strict=True):
        assert square.get_center() == pytest.approx(observation.target[:2] - error)
    lines = {line.get_label(): np.column_stack(line.get_data()) for line in axis.lines}
    sites = np.array([decision.site[:2] for decision in flown.decisions])
    np.testing.assert_allclose(lines["targets"][1:], sites - error)
    last = np.hypot(*(lines["targets"][-1] - lines["touchdown"][0]))
    assert last == pytest.approx(flown.outcome.miss_distance)


def test_the_true_map_lies_as_the_ground_does(record: EpisodeRecord) -> None:
    axis = Figure().subplots()
    draw_ground_track(axis, record)
    (image,) = axis.images
    rows, columns = record.scenario.tile.deterministic.shape
    assert image.origin == "lower"
    assert image.get_extent() == [0, columns, 0, rows]
    assert np.array_equal(np.asarray(image.get_array()), record.scenario.tile.deterministic)


def test_velocity_and_thrust_are_those_of_the_record(record: EpisodeRecord) -> None:
    speed, thrust = Figure().subplots(2)
    draw_velocity(speed, record)
    draw_thrust(thrust, record)
    for line, component in zip(speed.lines, record.velocity.T, strict=True):
        assert np.array_equal(line.get_xdata(), record.time)
        assert np.array_equal(line.get_ydata(), component)
    (steps,) = thrust.patches
    assert isinstance(steps, StepPatch)
    values, edges, _ = steps.get_data()
    assert np.array_equal(edges, record.time)
    assert np.array_equal(values, np.linalg.norm(record.thrust, axis=1))


def test_a_flight_has_four_panels_and_a_title_that_says_how_it_ended(record: EpisodeRecord) -> None:
    figure = draw_flight(record)
    ground, altitude, speed, thrust = figure.axes
    assert ground.get_xlabel() == "east [m]"
    assert np.array_equal(altitude.lines[0].get_ydata(), record.position[:, 2])
    assert (speed.get_ylabel(), thrust.get_ylabel()) == ("velocity [m/s]", "thrust [N]")
    title = figure.get_suptitle()
    assert title.startswith(f"nearest-safe, episode 3: {record.outcome.ending}, ")
    assert f"{record.outcome.touchdown_speed:.2f} m/s" in title


def test_a_saved_flight_is_read_without_pickle(record: EpisodeRecord, tmp_path: Path) -> None:
    save_flight(tmp_path / "flight.npz", record)
    with np.load(tmp_path / "flight.npz", allow_pickle=False) as kept:
        assert set(kept) == {"time", "path", "thrust", "sites"}
        assert np.array_equal(kept["path"], record.path)
        assert np.array_equal(kept["thrust"], record.thrust)
        assert kept["sites"].shape == (len(record.decisions), 3)


def test_twenty_four_policies_have_a_style_of_their_own() -> None:
    count = 3 * len(COLORS)
    assert len({tuple(line_style(k).items()) for k in range(count)}) == count
    assert len({tuple(marker_style(k).items()) for k in range(count)}) == count
    assert line_style(count) == line_style(0)


def test_every_ending_has_its_words() -> None:
    assert set(ENDINGS) == set(Ending)
    assert len(set(ENDINGS.values())) == len(ENDINGS)
