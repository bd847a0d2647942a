"""Two planners of a rigid body that share no algebra: the same optimum, and a published one."""

import math

import numpy as np
import pytest

from guidance import Lander, PlanStatus, solve_pdg, solve_pdg_6dof
from guidance.rigid_body import RigidBody, RigidState, attitude_along
from guidance.successive.solve import RigidPlanningMethod
from tests.guidance.rigid_body.rigid_cases import plan_szmuk_case

SITE = np.array([0.0, 0.0, 50.0])
START = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]


@pytest.mark.parametrize("turned", [False, True])
def test_both_methods_find_the_same_optimum_to_a_tenth_of_a_kilogramme(turned):
    """Upright at rest, and leaning with rates and a burning engine."""
    start: RigidState | list[float] = START
    if turned:
        attitude, thrust = attitude_along(np.array([0.3, -0.2, 1.0])), np.array([0.0, 0.0, 3000.0])
        rates = np.array([0.03, -0.05, 0.02])
        start = RigidState(np.array(START[:3]), np.array(START[3:6]), 1200.0, attitude, rates, thrust)
    first = solve_pdg_6dof(start, SITE)
    second = solve_pdg_6dof(start, SITE, method="casadi")
    assert (first.method, second.method) == ("successive", "casadi")
    assert second.status is PlanStatus.OPTIMAL
    assert second.keeps_limits
    assert second.residuals.landing_position < 1e-2
    assert first.propellant == pytest.approx(second.propellant, abs=0.1)
    assert first.time_of_flight == pytest.approx(second.time_of_flight, abs=0.5)
    assert 0.0 < second.relaxation_gap < 1.5


@pytest.mark.slow
def test_the_case_of_szmuk_and_acikmese_by_the_reference():
    """3.3901 time units, by an independent reproduction of AIAA 2018-0617, table 1 and 2."""
    flight = plan_szmuk_case(nodes=30, method="casadi")
    assert flight.time_of_flight == pytest.approx(3.3901, abs=0.01)
    assert flight.propellant == pytest.approx(0.1427, abs=1e-3)


@pytest.mark.parametrize("method", ["casadi", "successive"])
def test_an_agile_body_flies_the_point_mass_case_of_acikmese_and_ploen(method: RigidPlanningMethod):
    """The Mars case of JGCD 30(5), 2007, without glide slope and with a free time of flight.

    Published: 387.9 kg in 72 s. The body ends upright, and its thrust is linear between 61 nodes where the
    optimum's jumps: it burns more, by less than 1.2 %.
    """
    cant = math.cos(math.radians(27.0))
    full = 6.0 * 3100.0 * cant
    lander = Lander(
        dry_mass=1400.0, max_thrust=0.8 * full, min_thrust=0.3 * full, specific_impulse=225.0 * cant
    )
    start, gravity = [2000.0, 0.0, 1500.0, 100.0, 0.0, -75.0, 1905.0], (0.0, 0.0, -3.7114)
    point = solve_pdg(start, (0.0, 0.0, 0.0), lander=lander, gravity=gravity)
    agile = RigidBody(
        lander,
        (1500.0, 1500.0, 1500.0),
        1905.0,
        torque_limit=(2000.0, 2000.0, 2000.0),
        rate_limit=1.0,
        tilt_limit=math.pi,
        engine_lag=0.0,
    )
    plan = solve_pdg_6dof(
        start, (0.0, 0.0, 0.0), agile, gravity=gravity, free_attitude=True, nodes=61, method=method
    )
    assert plan.keeps_limits
    assert point.propellant == pytest.approx(387.9, rel=0.01)
    assert point.propellant < plan.propellant < 1.012 * point.propellant


def test_the_reference_says_what_a_flown_plan_breaks():
    """The point mass flies it; five nodes are too few for the tilt to hold between them too."""
    aside = [400.0, 0.0, 300.0, 20.0, 0.0, -5.0, 1200.0]
    plan = solve_pdg_6dof(aside, SITE, nodes=5, method="casadi", throw=False)
    assert plan.point_mass is not None
    assert plan.point_mass.status is PlanStatus.OPTIMAL
    assert plan.status is PlanStatus.LIMIT_REACHED
    assert plan.nodes == 0
    assert plan.message.startswith("flown, the plan leaves its limits: tilt")


def test_a_method_that_does_not_exist_is_named():
    with pytest.raises(ValueError, match="collocation"):
        solve_pdg_6dof(START, SITE, method="collocation")  # type: ignore[arg-type]
