"""Every episode of a study as one file: episodes.csv, and the same as Parquet."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path

from hda.flight.episode_row import ROW_COLUMNS, EpisodeRow
from studies.columns import file_number

_ROWS_AT_ONCE = 5000  # rows of a group of the Parquet file


def episode_line(row: EpisodeRow) -> str:
    """A row as it stands in episodes.csv, without the line's end; no name in it has a comma."""
    values = (getattr(row, name) for name in ROW_COLUMNS)
    return ",".join(file_number(value) if isinstance(value, float) else str(value) for value in values)


def write_episodes(folder: Path, rows: Iterable[EpisodeRow]) -> None:
    """Write rows as they come as episodes.csv and episodes.parquet; equal rows give equal CSV bytes."""
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {"str": pa.string(), "int": pa.int64(), "bool": pa.bool_(), "float": pa.float64()}
    schema = pa.schema([(name, kinds[EpisodeRow.__annotations__[name]]) for name in ROW_COLUMNS])
    with (
        (folder / "episodes.csv").open("w", newline="") as stream,
        parquet.ParquetWriter(folder / "episodes.parquet", schema) as tables,
    ):
        stream.write(",".join(ROW_COLUMNS) + "\n")
        remaining = iter(rows)
        while group := list(islice(remaining, _ROWS_AT_ONCE)):
            stream.writelines(f"{episode_line(row)}\n" for row in group)
            columns = {name: [getattr(row, name) for row in group] for name in ROW_COLUMNS}
            tables.write_table(pa.table(columns, schema=schema))
