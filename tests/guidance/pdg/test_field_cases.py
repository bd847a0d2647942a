"""Descents that users have brought and the planner once failed on; and sweeps over their kinds."""

import math
from collections.abc import Callable
from typing import cast

import numpy as np
import pytest
from field_descents import KINDS
from scipy.optimize import brentq

from guidance import Lander, PlanStatus, State, solve_pdg
from guidance.descent.certificate import Certificate
from guidance.descent.flown_path import fly_trajectory
from guidance.descent.plan import Plan
from guidance.descent.residuals import RESIDUAL_UNITS
from guidance.dynamics import integrate, propagate
from guidance.pdg.__main__ import main

ORIGIN = (0.0, 0.0, 0.0)
EDGE_CASES = {
    "mars, 28 degrees": (
        {
            "state": [310, -420, 2290, -23, 38, -68, 1905],
            "lander": Lander(1505, 13258, 200.5, 4972, math.radians(28.2)),
            "gravity": (0, 0, -3.7114),
        },
        207.335,
    ),
    "earth, 19 degrees": (
        {
            "state": [-60, -160, 480, 13, 18, 4, 1160],
            "lander": Lander(900, 15000, 180, 4500, math.radians(19)),
            "gravity": (0, 0, -9.80665),
        },
        123.383,
    ),
}


@pytest.mark.parametrize("unreachable", ["raise", "nearest"])
@pytest.mark.parametrize("name", EDGE_CASES)
def test_the_optimum_may_be_the_shortest_flight_there_is(name, unreachable):
    """The figures are those of an independent nonlinear programme."""
    given, propellant = EDGE_CASES[name]
    plan = solve_pdg(target=ORIGIN, unreachable=unreachable, **given)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.propellant == pytest.approx(propellant, abs=0.02)
    assert plan.keeps_limits
    shorter = solve_pdg(target=ORIGIN, time_of_flight=0.98 * plan.time_of_flight, throw=False, **given)
    assert not shorter.status.has_flight


@pytest.mark.parametrize(
    ("state", "lander", "propellant"),
    [
        ([0, 0, 950, 0, 0, -30, 1200], Lander(min_thrust=2500), 32.967),
        ([0, 0, 950, 0, 0, -30, 1200], Lander(min_thrust=4000), 39.006),
        ([0, 0, 950, 0, 0, -30, 1200], Lander(min_thrust=2500, pointing_limit=math.radians(60)), 34.079),
        ([0, 0, 1000, 0, 0, 0, 1200], Lander(min_thrust=2100), 35.652),
    ],
)
def test_a_vertical_flight_leaves_its_axis_where_that_is_cheaper(state, lander, propellant):
    """On the axis as a millimetre aside; 36.12 kg was once passed off as the optimum of the last."""
    plan = solve_pdg(state, ORIGIN, lander=lander)
    aside = solve_pdg([1e-3, *state[1:]], ORIGIN, lander=lander)
    assert plan.propellant == pytest.approx(propellant, abs=0.02)
    assert plan.propellant == pytest.approx(aside.propellant, rel=1e-3)
    assert plan.keeps_limits
    by_reference = solve_pdg(state, ORIGIN, lander=lander, method="casadi")
    assert by_reference.propellant == pytest.approx(propellant, rel=0.02)


def root(function: Callable[[float], float], high: float) -> float:
    """Where a function changes its sign between zero and `high`."""
    return float(cast("float", brentq(function, 0.0, high)))


def shortest_vertical_flight(start, lander, gravity):
    """[s] full thrust down, then full thrust up: exact motion that ends at rest at zero."""
    force = np.array([0.0, 0.0, lander.max_thrust])

    def height_at_rest(down):
        turned = propagate(start, -force, down, lander, gravity)
        up = root(lambda t: propagate(turned, force, t, lander, gravity).velocity[2], 200.0)
        return propagate(turned, force, up, lander, gravity).position[2], down + up

    switch = root(lambda t: height_at_rest(t)[0], 12.0)
    return height_at_rest(switch)[1]


def test_an_engine_without_throttle_has_a_closed_form():
    """Its propellant is its flow times the shortest flight; the plan takes some intervals to turn round."""
    lander, gravity = Lander(min_thrust=5000, max_thrust=5000), np.array([0.0, 0.0, -1.62])
    start = State.parse([0, 0, 950, 0, 0, -30, 1200])
    propellant = lander.max_mass_flow * shortest_vertical_flight(start, lander, gravity)
    assert propellant == pytest.approx(44.532, abs=1e-3)
    for aside in (0.0, 1e-3, 40.0):
        plan = solve_pdg([aside, 0, 950, 0, 0, -30, 1200], ORIGIN, lander=lander)
        assert plan.propellant == pytest.approx(propellant, rel=5e-3)
        assert plan.keeps_limits


