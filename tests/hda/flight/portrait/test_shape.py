"""The lander's surface faces outwards and stands on its pads, and its plume tells the throttle."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hda.flight.portrait.shape import PLUME_COLOR, Surface, lander_surface, plume_surface


def volume(surface: Surface) -> float:
    """By the divergence theorem: positive where the triangles of a closed surface face outwards."""
    first, second, third = np.moveaxis(surface.vertices[surface.triangles], 1, 0)
    return float(np.einsum("ij,ij->i", first, np.cross(second, third)).sum() / 6.0)


def of_color(surface: Surface, color: str) -> Surface:
    kept = [k for k, each in enumerate(surface.colors) if each == color]
    return Surface(surface.vertices, surface.triangles[kept], (color,) * len(kept))


def octagon(radius: float) -> float:
    return 2.0 * np.sqrt(2.0) * radius**2


def test_stage_cabin_and_plume_face_outwards_and_hold_what_their_frusta_hold():
    lander = lander_surface()
    stage, cabin = (of_color(lander, color) for color in ("#a3a3a3", "#d4d4d4"))
    np.testing.assert_allclose(volume(stage), 0.18 * octagon(0.21), rtol=1e-12)
    rings = [(0.15, 0.32), (0.17, 0.40), (0.10, 0.48)]
    frusta = sum(
        (b[1] - a[1]) / 3.0 * 2.0 * np.sqrt(2.0) * (a[0] ** 2 + a[0] * b[0] + b[0] ** 2)
        for a, b in itertools.pairwise(rings)
    )
    # the cabin's floor lies on the stage and is not drawn: it is the disc that closes it
    floor = 0.32 / 3.0 * octagon(0.15)
    np.testing.assert_allclose(volume(cabin) - floor, frusta, rtol=1e-12)


def test_it_stands_on_four_pads_within_the_circle_around_them():
    points = lander_surface().vertices
    radius = np.hypot(points[:, 0], points[:, 1])
    assert points[:, 2].min() == 0.0
    assert 0.48 < radius.max() <= 0.5 + 1e-12
    feet = points[points[:, 2] == 0.0]
    quarters = {(bool(x > 0), bool(y > 0)) for x, y in feet[:, :2]}
    assert len(quarters) == 4
    np.testing.assert_allclose(feet[:, :2].mean(axis=0), [0.0, 0.0], atol=1e-12)


@given(throttle=st.floats(0.0, 1.2))
def test_the_plume_hangs_from_the_nozzle_in_proportion_to_the_throttle(throttle: float):
    plume, full = plume_surface(throttle).vertices, plume_surface(1.0).vertices
    top = full[:, 2].max()
    assert plume[:, 2].max() == top
    np.testing.assert_allclose(top - plume[:, 2].min(), throttle * (top - full[:, 2].min()), atol=1e-12)
    assert set(plume_surface(throttle).colors) == {PLUME_COLOR}
    length = top - plume[:, 2].min()
    np.testing.assert_allclose(volume(plume_surface(throttle)), octagon(0.072) * length / 3.0, atol=1e-12)
