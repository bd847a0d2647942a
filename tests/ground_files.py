"""Elevation models as files, for the tests that read them."""

from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine

MOON = CRS.from_proj4("+proj=stere +lat_0=-85 +lon_0=30 +R=1737400 +units=m")


def write_geotiff(path: Path, heights: np.ndarray, side: float = 1.0, **options: Any) -> Path:
    """Write heights, whose row 0 is the south edge, the way a GeoTIFF stores them: north first."""
    profile: dict[str, Any] = {"crs": MOON, "transform": Affine(side, 0, 5000, 0, -side, 9000), **options}
    scale, unit = profile.pop("scale", None), profile.pop("unit", None)
    bands = profile.pop("count", 1)
    shape = {"height": heights.shape[0], "width": heights.shape[1], "count": bands, "dtype": heights.dtype}
    with rasterio.open(path, "w", driver="GTiff", **shape, **profile) as stream:
        for band in range(1, bands + 1):
            stream.write(heights[::-1], band)
        if scale is not None:
            stream.scales, stream.offsets = (scale[0],), (scale[1],)
        if unit is not None:
            stream.units = (unit,)
    return path
