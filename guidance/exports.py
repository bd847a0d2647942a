"""Lazy public names for a package: what a user does not touch is not imported (PEP 562)."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from types import ModuleType


def lazy_exports(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Make the ``__getattr__`` and ``__dir__`` of a package whose names live in submodules.

    Args:
        package: the package's ``__name__``.
        homes: public name -> module that defines it. A name that is itself a module maps to its own path.

    Returns:
        The two functions to bind as ``__getattr__`` and ``__dir__``.
    """

    def find(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module: ModuleType = importlib.import_module(homes[name])
        value = module if homes[name] == f"{package}.{name}" else getattr(module, name)
        importlib.import_module(package).__dict__[name] = value
        return value

    return find, lambda: sorted(homes)
