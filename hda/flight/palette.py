"""Colours, dashes and symbols that tell policies apart, the same in every picture."""

from __future__ import annotations

from typing import Any

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
"""Okabe and Ito's palette, told apart by colour-blind readers."""

DASHES = ("solid", "dash", "dot")
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
