"""`solve_pdg`, with its compiled code loaded: importing this plans a descent, so that no first call waits.

`guidance.solve_pdg` comes from here; the package itself is imported without it.
"""

from __future__ import annotations

from guidance.pdg.solve import solve_pdg

__all__ = ["solve_pdg"]

solve_pdg((200.0, 100.0, 900.0, -8.0, -4.0, -30.0, 1200.0), (0.0, 0.0, 0.0))
