"""Flying many episodes: chunks on workers or a cluster, kept as they finish, resumed, with their provenance.

A study names points and policies; a chunk is a pure function of them. Shards are written durably and read
back for the tables. It imports `studies.statistics`, and `rl`, whose agents fly too; every study imports it.
"""

from typing import TYPE_CHECKING

import rl  # noqa: F401 - puts the learning agents into the registry
from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.campaign.study_folder import StudyFolder

_HOMES = {
    "studies.campaign.study_folder": ("StudyFolder",),
}

__all__ = [
    "StudyFolder",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
