"""Why no flight exists: what a planner says, and how far its proof reaches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


class Proof(Protocol):
    """A proof for one time of flight, checked by code that shares nothing with the solver."""

    @property
    def time(self) -> float:
        """[s] time of flight."""
        ...

    @property
    def verified(self) -> bool:
        """Whether the proof holds."""
        ...

    @property
    def causes(self) -> tuple[str, ...]:
        """Limits that take part in the contradiction."""
        ...


@dataclass(frozen=True, eq=False)
class Certificate:
    """Why no flight exists, and how far the proof reaches.

    Attributes:
        scope: in words, which times of flight and which mesh are covered, and by what.
        causes: the limits that forbid the flight.
        proofs: Farkas proofs (`guidance.convex.farkas`), one per time of flight; empty if closed-form bounds
            alone decide.
    """

    scope: str
    causes: tuple[str, ...]
    proofs: tuple[Proof, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether every proof holds."""
        return all(proof.verified for proof in self.proofs)
