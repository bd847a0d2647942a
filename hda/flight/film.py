"""A flight as an animated GIF: the ground, the look of the moment, the height, frame by frame; or one frame.

On a preset with a ranging LIDAR a look is shown as measured: the heights that the lander saw, with their
holes, its verdict, and the truth beside it; and the lander close by, with its sensor's reach.

python -m hda.flight.film --policy hazard-aware --preset hard --episode 17 --out flight.gif
python -m hda.flight.film --policy hazard-aware --preset rigid-body --episode 17 --out flight.gif
python -m hda.flight.film --policy hazard-aware --preset rigid-body --episode 17 --at 10 --out moment.png
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from guidance.arrays import Array
from guidance.console import one_line_errors, tolerate_encoding
from hda.flight.episode import fly
from hda.flight.moment import WIDTH, draw_moment, find_moment
from hda.flight.outcome import ENDINGS
from hda.flight.palette import COLORS
from hda.flight.record import EpisodeRecord
from hda.task.scenario import sample_scenario

if TYPE_CHECKING:
    from PIL.Image import Image

_GREYS = 96  # of the palette that all frames share; the colours of lines, and their blends, are the rest
_BLENDS = 9
_LAST_FRAME = 2500  # [ms] that the landing stays
_ROUNDING = 0.005  # [s] of a flight's end as it is told


@dataclass(frozen=True)
class FilmOptions:
    """How a flight is filmed.

    Attributes:
        step: [s] of flight between two frames; of no account for a still.
        speed: seconds of flight that a second of the film shows; of no account for a still.
        width: [pixel] of the film; its height is in proportion.
        at: [s] a still of this moment of the flight, as a PNG, in place of the film; no later than its end.
    """

    step: float = 0.5
    speed: float = 5.0
    width: int = 800
    at: float | None = None

    def __post_init__(self) -> None:
        """Check every field.

        Raises:
            ValueError: a field is out of range.
        """
        if not self.step > 0.0:
            raise ValueError(f"step must be positive, got {self.step}")
        if not self.speed > 0.0:
            raise ValueError(f"speed must be positive, got {self.speed}")
        if not 200 <= self.width <= 3000:
            raise ValueError(f"width must lie between 200 and 3000 pixels, got {self.width}")
        if self.at is not None and not self.at >= 0.0:
            raise ValueError(f"at must not be negative, got {self.at}")

    @property
    def suffix(self) -> str:
        """Of the file."""
        return ".gif" if self.at is None else ".png"


@dataclass(frozen=True)
class FilmedEpisode:
    """Which episode is filmed.

    Attributes:
        preset: setting.
        episode: number of the episode.
        study_seed: seed of the study that the episode is from.
        split: tiles: train, tuning, validation or fresh.
    """

    preset: str = "paper"
    episode: int = 17
    study_seed: int = 0
    split: str = "validation"


def film_frames(record: EpisodeRecord, options: FilmOptions) -> Iterator[Image]:
    """Frames of the film of a flight, from start to touchdown, as RGB images; or the one of a still.

    Raises:
        ValueError: the flight ends before the still's moment.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    for time in frame_times(record, options):
        figure = draw_moment(find_moment(record, time))
        figure.set_dpi(options.width / WIDTH)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def frame_times(record: EpisodeRecord, options: FilmOptions) -> Array:
    """[s] time of flight that each frame shows; the last is the touchdown, unless it is a still's.

    Raises:
        ValueError: the flight ends before the still's moment.
    """
    end = float(record.time[-1])
    if options.at is not None:
        if options.at > end + _ROUNDING:
            raise ValueError(
                f"at must lie within the flight, which ends after {end:.2f} s, got {options.at:g}"
            )
        return np.array([min(options.at, end)])
    return np.append(np.arange(float(record.time[0]), end, options.step), end)


def save_frames(path: Path, frames: Sequence[Image], options: FilmOptions) -> None:
    """Write frames as a GIF that repeats for ever, whose last stays for a while; a still as a PNG.

    Args:
        path: of the GIF, or of a still's PNG; its folder is made.
        frames: RGB images of one size.
        options: how the flight was filmed.

    Raises:
        ValueError: `path` does not end in .gif, or for a still in .png.
    """
    from PIL.Image import Dither

    _check_name(path, options)
    palette = _make_palette()  # one for all, so that what stands still is not written again
    drawn = [frame.quantize(palette=palette, dither=Dither.NONE) for frame in frames]
    times = [max(round(1000.0 * options.step / options.speed), 20)] * (len(drawn) - 1) + [_LAST_FRAME]
    path.parent.mkdir(parents=True, exist_ok=True)
    if options.at is not None:
        drawn[0].save(path, optimize=True)
        return
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=times, loop=0)


def _make_palette() -> Image:
    """Greys, and the colours of lines as they blend into white paper and into dark ground."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    greys = np.repeat(np.linspace(0.0, 1.0, _GREYS)[:, None], 3, axis=1)
    share = np.linspace(1.0, 0.2, _BLENDS)[:, None]
    blends = [
        share * np.array(to_rgb(color)) + (1.0 - share) * ground
        for color in (COLORS[1], COLORS[4], COLORS[5])
        for ground in (1.0, 0.33, 0.0)
    ]
    entries = np.round(255.0 * np.concatenate([greys, *blends])).astype(int)
    palette = Image.new("P", (1, 1))
    palette.putpalette(entries.ravel().tolist())
    return palette


def _check_name(path: Path, options: FilmOptions) -> None:
    if path.suffix.lower() != options.suffix:
        of_a_still = "" if options.at is None else " for a still"
        raise ValueError(f"out must end in {options.suffix}{of_a_still}, got {str(path)!r}")


def film_flight(
    policy: str = "hazard-aware",
    flown: Annotated[FilmedEpisode, tyro.conf.arg(name="")] = FilmedEpisode(),
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("flight.gif"),
    film: Annotated[FilmOptions, tyro.conf.arg(name="")] = FilmOptions(),
) -> None:
    """Fly one episode and film it.

    Args:
        policy: name of a policy or an agent, or package.module:Name of your own.
        flown: which episode.
        out: GIF to write; of a still, PNG.
        film: how it is filmed.
    """
    from rich.progress import track

    from hda.registry import AGENTS, make_policy

    if policy in AGENTS:
        importlib.import_module("rl")  # as an entry point would: it registers the agents
    _check_name(out, film)
    sys.stdout.write(
        f"flying {policy} on {flown.preset}, episode {flown.episode}"
        " (the first flight on a machine compiles)\n"
    )
    sys.stdout.flush()
    scenario = sample_scenario(flown.preset, flown.study_seed, flown.episode, flown.split)
    record = fly(make_policy(policy), scenario)
    times = frame_times(record, film)
    frames = list(track(film_frames(record, film), description="drawing", total=len(times)))
    save_frames(out, frames, film)
    ended = f"{policy} {ENDINGS[record.outcome.ending]}"
    sys.stdout.write(f"{ended}; wrote {out}, {len(frames)} frames, {out.stat().st_size / 1e6:.2f} MB\n")


def main() -> None:
    """Run the command; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        tyro.cli(film_flight, prog="python -m hda.flight.film", description=__doc__)


if __name__ == "__main__":
    main()
