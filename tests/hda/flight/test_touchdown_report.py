"""A touchdown on real ground: each fault by itself, the ending that follows, and the two published sets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hda
from guidance import PAPER_LANDER, State
from guidance.rigid_body import RigidState, attitude_along
from hda.flight.outcome import Contact, Ending, Outcome, classify, score_step
from hda.flight.touchdown_report import TouchdownFault, TouchdownReport, judge_touchdown
from hda.ground.tile import Tile, make_tile
from hda.safety.criteria import DEFAULT_CRITERIA
from hda.safety.touchdown_stance import contact_height
from hda.task.presets import PRESETS
from hda.task.random_streams import EpisodeStreams
from hda.task.scenario import Scenario

PLACE = (30.0, 30.5)
SOFT = (0.0, 0.0, -1.0)
INITIAL = State(np.array([30.0, 30.0, 950.0]), np.array([5.0, 5.0, -30.0]), 1200.0)


def scenario_on(heights: np.ndarray, touchdown: hda.GroundTouchdown | None = None) -> Scenario:
    """The preset `lidar` over made ground."""
    preset = replace(PRESETS["lidar"], touchdown=touchdown or hda.GroundTouchdown())
    tile: Tile = make_tile(heights, DEFAULT_CRITERIA)
    target = np.array([*PLACE, 50.0])
    return Scenario(preset, "validation", EpisodeStreams(0, 0), tile, INITIAL, target)


def incline(degrees: float) -> np.ndarray:
    return np.tile(math.tan(math.radians(degrees)) * np.arange(60.0), (60, 1))


def with_rock(row: int, column: int, height: float) -> np.ndarray:
    ground = np.zeros((60, 60))
    ground[0, 0] = 20.0  # a far summit: the plane lies high above
    ground[row, column] += height
    return ground


def touch(
    scenario: Scenario,
    velocity=SOFT,
    place=PLACE,
    site: tuple[float, float] | None = None,
    under_power: bool = False,
) -> TouchdownReport:
    assert scenario.footing is not None
    height = contact_height(scenario.footing, *place)
    final = State(np.array([*place, height]), np.array(velocity), 1160.0)
    aim = np.array([*(site or place), height])
    report = judge_touchdown(scenario, final, aim, under_power)
    assert report is not None
    return report


def end(scenario: Scenario, report: TouchdownReport, velocity=SOFT, place=PLACE) -> Outcome:
    final = State(np.array([*place, 30.0]), np.array(velocity), 1160.0)
    contact = Contact(True, report.safe_cell, False, report)
    return classify(INITIAL, final, final.position, contact, PAPER_LANDER, scenario.preset.rules)


FLAT = with_rock(0, 1, 1.0)
CASES = {
    "flat": (FLAT, {}, (), Ending.SUCCESS),
    "both limits are kept": (FLAT, {"velocity": (0.3, 0.4, -2.0)}, (), Ending.SUCCESS),
    "fast down": (FLAT, {"velocity": (0.0, 0.0, -2.1)}, ("vertical-speed",), Ending.HARD_LANDING),
    "fast across": (FLAT, {"velocity": (0.4, 0.4, -1.0)}, ("horizontal-speed",), Ending.HARD_LANDING),
    "an incline of 11.5 degrees": (incline(11.5), {}, (), Ending.SUCCESS),
    "an incline of 12.5 degrees": (incline(12.5), {}, ("slope",), Ending.UNSAFE_SITE),
    "a low rock below the belly": (with_rock(30, 29, 0.25), {}, (), Ending.SUCCESS),
    "a rock below the belly": (with_rock(30, 29, 0.4), {}, ("clearance",), Ending.UNSAFE_SITE),
    "a rock under a pad": (with_rock(30, 34, 1.2), {}, (), Ending.SUCCESS),
    "a boulder under a pad": (with_rock(30, 34, 1.6), {}, ("slope",), Ending.UNSAFE_SITE),
    "the edge of the map": (FLAT, {"place": (3.0, 30.0)}, ("unknown-ground",), Ending.UNSAFE_SITE),
    "a strike on the way": (
        FLAT,
        {"velocity": (3.0, 0.0, -1.0), "site": (40.0, 30.5), "under_power": True},
        ("horizontal-speed", "strike"),
        Ending.CRASH,
    ),
    "the same without power": (
        FLAT,
        {"velocity": (3.0, 0.0, -1.0), "site": (40.0, 30.5)},
        ("horizontal-speed",),
        Ending.HARD_LANDING,
    ),
    "a gentle end on the way": (FLAT, {"site": (40.0, 30.5), "under_power": True}, (), Ending.SUCCESS),
    "early, at the site": (
        FLAT,
        {"velocity": (0.0, 0.0, -3.0), "under_power": True},
        ("vertical-speed",),
        Ending.HARD_LANDING,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_each_touchdown_names_what_failed(name):
    ground, case, faults, ending = CASES[name]
    scenario = scenario_on(ground)
    report = touch(scenario, **case)
    assert report.faults == tuple(TouchdownFault(fault) for fault in faults)
    outcome = end(scenario, report, case.get("velocity", SOFT), case.get("place", PLACE))
    assert outcome.ending is ending
    assert outcome.report is report
    assert outcome.success == (not faults)
    assert outcome.safe_site == report.safe_ground
    reward = score_step(0.0, outcome)
    assert reward.safety == (1.0 if outcome.safe_site else -1.0)
    assert reward.failure == (-10.0 if ending is Ending.CRASH else 0.0)


@given(
    degrees=st.floats(0.0, 11.0),
    down=st.floats(0.0, 2.0),
    across=st.floats(-0.5, 0.5),
)
def test_speeds_are_square_to_the_slope_and_along_it(degrees, down, across):
    report = touch(scenario_on(incline(degrees)), (across, 0.0, -down))
    tilt = math.radians(degrees)
    assert report.slope == pytest.approx(tilt, abs=2e-3)
    assert report.vertical_speed == pytest.approx(
        abs(down * math.cos(tilt) + across * math.sin(tilt)), abs=0.01
    )
    assert report.horizontal_speed == pytest.approx(
        abs(across * math.cos(tilt) - down * math.sin(tilt)), abs=0.01
    )


def test_a_tall_lander_tips_over_where_a_wide_one_slides():
    tall = hda.GroundTouchdown(
        limits=hda.TouchdownLimits(2.0, 8.0, math.radians(12.0)), centre_of_mass_height=6.0
    )
    wide = replace(tall, centre_of_mass_height=1.5)
    velocity = (2.5, 0.0, -0.5)
    fallen, standing = (touch(scenario_on(FLAT, gear), velocity) for gear in (tall, wide))
    assert fallen.faults == (TouchdownFault.TIP_OVER,)
    assert fallen.tip_over_speed < 2.5 < standing.tip_over_speed
    assert end(scenario_on(FLAT, tall), fallen, velocity).ending is Ending.CRASH
    assert standing.faults == ()


def test_the_published_sets_are_those_of_chandrayaan_3_and_decide():
    assert hda.TouchdownLimits(2.0, 0.5, math.radians(12.0)) == hda.DESIGN_LIMITS
    assert hda.TouchdownLimits(3.0, 1.0, math.radians(12.0)) == hda.TESTED_LIMITS
    hard = (0.8, 0.0, -2.5)
    assert touch(scenario_on(FLAT), hard).faults == (
        TouchdownFault.VERTICAL_SPEED,
        TouchdownFault.HORIZONTAL_SPEED,
    )
    assert touch(scenario_on(FLAT, hda.GroundTouchdown(limits=hda.TESTED_LIMITS)), hard).faults == ()


def touch_leaning(tilt_deg: float, rate_deg: float, touchdown: hda.GroundTouchdown) -> TouchdownReport:
    """A rigid body that comes down softly on level ground."""
    scenario = scenario_on(FLAT, touchdown)
    assert scenario.footing is not None
    place, tilt = np.array([*PLACE, contact_height(scenario.footing, *PLACE)]), math.radians(tilt_deg)
    turned = RigidState(
        place,
        np.array(SOFT),
        1160.0,
        attitude=attitude_along([math.sin(tilt) * 0.6, math.sin(tilt) * 0.8, math.cos(tilt)], 0.5),
        rates=math.radians(rate_deg) * np.array([0.6, 0.0, 0.8]),
    )
    report = judge_touchdown(scenario, turned.point, place, False, turned)
    assert report is not None
    return report


@pytest.mark.parametrize(
    ("tilt_deg", "rate_deg", "faults"),
    [
        (5.9, 1.9, ()),
        (6.1, 1.9, ("tilt",)),
        (0.0, 2.1, ("turn-rate",)),
        (9.0, 3.0, ("tilt", "turn-rate")),
    ],
)
def test_a_rigid_body_must_stand_upright_and_still(tilt_deg, rate_deg, faults):
    report = touch_leaning(tilt_deg, rate_deg, hda.GroundTouchdown())
    assert math.degrees(report.tilt) == pytest.approx(tilt_deg, abs=1e-6)
    assert math.degrees(report.turn_rate) == pytest.approx(rate_deg, abs=1e-9)
    assert report.faults == tuple(TouchdownFault(fault) for fault in faults)
    outcome = end(scenario_on(FLAT), report)
    assert outcome.ending is (Ending.HARD_LANDING if faults else Ending.SUCCESS)
    assert outcome.safe_site


def test_what_leans_downhill_tips_over_as_on_a_slope_that_is_steeper_by_as_much():
    leaning = touch_leaning(5.0, 0.0, hda.GroundTouchdown())
    steep = touch(scenario_on(incline(5.0)))
    assert leaning.slope == pytest.approx(0.0, abs=1e-6)
    assert leaning.tip_over_speed == pytest.approx(steep.tip_over_speed, rel=1e-3)


def test_a_fall_above_the_crash_speed_is_a_crash_whatever_the_ground():
    scenario = scenario_on(FLAT)
    report = touch(scenario, (0.0, 0.0, -6.0))
    assert end(scenario, report, (0.0, 0.0, -6.0)).ending is Ending.CRASH


def test_flights_that_end_on_the_plane_have_no_report():
    scenario = replace(scenario_on(FLAT), preset=PRESETS["paper"])
    assert judge_touchdown(scenario, INITIAL, INITIAL.position, False) is None
    flown = hda.fly(hda.make_policy("no-divert"), hda.sample_scenario("paper", 0, 0))
    assert flown.outcome.report is None
