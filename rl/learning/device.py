"""Where torch learns: on the processor, or on a GPU."""

from __future__ import annotations

from typing import Literal

import torch

DeviceChoice = Literal["auto", "cpu", "cuda"]


def choose_device(choice: DeviceChoice, with_memory: bool) -> Literal["cpu", "cuda"]:
    """The device that a choice means on this machine.

    Args:
        choice: "auto" takes a GPU where torch sees one and the agent has memory. Without memory the networks
            are so small that a GPU hardly hurries them (docs/results/agents.md).
        with_memory: the agent has memory (`rl.settings.WITH_MEMORY`).

    Raises:
        ValueError: "cuda" where torch sees no GPU.
    """
    seen = torch.cuda.is_available()
    if choice == "cuda" and not seen:
        raise ValueError("device cuda: torch sees no GPU here; pass --device cpu, or auto")
    taken = choice == "cuda" or (choice == "auto" and seen and with_memory)
    return "cuda" if taken else "cpu"
