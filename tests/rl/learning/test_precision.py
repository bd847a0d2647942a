"""torch's precision is put back."""

import pytest
import torch

from rl.learning.precision import matmul_precision


@pytest.mark.parametrize("before", ["highest", "medium"])
def test_the_precision_that_held_before_holds_again_even_after_an_error(before: str) -> None:
    def now() -> str:
        return torch.get_float32_matmul_precision()

    with matmul_precision(before):
        with matmul_precision("high"):
            assert now() == "high"
        assert now() == before
        with pytest.raises(KeyError), matmul_precision("high"):
            raise KeyError
        assert now() == before
