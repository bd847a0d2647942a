"""Costs in the time of flight of a known shape, as the time searches meet them."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Sample:
    time: float
    value: float = math.nan
    slope: float = math.nan
    solved: bool = True


def hyperbola(a=1.0, b=50.0, c=8.0, feasible=(0.0, math.inf)):
    """J' = a - b/(T - c)^2, least at c + sqrt(b/a)."""

    def evaluate(time):
        if not feasible[0] <= time <= feasible[1] or time <= c:
            return Sample(time, solved=False)
        return Sample(time, a * time + b / (time - c), a - b / (time - c) ** 2)

    return evaluate
