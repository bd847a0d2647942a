import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance import PAPER_LANDER, STANDARD_GRAVITY, Lander

WRONG_NUMBERS = [math.nan, math.inf, -math.inf, "much", None]


def test_paper_lander_is_the_table_of_the_paper():
    assert PAPER_LANDER.dry_mass == 1150.0
    assert PAPER_LANDER.max_thrust == 12000.0
    assert PAPER_LANDER.specific_impulse == 325.0
    assert PAPER_LANDER.min_thrust == 0.0
    assert PAPER_LANDER.pointing_limit is None


def test_derived_values_of_the_paper_lander():
    # 325 s x 9.80665 m/s^2 by hand; 12000 N over that
    assert PAPER_LANDER.exhaust_velocity == pytest.approx(3187.16125, rel=1e-14)
    assert PAPER_LANDER.max_mass_flow == pytest.approx(3.765106017, rel=1e-9)


@given(specific_impulse=st.floats(1.0, 5000.0), max_thrust=st.floats(1.0, 1e7))
def test_full_thrust_is_mass_flow_times_exhaust_velocity(specific_impulse, max_thrust):
    lander = Lander(specific_impulse=specific_impulse, max_thrust=max_thrust)
    assert lander.max_mass_flow * lander.exhaust_velocity == pytest.approx(max_thrust, rel=1e-14)
    assert lander.exhaust_velocity / STANDARD_GRAVITY == pytest.approx(specific_impulse, rel=1e-14)


@pytest.mark.parametrize("field", ["dry_mass", "max_thrust", "specific_impulse", "min_thrust"])
@pytest.mark.parametrize("value", [*WRONG_NUMBERS, -1.0])
def test_wrong_field_is_named(field, value):
    with pytest.raises(ValueError, match=rf"^{field} must be"):
        Lander(**{field: value})


@pytest.mark.parametrize("field", ["dry_mass", "max_thrust", "specific_impulse"])
def test_zero_is_refused_where_it_makes_no_sense(field):
    with pytest.raises(ValueError, match=rf"^{field} must be greater than 0"):
        Lander(**{field: 0.0})


def test_min_thrust_above_max_thrust_is_named():
    with pytest.raises(ValueError, match=r"^min_thrust must be at most 100"):
        Lander(max_thrust=100.0, min_thrust=101.0)
    assert Lander(max_thrust=100.0, min_thrust=100.0).min_thrust == 100.0


@pytest.mark.parametrize("value", [math.nan, math.inf, "steep", 0.0, -0.1, 3.2])
def test_wrong_pointing_limit_is_named(value):
    with pytest.raises(ValueError, match=r"^pointing_limit must be"):
        Lander(pointing_limit=value)


def test_pointing_limit_may_be_any_angle_up_to_half_a_turn():
    assert Lander(pointing_limit=math.pi).pointing_limit == math.pi
    assert Lander(pointing_limit=0.1).pointing_limit == 0.1


def test_lander_is_frozen_and_compares_by_value():
    with pytest.raises(dataclasses.FrozenInstanceError):
        PAPER_LANDER.dry_mass = 1.0  # type: ignore[misc]
    assert Lander() == PAPER_LANDER
    assert dataclasses.replace(PAPER_LANDER, dry_mass=1.0) != PAPER_LANDER
