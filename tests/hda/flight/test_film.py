"""Films of flights: the file plays the flight from start to end."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import hda
from hda.flight.episode import fly
from hda.flight.film import (
    FilmedEpisode,
    FilmOptions,
    film_flight,
    film_frames,
    frame_times,
    save_frames,
)
from hda.flight.record import EpisodeRecord


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return fly(hda.make_policy("nearest-safe"), hda.sample_scenario("paper", 0, 3))


def test_a_film_plays_the_flight_at_its_speed(record: EpisodeRecord, tmp_path: Path) -> None:
    options = FilmOptions(step=4.0, speed=8.0, width=400)
    times = frame_times(record, options)
    assert times[-1] == record.time[-1]
    assert np.diff(times)[:-1] == pytest.approx(4.0)
    path = tmp_path / "new" / "flight.gif"
    save_frames(path, list(film_frames(record, options)), options)
    with Image.open(path) as film:
        assert film.size[0] == 400
        shown = 0
        for k in range(film.n_frames):  # pyright: ignore[reportAttributeAccessIssue]
            film.seek(k)
            shown += film.info["duration"]
    assert shown == pytest.approx(500 * (len(times) - 1) + 2500)


def test_a_still_lies_within_the_flight(record: EpisodeRecord) -> None:
    end = float(record.time[-1])
    assert frame_times(record, FilmOptions(at=end)).tolist() == [end]
    assert frame_times(record, FilmOptions(at=end + 0.004)).tolist() == [end]  # as its end is written
    with pytest.raises(ValueError, match=f"at must lie within the flight, which ends after {end:.2f} s"):
        frame_times(record, FilmOptions(at=end + 0.1))


def test_the_command_films_an_agent_and_keeps_under_its_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "agent.gif"
    film_flight("td3", FilmedEpisode("hard", 3), out=out, film=FilmOptions(step=5.0, width=400))
    assert "td3 " in capsys.readouterr().out
    assert 1000 < out.stat().st_size < 1_500_000


def test_a_film_of_measured_looks_keeps_under_its_size(tmp_path: Path) -> None:
    out = tmp_path / "measured.gif"
    film_flight("nearest-safe", FilmedEpisode("lidar", 17), out=out, film=FilmOptions(step=3.0))
    with Image.open(out) as film:
        assert film.size == (800, 592)
        assert film.n_frames > 10  # pyright: ignore[reportAttributeAccessIssue]
    assert 10_000 < out.stat().st_size < 1_500_000 / 6  # the command's own step gives six times the frames


def test_a_body_is_filmed_under_its_size_and_a_still_shows_one_moment(tmp_path: Path) -> None:
    flown = FilmedEpisode("rigid-body", 17)
    film_flight("nearest-safe", flown, out=tmp_path / "body.gif", film=FilmOptions(step=5.0))
    with Image.open(tmp_path / "body.gif") as film:
        assert film.size == (800, 592)
        assert film.n_frames > 7  # pyright: ignore[reportAttributeAccessIssue]
        film.seek(1)
        second = np.asarray(film.convert("RGB")).astype(int)
    assert (tmp_path / "body.gif").stat().st_size < 1_500_000 / 4  # each frame here shows another look
    film_flight("nearest-safe", flown, out=tmp_path / "still.png", film=FilmOptions(at=5.0))
    with Image.open(tmp_path / "still.png") as still:
        assert np.array_equal(np.asarray(still.convert("RGB")).astype(int), second)


def test_what_cannot_be_filmed_is_refused_before_it_flies(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"out must end in \.gif"):
        film_flight(out=tmp_path / "flight.mp4")
    with pytest.raises(ValueError, match=r"out must end in \.png for a still"):
        film_flight(out=tmp_path / "flight.gif", film=FilmOptions(at=5.0))
    with pytest.raises(ValueError, match="at must not be negative"):
        FilmOptions(at=-1.0)
    with pytest.raises(ValueError, match="step must be positive"):
        FilmOptions(step=0.0)
    with pytest.raises(ValueError, match="speed must be positive"):
        FilmOptions(speed=-1.0)
    with pytest.raises(ValueError, match="width must lie"):
        FilmOptions(width=10)
