"""What no flight to any of many cells undercuts: proved bounds of a few cells, carried over to all.

The dual bound of a landing (`guidance.lower_bound`) is affine in where it ends and how fast: with the primer
p(tau) = a + b tau, a landing at s + ds with the velocity w + dw spends, for every time of flight,

    D(T; s + ds, w + dw) = D(T; s, w) + b.ds + a.dw.

So what is proved of one cell bounds every other, and every speed that counts as soft. The cell that looks
cheapest by all bounds so far is proved next, until it is one that was proved: its bound holds for all cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.bulk.solve import solve_pdg_many
from guidance.descent.certificate import Certificate
from guidance.descent.dual_bound import DualBound, DualPiece
from guidance.lander import Lander
from guidance.lower_bound.dual_case import dual_case
from guidance.lower_bound.proof import prove_least_propellant
from guidance.lower_bound.time_cover import sweep_cells
from guidance.state import State

_CELLS = 300  # of the grid of times of flight on which a primer is swept
_LONGER = 1.5  # times the begin of the last span: so far the grid goes
_MOST_PROOFS = 200
_REST = np.zeros(3)
_NEAR_ENOUGH = 1e-6  # of the exhaust velocity: a bound that close to a proved cell's is as good: 4 g


@dataclass(frozen=True)
class Arrival:
    """How a landing may end, beside where.

    Attributes:
        least_descent: [m/s] of the speeds downward.
        most_descent: [m/s] of them.
        most_drift: [m/s] greatest horizontal speed.
        half_cell: [m] by which it may end beside the middle of its cell, along each axis.
    """

    least_descent: float = 0.0
    most_descent: float = 0.0
    most_drift: float = 0.0
    half_cell: float = 0.0

    def gentlest(self, primer: Array) -> Array:
        """[m/s] shape (3,): of the velocities that it may end with, the one of the least bound for a primer.

        Args:
            primer: (a, b), shape (6,).
        """
        across = math.hypot(primer[0], primer[1])
        drift = -self.most_drift / across if across > 0.0 else 0.0
        descent = self.most_descent if primer[2] > 0.0 else self.least_descent
        return np.array([drift * primer[0], drift * primer[1], -descent])

    def change(self, primer: Array, velocity: Array) -> float:
        """[m/s] from the bound of an end at one velocity, shape (3,), in mid-cell to the least of all."""
        aside = float(np.abs(primer[3:5]).sum())
        return float(primer[:3] @ (self.gentlest(primer) - velocity)) - aside * self.half_cell


@dataclass(frozen=True, eq=False)
class CellBound:
    """What the proof of one landing says of landings anywhere on the plane.

    Attributes:
        site: [m] shape (2,), where it ends.
        level: [m/s] shape (k,), least bound of each piece over its times of flight, for an end there.
        slope: [1/s] shape (k, 2), growth of each with the place of the end.
        most: [m/s] the proof speaks of flights that spend no more.
    """

    site: Array
    level: Array
    slope: Array
    most: float

    def at(self, places: Array) -> Array:
        """[m/s] shape (n,): bound for ends at places [m], shape (n, 2)."""
        moved = places - self.site
        bound = np.full(len(places), self.most)
        for level, slope in zip(self.level, self.slope, strict=True):
            np.minimum(bound, level + moved @ slope, out=bound)
        return bound


def prove_cell(state: State, site: Array, lander: Lander, gravity: Array, arrival: Arrival) -> CellBound:
    """The bound of a landing at one place, for every other.

    Args:
        state: at the start.
        site: [m] shape (3,), the middle of a cell.
        lander: the vehicle.
        gravity: [m/s^2] shape (3,).
        arrival: how a landing may end.

    Returns:
        The bound; that no landing spends less than nothing where no more is proved.
    """
    flight = solve_pdg_many(state, site[None], lander=lander, gravity=gravity, threads=1)
    proof = _dual_bound(flight.certificate(0))
    if proof is None:
        return CellBound(site[:2].copy(), np.zeros(1), np.zeros((1, 2)), math.inf)
    levels = [_least_bound(piece, proof) + arrival.change(piece.primer, _REST) for piece in proof.pieces]
    velocity = arrival.gentlest(proof.pieces[int(np.argmin(levels))].primer)
    if velocity.any() and flight.optimal[0]:  # primers made for such an end are better there
        problem = replace(proof.problem, target_velocity=velocity)
        burnt, time = float(flight.propellant[0]), float(flight.time_of_flight[0])
        proof = _dual_bound(prove_least_propellant(problem, burnt, time)) or proof
        velocity = proof.problem.target_velocity
        levels = [
            _least_bound(piece, proof) + arrival.change(piece.primer, velocity) for piece in proof.pieces
        ]
    # without a glide slope no limit on the path leans, so that b alone says what another place costs
    assert not any(piece.path_multiplier[:2].any() for piece in proof.pieces)
    slopes = np.array([piece.primer[3:5] for piece in proof.pieces])
    return CellBound(site[:2].copy(), np.array(levels), slopes, proof.spent_at_most)


def _dual_bound(certificate: Certificate | None) -> DualBound | None:
    proof = certificate.proofs[0] if certificate is not None and certificate.proofs else None
    return proof if isinstance(proof, DualBound) else None


def _least_bound(piece: DualPiece, proof: DualBound) -> float:
    """[m/s] the least bound of a piece over its times; a constant primer's does not fall beyond the grid."""
    case = dual_case(proof.problem, proof.spent_at_most)
    endless = math.isinf(piece.end)
    end = _LONGER * max(piece.begin, 1.0) if endless else piece.end
    times = np.unique(np.concatenate([np.linspace(0.0, end, _CELLS), [piece.begin]]))
    primer = piece.primer
    if piece.path_multiplier.any():
        primer = np.concatenate([piece.primer, piece.path_multiplier, [piece.path_time]])
    lowest = np.empty(times.size - 1)
    sweep_cells(np.array(primer), times, case, lowest)
    return float(lowest[times[1:] > piece.begin].min())


def bound_cheapest(
    state: State, places: Array, lander: Lander, gravity: Array, plane: float, arrival: Arrival
) -> Array:
    """[m/s] shape (n,): what no landing at each of the places undercuts; the least is as good as proved.

    Args:
        state: at the start.
        places: [m] shape (n, 2), middles of cells, at least one.
        lander: the vehicle.
        gravity: [m/s^2] shape (3,).
        plane: [m] height at which flights end.
        arrival: how a landing may end.
    """
    bound, proved = np.full(len(places), -np.inf), np.zeros(len(places), dtype=np.bool_)
    best = int(np.argmin(np.hypot(*(places - _coast(state, gravity, plane)).T)))
    reached = np.inf
    for _ in range(_MOST_PROOFS):
        site = np.array([*places[best], plane])
        found = prove_cell(state, site, lander, gravity, arrival)
        proved[best] = True
        np.maximum(bound, found.at(places), out=bound)
        reached = min(reached, float(bound[best]))
        best = int(np.argmin(bound))
        if proved[best] or bound[best] > reached - _NEAR_ENOUGH * lander.exhaust_velocity:
            break
    return bound


def _coast(state: State, gravity: Array, plane: float) -> Array:
    """[m] shape (2,), over what place the lander would be at the plane if it fell freely."""
    pull, climb = -float(gravity[2]), float(state.velocity[2])
    fall = (climb + math.sqrt(climb**2 + 2.0 * pull * (float(state.position[2]) - plane))) / pull
    return state.position[:2] + fall * state.velocity[:2]
