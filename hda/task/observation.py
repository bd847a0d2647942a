"""All that a policy may know at a decision."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.lander import Lander
from guidance.rigid_body.body import RigidBody
from guidance.state import State
from hda.safety.criteria import DEFAULT_CRITERIA, SafetyCriteria
from hda.safety.touchdown_stance import Stance
from hda.sensing.gridding import PixelGrid
from hda.sensing.lidar import Lidar
from hda.sensing.measured_look import MeasuredGround
from hda.sensing.ranging import RangingLidar
from hda.task.rules import Rules


@dataclass(frozen=True, eq=False)
class ScenarioView:
    """What a policy may know of a scenario before the first look; never the true map.

    Attributes:
        lander: the vehicle; of a rigid body the point mass that thrusts no further aside than it leans.
        gravity: [m/s^2] shape (3,).
        nominal_target: [m] shape (3,), the first target, on the target plane.
        rules: timing, bounds of the dispersions, judgement.
        lidar: the sensor, with its known noise.
        criteria: what the lander demands of its ground.
        body: the vehicle where it is a rigid body; None for a point mass.
    """

    lander: Lander
    gravity: Array
    nominal_target: Array
    rules: Rules
    lidar: Lidar | RangingLidar
    criteria: SafetyCriteria = DEFAULT_CRITERIA
    body: RigidBody | None = None

    @property
    def decision_interval(self) -> float:
        """[s] time between looks."""
        return self.rules.decision_interval

    @property
    def control_period(self) -> float:
        """[s] time over which a thrust is held."""
        return self.rules.control_period

    @property
    def control_periods(self) -> int:
        """Control periods between two looks."""
        return self.rules.control_periods


@dataclass(frozen=True, eq=False)
class Observation:
    """One look and the state at which it was taken.

    Attributes:
        index: number of the decision, from 0.
        time: [s] since the start.
        state: estimated position and velocity, and the true mass: no preset errs in what has been burnt.
        target: [m] shape (3,), current target: the centre of the look. Where flights end on real ground its
            height is the newest that was measured there.
        safety_map: shape (n, n), observed probability of safety, row i grows north, column j east. Of a
            ranging LIDAR it is Algorithm 1's verdict on the measured ground, 0 where that is not known.
        width: [m] side of the square look.
        time_to_go: [s] what remains of the commanded time to go.
        ground: what a ranging LIDAR measured, in the frame of the estimated state; None where the sensor
            gives the map alone.
        stance: pads and belly of a lander that touches down on real ground; None where sites keep the height
            of the target: on a target plane, and when so little time is left that a new height would trouble
            the flight more than the error of the old.
        covariance: shape (6, 6), of the errors of position less site [m] and of velocity [m/s], as the filter
            states it; None without a filter.
        attitude: unit quaternion, scalar first, shape (4,), that the lander believes to have: it turns body
            vectors into the site frame. None for a point mass.
        rates: [rad/s] shape (3,), body frame, as the gyroscope tells less the bias that the filter knows; the
            true ones without a gyroscope, None for a point mass.
        attitude_covariance: [rad^2] shape (3, 3), of the small turn about the site's axes by which the
            attitude errs, as the filter states it; None for a point mass, and without a filter.
    """

    index: int
    time: float
    state: State
    target: Array
    safety_map: NDArray[np.float32]
    width: float
    time_to_go: float
    ground: MeasuredGround | None = None
    stance: Stance | None = None
    covariance: Array | None = None
    attitude: Array | None = None
    rates: Array | None = None
    attitude_covariance: Array | None = None

    @property
    def has_map(self) -> bool:
        """Whether any ground may be safe: a look that came without a map reads 0 everywhere."""
        return bool(self.safety_map.any())

    @property
    def elevation(self) -> Array | None:
        """[m] shape (rows, columns), measured heights, NaN in holes; None where there are no ranges."""
        return None if self.ground is None else self.ground.elevation.height

    @property
    def elevation_spread(self) -> Array | None:
        """[m] shape (rows, columns), one standard deviation of each measured height; or None."""
        return None if self.ground is None else self.ground.elevation.spread

    @property
    def elevation_grid(self) -> PixelGrid | None:
        """Where the cells of `elevation` lie; or None."""
        return None if self.ground is None else self.ground.grid

    @property
    def pixel_size(self) -> float:
        """[m] side of one pixel."""
        return self.width / self.safety_map.shape[0]

    @property
    def pixel_offset(self) -> Array:
        """[m] shape (n,), offset of pixel i (north) or j (east) from the target: ((i + 1/2)/n - 1/2) w."""
        n = self.safety_map.shape[0]
        return ((np.arange(n) + 0.5) / n - 0.5) * self.width

    def site(self, row: int, column: int) -> Array:
        """[m] shape (3,), centre of pixel (row, column), on the target plane or the measured ground."""
        n = self.safety_map.shape[0]
        return self.settled(
            np.array(
                [
                    self.target[0] + ((column + 0.5) / n - 0.5) * self.width,
                    self.target[1] + ((row + 0.5) / n - 0.5) * self.width,
                    self.target[2],
                ]
            )
        )

    def settled(self, site: Array) -> Array:
        """[m] shape (3,), a site at the height of its ground; itself where sites keep the target's height."""
        if self.stance is None:
            return site
        return np.array([site[0], site[1], self.ground_height(float(site[0]), float(site[1]))])

    def ground_height(self, x: float, y: float) -> float:
        """[m] height to fly to at (x, y): just above where the upright lander first touches measured ground.

        That is `hda.sensing.measured_look.STANDOFF` above the contact of a pad or of the belly.
        It is the target's height of the target itself, where sites keep that height, where the ground of no
        pad was measured, and near the target where that of some was not.
        """
        target, stance = float(self.target[2]), self.stance
        away = math.hypot(x - self.target[0], y - self.target[1])
        if stance is None or self.ground is None or away == 0.0:
            return target
        height, pads = self.ground.site_height(stance, x, y)
        return height if pads == 4 or (pads > 0 and away > stance.pad_distance) else target

    def pixel(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the pixel that contains `site` (its x and y count), or None outside the look."""
        n = self.safety_map.shape[0]
        row = math.floor(((site[1] - self.target[1]) / self.width + 0.5) * n)
        column = math.floor(((site[0] - self.target[0]) / self.width + 0.5) * n)
        return (row, column) if 0 <= row < n and 0 <= column < n else None
