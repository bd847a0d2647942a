"""Successive convexification: programme after programme about the last flight, until nothing changes.

A step is taken where the penalised objective falls by a share of what the programme promised, and the weight
of the trust region follows that share (ratio test of Mao et al., IEEE CDC 2016). Near the motion the duals
of the programme weigh departures from it in place of the penalty: so curvature does not stop long steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.convex.clarabel_solver import SolveStatus
from guidance.descent.plan import PlanStatus
from guidance.rigid_descent.problem import RigidLandingProblem
from guidance.successive.discretisation import discretise, shoot
from guidance.successive.programme import SuccessiveProgramme
from guidance.successive.units import Iterate, RigidUnits

MOST_PROGRAMMES = 60
_FIRST_TRUST, _LEAST_TRUST, _MOST_TRUST = 0.03, 1e-6, 1e5
_TAKEN, _GOOD = 0.05, 0.6  # shares of the promise from which on a step is taken, and the region grows
_SUSPECT = 3.0  # share beyond which the promise means nothing
_WIDER, _NARROWER = 0.3, 5.0
_RESTORED = 0.3  # share of the defects that a step may leave to be taken for that alone
_SETTLED = 4e-6  # promised fall of the objective below which little is left to gain
_SETTLING_TRUST = 1e-3  # at most, for that promise to mean something
_ROUNDING_TRUST = 1.0  # beyond it steps are so short that a promise below _SETTLED is rounding
_POLISHING_TRUST, _MOST_POLISH = 0.03, 6  # small steps, taken until the motion is kept
_EDGE = 1e-3  # of a time of flight: so near to an edge of its range it is held by it
_DEFECT = 1e-7  # greatest defect of a flight that keeps the motion
_NEAR = 0.02  # defects below which the motion's own prices weigh them, in place of the penalty
_MOST_FAILURES = 4
_DEAREST = 1e4  # penalty beyond which the motion is given up


@dataclass(frozen=True, eq=False)
class Ending:
    """How the iteration ended.

    Attributes:
        iterate: the last flight that was taken.
        status: OPTIMAL where it keeps the motion, the last programme promised no further gain and its time of
            flight lies inside the range; SOLVER_FAILED where Clarabel gave no answer; else LIMIT_REACHED.
        solves: programmes solved.
        words: the ending in words.
    """

    iterate: Iterate
    status: PlanStatus
    solves: int
    words: str


def iterate_programmes(problem: RigidLandingProblem, units: RigidUnits, guess: Iterate) -> Ending:
    """Improve a guess until it is a flight of the body that no small change makes better.

    Args:
        problem: what to solve.
        units: its units.
        guess: where to start; it need not keep the motion.
    """
    body, programme = units.body(problem), SuccessiveProgramme(problem, units, guess)
    now, trust, failures, polished = guess, _FIRST_TRUST, 0, 0
    motion, solves = discretise(now.states, now.controls, now.intervals, body), 0
    defects = now.states[1:] - motion.ends
    for solves in range(1, MOST_PROGRAMMES + 1):
        answer = programme.solve(now, motion, trust)
        if answer.status is not SolveStatus.SOLVED:
            failures += 1
            if failures > _MOST_FAILURES:
                return Ending(now, PlanStatus.SOLVER_FAILED, solves, f"Clarabel: {answer.words}")
            trust *= _NARROWER
            continue
        after = programme.iterate_of(answer.primal)
        ends = shoot(after.states, after.controls, after.intervals, body)
        there = after.states[1:] - ends
        if max(_greatest(defects), _greatest(there)) < _NEAR:
            price = answer.dual[: there.size].reshape(there.shape)
            before = programme.objective(now) + float((price * defects).sum())
            reached = programme.objective(after) + float((price * there).sum())
            hoped = before - programme.objective(after)
        else:
            before, reached = programme.merit(now, defects), programme.merit(after, there)
            hoped = before - programme.promise(answer.primal)
        gain = before - reached
        settled = hoped < _SETTLED and (trust <= _SETTLING_TRUST or polished > 0)
        restored = _greatest(there) < _RESTORED * _greatest(defects)
        trusted = _TAKEN * hoped <= gain <= _SUSPECT * max(hoped, _SETTLED)
        if trusted or restored or settled or polished > 0:
            now, defects = after, there
            motion = discretise(now.states, now.controls, now.intervals, body)
        if polished > 0 and _greatest(defects) <= _DEFECT and hoped < _SETTLED:
            return _settled_ending(now, programme.window, units, solves)
        if polished == _MOST_POLISH:
            polished = 0
            if _greatest(defects) > _DEFECT and programme.grow_penalty() > _DEAREST:
                break
        elif settled or polished > 0:
            polished, trust = polished + 1, max(trust, _POLISHING_TRUST)
        elif trusted and (gain > _GOOD * hoped or hoped < _SETTLED):
            trust = max(_LEAST_TRUST, trust * _WIDER)
        elif not trusted:
            rounding = trust > _ROUNDING_TRUST and abs(hoped) < _SETTLED  # shorter steps would tell nothing
            trust = _FIRST_TRUST if rounding else min(_MOST_TRUST, trust * _NARROWER)
    return Ending(now, PlanStatus.LIMIT_REACHED, solves, _what_is_left(defects, solves))


def _settled_ending(now: Iterate, window: tuple[float, float], units: RigidUnits, solves: int) -> Ending:
    """That of a flight which no small change makes better, if its time of flight was free to change."""
    shortest, longest = window
    if (1.0 + _EDGE) * shortest < now.duration < (1.0 - _EDGE) * longest:
        return Ending(now, PlanStatus.OPTIMAL, solves, "converged")
    span = f"{shortest * units.time:.3g} to {longest * units.time:.3g} s"
    words = f"the time of flight ends at an edge of its range, {span}; a better one may lie beyond"
    return Ending(now, PlanStatus.LIMIT_REACHED, solves, words)


def _greatest(defects: Array) -> float:
    return float(np.abs(defects).max())


def _what_is_left(defects: Array, solves: int) -> str:
    if _greatest(defects) > _NEAR:
        words = "nothing is proved, and more nodes, torque or rate_limit may give one"
        return f"no flight found in {solves} programmes; {words}"
    return f"not settled after {solves} programmes; another number of nodes may settle"
