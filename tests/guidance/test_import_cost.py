import json
import subprocess
import sys

import pytest

REPORT = """
import json, sys
import guidance
before = sorted(sys.modules)
{use}
print(json.dumps([before, sorted(sys.modules)]))
"""


def import_guidance(use: str = "") -> tuple[set[str], set[str]]:
    """In a fresh process: modules after the import, and after `use`."""
    answer = subprocess.run(
        [sys.executable, "-c", REPORT.format(use=use)], capture_output=True, text=True, check=True
    )
    before, after = json.loads(answer.stdout)
    return set(before), set(after)


def test_import_is_light():
    """What it costs stands among the ratios of `python -m studies.bench`."""
    modules, _ = import_guidance()
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
    _, modules = import_guidance(use)
    assert "guidance.lander" in modules or "guidance.state" in modules
    assert not {"numba", "scipy", "torch"} & modules


def test_every_public_name_is_found_and_others_are_not():
    import guidance

    assert {name for name in guidance.__all__ if getattr(guidance, name) is not None} == set(guidance.__all__)
    assert set(dir(guidance)) == set(guidance.__all__)
    with pytest.raises(AttributeError, match=r"'guidance' has no attribute 'lunar'"):
        _ = guidance.lunar  # type: ignore[attr-defined]


def test_no_first_call_waits_for_what_its_import_could_load():
    """Nothing is imported or compiled by the first plan of a process.

    Counted is a kernel that Python calls: those that it calls come with it from the cache, uncounted.
    """
    use = """
from guidance import solve_pdg
from guidance.flight_time.primer_vector import _seek
ready, loaded = set(sys.modules), len(_seek.signatures)
solve_pdg((250, 100, 950, -8, -4, -30, 1200), (0, 0, 50))
assert len(_seek.signatures) == loaded == 1
sys.modules.update(dict.fromkeys(f"late {name}" for name in set(sys.modules) - ready))
"""
    _, modules = import_guidance(use)
    assert "guidance.pdg.prepared" in modules
    assert not {name for name in modules if name.startswith("late ")}
