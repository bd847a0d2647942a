"""Descents in bulk: `solve_pdg_many`, for many starts or many targets at once.

`starts` is what is asked, `certified_flight` the compiled answer to one start, `cones` limits that it does
not know, `sampling` a flight on nodes, `answers` what comes out, `solve` the entry: all cores, and
`solve_pdg` for what the compiled answer leaves.
Nothing below imports this wing; other packages do.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.bulk.answers import STATUSES, Descents
    from guidance.bulk.solve import solve_pdg_many

_HOMES = {
    "guidance.bulk.answers": (
        "STATUSES",
        "Descents",
    ),
    "guidance.bulk.solve": ("solve_pdg_many",),
}

__all__ = [
    "STATUSES",
    "Descents",
    "solve_pdg_many",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
