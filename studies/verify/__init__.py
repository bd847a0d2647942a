"""Results of others, made again: a random share of the flights of a results folder, and all that it says.

`python -m studies.verify` is its command. `held_results` reads the folder, `checks` compares what it says
with itself and with this software, `flights` flies episodes again, `verification` puts these together.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.verify.verification import Verification, verify_results

_HOMES = {
    "studies.verify.verification": (
        "Verification",
        "verify_results",
    ),
}

__all__ = [
    "Verification",
    "verify_results",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
