"""A lower bound on the propellant of every flight, and the check of its proof.

The proof is a set of affine primers p(tau) = a + b tau (tau: time before the landing), each for a span of
times of flight. For every flight of T seconds that spends at most J (see `DualBound.spent_at_most`)

    J >= D(T) = a.(w - v_0 - g T) - b.(r_0 + v_0 T + g T^2/2) - int_0^T (f mu - l nu) dtau,
    mu = max(s, 0),  nu = max(-s, 0),  s = h(p) - 1 + f kappa int mu - (l/c) int nu,

with f and l the greatest and least thrust over the start mass, c the exhaust velocity, kappa =
(e^(J/c) - 1)/J and h(p) the greatest p.d over the directions that the engine may point along;
`guidance.lower_bound` derives it. A piece may also use a limit on the path: c.r >= 0 theta seconds before the
landing, for any c within the dual cone of the glide slope (of the altitude: c up). That adds
c (tau - theta)_+ to p and -c.(r_0 + v_0 (T - theta) + g (T - theta)^2/2) to D for T >= theta.

The check shares no code with the search for the primers. It takes chords
of h(p(tau)), which is convex on each side of theta: they lie above it, so that what the check computes is a
bound on any grid that holds theta.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem

_EVEN, _RISING, _INSIDE = 600, 300, 200  # marks of a piece: even from 0 on, ever wider, and within its span
_ABOUT = 60  # on each side of its kink
_ROUNDING = 1e-9  # of the exhaust velocity
_MOST_RATIO = 50.0  # of velocity change over exhaust velocity: no vehicle spends more


@dataclass(frozen=True, eq=False)
class DualPiece:
    """An affine primer and the times of flight that it speaks for.

    Attributes:
        begin: [s].
        end: [s]; inf for a constant primer that holds from `begin` on.
        primer: (a, b), shape (6,): a without unit, b in 1/s.
        path_multiplier: [1/s] c, shape (3,); zero without a limit on the path.
        path_time: [s] theta, at which that limit is used, before the landing.
    """

    begin: float
    end: float
    primer: Array
    path_multiplier: Array = field(default_factory=lambda: np.zeros(3))
    path_time: float = math.inf

    def primer_at(self, times: Array) -> Array:
        """P at times [s] before the landing, shape (n, 3)."""
        late = np.maximum(times - self.path_time, 0.0)[:, None]
        return self.primer[:3] + times[:, None] * self.primer[3:] + late * self.path_multiplier


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
    def anywhere(self) -> bool:
        """Whether it speaks of landings anywhere in the target's plane: no primer asks where."""
        asked = (piece.primer[3:5].any() or piece.path_multiplier[:2].any() for piece in self.pieces)
        return not any(asked)

    @property
    def verified(self) -> bool:
        """Whether the proof holds: the pieces follow one another, and each bounds all of its times."""
        if not self._well_formed():
            return False
        claim = self.bound - _ROUNDING * self.problem.lander.exhaust_velocity
        return all(self._least_bound(piece) >= claim for piece in self.pieces)

    def supports(self, lower_bound: float) -> bool:
        """Whether the claim implies that no flight burns less than `lower_bound` [kg]; inf: there is none."""
        if math.isfinite(lower_bound):
            return lower_bound <= self.propellant * (1.0 + 1e-12)
        return self.shortest == 0.0 and math.isinf(self.longest) and self.above_tank

    @property
    def above_tank(self) -> bool:
        """Whether the claim is that the tank pays for no flight of the times that it speaks of."""
        tank = self.problem.lander.exhaust_velocity * self.problem.log_mass_ratio
        return self.bound >= tank * (1.0 - 1e-6)

    def _well_formed(self) -> bool:
        """Whether the numbers are numbers, and the pieces cover the claimed times without a hole."""
        marks = [self.shortest, *(piece.end for piece in self.pieces)]
        numbers = [self.bound, self.spent_at_most, *marks[:-1]]
        numbers += [float(number) for piece in self.pieces for number in piece.primer]
        if self.problem.rotates:  # the relaxation knows no turning frame
            return False
        if not self.pieces or not all(math.isfinite(number) for number in numbers):
            return False
        chained = marks[:-1] == [piece.begin for piece in self.pieces] and marks[-1] == self.longest
        rising = all(first <= second for first, second in zip([0.0, *marks], marks, strict=False))
        most = _MOST_RATIO * self.problem.lander.exhaust_velocity
        kept = all(self._keeps_path(piece) for piece in self.pieces)
        return (
            kept
            and chained
            and rising
            and 0.0 < self.spent_at_most < most
            and self.bound <= self.spent_at_most
        )

    def _keeps_path(self, piece: DualPiece) -> bool:
        """Whether c.r >= 0 wherever the altitude and the glide slope are kept."""
        c, limit = piece.path_multiplier, self.problem.glide_slope_limit
        if not (np.isfinite(c).all() and piece.path_time >= 0.0):
            return False
        across, up = math.hypot(c[0], c[1]), float(c[2])
        if limit is None or not self.problem.has_glide_slope:
            return across == 0.0 and up >= 0.0
        return across * math.sin(limit) <= up * math.cos(limit) * (1.0 + 1e-12)

    def _least_bound(self, piece: DualPiece) -> float:
        """[m/s] the least D over a piece's times of flight."""
        endless = math.isinf(piece.end)
        if endless and not self._rises_for_ever(piece):
            return -math.inf
        end = piece.begin if endless else piece.end
        marks = np.unique(
            np.concatenate(
                [
                    np.linspace(0.0, end, _EVEN),
                    end * np.geomspace(1e-5, 1.0, _RISING),
                    np.linspace(piece.begin, end, _INSIDE),
                    _marks_about(piece, end),
                ]
            )
        )
        bounds, sag = self._bounds(piece, marks)
        inside = marks >= piece.begin
        cells = inside[1:] & inside[:-1]
        between = np.minimum(bounds[1:], bounds[:-1])[cells] - sag[cells]
        return min(float(bounds[inside].min()), float(between.min(initial=math.inf)))

    def _rises_for_ever(self, piece: DualPiece) -> bool:
        """Whether D of a constant primer no longer than one does not fall with T: it is linear."""
        constant = (
            not piece.primer[3:].any()
            and not piece.path_multiplier.any()
            and bool(np.linalg.norm(piece.primer[:3]) <= 1.0 + 1e-12)
        )
        return constant and float(piece.primer[:3] @ self.problem.gravity) <= 0.0

    def _bounds(self, piece: DualPiece, times: Array) -> tuple[Array, Array]:
        """D at rising times from 0, shape (n,), and what it may sag between them, shape (n - 1,).

        Between two times D falls below its ends by at most an eighth of the step squared times the greatest
        second derivative, -(b + c).g - (f or l) s'; on a chord s' = h' + (f kappa or l/c) s, where s is
        monotone.
        """
        problem, primer = self.problem, piece.primer
        reach = _support(piece.primer_at(times), problem.lander.pointing_limit)
        steps = np.diff(times)
        slopes = np.diff(reach) / steps
        thrust = _ThrustBounds.of(problem, self.spent_at_most)
        switching, spent = np.full(times.size, reach[0] - 1.0), np.zeros(times.size)
        for k in range(steps.size):
            s, more = thrust.advance(float(switching[k]), float(slopes[k]), float(steps[k]))
            switching[k + 1], spent[k + 1] = s, spent[k] + more
        column, v, g = times[:, None], problem.state.velocity, problem.gravity
        speed = (problem.target_velocity - v) - column * g
        place = problem.offset + column * v + 0.5 * column**2 * g
        lowest = np.minimum(switching[1:], switching[:-1])
        falling = np.maximum(-slopes, 0.0) + thrust.full_growth * np.maximum(-lowest, 0.0)
        burning = np.maximum(switching[1:], switching[:-1]) > 0.0
        kinked = times >= piece.path_time
        bend = -float(primer[3:] @ g) - np.where(kinked[:-1], float(piece.path_multiplier @ g), 0.0)
        bend = bend + np.where(burning, thrust.full, thrust.least) * falling
        bounds = speed @ primer[:3] - place @ primer[3:] - spent
        if kinked.any():
            before = np.maximum(times - piece.path_time, 0.0)[:, None]
            there = problem.offset + before * v + 0.5 * before**2 * g
            bounds = bounds - np.where(kinked, there @ piece.path_multiplier, 0.0)
        return bounds, 0.125 * steps**2 * np.maximum(bend, 0.0)


