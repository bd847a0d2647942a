"""Says where another `guidance` stands in the way; imported before anything of it.

Another distribution on PyPI installs a package of that name, and so does a file `guidance.py` beside a
script. Without this the first import of a submodule fails, far from the cause. Nothing of a foreign package
is run: it is told by the text of its `__init__`, as pip writes two packages of one name into one folder.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

_MARK = "guidance.lander"
"""Stands in the `__init__` of ours, which names the homes of its public names."""


def require_own_guidance() -> None:
    """Check which `guidance` Python finds.

    Raises:
        ImportError: it is not that of lunar-hda, or there is none.
    """
    try:
        spec = importlib.util.find_spec("guidance")
    except ValueError:  # a module put there by hand has no spec
        spec = None
    origin = None if spec is None else spec.origin
    try:
        if origin is not None and _MARK in Path(origin).read_text(encoding="utf-8", errors="replace"):
            return
    except OSError:
        return  # not a file: in a zip archive, as it were
    found = "but finds none" if origin is None else f"but Python finds another's: {origin}"
    raise ImportError(
        f"lunar-hda needs its own package `guidance`, {found}; uninstall or rename that one and install"
        " lunar-hda again, best in a virtual environment of its own"
    )


require_own_guidance()
