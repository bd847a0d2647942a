"""The landing site in the filter, look by look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.validation import finite_vector
from hda.navigation.attitude import correct_attitude
from hda.navigation.layout import SITE, SITE_FIX, FilterMemory
from hda.navigation.navigation_state import NavigationState, check_begun
from hda.navigation.sensor_errors import FixDraws
from hda.navigation.sensors import SiteFixes
from hda.navigation.site_fixes import acquire_site, fix_site, measure_site
from hda.navigation.system import NavigationSystem

_FIRST_LOOK = SiteFixes()


def find_site(
    system: NavigationSystem, navigation: NavigationState, position: Array, site: Array, draws: FixDraws
) -> NavigationState:
    """Put a site into the filter where a look sees it first.

    Args:
        system: sensors and filter; without `system.site` the look is taken to be as good as one by default.
        navigation: the filter, begun by a system with a gyroscope as this has one.
        position: [m] shape (3,), the vehicle's true position.
        site: [m] shape (3,), the site's true place.
        draws: of this look; a first look is never without its site.

    Raises:
        ValueError: the filter was begun without the system's gyroscope or with one that it lacks.
    """
    check_begun(system, navigation)
    deviation = _look_deviation(system, position, site)
    reading = measure_site(site - position, navigation.errors.tilt.copy(), deviation, draws.normal)
    memory = navigation.memory()
    acquire_site(memory, reading, deviation)
    return _close(navigation, memory)


def track_site(
    system: NavigationSystem, navigation: NavigationState, position: Array, site: Array, draws: FixDraws
) -> tuple[NavigationState, float]:
    """Take in where a later look sees the site.

    Args:
        system: sensors and filter.
        navigation: the filter, begun by a system with a gyroscope as this has one.
        position: [m] shape (3,), the vehicle's true position.
        site: [m] shape (3,), the site's true place.
        draws: of this look.

    Returns:
        The filter, and the squared innovation of the fix (3 degrees of freedom), NaN where there was none.

    Raises:
        ValueError: the filter was begun without the system's gyroscope or with one that it lacks.
    """
    check_begun(system, navigation)
    fixes = system.site
    slant = float(np.linalg.norm(site - position))
    if fixes is None or slant < fixes.floor or draws.uniform < fixes.dropout:
        return navigation, float("nan")
    deviation = fixes.deviation(slant)
    reading = measure_site(site - position, navigation.errors.tilt.copy(), deviation, draws.normal)
    memory, gate = navigation.memory(), float(system.gates[SITE_FIX])
    square = fix_site(memory, reading, deviation, gate, system.patience)
    tilt = navigation.errors.tilt.copy()
    correct_attitude(memory, tilt)
    corrected = replace(navigation, errors=replace(navigation.errors, tilt=tilt))
    return _close(corrected, memory), float(square)


def choose_site(navigation: NavigationState, offset: ArrayLike) -> NavigationState:
    """Change the tracked site for another on the map that the looks made.

    The map hangs on the old site, so the new one takes over its error.

    Args:
        navigation: the filter.
        offset: [m] shape (3,), new less old site on the map.

    Raises:
        ValueError: the offset is not three finite numbers.
    """
    return _close(navigation, move_site(navigation, finite_vector("offset", offset, 3)))


def move_site(navigation: NavigationState, offset: Array) -> FilterMemory:
    """As `choose_site`, for the kernels, which go on changing it."""
    memory = navigation.memory()
    memory.mean[SITE : SITE + 3] += offset
    return memory


def _close(navigation: NavigationState, memory: FilterMemory) -> NavigationState:
    return NavigationState(*memory, navigation.errors, navigation.instant)


def _look_deviation(system: NavigationSystem, position: Array, site: Array) -> float:
    return (system.site or _FIRST_LOOK).deviation(float(np.linalg.norm(site - position)))
