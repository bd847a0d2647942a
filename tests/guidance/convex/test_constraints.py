"""Each constraint family on points inside, on and outside, and the physics of the equations."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from guidance import Cone, Lander, Limits, State
from guidance.convex import constraints
from guidance.convex.condensed import CondensedLayout, burnt_mass, landing_moments
from guidance.convex.layout import Layout
from guidance.convex.programme import Family
from guidance.convex.scaling import least_log_mass, outer_mass_bounds, scale_problem, tangent_mass_bounds
from guidance.descent.problem import LandingProblem
from guidance.dynamics import integrate

NODES = 7
LAYOUT = Layout(NODES)
FREE = Layout(NODES, free_landing_point=True)
LANDER = Lander(min_thrust=1200.0, pointing_limit=0.7)
PROBLEM = LandingProblem(
    State(np.array([30.0, -20.0, 400.0]), np.array([-3.0, 2.0, -25.0]), 1200.0),
    np.array([5.0, 5.0, 50.0]),
    LANDER,
    np.array([0.1, -0.2, -1.62]),
    Limits(
        glide_slope=0.5,
        speed=40.0,
        final_thrust_direction=Cone(0.3, (0.6, 0.0, 0.8)),
        line_of_sight=Cone(0.8, (0.6, 0.0, 0.8)),
        thrust_rate=900.0,
    ),
    target_velocity=np.array([1.0, -2.0, -6.0]),
)
TIME = 20.0
SCALED = scale_problem(PROBLEM, TIME, NODES, error_limit=3.0, limit_propellant=True)


def filled(layout=LAYOUT, **parts):
    """A decision vector of zeros but for the named parts."""
    x = np.zeros(layout.size)
    for name, value in parts.items():
        x[getattr(layout, name)] = value
    return x


def check(family, inside, on, outside, layout=LAYOUT):
    rows = family(layout, SCALED)
    assert rows.violation(inside) < -1e-6
    assert rows.violation(on) == pytest.approx(0.0, abs=1e-12)
    assert rows.violation(outside) > 1e-6


def test_indices_cover_the_vector_once():
    for layout in (LAYOUT, FREE):
        blocks = [layout.position, layout.velocity, layout.log_mass, layout.acceleration, layout.slack]
        owned = np.concatenate([block.ravel() for block in blocks])
        if layout.free_landing_point:
            owned = np.append(owned, layout.landing_error)
        assert sorted(owned.tolist()) == list(range(layout.size))
    with pytest.raises(AttributeError):
        _ = LAYOUT.landing_error


def test_thrust_cone():
    push = np.tile([0.3, 0.0, 0.4], (NODES, 1))
    check(
        constraints.thrust_cone,
        filled(acceleration=push, slack=0.6),
        filled(acceleration=push, slack=0.5),
        filled(acceleration=push, slack=0.4),
    )
    one_node = filled(acceleration=push, slack=0.6)
    one_node[LAYOUT.slack[3]] = 0.49
    assert constraints.thrust_cone(LAYOUT, SCALED).violation(one_node) == pytest.approx(0.01)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_thrust_bounds_mean_newtons(share):
    """At the linearisation point a slack stands for mass times acceleration, against newtons."""
    log_mass = -share * 0.03 * np.ones(NODES)
    scaled = replace(SCALED, mass_bounds=tangent_mass_bounds(PROBLEM, log_mass, SCALED.kappa))
    mass = PROBLEM.state.mass * np.exp(log_mass)
    for family, limit, sign in (
        (constraints.max_thrust, LANDER.max_thrust, 1.0),
        (constraints.min_thrust, LANDER.min_thrust, -1.0),
    ):
        rows = family(LAYOUT, scaled)
        for change in (-10.0, 0.0, 10.0):
            slack = (limit + change) / mass / scaled.acceleration
            x = filled(log_mass=log_mass / scaled.kappa, slack=slack)
            newtons = rows.violation(x) * scaled.acceleration * mass[0]
            assert newtons == pytest.approx(sign * change, abs=1e-6)


def test_outer_thrust_bounds_exclude_no_true_thrust_and_hardly_widen_it():
    least = least_log_mass(PROBLEM, TIME, NODES)
    bounds = outer_mass_bounds(PROBLEM, TIME, 1.0, NODES)
    ratio = LANDER.min_thrust / LANDER.max_thrust
    for share in np.linspace(0.0, 1.0, 21):
        z = share * least
        assert (bounds.upper_bound - bounds.upper_slope * z >= np.exp(-z) - 1e-12).all()
        assert (bounds.upper_bound - bounds.upper_slope * z <= np.exp(-z) * 1.0005).all()
        assert (bounds.lower_bound - bounds.lower_slope * z <= ratio * np.exp(-z) + 1e-12).all()
        assert (bounds.lower_bound - bounds.lower_slope * z >= ratio * np.exp(-z) * 0.999).all()


def test_least_log_mass_is_guarded_where_full_thrust_would_burn_the_vehicle():
    z = least_log_mass(PROBLEM, 5000.0, NODES)  # 5000 s at 3.8 kg/s
    assert np.isfinite(z).all()
    assert z[0] == 0.0
    assert z[-1] == pytest.approx(-PROBLEM.log_mass_ratio)
    assert (np.diff(z) <= 0.0).all()


def test_altitude_floor():
    def heights(lowest):
        x = filled()
        x[LAYOUT.position[1:-1, 2]] = 0.1
        x[LAYOUT.position[3, 2]] = lowest
        return x

    check(constraints.altitude_floor, heights(0.05), heights(0.0), heights(-0.05))


@pytest.mark.parametrize("limit", [0.4, 1.2, 2.0])
def test_pointing_also_beyond_a_right_angle(limit):
    scaled = replace(SCALED, pointing_cosine=float(np.cos(limit)))
    rows = constraints.pointing(LAYOUT, scaled)
    for change in (-0.1, 0.0, 0.1):
        angle = limit + change
        push = 0.5 * np.array([np.sin(angle), 0.0, np.cos(angle)])
        violation = rows.violation(filled(acceleration=push, slack=0.5))
        assert np.sign(round(violation, 12)) == np.sign(change)


def test_glide_slope_is_seen_from_the_landing_point():
    landing = np.array([0.02, -0.01, 0.0])
    rows = constraints.glide_slope(FREE, SCALED)
    for change in (-0.05, 0.0, 0.05):
        angle = SCALED.glide_angle + change
        x = filled(FREE, position=landing + 0.2 * np.array([0.0, np.sin(angle), np.cos(angle)]))
        x[FREE.position[-1]] = landing
        assert np.sign(round(rows.violation(x), 12)) == np.sign(change)


@pytest.mark.parametrize("angle", [0.2, 1.4, 2.4])
def test_final_thrust_direction_binds_the_last_node_alone(angle):
    scaled = replace(SCALED, final_thrust=np.array([0.6, 0.0, 0.8, np.cos(angle)]))
    rows = constraints.final_thrust_direction(LAYOUT, scaled)
    for change in (-0.1, 0.0, 0.1):
        lean = np.arctan2(0.6, 0.8) + angle + change  # in the plane of the axis
        x = filled(acceleration=[0.0, 0.0, -0.5], slack=0.5)
        x[LAYOUT.acceleration[-1]] = 0.5 * np.array([np.sin(lean), 0.0, np.cos(lean)])
        assert np.sign(round(rows.violation(x), 12)) == np.sign(change)


def test_the_rate_of_the_thrust_in_newtons_a_second():
    """Linearised at its own mass, the rows' violation is what the thrust of a node exceeds."""
    limited = replace(PROBLEM, limits=Limits(thrust_rate=900.0))
    log_mass, step = np.linspace(0.0, -0.04, NODES), TIME / (NODES - 1)
    mass = PROBLEM.state.mass * np.exp(log_mass)
    scaled = scale_problem(limited, TIME, NODES, log_mass)
    thrust = 3000.0 + np.array([0.0, 1.0, 0.0, -1.0, -2.0, -1.0, 0.0])[:, None] * 900.0 * step * np.eye(3)[2]
    for axis, change in ((0, 0.0), (1, 240.0)):
        moved = thrust.copy()
        moved[2, axis] += change
        rows = constraints.thrust_rate(LAYOUT, scaled)
        x = filled(acceleration=moved / mass[:, None] / scaled.acceleration)
        excess = rows.violation(x) * LANDER.max_thrust
        expected = np.linalg.norm(np.diff(moved, axis=0), axis=1).max() - 900.0 * step
        assert excess == pytest.approx(expected, abs=1e-6)


