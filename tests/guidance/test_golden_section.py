import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.golden_section import divide, keep_lower, keep_upper

ENDS = st.floats(-1e3, 1e3)
WIDTHS = st.floats(1e-3, 1e3)
RATIO = (math.sqrt(5.0) - 1.0) / 2.0


def minimise(function, low, high, steps):
    """The last bracket of a search and the points at which the function was asked."""
    bracket = divide(low, high)
    asked = [bracket.first, bracket.second]
    for _ in range(steps):
        if function(bracket.first) < function(bracket.second):
            bracket = keep_lower(bracket)
            asked.append(bracket.first)
        else:
            bracket = keep_upper(bracket)
            asked.append(bracket.second)
    return bracket, asked


@given(low=ENDS, width=WIDTHS, share=st.floats(0.0, 1.0))
def test_the_minimum_stays_in_a_bracket_that_shrinks_by_the_golden_ratio(low, width, share):
    lowest, rounding = low + share * width, 1e-9 * (abs(low) + width)
    bracket, _ = minimise(lambda x: abs(x - lowest), low, low + width, 12)
    assert bracket.low - rounding <= lowest <= bracket.high + rounding
    assert bracket.high - bracket.low == pytest.approx(width * RATIO**12, abs=rounding)


@given(low=ENDS, width=WIDTHS, lower=st.lists(st.booleans(), max_size=20))
def test_each_step_keeps_one_inner_point_and_divides_the_rest_alike(low, width, lower):
    bracket = divide(low, low + width)
    for keeps_lower in lower:
        before = bracket
        bracket = keep_lower(bracket) if keeps_lower else keep_upper(bracket)
        if keeps_lower:
            assert (bracket.low, bracket.second, bracket.high) == (before.low, before.first, before.second)
        else:
            assert (bracket.low, bracket.first, bracket.high) == (before.first, before.second, before.high)
        span, rounding = bracket.high - bracket.low, 1e-9 * (abs(low) + width)
        assert bracket.first - bracket.low == pytest.approx((1.0 - RATIO) * span, abs=rounding)
        assert bracket.second - bracket.low == pytest.approx(RATIO * span, abs=rounding)


def test_it_finds_a_minimum_known_in_closed_form():
    bracket, asked = minimise(lambda x: math.cosh(x - 0.7) + 0.3 * x, -1.0, 3.0, 30)
    assert bracket.first == pytest.approx(0.7 - math.asinh(0.3), abs=4.0 * RATIO**30)
    assert len(set(asked)) == 32  # one new point a step
