"""The cone programme of one iteration: linearised motion with a virtual control, limits, a trust region.

    minimise   objective + penalty |virtual control|_1 + w |change|^2 / 2
    subject to x[k+1] = end + A dx[k] + B- du[k] + B+ du[k+1] + S dh + virtual control

in the units of `guidance.successive.units`. The virtual control makes it feasible; the penalty is exact, so
that it vanishes where the motion can be kept (Mao, Szmuk and Acikmese, IEEE CDC 2016).
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array, Index
from guidance.convex.clarabel_solver import ConicAnswer, ConicSolver
from guidance.rigid_descent.problem import RigidLandingProblem
from guidance.successive.discretisation import STATE, Discretisation
from guidance.successive.layout import ConeRows, ProgrammeLayout
from guidance.successive.units import Iterate, RigidUnits

_PENALTY = {"propellant": 5.0, "time": 30.0}  # above the price of any state but the mass at most optima
_DEARER = 5.0
_MASS_PENALTY = 4.0  # of mass out of nothing, beside that of the rest
_TORQUE_WEIGHT = 0.05  # of the trust region, beside positions, velocities and thrusts
_RATE_WEIGHT = 0.05
_SHORTEST, _LONGEST = 0.2, 5.0  # time of flight over that of the first guess


class SuccessiveProgramme:
    """The programme of a problem on a mesh; its sparsity is that of the first iterate.

    Attributes:
        penalty: shape (14,), on departures from the motion in each number of the state.
        window: least and greatest time of flight.
    """

    def __init__(self, problem: RigidLandingProblem, units: RigidUnits, guess: Iterate) -> None:
        """Keep what does not change.

        Args:
            problem: what to solve.
            units: its units.
            guess: the first iterate; its duration bounds that of the others.
        """
        self._problem, self._units = problem, units
        self._layout = ProgrammeLayout(len(guess.states))
        self.window = _SHORTEST * guess.duration, _LONGEST * guess.duration
        self._solver: ConicSolver | None = None
        layout = self._layout
        weight = np.zeros(layout.size)
        weight[layout.state] = 1.0
        weight[layout.state[:, 10:13]] = _RATE_WEIGHT
        weight[layout.control[:, :3]] = 1.0
        weight[layout.control[:, 3:]] = _TORQUE_WEIGHT
        weight[layout.duration] = 1.0
        self._weight = weight
        self._cost = np.zeros(layout.size)
        self.penalty = np.full(STATE, _PENALTY[problem.objective])
        self.penalty[13] *= _MASS_PENALTY
        if problem.objective == "time":
            self._cost[layout.duration] = 1.0
        else:
            self._cost[layout.state[-1, 13]] = -1.0

    def objective(self, iterate: Iterate) -> float:
        """What is minimised, without penalty and trust region."""
        return iterate.duration if self._problem.objective == "time" else -float(iterate.states[-1, 13])

    def merit(self, iterate: Iterate, defects: Array) -> float:
        """The objective with the penalty on departures from the motion, shape (N - 1, 14)."""
        return self.objective(iterate) + float((np.abs(defects) @ self.penalty).sum())

    def solve(self, about: Iterate, motion: Discretisation, trust: float) -> ConicAnswer:
        """Solve about an iterate.

        Args:
            about: the last iterate.
            motion: its discretisation.
            trust: w.

        Returns:
            The answer; its first duals belong to the motion, interval by interval.
        """
        layout, entries = self._layout, self._rows(about, motion)
        row, column = np.concatenate(entries.row), np.concatenate(entries.column)
        order = np.lexsort((row, column))
        values = np.concatenate(entries.value)[order]
        bound = np.concatenate(entries.bound)
        centre = np.zeros(layout.size)
        centre[layout.state], centre[layout.control] = about.states, about.controls
        centre[layout.duration] = about.duration
        curvature = trust * self._weight
        for virtual in layout.virtual:
            self._cost[virtual] = self.penalty
        cost = self._cost - curvature * centre
        if self._solver is None:
            from scipy.sparse import csc_matrix

            pointer = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=layout.size))])
            matrix = csc_matrix((values, row[order], pointer), shape=(bound.size, layout.size))
            cones = tuple(entries.cones)
            self._solver = ConicSolver(matrix, bound, cost, cones, curvature=curvature)
        return self._solver.solve(values, bound, cost, curvature)

    def iterate_of(self, primal: Array) -> Iterate:
        """The flight in an answer."""
        layout = self._layout
        return Iterate(primal[layout.state], primal[layout.control], float(primal[layout.duration]))

    def promise(self, primal: Array) -> float:
        """The merit that an answer has where the motion is as linear as its programme."""
        return float(self._cost @ primal)

    def grow_penalty(self) -> float:
        """Make departures from the motion dearer, and say how dear they are."""
        self.penalty *= _DEARER
        return float(self.penalty[0])

    def _rows(self, about: Iterate, motion: Discretisation) -> ConeRows:
        entries = ConeRows()
        self._state_motion(entries, about, motion)
        self._state_ends(entries, about)
        self._state_bounds(entries)
        self._state_commands(entries, about)
        self._state_cones(entries)
        self._state_midway_rates(entries, about)
        return entries

    def _state_motion(self, entries: ConeRows, about: Iterate, motion: Discretisation) -> None:
        layout = self._layout
        up, down = layout.virtual
        count = layout.nodes - 1
        known = motion.ends - np.einsum("kij,kj->ki", motion.by_state, about.states[:-1])
        known -= np.einsum("kij,kj->ki", motion.by_first, about.controls[:-1])
        known -= np.einsum("kij,kj->ki", motion.by_last, about.controls[1:])
        known -= motion.by_duration * about.intervals[:, None]

        def wide(columns: Index) -> Index:
            return np.broadcast_to(columns[:, None, :], (count, STATE, columns.shape[1]))

        entries.add(
            "zero",
            known,
            (layout.state[1:], 1.0),
            (wide(layout.state[:-1]), -motion.by_state),
            (wide(layout.control[:-1]), -motion.by_first),
            (wide(layout.control[1:]), -motion.by_last),
            (np.full((count, STATE), layout.duration), -motion.by_duration / count),
            (up, -1.0),
            (down, 1.0),
        )

    def _state_ends(self, entries: ConeRows, about: Iterate) -> None:
        layout, problem, units = self._layout, self._problem, self._units
        state = problem.state.as_array()[:STATE]
        state[:3] -= problem.target
        start, first, last = state / units.state, layout.state[0], layout.state[-1]
        if problem.free_attitude:
            fixed = np.r_[0:6, 10:14]
            attitude = about.states[0, 6:10]
            unit = attitude / np.linalg.norm(attitude)
            entries.add("zero", np.ones(1), (first[None, 6:10], unit[None]))
            entries.add("zero", start[fixed], (first[fixed], 1.0))
        else:
            entries.add("zero", start, (first, 1.0))
        if not problem.free_thrust:
            entries.add("zero", problem.state.thrust / units.force, (layout.control[0, :3], 1.0))
        end = np.zeros(11)
        end[3:6] = problem.target_velocity / units.speed
        entries.add("zero", end, (last[[0, 1, 2, 3, 4, 5, 7, 8, 10, 11, 12]], 1.0))

    def _state_bounds(self, entries: ConeRows) -> None:
        """Virtual controls, mass, altitude, torque and time of flight; what is out of use is zero."""
        layout, problem, units = self._layout, self._problem, self._units
        for virtual in layout.virtual:
            entries.add("nonnegative", np.zeros(virtual.shape), (virtual, -1.0))
        dry = np.array([-problem.body.lander.dry_mass / units.mass])
        entries.add("nonnegative", dry, (layout.state[-1:, 13], -1.0))
        height = layout.state[1:-1, 2]
        entries.add("nonnegative", np.zeros(height.shape), (height, -1.0))
        span = np.array([layout.duration])
        entries.add("nonnegative", np.array([-self.window[0]]), (span, -1.0))
        entries.add("nonnegative", np.array([self.window[1]]), (span, 1.0))
        for axis, limit in enumerate(problem.body.torque_limit):
            torque = layout.control[:, 3 + axis]
            if limit == 0.0:
                entries.add("zero", np.zeros(torque.shape), (torque, 1.0))
                continue
            bound = np.full(torque.shape, limit / units.torque)
            entries.add("nonnegative", bound, (torque, 1.0))
            entries.add("nonnegative", bound, (torque, -1.0))
        if problem.body.gimbal_limit == 0.0:
            across = layout.control[1 if not problem.free_thrust else 0 :, :2]
            entries.add("zero", np.zeros(across.shape), (across, 1.0))

    def _state_commands(self, entries: ConeRows, about: Iterate) -> None:
        """Limits of the commanded thrust F + lag F' at both ends of each interval; F' at the last duration.

        The least thrust of a gimballed engine holds along the last iterate's direction, which is safe.
        """
        layout, problem, units = self._layout, self._problem, self._units
        gimbal, lander = problem.body.gimbal_limit, problem.body.lander
        lead = problem.body.engine_lag / units.time / about.intervals[0]
        before, after = layout.control[:-1, :3], layout.control[1:, :3]
        least, most = lander.min_thrust / units.force, lander.max_thrust / units.force
        for here in (0.0, 1.0):
            weights = 1.0 - here - lead, here + lead
            thrust = weights[0] * about.controls[:-1, :3] + weights[1] * about.controls[1:, :3]
            size = np.linalg.norm(thrust, axis=1)
            up = np.array([0.0, 0.0, 1.0])
            if gimbal == 0.0:
                column = before[:, 2], after[:, 2]
                for sign, level in ((-1.0, -least), (1.0, most)):
                    terms = [(c, sign * w) for c, w in zip(column, weights, strict=True)]
                    entries.add("nonnegative", np.full(len(before), level), *terms)
                continue
            along = np.where(size[:, None] > 1e-6, thrust / np.maximum(size, 1e-6)[:, None], up)
            terms = [(c, -w * along) for c, w in zip((before, after), weights, strict=True)]
            entries.add("nonnegative", np.full(len(before), -least), *terms)
            self._state_gimbal(entries, (before, after), weights, most)

    def _state_gimbal(
        self, entries: ConeRows, columns: tuple[Index, Index], weights: tuple[float, float], most: float
    ) -> None:
        """|F| <= most, and |F across| <= tan(limit) F along, of F = sum of weights times columns."""
        count, tangent = len(columns[0]), math.tan(self._problem.body.gimbal_limit)
        bound = np.zeros((count, 4))
        bound[:, 0] = most
        entries.add_cones(bound, columns, weights, ((1, 0, 1.0), (2, 1, 1.0), (3, 2, 1.0)))
        rows = ((0, 2, tangent), (1, 0, 1.0), (2, 1, 1.0))
        entries.add_cones(np.zeros((count, 3)), columns, weights, rows)

    def _state_cones(self, entries: ConeRows) -> None:
        """Tilt, rates and glide slope from the second node to the last but one."""
        problem, units = self._problem, self._units
        inner = self._layout.state[1:-1]
        count, body = len(inner), problem.body
        if body.tilt_limit < math.pi:
            bound = np.zeros((count, 3))
            bound[:, 0] = math.sin(0.5 * body.tilt_limit)
            entries.add_cones(bound, (inner,), (1.0,), ((1, 7, 1.0), (2, 8, 1.0)))
        bound = np.zeros((count, 4))
        bound[:, 0] = body.rate_limit * units.time
        entries.add_cones(bound, (inner,), (1.0,), ((1, 10, 1.0), (2, 11, 1.0), (3, 12, 1.0)))
        if problem.glide_slope is not None and problem.glide_slope < 0.5 * math.pi:
            rows = ((0, 2, math.tan(problem.glide_slope)), (1, 0, 1.0), (2, 1, 1.0))
            entries.add_cones(np.zeros((count, 3)), (inner,), (1.0,), rows)

    def _state_midway_rates(self, entries: ConeRows, about: Iterate) -> None:
        """The rates' limit midway, where a torque that changes sign takes them further than at the nodes.

        There they are (w + w')/2 + h/8 (a - a'), a the acceleration by torque and gimbal at the last masses.
        """
        layout, units = self._layout, self._units
        body = units.body(self._problem)
        scale = (about.states[:, 13] / body.mass) ** body.exponent
        eighth = about.intervals[0] / 8.0
        count = layout.nodes - 1
        first = entries.count
        across = ((1, body.arm[0]), (0, -body.arm[1]), (None, 0.0))
        for axis, (column, arm) in enumerate(across):
            row = first + 4 * np.arange(count) + 1 + axis
            for node, sign in ((slice(0, -1), 1.0), (slice(1, None), -1.0)):
                terms = [(layout.state[node, 10 + axis], np.full(count, 0.5))]
                push = sign * eighth / scale[node]
                terms.append((layout.control[node, 3 + axis], push * body.turn[axis]))
                if column is not None and self._problem.body.gimbal_limit > 0.0:
                    terms.append((layout.control[node, column], push * arm))
                for columns, value in terms:
                    entries.row.append(row)
                    entries.column.append(columns)
                    entries.value.append(-value)
        bound = np.zeros((count, 4))
        bound[:, 0] = self._problem.body.rate_limit * units.time
        entries.bound.append(bound.ravel())
        entries.count += bound.size
        entries.cones += [("second_order", 4)] * count