@given(seed=st.integers(0, 1_000_000))
def test_the_relaxed_rate_of_the_thrust_excludes_no_flight(seed):
    """Any thrust within the bounds, and the greatest rate that it has from node to node."""
    rng = np.random.default_rng(seed)
    time, mass = rng.uniform(5.0, 60.0), np.empty(NODES)
    free = Lander(
        dry_mass=700.0, max_thrust=rng.uniform(4e3, 4e4), specific_impulse=rng.uniform(150.0, 450.0)
    )
    step, push = time / (NODES - 1), rng.normal(size=(NODES, 3))
    thrust = rng.uniform(0.0, free.max_thrust, NODES)[:, None] * push / np.linalg.norm(push, axis=1)[:, None]
    mass[0] = PROBLEM.state.mass
    for k in range(NODES - 1):  # trapezoidal in ln(mass), as the mesh burns it
        size = np.linalg.norm(thrust[k : k + 2], axis=1)
        mass[k + 1] = mass[k] * np.exp(-0.5 * step * size.sum() / mass[k] / free.exhaust_velocity)
    if mass[-1] <= free.dry_mass:
        reject()
    rate = np.linalg.norm(np.diff(thrust, axis=0), axis=1).max() / step
    problem = replace(PROBLEM, lander=free, limits=Limits(thrust_rate=float(rate)))
    scaled = scale_problem(problem, time, NODES)
    push = thrust / mass[:, None] / scaled.acceleration
    x = filled(acceleration=push, slack=np.linalg.norm(push, axis=1))
    assert constraints.thrust_rate(LAYOUT, scaled).violation(x) <= 1e-12


