"""The quick comparison: which policies fly, how many episodes, and the report on the user's screen."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path

QUICK_EPISODES = 100
QUICK_POLICIES = ("no-divert", "single-divert", "nearest-safe", "hazard-aware", "td3", "td3-lstm")
QUICK_FOLDER = Path("results/quick")


def show_report(path: Path) -> bool:
    """Open a report in the user's browser, where there is a terminal and a screen.

    Returns:
        Whether it was opened.
    """
    screen = sys.platform in ("darwin", "win32") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if not (screen and sys.stdout.isatty()):
        return False
    try:
        return webbrowser.open(path.resolve().as_uri())
    except webbrowser.Error:
        return False
