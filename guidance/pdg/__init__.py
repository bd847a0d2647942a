"""Powered-descent guidance: `solve_pdg`, the public entry to every planner, and its command line.

`solve` checks the arguments and says what became of them, `request` holds what is asked, `fallbacks` who is
asked and in which order.
Nothing below imports this wing; `guidance.tracking` and other packages do.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.pdg.solve import DEFAULT_NODES, METHODS, replan, solve_pdg

_HOMES = {
    "guidance.pdg.solve": (
        "DEFAULT_NODES",
        "METHODS",
        "replan",
        "solve_pdg",
    ),
}

__all__ = [
    "DEFAULT_NODES",
    "METHODS",
    "replan",
    "solve_pdg",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
