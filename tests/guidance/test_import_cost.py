import json
import subprocess
import sys

import pytest

REPORT = """
import json, sys, time
start = time.perf_counter()
import guidance
seconds = time.perf_counter() - start
before = sorted(sys.modules)
{use}
print(json.dumps([seconds, before, sorted(sys.modules)]))
"""


def import_guidance(use: str = "") -> tuple[float, set[str], set[str]]:
    """In a fresh process: seconds, modules after the import, modules after `use`."""
    answer = subprocess.run(
        [sys.executable, "-c", REPORT.format(use=use)], capture_output=True, text=True, check=True
    )
    seconds, before, after = json.loads(answer.stdout)
    return seconds, set(before), set(after)


def test_import_is_quick_and_light():
    seconds, modules, _ = min((import_guidance() for _ in range(3)), key=lambda report: report[0])
    assert seconds < 0.5
    heavy = {
        "numba",
        "scipy",
        "torch",
        "cvxpy",
        "casadi",
        "clarabel",
        "control",
        "matplotlib",
        "pandas",
        "gymnasium",
    }
    assert "guidance" in modules
    assert not heavy & modules


@pytest.mark.parametrize("use", ["guidance.Lander()", "guidance.State([0, 0, 0], [0, 0, 0], 1)"])
def test_a_vehicle_needs_no_compiler(use):
    _, _, modules = import_guidance(use)
    assert "guidance.lander" in modules or "guidance.state" in modules
    assert not {"numba", "scipy", "torch"} & modules


def test_every_public_name_is_found_and_others_are_not():
    import guidance

    assert {name for name in guidance.__all__ if getattr(guidance, name) is not None} == set(guidance.__all__)
    assert set(dir(guidance)) == set(guidance.__all__)
    with pytest.raises(AttributeError, match=r"'guidance' has no attribute 'lunar'"):
        _ = guidance.lunar  # type: ignore[attr-defined]
