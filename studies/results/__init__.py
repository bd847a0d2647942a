"""The tables of the documentation made again, one command after the other.

`python -m studies.results` is its command, and `make results`. `entries` lists the tables and what makes
each; `command` runs what is missing and keeps a journal of it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.results.command import MakeResults, make_results
    from studies.results.entries import RESULTS, Result

_HOMES = {
    "studies.results.command": (
        "MakeResults",
        "make_results",
    ),
    "studies.results.entries": (
        "RESULTS",
        "Result",
    ),
}

__all__ = [
    "RESULTS",
    "MakeResults",
    "Result",
    "make_results",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
