"""Compiled inner loops: one place decides how numba is used.

Compiled code is kept per user, in a folder named after a hash of the sources of every package here: numba
itself looks only at the file that defines a kernel, and would go on with stale code after a change in another
that it calls. Where no folder can be written, or a later numba keeps its files in another way, the kernel is
compiled in memory. `LUNAR_HDA_CACHE` moves the folder. Never `fastmath`: it drops NaN checks, and changes
sums.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
import platformdirs
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., object])
_numba_config = cast("Any", config)  # numba names its settings at run time


def cache_folder() -> Path:
    """Where generated data and compiled code are kept for this user (`LUNAR_HDA_CACHE` overrides)."""
    override = os.environ.get("LUNAR_HDA_CACHE")
    return Path(override) if override else Path(platformdirs.user_cache_dir("lunar-hda", appauthor=False))


@cache
def source_hash() -> str:
    """Hash of every source file of the packages that hold kernels."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for package in ("guidance", "hda", "rl"):
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def kernel_folder() -> Path:
    """Where the compiled code of these sources is kept."""
    return cache_folder() / "kernels" / source_hash()


class _SignatureFiles:
    """A kernel's files of compiled code, each named after the types of its arguments.

    numba numbers them, so that two processes that compile a kernel for different types at the same time may
    give both the same number, and one of them later runs the other's code. This goes before numba's own
    class, of which it uses what numba does not publish.
    """

    def save(self: Any, key: Any, data: Any) -> None:
        """Keep the code of one signature: before the index names it, so that no reader misses it."""
        stem = self._index_name.removesuffix(".nbi")
        name = f"{stem}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)
        overloads = self._load_index()
        if overloads.get(key) != name:
            self._save_index({**overloads, key: name})


_UNPUBLISHED = ("_index_name", "_save_data", "_load_index", "_save_index")


def _name_files_by_signature(compiled: Any) -> None:
    """Make a kernel name its files after signatures; AttributeError or TypeError where numba has changed."""
    files = compiled._cache._cache_file
    for name in _UNPUBLISHED:
        getattr(files, name)
    files.__class__ = type("SignatureFiles", (_SignatureFiles, type(files)), {})


def compile_kernel(
    function: Function, *, parallel: bool = False, error_model: Literal["python", "numpy"] = "python"
) -> Function:
    """Compile a function on first call, without the GIL; cached on disk where that is possible.

    With numba's own switch `NUMBA_DISABLE_JIT=1` it stays Python, for a debugger or a count of covered lines.
    """
    if _numba_config.DISABLE_JIT:
        return function
    compiler = numba.njit(nogil=True, parallel=parallel, error_model=error_model)
    compiled = compiler(function)
    before = _numba_config.CACHE_DIR
    try:
        _numba_config.CACHE_DIR = str(kernel_folder())
        compiled.enable_caching()
        _name_files_by_signature(compiled)
    except (RuntimeError, OSError, AttributeError, TypeError):
        compiled = compiler(function)  # in memory: there is nowhere to write, or files might be mixed up
    finally:
        _numba_config.CACHE_DIR = before
    return cast("Function", compiled)


def compile_parallel_kernel(function: Function) -> Function:
    """Like `compile_kernel`, with `numba.prange` loops spread over the cores."""
    return compile_kernel(function, parallel=True)


def compile_vector_kernel(function: Function) -> Function:
    """Like `compile_kernel`, but a number over zero is infinite and no error, as in numpy.

    The test for a zero divisor keeps a loop off the vector units.
    """
    return compile_kernel(function, error_model="numpy")
