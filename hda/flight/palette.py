"""Colours, dashes and symbols that tell policies apart, the same in every picture."""

from __future__ import annotations

from typing import Any

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B87A00", "#3D94D1", "#000000", "#8F8500")
"""Okabe and Ito's palette for colour-blind readers; orange, sky blue and yellow are darker here, so
that each line has a contrast of 3 on white (WCAG 2.1, 1.4.11)."""

DASHES = ("solid", "dash", "dot")
MATPLOTLIB_DASHES = {"solid": "-", "dash": "--", "dot": ":"}
"""The same for Matplotlib, which names them otherwise."""
SYMBOLS = ("circle", "square", "diamond")


def line_style(index: int) -> dict[str, Any]:
    """Colour and dash of the policy of a number; both together are its own up to 24 policies."""
    return {
        "color": COLORS[index % len(COLORS)],
        "dash": DASHES[index // len(COLORS) % len(DASHES)],
        "width": 2,
    }


def marker_style(index: int) -> dict[str, Any]:
    """Colour and symbol of the policy of a number; both together are its own up to 24 policies."""
    symbol = SYMBOLS[index // len(COLORS) % len(SYMBOLS)]
    return {"color": COLORS[index % len(COLORS)], "symbol": symbol, "size": 10}
