"""A flight as an animated GIF: the ground, the look of the moment, the height, frame by frame.

python -m hda.flight.film --policy hazard-aware --preset hard --episode 17 --out flight.gif
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
from guidance.console import tolerate_encoding
from hda.flight.episode import fly
from hda.flight.outcome import ENDINGS
from hda.flight.palette import COLORS
from hda.flight.picture import draw_field_of_view, draw_true_safety, shown_ground
from hda.flight.record import EpisodeRecord
from hda.task.scenario import sample_scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL.Image import Image

_INCHES = (10.0, 3.9)
_COLORS = 64  # of the palette that all frames share: few, so that the file stays small
_LAST_FRAME = 2500  # [ms] that the landing stays
_FLAME = 0.012  # [m/N] of the line that stands for the thrust


@dataclass(frozen=True)
class FilmOptions:
    """How a flight is filmed.

    Attributes:
        step: [s] of flight between two frames.
        speed: seconds of flight that a second of the film shows.
        width: [pixel] of the film; its height is in proportion.
    """

    step: float = 0.5
    speed: float = 5.0
    width: int = 800

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


@dataclass(frozen=True, eq=False)
class Moment:
    """A flight as it stands at one time.

    Attributes:
        record: the flight.
        time: [s] since the start.
        path: shape (n, 7), position [m], velocity [m/s] and mass [kg] up to now; the last row is now.
        look: number of the look that guides the flight now.
        thrust: [N] size of the thrust that is applied now; 0 once the flight is over.
    """

    record: EpisodeRecord
    time: float
    path: Array
    look: int
    thrust: float


def find_moment(record: EpisodeRecord, time: float) -> Moment:
    """Find what a flight is like at one time.

    Args:
        record: the flight.
        time: [s] since the start; a time outside the flight counts as its start or its end.
    """
    time = float(np.clip(time, record.time[0], record.time[-1]))
    flown = np.append(record.time[record.time < time], time)
    path = np.column_stack([np.interp(flown, record.time, column) for column in record.path.T])
    looks = [observation.time for observation in record.observations[: len(record.decisions)]]
    interval = int(np.searchsorted(record.time, time, side="right")) - 1
    over = interval >= len(record.thrust)
    thrust = 0.0 if over else float(np.linalg.norm(record.thrust[interval]))
    return Moment(record, time, path, int(np.searchsorted(looks, time, side="right")) - 1, thrust)


def draw_moment(moment: Moment) -> Figure:
    """Draw a moment: the ground with the flight so far, the look that guides it, its height.

    Returns:
        The figure, not tied to any window.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=_INCHES, layout="constrained")
    ground, view, height = figure.subplots(1, 3)
    _draw_ground(ground, moment)
    _draw_look(view, moment)
    _draw_height(height, moment)
    figure.suptitle(_describe(moment), x=0.01, ha="left", family="monospace", fontsize="medium")
    return figure


