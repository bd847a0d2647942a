"""What a preset is, and the named settings of the benchmark.

The numbers of `paper` and `hard` come from `python -m studies.calibrate` on the tuning tiles;
docs/explanation/calibration.md shows what they give beside the paper's row. `partial` is the ground of
`paper` seen badly, so that one look is not enough: five times its map noise, two looks of five without a map,
and errors of the estimated state.
On `lidar` and `lidar-coarse` a look is no longer the true map with noise on it: ranges are measured to the
same ground, 128 or 64 rays a side, gridded, and assessed on board; and the flight ends on the real ground.
`navigated` is `lidar` by a lander that finds its state by sensors and a filter.
On `rigid-body` that lander must turn to thrust elsewhere, its sensors turn with it, and its filter estimates
its attitude.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from guidance.constants import MOON_GRAVITY
from guidance.lander import PAPER_LANDER, Lander
from guidance.rigid_body.attitude_loop import DEFAULT_LOOP, AttitudeLoop
from guidance.rigid_body.body import DEFAULT_BODY, RigidBody
from guidance.thrust_limits import pointing_angle
from guidance.validation import finite_number, finite_vector, unknown_name
from hda.ground.own_terrain import OwnTerrain
from hda.navigation.layout import FilterNumbers
from hda.navigation.sensors import Gyroscope
from hda.navigation.system import NavigationSystem
from hda.safety.criteria import SafetyCriteria
from hda.safety.touchdown_stance import Stance
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.rules import Rules, StartConditions
from hda.task.touchdown import GroundTouchdown, PlaneTouchdown, Touchdown
from hda.terrain.generator import TerrainParameters
from hda.terrain.islands import IslandField
from hda.terrain.settings import BOULDERS, PAPER_TERRAIN


@dataclass(frozen=True)
class Preset:
    """A whole benchmark setting, frozen with the figures that its calibration gave.

    Attributes:
        name: name in tables.
        terrain: generator parameters, or a user's own terrain.
        criteria: Algorithm 1's limits and lander size.
        start: initial conditions.
        lidar: sensor model.
        rules: timing, dispersions, judgement.
        lander: the vehicle's engine and tank; without a body it is the vehicle.
        gravity: [m/s^2] site frame, pointing down.
        touchdown: where a flight ends, and how it is judged there.
        navigation: sensors and filter by which the lander knows its state; None: it knows it but for the
            constant errors of `rules`.
        body: the lander as a rigid body that must turn to thrust elsewhere; None: a point mass. Its engine
            and tank are those of `lander`, whatever it names, and it leans no further than
            `lander.pointing_limit`. On the target plane (`PlaneTouchdown`) how it leans and turns at the
            touchdown is not judged.
        attitude_loop: by which the body turns.

    Raises:
        ValueError: gravity does not point down, a start has no propellant or lies below the target plane,
            a body has no torque to lean with, flights end on real ground whose height no sensor measures,
            there are both a filter and constant errors, a gyroscope has no body, or a navigation sensor is
            not read at a whole number of control periods.
    """

    name: str
    terrain: TerrainParameters | OwnTerrain = field(default_factory=TerrainParameters)
    criteria: SafetyCriteria = field(default_factory=SafetyCriteria)
    start: StartConditions = field(default_factory=StartConditions)
    lidar: Lidar | RangingLidar = field(default_factory=Lidar)
    rules: Rules = field(default_factory=Rules)
    lander: Lander = PAPER_LANDER
    gravity: tuple[float, float, float] = MOON_GRAVITY
    touchdown: Touchdown = field(default_factory=PlaneTouchdown)
    navigation: NavigationSystem | None = None
    body: RigidBody | None = None
    attitude_loop: AttitudeLoop = DEFAULT_LOOP

    def __post_init__(self) -> None:
        """The ground must be below, and the tank must hold something."""
        if finite_vector("gravity", self.gravity, 3)[2] >= 0.0:
            raise ValueError(f"gravity must point down (z below zero), got {self.gravity}")
        finite_number("start.mass", self.start.mass.low, above=self.lander.dry_mass)
        finite_number("start.altitude", self.start.altitude.low, above=self.terrain.maximum_elevation)
        if self.stance is not None and not isinstance(self.lidar, RangingLidar):
            raise ValueError("touchdown on real ground needs a lidar that measures ranges")
        if self.body is not None and min(self.body.torque_limit[:2]) <= 0.0:
            raise ValueError(
                f"a body that flies needs torque about x and y, torque_limit is {self.body.torque_limit}"
            )
        constant = self.rules.navigation_position_error, self.rules.navigation_velocity_error
        if self.navigation is not None and any(constant):
            raise ValueError("navigation by a filter leaves no constant navigation errors in the rules")
        if self.navigation is not None and self.navigation.gyroscope is not None and self.body is None:
            raise ValueError("a gyroscope needs a body that turns; give one, or leave the gyroscope out")
        if self.navigation is not None:
            _ = self.filter_numbers  # refuses a sensor that no instant can read

    @cached_property
    def vehicle(self) -> Lander | RigidBody:
        """What flies: a point mass, or the rigid body with this preset's engine and tank."""
        if self.body is None:
            return self.lander
        limit = min(self.body.tilt_limit, pointing_angle(self.lander))
        return replace(self.body, lander=self.lander, tilt_limit=limit)

    @cached_property
    def guided_lander(self) -> Lander:
        """The point mass that guidance plans for: it thrusts no further aside than a body leans."""
        vehicle = self.vehicle
        if not isinstance(vehicle, RigidBody) or vehicle.tilt_limit == pointing_angle(self.lander):
            return self.lander
        return replace(self.lander, pointing_limit=vehicle.tilt_limit)

    @cached_property
    def filter_numbers(self) -> FilterNumbers | None:
        """Sensors and filter for the kernels; None where there is none.

        Raises:
            ValueError: a sensor is not read at a whole number of control periods.
        """
        return None if self.navigation is None else self.navigation.numbers(self.rules.control_period)

    @cached_property
    def stance(self) -> Stance | None:
        """The lander's pads and belly where it touches down on real ground; None on the plane."""
        return self.touchdown.stance(self.criteria)


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(name="paper", terrain=PAPER_TERRAIN),
        Preset(
            name="hard",
            terrain=TerrainParameters(rocks=BOULDERS, islands=IslandField(25.0, threshold=-1.0)),
        ),
        Preset(
            name="partial",
            terrain=PAPER_TERRAIN,
            lidar=Lidar(noise=0.25, dropout=0.4),
            rules=Rules(navigation_position_error=0.5, navigation_velocity_error=0.1),
        ),
        Preset(
            name="lidar",
            terrain=PAPER_TERRAIN,
            lidar=RangingLidar(rays=128),
            touchdown=GroundTouchdown(),
        ),
        Preset(
            name="lidar-coarse",
            terrain=PAPER_TERRAIN,
            lidar=RangingLidar(rays=64),
            touchdown=GroundTouchdown(),
        ),
        Preset(
            name="navigated",
            terrain=PAPER_TERRAIN,
            lidar=RangingLidar(rays=128),
            touchdown=GroundTouchdown(),
            navigation=NavigationSystem(),
        ),
        Preset(
            name="rigid-body",
            terrain=PAPER_TERRAIN,
            lidar=RangingLidar(rays=128),
            touchdown=GroundTouchdown(),
            navigation=NavigationSystem(gyroscope=Gyroscope()),
            body=DEFAULT_BODY,
        ),
    )
}
"""The presets by name."""


def find_preset(preset: str | Preset) -> Preset:
    """Give the preset of a name (a Preset passes through).

    Raises:
        ValueError: there is no such preset; the nearest valid names are given.
    """
    if isinstance(preset, Preset):
        return preset
    if preset not in PRESETS:
        raise ValueError(unknown_name("preset", preset, PRESETS))
    return PRESETS[preset]
