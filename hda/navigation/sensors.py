"""The navigation sensors of a lander: what they measure, how well, how often, and where they fall silent.

A figure with a source is a published one; the others say that they were chosen. Heights are above the ground
straight below. Each sensor is read at control instants, so no more often than the thrust changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from guidance.arrays import Array
from guidance.constants import STANDARD_GRAVITY
from guidance.validation import finite_number
from hda.navigation.layout import AidingNumbers, GyroNumbers, InertialNumbers


def _check_sensor(sensor: Altimeter | Velocimeter | TerrainFixes) -> None:
    """What a sensor that is read at control instants must keep."""
    finite_number("noise", sensor.noise, above=0.0)
    finite_number("interval", sensor.interval, above=0.0)
    finite_number("floor", sensor.floor, at_least=0.0)
    finite_number("ceiling", sensor.ceiling, at_least=sensor.floor)
    finite_number("dropout", sensor.dropout, at_least=0.0, at_most=1.0)


@dataclass(frozen=True)
class InertialUnit:
    """An accelerometer triad, integrated exactly over a control period; by default that of the LN-200S.

    Attributes:
        noise: [m/s^2/sqrt(Hz)] density of the white noise of the specific force (35 ug/sqrt(Hz), LN-200S).
        bias: [m/s^2] one sigma of the bias along each axis (300 ug, LN-200S).
        correlation_time: [s] of the bias, a Gauss-Markov process (chosen: many descents long).
        tilt: [rad] one sigma, about each axis, of the error of the attitude at the start (chosen: 1 mrad,
            what a star tracker's tenth of that becomes in the minutes of braking before). Without a
            `Gyroscope` it stays as it was drawn for the whole episode.

    Raises:
        ValueError: a field is out of range.
    """

    noise: float = 35e-6 * STANDARD_GRAVITY
    bias: float = 300e-6 * STANDARD_GRAVITY
    correlation_time: float = 1000.0
    tilt: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse a unit that cannot exist."""
        finite_number("noise", self.noise, at_least=0.0)
        finite_number("bias", self.bias, at_least=0.0)
        finite_number("correlation_time", self.correlation_time, above=0.0)
        finite_number("tilt", self.tilt, at_least=0.0, at_most=0.1)

    @property
    def numbers(self) -> InertialNumbers:
        """The unit for the kernels."""
        return InertialNumbers(self.noise**2, self.bias, self.correlation_time)


@dataclass(frozen=True)
class Gyroscope:
    """A triad of gyroscopes, by which a body that turns knows its attitude; by default that of the LN-200S.

    Attributes:
        noise: [rad/sqrt(s)] angle random walk (0.07 deg/sqrt(h), LN-200S).
        bias: [rad/s] one sigma of the bias about each axis (1 deg/h, LN-200S).
        correlation_time: [s] of the bias, a Gauss-Markov process (chosen: many descents long).

    Raises:
        ValueError: a field is out of range.
    """

    noise: float = math.radians(0.07) / 60.0
    bias: float = math.radians(1.0) / 3600.0
    correlation_time: float = 1000.0

    def __post_init__(self) -> None:
        """Refuse a gyroscope that cannot exist."""
        finite_number("noise", self.noise, at_least=0.0)
        finite_number("bias", self.bias, at_least=0.0)
        finite_number("correlation_time", self.correlation_time, above=0.0)

    @property
    def numbers(self) -> GyroNumbers:
        """The gyroscope for the kernels."""
        return GyroNumbers(self.noise**2, self.bias, self.correlation_time)


@dataclass(frozen=True)
class Altimeter:
    """A laser's range straight down, by default as good as ALHAT's; on a body that turns it hangs on gimbals.

    Attributes:
        noise: [m] one sigma of a reading (5 cm, Roback et al., 2015, NTRS 20160005928).
        bias: [m] one sigma of an error common to all readings of an episode (chosen).
        interval: [s] between readings (chosen: 2 Hz, as the vehicle of the benchmark steers).
        floor: [m] it does not read lower (1 m, Roback et al.).
        ceiling: [m] nor higher (30 km, Roback et al.).
        dropout: probability that a reading falls out.
        plume_height: [m] under this height the plume adds to the noise; the filter knows it (Roback et al.
            saw it do so; no figure).
        plume_noise: [m] one sigma of what it adds.

    Raises:
        ValueError: a field is out of range.
    """

    noise: float = 0.05
    bias: float = 0.1
    interval: float = 0.5
    floor: float = 1.0
    ceiling: float = 30_000.0
    dropout: float = 0.0
    plume_height: float = 0.0
    plume_noise: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        _check_sensor(self)
        for name in ("bias", "plume_height", "plume_noise"):
            finite_number(name, getattr(self, name), at_least=0.0)


@dataclass(frozen=True)
class Velocimeter:
    """A Doppler LIDAR of three beams, equally spaced about the vertical; by default NASA's of 2020.

    With a `Gyroscope` aboard the beams are fixed to the body and turn with it. A beam then gives no reading
    where it is less steep than `slant_limit` allows, or the ground along it farther than `ceiling`.

    Attributes:
        noise: [m/s] one sigma of the speed along a beam (2 cm/s, NTRS 20200002534).
        bias: [m/s] one sigma of each beam's error common to an episode (chosen).
        beam_angle: [rad] between each beam and the vertical (chosen: 22.5 deg).
        interval: [s] between readings (chosen: 2 Hz, as the vehicle of the benchmark steers).
        floor: [m] it does not read lower (30 m, as designed for the Lunar Pallet Lander, NTRS 20190002101).
        ceiling: [m] nor higher (4 km, NTRS 20200002534).
        dropout: probability that a reading of all three falls out.
        plume_height: [m] under this height the plume adds to the noise; the filter knows it.
        plume_noise: [m/s] one sigma of what it adds.
        slant_limit: [rad] greatest angle between the vertical and a beam of a turning body (chosen: 60 deg;
            the echo weakens with the cosine of it, and the range grows).

    Raises:
        ValueError: a field is out of range.
    """

    noise: float = 0.02
    bias: float = 0.005
    beam_angle: float = math.radians(22.5)
    interval: float = 0.5
    floor: float = 30.0
    ceiling: float = 4000.0
    dropout: float = 0.0
    plume_height: float = 0.0
    plume_noise: float = 0.0
    slant_limit: float = math.radians(60.0)

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        _check_sensor(self)
        finite_number("slant_limit", self.slant_limit, above=0.0, at_most=math.radians(89.0))
        finite_number("beam_angle", self.beam_angle, at_least=math.radians(1.0), at_most=math.radians(89.0))
        for name in ("bias", "plume_height", "plume_noise"):
            finite_number(name, getattr(self, name), at_least=0.0)

    @cached_property
    def beams(self) -> Array:
        """Unit vectors of the beams, shape (3, 3), one a row; the first leans to the east. Read-only."""
        azimuth = np.arange(3) * (2.0 * math.pi / 3.0)
        across, down = math.sin(self.beam_angle), math.cos(self.beam_angle)
        beams = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), np.full(3, -down)])
        beams.flags.writeable = False
        return beams


