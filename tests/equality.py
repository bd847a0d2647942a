"""Whether two values are the same bit for bit, whatever they are made of."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def parts(value: Any) -> Iterator[Any]:
    """What a value directly holds."""
    if isinstance(value, Mapping):
        yield from value.keys()
        yield from value.values()
    elif isinstance(value, list | tuple | set | frozenset):
        yield from value
    elif is_dataclass(value) and not isinstance(value, type):
        yield from (getattr(value, field.name) for field in fields(value))
    elif hasattr(value, "__dict__") and not isinstance(value, type | np.ndarray):
        yield from vars(value).values()


def same(first: Any, second: Any) -> bool:
    """Equal types and equal contents; NaN equals NaN."""
    if first is second:
        return True
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and first.shape == second.shape and same_bytes(first, second)
    if isinstance(first, np.random.Generator):
        return same(first.bit_generator.state, second.bit_generator.state)
    if isinstance(first, float):
        return first == second or (first != first and second != second)
    if hasattr(first, "detach"):  # a tensor
        return same(first.detach().cpu().numpy(), second.detach().cpu().numpy())
    one, other = list(parts(first)), list(parts(second))
    if not one and not other:
        return bool(first == second)
    return len(one) == len(other) and all(same(a, b) for a, b in zip(one, other, strict=True))


def same_bytes(first: np.ndarray, second: np.ndarray) -> bool:
    return np.ascontiguousarray(first).tobytes() == np.ascontiguousarray(second).tobytes()
