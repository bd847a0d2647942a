"""When to land: closed-form bounds on the time of flight, searches for the best one, and the indirect method.

The searches know a fixed-time solve only by its cost and its derivative. The indirect method (Lawden's
primer vector) needs no solver. Planners import this wing; it imports `guidance.descent` alone.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.flight_time.primer_vector import PrimerFlight, find_primer_flight
    from guidance.flight_time.search import TimeModel, TimeSearch
    from guidance.flight_time.time_window import TimeWindow, guess_time

_HOMES = {
    "guidance.flight_time.primer_vector": (
        "PrimerFlight",
        "find_primer_flight",
    ),
    "guidance.flight_time.search": (
        "TimeModel",
        "TimeSearch",
    ),
    "guidance.flight_time.time_window": (
        "TimeWindow",
        "guess_time",
    ),
}

__all__ = [
    "PrimerFlight",
    "TimeModel",
    "TimeSearch",
    "TimeWindow",
    "find_primer_flight",
    "guess_time",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