@dataclass(frozen=True)
class TerrainFixes:
    """Fixes of the position against the map from orbit, by a camera (terrain-relative navigation).

    Attributes:
        noise: [m] one sigma of a fix along each axis, each fix with an error of its own (10 m, NTRS
            20190002101).
        interval: [s] between fixes (about 1 Hz on Blue Ghost).
        floor: [m] none lower (500 m, NTRS 20190002101).
        ceiling: [m] none higher (9 km, NTRS 20190002101).
        dropout: probability that a fix falls out.

    Raises:
        ValueError: a field is out of range.
    """

    noise: float = 10.0
    interval: float = 1.0
    floor: float = 500.0
    ceiling: float = 9000.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        _check_sensor(self)


@dataclass(frozen=True)
class SiteFixes:
    """Fixes of the landing site relative to the vehicle, one from each look (hazard-relative navigation).

    Attributes:
        noise_per_range: [m/m] one sigma along each axis, in proportion to the slant range (chosen: half the
            spacing of 128 rays over the paper's field of view of 11.4 deg).
        least_noise: [m] what is left of it close by (chosen).
        floor: [m] slant range under which no site is tracked (250 m, Roback et al., 2015).
        dropout: probability that a look gives no fix.

    Raises:
        ValueError: a field is out of range.
    """

    noise_per_range: float = 0.5 * math.tan(math.radians(11.4)) / 128.0
    least_noise: float = 0.1
    floor: float = 250.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a sensor that cannot exist."""
        finite_number("noise_per_range", self.noise_per_range, at_least=0.0)
        finite_number("least_noise", self.least_noise, above=0.0)
        finite_number("floor", self.floor, at_least=0.0)
        finite_number("dropout", self.dropout, at_least=0.0, at_most=1.0)

    def deviation(self, slant_range: float) -> float:
        """[m] one sigma of a fix along each axis from `slant_range` [m]."""
        return math.hypot(self.noise_per_range * slant_range, self.least_noise)


def aiding_numbers(sensor: Altimeter | Velocimeter | TerrainFixes | None, period: float) -> AidingNumbers:
    """A sensor for the kernels of a vehicle that steers each `period` [s]; None: it is not there.

    Raises:
        ValueError: the sensor's interval is not a whole number of periods.
    """
    if sensor is None:
        return AidingNumbers(1.0, 0, 0.0, 0.0, 1.0, 0.0, 0.0)
    plume = (0.0, 0.0)
    if not isinstance(sensor, TerrainFixes):
        plume = (sensor.plume_height, sensor.plume_noise)
    ratio = sensor.interval / period
    every = round(ratio)
    if every < 1 or abs(ratio - every) > 1e-6 * ratio:
        raise ValueError(
            f"interval of {type(sensor).__name__} must be a whole number of control periods,"
            f" got {sensor.interval:g} s for {period:g} s"
        )
    return AidingNumbers(sensor.noise, every, sensor.floor, sensor.ceiling, sensor.dropout, *plume)
