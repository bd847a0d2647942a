"""A lower bound on the propellant of every flight, and the check of its proof.

The proof is a set of affine primers p(tau) = a + b tau (tau: time before the landing), each for a span of
times of flight. For every flight of T seconds that spends at most J (see `DualBound.spent_at_most`)

    J >= D(T) = a.(w - v_0 - g T) - b.(r_0 + v_0 T + g T^2/2) - int_0^T (f mu - l nu) dtau,
    mu = max(s, 0),  nu = max(-s, 0),  s = h(p) - 1 + f kappa int mu - (l/c) int nu,

with f and l the greatest and least thrust over the start mass, c the exhaust velocity, kappa =
(e^(J/c) - 1)/J and h(p) the greatest p.d over the directions that the engine may point along;
`guidance.lower_bound` derives it. The check integrates this in plain numpy and shares nothing with the search
for the primers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem

_STEP = 1e-3  # of the longest finite time of flight
_ALLOWANCE = 1e-7  # of the exhaust velocity: the integration's error, 0.1 g of 1200 kg


@dataclass(frozen=True, eq=False)
class DualPiece:
    """An affine primer and the times of flight that it speaks for.

    Attributes:
        begin: [s].
        end: [s]; inf for a constant primer that holds from `begin` on.
        primer: (a, b), shape (6,): a without unit, b in 1/s.
    """

    begin: float
    end: float
    primer: Array


@dataclass(frozen=True, eq=False)
class DualBound:
    """No flight of a landing problem spends less velocity change than `bound`.

    Attributes:
        problem: the landing problem.
        spent_at_most: [m/s] J: the proof speaks of flights that spend no more; dearer ones are no better.
        bound: [m/s] no flight spends less, as claimed.
        pieces: the proof.
        shortest: [s] the least time of flight that it speaks of.
        longest: [s] the greatest one.
    """

    problem: LandingProblem
    spent_at_most: float
    bound: float
    pieces: tuple[DualPiece, ...]
    shortest: float = 0.0
    longest: float = math.inf

    @property
    def propellant(self) -> float:
        """[kg] no flight burns less."""
        state = self.problem.state
        return state.mass * -math.expm1(-self.bound / self.problem.lander.exhaust_velocity)

    @property
    def verified(self) -> bool:
        """Whether the proof holds: the pieces follow one another, and each bounds all of its times."""
        if not self.pieces or not self.bound <= self.spent_at_most:
            return False
        marks = [self.shortest, *(piece.end for piece in self.pieces)]
        if marks[-1] != self.longest or marks[:-1] != [piece.begin for piece in self.pieces]:
            return False
        allowance = _ALLOWANCE * self.problem.lander.exhaust_velocity
        return bool(self._least_bounds().min() >= self.bound - allowance)

    def _least_bounds(self) -> Array:
        """[m/s] the least D of each piece, shape (k,)."""
        horizon = max(piece.begin if math.isinf(piece.end) else piece.end for piece in self.pieces)
        times = np.linspace(0.0, horizon, math.ceil(1.0 / _STEP) + 1)
        marks = np.unique(np.concatenate([times, [piece.begin for piece in self.pieces]]))
        bounds, sag = self._bounds(marks)
        least = np.empty(len(self.pieces))
        for k, piece in enumerate(self.pieces):
            inside = (marks >= piece.begin) & (marks <= piece.end)
            cells = inside[1:] & inside[:-1]
            lower = np.minimum(bounds[1:, k], bounds[:-1, k])[cells] - sag[cells, k]
            least[k] = min(float(bounds[inside, k].min()), float(lower.min(initial=math.inf)))
            if math.isinf(piece.end) and not self._rises_for_ever(piece):
                least[k] = -math.inf
        return least

    @property
    def _growth(self) -> float:
        """[1/s] f kappa."""
        exhaust = self.problem.lander.exhaust_velocity
        chord = math.expm1(self.spent_at_most / exhaust) / self.spent_at_most
        return self.problem.lander.max_thrust / self.problem.state.mass * chord

    def _rises_for_ever(self, piece: DualPiece) -> bool:
        """Whether D of a constant primer no longer than one grows with T: it is linear."""
        constant = not piece.primer[3:].any() and bool(np.linalg.norm(piece.primer[:3]) <= 1.0 + 1e-12)
        return constant and float(piece.primer[:3] @ self.problem.gravity) <= 0.0

    def _bounds(self, times: Array) -> tuple[Array, Array]:
        """D of every piece at rising times from 0, shape (n, k), and what it may sag between, (n - 1, k).

        By the classical Runge-Kutta method. Between two times D falls below its ends by at most an eighth of
        the step squared times the greatest second derivative, -b.g - (f or l) s', where h' only rises.
        """
        problem, mass = self.problem, self.problem.state.mass
        primers = np.array([piece.primer for piece in self.pieces])
        a, b = primers[:, :3], primers[:, 3:]
        full, least = problem.lander.max_thrust / mass, problem.lander.min_thrust / mass
        growth, least_growth = self._growth, least / problem.lander.exhaust_velocity
        middle = np.sort(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
        reach = _support(a + middle[:, None, None] * b, problem.lander.pointing_limit)

        def rate(length: Array, spent: Array) -> Array:
            switching = length - 1.0 + growth * spent[0] - least_growth * spent[1]
            return np.array([np.maximum(switching, 0.0), np.maximum(-switching, 0.0)])

        integral = np.zeros((times.size, 2, len(self.pieces)))
        for k, step in enumerate(np.diff(times)):
            here, centre, there = reach[2 * k : 2 * k + 3]
            first = rate(here, integral[k])
            second = rate(centre, integral[k] + 0.5 * step * first)
            third = rate(centre, integral[k] + 0.5 * step * second)
            fourth = rate(there, integral[k] + step * third)
            integral[k + 1] = integral[k] + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        column, v, g = times[:, None], problem.state.velocity, problem.gravity
        speed = (problem.target_velocity - v) - column * g
        place = problem.offset + column * v + 0.5 * column**2 * g
        bounds = speed @ a.T - place @ b.T - full * integral[:, 0] + least * integral[:, 1]
        step = np.diff(times)[:, None]
        nodes = reach[::2]
        slope = np.vstack([-np.linalg.norm(b, axis=1)[None, :], np.diff(nodes, axis=0) / step])[:-1]
        switching = nodes - 1.0 + growth * integral[:, 0] - least_growth * integral[:, 1]
        highest = np.maximum(switching[1:], switching[:-1])  # s has no maximum between
        lowest = np.minimum(switching[1:], switching[:-1]) - step * np.linalg.norm(b, axis=1)
        weight = np.where(highest > -1e-9, full, least)
        bend = -b @ g + weight * (np.maximum(-slope, 0.0) + growth * np.maximum(-lowest, 0.0))
        return bounds, 0.125 * step**2 * np.maximum(bend, 0.0)


def _support(primer: Array, limit: float | None) -> Array:
    """h(p): greatest p.d over unit vectors d within an angle [rad] of the z axis; p of shape (..., 3)."""
    length = np.linalg.norm(primer, axis=-1)
    if limit is None:
        return length
    across, up = np.hypot(primer[..., 0], primer[..., 1]), primer[..., 2]
    leaning = np.arctan2(across, up) > limit
    return np.where(leaning, math.sin(limit) * across + math.cos(limit) * up, length)
