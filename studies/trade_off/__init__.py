"""Safety against propellant: policies on each preset, against a reference, and the weights of `hazard-aware`.

`python -m studies.trade_off` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.trade_off.command import TradeOff, run_trade_off

_HOMES = {
    "studies.trade_off.command": (
        "TradeOff",
        "run_trade_off",
    ),
}

__all__ = [
    "TradeOff",
    "run_trade_off",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
