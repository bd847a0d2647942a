"""A moment shows the flight as it stood."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import hda
from hda.flight.episode import fly
from hda.flight.moment import draw_moment, find_moment
from hda.flight.outcome import ENDINGS
from hda.flight.record import EpisodeRecord
from tests.drawing import line_data


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return fly(hda.make_policy("nearest-safe"), hda.sample_scenario("paper", 0, 3))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.77, 1.0])
def test_a_moment_is_the_flight_as_it_stood(record: EpisodeRecord, share: float) -> None:
    time = share * float(record.time[-1])
    moment = find_moment(record, time)
    assert moment.time == time
    now = [np.interp(time, record.time, column) for column in record.path.T]
    assert moment.path[-1] == pytest.approx(np.array(now))
    before = record.time < time
    assert np.array_equal(moment.path[:-1], record.path[before])
    seen = [k for k, look in enumerate(record.observations[: len(record.decisions)]) if look.time <= time]
    assert moment.look == max(seen)


def test_the_thrust_is_what_is_held_and_none_after_the_touchdown(record: EpisodeRecord) -> None:
    middles = (record.time[1:] + record.time[:-1]) / 2.0
    held = [find_moment(record, time).thrust for time in middles]
    assert held == pytest.approx(np.linalg.norm(record.thrust, axis=1).tolist())
    assert find_moment(record, 1e9).thrust == 0.0
    assert find_moment(record, -1.0).time == record.time[0]


def test_a_picture_shows_ground_look_and_height(record: EpisodeRecord) -> None:
    moment = find_moment(record, 12.25)
    figure = draw_moment(moment)
    ground, view, height = figure.axes
    assert np.array_equal(np.column_stack(line_data(ground, "flight")), moment.path[:, :2])
    observation = record.observations[moment.look]
    (image,) = view.images
    assert np.array_equal(np.asarray(image.get_array()), observation.safety_map)
    west, east, south, north = image.get_extent()
    assert (west + east) / 2.0 == pytest.approx(observation.target[0])
    assert (south + north) / 2.0 == pytest.approx(observation.target[1])
    assert east - west == pytest.approx(observation.width)
    site = record.decisions[moment.look].site
    assert np.ravel(line_data(view, "target")) == pytest.approx(site[:2])
    distance, above = line_data(height, "flight")
    end = record.outcome.touchdown
    assert above == pytest.approx(moment.path[:, 2] - end[2])
    assert distance[-1] == pytest.approx(np.hypot(*(moment.path[-1, :2] - end[:2])))
    assert figure.get_suptitle().startswith("nearest-safe   12.2 s")


def test_the_last_picture_says_how_it_ended(record: EpisodeRecord) -> None:
    words = ENDINGS[record.outcome.ending]
    assert draw_moment(find_moment(record, np.inf)).get_suptitle().endswith(words)
    assert words not in draw_moment(find_moment(record, 3.0)).get_suptitle()


def test_the_lander_is_drawn_where_it_is_over_the_ground_and_beside_its_height(record: EpisodeRecord) -> None:
    moment = find_moment(record, 12.25)
    ground, _, height = draw_moment(moment).axes
    distance, above = line_data(height, "flight")
    for axis, place in ((ground, moment.path[-1, :2]), (height, (distance[-1], above[-1]))):
        (lander,) = [each for each in axis.collections if isinstance(each, PolyCollection)]
        np.testing.assert_allclose(np.asarray(lander.get_offsets()), [place])
    east, north = line_data(ground, "sensor's reach")
    off = np.hypot(east - moment.path[-1, 0], north - moment.path[-1, 1])
    high = moment.path[-1, 2] - record.scenario.nominal_target[2]
    np.testing.assert_allclose(off, high * np.tan(record.scenario.preset.lidar.off_nadir_limit))


def test_a_measured_look_is_shown_beside_the_truth() -> None:
    flown = fly(hda.make_policy("nearest-safe"), hda.sample_scenario("lidar-coarse", 0, 3))
    for time in (1.0, 12.25):
        moment = find_moment(flown, time)
        axes = {axis.get_label(): axis for axis in draw_moment(moment).axes}
        assert set(axes) == {"ground", "lander", "height", "seen", "verdict", "truth"}
        observation, tile = flown.observations[moment.look], flown.scenario.tile
        shown = {name: axes[name].images[0] for name in ("seen", "verdict", "truth")}
        drawn = {name: np.ma.asarray(image.get_array()) for name, image in shown.items()}
        assert observation.elevation is not None
        np.testing.assert_array_equal(np.ma.getmaskarray(drawn["seen"]), np.isnan(observation.elevation))
        np.testing.assert_array_equal(drawn["verdict"], observation.safety_map)
        np.testing.assert_array_equal(drawn["truth"], tile.deterministic)
        site = flown.decisions[moment.look].site
        for name in shown:
            assert np.ravel(line_data(axes[name], "target")) == pytest.approx(site[:2])
            middle = np.mean(axes[name].get_xlim()), np.mean(axes[name].get_ylim())
            assert middle == pytest.approx(tuple(observation.target[:2]))
        assert np.array_equal(np.column_stack(line_data(axes["ground"], "flight")), moment.path[:, :2])