def film_frames(record: EpisodeRecord, options: FilmOptions) -> Iterator[Image]:
    """Frames of the film of a flight, from its start to its touchdown, as RGB images."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    for time in frame_times(record, options):
        figure = draw_moment(find_moment(record, time))
        figure.set_dpi(options.width / _INCHES[0])
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def frame_times(record: EpisodeRecord, options: FilmOptions) -> Array:
    """[s] time of flight that each frame shows; the last is the touchdown."""
    end = float(record.time[-1])
    return np.append(np.arange(float(record.time[0]), end, options.step), end)


def save_frames(path: Path, frames: Sequence[Image], options: FilmOptions) -> None:
    """Write frames as a GIF that repeats for ever; the last stays for a while.

    Args:
        path: of the GIF; its folder is made.
        frames: RGB images of one size.
        options: how the flight was filmed.

    Raises:
        ValueError: `path` does not end in .gif.
    """
    from PIL.Image import Dither, Quantize

    _check_name(path)
    # one palette for all, so that what stands still is not written again
    palette = frames[len(frames) // 2].quantize(_COLORS, method=Quantize.MEDIANCUT)
    drawn = [frame.quantize(palette=palette, dither=Dither.NONE) for frame in frames]
    times = [max(round(1000.0 * options.step / options.speed), 20)] * (len(drawn) - 1) + [_LAST_FRAME]
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=times, loop=0)


def _check_name(path: Path) -> None:
    if path.suffix.lower() != ".gif":
        raise ValueError(f"out must end in .gif, got {str(path)!r}")


def _draw_ground(axis: Axes, moment: Moment) -> None:
    record, path = moment.record, moment.path
    draw_true_safety(axis, record.scenario.tile)
    draw_field_of_view(axis, record.observations[moment.look])
    site = record.decisions[moment.look].site
    axis.plot(path[:, 0], path[:, 1], color=COLORS[1], label="flight")
    axis.plot(*site[:2], "o", color=COLORS[0], markersize=5, label="target")
    axis.plot(path[-1, 0], path[-1, 1], "^", color=COLORS[1], markersize=7, label="lander")
    west, east, south, north = shown_ground(record)
    axis.set_xlim(west, east)
    axis.set_ylim(south, north)
    axis.set_title("true ground, light: safe", fontsize="medium")
    axis.legend(loc="upper left", fontsize="x-small", framealpha=0.9)


def _draw_look(axis: Axes, moment: Moment) -> None:
    observation = moment.record.observations[moment.look]
    half = observation.width / 2.0
    east, north = (float(value) for value in observation.target[:2])
    extent = (east - half, east + half, north - half, north + half)
    axis.imshow(observation.safety_map, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.0)
    site = moment.record.decisions[moment.look].site
    axis.plot(
        *site[:2], "o", color=COLORS[0], markersize=8, fillstyle="none", markeredgewidth=2, label="target"
    )
    axis.set_xlim(extent[:2])
    axis.set_ylim(extent[2:])
    axis.set_xticks([])
    axis.set_yticks([])
    axis.set_xlabel(f"{observation.width:.0f} m wide, taken at {observation.time:.0f} s")
    axis.set_title(f"look {observation.index + 1}, light: looks safe", fontsize="medium")


def _draw_height(axis: Axes, moment: Moment) -> None:
    record, path = moment.record, moment.path
    end = record.outcome.touchdown
    distance, height = np.linalg.norm(path[:, :2] - end[:2], axis=1), path[:, 2] - end[2]
    axis.plot(distance, height, color=COLORS[1], label="flight")
    flame = [height[-1], height[-1] - _FLAME * moment.thrust]
    axis.plot([distance[-1]] * 2, flame, color=COLORS[4], linewidth=4, label="thrust")
    axis.plot(distance[-1], height[-1], "^", color=COLORS[1], markersize=7, label="lander")
    farthest = float(np.linalg.norm(record.position[:, :2] - end[:2], axis=1).max())
    axis.set_xlim(-0.1 * farthest - 1.0, 1.1 * farthest + 1.0)
    axis.set_ylim(0.0, 1.05 * float((record.position[:, 2] - end[2]).max()))
    axis.set_xlabel("distance to the touchdown [m]")
    axis.set_ylabel("height [m]")
    axis.set_title("height; bar: thrust", fontsize="medium")
    axis.grid(alpha=0.25)


def _describe(moment: Moment) -> str:
    record, now = moment.record, moment.path[-1]
    full = record.path[0, 6] - record.scenario.preset.lander.dry_mass
    burnt = 100.0 * (record.path[0, 6] - now[6]) / full
    first = f"{record.policy}   {moment.time:4.1f} s   {float(np.linalg.norm(now[3:6])):4.1f} m/s"
    second = f"{moment.thrust:5.0f} N   {burnt:4.1f} % of the propellant"
    ended = f"   {ENDINGS[record.outcome.ending]}" if moment.time >= record.time[-1] else ""
    return f"{first}   {second}{ended}"


def film_flight(
    policy: str = "hazard-aware",
    preset: str = "paper",
    episode: int = 17,
    study_seed: int = 0,
    split: str = "validation",
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("flight.gif"),
    film: Annotated[FilmOptions, tyro.conf.arg(name="")] = FilmOptions(),
) -> None:
    """Fly one episode and film it.

    Args:
        policy: name of a policy or an agent, or package.module:Name of your own.
        preset: setting.
        episode: number of the episode.
        study_seed: seed of the study that the episode is from.
        split: tiles: train, tuning, validation or fresh.
        out: GIF to write.
        film: how it is filmed.
    """
    from rich.progress import track

    from hda.registry import AGENTS, make_policy

    if policy in AGENTS:
        importlib.import_module("rl")  # as an entry point would: it registers the agents
    _check_name(out)
    sys.stdout.write(
        f"flying {policy} on {preset}, episode {episode} (the first flight on a machine compiles)\n"
    )
    sys.stdout.flush()
    record = fly(make_policy(policy), sample_scenario(preset, study_seed, episode, split))
    times = frame_times(record, film)
    frames = list(track(film_frames(record, film), description="drawing", total=len(times)))
    save_frames(out, frames, film)
    ended = f"{policy} {ENDINGS[record.outcome.ending]}"
    sys.stdout.write(f"{ended}; wrote {out}, {len(frames)} frames, {out.stat().st_size / 1e6:.2f} MB\n")


def main() -> None:
    """Run the command."""
    tolerate_encoding()
    try:
        tyro.cli(film_flight, prog="python -m hda.flight.film", description=__doc__)
    except ValueError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
