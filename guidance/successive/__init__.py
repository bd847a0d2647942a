"""The descent of a rigid body by successive convexification: `solve_pdg_6dof`.

It asks `guidance.pdg` for the point mass's plan to start from, and Clarabel for every programme. Only `solve`
imports the reference planner, which a caller may ask for in its place.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.successive.solve import solve_pdg_6dof

_HOMES = {"guidance.successive.solve": ("solve_pdg_6dof",)}

__all__ = ["solve_pdg_6dof"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
