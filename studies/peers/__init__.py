"""Packages of others that run in an interpreter of their own, and how they are talked to.

`openscvx_process` starts the interpreter and exchanges lines with it; `openscvx_serving` is what answers them
there, and needs nothing of these packages. The studies that ask OpenSCvx bring the programmes.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.peers.openscvx_process import (
        FIRST_ORDER_HOLD,
        OPENSCVX_METHOD,
        PEERS_WING,
        WorkerProcess,
        demand_openscvx,
        open_worker,
        serving_code,
    )

_HOMES = {
    "studies.peers.openscvx_process": (
        "FIRST_ORDER_HOLD",
        "OPENSCVX_METHOD",
        "PEERS_WING",
        "WorkerProcess",
        "demand_openscvx",
        "open_worker",
        "serving_code",
    ),
}

__all__ = [
    "FIRST_ORDER_HOLD",
    "OPENSCVX_METHOD",
    "PEERS_WING",
    "WorkerProcess",
    "demand_openscvx",
    "open_worker",
    "serving_code",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
