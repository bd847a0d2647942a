"""How exactly torch multiplies, for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def matmul_precision(precision: str) -> Iterator[None]:
    """Let torch multiply float32 matrices so; what held before holds again afterwards, whatever happens.

    Args:
        precision: "highest" is float32; "high" and "medium" let the processor use fewer bits where it can.

    Raises:
        RuntimeError: torch knows no such precision.
    """
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision(precision)
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)