def test_line_of_sight_is_seen_from_the_target():
    cone, apex = Cone(0.5, (0.6, 0.0, 0.8)), np.array([0.2, -0.1, 0.05])
    rows = np.vstack([np.sin(cone.angle) * cone.direction, np.cos(cone.angle) * cone.across])
    scaled = replace(SCALED, sight=rows, sight_apex=apex)

    def seen_at(angle, layout, node):
        x = filled(layout, position=apex + 0.4 * cone.direction)
        aside = np.cos(angle) * cone.direction + np.sin(angle) * cone.across[1]
        x[layout.position[node]] = apex + 0.3 * aside
        return x

    for layout, nodes in ((LAYOUT, range(NODES - 1)), (FREE, range(NODES))):
        family = constraints.line_of_sight(layout, scaled)
        assert family.bound.size == 3 * len(nodes)
        for node in nodes:
            assert family.violation(seen_at(0.4, layout, node)) < 0.0
            assert family.violation(seen_at(0.5, layout, node)) == pytest.approx(0.0, abs=1e-12)
            outside = 0.3 * np.sin(0.1)  # the distance from the surface
            assert family.violation(seen_at(0.6, layout, node)) == pytest.approx(outside)


def test_speed_limit():
    def flying(speed):
        return filled(velocity=np.array([0.0, 0.6, -0.8]) * speed / (SCALED.acceleration * TIME))

    check(constraints.speed_limit, flying(39.0), flying(40.0), flying(41.0))


def test_dry_mass():
    def landed(mass):
        x = filled()
        x[LAYOUT.log_mass[-1]] = np.log(mass / PROBLEM.state.mass) / SCALED.kappa
        return x

    check(constraints.dry_mass, landed(1160.0), landed(LANDER.dry_mass), landed(1149.0))


def test_landing_error_and_its_limit():
    def landed(error, miss):
        x = filled(FREE, landing_error=error / SCALED.length)
        x[FREE.position[-1, :2]] = np.array([0.6, -0.8]) * miss / SCALED.length
        return x

    rows = constraints.landing_error(FREE, SCALED)
    assert rows.violation(landed(2.0, 1.9)) < 0.0
    assert rows.violation(landed(2.0, 2.0)) == pytest.approx(0.0, abs=1e-12)
    assert rows.violation(landed(2.0, 2.1)) > 0.0
    limit = constraints.landing_error_limit(FREE, SCALED)
    assert limit.violation(landed(2.9, 0.0)) < 0.0
    assert limit.violation(landed(3.0, 0.0)) == pytest.approx(0.0, abs=1e-12)
    assert limit.violation(landed(3.1, 0.0)) > 0.0


