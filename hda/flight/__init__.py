"""The simulator: a vehicle between two looks, an episode from look to look, and how it ended.

`fly_legs` is the one loop; the Gymnasium environments step through the same functions. `rigid` is a body
that must turn, in the vehicle's loop; `portrait` is the lander as pictures show it. It imports the task and
the seam (`hda.policy`), no policy.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.flight.episode import advance, begin_flight, fly, fly_legs, observe
    from hda.flight.episode_row import EpisodeRow, summarize_episode
    from hda.flight.outcome import Ending, Outcome
    from hda.flight.record import EpisodeRecord
    from hda.flight.touchdown_report import TouchdownFault, TouchdownReport
    from hda.flight.vehicle import FlightErrors, FlightStatus, Segment, Surroundings, fly_over

_HOMES = {
    "hda.flight.episode": (
        "fly",
        "fly_legs",
        "observe",
        "advance",
        "begin_flight",
    ),
    "hda.flight.episode_row": (
        "EpisodeRow",
        "summarize_episode",
    ),
    "hda.flight.outcome": (
        "Ending",
        "Outcome",
    ),
    "hda.flight.record": ("EpisodeRecord",),
    "hda.flight.touchdown_report": (
        "TouchdownFault",
        "TouchdownReport",
    ),
    "hda.flight.vehicle": (
        "FlightErrors",
        "FlightStatus",
        "Segment",
        "Surroundings",
        "fly_over",
    ),
}

__all__ = [
    "Ending",
    "EpisodeRecord",
    "EpisodeRow",
    "FlightErrors",
    "FlightStatus",
    "Outcome",
    "Segment",
    "Surroundings",
    "TouchdownFault",
    "TouchdownReport",
    "advance",
    "begin_flight",
    "fly",
    "fly_legs",
    "fly_over",
    "observe",
    "summarize_episode",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
