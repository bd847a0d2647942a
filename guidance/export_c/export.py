"""The flight code, written into a folder of the user's."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from guidance.flight_code.vectors import draw_questions, edge_questions, write_table, wrong_questions

SOURCES = ("powered_descent.c", "powered_descent.h", "check_vectors.c", "Makefile", "README.md")
VECTORS = "vectors.csv"
_COUNT, _SEED = 400, 20240


def export_flight_code(out: Path, overwrite: bool = False) -> list[Path]:
    """Write the C sources, a program that checks them, its test vectors, a Makefile and a README.

    Args:
        out: folder; made where it is missing.
        overwrite: whether files that are there are replaced.

    Returns:
        What was written.

    Raises:
        FileExistsError: a file is there and must not be replaced; nothing is written then.
        OSError: the folder cannot be written.
    """
    texts = {name: (files("guidance.flight_code") / name).read_text(encoding="utf-8") for name in SOURCES}
    there = [name for name in (*SOURCES, VECTORS) if (out / name).exists()]
    if there and not overwrite:
        raise FileExistsError(f"{out} holds {', '.join(there)} already; --overwrite replaces them")
    drawn = draw_questions(_COUNT, np.random.default_rng(_SEED))
    texts[VECTORS] = write_table([*drawn, *edge_questions(), *wrong_questions()])
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in texts.items():
        (out / name).write_text(text, encoding="utf-8", newline="\n")
        written.append(out / name)
    return written