@pytest.mark.parametrize("nodes", [21, 31, 61])
def test_a_long_flight_does_not_pass_under_the_ground(nodes):
    """420 km along the ground from lunar orbit: 97 m under it on 21 nodes, were they not refined."""
    plan = solve_pdg(
        [-420000, 0, 15000, 1673, 0, 0, 15200], ORIGIN, lander=Lander(7201, 45000, 311, 4500), nodes=nodes
    )
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.nodes > nodes
    assert plan.residuals.altitude <= 0.2
    assert plan.keeps_limits
    assert plan.propellant == pytest.approx(7606.5, abs=2.0)


def test_a_plan_that_no_mesh_mends_is_none(monkeypatch):
    monkeypatch.setattr("guidance.pdg.fallbacks.MOST_NODES", 100)
    plan = solve_pdg(
        [-420000, 0, 15000, 1673, 0, 0, 15200],
        ORIGIN,
        lander=Lander(7201, 45000, 311, 4500),
        nodes=31,
        throw=False,
    )
    assert plan.status is PlanStatus.LIMIT_REACHED
    assert "flown on 31 nodes the plan misses altitude by" in plan.message
    assert plan.nodes == 0


@pytest.mark.parametrize("height", [0.1, 1.0, 10.0, 100.0, 950.0])
def test_casadi_flies_hops_and_drops_on_the_axis(height):
    state = [0, 0, height, 0, 0, 0, 1200]
    reference, plan = solve_pdg(state, ORIGIN, method="casadi"), solve_pdg(state, ORIGIN)
    assert reference.method == "casadi"
    assert reference.propellant == pytest.approx(plan.propellant, rel=2e-3)
    assert reference.keeps_limits


def test_an_engine_weaker_than_the_weight_is_the_cause():
    lander = Lander(3725, 10400, 295, 1300)
    plan = solve_pdg([0, 0, 160, 0, 0, -1, 9925], ORIGIN, lander=lander, gravity=(0, 0, -9.81), throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert isinstance(plan.certificate, Certificate)
    assert plan.certificate.causes == ("maximum thrust",)


def test_the_command_prints_every_residual(capsys):
    main(["--state", "200", "100", "950", "-8", "-4", "-30", "1200"])
    out = capsys.readouterr().out
    assert [name for name in RESIDUAL_UNITS if f"{name} " not in out] == []


def complaint(given, plan: Plan) -> str:
    """What is wrong with an answer, judged by flying it and by the nonconvex reference; empty if nothing."""
    if plan.status is PlanStatus.INFEASIBLE:
        proved = plan.certificate is not None and plan.certificate.verified
        return "" if proved else f"infeasible without proof: {plan.message}"
    reference = solve_pdg(**given, method="casadi", throw=False)
    found = reference.status.has_flight and reference.keeps_limits
    if not plan.status.has_flight:
        return f"gave up: {plan.message}; casadi {reference.propellant:.3f} kg" if found else ""
    if not plan.keeps_limits:
        return f"breaks limits: {plan.residuals}"
    if found and plan.propellant > 1.006 * reference.propellant + 0.02:
        return f"dear: {plan.propellant:.3f} kg, casadi {reference.propellant:.3f} kg"
    return ""


def sweep(kind, count, seed):
    complaints, flights = {}, 0
    for k in range(count):
        given = KINDS[kind](np.random.default_rng([seed, k]))
        plan = solve_pdg(**given, throw=False)
        flights += plan.status.has_flight
        words = complaint(given, plan)
        if words:
            complaints[seed, k] = words
    assert not complaints
    assert flights > count // 3


@pytest.mark.parametrize("kind", KINDS)
def test_descents_of_each_kind(kind):
    sweep(kind, 12, 31)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_descents_of_each_kind(kind):
    sweep(kind, 100, 32)


@pytest.mark.parametrize("kind", KINDS)
def test_the_compiled_flight_of_a_plan_is_the_integrators(kind):
    """Runge-Kutta with four steps an interval against DOP853, to a millimetre over a kilometre."""
    checked = 0
    for k in range(6):
        given = KINDS[kind](np.random.default_rng([33, k]))
        plan = solve_pdg(**given, throw=False)
        if plan.status.has_flight and plan.nodes <= 61:
            problem = plan.problem
            exact = integrate(problem.state, plan.thrust_at, plan.time, problem.lander, problem.gravity)
            scale = np.repeat(
                [*np.maximum(np.abs(plan.position).max(axis=0), 1.0), problem.state.mass], [1, 1, 4, 1]
            )
            assert (np.abs(fly_trajectory(plan.trajectory, problem)[::4] - exact) / scale).max() < 1e-6
            checked += 1
    assert checked
