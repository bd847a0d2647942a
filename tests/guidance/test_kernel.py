"""Compiled code on the disk: two processes that compile a kernel for different types never mix its files."""

from pathlib import Path
from typing import Any, cast

import numba.core.caching
import numpy as np
import pytest

from guidance.kernel import compile_kernel, kernel_folder


def double(value):
    return value + value


def test_the_files_of_two_types_have_names_of_their_own_whatever_each_process_has_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(tmp_path))
    assert compile_kernel(double)(3) == 6
    (index,) = kernel_folder().rglob("*.nbi")
    index.unlink()  # as for a process that had looked before the first one wrote
    assert compile_kernel(double)(0.25) == 0.5
    assert len(list(kernel_folder().rglob("*.nbc"))) == 2
    assert compile_kernel(double)(np.ones(2)).tolist() == [2.0, 2.0]
    assert [compile_kernel(double)(value) for value in (3, 0.25)] == [6, 0.5]


def test_what_one_process_compiled_another_loads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(tmp_path))
    compile_kernel(double)(3)
    (file,) = kernel_folder().rglob("*.nbc")
    written = file.stat().st_mtime_ns
    again = cast("Any", compile_kernel(double))
    assert again(4) == 8
    assert sum(again.stats.cache_hits.values()) == 1
    assert file.stat().st_mtime_ns == written


@pytest.mark.parametrize("name", ["_load_index", "_save_data"])
def test_without_what_numba_does_not_publish_it_compiles_in_memory(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(tmp_path))
    monkeypatch.delattr(numba.core.caching.IndexDataCacheFile, name)
    assert compile_kernel(double)(3) == 6
    assert not list(tmp_path.rglob("*.nb?"))
