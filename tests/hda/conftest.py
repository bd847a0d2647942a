from pathlib import Path

import pytest

from hda.ground import library as dtm_library


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of terrain, with the kernels that are compiled already."""
    from guidance.kernel import cache_folder

    kernels = cache_folder() / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    place = tmp_path / "cache"
    place.mkdir()
    (place / "kernels").symlink_to(kernels.resolve(), target_is_directory=True)
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(place))
    dtm_library._open_or_build.cache_clear()
    dtm_library._verified.clear()
    return place
