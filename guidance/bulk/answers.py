"""What comes out in bulk: one row for each start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from guidance.arrays import Array
from guidance.bulk.certified_flight import Finding, answer_start, vehicle_of
from guidance.bulk.sampling import Nodes
from guidance.bulk.starts import Starts
from guidance.descent.certificate import Certificate
from guidance.descent.plan import PlanStatus
from guidance.flight_time.extremal import new_extremal
from guidance.lower_bound.proof import certify_cover

STATUSES = tuple(PlanStatus)
"""What the numbers of a status array stand for."""
OPTIMAL = STATUSES.index(PlanStatus.OPTIMAL)
INFEASIBLE = STATUSES.index(PlanStatus.INFEASIBLE)
UNDECIDED = STATUSES.index(PlanStatus.LIMIT_REACHED)


@dataclass(frozen=True, eq=False)
class Descents:
    """Answers to N starts, in SI and the site frame; numbers are nan where there is no flight.

    Attributes:
        starts: what was asked.
        status: shape (N,): indices into `STATUSES`.
        propellant: [kg] shape (N,), that the flight burns.
        time_of_flight: [s] shape (N,).
        lower_bound: [kg] shape (N,), what no flight burns less than; inf where it is proved that there is
            none, nan where nothing is proved.
        first_thrust: [N] shape (N, 3), at the start; zero where the flight begins with a coast.
        method: shape (N,): 'indirect', or the method of `solve_pdg` that answered; empty where nobody did.
        nodes: the flights on nodes, where they were asked for; else None.
        certificates: by row, those of `solve_pdg` and of bounds that were searched for.
    """

    starts: Starts
    status: npt.NDArray[np.int8]
    propellant: Array
    time_of_flight: Array
    lower_bound: Array
    first_thrust: Array
    method: npt.NDArray[np.str_]
    nodes: Nodes | None = None
    certificates: Mapping[int, Certificate | None] = field(default_factory=dict)

    def __len__(self) -> int:
        """N."""
        return len(self.starts)

    @property
    def optimality_gap(self) -> Array:
        """[kg] shape (N,): what the flight burns above the proved bound."""
        return self.propellant - self.lower_bound

    @property
    def optimal(self) -> npt.NDArray[np.bool_]:
        """Shape (N,): where there is a flight of least propellant."""
        return self.status == OPTIMAL

    @property
    def infeasible(self) -> npt.NDArray[np.bool_]:
        """Shape (N,): where it is proved that there is no flight."""
        return self.status == INFEASIBLE

    def status_of(self, index: int) -> PlanStatus:
        """The status of one start."""
        return STATUSES[self.status[index]]

    def certificate(self, index: int) -> Certificate | None:
        """The proof of one row, made again; None where nothing is proved.

        Its `verified` checks it by code that shares nothing with what found it.
        """
        if index in self.certificates or self.method[index] != "indirect":
            return self.certificates.get(index)
        starts = self.starts
        vehicle = vehicle_of(starts.lander, starts.gravity, starts.limits)
        start, target = starts.states[index], starts.targets[index]
        answer, bound = answer_start(start, target, vehicle, new_extremal())
        infeasible = answer.finding == Finding.INFEASIBLE
        return certify_cover(starts.problem(index), bound.spent_at_most, bound.times, bound.cover, infeasible)
