"""ALHAT's choice of a site: safest, with room to the nearest hazard, and cheap to reach.

After Johnson, Huertas, Werner and Montgomery ("Analysis of on-board hazard detection and avoidance for safe
lunar landing", IEEE Aerospace, 2008) and Ivanov, Huertas and Brady ("Probabilistic hazard detection for
autonomous safe landing", AIAA GNC, 2013): the map of safety is smoothed by the error with which the lander
comes down, and a site is worth

    score = P + w_d min(d, D) / D - w_f (propellant - least propellant) / propellant on board,

with P its smoothed probability of safety and d its distance to the nearest hazard. One scan decides.

Deviations. The full texts could not be read: that safety, the distance to hazards and the error of navigation
are combined is from their abstracts and US patent 9,141,113; that propellant counts too is from what others
say of the former. The form of the score and its weights are chosen here, on tuning episodes. The map is a
look of this benchmark, whose edge counts as hazard, not a mosaic of a gimballed flash LIDAR. The site is
flown to as it was selected, without tracking of the ground, and no list of further sites is kept for a pilot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.state import State
from guidance.two_impulse import divert_cost
from guidance.validation import finite_number
from hda.policies.beliefs.surroundings import squared_distance
from hda.policies.rivals.map_smoothing import smooth_map
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True)
class AlhatWeights:
    """What the score weighs; chosen on tuning episodes of `paper` (docs/explanation/rivals.md).

    Attributes:
        scan_range: [m] from the target; the first look with a map from within it decides. ALHAT's sensor was
            specified to find hazards of 0.3 m from 1 km (Roback et al., 2015).
        dispersion: [m] standard deviation of the touchdown about the site, along each axis.
        hazard_probability: a pixel that looks less safe than this is a hazard.
        clearance: [m] D, the distance to a hazard beyond which more is worth nothing.
        distance: w_d.
        propellant: w_f.

    Raises:
        ValueError: a weight is negative or not finite, or the clearance is not positive.
    """

    scan_range: float = 1000.0
    dispersion: float = 1.0
    hazard_probability: float = 0.5
    clearance: float = 10.0
    distance: float = 1.0
    propellant: float = 1.0

    def __post_init__(self) -> None:
        """Refuse weights that mean nothing."""
        for name in ("scan_range", "dispersion", "distance", "propellant"):
            finite_number(name, getattr(self, name), at_least=0.0)
        finite_number("hazard_probability", self.hazard_probability, at_least=0.0, at_most=1.0)
        finite_number("clearance", self.clearance, above=0.0)


@dataclass(frozen=True, eq=False)
class AlhatMemory:
    """What the selection remembers.

    Attributes:
        view: the scenario.
        selected: whether the scan has been made.
    """

    view: ScenarioView
    selected: bool = False


@dataclass(frozen=True)
class AlhatSite:
    """Site selection by one scan and the greatest score.

    Attributes:
        weights: of the score.
    """

    weights: AlhatWeights = AlhatWeights()

    def begin(self, view: ScenarioView) -> AlhatMemory:
        """Nothing scanned yet; kernels are loaded here, so that the scan does not wait for them."""
        hazard_distance(np.zeros((1, 1), dtype=np.bool_))
        above, place = State(np.array([0.0, 0.0, 100.0]), np.zeros(3), view.lander.dry_mass), np.zeros(1)
        divert_cost(above, place, place, 0.0, view.lander, view.gravity)
        return AlhatMemory(view)

    def select(self, observation: Observation, memory: AlhatMemory) -> tuple[Array, AlhatMemory]:
        """Score the first map from low enough; keep the target before and after."""
        away = observation.state.position - observation.target
        in_range = away[2] > 0.0 and float(np.linalg.norm(away)) <= self.weights.scan_range
        if memory.selected or not in_range or not observation.has_map:
            return observation.target, memory
        score = self.score(observation, memory.view)
        row, column = divmod(int(np.argmax(score)), score.shape[1])
        return observation.site(row, column), AlhatMemory(memory.view, selected=True)

    def score(self, observation: Observation, view: ScenarioView) -> Array:
        """Score of each pixel of a look from above its target, shape (n, n)."""
        weights, pixel = self.weights, observation.pixel_size
        safety = observation.safety_map.astype(np.float64)
        room = np.minimum(hazard_distance(safety < weights.hazard_probability) * pixel, weights.clearance)
        offset, target = observation.pixel_offset, observation.target
        lander, state = view.lander, observation.state
        propellant = divert_cost(
            state, target[0] + offset, target[1] + offset, float(target[2]), lander, view.gravity
        )
        on_board = max(state.mass - lander.dry_mass, 1e-9)
        return (
            smooth_map(safety, weights.dispersion / pixel)
            + weights.distance * room / weights.clearance
            - weights.propellant * (propellant - propellant.min()) / on_board
        )


def hazard_distance(hazard: NDArray[np.bool_]) -> Array:
    """Pixels from each to the nearest hazard, shape (n, n); beyond the edge all is hazard."""
    framed = np.pad(hazard, 1, constant_values=True)
    return np.sqrt(squared_distance(framed, max(framed.shape))[1:-1, 1:-1].astype(np.float64))
