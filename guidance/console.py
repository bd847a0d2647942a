"""What commands do to the console: no encoding fails them, and what a user did wrong is one line."""

from __future__ import annotations

import codecs
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_HANDLER = "lunar-hda-console"
_STAND_INS = {"\u2026": "~"}
"""A cut-off mark of tables in one cell; all else becomes its escape, from which a name can be read."""


def _stand_in(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    character = error.object[error.start]
    if character in _STAND_INS:
        return _STAND_INS[character], error.start + 1
    return codecs.backslashreplace_errors(error)


def tolerate_encoding() -> None:
    """Let stdout and stderr write a stand-in for each character that their encoding lacks.

    The first line of every command. Handlers that the user chose (`PYTHONIOENCODING=ascii:replace`) stay.
    """
    codecs.register_error(_HANDLER, _stand_in)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors=_HANDLER)


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn a ValueError or OSError into one line on stderr and exit code 2."""
    try:
        yield
    except (ValueError, OSError) as error:
        from rich.console import Console

        line = f"error: {error}"
        Console(stderr=True).print(line, style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
