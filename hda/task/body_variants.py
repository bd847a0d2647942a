"""Harder rigid bodies by name: weak jets, a sensor that is fixed to the body, an engine that cannot idle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from guidance.rigid_body.body import RigidBody
from guidance.validation import unknown_name
from hda.task.presets import Preset

_WEAK_TORQUE = 11.0  # [N m] about each axis: of the order of a lander of 600 kg with jets of 20 N
_HALF_VIEW = math.radians(5.7)  # half of the paper's field of view of 11.4 deg
_ENGINE = 4500.0  # [N] near the paper's greatest thrust in flight; 40 % of it is below the lander's weight
_FLOOR = 0.4


def _weaken_torque(preset: Preset, body: RigidBody) -> Preset:
    return replace(preset, body=replace(body, torque_limit=(_WEAK_TORQUE, _WEAK_TORQUE, _WEAK_TORQUE)))


def _fix_sensor(preset: Preset, body: RigidBody) -> Preset:
    return replace(preset, lidar=replace(preset.lidar, off_nadir_limit=_HALF_VIEW))


def _raise_floor(preset: Preset, body: RigidBody) -> Preset:
    return replace(preset, lander=replace(preset.lander, max_thrust=_ENGINE, min_thrust=_FLOOR * _ENGINE))


BODY_VARIANTS: dict[str, Callable[[Preset, RigidBody], Preset]] = {
    "weak-torque": _weaken_torque,
    "body-fixed-sensor": _fix_sensor,
    "throttle-floor": _raise_floor,
}
"""Variants of a rigid body by name: 11 N m about each axis; rays within 5.7 deg of the body's axis alone; an
engine of 4500 N that never gives less than 40 % of it while it burns (of the paper's 12000 N, 40 % is 2.5
times the weight, and no flight could come down)."""


def vary_body(preset: Preset, name: str) -> Preset:
    """The same setting with a named variant of `BODY_VARIANTS`.

    Raises:
        ValueError: the preset has no body, or there is no such variant; the nearest valid names are given.
    """
    if name not in BODY_VARIANTS:
        raise ValueError(unknown_name("variant of a body", name, BODY_VARIANTS))
    if preset.body is None:
        raise ValueError(f"preset {preset.name!r} has no rigid body: vary `rigid-body`")
    return BODY_VARIANTS[name](preset, preset.body)
