"""The speed of the inner loops, and what must not grow as ratios with their limits.

`python -m studies.bench` is its command. `command` reads the options and prints the tables; `speed_ratios`,
`environment_speed` and `terrain_timing` measure.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.bench.command import Bench, bench

_HOMES = {
    "studies.bench.command": (
        "Bench",
        "bench",
    ),
}

__all__ = [
    "Bench",
    "bench",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
