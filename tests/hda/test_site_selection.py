"""Where to land: pixels against slow searches, thresholds, ties, and the memory of each selection."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import State
from hda.ground.tile import Tile
from hda.policies.privileged.oracle import OracleSite, nearest_clear_site, safe_clearance
from hda.site_selection import (
    NearestSafeSite,
    NominalSite,
    SingleDivertSite,
    nearest_safe_site,
    observed_safety,
    safest_site,
)
from hda.task.observation import Observation

TARGET = np.array([500.0, 400.0, 50.0])
VIEW: Any = None  # no selection here reads the view
SEEDS = st.integers(0, 2**32 - 1)


def observation(safety_map, altitude: float = 900.0, target=TARGET, width: float = 64.0) -> Observation:
    state = State(np.array([480.0, 390.0, altitude]), np.array([1.0, 1.0, -20.0]), 1190.0)
    safety_map = np.asarray(safety_map, dtype=np.float32)
    return Observation(0, 0.0, state, np.array(target, dtype=float), safety_map, width, 40.0)


def coarse_map(seed: int, pixels: int) -> np.ndarray:
    """Few levels, so that ties abound."""
    levels = np.array([0.0, 0.4999, 0.5, 0.9, 0.95, 1.0], dtype=np.float32)
    return np.random.default_rng(seed).choice(levels, size=(pixels, pixels))


def pixel_centre(row: int, column: int, pixels: int, width: float) -> tuple[float, float]:
    """Pixel (i, j) lies at r_f + ((j + 0.5)/n - 0.5, (i + 0.5)/n - 0.5) w."""
    x = TARGET[0] + ((column + 0.5) / pixels - 0.5) * width
    y = TARGET[1] + ((row + 0.5) / pixels - 0.5) * width
    return x, y


@settings(max_examples=60)
@given(seed=SEEDS, pixels=st.sampled_from([2, 5, 8, 16]), width=st.sampled_from([1.0, 64.0, 171.3]))
def test_the_safest_pixel_is_the_first_of_the_greatest_in_row_major_order(seed, pixels, width):
    seen = coarse_map(seed, pixels)
    best, where = -1.0, (0, 0)
    for row in range(pixels):
        for column in range(pixels):
            if seen[row, column] > best:
                best, where = seen[row, column], (row, column)
    site = safest_site(observation(seen, width=width))
    np.testing.assert_allclose(site, [*pixel_centre(*where, pixels, width), 50.0], rtol=1e-12)


@settings(max_examples=60)
@given(seed=SEEDS, pixels=st.sampled_from([2, 4, 8, 16]), threshold=st.sampled_from([0.5, 0.95, 1.0]))
def test_the_nearest_safe_pixel_is_nearest_to_the_target(seed, pixels, threshold):
    seen = coarse_map(seed, pixels)
    nearest, where = math.inf, None
    for row in range(pixels):
        for column in range(pixels):
            # in pixels from the middle, doubled: whole numbers, so that ties are ties
            square = (2 * row + 1 - pixels) ** 2 + (2 * column + 1 - pixels) ** 2
            if seen[row, column] >= np.float32(threshold) and square < nearest:
                nearest, where = square, (row, column)
    site = nearest_safe_site(observation(seen), threshold)
    if where is None:
        assert site is None
    else:
        assert site is not None
        np.testing.assert_allclose(site, [*pixel_centre(*where, pixels, 64.0), 50.0], rtol=1e-12)


def test_the_lander_does_not_decide_which_site_is_nearest():
    seen = np.zeros((8, 8))
    seen[1, 4] = seen[6, 7] = 1.0  # the second is nearer to a lander in the north-east corner
    near = observation(seen)
    corner = State(TARGET + np.array([32.0, 32.0, 50.0]), np.zeros(3), 1190.0)
    far = Observation(0, 0.0, corner, TARGET, near.safety_map, 64.0, 40.0)
    for look in (near, far):
        site = nearest_safe_site(look, 0.95)
        assert site is not None
        np.testing.assert_allclose(site, [*pixel_centre(1, 4, 8, 64.0), 50.0])


@given(row=st.integers(0, 15), column=st.integers(0, 15), width=st.floats(0.5, 300.0))
def test_the_observed_safety_of_a_pixels_centre_is_its_own(row, column, width):
    seen = np.arange(256, dtype=np.float32).reshape(16, 16) / 256.0
    look = observation(seen, width=width)
    assert observed_safety(look, look.site(row, column)) == seen[row, column]
    assert look.pixel(look.site(row, column)) == (row, column)


@pytest.mark.parametrize(
    "offset", [(32.001, 0.0), (-32.001, 0.0), (0.0, 32.001), (0.0, -32.001), (900.0, 900.0)]
)
def test_outside_the_look_nothing_is_known_to_be_safe(offset):
    look = observation(np.ones((64, 64)))
    assert observed_safety(look, TARGET + np.array([*offset, 0.0])) == 0.0
    assert observed_safety(look, TARGET + np.array([*offset, 0.0]) * 0.99 * 32.0 / 900.0) == 1.0


def test_the_nominal_site_never_moves():
    site, memory = NominalSite().select(observation(np.eye(8)), NominalSite().begin(VIEW))
    assert (site.tolist(), memory) == (TARGET.tolist(), None)


# Single Divert


def peak(row: int, column: int) -> np.ndarray:
    seen = np.zeros((8, 8))
    seen[row, column] = 1.0
    return seen


def test_single_divert_fires_once_at_the_first_look_at_or_below_500_m():
    selection = SingleDivertSite()
    memory = selection.begin(VIEW)
    target = TARGET
    fired = []
    for k, altitude in enumerate([950.0, 700.0, 500.0 + 1e-9, 500.0, 400.0, 120.0]):
        look = observation(peak(k, 7 - k), altitude, target)
        site, memory = selection.select(look, memory)
        fired.append(not np.array_equal(site, target))
        if fired[-1]:
            np.testing.assert_array_equal(site, safest_site(look))
        target = site
    assert fired == [False, False, False, True, False, False]


def test_single_divert_does_not_fire_again_where_its_own_pixel_was_the_safest():
    selection = SingleDivertSite()
    first = observation(peak(3, 3), 480.0)
    site, memory = selection.select(first, False)
    second = observation(peak(0, 7), 300.0, site)
    assert selection.select(second, memory)[0].tolist() == site.tolist()


def test_the_divert_altitude_is_a_parameter():
    selection = SingleDivertSite(divert_altitude=700.0)
    assert selection.select(observation(peak(0, 0), 700.0), False)[1]
    assert not selection.select(observation(peak(0, 0), 700.1), False)[1]


# Nearest safe


def map_of(centre: float, elsewhere: float) -> np.ndarray:
    """A 9 x 9 look: the target lies in pixel (4, 4); one other pixel, (4, 6), differs from zero."""
    seen = np.zeros((9, 9))
    seen[4, 4], seen[4, 6] = centre, elsewhere
    return seen


@pytest.mark.parametrize(
    ("centre", "elsewhere", "kept"),
    [(0.5, 1.0, True), (0.4999, 1.0, False), (1.0, 1.0, True), (0.4999, 0.9499, False), (0.6, 0.95, True)],
)
def test_a_selected_site_is_kept_while_it_looks_at_least_half_safe(centre, elsewhere, kept):
    site, memory = NearestSafeSite().select(observation(map_of(centre, elsewhere)), True)
    assert np.array_equal(site, TARGET) == kept
    assert memory is True
    if not kept:
        assert site[0] == pytest.approx(TARGET[0] + 2.0 * 64.0 / 9.0)


@pytest.mark.parametrize(("centre", "moves"), [(0.95, False), (0.9499, True), (0.6, True)])
def test_the_first_look_selects_whatever_the_nominal_target_looks_like(centre, moves):
    look = observation(map_of(centre, 0.97))
    site, memory = NearestSafeSite().select(look, NearestSafeSite().begin(VIEW))
    assert memory is True
    assert np.allclose(site, TARGET) != moves


def test_where_nothing_looks_safe_the_safest_is_taken():
    look = observation(map_of(0.1, 0.94))
    np.testing.assert_array_equal(NearestSafeSite().select(look, True)[0], safest_site(look))


def test_a_look_without_a_map_moves_no_target():
    dark = observation(np.zeros((9, 9)))
    for memory in (False, True):
        site, after = NearestSafeSite().select(dark, memory)
        np.testing.assert_array_equal(site, dark.target)
        assert after is memory


def test_the_thresholds_are_parameters():
    selection = NearestSafeSite(keep_threshold=0.3, select_threshold=0.6)
    assert np.array_equal(selection.select(observation(map_of(0.3, 1.0)), True)[0], TARGET)
    moved = selection.select(observation(map_of(0.2, 0.6)), True)[0]
    assert moved[0] == pytest.approx(TARGET[0] + 2.0 * 64.0 / 9.0)


# The oracle


def tile_of(safe: np.ndarray) -> Tile:
    shape = safe.shape
    return Tile(-1, np.zeros(shape, np.float32), safe.astype(np.float32), safe.astype(np.bool_))


def patchy(seed: int, size: int = 60) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    field = gaussian_filter(np.random.default_rng(seed).standard_normal((size, size)), 3.0)
    return field < np.quantile(field, 0.5)


def all_safe_within(safe: np.ndarray, x: float, y: float, reach: float) -> bool:
    """Whether every cell that comes within `reach` of (x, y) is safe; cells are squares of 1 m."""
    for row in range(-3, safe.shape[0] + 3):
        for column in range(-3, safe.shape[1] + 3):
            away_x = max(abs(column + 0.5 - x) - 0.5, 0.0)
            away_y = max(abs(row + 0.5 - y) - 0.5, 0.0)
            if math.hypot(away_x, away_y) < reach:
                inside = 0 <= row < safe.shape[0] and 0 <= column < safe.shape[1]
                if not inside or not safe[row, column]:
                    return False
    return True


@settings(max_examples=12)
@given(seed=SEEDS)
def test_all_ground_within_two_metres_of_the_oracles_site_is_safe(seed):
    safe = patchy(seed)
    target = np.array([*np.random.default_rng(seed).uniform(0.0, 60.0, size=2), 50.0])
    selection = OracleSite(tile_of(safe))
    site, memory = selection.select(observation(np.zeros((8, 8)), target=target), selection.begin(VIEW))
    assert all_safe_within(safe, site[0], site[1], 2.0)
    assert site[2] == 50.0
    assert (site[:2] % 1.0 == 0.5).all()
    # and no cell with as much room lies nearer
    here = math.dist(site[:2], target[:2])
    room = safe_clearance(tile_of(safe))
    for row, column in np.argwhere(room >= 2.0):
        assert math.dist((column + 0.5, row + 0.5), target[:2]) >= here - 1e-9
    # it stays, wherever the look has gone
    again = selection.select(observation(np.ones((8, 8)), target=site), memory)[0]
    np.testing.assert_array_equal(again, site)


@settings(max_examples=15)
@given(seed=SEEDS)
def test_clearance_is_the_distance_to_the_nearest_unsafe_cell(seed):
    safe = patchy(seed, 20)
    unsafe = [tuple(cell) for cell in np.argwhere(~safe)]
    edge = range(-1, 21)
    unsafe += [(row, column) for row in edge for column in edge if {row, column} & {-1, 20}]
    brute = np.array(
        [[min(math.dist((r, c), cell) for cell in unsafe) for c in range(20)] for r in range(20)]
    )
    np.testing.assert_allclose(safe_clearance(tile_of(safe)), brute - 0.5, rtol=1e-6)


def test_without_enough_room_anywhere_the_oracle_takes_the_most():
    safe = np.zeros((30, 30), dtype=bool)
    safe[10:13, 20:23] = True
    site = nearest_clear_site(tile_of(safe), np.array([2.0, 2.0, 50.0]), 2.0)
    np.testing.assert_array_equal(site, [21.5, 11.5, 50.0])
