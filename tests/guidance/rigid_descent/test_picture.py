"""The picture of a rigid body's plan: every quantity, and every limit."""

from dataclasses import replace

import numpy as np
import pytest

from guidance import PlanStatus, solve_pdg_6dof
from guidance.rigid_body import DEFAULT_BODY
from guidance.rigid_descent.flight import no_flight
from guidance.rigid_descent.picture import draw_rigid_plan
from guidance.rigid_descent.plan import RigidPlan

START = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]
SITE = np.array([0.0, 0.0, 50.0])


@pytest.fixture(scope="module")
def plan() -> RigidPlan:
    return solve_pdg_6dof(START, SITE)


def panel(plan: RigidPlan, label: str):
    return next(axes for axes in draw_rigid_plan(plan).axes if axes.get_ylabel().startswith(label))


def test_the_picture_shows_every_quantity_with_its_limit(plan):
    labels = {axes.get_ylabel() for axes in draw_rigid_plan(plan).axes}
    assert {"body from the vertical [deg]", "rates [deg/s]", "thrust [kN]", "torque [N m]"} <= labels
    assert max(np.max(line.get_ydata()) for line in panel(plan, "body").lines) == pytest.approx(45.0)


def test_unequal_torque_limits_have_a_line_each_on_either_side(plan):
    def limits_of(drawn: RigidPlan) -> list[float]:
        lines = [line for line in panel(drawn, "torque").lines if line.get_linestyle() == "--"]
        return sorted(float(np.asarray(line.get_ydata()).flat[0]) for line in lines)

    size = DEFAULT_BODY.torque_limit[0]
    assert limits_of(plan) == [-size, size]
    body = replace(DEFAULT_BODY, torque_limit=(100.0, 200.0, 300.0))
    uneven = replace(plan, problem=replace(plan.problem, body=body))
    assert limits_of(uneven) == [-300.0, -200.0, -100.0, 100.0, 200.0, 300.0]


def test_the_title_states_the_gap_where_there_is_a_bound(plan):
    title = draw_rigid_plan(plan).get_suptitle()
    assert f"{plan.relaxation_gap:.2f} kg above the bound" in title
    assert "nan" not in draw_rigid_plan(replace(plan, point_mass=None)).get_suptitle()


def test_a_plan_without_a_flight_is_not_drawn(plan):
    with pytest.raises(ValueError, match="limit reached"):
        draw_rigid_plan(replace(plan, status=PlanStatus.LIMIT_REACHED, flight=no_flight()))
