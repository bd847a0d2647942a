"""Checks at the public doors: each failure is a ValueError that names the argument."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array


def finite_vector(name: str, value: ArrayLike, size: int) -> Array:
    """Return `value` as a float64 array of shape (size,); raise ValueError naming `name` otherwise."""
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be {size} numbers, got {value!r}") from error
    if vector.shape != (size,):
        raise ValueError(f"{name} must have shape ({size},), got {vector.shape}")
    if not all(map(math.isfinite, vector.tolist())):
        raise ValueError(f"{name} must be finite, got {vector.tolist()}")
    return vector


def finite_number(
    name: str,
    value: float,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
) -> float:
    """Return `value` as a float in (above, inf) and [at_least, at_most]; raise ValueError naming `name`."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be a number, got {value!r}") from error
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    if number <= above:
        raise ValueError(f"{name} must be greater than {above:g}, got {number:g}")
    if number < at_least:
        raise ValueError(f"{name} must be at least {at_least:g}, got {number:g}")
    if number > at_most:
        raise ValueError(f"{name} must be at most {at_most:g}, got {number:g}")
    return number


def whole_number(name: str, value: int, at_least: int) -> int:
    """Return `value` as an int of at least so much; raise ValueError naming `name` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < at_least:
        raise ValueError(f"{name} must be an integer of at least {at_least}, got {value!r}")
    return int(value)


def unknown_name(kind: str, name: object, valid: Iterable[str]) -> str:
    """Say that a name is unknown, with the nearest valid names first."""
    names = sorted(valid)
    near = difflib.get_close_matches(str(name), names, n=3, cutoff=0.4)
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    return f"unknown {kind} {name!r}{hint} (valid: {', '.join(names)})"