def test_start_and_landing():
    x = filled()
    x[LAYOUT.position[0]] = (PROBLEM.state.position - PROBLEM.target) / SCALED.length
    x[LAYOUT.velocity[0]] = PROBLEM.state.velocity / (SCALED.acceleration * TIME)
    assert constraints.start(LAYOUT, SCALED).violation(x) == pytest.approx(0.0, abs=1e-15)
    for index in (*LAYOUT.position[0], *LAYOUT.velocity[0], LAYOUT.log_mass[0]):
        moved = x.copy()
        moved[index] += 1e-3
        assert constraints.start(LAYOUT, SCALED).violation(moved) == pytest.approx(1e-3)
    for layout, fixed in ((LAYOUT, 6), (FREE, 4)):
        rows = constraints.landing(layout, SCALED)
        assert rows.bound.size == fixed
        arrived = PROBLEM.target_velocity / (SCALED.acceleration * TIME)
        assert rows.violation(filled(layout, velocity=arrived)) == pytest.approx(0.0, abs=1e-15)
        missed = arrived + np.array([0.0, 0.0, 0.01])
        assert rows.violation(filled(layout, velocity=missed)) == pytest.approx(0.01)


def test_motion_is_the_true_motion():
    """Node states of an integrated flight with linear thrust acceleration satisfy the equations."""
    rng = np.random.default_rng(3)
    push = rng.uniform(0.0, 4.0, (NODES, 3)) + np.array([0.0, 0.0, 1.0])
    times = np.linspace(0.0, TIME, NODES)
    # a huge exhaust velocity keeps the mass, so that thrust is mass times acceleration exactly
    light = Lander(dry_mass=1.0, max_thrust=12000.0, specific_impulse=1e9)
    steady = replace(PROBLEM, lander=light)

    def thrust(t):
        return 1200.0 * np.array([np.interp(t, times, push[:, axis]) for axis in range(3)])

    flown = integrate(steady.state, thrust, times, light, steady.gravity)
    scaled = scale_problem(steady, TIME, NODES)
    size = np.linalg.norm(push, axis=1) / scaled.acceleration
    zeta = -np.concatenate([[0.0], np.cumsum(0.5 * (size[1:] + size[:-1]) / (NODES - 1))])
    x = filled(
        position=(flown[:, :3] - steady.target) / scaled.length,
        velocity=flown[:, 3:6] / (scaled.acceleration * TIME),
        acceleration=push / scaled.acceleration,
        slack=size,
        log_mass=zeta,
    )
    rows = constraints.motion(LAYOUT, scaled)
    assert rows.violation(x) < 1e-9
    x[LAYOUT.velocity[3, 1]] += 1e-3
    assert rows.violation(x) > 1e-4


def test_numbers_go_with_time_as_declared():
    """Each family declares how its numbers go with T; scaling anew at other times must agree."""

    def scaled(time):
        return scale_problem(PROBLEM, time, NODES, np.zeros(NODES), 3.0, True)

    whole: list[Family] = [
        constraints.start,
        constraints.motion,
        constraints.landing,
        constraints.max_thrust,
        constraints.min_thrust,
        constraints.pointing,
        constraints.final_thrust_direction,
        constraints.line_of_sight,
        constraints.thrust_rate,
        constraints.glide_slope,
        constraints.speed_limit,
        constraints.dry_mass,
        constraints.landing_error_limit,
    ]
    condensed: list[Family] = [
        burnt_mass,
        landing_moments,
        constraints.max_thrust,
        constraints.final_thrust_direction,
        constraints.dry_mass,
    ]
    step = 1e-5
    for layout, families in ((FREE, whole), (CondensedLayout(NODES), condensed)):
        for family in families:
            a, b = family(layout, scaled(TIME)), family(layout, scaled(2.0 * TIME))
            np.testing.assert_allclose(b.value, a.value * 2.0**a.value_power, rtol=1e-12)
            later, sooner = (family(layout, scaled(TIME * (1.0 + s))).bound for s in (step, -step))
            rate = np.broadcast_to(a.bound_rate, a.bound.shape)
            np.testing.assert_allclose((later - sooner) / (2.0 * step), rate, rtol=1e-8, atol=1e-10)
