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
from hda.navigation.layout import (
    ALTIMETER,
    ALTIMETER_BIAS,
    ALTIMETER_NOISE,
    BEAM_BIAS,
    BEAM_NOISE,
    FIX_NOISE,
    GROUND,
    POSITION,
    SIZE,
    TERRAIN_FIX,
    TILT,
    VELOCIMETER,
    VELOCITY,
    AidingNumbers,
    FilterMemory,
    FilterNumbers,
    TrueErrors,
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
    design = np.zeros((1, SIZE))
    design[0, POSITION + 2] = 1.0
    design[0, GROUND] = -1.0
    design[0, ALTIMETER_BIAS] = 1.0
    innovation, noise = np.empty(1), np.empty(1)
    innovation[0] = reading - (memory.mean[POSITION + 2] - memory.mean[GROUND])
    noise[0] = deviation * deviation
    gating = (numbers.gates[ALTIMETER], numbers.patience, ALTIMETER, GROUND, GROUND + 1)
    return take_in(memory, design, innovation, noise, gating)


@compile_kernel
def read_velocimeter(
    memory: FilterMemory,
    velocity: Array,
    height: float,
    errors: TrueErrors,
    draws: Array,
    numbers: FilterNumbers,
) -> float:
    """Three speeds along the beams, z_i = -u_i . v + bias_i: the squared innovation."""
    deviation = _deviation(numbers.velocimeter, height)
    design, innovation, noise = np.zeros((3, SIZE)), np.empty(3), np.empty(3)
    believed = memory.mean[VELOCITY : VELOCITY + 3]
    for i in range(3):
        beam = numbers.beams[i]
        pointed = beam + cross(errors.tilt, beam)
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
        noise[i] = deviation * deviation
    gating = (numbers.gates[VELOCIMETER], numbers.patience, VELOCIMETER, VELOCITY, VELOCITY + 3)
    return take_in(memory, design, innovation, noise, gating)


@compile_kernel
def read_terrain(memory: FilterMemory, position: Array, draws: Array, numbers: FilterNumbers) -> float:
    """A fix of the position against the map from orbit, z = r: the squared innovation."""
    deviation = numbers.terrain.noise
    design, innovation, noise = np.zeros((3, SIZE)), np.empty(3), np.empty(3)
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
    truth: tuple[Array, float, int],
    errors: TrueErrors,
    draws: tuple[Array, Array],
    numbers: FilterNumbers,
    squares: Array,
) -> None:
    """Take in all that is read at one control instant.

    Args:
        memory: of the filter; changed in place.
        truth: true state (x y z vx vy vz m), height above the ground below [m] (NaN: none), and the number
            of the instant.
        errors: the sensors' true errors.
        draws: shapes (16,) standard normal and (3,) uniform.
        numbers: sensors and filter.
        squares: shape (3,); the squared innovations are written here, NaN where a sensor did not read.
    """
    state, height, instant = truth
    normal, uniform = draws
    squares[:] = math.nan
    if _reads(numbers.altimeter, instant, height, uniform[ALTIMETER]):
        squares[ALTIMETER] = read_altimeter(memory, height, errors, normal, numbers)
    if _reads(numbers.velocimeter, instant, height, uniform[VELOCIMETER]):
        squares[VELOCIMETER] = read_velocimeter(memory, state[3:6], height, errors, normal, numbers)
    if _reads(numbers.terrain, instant, height, uniform[TERRAIN_FIX]):
        squares[TERRAIN_FIX] = read_terrain(memory, state[:3], normal, numbers)
