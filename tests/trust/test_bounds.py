"""Every kernel once with bounds checks: an index outside an array is an error there, elsewhere rubbish."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FLIGHT = """
import numba
import numpy as np
from numba.core import config

assert config.BOUNDSCHECK == 1
import hda
from guidance.kernel import cache_folder


@numba.njit
def beyond(values):
    return values[values.size]


try:
    beyond(np.zeros(3))
except IndexError:
    pass
else:
    raise AssertionError("bounds are not checked")

for policy in POLICIES:
    for episode in range(2):
        record = hda.fly(hda.make_policy(policy), hda.sample_scenario("paper", 0, episode, "train"))
        assert record.outcome is not None
        print(policy, episode, record.outcome.touchdown_speed)
edge = np.full((23, 31), 3.0)
edge[0, 0] = edge[-1, -1] = np.nan
assert hda.assess_safety(edge).deterministic[11, 15]
print("kept", sum(1 for _ in cache_folder().rglob("*.nbi")))
"""
POLICIES = ("no-divert", "nearest-safe", "hazard-aware", "hazard-aware+zem-zev", "oracle", "oracle-fuel")


@pytest.mark.slow
def test_kernels_stay_within_their_arrays(tmp_path: Path) -> None:
    """Compiled anew, for code in the cache has no checks."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", FLIGHT.replace("POLICIES", repr(POLICIES))],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_BOUNDSCHECK": "1", "LUNAR_HDA_CACHE": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=1500,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-3000:]
    assert int(run.stdout.split()[-1]) >= 15
