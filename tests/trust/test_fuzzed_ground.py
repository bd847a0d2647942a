"""Whatever is given as ground: a labelled error or a right safety map."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hda.ground.elevation_file import ElevationFileError, open_elevation
from hda.ground.own_terrain import open_own_terrain
from hda.ground.tile import make_tile
from hda.safety.criteria import SafetyCriteria
from hda.safety.safety_map import assess_safety

HEIGHTS = st.one_of(
    st.floats(-5.0, 5.0),
    st.sampled_from([0.0, math.nan, math.inf, -math.inf, 1e300, -1e308, 3.4e38, -32768.0, 5e-324, 1e9]),
)
DTYPES = (
    "float16",
    "float32",
    "float64",
    "int8",
    "uint64",
    "bool",
    "complex128",
    "U5",
    "datetime64[s]",
    "object",
)


@settings(max_examples=60)
@given(data=st.data())
def test_any_array_of_heights(data: st.DataObject) -> None:
    shape = data.draw(st.tuples(st.integers(0, 24), st.integers(0, 24)))
    dem = np.full(shape, data.draw(st.floats(-100.0, 100.0)))
    for _ in range(data.draw(st.integers(0, 4))):
        if dem.size:
            place = data.draw(st.integers(0, shape[0] - 1)), data.draw(st.integers(0, shape[1] - 1))
            dem[place] = data.draw(HEIGHTS)
    before = dem.copy()
    try:
        safety = assess_safety(dem)
    except ValueError:
        assert min(shape) < 11 or np.isinf(dem).any() or (np.abs(dem) > 1e9).any()
        return
    np.testing.assert_array_equal(dem, before)
    assert np.isfinite(safety.probability).all()
    assert ((safety.probability >= 0.0) & (safety.probability <= 1.0)).all()
    for row, column in np.argwhere(np.isnan(dem)):  # the hole and all around it
        around = (slice(max(0, row - 2), row + 3), slice(max(0, column - 2), column + 3))
        assert not safety.deterministic[around].any()
        assert (safety.probability[around] == 0.0).all()
    safe = safety.deterministic
    assert np.isfinite(safety.slope[safe]).all()
    assert (safety.slope[safe] <= math.radians(10.0)).all()
    assert (safety.roughness[safe] <= 0.30).all()
    edge = np.ones(shape, dtype=bool)
    edge[5:-5, 5:-5] = False
    assert not safe[edge].any()
    if (dem == dem.flat[0]).all():  # flat ground is safe wherever the lander fits
        assert safe[~edge].all()


@settings(max_examples=60)
@given(data=st.data())
def test_any_other_array_is_refused_or_read_as_numbers(data: st.DataObject) -> None:
    shape = data.draw(arrays.array_shapes(min_dims=0, max_dims=3, max_side=14))
    kind = np.dtype(data.draw(st.sampled_from(DTYPES)))
    dem: Any = np.zeros(shape, dtype=kind)
    try:
        safety = assess_safety(dem)
    except ValueError:
        assert len(shape) != 2 or min(shape) < 11 or kind.kind not in "biufO"
        return
    assert len(shape) == 2
    assert kind.kind in "biufO"
    assert safety.deterministic[5:-5, 5:-5].all()


@given(
    pixel_size=st.floats(),
    footprint_diameter=st.floats(),
    pad_diameter=st.floats(),
    max_slope=st.floats(),
    max_roughness=st.floats(),
    range_noise=st.floats(),
)
def test_any_limit_is_refused_or_used(pixel_size: float, **limits: float) -> None:
    try:
        safety = assess_safety(np.zeros((21, 21)), pixel_size, **limits)
    except ValueError:
        return
    assert np.isfinite(safety.probability).all()
    assert safety.deterministic[10, 10]


@pytest.mark.parametrize(
    ("pixel_size", "diameter"), [(1e-300, 10.0), (1e-3, 10.0), (1.0, 1e300), (5e-324, 1e300)]
)
def test_a_lander_larger_than_the_map_is_refused_at_once(pixel_size: float, diameter: float) -> None:
    with pytest.raises(ValueError, match="hold the lander"):
        assess_safety(np.zeros((30, 30)), pixel_size, footprint_diameter=diameter)


def test_masked_ground_is_unknown_ground() -> None:
    dem = np.ma.masked_array(np.zeros((31, 31)), mask=False)
    dem[15, 15] = np.ma.masked
    for safety in (assess_safety(dem), make_tile(dem, SafetyCriteria())):
        assert not safety.deterministic[13:18, 13:18].any()
        assert safety.deterministic[15, 6]
    assert np.isnan(make_tile(dem, SafetyCriteria()).elevation[15, 15])


@pytest.mark.parametrize("height", [math.inf, -math.inf, 3.4e38, -1e308])
def test_a_tile_of_impossible_heights_is_refused(height: float) -> None:
    dem = np.zeros((31, 31))
    dem[3, 4] = height
    with pytest.raises(ValueError, match="NaN where the elevation is unknown"):
        make_tile(dem, SafetyCriteria())


# ---- files ----


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A whole GeoTIFF and a whole .npy, as bytes."""
    import rasterio
    from rasterio.crs import CRS
    from rasterio.transform import Affine

    folder = tmp_path_factory.mktemp("files")
    heights = np.random.default_rng(0).normal(size=(40, 30)).astype(np.float32)
    np.save(folder / "site.npy", heights)
    crs = CRS.from_proj4("+proj=stere +lat_0=-85 +R=1737400 +units=m")
    shape = {"height": 40, "width": 30, "count": 1, "dtype": "float32"}
    with rasterio.open(
        folder / "site.tif", "w", driver="GTiff", crs=crs, transform=Affine(1, 0, 0, 0, -1, 40), **shape
    ) as stream:
        stream.write(heights, 1)
    return {name: (folder / name).read_bytes() for name in ("site.npy", "site.tif")}


@pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")
@settings(max_examples=150)
@given(data=st.data())
def test_a_damaged_elevation_file_is_refused_or_read(
    files: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from(sorted(files)))
    content = bytearray(files[name])
    how = data.draw(st.sampled_from(["cut", "change", "rubbish"]))
    if how == "cut":
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    elif how == "change":
        for _ in range(data.draw(st.integers(1, 3))):
            content[data.draw(st.integers(0, min(500, len(content)) - 1))] = data.draw(st.integers(0, 255))
    else:
        content = bytearray(data.draw(st.binary(max_size=200)))
    path = tmp_path_factory.mktemp("damaged") / name
    path.write_bytes(content)
    try:
        with open_elevation(path) as source:
            part = source.read(0, min(40, source.shape[0]), 0, min(30, source.shape[1]))
        assert part.dtype == np.float64
        assert not np.isinf(part).any()
    except ElevationFileError:
        return


@settings(max_examples=30)
@given(content=st.binary(max_size=300), suffix=st.sampled_from([".npy", ".tif"]))
def test_rubbish_is_no_terrain(tmp_path_factory: pytest.TempPathFactory, content: bytes, suffix: str) -> None:
    path: Path = tmp_path_factory.mktemp("rubbish") / f"site{suffix}"
    path.write_bytes(content)
    with pytest.raises(ElevationFileError):
        open_own_terrain(path)
