"""Reading back what a matplotlib figure draws."""

from __future__ import annotations

from typing import Any

import numpy as np


def line_data(axes: Any, label: str) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the only line of that label."""
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)


def bar_ends(container: Any) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends, shape (n, 2) each, of the bars along y of an error-bar container."""
    segments = np.array(container.lines[2][-1].get_segments())
    return segments[:, 0], segments[:, 1]


def legend_words(legend: Any) -> list[str]:
    return [text.get_text() for text in legend.get_texts()]
