"""What the aiding sensors read at a control instant, and what the filter makes of it.

A reading is made of the true state, the sensor's true errors and a draw; its prediction of the estimate
alone. A tilt turns what is measured along the body's axes: a direction d that the vehicle believes in is
d + tilt x d in truth.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.quaternion import rotate_into
from hda.navigation.attitude import believe_into, correct_attitude
from hda.navigation.layout import (
    ALTIMETER,
    ALTIMETER_BIAS,
    ALTIMETER_NOISE,
    BEAM_BIAS,
    BEAM_NOISE,
    FIX_NOISE,
    GROUND,
    POSITION,
    TERRAIN_FIX,
    TILT,
    VELOCIMETER,
    VELOCITY,
    AidingNumbers,
    FilterMemory,
    FilterNumbers,
    TrueErrors,
    Turn,
)
from hda.navigation.propagation import cross
from hda.navigation.schmidt_update import take_in


@compile_kernel
def _reads(sensor: AidingNumbers, instant: int, height: float, chance: float) -> bool:
    """Whether a sensor reads at a control instant, `height` above the ground (NaN: no ground below)."""
    if sensor.every == 0 or instant % sensor.every != 0 or chance < sensor.dropout:
        return False
    return sensor.floor <= height <= sensor.ceiling


@compile_kernel
def _deviation(sensor: AidingNumbers, height: float) -> float:
    """One sigma of a reading."""
    if height < sensor.plume_height:
        return math.hypot(sensor.noise, sensor.plume_noise)
    return sensor.noise


@compile_kernel
def read_altimeter(
    memory: FilterMemory, height: float, errors: TrueErrors, draws: Array, numbers: FilterNumbers
) -> float:
    """A range straight down, z = r_z - h + bias: the squared innovation."""
    deviation = _deviation(numbers.altimeter, height)
    reading = height + errors.altimeter_bias + deviation * draws[ALTIMETER_NOISE]
    design = np.zeros((1, memory.covariance.shape[0]))
    design[0, POSITION + 2] = 1.0
    design[0, GROUND] = -1.0
    design[0, ALTIMETER_BIAS] = 1.0
    innovation, noise = np.empty(1), np.empty(1)
    innovation[0] = reading - (memory.mean[POSITION + 2] - memory.mean[GROUND])
    noise[0] = deviation * deviation
    gating = (numbers.gates[ALTIMETER], numbers.patience, ALTIMETER, GROUND, GROUND + 1)
    return take_in(memory, design, innovation, noise, gating)


@compile_kernel
def _believed_beam(beam: Array, tilt: Array, turn: Turn | None) -> Array:
    """Where a beam of the body points as the vehicle believes: unit vector, shape (3,), site frame."""
    if turn is None:
        return beam
    believed, out = np.empty(4), np.empty(3)
    believe_into(turn.after, tilt, believed)
    rotate_into(believed, beam, out)
    return out


@compile_kernel
def _comes_back(pointed: Array, height: float, numbers: FilterNumbers, turn: Turn | None) -> bool:
    """Whether a beam of a turning body gives a reading: it is steep, and the ground is near enough along it.

    The ground is taken to be level here, as it is beyond the tile, which a slant beam soon leaves.
    """
    if turn is None:
        return True
    return -pointed[2] >= numbers.steepness and height <= -pointed[2] * numbers.velocimeter.ceiling


@compile_kernel
def read_velocimeter(
    memory: FilterMemory,
    truth: tuple[Array, float, Turn | None],
    errors: TrueErrors,
    draws: Array,
    numbers: FilterNumbers,
) -> float:
    """Three speeds along the beams, z_i = -u_i . v + bias_i: the squared innovation.

    A beam without a reading leaves a row of zeros, which tells nothing and adds nothing to the square; NaN
    where no beam has one. The gate is that of three beams.

    Args:
        memory: of the filter; changed in place.
        truth: velocity [m/s] shape (3,), height above the ground [m], and how the body turned; None: the
            beams are held upright.
        errors: the sensor's true errors.
        draws: shape (16,), standard normal.
        numbers: sensors and filter.
    """
    velocity, height, turn = truth
    deviation = _deviation(numbers.velocimeter, height)
    design = np.zeros((3, memory.covariance.shape[0]))
    innovation, noise = np.empty(3), np.empty(3)
    believed, read = memory.mean[VELOCITY : VELOCITY + 3], 0
    for i in range(3):
        beam = _believed_beam(numbers.beams[i], errors.tilt, turn)
        pointed = beam + cross(errors.tilt, beam)
        noise[i] = deviation * deviation
        innovation[i] = 0.0
        if not _comes_back(pointed, height, numbers, turn):
            continue
        turned = cross(beam, believed)
        reading = errors.beam_bias[i] + deviation * draws[BEAM_NOISE + i]
        predicted = 0.0
        for axis in range(3):
            reading -= pointed[axis] * velocity[axis]
            predicted -= beam[axis] * believed[axis]
            design[i, VELOCITY + axis] = -beam[axis]
            design[i, TILT + axis] = -turned[axis]
        design[i, BEAM_BIAS + i] = 1.0
        innovation[i] = reading - predicted
        read += 1
    if read == 0:
        return math.nan
    gating = (numbers.gates[VELOCIMETER], numbers.patience, VELOCIMETER, VELOCITY, VELOCITY + 3)
    return take_in(memory, design, innovation, noise, gating)


@compile_kernel
def read_terrain(memory: FilterMemory, position: Array, draws: Array, numbers: FilterNumbers) -> float:
    """A fix of the position against the map from orbit, z = r: the squared innovation."""
    deviation = numbers.terrain.noise
    design = np.zeros((3, memory.covariance.shape[0]))
    innovation, noise = np.empty(3), np.empty(3)
    for axis in range(3):
        design[axis, POSITION + axis] = 1.0
        reading = position[axis] + deviation * draws[FIX_NOISE + axis]
        innovation[axis] = reading - memory.mean[POSITION + axis]
        noise[axis] = deviation * deviation
    gating = (numbers.gates[TERRAIN_FIX], numbers.patience, TERRAIN_FIX, POSITION, POSITION + 3)
    return take_in(memory, design, innovation, noise, gating)


@compile_kernel
def read_sensors(
    memory: FilterMemory,
    truth: tuple[Array, float, int, Turn | None],
    errors: TrueErrors,
    draws: tuple[Array, Array],
    numbers: FilterNumbers,
    squares: Array,
) -> None:
    """Take in all that is read at one control instant.

    Args:
        memory: of the filter; changed in place.
        truth: true state (x y z vx vy vz m), height above the ground below [m] (NaN: none), the number of
            the instant, and how the body turned before it (None: there is no gyroscope).
        errors: the sensors' true errors; with a gyroscope each reading corrects the tilt, in place.
        draws: shapes (16,) standard normal and (3,) uniform.
        numbers: sensors and filter.
        squares: shape (3,); the squared innovations are written here, NaN where a sensor did not read.
    """
    state, height, instant, turn = truth
    normal, uniform = draws
    squares[:] = math.nan
    if _reads(numbers.altimeter, instant, height, uniform[ALTIMETER]):
        squares[ALTIMETER] = read_altimeter(memory, height, errors, normal, numbers)
        correct_attitude(memory, errors.tilt)
    if _reads(numbers.velocimeter, instant, height, uniform[VELOCIMETER]):
        seen = (state[3:6], height, turn)
        squares[VELOCIMETER] = read_velocimeter(memory, seen, errors, normal, numbers)
        correct_attitude(memory, errors.tilt)
    if _reads(numbers.terrain, instant, height, uniform[TERRAIN_FIX]):
        squares[TERRAIN_FIX] = read_terrain(memory, state[:3], normal, numbers)
        correct_attitude(memory, errors.tilt)
