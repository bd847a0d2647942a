"""The flight code's way out: `python -m guidance.export_c --out DIR` writes a folder that checks itself.

What it writes stands in `guidance.flight_code`; the test vectors are made from Python when it is called.
Nothing imports this wing.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.export_c.export import export_flight_code

_HOMES = {
    "guidance.export_c.export": ("export_flight_code",),
}

__all__ = [
    "export_flight_code",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
