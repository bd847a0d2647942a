"""The libraries that only training needs: the extra `train`. Agents fly, and are exported, without them."""

from __future__ import annotations

from importlib.util import find_spec

TRAINING_LIBRARIES = ("torch", "stable_baselines3", "sb3_contrib", "tensorboard")
"""Modules of the extra `train`."""


class TrainingLibrariesError(ImportError, ValueError):
    """Training was asked for without the libraries that it needs."""


def require_training_libraries() -> None:
    """Refuse to train where a library for it is missing; none is imported.

    Raises:
        TrainingLibrariesError: names what is missing, and the line that installs it.
    """
    missing = [name for name in TRAINING_LIBRARIES if find_spec(name) is None]
    if missing:
        raise TrainingLibrariesError(
            f"training needs {', '.join(missing)}; install the extra with: pip install 'lunar-hda[train]'"
        )
