from __future__ import annotations

import pytest
import torch

from rl.learning.device import choose_device


@pytest.mark.parametrize(
    ("choice", "seen", "device"),
    [("auto", True, "cuda"), ("auto", False, "cpu"), ("cpu", True, "cpu"), ("cuda", True, "cuda")],
)
def test_a_gpu_is_taken_where_torch_sees_one(choice, seen, device, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: seen)
    assert choose_device(choice) == device


def test_a_gpu_that_torch_does_not_see_is_refused(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match="torch sees no GPU here; pass --device cpu"):
        choose_device("cuda")
