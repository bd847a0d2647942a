"""How the lander stands: planes through three pads, what is under its belly, and when it tips over."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hda.safety.touchdown_pose import TippingBody, stand, tip_over_speed
from tests.hda.safety.test_touchdown_stance import BEARINGS, INSIDE, footing, incline, rough
from tests.oracles import set_down as oracle

GRAVITY = 1.62
WIDE = TippingBody(height=1.5, inertia=900.0, edge_distance=3.18, mass=1150.0)
MODULE = TippingBody(height=2.0, inertia=900.0, edge_distance=1.63, mass=1150.0)
TALL = TippingBody(height=2.5, inertia=900.0, edge_distance=1.15, mass=1150.0)


@given(x=INSIDE, y=INSIDE, bearing=BEARINGS, slope=st.floats(0.0, 0.4), uphill=BEARINGS)
def test_on_an_incline_both_planes_are_its_own(x, y, bearing, slope, uphill):
    east, north = slope * math.cos(uphill), slope * math.sin(uphill)
    pose = stand(footing(incline(east, north), bearing), x, y)
    assert pose.known
    # 16 points find a pad's upper rim to 2 % of its radius, so that pads may err by 1 cm a unit of slope
    nearly = 1e-4 + 0.01 * slope / 4.5 * 2.0
    np.testing.assert_allclose(pose.slopes, math.atan(slope), atol=nearly)
    normal = np.array([-east, -north, 1.0]) / math.sqrt(1.0 + slope**2)
    np.testing.assert_allclose(pose.normals, [normal, normal], atol=nearly)
    assert -0.5 * slope - 1e-3 <= pose.roughness <= 1e-3  # pads rest on their upper rims


def test_a_rock_under_one_pad_tilts_the_lander_about_the_other_diagonal():
    ground = np.full((30, 30), 20.0)
    ground[15, 19] += 1.0
    pose = stand(footing(ground), 15.0, 15.5)
    # it stands on the rock and on the opposite pad, 0.5 m up at the axis, and rocks to either side
    assert pose.slopes.tolist() == pytest.approx([math.atan(math.hypot(0.5, 0.5) / 4.5)] * 2, abs=1e-5)
    assert pose.roughness < 0.0


@pytest.mark.parametrize("height", [0.1, 0.3, 1.2])
def test_a_rock_between_the_pads_is_all_of_the_roughness(height):
    ground = np.full((30, 30), 20.0)
    ground[15, 15] += height
    pose = stand(footing(ground), 15.0, 15.5)
    assert pose.slopes.max() == 0.0
    assert pose.roughness == pytest.approx(height, abs=1e-5)


@given(x=INSIDE, y=INSIDE, bearing=BEARINGS, seed=st.integers(0, 20))
def test_on_rough_ground_the_planes_go_through_three_pads_and_below_none(x, y, bearing, seed):
    ground = footing(rough(seed), bearing)
    pose = stand(ground, x, y)
    pads = oracle.pad_middles(0.0, 0.0, 4.5, bearing)
    points = [(px, py, oracle.pad_height(ground.elevation, x + px, y + py, 0.5)) for px, py in pads]
    stable = []
    for left_out in range(4):
        plane = oracle.plane_through([point for k, point in enumerate(points) if k != left_out])
        px, py, height = points[left_out]
        if plane[0] * px + plane[1] * py + plane[2] >= height - 1e-9:  # the fourth pad hangs
            stable.append(plane)
    assert len(stable) == 2
    slopes = sorted(math.atan(math.hypot(plane[0], plane[1])) for plane in stable)
    np.testing.assert_allclose(np.sort(pose.slopes), slopes, atol=1e-4)
    highest = -math.inf
    for row in range(30):
        for column in range(30):
            east, north = column + 0.5 - x, row + 0.5 - y
            if oracle.is_between(east, north, pads):
                for gx, gy, z0 in stable:
                    above = float(ground.elevation[row, column]) - (z0 + gx * east + gy * north)
                    highest = max(highest, above / math.sqrt(1.0 + gx**2 + gy**2))
    assert pose.roughness == pytest.approx(highest, abs=1e-4)


def test_a_hole_under_a_pad_or_the_belly_and_the_maps_edge_are_unknown_ground():
    flat = np.full((30, 30), 20.0)
    assert stand(footing(flat), 15.0, 15.0).known
    for row, column in ((15, 19), (15, 15)):
        ground = flat.copy()
        ground[row, column] = np.nan
        assert not stand(footing(ground), 15.0, 15.5).known
    assert not stand(footing(flat), 4.0, 15.0).known
    outside = stand(footing(flat), -100.0, 15.0)
    assert not outside.known
    assert outside.slopes.max() == 0.0


@pytest.mark.parametrize(
    ("body", "speeds"),
    [(WIDE, (6.2, 5.8, 5.3, 5.1)), (MODULE, (1.9, 1.6, 1.4, 1.3)), (TALL, (1.0, 0.84, 0.62, 0.54))],
)
def test_tipping_speeds_are_those_of_the_energy_worked_by_hand(body, speeds):
    """1150 kg, 900 kg m^2 on slopes of 0, 5, 10 and 12 degrees, to the digits that were worked."""
    for slope, speed in zip((0.0, 5.0, 10.0, 12.0), speeds, strict=True):
        found = tip_over_speed(body, math.radians(slope), GRAVITY)
        assert found == pytest.approx(speed, abs=0.055 if speed >= 1.0 else 0.011)


@pytest.mark.parametrize("body", [WIDE, MODULE, TALL])
@pytest.mark.parametrize("slope", [0.0, 0.1, 0.2])
def test_a_pendulum_over_the_edge_tips_just_above_that_speed(body, slope):
    """The rotation about the caught pads, integrated: it passes the top, or it falls back."""
    arm = math.hypot(body.height, body.edge_distance)
    inertia = body.inertia + body.mass * arm**2
    to_the_top = math.atan2(body.edge_distance, body.height) - slope  # of the arm from the vertical

    def tips(speed: float) -> bool:
        def turn(_, y):
            return [y[1], -body.mass * GRAVITY * arm * math.sin(to_the_top - y[0]) / inertia]

        def top(_, y):
            return y[0] - to_the_top

        def falls_back(_, y):
            return y[0] + 1e-9

        for event in (top, falls_back):
            event.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        falls_back.direction = -1  # pyright: ignore[reportFunctionMemberAccess]
        rate = body.mass * body.height * speed / inertia
        leg = solve_ivp(turn, (0.0, 200.0), [0.0, rate], events=[top, falls_back], rtol=1e-9, atol=1e-12)
        return len(leg.t_events[0]) > 0

    limit = tip_over_speed(body, slope, GRAVITY)
    assert tips(1.01 * limit)
    assert not tips(0.99 * limit)


def test_a_lander_beyond_its_balance_tips_at_rest_and_a_heavier_planet_holds_it_better():
    assert tip_over_speed(TALL, math.atan2(1.15, 2.5) + 1e-6, GRAVITY) == 0.0
    assert tip_over_speed(TALL, 0.1, 9.81) > tip_over_speed(TALL, 0.1, GRAVITY)
    assert tip_over_speed(replace(TALL, height=1.0), 0.1, GRAVITY) > tip_over_speed(TALL, 0.1, GRAVITY)