@dataclass(frozen=True)
class _ThrustBounds:
    """f, f kappa, l and l/c of the relaxed thrust bounds."""

    full: float
    full_growth: float
    least: float
    least_growth: float

    @classmethod
    def of(cls, problem: LandingProblem, most: float) -> _ThrustBounds:
        exhaust, mass = problem.lander.exhaust_velocity, problem.state.mass
        full, least = problem.lander.max_thrust / mass, problem.lander.min_thrust / mass
        return cls(full, full * math.expm1(most / exhaust) / most, least, least / exhaust)

    def advance(self, s: float, slope: float, step: float) -> tuple[float, float]:
        """S after a step on which h has a constant slope, and the growth of int (f mu - l nu) over it."""
        spent, remaining = 0.0, step
        while remaining > 0.0:
            burning = s > 0.0 or (s == 0.0 and slope > 0.0)
            weight = self.full if burning else self.least
            rate = self.full_growth if burning else self.least_growth
            duration = remaining
            end = s + (slope + rate * s) * _growth(rate, duration)
            crosses = end < 0.0 if burning else end > 0.0
            if crosses:
                duration = -math.log1p(rate * s / slope) / rate if rate > 0.0 else -s / slope
                duration, end = min(max(duration, 0.0), remaining), 0.0
            if rate * duration > 1e-4:
                area = (end - s - slope * duration) / rate
            else:
                bent = rate * duration / 3.0
                area = duration * (s * (1.0 + 1.5 * bent) + 0.5 * slope * duration * (1.0 + bent))
            spent += weight * area
            s, remaining = end, remaining - duration if crosses else 0.0
        return s, spent


def _marks_about(piece: DualPiece, end: float) -> Array:
    """[s] theta, and ever closer to it on both sides, within the times of a piece: it may turn fast there."""
    if not piece.path_multiplier.any():
        return np.array([end])
    away = end * np.geomspace(1e-7, 0.05, _ABOUT)
    marks = np.concatenate([piece.path_time - away, [piece.path_time], piece.path_time + away])
    return np.clip(marks, 0.0, end)


def _growth(rate: float, time: float) -> float:
    """[s] (e^{rate time} - 1)/rate."""
    return math.expm1(rate * time) / rate if rate > 0.0 else time


def _support(primer: Array, limit: float | None) -> Array:
    """h(p): greatest p.d over unit vectors d within an angle [rad] of the z axis; p of shape (..., 3)."""
    length = np.linalg.norm(primer, axis=-1)
    if limit is None:
        return length
    across, up = np.hypot(primer[..., 0], primer[..., 1]), primer[..., 2]
    leaning = np.arctan2(across, up) > limit
    return np.where(leaning, math.sin(limit) * across + math.cos(limit) * up, length)
