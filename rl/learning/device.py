"""Where torch learns: a GPU where it sees one, else the processor."""

from __future__ import annotations

from typing import Literal

import torch

DeviceChoice = Literal["auto", "cpu", "cuda"]


def choose_device(choice: DeviceChoice) -> Literal["cpu", "cuda"]:
    """The device that a choice means on this machine; "auto" takes a GPU where torch sees one.

    Raises:
        ValueError: "cuda" where torch sees no GPU.
    """
    seen = torch.cuda.is_available()
    if choice == "cuda" and not seen:
        raise ValueError("device cuda: torch sees no GPU here; pass --device cpu, or auto")
    return "cuda" if seen and choice != "cpu" else "cpu"
