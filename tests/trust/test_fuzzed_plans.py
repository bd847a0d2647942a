"""Any state and target: a plan that flies, or a labelled error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import guidance
from guidance.descent.plan import Plan, PlanStatus

ODD = st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 1e-12, 1e6, -1e6])
SENSIBLE = st.tuples(
    *(st.floats(-600.0, 600.0),) * 2,
    st.floats(30.0, 1500.0),
    *(st.floats(-60.0, 60.0),) * 3,
    st.floats(1140.0, 1300.0),
).map(list)


def assert_flies(plan: Plan) -> None:
    """Flown through the true motion, the plan lands and keeps every limit."""
    assert plan.status is PlanStatus.OPTIMAL
    check = plan.residuals
    assert np.abs(plan.velocity[-1] - plan.problem.target_velocity).max() < 1e-3
    scale = max(1.0, float(np.abs(plan.position).max()) / 1000.0, float(np.abs(plan.velocity).max()) / 100.0)
    assert check.landing_position < 1.0 * scale
    assert check.landing_velocity < 0.5 * scale
    assert check.thrust_above < 60.0
    assert check.propellant < 0.5
    assert check.altitude < 1.0 * scale
    assert check.mass < 0.5


@settings(max_examples=25)
@given(
    data=st.data(),
    state=SENSIBLE,
    target=st.tuples(*(st.floats(-500.0, 500.0),) * 2, st.just(50.0)).map(list),
    arrival=st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(*(st.floats(-30.0, 30.0),) * 3)).map(list),
)
def test_any_state_and_target(
    data: st.DataObject, state: list[float], target: list[float], arrival: list[float]
) -> None:
    for numbers in (state, target, arrival):
        if data.draw(st.integers(0, 3)) == 0:
            numbers[data.draw(st.integers(0, len(numbers) - 1))] = data.draw(ODD)
    try:
        plan = guidance.solve_pdg(state, target, target_velocity=arrival, throw=False)
    except ValueError:
        numbers = np.abs([*state, *target, *arrival])
        outside = not np.isfinite(numbers).all() or numbers.max() > 1e9
        assert outside or state[6] <= 1150.0 or state[2] < target[2]
        return
    if plan.status.has_flight:
        assert_flies(plan)
        return
    assert plan.message
    if plan.status is PlanStatus.INFEASIBLE:
        assert plan.certificate is not None


@pytest.mark.parametrize("huge", [1e10, 1e300, -1e300])
@pytest.mark.parametrize("place", range(7))
def test_numbers_that_overflow_are_refused(huge: float, place: int) -> None:
    state = [0.0, 0.0, 900.0, 0.0, 0.0, -20.0, 1200.0]
    state[place] = huge
    with pytest.raises(ValueError, match=r"state|mass"):
        guidance.solve_pdg(state, (0.0, 0.0, 50.0))
    with pytest.raises(ValueError, match=r"target|altitude"):
        guidance.solve_pdg((0, 0, 900, 0, 0, -20, 1200), [huge if k == place % 3 else 0.0 for k in range(3)])


@settings(max_examples=25)
@given(
    state=st.one_of(st.lists(st.floats(), max_size=9), st.text(max_size=7), st.none(), st.integers()),
    target=st.one_of(st.lists(st.floats(), max_size=4), st.text(max_size=3), st.none()),
)
def test_any_other_argument_is_refused_by_name(state: object, target: object) -> None:
    with pytest.raises(ValueError, match=r"state|target|mass"):
        guidance.solve_pdg(state, target)  # pyright: ignore[reportArgumentType, reportCallIssue]
