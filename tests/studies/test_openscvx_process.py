"""The interpreter of OpenSCvx: what it is asked, what is refused, and what depends on the wing that asks."""

import platform
import sys
from pathlib import Path

import numpy as np
import pytest

from studies.campaign.provenance import digest_files, identify_run
from studies.peers import openscvx_process
from studies.peers.openscvx_process import (
    PEERS_WING,
    demand_openscvx,
    open_worker,
    openscvx_version,
    peer_versions,
)
from studies.rigid_plans import RigidPlans, study_rigid_plans
from studies.rigid_plans.openscvx_body import (
    SERVE_BODY,
    ask_openscvx,
)
from studies.rigid_plans.peer_answers import HELD
from studies.rigid_plans.peer_problems import (
    shared_example,
)
from studies.timing import command as timing_command
from studies.timing.command import Timing, identify_timing

HERE = Path(sys.executable)
OPENSCVX = openscvx_version(HERE)


@pytest.mark.skipif(OPENSCVX is not None, reason="OpenSCvx is installed")
def test_the_worker_says_what_it_lacks() -> None:
    """The real one, in an interpreter without the package."""
    with open_worker(HERE, SERVE_BODY) as worker:
        answer = ask_openscvx(worker, shared_example(), HELD)
    assert answer.status == "failed: ModuleNotFoundError: No module named 'openscvx'"
    assert answer.processor > 0.0


def test_a_worker_that_ends_is_told() -> None:
    with open_worker(HERE, "import sys; sys.exit('it was too much')") as worker:
        answer = ask_openscvx(worker, shared_example(), HELD)
    assert answer.status == "failed: the worker ended: it was too much"


def test_an_interpreter_without_the_package_is_named_before_a_folder_is_made(tmp_path: Path) -> None:
    out = tmp_path / "plans"
    with pytest.raises(OSError, match="absent"):
        study_rigid_plans(RigidPlans(openscvx_python=tmp_path / "absent", out=out))
    if OPENSCVX is None:
        with pytest.raises(ValueError, match="has no openscvx"):
            study_rigid_plans(RigidPlans(openscvx_python=HERE, out=out))
    assert not out.exists()


def test_what_names_no_versions_is_no_interpreter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Programmes that answer nothing, something else, and too late."""
    monkeypatch.setattr(openscvx_process, "_PATIENCE", 0.5)
    for name, does in (
        ("silent", "exit 0"),
        ("loud", "echo 1"),
        ("words", "echo '{\"a\": 1}'"),
        ("late", "exec sleep 9"),
    ):
        stranger = tmp_path / name
        stranger.write_text(f"#!/bin/sh\n{does}\n")
        stranger.chmod(0o755)
        assert peer_versions(stranger) == {}
        with pytest.raises(ValueError, match=r"openscvx_python: .* has no Python"):
            demand_openscvx(stranger)


def test_an_interpreter_names_its_python_and_packages() -> None:
    found = peer_versions(HERE)
    assert found["python"] == platform.python_version()
    assert found["numpy"] == np.__version__


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"starts": 3, "peer_starts": 1}, "starts must be at least 4"),
        ({"starts": 9, "peer_starts": 7}, "at most 6"),
    ],
)
def test_no_more_starts_are_asked_of_the_peer_than_were_not_chosen_on(asked: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        RigidPlans(openscvx_python=HERE, **asked)
    RigidPlans(starts=1)  # where it is not asked the default does not matter


def test_a_wing_beside_changes_the_identity_of_a_run(tmp_path: Path) -> None:
    """One byte of it does; without one the digest is that of the wing alone."""
    wing, beside = tmp_path / "wing", tmp_path / "beside"
    for folder in (wing, beside):
        folder.mkdir()
        (folder / "a.py").write_text("1")
    alone = identify_run(wing, {})["wing"]
    both = identify_run(wing, {}, beside=(beside,))["wing"]
    (beside / "a.py").write_text("2")
    changed = identify_run(wing, {}, beside=(beside,))["wing"]
    assert alone == digest_files(wing)
    assert len({alone, both, changed}) == 3
    assert (PEERS_WING / "openscvx_process.py").is_file()
    timing = identify_timing(Timing(), {})["wing"]
    assert timing == digest_files(timing_command._WING, PEERS_WING)
