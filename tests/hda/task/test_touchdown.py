"""Where flights of the presets end, and what a touchdown may be."""

import math
from dataclasses import replace

import pytest

import hda
from hda.task.presets import PRESETS


def test_only_the_presets_that_measure_their_ground_end_on_it():
    for name, preset in PRESETS.items():
        on_ground = name in ("lidar", "lidar-coarse", "navigated", "rigid-body")
        assert isinstance(preset.touchdown, hda.GroundTouchdown) == on_ground
        assert (preset.stance is not None) == on_ground
    assert hda.sample_scenario("paper", 0, 0).footing is None
    scenario = hda.sample_scenario("lidar", 0, 0)
    assert scenario.footing is not None
    assert scenario.footing.elevation is scenario.tile.elevation
    assert scenario.footing.plane == scenario.nominal_target[2]


def test_pads_and_belly_are_those_of_algorithm_1():
    preset = PRESETS["lidar"]
    stance = hda.GroundTouchdown(bearing=0.4).stance(preset.criteria)
    assert 2.0 * (stance.pad_distance + stance.pad_radius) == preset.criteria.footprint_diameter
    assert 2.0 * stance.pad_radius == preset.criteria.pad_diameter
    assert stance.clearance == preset.criteria.max_roughness
    assert stance.bearing == 0.4


def test_ground_that_no_sensor_measures_is_no_place_to_touch_down():
    with pytest.raises(ValueError, match="measures ranges"):
        replace(PRESETS["paper"], touchdown=hda.GroundTouchdown())
    on_plane = replace(PRESETS["lidar"], touchdown=hda.PlaneTouchdown())
    assert on_plane.stance is None


@pytest.mark.parametrize("name", ["bearing", "centre_of_mass_height", "moment_of_inertia"])
def test_a_lander_that_cannot_be_is_refused_by_name(name):
    with pytest.raises(ValueError, match=name):
        replace(hda.GroundTouchdown(), **{name: math.nan})  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("name", ["vertical_speed", "horizontal_speed", "slope"])
def test_limits_that_mean_nothing_are_refused_by_name(name):
    numbers = {"vertical_speed": 2.0, "horizontal_speed": 0.5, "slope": 0.2, name: 0.0}
    with pytest.raises(ValueError, match=name):
        hda.TouchdownLimits(**numbers)
