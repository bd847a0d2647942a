"""Where a result comes from: enough to make it again."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from hda.dtm_library import FORMAT_VERSION, Ground
from studies.monte_carlo import Study

_PACKAGES = (
    "casadi",
    "clarabel",
    "control",
    "cvxpy",
    "numba",
    "numpy",
    "scipy",
    "stable-baselines3",
    "torch",
)


def git_commit() -> str | None:
    """Commit of the source tree, with `+changes` if it differs; None outside a checkout."""
    root = Path(__file__).resolve().parent.parent
    try:
        commit = _git(root, "rev-parse", "HEAD")
        return commit + ("+changes" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(root: Path, *arguments: str) -> str:
    run = subprocess.run(
        ["git", *arguments], cwd=root, capture_output=True, text=True, check=True, timeout=20
    )
    return run.stdout.strip()


def describe_study(study: Study) -> dict[str, object]:
    """Versions, parameters, seeds, source commit and command of a study."""
    ground = Ground(study.preset.terrain, study.preset.criteria)
    versions = {name: metadata.version(name) for name in ("lunar-hda", *_PACKAGES)}
    return {
        "command": " ".join(sys.argv),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "git_commit": git_commit(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "versions": versions,
        "study": {
            "episodes": study.episodes,
            "policies": list(study.policies),
            "study_seed": study.study_seed,
            "split": study.split,
        },
        "preset": asdict(study.preset),
        "terrain_key": ground.key,
        "terrain_format": FORMAT_VERSION,
    }


def write_provenance(path: Path, study: Study) -> None:
    """Write `describe_study` as JSON."""
    path.write_text(json.dumps(describe_study(study), indent=1, sort_keys=True, default=str) + "\n")
