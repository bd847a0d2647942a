"""The golden section: a bracket about a minimum that shrinks by the golden ratio at each new value.

Two inner points divide the bracket so that one of them stays an inner point of what is kept: every step asks
for one value. The caller keeps the values; these functions run in Python and in kernels alike.
Source: Kiefer, Proc. AMS 4(3), 1953.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from guidance.kernel import compile_kernel

_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)


class Bracket(NamedTuple):
    """Four rising points; a unimodal function has its minimum between the outer ones.

    Attributes:
        low: lower end.
        first: lower inner point.
        second: upper inner point.
        high: upper end.
    """

    low: float
    first: float
    second: float
    high: float


@compile_kernel
def divide(low: float, high: float) -> Bracket:
    """Two inner points of [low, high], high above low."""
    return Bracket(low, high - _RATIO * (high - low), low + _RATIO * (high - low), high)


@compile_kernel
def keep_lower(bracket: Bracket) -> Bracket:
    """What is left where the first inner point has the lower value; only `first` is new."""
    low, high = bracket.low, bracket.second
    return Bracket(low, high - _RATIO * (high - low), bracket.first, high)


@compile_kernel
def keep_upper(bracket: Bracket) -> Bracket:
    """What is left where the second inner point has the lower value; only `second` is new."""
    low, high = bracket.first, bracket.high
    return Bracket(low, bracket.second, low + _RATIO * (high - low), high)


@compile_kernel
def keep_either(bracket: Bracket, lower: bool) -> Bracket:
    """`keep_lower` or `keep_upper`, without a branch: for loops that run on vector units."""
    low = bracket.low if lower else bracket.first
    high = bracket.second if lower else bracket.high
    kept = bracket.first if lower else bracket.second
    step = _RATIO * (high - low)
    new = high - step if lower else low + step
    return Bracket(low, new if lower else kept, kept if lower else new, high)
