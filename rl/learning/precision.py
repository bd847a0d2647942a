"""How exactly torch multiplies, for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def matmul_precision(precision: str) -> Iterator[None]:
    """Let torch multiply float32 matrices so; what held before holds again afterwards, whatever happens.

    Args:
        precision: "highest" is float32; with "medium" the processor multiplies in bfloat16 where it
            can. A GPU multiplies in TF32 with "high" and with "medium", and cuDNN's LSTM there in any case
            (`torch.backends.cudnn.rnn.fp32_precision`).

    Raises:
        RuntimeError: torch knows no such precision.
    """
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision(precision)
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)
