"""The named variants of the rigid body: what each changes, and what is refused."""

import math
from dataclasses import replace

import pytest

from hda.task.body_variants import BODY_VARIANTS, vary_body
from hda.task.presets import PRESETS

OWN = PRESETS["rigid-body"]


def test_each_variant_changes_what_its_name_says_and_nothing_else():
    weak, fixed, floor = (vary_body(OWN, name) for name in BODY_VARIANTS)
    assert weak.body is not None
    assert weak.body.torque_limit == (11.0, 11.0, 11.0)
    assert OWN.body is not None
    assert replace(weak, body=replace(weak.body, torque_limit=OWN.body.torque_limit)) == OWN
    assert math.degrees(fixed.lidar.off_nadir_limit) == pytest.approx(5.7)
    assert replace(fixed, lidar=OWN.lidar) == OWN
    assert floor.lander.min_thrust == 0.4 * floor.lander.max_thrust
    assert replace(floor, lander=OWN.lander) == OWN


def test_at_its_floor_the_engine_lets_the_lander_sink():
    lander = vary_body(OWN, "throttle-floor").lander
    assert lander.min_thrust < -OWN.gravity[2] * lander.dry_mass < lander.max_thrust


def test_what_is_no_variant_is_refused():
    with pytest.raises(ValueError, match="did you mean weak-torque"):
        vary_body(OWN, "weak-torqe")
    with pytest.raises(ValueError, match="'navigated' has no rigid body"):
        vary_body(PRESETS["navigated"], "weak-torque")
