from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_example_learns_its_task():
    done = subprocess.run(
        [sys.executable, "-m", "examples.memory_task"],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    before, after = (float(value) for value in re.findall(r": (-?\d+\.\d+)$", done.stdout, re.MULTILINE))
    assert abs(before) < 0.3
    assert after > 0.8
