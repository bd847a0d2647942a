"""A scan of ranges to the ground: one ray to each point of a square grid on the target plane.

The rays leave the vehicle one after the other while it moves, row by row from the south-west. Each is aimed
by the attitude and the velocity that the vehicle believes it has; where it really goes, and from where,
differs by the errors below, and the point is put where the vehicle believes it to be. Rocks cast shadows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.state import RigidState
from guidance.state import State
from guidance.validation import finite_number
from hda.sensing.gridding import Gridding
from hda.sensing.ray_casting import find_ground
from hda.sensing.scan_draws import ScanDraws
from hda.sensing.sensor_axis import is_outside, sensor_axis


@dataclass(frozen=True)
class RangingLidar:
    """A scanning LIDAR that gives ranges, and what is made of them on board.

    Attributes:
        rays: along each side of the scan (128: chosen, of the order of a flash LIDAR's detectors; that of
            ALHAT is described by Roback et al., 2015, NTRS 20160005928).
        field_of_view: [rad] the scan covers a square of side range x tan(field_of_view) on the target plane
            (the paper's 11.4 deg).
        margin: [m] by which the scan reaches beyond that square on every side, so that Algorithm 1 can judge
            its edge: half a lander and a cell.
        off_nadir_limit: [rad] rays further than this from the vertical are not sent (the paper's 20 deg). On
            a rigid body it counts from the body's own axis: the reach of gimbals, or half the field of view
            of a sensor that is fixed to the body.
        pixels: along each side of the safety map (the paper's 64).
        range_noise: [m] one sigma of a range at `noise_range`, growing in proportion to the range (the
            paper's 5 cm at three sigma; in proportion, as the echo weakens with the square of the range).
        noise_range: [m] range to which `range_noise` refers.
        beam_divergence: [rad] full angle of the beam. On ground inclined by i to the beam it adds an error
            of one sigma (range x beam_divergence / 4) tan i (chosen: 1 deg over 128 detectors).
        range_bias: [m] one sigma of an error common to all ranges of a scan (Chang'E-3: under 0.15 m at
            three).
        ray_dropout: probability that a ray brings no echo.
        pointing_error: [rad] one sigma, about each axis, of the error of the attitude by which a scan is
            placed (1 mrad, an inertial unit's after a descent).
        pointing_jitter: [rad] one sigma of a ray's own error about the two horizontal axes (0.1 to 0.2 mrad,
            a detector's width).
        scan_duration: [s] from the first ray to the last (NASA's SPLICE: 2 s).
        latency: [s] from the last ray to the decision; 0: the decision interval stands for it, as in the
            paper.
        motion_error: [m/s] one sigma, along each axis, of the error of the velocity by which the vehicle's
            motion is taken out of the scan (Doppler LIDARs: 2 to 5 cm/s).
        gridding: how the points become an elevation map.

    Raises:
        ValueError: a field is out of range.
    """

    rays: int = 128
    field_of_view: float = math.radians(11.4)
    margin: float = 6.0
    off_nadir_limit: float = math.radians(20.0)
    pixels: int = 64
    range_noise: float = 0.05 / 3.0
    noise_range: float = 500.0
    beam_divergence: float = math.radians(1.0) / 128.0
    range_bias: float = 0.05
    ray_dropout: float = 0.0
    pointing_error: float = 1e-3
    pointing_jitter: float = 1e-4
    scan_duration: float = 2.0
    latency: float = 0.0
    motion_error: float = 0.05
    gridding: Gridding = field(default_factory=Gridding)

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        for name in ("rays", "pixels"):
            if getattr(self, name) < 2:
                raise ValueError(f"{name} must be at least 2, got {getattr(self, name)}")
        for name in ("field_of_view", "off_nadir_limit"):
            finite_number(name, getattr(self, name), above=0.0, at_most=math.radians(89.0))
        for name in ("pointing_error", "pointing_jitter", "beam_divergence"):
            finite_number(name, getattr(self, name), at_least=0.0, at_most=0.1)
        for name in ("margin", "range_noise", "range_bias", "scan_duration", "latency", "motion_error"):
            finite_number(name, getattr(self, name), at_least=0.0)
        finite_number("noise_range", self.noise_range, above=0.0)
        finite_number("ray_dropout", self.ray_dropout, at_least=0.0, at_most=1.0)

    def width(self, position: Array, target: Array) -> float:
        """[m] side of the field of view when `position` looks at `target`, both shape (3,)."""
        return float(np.linalg.norm(position - target)) * math.tan(self.field_of_view)

    def ray_spacing(self, position: Array, target: Array) -> float:
        """[m] between neighbouring rays on the target plane when `position` scans around `target`."""
        return (self.width(position, target) + 2.0 * self.margin) / self.rays


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The echoes of a scan, where the vehicle believes them to be.

    Attributes:
        offset: [m] shape (k, 3), from the vehicle's place at the decision.
        deviation: [m] shape (k,), one sigma of the height, as far as the range tells it.
    """

    offset: Array
    deviation: Array


class _View(NamedTuple):
    """Place and velocity at the decision, the scan's centre from there and its width, tangent of the limit.

    `top` is a height [m] that no ground exceeds; the limit counts from the vertical, or from a body's `axis`.
    """

    position: Array
    velocity: Array
    offset: Array
    width: float
    limit: float
    top: float
    axis: Array | None


class _Errors(NamedTuple):
    """Errors of one scan, in SI units."""

    attitude: Array
    bias: float
    motion: Array
    noise_per_metre: float
    divergence: float
    jitter: float
    dropout: float


class _Timing(NamedTuple):
    """[s] length of the scan, and time from its end to the decision."""

    duration: float
    latency: float


class _RayDraws(NamedTuple):
    """The part of `ScanDraws` that each ray has of its own."""

    range: NDArray[np.float32]
    jitter: NDArray[np.float32]
    dropout: NDArray[np.float32]


class _Echoes(NamedTuple):
    """Where the kernel writes: `PointCloud` with a place for every ray."""

    offset: Array
    deviation: Array


@compile_kernel
def _scan_into(
    elevation: NDArray[np.float32],
    view: _View,
    errors: _Errors,
    timing: _Timing,
    draws: _RayDraws,
    echoes: _Echoes,
) -> int:
    """Send every ray; return the number of echoes written."""
    ranges, jitters, dropouts = draws
    rays = ranges.shape[0]
    x0, y0, z0 = view.position[0], view.position[1], view.position[2]
    vx, vy, vz = view.velocity[0], view.velocity[1], view.velocity[2]
    aim_x, aim_y, aim_z = view.offset[0], view.offset[1], view.offset[2]
    believed_vx, believed_vy, believed_vz = (
        vx + errors.motion[0],
        vy + errors.motion[1],
        vz + errors.motion[2],
    )
    tilt_x, tilt_y, about_z = errors.attitude[0], errors.attitude[1], errors.attitude[2]
    offset, deviation = echoes
    count = 0
    for i in range(rays):
        for j in range(rays):
            if dropouts[i, j] < errors.dropout:
                continue
            age = timing.latency + timing.duration * (1.0 - (i * rays + j + 1.0) / (rays * rays))
            x = aim_x + age * believed_vx + ((j + 0.5) / rays - 0.5) * view.width
            y = aim_y + age * believed_vy + ((i + 0.5) / rays - 0.5) * view.width
            z = aim_z + age * believed_vz
            across = math.sqrt(x**2 + y**2)
            if is_outside(view.axis, view.limit, (x, y, z), across):
                continue
            length = math.sqrt(across * across + z**2)
            x, y, z = x / length, y / length, z / length
            about_x = tilt_x + errors.jitter * jitters[i, j, 0]
            about_y = tilt_y + errors.jitter * jitters[i, j, 1]
            ray_x = x + about_y * z - about_z * y
            ray_y = y + about_z * x - about_x * z
            ray_z = z + about_x * y - about_y * x
            length = math.sqrt(ray_x**2 + ray_y**2 + ray_z**2)
            ray_x, ray_y, ray_z = ray_x / length, ray_y / length, ray_z / length
            origin = (x0 - age * vx, y0 - age * vy, z0 - age * vz)
            distance, east, north = find_ground(elevation, origin, (ray_x, ray_y, ray_z), view.top)
            if math.isnan(distance):
                continue
            cosine = (east * ray_x + north * ray_y - ray_z) / math.sqrt(1.0 + east * east + north * north)
            tangent = math.sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 1e-3)
            own = errors.noise_per_metre * distance
            inclined = 0.25 * errors.divergence * distance * tangent
            measured = distance + errors.bias + math.sqrt(own * own + inclined * inclined) * ranges[i, j]
            offset[count, 0] = measured * x - age * believed_vx
            offset[count, 1] = measured * y - age * believed_vy
            offset[count, 2] = measured * z - age * believed_vz
            deviation[count] = errors.noise_per_metre * measured * -z
            count += 1
    return count


def scan(
    lidar: RangingLidar,
    elevation: NDArray[np.float32],
    state: State | RigidState,
    target: Array,
    draws: ScanDraws,
    highest: float | None = None,
) -> PointCloud:
    """Scan the ground around `target`.

    The vehicle's flight during the scan is taken as straight, at the velocity that it has at the decision.

    Args:
        lidar: the sensor.
        elevation: [m] shape (rows, columns), the true ground at 1 m a cell; row 0 is the south edge.
        state: true state at the decision, above the target; a rigid body does not turn during the scan.
        target: [m] shape (3,), where the scan is centred, on the target plane.
        draws: of this scan, for `lidar.rays` rays.
        highest: [m] the greatest known height; found in `elevation` if left out.

    Raises:
        ValueError: the draws are of another number of rays.
    """
    rays = lidar.rays
    if draws.range.shape != (rays, rays):
        raise ValueError(f"draws must be of {rays} x {rays} rays, got {draws.range.shape}")
    offset, deviation = np.empty((rays * rays, 3)), np.empty(rays * rays)
    count = _scan_into(
        elevation,
        _View(
            state.position,
            state.velocity,
            target - state.position,
            rays * lidar.ray_spacing(state.position, target),
            math.tan(lidar.off_nadir_limit),
            float(np.nanmax(elevation)) if highest is None else highest,
            sensor_axis(state.attitude) if isinstance(state, RigidState) else None,
        ),
        _Errors(
            lidar.pointing_error * draws.attitude,
            lidar.range_bias * draws.bias,
            lidar.motion_error * draws.motion,
            lidar.range_noise / lidar.noise_range,
            lidar.beam_divergence,
            lidar.pointing_jitter,
            lidar.ray_dropout,
        ),
        _Timing(lidar.scan_duration, lidar.latency),
        _RayDraws(draws.range, draws.jitter, draws.dropout),
        _Echoes(offset, deviation),
    )
    return PointCloud(offset[:count], deviation[:count])
