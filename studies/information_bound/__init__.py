"""How far a policy is from the best possible: what no policy undercuts, and where the difference lies.

`python -m studies.information_bound` is its command. `restrictions` bounds an episode with its map, noise and
engine known in advance, under one restriction more each time; `cheapest_landing` proves it; `recognition`
asks what the first look tells of the map; `told` are policies that are told the map at some look.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.information_bound.cheapest_landing import Arrival, bound_cheapest
    from studies.information_bound.command import InformationBound, run_information_bound
    from studies.information_bound.recognition import penalised_loss

_HOMES = {
    "studies.information_bound.cheapest_landing": (
        "Arrival",
        "bound_cheapest",
    ),
    "studies.information_bound.command": (
        "InformationBound",
        "run_information_bound",
    ),
    "studies.information_bound.recognition": ("penalised_loss",),
}

__all__ = [
    "Arrival",
    "InformationBound",
    "bound_cheapest",
    "penalised_loss",
    "run_information_bound",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
