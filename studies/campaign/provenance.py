"""Where a result comes from: enough to make it again."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import platform
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from hda.ground.library import FORMAT_VERSION, Ground
from hda.ground.own_terrain import OwnTerrain
from hda.task.presets import Preset
from studies.campaign.monte_carlo import Study, chunk_episodes

_PACKAGES = (
    "casadi",
    "clarabel",
    "control",
    "cvxpy",
    "numba",
    "numpy",
    "scipy",
)
CHECKSUMS = "checksums.sha256"
"""Beside the products of a study: the SHA-256 of each, as `sha256sum --check` reads them."""
_PRODUCT_FOLDERS = ("figures", "shards", "trajectories")

_TRAINING_PACKAGES = ("sb3-contrib", "stable-baselines3", "torch")
"""Named in the provenance alone: they are optional, and no row depends on them."""


def git_commit() -> str | None:
    """Commit of the source tree, with `+changes` if it differs; None outside a checkout."""
    root = Path(__file__).resolve().parents[2]
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


def identify_study(study: Study) -> dict[str, Any]:
    """All that decides the bytes of a study's rows: parameters, versions, digests of the sources."""
    ground, preset = Ground(study.preset.terrain, study.preset.criteria), asdict(study.preset)
    if isinstance(study.preset.terrain, OwnTerrain):
        preset["terrain"] = study.preset.terrain.description()
    return {
        "study": {
            "episodes": study.episodes,
            "policies": list(study.policies),
            "study_seed": study.study_seed,
            "split": study.split,
            "paths": list(study.paths),
            "chunk_episodes": chunk_episodes(study.episodes),
        },
        "preset": preset,
        "terrain_key": ground.key,
        "terrain_format": FORMAT_VERSION,
        **identify_software(study.paths),
    }


def restore_study(told: dict[str, Any], preset: Preset) -> Study:
    """The study of `identify_study`'s field `study`, on a preset.

    Raises:
        KeyError, TypeError, ValueError: fields are missing or damaged.
    """
    return Study(
        preset,
        tuple(map(str, told["policies"])),
        int(told["episodes"]),
        int(told["study_seed"]),
        str(told["split"]),
        tuple(map(str, told["paths"])),
    )


def identify_software(paths: tuple[str, ...] = ()) -> dict[str, Any]:
    """What must be the same in every process that flies episodes of a study.

    Args:
        paths: paths `package.module:Name` of policies that are not registered.
    """
    return {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "versions": {name: metadata.version(name) for name in ("lunar-hda", *_PACKAGES)},
        "sources": digest_sources(paths),
    }


def identify_run(
    wing: Path, decided: dict[str, Any], paths: tuple[str, ...] = (), beside: tuple[Path, ...] = ()
) -> dict[str, Any]:
    """All that decides the rows of a run that is no single study: options, versions, digests of the sources.

    Args:
        wing: folder of the study's own code, which works out the rows.
        decided: the options that decide a row, whichever rows are asked for.
        paths: paths `package.module:Name` of policies that are not registered.
        beside: folders of other wings of studies that the rows depend on.
    """
    return {"options": decided, **identify_software(paths), "wing": digest_files(wing, *beside)}


def digest_sources(paths: tuple[str, ...]) -> dict[str, str]:
    """Package -> digest of every file in it, weights included; also the module of a policy given by path."""
    root = Path(__file__).resolve().parents[1]
    digests = {name: digest_files(root.parent / name) for name in ("guidance", "hda", "rl")}
    digests["studies"] = digest_files(root / "campaign" / "monte_carlo.py")
    for path in paths:
        module = path.partition(":")[0]
        found = importlib.util.find_spec(module)
        if found is not None and found.origin is not None:
            digests[module] = digest_files(Path(found.origin))
    return digests


def digest_files(*places: Path) -> str:
    """Digest of files, and of every file in folders; compiled ones left out."""
    total = hashlib.sha256()
    for place in places:
        files = [place] if place.is_file() else sorted(p for p in place.rglob("*") if p.is_file())
        for file in files:
            if "__pycache__" not in file.parts:
                total.update(f"{file.relative_to(place.parent).as_posix()}\n".encode())
                total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()[:16]


def describe_study(study: Study, flight: dict[str, Any]) -> dict[str, Any]:
    """What the study is, and how it was made: source commit, command, sessions and retries."""
    return {**identify_study(study), **_describe_making(), "flight": flight}


def describe_run(options: Any) -> dict[str, Any]:
    """As `describe_study`, for a run that is no single study: its options stand for the parameters.

    Args:
        options: dataclass of the command line.
    """
    return {**identify_software(), **_describe_making(), "options": asdict(options)}


def _describe_making() -> dict[str, Any]:
    return {
        "command": " ".join(sys.argv),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "git_commit": git_commit(),
        "training_versions": _installed_versions(_TRAINING_PACKAGES),
    }


def _installed_versions(packages: Iterable[str]) -> dict[str, str]:
    found = {}
    for name in packages:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def write_provenance(path: Path, provenance: dict[str, Any]) -> None:
    """Write a provenance as JSON."""
    path.write_text(json.dumps(provenance, indent=1, sort_keys=True, default=str) + "\n")


def write_checksums(folder: Path) -> None:
    """List every product of a study's folder with its digest."""
    lines = [f"{digest_file(folder / name)}  {name}\n" for name in list_products(folder)]
    (folder / CHECKSUMS).write_text("".join(lines))


def list_products(folder: Path) -> list[str]:
    """Paths of a study's products below its folder, with slashes, ascending; the checksums left out."""
    files = [
        file for place in ("*", *(f"{name}/*" for name in _PRODUCT_FOLDERS)) for file in folder.glob(place)
    ]
    names = (file.relative_to(folder).as_posix() for file in files if file.is_file() and file.name[0] != ".")
    return sorted(name for name in names if name != CHECKSUMS)


def digest_file(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
