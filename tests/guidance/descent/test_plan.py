"""A Plan as a value: its thrust in time, its arrays, and residuals that notice a doctored plan."""

import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from descents import FEASIBLE, TARGET, arguments

import guidance
from guidance import Limits, Plan, PlanStatus
from guidance.descent.picture import draw_plan, save_plan_figure

START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]


@pytest.fixture(scope="module")
def plan():
    return guidance.solve_pdg(START, TARGET, method="convex")


@pytest.fixture(scope="module")
def nothing(plan):
    return Plan(PlanStatus.INFEASIBLE, plan.problem, "convex")


def test_shapes_and_ends(plan):
    n = plan.nodes
    assert plan.time.shape == plan.mass.shape == (n,)
    assert plan.position.shape == plan.velocity.shape == plan.thrust.shape == (n, 3)
    assert plan.time[0] == 0.0
    assert plan.time[-1] == plan.time_of_flight
    np.testing.assert_allclose(np.diff(plan.time), plan.time_of_flight / (n - 1))
    assert plan.position[0].tolist() == START[:3]
    assert plan.velocity[0].tolist() == START[3:6]
    assert plan.mass[0] == START[6]
    np.testing.assert_allclose(plan.position[-1], TARGET, atol=1e-4)
    np.testing.assert_allclose(plan.velocity[-1], 0.0, atol=1e-5)
    assert plan.propellant == pytest.approx(START[6] - plan.mass[-1])
    assert plan.landing_error < 1e-4


def test_frozen_and_picklable(plan):
    with pytest.raises(FrozenInstanceError):
        plan.status = PlanStatus.NEAREST
    with pytest.raises(ValueError, match="read-only"):
        plan.position[0, 0] = 1.0
    again = pickle.loads(pickle.dumps(plan))
    assert again.thrust.tobytes() == plan.thrust.tobytes()


def test_thrust_at_nodes_between_and_outside(plan):
    np.testing.assert_allclose(plan.thrust_at(plan.time), plan.thrust, atol=1e-6)
    assert plan.thrust_at(3.0).shape == (3,)
    middle = 0.5 * (plan.time[40] + plan.time[41])
    acceleration = plan.thrust / plan.mass[:, None]
    mean = 0.5 * (acceleration[40] + acceleration[41])
    mass = np.linalg.norm(plan.thrust_at(middle)) / np.linalg.norm(mean)
    assert plan.mass[41] < mass < plan.mass[40]
    np.testing.assert_allclose(plan.thrust_at(-1.0), plan.thrust[0])
    assert plan.thrust_at(plan.time_of_flight + 0.01).tolist() == [0.0, 0.0, 0.0]


def test_without_a_flight(nothing):
    assert nothing.nodes == 0
    assert np.isnan([nothing.time_of_flight, nothing.propellant, nothing.landing_error]).all()
    assert not nothing.status.has_flight
    with pytest.raises(ValueError, match="infeasible"):
        nothing.thrust_at(0.0)
    with pytest.raises(ValueError, match="infeasible"):
        _ = nothing.residuals
    with pytest.raises(ValueError, match="infeasible"):
        draw_plan(nothing)


def doctored(plan, **arrays):
    return replace(plan, trajectory=replace(plan.trajectory, **arrays))


def test_residuals_notice_what_was_doctored(plan):
    assert plan.residuals.position < 0.01
    assert plan.residuals.velocity < 0.01
    assert plan.residuals.thrust_above < 12.0
    assert plan.residuals.altitude < 0.01
    weak = doctored(plan, thrust=0.99 * plan.thrust)
    assert weak.residuals.position > 0.5
    assert weak.residuals.landing_velocity > 0.1
    strong = doctored(plan, thrust=1.01 * plan.thrust)
    assert strong.residuals.thrust_above == pytest.approx(120.0, abs=15.0)
    assert strong.residuals.velocity > 0.1
    shifted = doctored(plan, position=plan.position + np.array([0.0, 3.0, 0.0]))
    assert shifted.residuals.position == pytest.approx(3.0, abs=0.01)
    heavy = doctored(plan, mass=plan.mass + 2.0)
    assert heavy.residuals.mass == pytest.approx(2.0, abs=0.2)


def test_residuals_measure_the_limits_of_the_problem(plan):
    def judged(**changes):
        return replace(plan, problem=replace(plan.problem, **changes)).residuals

    fastest = np.linalg.norm(plan.velocity, axis=1).max()
    assert judged(limits=Limits(speed=fastest - 1.0)).speed == pytest.approx(1.0, abs=0.01)
    assert judged(limits=Limits(glide_slope=0.05)).glide_slope > 10.0
    assert judged(target=TARGET + np.array([0.0, 0.0, 7.0])).altitude == pytest.approx(7.0, abs=0.01)
    lander = plan.problem.lander
    assert judged(lander=replace(lander, pointing_limit=0.1)).pointing > 0.05
    assert judged(lander=replace(lander, min_thrust=500.0)).thrust_below == pytest.approx(500.0, abs=1.0)
    assert judged(lander=replace(lander, dry_mass=1190.0)).propellant > 10.0


def test_true_mass_follows_the_plan_on_a_long_burn():
    """Mars: a fifth of the mass is burnt, and the engine never stops."""
    case = FEASIBLE[-1]
    plan = guidance.solve_pdg(**arguments(case))
    assert plan.residuals.mass < 0.1
    assert plan.residuals.thrust_below < 1e-3 * case["lander"]["min_thrust"]


def test_picture(plan, tmp_path):
    save_plan_figure(plan, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    figure = draw_plan(plan)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[:3] == ["path", "velocity", "thrust"]
    line = figure.axes[3].lines[0]
    np.testing.assert_allclose(np.asarray(line.get_ydata()), plan.mass)
